#!/usr/bin/env python3
"""Error of direct-light estimators at equal time, against long references.

    equal_time.py references SCENES OUT    renders the references that are missing (an hour on two cores)
    equal_time.py compare SCENES OUT [direct|path]

SCENES has a folder for each scene; OUT keeps references and pictures. `LUMIRIS` is the program, `SEEDS` how many pictures of
each estimator are averaged. Wants numpy and OpenEXR. Time is processor time of the process without loading the scene.
"""
import json, os, resource, subprocess, sys
import numpy as np
import OpenEXR

PROGRAM = os.environ.get("LUMIRIS", "lumiris")
SEEDS = int(os.environ.get("SEEDS", "2"))
SCENES = {
    "armadillo-env": ("armadillo-env/scene-v4.pbrt", "112x112"),
    "kitchen": ("kitchen/scene-v4.pbrt", "160x90"),
    "staircase2": ("staircase2/scene-v4.pbrt", "112x112"),
    "veach-mis": ("veach-mis/scene-v4.pbrt", "160x90"),
    "chess-set": ("chess-set/ChessSet-rgb.pbrt", "112x112"),
}
ESTIMATORS = {
    "mis": "--estimator mis",
    "mis, N = 4": "--estimator mis --samples 4",
    "mc": "--estimator mc",
    "ris": "--estimator ris",
    "ris, N = 2, M = 16": "--estimator ris --samples 2 --proposals 16",
    "ris, N = 4, M = 32": "--estimator ris --samples 4 --proposals 32",
}
LUMINANCE = np.array([0.212671, 0.715160, 0.072169])
REGION = 16


def processor_seconds(command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


def render(scenes, name, kind, out, options):
    file, resolution = SCENES[name]
    depth = ["--max-depth", "5"] if kind == "path" else []
    command = [PROGRAM, "render", os.path.join(scenes, file), "--integrator", kind, *depth, "--box-filter"]
    command += ["--resolution", resolution, "-q", "-o", out, "--aov", "variance", "--stats", out[:-4] + ".json"]
    return processor_seconds(command + options)


def read(path):
    channels = OpenEXR.File(path, separate_channels=True).channels()
    stack = lambda names: np.stack([np.asarray(channels[n].pixels, np.float64) for n in names], -1)
    return stack("RGB"), stack(["variance." + c for c in "RGB"])


def regions(image):
    h, w = image.shape[0] // REGION, image.shape[1] // REGION
    return image[: h * REGION, : w * REGION].reshape(h, REGION, w, REGION, 3).sum((1, 3))


def compare(scenes, out, kind):
    print("| scene | estimator | M | N | CPU s | MSE | relMSE | MSE at equal time | relMSE at equal time | largest z of regions |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for name in SCENES:
        reference, variance = read(os.path.join(out, f"{name}-{kind}.exr"))
        picture = os.path.join(out, "picture.exr")
        loading = render(scenes, name, kind, picture, ["--spp", "1"])
        base = None
        for label, options in ESTIMATORS.items():
            errors, seconds, largest = [], [], 0.0
            for seed in range(SEEDS):
                seconds.append(render(scenes, name, kind, picture, options.split() + ["--spp", "64", "--seed", str(seed)]))
                image, own = read(picture)
                d = ((image - reference) @ LUMINANCE) ** 2
                y = reference @ LUMINANCE
                # The reference's own variance is part of the difference.
                mse = d.mean() - (variance @ LUMINANCE**2).mean()
                errors.append((mse, (d / (y**2 + 0.01 * y.mean() ** 2)).mean()))
                spread = regions(own) + regions(variance)
                lit = spread > 1e-16
                largest = max(largest, np.abs(regions(image - reference)[lit] / np.sqrt(spread[lit])).max())
            mse, relative = np.mean(errors, 0)
            time = min(seconds) - loading
            base = base or (mse * time, relative * time)
            settings = json.load(open(picture[:-4] + ".json"))["settings"]
            m, n = settings.get("lumiris:proposals", ""), settings["lumiris:samples"]
            print(f"| {name} | {label} | {m} | {n} | {time:.2f} | {mse:.2e} | {relative:.2e} "
                  f"| {mse * time / base[0]:.2f} | {relative * time / base[1]:.2f} | {largest:.1f} |", flush=True)


def main():
    command, scenes, out = sys.argv[1:4]
    if command == "references":
        for kind in ["direct", "path"]:
            for name in SCENES:
                path = os.path.join(out, f"{name}-{kind}.exr")
                if not os.path.exists(path):
                    render(scenes, name, kind, path, ["--estimator", "mis", "--spp", "10240", "--seed", "1000"])
    else:
        compare(scenes, out, sys.argv[4] if len(sys.argv) > 4 else "direct")


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Error of direct-light estimators at equal time, against long references.

    equal_time.py best SCENES OUT [direct|path]    `ris` by the best number of samples of `mis`, without references
    equal_time.py references SCENES OUT    renders the references that are missing (an hour on two cores)
    equal_time.py compare SCENES OUT [direct|path]

SCENES has a folder for each scene; OUT keeps references and pictures. `LUMIRIS` is the program, `SEEDS` how many pictures of
each estimator are averaged. Wants numpy and OpenEXR. Time is processor time of the process without loading the scene.

`best`: the error is the variance between seeds, since the estimators have no bias; relMSE divides that of a pixel by the square
of the mean of all pictures. Estimators take turns in an order that moves on from seed to seed, one thread each, and times are
medians; ± is one standard error, by leaving out one seed after the other.
"""
import json, os, resource, subprocess, sys
from statistics import median
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
BEST_OF = {f"mis, N = {n}": f"--estimator mis --samples {n}" for n in [1, 2, 4, 8]}
JUDGED = {"ris, N = 4, M = 32": ESTIMATORS["ris, N = 4, M = 32"]}
LUMINANCE = np.array([0.212671, 0.715160, 0.072169])
REGION = 16


def processor_seconds(command):
    used = lambda: sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
    before = used()
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    return used() - before


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


def turns(scenes, out, kind, name):
    """Luminances (seed, pixel) and processor seconds of each estimator, loading left out."""
    methods = {"loading": "--spp 1"} | {k: v + " --spp 64" for k, v in (BEST_OF | JUDGED).items()}
    labels, picture = list(methods), os.path.join(out, "picture.exr")
    seconds, pictures = {label: [] for label in labels}, {label: [] for label in labels}
    for turn in range(SEEDS):
        for k in range(len(labels)):
            i = (k + turn) % len(labels)
            seed = ["--seed", str(1 + turn * len(labels) + i), "--threads", "1"]
            seconds[labels[i]].append(render(scenes, name, kind, picture, methods[labels[i]].split() + seed))
            pictures[labels[i]].append((read(picture)[0] @ LUMINANCE).ravel())
    loading = median(seconds.pop("loading"))
    pictures.pop("loading")
    return {k: np.array(v) for k, v in pictures.items()}, {k: median(v) - loading for k, v in seconds.items()}


def variances(pictures):
    """MSE and relMSE of each estimator: the variance between its pictures."""
    y = np.mean([p.mean(0) for p in pictures.values()], 0)
    scale = y**2 + 0.01 * y.mean() ** 2
    spread = {k: p.var(0, ddof=1) for k, p in pictures.items()}
    return {k: np.array([v.mean(), (v / scale).mean()]) for k, v in spread.items()}


def best(scenes, out, kind):
    print("| scene | estimator | CPU s | MSE | relMSE | MSE at equal time | relMSE at equal time |")
    print("|---|---|---|---|---|---|---|")
    for name in SCENES:
        pictures, seconds = turns(scenes, out, kind, name)
        cost = lambda of: {k: e * seconds[k] for k, e in variances(of).items()}
        costs, errors = cost(pictures), variances(pictures)
        chosen = [min(BEST_OF, key=lambda k: costs[k][error]) for error in range(2)]
        ratios = lambda c: {k: [v[e] / c[chosen[e]][e] for e in range(2)] for k, v in c.items()}
        without = [ratios(cost({k: np.delete(p, s, 0) for k, p in pictures.items()})) for s in range(SEEDS)]
        for label in pictures:
            left = np.array([w[label] for w in without])
            spread = np.sqrt((SEEDS - 1) * left.var(0))
            cells = [f"{r:.2f}" + (" (best)" if chosen[e] == label else f" ± {spread[e]:.2f}")
                     for e, r in enumerate(ratios(costs)[label])]
            print(f"| {name} | {label} | {seconds[label]:.2f} | {errors[label][0]:.2e} | {errors[label][1]:.2e} "
                  f"| {cells[0]} | {cells[1]} |", flush=True)


def main():
    command, scenes, out = sys.argv[1:4]
    if command == "references":
        for kind in ["direct", "path"]:
            for name in SCENES:
                path = os.path.join(out, f"{name}-{kind}.exr")
                if not os.path.exists(path):
                    render(scenes, name, kind, path, ["--estimator", "mis", "--spp", "10240", "--seed", "1000"])
    elif command == "best":
        best(scenes, out, sys.argv[4] if len(sys.argv) > 4 else "direct")
    else:
        compare(scenes, out, sys.argv[4] if len(sys.argv) > 4 else "direct")


if __name__ == "__main__":
    main()

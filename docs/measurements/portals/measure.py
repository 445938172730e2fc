#!/usr/bin/env python3
"""A room with a window, with and without a portal: measure.py FOLDER [SAMPLES]

Writes a sky and scenes into the folder, renders each with two seeds, and prints times and errors. Needs the Python packages
numpy and OpenEXR.
"""
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR

ROOM = """LookAt 0 1.5 -2.9  0 0.75 0  0 1 0
Camera "perspective" "float fov" 40
Film "rgb" "integer xresolution" 240 "integer yresolution" 160
Integrator "path" "integer maxdepth" 5
WorldBegin
AttributeBegin
Rotate -90 1 0 0
LightSource "infinite" {light}
AttributeEnd
Material "diffuse" "rgb reflectance" [ 0.72 0.68 0.62 ]
Shape "trianglemesh" "point3 P" [ -2 0 -3  2 0 -3  2 0 2  -2 0 2 ] "integer indices" [ 0 2 1 0 3 2 ]
Shape "trianglemesh" "point3 P" [ -2 2.6 -3  2 2.6 -3  2 2.6 2  -2 2.6 2 ] "integer indices" [ 0 1 2 0 2 3 ]
Shape "trianglemesh" "point3 P" [ -2 0 2  2 0 2  2 2.6 2  -2 2.6 2 ] "integer indices" [ 0 1 2 0 2 3 ]
Shape "trianglemesh" "point3 P" [ -2 0 -3  2 0 -3  2 2.6 -3  -2 2.6 -3 ] "integer indices" [ 0 2 1 0 3 2 ]
Shape "trianglemesh" "point3 P" [ 2 0 -3  2 0 2  2 2.6 2  2 2.6 -3 ] "integer indices" [ 0 1 2 0 2 3 ]
Shape "trianglemesh" "point3 P" [ -2 0 -3  -2 0 2  -2 2.6 2  -2 2.6 -3  -2 0.8 -0.8  -2 0.8 1  -2 2.2 1  -2 2.2 -0.8 ]
  "integer indices" [ 0 1 5 0 5 4  1 2 6 1 6 5  2 3 7 2 7 6  3 0 4 3 4 7 ]
Material "coateddiffuse" "rgb reflectance" [ 0.16 0.09 0.05 ] "float roughness" 0.05
Translate 0 0.55 0 Scale 1.1 0.04 0.7
Shape "trianglemesh" "point3 P" [ -1 -1 -1  1 -1 -1  1 1 -1  -1 1 -1  -1 -1 1  1 -1 1  1 1 1  -1 1 1 ]
  "integer indices" [ 0 2 1 0 3 2  4 5 6 4 6 7  0 1 5 0 5 4  3 7 6 3 6 2  0 4 7 0 7 3  1 2 6 1 6 5 ]
"""
PORTAL = '"point3 portal" [ -2 0.8 -0.8  -2 2.2 -0.8  -2 2.2 1  -2 0.8 1 ]'


def write_sky(path):
    """An equal-area map: clouds of one texel each, and a sun of nine that shines through the window (z is up)."""
    size = 256
    cloud = 0.3 + 0.7 * np.random.default_rng(3).random((size, size), dtype=np.float32)
    sky = np.stack([5 * cloud, 7 * cloud, 10 * cloud], -1)
    # The upper half-space is |x| + |y| < 1 of the map
    sky[126:129, 48:51] = [6e4, 5e4, 4e4]
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": sky.astype(np.float32)}).write(str(path))


def render(scene, options, seed, out):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(["lumiris", "render", scene, *options, "--seed", str(seed), "-q", "-o", out], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    channels = OpenEXR.File(str(out), separate_channels=True).channels()
    image = np.stack([channels[c].pixels.astype(np.float64) for c in "RGB"], -1)
    return image, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    folder, samples = Path(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else "64"
    folder.mkdir(parents=True, exist_ok=True)
    write_sky(folder / "sky.exr")
    print("| sky | settings | portal | mean | CPU time | MSE | relMSE | efficiency (relMSE) |\n|---|---|---|---|---|---|---|---|")
    for sky, light in [("even", '"rgb L" [ 9 10 11 ]'), ("clouds and sun", '"string filename" "sky.exr"')]:
        for what, options in [("`mis` 2", ["--estimator", "mis", "--samples", "2", "--path-reuse", "1"]), ("`auto`", [])]:
            first, reference = None, None
            for name, portal in [("no", ""), ("yes", PORTAL)]:
                scene = folder / f"{'even' if sky == 'even' else 'sun'}-{name}.pbrt"
                scene.write_text(ROOM.format(light=f"{light} {portal}"))
                runs = [render(scene, [*options, "--spp", samples], seed, folder / "image.exr") for seed in (1, 2)]
                (a, _), (b, _) = runs
                cpu = sum(seconds for _, seconds in runs) / 2
                # One reference for both, so that the errors are relative to the same
                if reference is None:
                    reference = render(folder / scene.name, ["--spp", "1024"], 9, folder / "reference.exr")[0]
                squares = (a - b) ** 2 / 2
                mse, rel = squares.mean(), (squares / (reference**2 + 0.01)).mean()
                first = first or rel * cpu
                mean = (a.mean() + b.mean()) / 2
                print(f"| {sky} | {what} | {name} | {mean:.4f} | {cpu:.1f} s | {mse:.3g} | {rel:.3g} | {first / (rel * cpu):.2f} |")


main()

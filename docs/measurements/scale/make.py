#!/usr/bin/env python3
"""Writes large scenes into a folder, and measures what they take.

make.py FOLDER              the scenes: 10 million triangles with and without normals and texture coordinates, ten
                            instances of them, a million instances of 100 triangles, a million objects, moving shapes and
                            moving instances, 2 million triangles as text and as lights
make.py FOLDER LUMIRIS [SCENE [OPTION...]]...
                            then the peak that `lumiris info` predicts and what `lumiris render` takes, of these scenes and
                            of others, each as one argument: "scenes/demo/gallery.pbrt --resolution 960x540 --spp 16"
"""
import json
import subprocess
import sys
from pathlib import Path

import numpy as np

HEAD = """LookAt 0 -1.6 0.9 0 0 0 0 0 1
Camera "perspective" "float fov" 40
Film "rgb" "integer xresolution" 320 "integer yresolution" 240
Sampler "halton" "integer pixelsamples" 4
Integrator "path" "integer maxdepth" 2
WorldBegin
LightSource "infinite" "rgb L" [0.5 0.6 0.8]
LightSource "distant" "point3 from" [1 1 2] "rgb L" [2 2 1.8]
Material "diffuse" "rgb reflectance" [0.5 0.5 0.5]
"""


def grid(n):
    """Positions and texture coordinates (n, n) of a wavy square, and the indices of its triangles."""
    u, v = np.meshgrid(np.linspace(0, 1, n, dtype=np.float32), np.linspace(0, 1, n, dtype=np.float32))
    noise = np.random.default_rng(1).standard_normal(u.shape)
    height = (0.02 * np.sin(40 * u) * np.cos(37 * v) + 0.0005 * noise).astype(np.float32)
    i = np.arange(n * n, dtype=np.int32).reshape(n, n)
    a, b, c, d = i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]
    halves = [np.stack(corners, -1).reshape(-1, 3) for corners in ((a, b, c), (a, c, d))]
    return u, v, height, np.concatenate(halves)


def write_ply(path, names, vertices, triangles):
    faces = np.zeros(len(triangles), dtype=[("n", "u1"), ("i", "<i4", 3)])
    faces["n"], faces["i"] = 3, triangles
    properties = "".join(f"property float {name}\n" for name in names)
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n{properties}"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path.write_bytes(header.encode() + np.ascontiguousarray(vertices, "<f4").tobytes() + faces.tobytes())


def write_scenes(folder):
    u, v, height, triangles = grid(2237)
    positions = np.stack([u - 0.5, v - 0.5, height], -1)
    slopes = [-np.gradient(height, axis=axis) * (len(height) - 1) for axis in (1, 0)]
    normals = np.stack([*slopes, np.ones_like(height)], -1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    every = np.concatenate([positions, normals, u[..., None], v[..., None]], -1).reshape(-1, 8)
    write_ply(folder / "full.ply", "x y z nx ny nz u v".split(), every, triangles)
    write_ply(folder / "bare.ply", "x y z".split(), every[:, :3], triangles)
    for name in ("full", "bare"):
        (folder / f"{name}.pbrt").write_text(f'{HEAD}Shape "plymesh" "string filename" "{name}.ply"\n')
    places = [
        f"AttributeBegin\nTranslate {(k % 4 - 1.5) * 0.4} {(k // 4 - 1) * 0.4} {0.05 * k}\nRotate {17 * k} 0 0 1\n"
        'Scale 0.4 0.4 1\nObjectInstance "m"\nAttributeEnd\n'
        for k in range(10)
    ]
    mesh = 'Shape "plymesh" "string filename" "full.ply"\n'
    (folder / "ten.pbrt").write_text(f'{HEAD}ObjectBegin "m"\n{mesh}ObjectEnd\n' + "".join(places))

    rng = np.random.default_rng(2)
    with open(folder / "million.pbrt", "w", encoding="ascii") as out:
        u, v, height, triangles = grid(8)
        out.write(f'{HEAD}ObjectBegin "m"\n{inline(np.stack([u - 0.5, v - 0.5, height], -1), triangles)}ObjectEnd\n')
        for x, y, z, angle in rng.uniform([-0.5, -0.5, 0, 0], [0.5, 0.5, 0.1, 360], (1_000_000, 4)):
            out.write(
                f"AttributeBegin\nTranslate {x:.5f} {y:.5f} {z:.5f}\nRotate {angle:.1f} 0 0 1\nScale .002 .002 .002\n"
                'ObjectInstance "m"\nAttributeEnd\n'
            )
    write_small(folder)
    u, v, height, triangles = grid(1001)
    text = inline(np.stack([u - 0.5, v - 0.5, height], -1), triangles)
    (folder / "text.pbrt").write_text(HEAD + text)
    (folder / "lights.pbrt").write_text(f'{HEAD}AreaLightSource "diffuse" "rgb L" [1 1 1]\n{text}')


def write_small(folder):
    """A million tetrahedra: each an object of its own, a shape that shifts, or an instance that turns by 10 degrees."""
    corners = "0 0 0  .002 0 0  0 .002 0  0 0 .002"
    shape = f'Shape "trianglemesh" "integer indices" [ 0 1 2 0 1 3 1 2 3 2 0 3 ] "point3 P" [ {corners} ]\n'
    moving = "ActiveTransform EndTime\n{}\nActiveTransform All\n"
    kinds = {
        "objects": ("", 'ObjectBegin "o{0}"\n' + shape + "ObjectEnd\n", "", 'ObjectInstance "o{0}"\n'),
        "shifts": ("", "", moving.format("Translate .01 0 0"), shape),
        "turns": (f'ObjectBegin "o"\n{shape}ObjectEnd\n', "", moving.format("Rotate 10 0 0 1"), 'ObjectInstance "o"\n'),
    }
    places = np.random.default_rng(3).uniform([-0.5, -0.5, 0], [0.5, 0.5, 0.1], (1_000_000, 3))
    for name, (first, before, motion, what) in kinds.items():
        with open(folder / f"{name}.pbrt", "w", encoding="ascii") as out:
            out.write(HEAD + first)
            for i, (x, y, z) in enumerate(places):
                place = f"AttributeBegin\n{motion}Translate {x:.5f} {y:.5f} {z:.5f}\n"
                out.write(f"{before.format(i)}{place}{what.format(i)}AttributeEnd\n")


def inline(positions, triangles):
    indices = " ".join(map(str, triangles.ravel()))
    points = " ".join(f"{x:.6f}" for x in positions.ravel())
    return f'Shape "trianglemesh" "integer indices" [ {indices} ] "point3 P" [ {points} ]\n'


def measure(lumiris, scene, options, folder):
    """Bytes that are predicted and taken, and seconds."""
    layers = "predicted_without_layers" if "--aov" in options else "predicted_with_all_layers"
    of_info = [o for i, o in enumerate(options) if o != "--aov" and (i == 0 or options[i - 1] != "--aov")]
    info = subprocess.run([lumiris, "info", scene, "--json", *of_info], capture_output=True, check=True)
    memory = json.loads(info.stdout)["memory"]
    command = ["/usr/bin/time", "-f", "%M %e", lumiris, "render", scene, "-q", "-o", f"{folder}/o.exr", *options]
    run = subprocess.run(command, capture_output=True, text=True, check=True)
    kilobytes, seconds = run.stderr.split()[-2:]
    return memory, memory[layers]["peak_bytes"], 1024 * int(kilobytes), float(seconds)


def main():
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / "lights.pbrt").exists():
        write_scenes(folder)
    if len(sys.argv) < 3:
        return
    scenes = [f"{folder}/{name}.pbrt" for name in ("bare", "full", "ten", "million", "objects", "shifts", "turns", "text", "lights")]
    print("| scene | geometry | Embree | predicted | peak | by | s |\n|---|---|---|---|---|---|---|")
    for row in [*scenes, *sys.argv[3:]]:
        scene, *options = row.split()
        memory, predicted, peak, seconds = measure(sys.argv[2], scene, options, folder)
        sizes = [memory["geometry_bytes"], memory["accel_bytes"], predicted, peak]
        cells = " | ".join(f"{size / 1e6:.0f} MB" for size in sizes)
        name = f"{Path(scene).parent.name}/{Path(scene).name} {' '.join(options)}"
        print(f"| {name} | {cells} | {predicted / peak - 1:+.1%} | {seconds:.1f} |", flush=True)


main()

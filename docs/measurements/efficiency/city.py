#!/usr/bin/env python3
"""city.py FOLDER LAMPS...: a city at night with these numbers of street lamps, seen from a street and from the air."""
import sys
from pathlib import Path

import numpy as np

BLOCK, STREET = 60.0, 14.0  # m
LAMPS_PER_BLOCK = 6
QUAD = np.array([[0, 1, 2], [0, 2, 3]])
COLORS = ["1800 1320 720", "1500 1500 1500", "1920 1200 480", "1200 1380 1800"]
HEAD = """LookAt {look}
Camera "perspective" "float fov" {fov}
Film "rgb" "integer xresolution" 240 "integer yresolution" 135
Sampler "zsobol" "integer pixelsamples" 16
Integrator "path" "integer maxdepth" 1
WorldBegin
Include "city-{lamps}.inc.pbrt"
"""


def mesh(points, indices):
    p = " ".join(f"{x:.4g}" for x in np.asarray(points).ravel())
    i = " ".join(map(str, np.asarray(indices).ravel()))
    return f'Shape "trianglemesh" "integer indices" [ {i} ] "point3 P" [ {p} ]\n'


def buildings(rng, blocks, pitch):
    """Four boxes to a block, without floors."""
    points, indices = [], []
    for bx, by in np.ndindex(blocks, blocks):
        corner = np.array([bx, by]) * pitch - blocks * pitch / 2 + STREET / 2
        for k in range(4):
            size = BLOCK / 2 - rng.uniform(1, 4, 2)
            x0, y0 = corner + np.array([k % 2, k // 2]) * BLOCK / 2 + 1
            x1, y1 = x0 + size[0], y0 + size[1]
            height, base = rng.uniform(8, 45), len(points)
            points += [[x, y, z] for z in (0, height) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]
            for face in ([0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7], [4, 5, 6, 7]):
                indices += [[base + face[a] for a in triangle] for triangle in QUAD]
    return mesh(points, indices)


def lamps_of(rng, count, blocks, pitch):
    """Squares 5 m above the streets, facing down, in a mesh for each of four colours."""
    groups = [[] for _ in COLORS]
    half = blocks * pitch / 2
    for i in range(count):
        (bx, by), k = divmod(i // LAMPS_PER_BLOCK, blocks), i % LAMPS_PER_BLOCK
        along, beside = (k // 2 + 0.5) * pitch / 3, -STREET / 4
        offset = [beside, along] if k % 2 else [along, beside]
        groups[rng.integers(4)].append([bx * pitch - half + offset[0], by * pitch - half + offset[1], 5.0])
    for color, centers in zip(COLORS, groups):
        points = [
            [x + dx, y + dy, z] for x, y, z in centers for dx, dy in ((-0.2, 0.2), (0.2, 0.2), (0.2, -0.2), (-0.2, -0.2))
        ]
        indices = [4 * i + QUAD for i in range(len(centers))]
        light = f'AreaLightSource "diffuse" "rgb L" [{color}]\n'
        yield f'AttributeBegin\nMaterial "diffuse" "rgb reflectance" [0 0 0]\n{light}{mesh(points, indices)}AttributeEnd\n'


def write(folder, count):
    rng = np.random.default_rng(7)
    pitch = BLOCK + STREET
    blocks = int(np.ceil(np.sqrt(count / LAMPS_PER_BLOCK)))
    side = blocks * pitch / 2 + 100
    ground = mesh([[-side, -side, 0], [side, -side, 0], [side, side, 0], [-side, side, 0]], QUAD)
    text = 'Material "diffuse" "rgb reflectance" [0.45 0.42 0.38]\n' + buildings(rng, blocks, pitch)
    text += 'Material "diffuse" "rgb reflectance" [0.2 0.2 0.21]\n' + ground
    text += "".join(lamps_of(rng, count, blocks, pitch))
    (folder / f"city-{count}.inc.pbrt").write_text(text)

    # The camera of the street stands in one
    x = -pitch / 2 if blocks % 2 else 0.0
    views = {"street": (f"{x} -20 1.7  {x + 0.5} 40 2.5  0 0 1", 65), "aerial": ("0 -160 110  0 0 0  0 0 1", 50)}
    for view, (look, fov) in views.items():
        (folder / f"{view}-{count}.pbrt").write_text(HEAD.format(look=look, fov=fov, lamps=count))


folder = Path(sys.argv[1])
folder.mkdir(exist_ok=True, parents=True)
for count in map(int, sys.argv[2:]):
    write(folder, count)

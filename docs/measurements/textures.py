#!/usr/bin/env python3
"""Measures the first run and later runs with many textures.

textures.py FOLDER N SIZE LUMIRIS [OPTION...]     writes N images of SIZE x SIZE (8-bit PNG) and a scene of N squares into
                                                  FOLDER, and renders it: without a folder for textures, with a new one,
                                                  and with the same twice more. Options go to every run
"""
import json
import os
import shutil
import struct
import subprocess
import sys
import time
import zlib
from pathlib import Path

import numpy as np


def png(pixels):
    """The file of an image, in two pieces between which other chunks fit."""
    left = np.concatenate([np.zeros_like(pixels[:, :1]), pixels[:, :-1]], 1)
    # Each byte less that of the pixel to the left: filter 1
    rows = np.concatenate([np.full((len(pixels), 1), 1, np.uint8), (pixels - left).reshape(len(pixels), -1)], 1)
    header = struct.pack(">IIBBBBB", pixels.shape[1], pixels.shape[0], 8, 2, 0, 0, 0)
    begin = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header)
    return begin, chunk(b"IDAT", zlib.compress(rows.tobytes(), 1)) + chunk(b"IEND", b"")


def chunk(name, content):
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))


def smooth_with_noise(seed, size):
    """As a photograph: smooth colours with fine noise."""
    rng = np.random.default_rng(seed)
    smooth = rng.integers(0, 240, (size // 64, size // 64, 3), np.uint8).repeat(64, 0).repeat(64, 1)
    return smooth + rng.integers(0, 4, (size, size, 3), np.uint8)


def write_scene(folder, count, size):
    """Images with some 1.3 bytes per pixel; each eighth has the same pixels in another file."""
    files = [png(smooth_with_noise(seed, size)) for seed in range(8)]
    edge = int(np.ceil(count**0.5))
    text = [
        f"LookAt 0 -{0.75 * edge} {0.6 * edge}  0 0 0  0 0 1\nCamera \"perspective\" \"float fov\" 50\n"
        'Film "rgb" "integer xresolution" 1920 "integer yresolution" 1080\nSampler "sobol" "integer pixelsamples" 4\n'
        'Integrator "path" "integer maxdepth" 2\nWorldBegin\nLightSource "infinite" "rgb L" [0.5 0.6 0.8]\n'
    ]
    for i in range(count):
        begin, end = files[i % len(files)]
        (folder / f"{i}.png").write_bytes(begin + chunk(b"tEXt", b"Comment\0" + str(i).encode()) + end)
        x, y = i % edge - edge / 2, i // edge - edge / 2
        text.append(
            f'Texture "t{i}" "spectrum" "imagemap" "string filename" "{i}.png"\n'
            f'Material "diffuse" "texture reflectance" "t{i}"\n'
            f'Shape "bilinearmesh" "point3 P" [{x} {y} 0 {x + 1} {y} 0 {x} {y + 1} 0 {x + 1} {y + 1} 0]\n'
        )
    scene = folder / f"{count}.pbrt"
    scene.write_text("".join(text))
    return scene


def run(lumiris, scene, options):
    """Prints a row: CPU time of loading and of the process; wall time; peak memory; tiles that were read. Returns the
    image."""
    image, stats = scene.with_suffix(f".{len(options)}.exr"), scene.with_suffix(".json")
    fixed = "--estimator mis --allocation uniform --path-reuse 1 --aov none -q".split()
    start = time.time()
    pid = os.fork()
    if pid == 0:
        os.execvp(lumiris, [lumiris, "render", str(scene), "-o", str(image), "--stats", str(stats), *fixed, *options])
    _, status, usage = os.wait4(pid, 0)
    wall = time.time() - start
    if status:
        sys.exit(f"{options} failed")
    stats = json.loads(stats.read_text())
    tiles = stats["memory"]["texture_tiles"]
    cells = [f"{stats['cpu_seconds']['load']:.2f} s", f"{usage.ru_utime + usage.ru_stime:.2f} s", f"{wall:.1f} s"]
    cells += [f"{usage.ru_maxrss / 1000:.0f} MB", str(tiles and tiles["tiles_read"])]
    print("|", " | ".join(cells), "|", flush=True)
    return str(image)


def main():
    folder, (count, size) = Path(sys.argv[1]), map(int, sys.argv[2:4])
    lumiris, options = sys.argv[4], sys.argv[5:]
    folder.mkdir(parents=True, exist_ok=True)
    scene, cache = write_scene(folder, count, size), folder / "cache"
    shutil.rmtree(cache, ignore_errors=True)
    whole = run(lumiris, scene, options)
    for _ in range(3):
        tiled = run(lumiris, scene, [*options, "--texture-cache", str(cache)])
    subprocess.run([lumiris, "compare", tiled, "--reference", whole], check=True)
    print(f"the folder takes {sum(file.stat().st_size for file in cache.iterdir()) / 1e6:.0f} MB")


if __name__ == "__main__":
    main()

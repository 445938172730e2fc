#!/usr/bin/env python3
"""Renders every scene of a folder small: a contact sheet, and a table of times, memory and of both ray tracers.

    survey.py FOLDER OUT --program lumiris [--environment SKY] [--pbrt PATTERN ...] [--exclude NAME ...]

FOLDER is searched for glTF files, which are framed and lit by the environment, but for folders that are excluded, and for the
given patterns of pbrt scenes. OUT
gets `table.md`, by rows of the sheet, and `sheet.png`. Needs the Python module `lumiris`.
"""

import argparse
import json
import pathlib
import re
import struct
import subprocess
import tempfile
import zlib

import lumiris
import numpy as np

EDGE = (128, 96)
COLUMNS = 8
SPP = 32


def run(command):
    """Output, standard error, and the peak size in bytes; None where the program failed."""
    done = subprocess.run(["/usr/bin/time", "-f", "peak %M", *command], capture_output=True, text=True)
    peak = re.findall(r"^peak (\d+)$", done.stderr, re.MULTILINE)
    return (done.stdout, done.stderr, int(peak[-1]) * 1024) if done.returncode == 0 and peak else None


def render(program, scene, options, folder):
    """A row of the table, and the picture."""
    stats, image, report = (folder / name for name in ("stats.json", "image.exr", "report.json"))
    size = ["--resolution", f"{EDGE[0]}x{EDGE[1]}"]
    command = [program, "render", scene, *options, *size, "--spp", str(SPP), "--aov", "none", "-q"]
    done = run([*command, "--stats", str(stats), "-o", str(image)])
    if done is None:
        return None
    seconds = json.loads(stats.read_text())["seconds"]
    samples = EDGE[0] * EDGE[1] * SPP
    command = [program, "crosscheck", scene, *options, *size, "--spp", "1", "--rays", "200000", "--json", str(report)]
    checked = subprocess.run(command, capture_output=True, text=True)
    verdict = checked.stdout.strip().splitlines()[-1] if checked.stdout.strip() else "failed"
    row = {
        "load": seconds["load"] + seconds["build"],
        "sample": seconds["render"] / samples * 1e6,
        "peak": done[2] / 1e6,
        "check": "agree" if checked.returncode == 0 else verdict.removeprefix("Embree and the BVH ").lower(),
    }
    return row, np.asarray(lumiris.read(str(image))["beauty"])[..., :3]


def shown(pixels):
    """A picture for a display: exposed to its 90th percentile, sRGB."""
    scale = np.percentile(pixels.max(-1), 90)
    x = np.clip(pixels * (0.8 / max(scale, 1e-6)), 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055).astype(np.float32)


def write_png(path, pixels):
    """Writes rows × columns × 3 numbers of 0 to 1 in 8 bits [PNG, ISO/IEC 15948]."""
    data = np.round(pixels * 255).astype(np.uint8)
    height, width, _ = data.shape
    rows = b"".join(b"\0" + row.tobytes() for row in data)

    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    content = [(b"IHDR", header), (b"IDAT", zlib.compress(rows, 9)), (b"IEND", b"")]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*entry) for entry in content))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--program", default="lumiris")
    parser.add_argument("--environment")
    parser.add_argument("--pbrt", nargs="*", default=[])
    parser.add_argument("--exclude", nargs="*", default=[])
    args = parser.parse_args()
    scenes = [(path, []) for pattern in args.pbrt for path in sorted(args.folder.glob(pattern))]
    light = ["--environment", args.environment] if args.environment else []
    gltf = sorted(p for p in args.folder.rglob("*") if p.suffix in (".gltf", ".glb") and not set(args.exclude) & set(p.parts))
    scenes += [(path, [*light, "--camera-auto"]) for path in gltf]

    tiles, rows = [], []
    with tempfile.TemporaryDirectory() as name:
        for path, options in scenes:
            found = render(args.program, str(path), options, pathlib.Path(name))
            label = path.relative_to(args.folder)
            place = f"{len(tiles) // COLUMNS + 1}.{len(tiles) % COLUMNS + 1}"
            if found is None:
                rows.append(f"| | {label} | not rendered | | | |")
                continue
            row, pixels = found
            tiles.append(shown(pixels))
            rows.append(
                f"| {place} | {label} | {row['load']:.2f} | {row['sample']:.2f} | {row['peak']:.0f} | {row['check']} |"
            )
            print(rows[-1], flush=True)
    tiles += [np.zeros_like(tiles[0])] * (-len(tiles) % COLUMNS)
    lines = [np.concatenate(tiles[i : i + COLUMNS], axis=1) for i in range(0, len(tiles), COLUMNS)]
    args.out.mkdir(parents=True, exist_ok=True)
    write_png(args.out / "sheet.png", np.concatenate(lines))
    head = "| place | scene | load (s) | µs/sample | peak (MB) | Embree and BVH |\n|---|---|---|---|---|---|"
    (args.out / "table.md").write_text("\n".join([head, *rows]) + "\n")


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""island.py LUMIRIS FOLDER INSTANCES...: cost of `lumiris generate island` with these numbers of instances, as a table.

A row: the generation, the import and the build, and an image of one sample per pixel (480 × 270, the camera above the
island); then the growth of the costs per sample from 1 to 9 samples. CPU seconds of both threads, peak of the resident
memory of the process, and the prediction of `lumiris info`.
"""
import json
import subprocess
import sys
from pathlib import Path


def run(command):
    """Runs a command. Returns its CPU seconds, its peak of memory in GB and its output."""
    command = ["/usr/bin/time", "-f", "%U %S %M", *map(str, command)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    user, system, kilobytes = done.stderr.splitlines()[-1].split()
    return float(user) + float(system), float(kilobytes) / 1e6, done.stdout


def row(lumiris, folder, count):
    """The row of the table for a number of instances."""
    scene, image, stats = folder / "island.pbrt", folder / "island.exr", folder / "stats.json"
    generated, _, _ = run([lumiris, "generate", "island", "--output", folder, "--instances", count])
    size = sum(file.stat().st_size for file in folder.rglob("*") if file.suffix in (".pbrt", ".ply", ".gz", ".png"))
    options = ["--resolution", "480x270", "--threads", 2, "--estimator", "mis"]
    info = json.loads(run([lumiris, "info", scene, "--json", *options, "--spp", 1])[2])
    predicted = next(v for k, v in info["memory"].items() if k.startswith("predicted"))["peak_bytes"] / 1e9

    # One sample, then nine
    phases, all_seconds, peaks = [], [], []
    for samples in (1, 9):
        render = [lumiris, "render", scene, "-o", image, "--stats", stats, "-q", "--spp", samples, *options]
        seconds, peak, _ = run(render)
        all_seconds.append(seconds)
        peaks.append(peak)
        phases.append(json.loads(stats.read_text())["cpu_seconds"])
    first, per_sample = phases[0], (all_seconds[1] - all_seconds[0]) / 8
    cells = [f"{generated:.1f}", f"{size / 1e6:.0f}", f"{first['load']:.1f}", f"{first['build']:.1f}"]
    cells += [f"{all_seconds[0]:.1f}", f"{per_sample:.2f}", f"{max(peaks):.2f}", f"{predicted:.2f}"]
    return cells


def main():
    lumiris, folder = sys.argv[1], Path(sys.argv[2])
    print("| instances | generated, CPU s | files, MB | import | build | first sample, process | per sample | GB | predicted |")
    print("|---|---|---|---|---|---|---|---|---|")
    for count in sys.argv[3:]:
        print(f"| {count} | " + " | ".join(row(lumiris, folder / count, int(count))) + " |", flush=True)


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Compares pictures with references region by region: regions.py REFERENCES PICTURES

For each NAME.exr of the folder REFERENCES, PICTURES has NAME.1.exr, NAME.2.exr, … of different seeds. A region is 16 x 16
pixels. It agrees if the mean over all seeds differs by at most 2 % of the reference or by 3 standard errors. The standard error
is that of the region's means among seeds, whatever the pixels have in common, or that of half of the regions if that is more,
since few seeds tell it badly; the reference is taken to be as noisy plus 0.5 %.
Needs the Python packages numpy and OpenEXR.
"""
import glob
import sys
from pathlib import Path

import numpy as np
import OpenEXR

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def rgb(path):
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    return np.stack([np.asarray(channels[c].pixels, dtype=np.float64) for c in "RGB"], -1)


def regions(values, size=16):
    h, w = values.shape[0] // size, values.shape[1] // size
    return values[: h * size, : w * size].reshape(h, size, w, size, -1).mean((1, 3))


def sigma(seeds, reference):
    """Standard error of the difference of the mean over seeds from the reference, by region."""
    error = seeds.std(0, ddof=1) / np.sqrt(len(seeds))
    relative = np.median(error / np.maximum(reference, 1e-4), (0, 1))
    return np.sqrt(2 * np.maximum(error, relative * reference) ** 2 + (0.005 * reference) ** 2)


print("| picture | mean, luminance | regions | RGB agrees | luminance agrees | RGB within 4 % or 3 σ | median, 95 % of luminance |")
print("|---|---|---|---|---|---|---|")
references, pictures = map(Path, sys.argv[1:])
for path in sorted(references.glob("*.exr")):
    seeds = np.stack([regions(rgb(p)) for p in sorted(glob.glob(f"{pictures}/{path.stem}.*.exr"))])
    x, y = seeds.mean(0), regions(rgb(path))
    error = sigma(seeds, y)
    agrees = lambda part: (np.abs(x - y) <= np.maximum(part * y, 3 * error)).all(-1).mean()
    lx, ly = x @ LUMINANCE, y @ LUMINANCE
    of_luminance = sigma((seeds @ LUMINANCE)[..., None], ly[..., None])[..., 0]
    difference = np.abs(lx - ly)
    luminance = (difference <= np.maximum(0.02 * ly, 3 * of_luminance)).mean()
    off = difference / np.maximum(ly, 1e-4)
    print(f"| {path.stem} | {lx.mean() / ly.mean():.4f} | {lx.size} | {agrees(0.02):.1%} | {luminance:.1%} | {agrees(0.04):.1%} "
          f"| {np.median(off):.2%}, {np.percentile(off, 95):.2%} |")

#!/usr/bin/env python3
"""Compares pictures region by region: regions.py PICTURE.exr REFERENCE.exr [PICTURE REFERENCE ...]

A region is 16 x 16 pixels. It agrees if the means differ by at most 2 % of the reference or by 3 standard errors, where
the picture's error comes from its variance channels, and the reference is taken to be as noisy plus 0.5 %.
Needs the Python packages numpy and OpenEXR.
"""
import sys

import numpy as np
import OpenEXR

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def read(path):
    channels = OpenEXR.File(path, separate_channels=True).channels()
    return {name: np.asarray(c.pixels, dtype=np.float64) for name, c in channels.items()}


def rgb(image, prefix=""):
    return np.stack([image[prefix + c] for c in "RGB"], -1)


def regions(values, size=16):
    h, w = values.shape[0] // size, values.shape[1] // size
    return values[: h * size, : w * size].reshape(h, size, w, size, -1).mean((1, 3))


print("| picture | mean, luminance | regions | RGB agrees | luminance agrees | RGB within 4 % or 3 σ | median, 95 % of luminance |")
print("|---|---|---|---|---|---|---|")
for picture, reference in zip(sys.argv[1::2], sys.argv[2::2]):
    ours, theirs = read(picture), rgb(read(reference))
    x, y = regions(rgb(ours)), regions(theirs)
    variance = regions(rgb(ours, "variance.")) / 256
    sigma = np.sqrt(2 * variance + (0.005 * y) ** 2)
    difference = np.abs(x - y)
    agrees = lambda part: (difference <= np.maximum(part * y, 3 * sigma)).all(-1).mean()
    lx, ly = x @ LUMINANCE, y @ LUMINANCE
    # The channels' errors are correlated, not independent: between the two sums, by a factor of 1.8 in variance.
    sl = np.sqrt((sigma**2) @ LUMINANCE**2 * 1.8)
    dl = np.abs(lx - ly)
    lum = (dl <= np.maximum(0.02 * ly, 3 * sl)).mean()
    off = dl / np.maximum(ly, 1e-4)
    name = picture.split("/")[-1].removesuffix(".exr")
    print(f"| {name} | {lx.mean() / ly.mean():.4f} | {lx.size} | {agrees(0.02):.1%} | {lum:.1%} | {agrees(0.04):.1%} "
          f"| {np.median(off):.2%}, {np.percentile(off, 95):.2%} |")

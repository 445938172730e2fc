"""Comparisons."""

from __future__ import annotations

import json
import pathlib
import subprocess

import numpy as np
import pytest

import lumiris
from conftest import SCENE


def test_numbers_are_those_of_the_program(program: str, tmp_path: pathlib.Path) -> None:
    image = lumiris.render(SCENE, spp=4, seed=1)
    reference = lumiris.render(SCENE, spp=64, seed=2)
    paths = [tmp_path / "image.exr", tmp_path / "reference.exr"]
    lumiris.write(paths[0], image)
    lumiris.write(paths[1], reference)
    command = [program, "compare", str(paths[0]), "--reference", str(paths[1]), "--json", "-"]
    told = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)["images"][0]
    for pair in ((image, reference), (paths[0], paths[1]), (image, str(paths[1]))):
        compared = lumiris.compare(*pair)
        assert compared.noise == "both" and compared.maps.keys() == {"flip", "hdrflip", "tvi", "z"}
        for key, value in compared.items():
            assert value == pytest.approx(told[key], rel=1e-12), key
        assert len(compared) == 17
        assert compared.maps["flip"].mean() == pytest.approx(compared["flip"], rel=1e-5)


def test_arrays_are_compared_by_the_formulas() -> None:
    rng = np.random.default_rng(7)
    x, r = rng.random((2, 16, 20, 3), dtype=np.float32)
    compared = lumiris.compare(x, r, epsilon=0.25, peak=2.0)
    d = (x.astype(float) - r) ** 2
    assert compared["mse"] == pytest.approx(d.mean())
    assert compared["relmse"] == pytest.approx((d / (r.astype(float) ** 2 + 0.25)).mean())
    assert compared["psnr"] == pytest.approx(10 * np.log10(4 / d.mean()))
    assert compared["z"] is None and compared.noise == "none" and "z" not in compared.maps
    grey = lumiris.compare(x[:, :, 0], r[:, :, :1], metrics=["mse"])
    assert grey["mse"] == pytest.approx(d[:, :, 0].mean()) and "flip" not in grey and not grey.maps


def test_crops_are_compared_where_both_have_pixels() -> None:
    whole = lumiris.render(SCENE, spp=2)
    crop = lumiris.render(SCENE, spp=2, crop=(0.25, 0.75, 0.5, 1.0))
    compared = lumiris.compare(crop, whole)
    assert compared["mse"] == 0.0 and compared.maps["flip"].shape == (15, 20)
    assert lumiris.compare(crop, whole, layer="albedo", metrics=["mse"])["mse"] == 0.0


def test_what_cannot_be_compared_is_an_error(tmp_path: pathlib.Path) -> None:
    zeros = np.zeros((4, 5, 3))
    with pytest.raises(ValueError, match="only images of one size"):
        lumiris.compare(zeros, np.zeros((4, 6, 3)))
    with pytest.raises(ValueError, match="no metric `ssim`; there are mse, rmse"):
        lumiris.compare(zeros, zeros, metrics=["ssim"])
    with pytest.raises(ValueError, match="no layer 'fog'"):
        lumiris.compare({"beauty": zeros}, zeros, layer="fog")
    with pytest.raises(ValueError, match="1, 3 or 4 channels"):
        lumiris.compare(np.zeros((4, 5, 2)), zeros)
    with pytest.raises(ValueError, match="ppd"):
        lumiris.compare(zeros, zeros, ppd=0.0)
    with pytest.raises(OSError, match="none.exr"):
        lumiris.compare(tmp_path / "none.exr", zeros)

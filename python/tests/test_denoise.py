"""Denoising."""

from __future__ import annotations

import os
import pathlib
import subprocess

import numpy as np
import pytest

import lumiris
from conftest import SCENE


@pytest.fixture
def library() -> str:
    """Path of Open Image Denoise."""
    path = os.environ.get("LUMIRIS_OIDN")
    if not path:
        pytest.skip("LUMIRIS_OIDN does not name Open Image Denoise")
    return path


def test_without_the_library_it_says_how_to_name_it(tmp_path: pathlib.Path) -> None:
    missing = tmp_path / "libOpenImageDenoise.so"
    with pytest.raises(RuntimeError, match="LUMIRIS_OIDN"):
        lumiris.denoise(np.zeros((4, 4, 3), np.float32), library=missing)


def test_wrong_shapes_are_refused() -> None:
    with pytest.raises(ValueError, match="image"):
        lumiris.denoise(np.zeros((4, 4, 2), np.float32))
    with pytest.raises(ValueError, match="albedo"):
        lumiris.denoise(np.zeros((4, 4, 3), np.float32), albedo=np.zeros((4, 5, 3), np.float32))


def test_noise_goes_and_the_image_stays(library: str) -> None:
    image = lumiris.render(SCENE, spp=4, resolution=(128, 96))
    reference = lumiris.render(SCENE, spp=1024, resolution=(128, 96), aov=[])["beauty"]
    before = image["beauty"].copy()
    denoised = lumiris.denoise(image)
    error = {name: np.mean((a - reference) ** 2) for name, a in (("noisy", before), ("denoised", denoised))}
    assert error["denoised"] < 0.25 * error["noisy"]
    assert np.array_equal(before, image["beauty"])
    by_colour = lumiris.denoise(image["beauty"], library=library)
    assert not np.array_equal(by_colour, denoised)


def test_the_program_has_the_same_bits(library: str, program: str, tmp_path: pathlib.Path) -> None:
    image = lumiris.render(SCENE, spp=4)
    lumiris.write(tmp_path / "a.exr", image)
    subprocess.run([program, "denoise", "a.exr", "-o", "b.exr", "-q"], cwd=tmp_path, check=True)
    assert np.array_equal(lumiris.read(tmp_path / "b.exr")["denoised"], lumiris.denoise(image))

"""Reading and writing."""

from __future__ import annotations

import pathlib

import numpy as np
import pytest

import lumiris
from conftest import SCENE


def test_what_is_written_is_read(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "a.exr"
    image = lumiris.render(SCENE, spp=2, crop=(0.25, 0.75, 0.5, 1.0))
    lumiris.write(path, image)
    again = lumiris.read(path)
    assert again.keys() == image.keys() and (again.origin, again.full_size) == ((10, 15), (40, 30))
    for name in image:
        assert np.array_equal(again[name], image[name]) and again.channels[name] == image.channels[name]
    for key, value in image.metadata.items():
        assert again.metadata[key] == value


def test_arrays_and_dicts_are_written_with_names_of_their_own(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "a.exr"
    colour = np.random.default_rng(1).normal(size=(3, 5, 3))
    layers = {"beauty": colour, "mask": np.eye(3, 5), "flow": np.ones((3, 5, 2))}
    lumiris.write(path, layers, {"lumiris:remark": "mine"})
    again = lumiris.read(path)
    assert again.channels == {
        "beauty": ("R", "G", "B"),
        "mask": ("mask",),
        "flow": ("flow.0", "flow.1"),
    }
    assert np.array_equal(again["beauty"], colour.astype(np.float32))
    assert np.array_equal(again["mask"][:, :, 0], np.eye(3, 5))
    assert again.metadata["lumiris:remark"] == "mine"
    # Any memory layout
    lumiris.write(path, colour[::-1, ::-1])
    assert np.array_equal(lumiris.read(path)["beauty"], colour[::-1, ::-1].astype(np.float32))


def test_files_that_cannot_be_read_or_written_are_errors(tmp_path: pathlib.Path) -> None:
    with pytest.raises(FileNotFoundError, match="none.exr"):
        lumiris.read(tmp_path / "none.exr")
    (tmp_path / "broken.exr").write_bytes(b"no image")
    with pytest.raises(OSError, match="broken.exr"):
        lumiris.read(tmp_path / "broken.exr")
    with pytest.raises(OSError, match="missing"):
        lumiris.write(tmp_path / "missing" / "a.exr", np.zeros((2, 2, 3)))
    with pytest.raises(ValueError, match="only EXR"):
        lumiris.write(tmp_path / "a.png", np.zeros((2, 2, 3)))
    with pytest.raises(ValueError, match="shape"):
        lumiris.write(tmp_path / "a.exr", {"beauty": np.zeros((2, 2, 3)), "other": np.zeros((3, 2))})
    with pytest.raises(ValueError, match="rows × columns × channels"):
        lumiris.write(tmp_path / "a.exr", np.zeros(3))
    with pytest.raises(ValueError, match="nothing"):
        lumiris.write(tmp_path / "a.exr", {})
    assert not (tmp_path / "a.exr").exists()

"""Parts of images, merging, and checkpoints."""

from __future__ import annotations

import pathlib
import subprocess
from typing import Any, Dict

import numpy as np
import pytest

import lumiris
from conftest import SCENE

OPTIONS: Dict[str, Any] = {"spp": 7, "estimator": "mis", "integrator": "path"}


def assert_same(image: lumiris.Layers, expected: lumiris.Layers) -> None:
    assert image.keys() == expected.keys()
    for name, layer in image.items():
        assert np.array_equal(layer.view(np.uint32), expected[name].view(np.uint32)), name
        assert image.channels[name] == expected.channels[name]
    assert (image.origin, image.full_size) == (expected.origin, expected.full_size)


@pytest.mark.parametrize("by", ["samples", "tiles"])
def test_merged_parts_have_the_bits_of_the_image_at_once(tmp_path: pathlib.Path, by: Any) -> None:
    whole = lumiris.render(SCENE, **OPTIONS)
    paths = [tmp_path / f"{i}.part" for i in (3, 1, 2)]
    for i, path in zip((3, 1, 2), paths):
        part = lumiris.render(SCENE, **OPTIONS, part=f"{i}/3" if i == 1 else (i, 3), part_by=by, part_file=path)
        assert part.complete and part["beauty"].shape == whole["beauty"].shape
    merged = lumiris.merge(paths)
    assert_same(merged, whole)
    assert merged.complete and merged.missing == () and merged.seconds > 0
    for key, value in whole.metadata.items():
        assert key == "lumiris:seconds" or merged.metadata[key] == value, key
    assert list(lumiris.merge(paths, aov=[])) == ["beauty"]

    with pytest.raises(ValueError, match="parts are missing"):
        lumiris.merge(paths[:2])
    with pytest.warns(lumiris.SceneWarning, match="missing"):
        some = lumiris.merge(paths[:2], allow_missing=True)
    assert not some.complete and len(some.missing) == 1


def test_parts_of_the_program_and_of_the_module_are_one_image(
    program: str, scene_file: pathlib.Path, tmp_path: pathlib.Path
) -> None:
    options = ["--spp=7", "--estimator=mis", "--integrator=path", "--box-filter", "--crop=0,0.5,0.25,1"]
    render = [program, "render", "--quiet", str(scene_file), *options]
    there: Dict[str, Any] = {**OPTIONS, "box_filter": True, "crop": (0, 0.5, 0.25, 1)}
    subprocess.run([*render, "--samples-to=3", "-o", str(tmp_path / "1.part")], check=True)
    lumiris.render(scene_file, **there, samples_from=3, part_file=tmp_path / "2.part")
    merged = lumiris.merge([tmp_path / "1.part", tmp_path / "2.part"])
    assert_same(merged, lumiris.render(scene_file, **there))
    exr = tmp_path / "merged.exr"
    subprocess.run([program, "merge", "-q", tmp_path / "2.part", tmp_path / "1.part", "-o", exr], check=True)
    assert_same(lumiris.read(exr), merged)


def test_a_checkpoint_goes_on_to_the_bits_of_the_uninterrupted_image(program: str, scene_file: pathlib.Path) -> None:
    film = scene_file.parent / "c.film"
    # Without settings: they are in the checkpoint
    begun = lumiris.render(
        scene_file, **{**OPTIONS, "spp": 64}, checkpoint=(film, 0.01), callback=lambda p: p.passes < 3, box_filter=True
    )
    assert not begun.complete and film.exists()
    resumed = lumiris.render(scene_file, resume=film)
    whole = lumiris.render(scene_file, **{**OPTIONS, "spp": 64}, box_filter=True)
    assert_same(resumed, whole)
    exr = scene_file.parent / "resumed.exr"
    subprocess.run([program, "render", "-q", str(scene_file), "--resume", film, "-o", exr], check=True)
    assert_same(lumiris.read(exr), whole)

    # The same call starts, resumes, and renders more samples
    again = scene_file.parent / "again.film"
    for _ in range(2):
        image = lumiris.render(scene_file, **OPTIONS, checkpoint=again, resume=again)
    assert_same(image, lumiris.render(scene_file, **OPTIONS))
    more = lumiris.render(scene_file, resume=again, spp=9)
    assert_same(more, lumiris.render(scene_file, **OPTIONS, samples_to=9))

    with pytest.raises(ValueError, match="seed: 3, not 0"):
        lumiris.render(scene_file, resume=film, seed=3)
    with pytest.raises(ValueError, match="the scene: its files are not the same"):
        lumiris.render(SCENE + "# another\n", resume=film)


def test_a_checkpoint_that_cannot_be_written_is_a_warning(tmp_path: pathlib.Path) -> None:
    with pytest.warns(lumiris.SceneWarning, match="the checkpoint .* cannot be written"):
        (tmp_path / "c.film.tmp").mkdir()
        lumiris.render(SCENE, spp=1, checkpoint=tmp_path / "c.film")


@pytest.mark.parametrize(
    "options, kind, text",
    [
        ({"part": (1, 2)}, ValueError, "part needs a part_file"),
        ({"part": (3, 2), "part_file": "a.part"}, ValueError, "1 <= i <= n"),
        ({"part": "a/b", "part_file": "a.part"}, ValueError, "such as '3/8'"),
        ({"part": (1, 8), "part_file": "a.part"}, ValueError, "7 samples per pixel cannot be 8 parts: divide with part_by"),
        ({"part": (1, 2), "part_by": "rows", "part_file": "a.part"}, ValueError, "samples or tiles"),
        ({"part": (1, 2), "samples_from": 1, "part_file": "a.part"}, ValueError, "beside samples_from and samples_to"),
        ({"part": (1, 2), "time": 1.0, "part_file": "a.part"}, ValueError, "limited by time"),
        ({"samples_from": 5, "samples_to": 5}, ValueError, "no samples from 5 to 5"),
        ({"samples_to": 3, "cryptomatte": "object"}, ValueError, "cryptomatte"),
        ({"part": (1, 2), "estimator": "ocv", "ocv": "progressive", "part_file": "a.part"}, ValueError, "part_by tiles"),
        ({"checkpoint": ("c.film", 0.0)}, ValueError, "positive number of seconds"),
        ({"resume": "none.film"}, FileNotFoundError, "none.film"),
        ({"checkpoint": "none/c.film"}, FileNotFoundError, "folder none does not exist"),
        ({"part": (1, 2), "part_file": "none/a.part"}, FileNotFoundError, "folder none does not exist"),
    ],
)
def test_what_cannot_be_divided_or_continued_is_said(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch, options: Dict[str, Any], kind: type, text: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(kind, match=text):
        lumiris.render(SCENE, **{**OPTIONS, "integrator": "direct", **options})
    assert list(tmp_path.iterdir()) == []


def test_a_read_only_file_is_refused_before_rendering(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "a.film"
    path.write_text("of yesterday")
    path.chmod(0o444)
    for options in ({"checkpoint": path}, {"part": (1, 2), "part_file": path}):
        with pytest.raises(PermissionError, match="a.film: is read-only"):
            lumiris.render("none.pbrt", **options)
    assert path.read_text() == "of yesterday"


def test_damaged_parts_are_said(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "a.part"
    lumiris.render(SCENE, spp=1, estimator="mis", part_file=path)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(ValueError, match="a.part is damaged: it is cut off"):
        lumiris.merge([path])
    path.write_bytes(b"something else")
    with pytest.raises(ValueError, match="neither a part of an image nor a checkpoint"):
        lumiris.merge([path])
    with pytest.raises(FileNotFoundError, match="none.part"):
        lumiris.merge([tmp_path / "none.part"])
    with pytest.raises(ValueError, match="no parts to merge"):
        lumiris.merge([])

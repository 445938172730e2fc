"""Rendering: results, settings, errors."""

from __future__ import annotations

import pathlib
import subprocess
from typing import Any, Dict, List

import numpy as np
import pytest

import lumiris
from conftest import SCENE

TINY: Dict[str, Any] = {"resolution": (4, 3), "spp": 1, "threads": 1}


def test_layers_are_float_arrays_of_the_memory_that_the_renderer_has_filled() -> None:
    image = lumiris.render(SCENE, spp=2)
    assert list(image) == ["beauty", "variance", "samples", "albedo", "normal", "depth", "material", "object"]
    for name, layer in image.items():
        assert layer.dtype == np.float32 and layer.shape[:2] == (30, 40), name
        assert layer.shape[2] == len(image.channels[name])
        assert layer.flags.c_contiguous and layer.flags.writeable
        # A view of an array whose memory belongs to an object that is not an array
        base = layer.base
        assert not layer.flags.owndata and isinstance(base, np.ndarray) and not base.flags.owndata
        assert base.base is not None and type(base.base).__name__ == "PySliceContainer"
    assert image.complete and image.seconds > 0 and image.full_size == (40, 30)
    assert image.metadata["lumiris:spp"] == "2"


def test_memory_outlives_the_result() -> None:
    layer = lumiris.render(SCENE, spp=1)["beauty"]
    copy = layer.copy()
    for seed in range(5):
        lumiris.render(SCENE, spp=1, seed=seed + 1)
    assert np.array_equal(layer, copy)


@pytest.mark.parametrize(
    "options",
    [
        {"spp": 5, "seed": 3, "estimator": "mis", "integrator": "path", "max_depth": 3},
        {"spp": 3, "estimator": "ris", "samples": 2, "proposals": 16, "crop": (0.25, 0.75, 0.5, 1.0), "aov": ["albedo"]},
        {"spp": 8, "estimator": "ocv", "ocv": "pixels", "sampler": "zsobol", "box_filter": True, "threads": 1},
        {"noise": 0.2, "spp": 64, "estimator": "mc", "resolution": (32, 32)},
        {"spp": 2, "integrator": "photon-map", "photons": 500, "estimator": "mc", "progressive": True, "accel": "bvh"},
    ],
)
def test_images_are_those_of_the_program_to_the_bit(
    program: str, scene_file: pathlib.Path, options: Dict[str, Any]
) -> None:
    words: List[str] = []
    for name, value in options.items():
        word = "--" + name.replace("_", "-")
        if isinstance(value, bool):
            words.append(word)
        elif isinstance(value, (list, tuple)):
            words.append(f"{word}={('x' if name == 'resolution' else ',').join(map(str, value))}")
        else:
            words.append(f"{word}={value}")
    path = scene_file.with_suffix(".exr")
    subprocess.run([program, "render", "--quiet", str(scene_file), "-o", str(path), *words], check=True)
    expected = lumiris.read(path)
    image = lumiris.render(scene_file, **options)
    assert image.keys() == expected.keys()
    for name, layer in image.items():
        assert np.array_equal(layer.view(np.uint32), expected[name].view(np.uint32)), name
        assert image.channels[name] == expected.channels[name]
    assert (image.origin, image.full_size) == (expected.origin, expected.full_size)
    for key, value in image.metadata.items():
        assert key == "lumiris:seconds" or expected.metadata[key] == value, key


def test_text_and_file_give_one_image(scene_file: pathlib.Path) -> None:
    (scene_file.parent / "floor.pbrt").write_text(SCENE[SCENE.index("Material") :])
    text = SCENE[: SCENE.index("Material")] + 'Include "floor.pbrt"'
    images = [
        lumiris.render(scene_file, spp=2),
        lumiris.render(str(scene_file), spp=2),
        lumiris.render(SCENE, spp=2),
        lumiris.render(text, folder=scene_file.parent, spp=2),
    ]
    for image in images[1:]:
        assert np.array_equal(image["beauty"], images[0]["beauty"])
    with pytest.raises(lumiris.SceneError, match="floor.pbrt"):
        lumiris.render(text, folder=scene_file.parent / "elsewhere", spp=2)


def test_every_name_that_a_setting_can_have_is_accepted_and_recorded() -> None:
    table = lumiris.settings()
    assert len(table) > 30
    recorded = 0
    for keyword, setting in table.items():
        for name in setting.names:
            options = {**TINY, "photons": 50, "estimator": "mc", "cache_samples": 8, keyword: name}
            if keyword == "proposals":
                options["estimator"] = "ris"
            if name in ("floor", "cut-off"):
                options[keyword] = f"{name}:0.5"
            metadata = lumiris.render(SCENE, **options).metadata
            recorded += metadata.get(f"lumiris:{setting.key}") == options[keyword]
    # Some are recorded as the choice made for `auto`, some apply to other estimators only
    assert recorded > 25


def test_none_leaves_a_setting_and_old_names_are_accepted() -> None:
    assert lumiris.render(SCENE, resolution=(4, 3), spp=None).metadata["lumiris:spp"] == "4"
    old = {"light_choice": "power"}
    assert lumiris.render(SCENE, **TINY, **old).metadata["lumiris:light_sampler"] == "power"  # type: ignore[arg-type]
    roulette = lumiris.render(SCENE, **TINY, integrator="path", max_depth=3, roulette_depth=False)
    assert roulette.metadata["lumiris:roulette_depth"] == "off"


@pytest.mark.parametrize(
    "options, kind, text",
    [
        ({"spp": 0}, ValueError, "spp: expected a whole number at least 1, but found `0`"),
        ({"spp": 1.5}, ValueError, "spp: expected a whole number"),
        ({"spp": {}}, TypeError, "spp: expected text, a number or a pair"),
        ({"estimator": "best"}, ValueError, "estimator: expected one of auto, mc, mis"),
        ({"estimater": "mis"}, TypeError, "did you mean 'estimator'"),
        ({"crop": (0, 2, 0, 1)}, ValueError, "crop"),
        ({"resolution": (0, 5)}, ValueError, "resolution"),
        ({"packet_width": 3}, ValueError, "packet_width"),
        ({"threads": 0}, ValueError, "threads"),
        ({"time": -1.0}, ValueError, "time"),
        ({"aov": ["fog"]}, ValueError, "fog"),
        ({"accel": "octree"}, ValueError, "accel"),
        ({"texture_memory": "much"}, ValueError, "texture_memory"),
        ({"cryptomatte": ["light"]}, ValueError, "cryptomatte: expected object or material, not `light`"),
        ({"noise": 0.1, "spp": 64, "estimator": "optimal-mis"}, ValueError, "noise needs the integrator direct or path"),
        ({"callback": 3}, TypeError, "not callable"),
    ],
)
def test_what_is_not_allowed_is_said(options: Dict[str, Any], kind: type, text: str) -> None:
    with pytest.raises(kind, match=text):
        lumiris.render(SCENE, **{**TINY, **options})


def test_errors_of_scenes_tell_their_place(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "wrong.pbrt"
    path.write_text(SCENE.replace("  Material", "Material").replace("Material", "  Materiel"))
    line = 1 + path.read_text().splitlines().index('  Materiel "diffuse" "rgb reflectance" [ 0.5 0.25 0.75 ]')
    with pytest.raises(lumiris.SceneError, match="did you mean `Material`") as caught:
        lumiris.render(path)
    error = caught.value
    assert (error.file, error.line, error.column) == (str(path), line, 3)
    assert error.message == "unknown directive `Materiel`"
    with pytest.raises(lumiris.SceneError) as caught:
        lumiris.render(tmp_path / "none.pbrt")
    assert (caught.value.file, caught.value.line) == (str(tmp_path / "none.pbrt"), None)
    with pytest.raises(lumiris.SceneError) as caught:
        lumiris.render(SCENE + "\nShape")
    assert caught.value.file == "<scene>"


def test_warnings_of_scenes_are_warnings() -> None:
    with pytest.warns(lumiris.SceneWarning, match="WorldEnd is not used"):
        lumiris.render(SCENE + "WorldEnd", **TINY)
    with pytest.warns(lumiris.SceneWarning, match="biased"):
        lumiris.render(SCENE, **TINY, estimator="contributing", noncontributing_samples=0)
    with pytest.warns(lumiris.SceneWarning, match="path_reuse=4 has no effect on this image"):
        lumiris.render(SCENE, **TINY, integrator="direct", path_reuse=4)


def test_light_groups_are_layers_that_add_up_to_the_image() -> None:
    scene = SCENE + 'LightSource "infinite" "rgb L" [2 3 1] "string lightgroup" "rim"'
    image = lumiris.render(scene, **TINY, estimator="mis")
    names = [name for name in image if name.startswith("light_")]
    assert sorted(names) == ["light_other", "light_rim"] and image["light_rim"].max() > 0
    assert np.allclose(image["light_other"] + image["light_rim"], image["beauty"], rtol=1e-5, atol=1e-7)
    assert not any(name.startswith("light_") for name in lumiris.render(scene, **TINY, estimator="mis", light_groups="none"))


def test_textures_beyond_a_limit_give_the_same_image(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lumiris.write(tmp_path / "noise.exr", np.random.default_rng(1).random((256, 256, 3), dtype=np.float32))
    scene = SCENE.replace(
        'Material "diffuse" "rgb reflectance" [ 0.5 0.25 0.75 ]',
        'Texture "noise" "spectrum" "imagemap" "string filename" "noise.exr"\n'
        'Material "diffuse" "texture reflectance" "noise"',
    )
    images = [
        lumiris.render(scene, folder=tmp_path, **TINY, texture_memory=limit)["beauty"] for limit in (None, 100_000, "1K")
    ]
    assert len({image.tobytes() for image in images}) == 1
    # The file holds only textures beyond the limit
    monkeypatch.setenv("TMPDIR", str(tmp_path / "nowhere"))
    lumiris.render(scene, folder=tmp_path, **TINY, texture_memory="1G")
    with pytest.raises(lumiris.SceneError, match="no temporary file"):
        lumiris.render(scene, folder=tmp_path, **TINY, texture_memory="1K")


def test_cryptomattes_are_those_of_the_program(scene_file: pathlib.Path, program: str) -> None:
    path = scene_file.with_suffix(".exr")
    options = ["--spp", "4", "--cryptomatte=object"]
    subprocess.run([program, "render", "--quiet", str(scene_file), "-o", str(path), *options], check=True)
    expected = lumiris.read(path)
    image = lumiris.render(scene_file, spp=4, cryptomatte=["object"])
    assert image.keys() == expected.keys()
    names = [name for name in image if name.startswith("CryptoObject")]
    assert len(names) == 3
    for name in names:
        assert np.array_equal(image[name].view(np.uint32), expected[name].view(np.uint32)), name
    # The floor and the sphere cover everything except the sky
    coverage = sum(image[name][:, :, 1::2].sum(axis=2) for name in names)
    assert np.all(coverage <= 1.0 + 1e-6) and np.mean(coverage > 0.99) > 0.5
    entries = {key: value for key, value in image.metadata.items() if key.startswith("cryptomatte/")}
    assert entries and all(expected.metadata[key] == value for key, value in entries.items())


def test_resolution_and_layers_may_be_texts_of_the_command_line() -> None:
    options: Dict[str, Any] = {"spp": 1, "estimator": "mis"}
    image = lumiris.render(SCENE, resolution="5x4", aov="albedo,depth", **options)
    same = lumiris.render(SCENE, resolution=(5, 4), aov=["albedo", "depth"], **options)
    assert image["beauty"].shape == (4, 5, 3) and set(image) == set(same)
    assert set(lumiris.render(SCENE, resolution="5x4", aov="none", **options)) == set(
        lumiris.render(SCENE, resolution="5x4", aov=[], **options)
    )
    with pytest.raises(ValueError, match="'WxH'"):
        lumiris.render(SCENE, resolution="5*4", **options)

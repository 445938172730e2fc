"""Fixtures of the tests."""

from __future__ import annotations

import os
import pathlib

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]

#: A floor of known colour with a sphere, under a constant sky and a point light.
SCENE = """
LookAt 0 -3 2  0 0 0  0 0 1
Camera "perspective" "float fov" [ 60 ]
Film "rgb" "integer xresolution" [ 40 ] "integer yresolution" [ 30 ]
Sampler "independent" "integer pixelsamples" [ 4 ]
Integrator "direct"
WorldBegin
LightSource "infinite" "rgb L" [ 2 2 2 ]
LightSource "point" "rgb I" [ 5 4 3 ] "point3 from" [ 1 -1 2 ]
Material "diffuse" "rgb reflectance" [ 0.5 0.25 0.75 ]
Shape "trianglemesh" "point3 P" [ -9 -9 0  9 -9 0  9 9 0  -9 9 0 ] "integer indices" [ 0 1 2 0 2 3 ]
Shape "sphere" "float radius" [ 0.7 ]
"""


@pytest.fixture
def scene_file(tmp_path: pathlib.Path) -> pathlib.Path:
    """The scene as a file."""
    path = tmp_path / "scene.pbrt"
    path.write_text(SCENE)
    return path


@pytest.fixture
def program() -> str:
    """The command-line program."""
    path = os.environ.get("LUMIRIS")
    if path is None:
        pytest.skip("LUMIRIS does not name the program to compare with")
    return str(pathlib.Path(path).resolve())

"""Lumiris, an offline CPU renderer, as a Python module.

>>> import lumiris
>>> image = lumiris.render("scene.pbrt", spp=64, estimator="mis")
>>> image["beauty"].shape
(400, 600, 3)

`render` returns layers as arrays, and `merge` merges parts of an image. `read` and `write` are for EXR and other files.
`compare` computes the metrics of `lumiris compare`, `denoise` uses Open Image Denoise, and `lumiris.estimators` has the
estimators themselves. `settings` lists all settings.
"""

from ._compare import Comparison, compare
from ._denoise import denoise
from ._image import Layers, read, write
from ._lumiris import Progress, SceneError, __version__
from ._render import Merged, Rendering, SceneWarning, Setting, merge, render, settings
from . import estimators

__all__ = [
    "Comparison",
    "Layers",
    "Merged",
    "Progress",
    "Rendering",
    "SceneError",
    "SceneWarning",
    "Setting",
    "__version__",
    "compare",
    "denoise",
    "estimators",
    "merge",
    "read",
    "render",
    "settings",
    "write",
]

"""Lumiris, an offline CPU renderer, as a Python module.

>>> import lumiris
>>> image = lumiris.render("scene.pbrt", spp=64, estimator="mis")
>>> image["beauty"].shape
(400, 600, 3)

`render` gives layers of arrays, `merge` those of parts that were rendered apart, `read` and `write` are for EXR and other files, `compare` has the metrics of
`lumiris compare`, `denoise` is Open Image Denoise, and `lumiris.estimators` are the estimators themselves. `settings` lists what can be set.
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

"""Denoising."""

from __future__ import annotations

import os
from typing import Mapping, Optional, Union

import numpy as np
from numpy.typing import ArrayLike

from . import _lumiris
from ._image import IMAGE, Array, Path, layer

#: Environment variable with the path of the library.
_LIBRARY = "LUMIRIS_OIDN"


def denoise(
    image: Union[ArrayLike, Mapping[str, ArrayLike]],
    *,
    albedo: Optional[ArrayLike] = None,
    normal: Optional[ArrayLike] = None,
    library: Optional[Path] = None,
    threads: Optional[int] = None,
) -> Array:
    """Denoises an image with Open Image Denoise 2, as `lumiris denoise`.

    Returns an array of rows × columns × 3; `image` is unchanged.
    `image` is an array, or layers such as the results of `render` and `read`, whose albedo and normal guide the
    denoising unless others are given. A normal without albedo is ignored. `library` is the path of the library, by
    default the value of the environment variable LUMIRIS_OIDN, or the system's library.

    >>> image["denoised"] = lumiris.denoise(image)

    Raises RuntimeError without the library, and ValueError if shapes differ.
    """
    if isinstance(image, Mapping):
        albedo = image.get("albedo") if albedo is None else albedo
        normal = image.get("normal") if normal is None else normal
        image = image[IMAGE]
    name = os.fspath(library or os.environ.get(_LIBRARY, "")) or None
    # The dynamic loader does not search the current folder for plain names
    if name is not None and os.path.isfile(name):
        name = os.path.abspath(name)

    def three(array: Optional[ArrayLike], what: str) -> Optional[Array]:
        return None if array is None else np.ascontiguousarray(layer(array, what)[:, :, :3])

    color = three(image, "image")
    assert color is not None
    return _lumiris.denoise(color, three(albedo, "albedo"), three(normal, "normal"), name, threads)[0]

"""Denoising."""

from __future__ import annotations

import os
from typing import Mapping, Optional, Union

import numpy as np
from numpy.typing import ArrayLike

from . import _lumiris
from ._image import IMAGE, Array, Path, layer

#: Environment variable of the library.
_LIBRARY = "LUMIRIS_OIDN"


def denoise(
    image: Union[ArrayLike, Mapping[str, ArrayLike]],
    *,
    albedo: Optional[ArrayLike] = None,
    normal: Optional[ArrayLike] = None,
    library: Optional[Path] = None,
    threads: Optional[int] = None,
) -> Array:
    """Denoises an image by Open Image Denoise 2, as `lumiris denoise`: rows × columns × 3, the image itself is kept.

    `image` is an array, or layers such as `render` and `read` give, whose albedo and normal guide the denoising if no
    others are given. A normal without albedo is not used. `library` is the library's file: by default that of the
    environment variable LUMIRIS_OIDN, or the system's.

    >>> image["denoised"] = lumiris.denoise(image)

    Raises RuntimeError without the library, and ValueError where shapes differ.
    """
    if isinstance(image, Mapping):
        albedo = image.get("albedo") if albedo is None else albedo
        normal = image.get("normal") if normal is None else normal
        image = image[IMAGE]
    name = os.fspath(library or os.environ.get(_LIBRARY, "")) or None
    # The dynamic loader does not look for mere names in the current folder
    if name is not None and os.path.isfile(name):
        name = os.path.abspath(name)

    def three(array: Optional[ArrayLike], what: str) -> Optional[Array]:
        return None if array is None else np.ascontiguousarray(layer(array, what)[:, :, :3])

    color = three(image, "image")
    assert color is not None
    return _lumiris.denoise(color, three(albedo, "albedo"), three(normal, "normal"), name, threads)[0]

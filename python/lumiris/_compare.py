"""Comparison of images."""

from __future__ import annotations

import os
from typing import Dict, Mapping, Optional, Sequence, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _lumiris
from ._image import IMAGE, Array, Layers, Path, layer as as_layer

#: Types accepted as images by `compare`.
Image = Union[Path, ArrayLike, Mapping[str, ArrayLike]]


class Comparison(Dict[str, Optional[float]]):
    """Metrics by their command-line names; None if a metric cannot be computed, such as `z` without variances."""

    #: Per-pixel values of `flip`, `hdrflip`, `tvi` and `z`; NaN for pixels that are not compared.
    maps: Dict[str, NDArray[np.float32]]
    #: The images that have variances: `both`, `image` or `none`.
    noise: str


def _colour(array: Array, name: str) -> Array:
    if array.shape[2] not in (1, 3, 4):
        raise ValueError(f"{name}: expected 1, 3 or 4 channels, but found {array.shape[2]}")
    # Grey has three equal channels; opacity is ignored
    return np.ascontiguousarray(np.repeat(array, 3, axis=2) if array.shape[2] == 1 else array[:, :, :3])


def _input(image: Image, name: str, layer: Optional[str]) -> Union[str, _lumiris.Pixels]:
    if isinstance(image, (str, os.PathLike)):
        return os.fspath(image)
    if not isinstance(image, Mapping):
        if layer is not None:
            raise ValueError(f"{name}: an array has no layer {layer!r}")
        return _colour(as_layer(image, name), name), None, None
    chosen = IMAGE if layer is None else layer
    if chosen not in image:
        raise ValueError(f"{name}: there is no layer {chosen!r}; there are {', '.join(image)}")
    variance = None
    if chosen == IMAGE and "variance" in image:
        found = as_layer(image["variance"], name)
        variance = _colour(found, name) if bool((found > 0).any()) else None
    place = None
    if isinstance(image, Layers) and image.full_size != (0, 0):
        place = (image.origin, image.full_size)
    return _colour(as_layer(image[chosen], name), name), variance, place


def compare(
    image: Image,
    reference: Image,
    *,
    metrics: Optional[Sequence[str]] = None,
    layer: Optional[str] = None,
    exposure: float = 0.0,
    epsilon: float = 0.01,
    peak: float = 1.0,
    luminance: float = 1.0,
    ppd: float = 67.0,
) -> Comparison:
    """Compares an image with its reference, by the metrics of `lumiris compare`.

    Both may be files, linear arrays (rows × columns × 1, 3 or 4, or rows × columns), or layers, whose variances are
    used by tests. If the images are crops of one image, their common pixels are compared. `metrics` selects metrics, by
    default all of `mse`, `rmse`, `relmse`, `nmse`, `psnr`, `flip`, `hdrflip`, `tvi`, `bias`, `z`. `layer` is compared
    instead of the image. The other parameters are as on the command line: `exposure` (stops) for `flip`, `epsilon` for
    `relmse`, `peak` for `psnr`, `luminance` (cd/m² of a pixel of value 1) for `tvi`, and `ppd` (pixels per degree) for
    both ꟻLIPs.

    Raises ValueError for images that cannot be compared, and OSError for files that cannot be read.
    """
    options: Dict[str, object] = {
        "metrics": None if metrics is None else list(metrics),
        "layer": layer,
        "exposure": exposure,
        "epsilon": epsilon,
        "peak": peak,
        "luminance": luminance,
        "ppd": ppd,
    }
    numbers, maps, noise = _lumiris.compare(_input(image, "image", layer), _input(reference, "reference", layer), options)
    comparison = Comparison(numbers)
    comparison.maps = dict(maps)
    comparison.noise = noise
    return comparison

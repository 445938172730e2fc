"""Layers of an image, and image files."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Dict, Iterable, List, Mapping, Optional, Tuple, Type, TypeVar, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _lumiris

if TYPE_CHECKING:
    from ._lumiris import Layer, Place

Array = NDArray[np.float32]
Path = Union[str, "os.PathLike[str]"]

#: Name of the layer with the channels R, G and B.
IMAGE = "beauty"
#: Default channel names by number of channels: the part after the dot.
_COMPONENTS = {3: ("R", "G", "B"), 4: ("R", "G", "B", "A")}

_Kind = TypeVar("_Kind", bound="Layers")


class Layers(Dict[str, Array]):
    """Layers of an image by name: linear float32 arrays, rows × columns × channels, from the top left.

    The image itself is `beauty`. Other layers are named by the part of their channels' names before the dot, such as
    `albedo`.
    """

    #: Names of the channels of each layer, as in files.
    channels: Dict[str, Tuple[str, ...]]
    #: Metadata of the file; for images by Lumiris, everything that the image depends on.
    metadata: Dict[str, str]
    #: Column and row of the first pixel inside the full image.
    origin: Tuple[int, int]
    #: Columns and rows of the full image, which contains this one.
    full_size: Tuple[int, int]

    def __init__(
        self,
        layers: Mapping[str, Array],
        *,
        channels: Optional[Mapping[str, Tuple[str, ...]]] = None,
        metadata: Optional[Mapping[str, str]] = None,
        origin: Tuple[int, int] = (0, 0),
        full_size: Tuple[int, int] = (0, 0),
    ) -> None:
        super().__init__(layers)
        self.channels = dict(channels or {})
        self.metadata = dict(metadata or {})
        self.origin = origin
        self.full_size = full_size

    @classmethod
    def _of(cls: Type[_Kind], layers: List[Layer], metadata: Iterable[Tuple[str, str]], place: Place) -> _Kind:
        origin, full = place
        return cls(
            {name: array for name, _, array in layers},
            channels={name: tuple(names) for name, names, _ in layers},
            metadata=dict(metadata),
            origin=(origin[0], origin[1]),
            full_size=(full[0], full[1]),
        )

    def __repr__(self) -> str:
        layers = ", ".join(f"{name!r}: {'×'.join(map(str, layer.shape))}" for name, layer in self.items())
        return f"<{type(self).__name__} {layers}>"


def layer(array: ArrayLike, name: str = "image") -> Array:
    """An array as rows × columns × channels; an array of two dimensions has one channel."""
    layer = np.asarray(array, dtype=np.float32)
    if layer.ndim == 2:
        layer = layer[:, :, np.newaxis]
    if layer.ndim != 3:
        raise ValueError(f"{name}: expected rows × columns × channels, but found an array of shape {layer.shape}")
    return np.ascontiguousarray(layer)


def _channels(name: str, count: int) -> Tuple[str, ...]:
    if count == 1 and name != IMAGE:
        return (name,)
    components = _COMPONENTS.get(count, tuple(map(str, range(count))))
    if name == IMAGE:
        return ("Y",) if count == 1 else components
    return tuple(f"{name}.{component}" for component in components)


def read(path: Path, *, part: int = 0) -> Layers:
    """Reads an image that OpenImageIO can read: EXR, HDR, PFM, PNG, TIFF …

    Values are linear; integers of 8 and 16 bits are decoded with the sRGB curve. `part` is the index of a part, from 0,
    in an EXR file of several parts. Raises FileNotFoundError and OSError.
    """
    layers, metadata, place = _lumiris.read(os.fspath(path), part)
    return Layers._of(layers, metadata.items(), place)


def write(
    path: Path, layers: Union[ArrayLike, Mapping[str, ArrayLike]], metadata: Optional[Mapping[str, str]] = None
) -> None:
    """Writes an array, or layers, to an EXR file of 32-bit floats.

    For `Layers`, the names of channels, the position in the full image and the metadata are written, too; `metadata`
    replaces the latter. The file appears under its name only when it is complete. Raises OSError.
    """
    if not os.fspath(path).lower().endswith(".exr"):
        raise ValueError(f"{os.fspath(path)}: only EXR files hold layers of floats")
    given: Mapping[str, ArrayLike] = layers if isinstance(layers, Mapping) else {IMAGE: layers}
    known: Mapping[str, Tuple[str, ...]] = given.channels if isinstance(given, Layers) else {}
    place = None
    if isinstance(given, Layers):
        metadata = given.metadata if metadata is None else metadata
        place = (given.origin, given.full_size) if given.full_size != (0, 0) else None
    arrays = [(name, layer(array, name)) for name, array in given.items()]
    _lumiris.write(
        os.fspath(path),
        [(list(known.get(name, _channels(name, array.shape[2]))), array) for name, array in arrays],
        list((metadata or {}).items()),
        place,
    )

"""Rendering."""

from __future__ import annotations

import difflib
import numbers
import os
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Callable, Dict, Iterable, List, Literal, Mapping, Optional, Sequence, Tuple, Union

from . import _lumiris
from ._image import Layers, Path

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._settings import Settings

#: Name of a scene given as text.
_TEXT = "<scene>"
#: Default time between checkpoints (s).
_CHECKPOINT_SECONDS = 60.0


class SceneWarning(UserWarning):
    """The scene is used, but not as its author may expect."""


@dataclass(frozen=True)
class Setting:
    """A setting of an image: a keyword of `render`, and an option of the command line with `-` in place of `_`."""

    #: Its heading in the table.
    group: str
    #: Help text.
    help: str
    #: The default as text.
    default: str
    #: The allowed values as text.
    values: str
    #: The names among the allowed values.
    names: Tuple[str, ...]
    #: The name in metadata.
    key: str
    #: Former keywords, which are still accepted.
    aliases: Tuple[str, ...]


def settings() -> Dict[str, Setting]:
    """All settings by keyword."""
    return {
        name: Setting(
            group=row["group"],
            help=row["help"],
            default=row["default"],
            values=row["values"],
            names=tuple(row["names"]),
            key=row["key"],
            aliases=tuple(row["aliases"]),
        )
        for name, row in _lumiris.settings().items()
    }


class Merged(Layers):
    """An image merged from parts: its layers, and the missing parts."""

    #: Messages about missing parts; empty unless missing parts were allowed.
    missing: Tuple[str, ...]
    #: True if no sample is missing.
    complete: bool
    #: Total time of all parts (s).
    seconds: float


class Rendering(Layers):
    """A rendered image: its layers, and data on its rendering."""

    #: True if every pixel has all of its samples.
    complete: bool
    #: Wall-clock time of the rendering without loading (s).
    seconds: float


def _text(name: str, value: object) -> str:
    """A value as on the command line."""
    if isinstance(value, bool):
        return "True" if value else "off"
    if isinstance(value, str):
        return value
    if isinstance(value, numbers.Real):
        return str(value)
    if isinstance(value, (tuple, list)) and all(isinstance(v, numbers.Real) for v in value):
        return ",".join(map(str, value))
    raise TypeError(f"{name}: expected text, a number or a pair of numbers, but found {type(value).__name__}")


def _texts(given: Mapping[str, object]) -> List[Tuple[str, str]]:
    known = _lumiris.settings()
    names = set(known).union(*(row["aliases"] for row in known.values()))
    for name in given:
        if name not in names:
            near = difflib.get_close_matches(name, names, n=1)
            hint = f": did you mean {near[0]!r}?" if near else ""
            raise TypeError(f"render() has no keyword {name!r}{hint}")
    return [(name, _text(name, value)) for name, value in given.items() if value is not None]


def _source(scene: Path, folder: Optional[Path]) -> Union[str, Tuple[str, str, str]]:
    is_text = isinstance(scene, str) and (folder is not None or "\n" in scene or '"' in scene)
    if not is_text:
        if folder is not None:
            raise TypeError("folder: only for scenes that are given as text")
        return os.fspath(scene)
    return os.fspath(scene), _TEXT, os.fspath(folder or "")


def _part(part: Union[None, str, Tuple[int, int]]) -> Optional[Tuple[int, int]]:
    if part is None:
        return None
    words = part.split("/") if isinstance(part, str) else [str(number) for number in part]
    try:
        index, count = map(int, words)
    except ValueError as error:
        raise ValueError(f"part: expected (i, n) or 'i/n', such as '3/8', not {part!r}") from error
    if not 1 <= index <= count < 2**32:
        raise ValueError(f"part: expected 1 <= i <= n, not {part!r}")
    return index, count


def _resolution(resolution: Union[None, str, Tuple[int, int]]) -> Optional[Tuple[int, int]]:
    if not isinstance(resolution, str):
        return resolution
    try:
        width, height = map(int, resolution.split("x"))
    except ValueError as error:
        raise ValueError(f"resolution: expected (width, height) or 'WxH', not {resolution!r}") from error
    return width, height


def _aov(aov: Union[None, str, Sequence[str]]) -> Optional[List[str]]:
    if isinstance(aov, str):
        return [] if aov == "none" else aov.split(",")
    return None if aov is None else list(aov)


def _checkpoint(checkpoint: Union[None, Path, Tuple[Path, float]]) -> Optional[Tuple[str, float]]:
    if checkpoint is None:
        return None
    path, seconds = checkpoint if isinstance(checkpoint, tuple) else (checkpoint, _CHECKPOINT_SECONDS)
    return os.fspath(path), seconds


def render(
    scene: Path,
    *,
    folder: Optional[Path] = None,
    callback: Optional[Callable[[_lumiris.Progress], object]] = None,
    interval: float = 0.1,
    resolution: Union[None, str, Tuple[int, int]] = None,
    crop: Optional[Tuple[float, float, float, float]] = None,
    box_filter: bool = False,
    accel: str = "embree",
    packet_width: Optional[int] = None,
    threads: Optional[int] = None,
    tile_size: int = 16,
    time: Optional[float] = None,
    environment: Optional[Path] = None,
    scene_in_file: Union[None, int, str] = None,
    camera: Union[None, int, str] = None,
    camera_auto: bool = False,
    light_units: Optional[Literal["watt", "candela"]] = None,
    time_in_scene: Optional[float] = None,
    texture_memory: Union[None, int, str] = None,
    texture_cache: Optional[Path] = None,
    aov: Union[None, str, Sequence[str]] = None,
    cryptomatte: Sequence[str] = (),
    part: Union[None, str, Tuple[int, int]] = None,
    part_by: Literal["samples", "tiles"] = "samples",
    samples_from: Optional[int] = None,
    samples_to: Optional[int] = None,
    part_file: Optional[Path] = None,
    checkpoint: Union[None, Path, Tuple[Path, float]] = None,
    resume: Optional[Path] = None,
    **settings: Unpack[Settings],
) -> Rendering:
    """Renders a scene. The image is bit-identical to `lumiris render` with the same options.

    The arrays of the result own the memory of the renderer: nothing is copied.

    Parameters
    ----------
    scene
        A file (.pbrt, .pbrt.gz, .gltf, .glb), or the text of a pbrt file. A str is text if it has a line break or a
        quotation mark, or if `folder` is given.
    folder
        Folder of the files named in the text, by default the working folder.
    callback
        Called with a `Progress`: after every pass over the whole image, while the rendering waits (`is_pass`), and
        about every `interval` seconds within a pass, while the rendering continues. `progress.image()` and
        `progress.layers()` return the current image. Returning False ends the rendering; the result is the image so
        far. An exception ends the rendering and is raised. The callback runs in the thread that calls `render`.
    interval
        Time between calls within a pass (s).
    resolution, crop, box_filter, accel, packet_width, threads, tile_size, time
        As on the command line: columns and rows, or text such as "640x360"; x0, x1, y0, y1 in fractions of the image;
        use a pixel filter of one pixel; `embree` or `bvh`; rays per packet; threads; edge of a tile (pixels); time
        limit (s).
    environment, scene_in_file, camera, camera_auto, light_units, time_in_scene
        Options of glTF scenes: environment map; scene and camera, by name or index; use an automatic camera; units of
        punctual lights, whose candela and lux are divided by 683 lm/W (`watt`, the default) or taken as they are
        (`candela`); time of the animations (s).
    aov
        Additional layers: `variance`, `samples`, `albedo`, `normal`, `depth`, `material`, `object`, `ratio`, `records`.
        None requests all available layers; "none" or an empty list saves their time.
    texture_memory
        Memory limit for textures: a number of bytes, or a text such as `2G`. The rest is read by tiles from a temporary
        file. The image is bit-identical.
    texture_cache
        Folder for textures that later renderings read by tiles, at once. The image is bit-identical.
    cryptomatte
        Cryptomatte layers of ids and coverage: `object`, `material`, or both. The names of the ids are in the metadata.
        Compositing programs can read the layers from files by `lumiris.write`.
    part, part_by
        Render the i-th of n parts of the image, `(i, n)` or `"i/n"`: a share of the samples of every pixel, or of the
        tiles.
    samples_from, samples_to
        Index of the first sample of every pixel, and the index after the last one.
    part_file
        File for the exact sums of the rendering, for `lumiris.merge` and `lumiris merge`. Required with `part`.
    checkpoint
        File for the state needed to resume, or `(file, seconds)`. It is stored at this interval (60 s by default) and
        at the end, also after Ctrl-C. If it cannot be written, the rendering continues with a warning.
    resume
        Resume from a checkpoint or an unfinished part, with its settings; `spp` may ask for more samples. If the file
        is `checkpoint` and does not exist yet, the rendering starts from the beginning. The image is bit-identical to
        an uninterrupted rendering.
    settings
        The settings of the image, by their command-line names with `_` instead of `-`; see `lumiris.settings()`. Values
        are texts as on the command line, numbers, or pairs of numbers. None leaves a setting to the scene, True is the
        same as an option without a value, and False is `off`.

    Raises
    ------
    SceneError
        The scene cannot be loaded. The exception has file, line and column of the first error; its text has all errors.
    TypeError, ValueError
        An unknown keyword; a value that is not allowed; a checkpoint that is damaged, or belongs to another scene or
        other settings.
    OSError
        The file of `resume` or `part_file` cannot be read or written, or the folder of `checkpoint` or `part_file` is
        missing.
    KeyboardInterrupt
        Ctrl-C: the rendering ends after the current tiles.

    Warnings about the scene are issued as `SceneWarning`. Other Python threads run meanwhile.
    """
    options: Dict[str, object] = {
        "source": _source(scene, folder),
        "resolution": _resolution(resolution),
        "crop": crop,
        "box_filter": box_filter,
        "accel": accel,
        "packet_width": packet_width,
        "threads": threads,
        "tile_size": tile_size,
        "time": time,
        "environment": None if environment is None else os.fspath(environment),
        "scene_in_file": None if scene_in_file is None else str(scene_in_file),
        "camera": None if camera is None else str(camera),
        "camera_auto": camera_auto,
        "light_units": light_units,
        "time_in_scene": time_in_scene,
        "texture_memory": None if texture_memory is None else str(texture_memory),
        "texture_cache": None if texture_cache is None else os.fspath(texture_cache),
        "cryptomatte": [cryptomatte] if isinstance(cryptomatte, str) else list(cryptomatte),
        "aov": _aov(aov),
        "interval": interval,
        "settings": _texts(settings),
        "parts": {
            "part": _part(part),
            "part_by": part_by,
            "samples_from": samples_from,
            "samples_to": samples_to,
            "part_file": None if part_file is None else os.fspath(part_file),
            "checkpoint": _checkpoint(checkpoint),
            "resume": None if resume is None else os.fspath(resume),
        },
    }
    layers, metadata, place, complete, seconds, remarks = _lumiris.render(options, callback)
    for remark in remarks:
        warnings.warn(remark.strip(), SceneWarning, stacklevel=2)
    rendering = Rendering._of(layers, metadata, place)
    rendering.complete = complete
    rendering.seconds = seconds
    return rendering


def merge(
    parts: Iterable[Path], *, allow_missing: bool = False, aov: Union[None, str, Sequence[str]] = None
) -> Merged:
    """Merges parts of an image, in any order. The result is bit-identical to the image rendered at once.

    `parts` are files stored by `render` (`part_file`) or `lumiris render --part`; finished checkpoints are parts, too.
    `aov` selects layers, as for `render`, by default the layers for which the parts were rendered. If parts are
    missing, `allow_missing` merges the existing parts, with a `SceneWarning`. Raises ValueError for parts that are
    missing, repeated, damaged or of another image, and OSError for files that cannot be read.
    """
    paths = [os.fspath(part) for part in parts]
    layers, metadata, place, missing, seconds = _lumiris.merge(paths, allow_missing, _aov(aov))
    for what in missing:
        warnings.warn(f"{what}: missing", SceneWarning, stacklevel=2)
    merged = Merged._of(layers, metadata, place)
    merged.missing = tuple(missing)
    merged.complete = not missing
    merged.seconds = seconds
    return merged

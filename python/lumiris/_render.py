"""Rendering."""

from __future__ import annotations

import difflib
import json
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

#: Name of a scene that is given as text.
_TEXT = "<scene>"
#: Time between checkpoints (s).
_CHECKPOINT_SECONDS = 60.0


class SceneWarning(UserWarning):
    """The scene is used, but not as its author may expect."""


@dataclass(frozen=True)
class Setting:
    """A setting of an image: a keyword of `render`, and an option of the command line with `-` in place of `_`."""

    #: The heading that it stands under.
    group: str
    #: What it does.
    help: str
    #: The default in words.
    default: str
    #: The values that it can have, in words.
    values: str
    #: The names among these values.
    names: Tuple[str, ...]
    #: The name in metadata and plans.
    key: str
    #: Keywords that it had before, which are still accepted.
    aliases: Tuple[str, ...]


def settings() -> Dict[str, Setting]:
    """All settings by their keywords."""
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
    """An image of parts: its layers, and what is missing."""

    #: What is missing, in words; none unless that was allowed.
    missing: Tuple[str, ...]
    #: True if no sample is missing.
    complete: bool
    #: Time that all parts took together (s).
    seconds: float


class Rendering(Layers):
    """A rendered image: its layers, and how it came about."""

    #: What was chosen by measurements, by names in metadata: with this as `plan`, the image is the same to the bit.
    plan: Dict[str, str]
    #: True if every pixel has all its samples.
    complete: bool
    #: Wall-clock time of the rendering, without that of loading (s).
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


def _plan(plan: Union[None, Path, Mapping[str, str]]) -> List[Tuple[str, str]]:
    if plan is None:
        return []
    if isinstance(plan, Mapping):
        return list(plan.items())
    with open(plan, encoding="utf-8") as file:
        try:
            stored = json.load(file)["settings"]
            return [(str(key), str(value)) for key, value in stored.items()]
        except (AttributeError, KeyError, TypeError, json.JSONDecodeError) as error:
            raise ValueError(f"{os.fspath(plan)} is no plan") from error


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
    plan: Union[None, Path, Mapping[str, str]] = None,
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
    """Renders a scene; the same bits as `lumiris render` with the same options.

    The arrays of the result own the memory that the renderer has filled: nothing is copied.

    Parameters
    ----------
    scene
        A file (.pbrt, .pbrt.gz, .gltf, .glb), or the text of a pbrt file: a str is text if it has a line break or a quotation mark, or if
        `folder` is given.
    folder
        Where files are sought that the text names; the working folder by default.
    callback
        Called with a `Progress` after every pass over the whole image, while the rendering waits (`is_pass`), and every
        `interval` seconds (about) in between, while it goes on. `progress.image()` and `progress.layers()` are what there
        is by now. Returning False ends the rendering: the result is the picture so far. An exception ends it, too, and is
        raised. It is called in the thread that calls `render`.
    interval
        Time between two calls within a pass (s).
    plan
        Choices that an earlier rendering made by measurements (`Rendering.plan`), or a file of `lumiris plan`. Settings
        override them.
    resolution, crop, box_filter, accel, packet_width, threads, tile_size, time
        As on the command line: columns and rows, or text such as "640x360"; x0, x1, y0, y1 in fractions of the image; a pixel filter of one pixel;
        `embree` or `bvh`; rays per packet; threads; edge of a tile; seconds after which to stop.
    environment, scene_in_file, camera, camera_auto, light_units, time_in_scene
        Of glTF scenes: the image of an environment, the scene of the file and its camera by their names or indices, whether the scene
        is framed whatever its cameras, whether candela and lux of lights are divided by 683 (`watt`, the default) or taken as they are
        (`candela`), and the time of its animations (s).
    aov
        Layers beside the image: `variance`, `samples`, `albedo`, `normal`, `depth`, `material`, `object`, `ratio`, `records`.
        None asks for all that there are; "none" or an empty list saves the time for them.
    texture_memory
        Most bytes that textures take in memory, as a number or a text such as `2G`; others are read by tiles from a
        temporary file. The image is the same.
    cryptomatte
        Cryptomatte layers of ids and coverage: `object`, `material`, or both. Their names of ids are metadata; `lumiris.write`
        makes a file of them that compositing programs read.
    part, part_by
        The i-th of n parts of the image, `(i, n)` or `"i/n"`: a share of the samples of every pixel, or of the tiles.
    samples_from, samples_to
        Index of the first sample of every pixel, and the index after the last one.
    part_file
        Where the exact sums of what is rendered are stored, for `lumiris.merge` and `lumiris merge`; `part` needs one.
    checkpoint
        A file in which all that is needed to go on is stored every so many seconds (60 unless given: `(file, seconds)`) and
        in the end, also after Ctrl-C. One that cannot be written is a warning.
    resume
        A checkpoint or an unfinished part to go on from, with its settings; `spp` may ask for more samples. If it is
        `checkpoint` and there is none yet, the rendering starts. The image is that of an uninterrupted rendering to the bit.
    settings
        The settings of the image, with the names of the command line and `_` for `-`; see `lumiris.settings()`. Values are
        text as on the command line, numbers, or pairs of numbers; None leaves a setting to the scene. True is what an
        option without a value is, False is `off`.

    Raises
    ------
    SceneError
        The scene cannot be loaded; it tells file, line and column, and its text has all errors.
    TypeError, ValueError
        An unknown keyword, or a value that is not allowed; a checkpoint that is damaged, of another scene or of other
        settings.
    OSError
        A file of `resume` or `part_file` cannot be read or written, or the folder of `checkpoint` or `part_file` is not there.
    KeyboardInterrupt
        Ctrl-C: the rendering ends with the tiles under way.

    Warnings of the scene are given as `SceneWarning`. Other Python threads run meanwhile.
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
        "cryptomatte": [cryptomatte] if isinstance(cryptomatte, str) else list(cryptomatte),
        "aov": _aov(aov),
        "interval": interval,
        "settings": _texts(settings),
        "plan": _plan(plan),
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
    layers, metadata, place, chosen, complete, seconds, remarks = _lumiris.render(options, callback)
    for remark in remarks:
        warnings.warn(remark.strip(), SceneWarning, stacklevel=2)
    rendering = Rendering._of(layers, metadata, place)
    rendering.plan = dict(chosen)
    rendering.complete = complete
    rendering.seconds = seconds
    return rendering


def merge(
    parts: Iterable[Path], *, allow_missing: bool = False, aov: Union[None, str, Sequence[str]] = None
) -> Merged:
    """Merges parts of an image, in any order: the bits of the image that is rendered at once.

    `parts` are files that `render` has stored by `part_file`, or `lumiris render --part`; finished checkpoints are parts, too.
    `aov` chooses layers, as for `render`; by default they are those that the parts were rendered for. If parts are missing,
    `allow_missing` merges what there is, with a `SceneWarning`. Raises ValueError for parts that are missing, double, damaged
    or of another image, and OSError for files that cannot be read.
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

"""The native part of `lumiris`."""

from typing import Callable, Dict, List, Optional, Sequence, Tuple, TypedDict, Union

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]
Place = Tuple[Sequence[int], Sequence[int]]
Pixels = Tuple[Array, Optional[Array], Optional[Place]]
Samples = Tuple[Array, Array]
Layer = Tuple[str, List[str], Array]

__version__: str

class SceneError(Exception):
    """A scene that cannot be loaded. Its text has all errors and warnings with their positions in the source."""

    #: The first error.
    message: str
    #: The file with the first error, or the scene.
    file: str
    #: Its line and column, from 1; None if it has no position.
    line: Optional[int]
    column: Optional[int]

class Progress:
    """The progress of a rendering."""

    @property
    def fraction(self) -> float:
        """Share of the camera samples done, 0 to 1."""
    @property
    def passes(self) -> int:
        """Passes over the whole image done."""
    @property
    def is_pass(self) -> bool:
        """True after a pass over the whole image, while the rendering waits."""
    @property
    def samples_done(self) -> int:
        """Camera samples done, as if every pixel had the same number."""
    @property
    def samples_total(self) -> int:
        """Camera samples requested."""
    @property
    def rays(self) -> int:
        """Rays of all kinds traced so far."""
    @property
    def elapsed(self) -> float:
        """Time since the first sample (s)."""
    @property
    def noise(self) -> Optional[float]:
        """Median of the relative standard errors of blocks of 16 × 16 pixels; None before its first computation."""
    def image(self) -> Array:
        """The current image."""
    def layers(self) -> Dict[str, Array]:
        """The current image, features of the first surfaces, and sample counts."""

class SettingRow(TypedDict):
    group: str
    help: str
    default: str
    values: str
    names: List[str]
    numbers: Optional[str]
    has_bare: bool
    key: str
    aliases: List[str]

def settings() -> Dict[str, SettingRow]: ...
def read(path: str, part: int) -> Tuple[List[Layer], Dict[str, str], Place]: ...
def write(
    path: str, layers: List[Tuple[List[str], Array]], metadata: List[Tuple[str, str]], place: Optional[Place]
) -> None: ...
def render(
    options: Dict[str, object], callback: Optional[Callable[[Progress], object]]
) -> Tuple[List[Layer], List[Tuple[str, str]], Place, bool, float, List[str]]: ...
def merge(
    parts: List[str], allow_missing: bool, aov: Optional[List[str]]
) -> Tuple[List[Layer], List[Tuple[str, str]], Place, List[str], float]: ...
def compare(
    image: Union[str, Pixels], reference: Union[str, Pixels], options: Dict[str, object]
) -> Tuple[List[Tuple[str, Optional[float]]], List[Tuple[str, Array]], str]: ...
def denoise(
    color: Array, albedo: Optional[Array], normal: Optional[Array], library: Optional[str], threads: Optional[int]
) -> Tuple[Array, str]: ...
def mis(heuristic: str, a: Samples, b: Samples, is_factor: bool) -> Array: ...
def ris_draws(strata: str, weights: Array, u: Array, u_ends: Array) -> Tuple[NDArray[np.uint32], Array]: ...
def ocv(
    form: str, samples: Samples, integrals: Array, others: Optional[Samples]
) -> Tuple[Array, Array, int]: ...
def optimal_mis(samples: Samples, integrals: Array) -> Tuple[Array, int]: ...

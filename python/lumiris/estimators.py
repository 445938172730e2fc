"""The estimators of ∫ f that the renderer uses, on arrays: numbers in, numbers out.

Arrays are float32, as in the renderer; other arrays are converted. Leading dimensions, written `…`, are independent
estimates. Shapes that do not fit together raise ValueError.
"""

from __future__ import annotations

from typing import NamedTuple, Optional, Tuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _lumiris

Array = NDArray[np.float32]

__all__ = ["Draws", "Fit", "mis_factor", "mis_weight", "ocv", "optimal_mis", "ris", "ris_draws"]


def _array(values: ArrayLike) -> Array:
    return np.asarray(values, dtype=np.float32)


def _rows(array: Array, name: str, dimensions: int) -> Array:
    """Merges all leading dimensions into one."""
    if array.ndim < dimensions:
        raise ValueError(f"{name}: expected {dimensions} dimensions or more, but found an array of shape {array.shape}")
    kept = array.shape[array.ndim - dimensions :]
    rows = int(np.prod(array.shape[: array.ndim - dimensions], dtype=np.int64))
    return np.ascontiguousarray(array.reshape((rows, *kept)))


def _mis(a: Tuple[ArrayLike, ArrayLike], b: Tuple[ArrayLike, ArrayLike], heuristic: str, is_factor: bool) -> Array:
    na, pa, nb, pb = np.broadcast_arrays(*map(_array, (*a, *b)))
    flat = [np.ascontiguousarray(v).reshape(-1) for v in (na, pa, nb, pb)]
    return _lumiris.mis(heuristic, (flat[0], flat[1]), (flat[2], flat[3]), is_factor).reshape(na.shape)


def mis_weight(
    n_a: ArrayLike, p_a: ArrayLike, n_b: ArrayLike, p_b: ArrayLike, *, heuristic: str = "power"
) -> Array:
    """The MIS weight of technique a against b at samples of a: multiple importance sampling [Veach and Guibas 1995].

    `n_a` and `n_b` are numbers of samples, `p_a` and `p_b` densities at the samples, which may be infinite; shapes are
    broadcast. `heuristic` is `balance`, `power` or `maximum`. Weights are finite and in 0..1; they are 0 where a cannot
    have drawn the sample.
    """
    return _mis((n_a, p_a), (n_b, p_b), heuristic, False)


def mis_factor(
    n_a: ArrayLike, p_a: ArrayLike, n_b: ArrayLike, p_b: ArrayLike, *, heuristic: str = "power"
) -> Array:
    """The factor w/(n p) of f in the estimate: the sum of f times this over the samples of both techniques is ∫ f."""
    return _mis((n_a, p_a), (n_b, p_b), heuristic, True)


class Draws(NamedTuple):
    """Drawn proposals; Σ scale · c[indices] estimates Σ c."""

    #: Indices of the drawn proposals (…, N).
    indices: NDArray[np.uint32]
    #: 1/E[number of times that the proposal is drawn] (…, N); 0 if nothing was drawn.
    scale: Array


def ris_draws(
    weights: ArrayLike, u: ArrayLike, *, strata: str = "none", u_ends: Optional[ArrayLike] = None
) -> Draws:
    """Draws N of M proposals in proportion to their weights: resampled importance sampling [Talbot et al. 2005].

    `weights` (…, M) are q̂(x) r, where the target q̂ resembles f but is cheap, and r = 1/(M p). Proposals whose weight
    is not positive and finite are never drawn. `u` (…, N) are uniform numbers in [0, 1).

    `strata` has the values of the setting. `none`: independent draws. `proposals` and `weights`: one draw from each of
    N strata, of equal numbers of proposals or of nearly equal weights; for the latter, `u_ends` (…, N - 1) places the
    ends (½ by default). `systematic`: N draws at equal distances of the cumulative weight, offset by `u[…, 0]`.
    """
    w, numbers = _array(weights), _array(u)
    if w.shape[:-1] != numbers.shape[:-1] or w.ndim == 0 or numbers.ndim == 0:
        raise ValueError(f"weights of shape {w.shape} and uniform numbers of shape {numbers.shape}")
    n = numbers.shape[-1]
    if u_ends is None:
        ends = np.full((*numbers.shape[:-1], max(n - 1, 0)), 0.5, dtype=np.float32)
    else:
        ends = _array(u_ends)
        if ends.ndim == 0 or ends.shape[:-1] != w.shape[:-1]:
            raise ValueError(f"weights of shape {w.shape} and uniform numbers for ends of shape {ends.shape}")
    index, scale = _lumiris.ris_draws(strata, _rows(w, "weights", 1), _rows(numbers, "u", 1), _rows(ends, "u_ends", 1))
    return Draws(index.reshape(numbers.shape), scale.reshape(numbers.shape))


def ris(
    weights: ArrayLike,
    contributions: ArrayLike,
    u: ArrayLike,
    *,
    strata: str = "none",
    u_ends: Optional[ArrayLike] = None,
) -> Array:
    """The estimate Σ scale · c over the drawn proposals; see `ris_draws`.

    `contributions` c = f r are (…, M), or (…, M, 3) for colours; the result is (…) or (…, 3). If contributions are
    expensive, use `ris_draws` and evaluate the drawn proposals only.
    """
    w, c = _array(weights), _array(contributions)
    if c.shape[: w.ndim] != w.shape or c.ndim > w.ndim + 1:
        raise ValueError(f"weights of shape {w.shape} and contributions of shape {c.shape}")
    draws = ris_draws(w, u, strata=strata, u_ends=u_ends)
    index, scale = draws.indices.astype(np.intp), draws.scale
    if c.ndim > w.ndim:
        index, scale = index[..., np.newaxis], scale[..., np.newaxis]
    drawn = np.take_along_axis(c, index, axis=w.ndim - 1)
    result: Array = (drawn * scale).sum(axis=w.ndim - 1, dtype=np.float64).astype(np.float32)
    return result


class Fit(NamedTuple):
    """An estimate with fitted control variates."""

    #: The estimate (…) or (…, channels).
    estimate: Array
    #: The coefficients β of the columns (…, fits, m) or (…, fits, m, channels). `crossfit` has two fits, the other
    #: forms one.
    beta: Array
    #: Number of systems that are singular or nearly so. For a system without a solution, the estimate is the MIS
    #: estimate.
    ill_conditioned: int


def _samples(columns: ArrayLike, values: ArrayLike) -> Tuple[Array, Array, bool]:
    """Columns, values with three channels, and True if `values` has channels."""
    r, y = _array(columns), _array(values)
    has_channels = y.ndim == r.ndim
    if y.shape[: r.ndim - 1] != r.shape[:-1] or y.ndim not in (r.ndim - 1, r.ndim) or r.ndim < 2:
        raise ValueError(f"columns of shape {r.shape} and values of shape {y.shape}")
    if not has_channels:
        y = y[..., np.newaxis]
    if y.shape[-1] not in (1, 3):
        raise ValueError(f"expected values of 1 or 3 channels, but found {y.shape[-1]}")
    colours = np.repeat(y, 3, axis=-1) if y.shape[-1] == 1 else y
    return r, colours, has_channels


def _integrals(integrals: Optional[ArrayLike], count: int) -> Array:
    return np.ones(count, dtype=np.float32) if integrals is None else np.ascontiguousarray(_array(integrals).reshape(-1))


def ocv(
    columns: ArrayLike,
    values: ArrayLike,
    *,
    integrals: Optional[ArrayLike] = None,
    form: str = "regression",
    others: Optional[Tuple[ArrayLike, ArrayLike]] = None,
) -> Fit:
    """Optimizing control variates [Fan et al. 2006]: ȳ − Σ β_j c̄_j, with β fitted to samples.

    N samples come from a mixture p_α = Σ α_j p_j of m densities. `columns` r = p_j/p_α are (…, N, m), `values` y =
    f/p_α are (…, N), or (…, N, 3) for colours, and `integrals` (m) are ∫ p_j, 1 by default.

    `form` selects the samples for fitting β. `regression`: the same samples, with a bias of O(1/N). `crossfit`: for the
    first and the second half of the samples, the other half; unbiased if the halves are independent (both need their
    share of every density). `progressive`: the columns and values `others`; unbiased if they are independent of the
    samples. `paper`: the same samples with the ridge of the paper; biased.
    """
    r, y, has_channels = _samples(columns, values)
    fitted = None
    if others is not None:
        other_r, other_y, other_has_channels = _samples(*others)
        if (other_r.shape[:-2], other_has_channels) != (r.shape[:-2], has_channels):
            raise ValueError(f"columns of shape {r.shape}, and others of shape {other_r.shape}")
        fitted = (_rows(other_r, "others", 2), _rows(other_y, "others", 2))
    pair = (_rows(r, "columns", 2), _rows(y, "values", 2))
    estimate, beta, ill = _lumiris.ocv(form, pair, _integrals(integrals, r.shape[-1]), fitted)
    lead = r.shape[:-2]
    channels = _array(values).shape[-1] if has_channels else 1
    estimate = estimate.reshape((*lead, 3))[..., :channels]
    beta = beta.reshape((*lead, *beta.shape[1:]))[..., :channels]
    return Fit(estimate if has_channels else estimate[..., 0], beta if has_channels else beta[..., 0], ill)


def optimal_mis(columns: ArrayLike, values: ArrayLike, *, integrals: Optional[ArrayLike] = None) -> Array:
    """Optimal multiple importance sampling, with coefficients from the same samples; arguments as for `ocv`."""
    r, y, has_channels = _samples(columns, values)
    pair = (_rows(r, "columns", 2), _rows(y, "values", 2))
    estimate, _ = _lumiris.optimal_mis(pair, _integrals(integrals, r.shape[-1]))
    channels = _array(values).shape[-1] if has_channels else 1
    estimate = estimate.reshape((*r.shape[:-2], 3))[..., :channels]
    return estimate if has_channels else estimate[..., 0]

"""The estimators."""

from __future__ import annotations

from typing import Tuple

import numpy as np
import pytest

from lumiris import estimators


def test_weights_follow_their_formulas_and_sum_to_one() -> None:
    rng = np.random.default_rng(1)
    p, q = rng.random((2, 5, 7)) + 0.01
    x, y = 2 * p, 3 * q
    for heuristic, weight in (("balance", x / (x + y)), ("power", x**2 / (x**2 + y**2)), ("maximum", x > y)):
        w = estimators.mis_weight(2, p, 3, q, heuristic=heuristic)
        assert w.shape == (5, 7) and w.dtype == np.float32
        assert np.allclose(w, weight, atol=1e-6), heuristic
        assert np.allclose(w + estimators.mis_weight(3, q, 2, p, heuristic=heuristic), 1)
        assert np.allclose(estimators.mis_factor(2, p, 3, q, heuristic=heuristic), w / x, rtol=1e-5)
    assert estimators.mis_weight(1, np.inf, 1, 5.0) == 1 and estimators.mis_weight(1, 0.0, 1, 5.0) == 0
    with pytest.raises(ValueError, match="best"):
        estimators.mis_weight(1, 1, 1, 1, heuristic="best")
    with pytest.raises(ValueError, match="broadcast"):
        estimators.mis_weight(1, np.ones(3), 1, np.ones(4))


def test_mis_integrates() -> None:
    # ∫ 3x² over 0..1 with the densities 1 and 2x
    rng = np.random.default_rng(2)
    n = 20_000
    x, y = rng.random(n), np.sqrt(rng.random(n))
    a = 3 * x**2 * estimators.mis_factor(1, np.ones(n), 1, 2 * x)
    b = 3 * y**2 * estimators.mis_factor(1, 2 * y, 1, np.ones(n))
    total = a + b
    error = total.std() / np.sqrt(n)
    assert abs(total.mean() - 1) < 4 * error and error < 0.005


@pytest.mark.parametrize("strata", ["none", "proposals", "weights", "systematic"])
@pytest.mark.parametrize("channels", [(), (3,)])
def test_resampling_is_unbiased(strata: str, channels: Tuple[int, ...]) -> None:
    rng = np.random.default_rng(3)
    rows, m, n = 60_000, 12, 3
    c = rng.random((m, *channels)).astype(np.float32)
    w = (c.reshape(m, -1).sum(axis=1) * (0.5 + rng.random(m))).astype(np.float32)
    contributions = np.broadcast_to(c, (rows, m, *channels))
    u, ends = rng.random((rows, n)), rng.random((rows, n - 1))
    estimates = estimators.ris(np.broadcast_to(w, (rows, m)), contributions, u, strata=strata, u_ends=ends)
    assert estimates.shape == (rows, *channels) and estimates.dtype == np.float32
    error = estimates.std(axis=0) / np.sqrt(rows)
    # 4.5 standard errors: one correct estimate in 10⁵ fails; a bias of 1 % of the sum is at least five of them
    assert (abs(estimates.mean(axis=0) - c.sum(axis=0)) < 4.5 * error).all()
    assert (error < 0.002 * c.sum(axis=0)).all()


def test_draws_are_indices_with_scales() -> None:
    draws = estimators.ris_draws([0, 1, 3, 0], [0.1, 0.9])
    assert draws.indices.tolist() == [1, 2] and np.allclose(draws.scale, [4 / 2 / 1, 4 / 2 / 3])
    nothing = estimators.ris_draws(np.zeros((2, 3)), np.full((2, 4), 0.5))
    assert nothing.indices.shape == (2, 4) and (nothing.scale == 0).all()
    # With one stratum per proposal, each is drawn once
    w = np.array([0.2, 0.3, 0.5])
    assert estimators.ris(w, [1, 2, 4], [0.5] * 3, strata="proposals") == 7
    for weights, u in ((np.ones((2, 3)), np.ones((3, 2))), (np.ones(3), 0.5), (np.ones((2, 3)), np.ones(2))):
        with pytest.raises(ValueError, match="shape"):
            estimators.ris_draws(weights, u)
    with pytest.raises(ValueError, match="contributions of shape"):
        estimators.ris(np.ones(3), np.ones(4), [0.5])
    with pytest.raises(ValueError, match="strata: expected none, proposals"):
        estimators.ris_draws(np.ones(3), [0.5], strata="some")
    with pytest.raises(ValueError, match="2 uniform numbers for their ends"):
        estimators.ris_draws(np.ones(5), [0.5] * 3, strata="weights", u_ends=[0.5])


def _samples(rng: np.random.Generator, rows: int, n: int) -> Tuple[np.ndarray, np.ndarray]:
    """Columns for the densities 1 and 2x, with half of the samples each, and values of f = 1 + 4x + sin(9x)/4."""
    x = rng.random((rows, n))
    x[:, 1::2] = np.sqrt(x[:, 1::2])
    mixture = 0.5 + x
    r = np.stack([1 / mixture, 2 * x / mixture], axis=-1)
    return r, (1 + 4 * x + 0.25 * np.sin(9 * x)) / mixture


#: ∫ f.
TRUTH = 3 + 0.25 * (1 - np.cos(9)) / 9


@pytest.mark.parametrize("form", ["regression", "crossfit", "progressive"])
def test_control_variates_explain_what_densities_can(form: str) -> None:
    rng = np.random.default_rng(4)
    rows, n = 4000, 32
    r, y = _samples(rng, rows, n)
    others = _samples(rng, rows, 128) if form == "progressive" else None
    fit = estimators.ocv(r, y, form=form, others=others)
    assert fit.estimate.shape == (rows,) and fit.beta.shape == (rows, 2 if form == "crossfit" else 1, 2)
    error = fit.estimate.std() / np.sqrt(rows)
    assert abs(fit.estimate.mean() - TRUTH) < 4.5 * error + (0.01 if form == "regression" else 0)
    mis = y.mean(axis=1)
    assert fit.estimate.std() < 0.85 * mis.std()


def test_colours_and_single_estimates_are_rows_of_many() -> None:
    rng = np.random.default_rng(5)
    r, y = _samples(rng, 6, 20)
    colours = np.stack([y, 2 * y, np.zeros_like(y)], axis=-1)
    many = estimators.ocv(r, colours)
    assert many.estimate.shape == (6, 3) and many.beta.shape == (6, 1, 2, 3)
    one = estimators.ocv(r[2], colours[2])
    assert np.array_equal(one.estimate, many.estimate[2]) and one.estimate.shape == (3,)
    assert np.allclose(many.estimate[:, 1], 2 * many.estimate[:, 0], rtol=1e-3)
    grey = estimators.ocv(r.reshape(2, 3, 20, 2), y.reshape(2, 3, 20))
    assert np.array_equal(grey.estimate, many.estimate[:, 0].reshape(2, 3))
    # The paper's ridge has an effect with few samples
    paper = estimators.ocv(r, y, form="paper").estimate
    assert paper.shape == (6,) and not np.allclose(paper, grey.estimate.reshape(-1))


def test_optimal_weights_are_exact_where_densities_span_the_integrand() -> None:
    rng = np.random.default_rng(6)
    x = rng.random((3, 30))
    mixture = 0.5 + x
    r = np.stack([1 / mixture, 2 * x / mixture], axis=-1)
    estimate = estimators.optimal_mis(r, (1 + 4 * x) / mixture)
    assert estimate.shape == (3,) and np.allclose(estimate, 3, atol=1e-3)
    half = estimators.optimal_mis(r / [1, 2], (1 + 4 * x) / mixture, integrals=[1, 0.5])
    assert np.allclose(half, 3, atol=1e-3)


def test_shapes_that_do_not_fit_are_errors() -> None:
    r, y = np.ones((4, 10, 2)), np.ones((4, 10))
    for columns, values in ((r, y[:, :9]), (r, np.ones((4, 10, 2))), (r[0, 0], y[0, 0])):
        with pytest.raises(ValueError, match="shape|channels"):
            estimators.ocv(columns, values)
    with pytest.raises(ValueError, match="expected 2 integrals, but found 3"):
        estimators.ocv(r, y, integrals=[1, 1, 1])
    with pytest.raises(ValueError, match="columns, but found 1000"):
        estimators.ocv(np.ones((1, 1000)), np.ones(1))
    with pytest.raises(ValueError, match="form: expected"):
        estimators.ocv(r, y, form="other")
    with pytest.raises(ValueError, match="needs other samples"):
        estimators.ocv(r, y, form="progressive")
    with pytest.raises(ValueError, match="only the form progressive"):
        estimators.ocv(r, y, others=(r, y))
    with pytest.raises(ValueError, match="others of shape"):
        estimators.ocv(r, y, form="progressive", others=(r[:3], y[:3]))

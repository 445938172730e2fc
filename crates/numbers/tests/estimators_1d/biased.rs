//! Biased baselines: the measured bias equals the predicted one and is significant.

use super::baselines::{bidirectional, weighted};
use super::{assert_means, level};
use lumiris_numbers::estimators::ris::with_replacement;
use lumiris_numbers::estimators::stats::z_test;
use lumiris_numbers::math::luminance;
use lumiris_test_support::integrals::{Integral, Proposals, run};
use lumiris_test_support::random::RngExt;

const RUNS: usize = 1_000_000;
const LINE: Integral = Integral::Line;

/// Mean of `g` over pairs of proposals, by the midpoint rule.
fn mean_of_pairs(g: impl Fn([f64; 2], [f64; 2]) -> [f64; 3]) -> [f64; 3] {
    const POINTS: usize = 2_000;
    let points: Vec<[f64; 2]> = (0..POINTS).map(|i| LINE.sample([(i as f64 + 0.5) / POINTS as f64, 0.0])).collect();
    let mut sum = [0.0; 3];
    for &x in &points {
        for &y in &points {
            let value = g(x, y);
            (0..3).for_each(|i| sum[i] += value[i]);
        }
    }
    sum.map(|s| s / (POINTS * POINTS) as f64)
}

fn integral_of_target() -> f64 {
    LINE.mean_between(0.0, 1.0, |x| [LINE.target(x) / LINE.pdf(x)])[0]
}

fn weighted_runs(m: usize, runs: usize, control: bool) -> [lumiris_numbers::estimators::stats::Welford; 3] {
    let integral = integral_of_target() as f32;
    let mut p = Proposals::default();
    run(runs, [14, m as u32, 0], |stream| {
        p.independent(LINE, m, stream);
        [0, 1, 2].map(|i| {
            let c: Vec<f32> = p.contributions.iter().map(|c| c[i]).collect();
            // The plain estimate is unbiased and correlated: the mean of the difference is the bias, with less noise.
            let plain = if control { c.iter().map(|&c| f64::from(c)).sum() } else { 0.0 };
            f64::from(weighted(&c, &p.weights, integral)) - plain
        })
    })
}

#[test]
fn weighted_importance_sampling_has_the_predicted_bias() {
    let (value, _) = LINE.moments();
    let total = integral_of_target();

    // Two proposals: E[∫g Σ f/p / Σ g/p] by quadrature.
    let expected = mean_of_pairs(|x, y| {
        let (fx, fy, px, py) = (LINE.f(x), LINE.f(y), LINE.pdf(x), LINE.pdf(y));
        let g = LINE.target(x) / px + LINE.target(y) / py;
        std::array::from_fn(|i| total * (fx[i] / px + fy[i] / py) / g)
    });
    let channels = weighted_runs(2, RUNS, false);
    assert_means("weighted, M = 2", &channels, expected);
    assert!(
        channels.iter().zip(value).any(|(w, v)| z_test(w.mean(), v, w.standard_error()).p_value < level()),
        "no bias: {channels:?}"
    );

    // Many proposals: (I V(g/p)/∫g − Cov(f/p, g/p))/(M ∫g).
    const M: usize = 24;
    let m = LINE.mean_between(0.0, 1.0, |x| {
        let (f, g, p) = (LINE.f(x), LINE.target(x), LINE.pdf(x));
        [g * g / (p * p), f[0] * g / (p * p), f[1] * g / (p * p), f[2] * g / (p * p)]
    });
    let first_order: [f64; 3] = std::array::from_fn(|i| {
        let (variance, covariance) = (m[0] - total * total, m[i + 1] - value[i] * total);
        (value[i] * variance / total - covariance) / (M as f64 * total)
    });
    let channels = weighted_runs(M, 400_000, true);
    for (w, expected) in channels.iter().zip(first_order) {
        let tolerance = 5.0 * w.standard_error() + 4.0 / M as f64 * expected.abs();
        assert!((w.mean() - expected).abs() < tolerance, "{} {expected}", w.mean());
    }
}

#[test]
fn bidirectional_importance_sampling_is_biased_in_colour_as_predicted_and_unbiased_in_grey() {
    let (value, _) = LINE.moments();
    let grey_value = luminance(value);
    for grey in [false, true] {
        let colour = |x: [f64; 2]| if grey { [LINE.target(x); 3] } else { LINE.colour(x) };
        // Two proposals: E[(Σ w v / Σ w) Σ c] by quadrature; r = 1/(2p).
        let expected = mean_of_pairs(|x, y| {
            let (rx, ry) = (0.5 / LINE.pdf(x), 0.5 / LINE.pdf(y));
            let (wx, wy) = (LINE.target(x) * rx, LINE.target(y) * ry);
            let visible = (wx * LINE.visibility(x) + wy * LINE.visibility(y)) / (wx + wy);
            let (cx, cy) = (colour(x), colour(y));
            std::array::from_fn(|i| visible * (cx[i] * rx + cy[i] * ry))
        });
        let (mut p, mut draws) = (Proposals::default(), Vec::new());
        let channels = run(RUNS, [15, u32::from(grey), 0], |stream| {
            p.independent(LINE, 2, stream);
            with_replacement(&p.weights, &stream.random::<[f32; 2]>(), &mut draws);
            let seen: Vec<f32> = draws.iter().map(|d| p.visibilities[d.index as usize]).collect();
            let unshadowed = std::array::from_fn(|i| {
                (0..2).map(|j| if grey { p.weights[j] } else { p.unshadowed[j][i] }).sum::<f32>()
            });
            bidirectional(unshadowed, &seen).map(f64::from)
        });
        assert_means("bidirectional", &channels, expected);
        if grey {
            assert_means("bidirectional, grey", &channels, [grey_value; 3]);
        } else {
            for (w, value) in channels.iter().zip(value) {
                let z = z_test(w.mean(), value, w.standard_error());
                assert!(z.p_value < level(), "no bias: {} {value}", w.mean());
            }
        }
    }
}

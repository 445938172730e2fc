//! The distribution of the resampled point [Talbot et al. 2005, Figure 1]: p uniform in 0..π, q̂ = max(0, cos θ + sin⁴
//! θ).

use super::level;
use lumiris_numbers::estimators::ris::{Draw, stratified, systematic, with_replacement};
use lumiris_numbers::estimators::stats::chi_squared_test;
use lumiris_test_support::random::{RngExt, pcg32};
use std::f64::consts::PI;

const BINS: usize = 48;
const RUNS: usize = 400_000;
/// Quadrature points over θ per bin.
const POINTS: usize = 200;
/// Grid size of the distribution of the sum of weights.
const STEPS: usize = 1_200;
/// Upper bound of the weights.
const MAX_WEIGHT: f64 = 1.3;

fn q_hat(theta: f64) -> f64 {
    (theta.cos() + theta.sin().powi(4)).max(0.0)
}

/// Distribution of one weight on the grid: each point is split between two grid points, which preserves its mean.
fn law_of_weight() -> Vec<f64> {
    let mut law = vec![0.0; STEPS + 1];
    let total = BINS * POINTS;
    for k in 0..total {
        let at = q_hat(PI * (k as f64 + 0.5) / total as f64) / MAX_WEIGHT * STEPS as f64;
        let (i, t) = (at as usize, at.fract());
        law[i] += (1.0 - t) / total as f64;
        law[i + 1] += t / total as f64;
    }
    law
}

fn convolve(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut law = vec![0.0; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate().filter(|(_, x)| **x > 0.0) {
        b.iter().enumerate().for_each(|(j, y)| law[i + j] += x * y);
    }
    law
}

/// Probability of each bin, and last of no draw: ∫ p M E[w/(w + W)] dθ, where W is the sum of M − 1 other weights.
fn exact_law(m: usize) -> Vec<f64> {
    let one = law_of_weight();
    let others = (1..m).fold(vec![1.0], |law, _| convolve(&law, &one));
    let mut bins: Vec<f64> = (0..BINS)
        .map(|bin| {
            let mean = |k: usize| {
                let w = q_hat(PI * (bin as f64 + (k as f64 + 0.5) / POINTS as f64) / BINS as f64);
                let share = |(i, p): (usize, &f64)| p * w / (w + i as f64 * MAX_WEIGHT / STEPS as f64);
                if w > 0.0 { others.iter().enumerate().map(share).sum::<f64>() } else { 0.0 }
            };
            m as f64 * (0..POINTS).map(mean).sum::<f64>() / (POINTS * BINS) as f64
        })
        .collect();
    bins.push(1.0 - bins.iter().sum::<f64>());
    bins
}

type DrawOne = fn(&[f32], f32, &mut Vec<Draw>);

#[test]
fn the_resampled_point_has_the_exact_law_for_1_2_and_8_proposals() {
    let ways: [(&str, DrawOne); 3] = [
        ("with replacement", |w, u, out| with_replacement(w, &[u], out)),
        ("systematic", |w, u, out| systematic(w, 1, u, out)),
        ("stratified", |w, u, out| stratified(w, &[w.len() as u32], &[u], out)),
    ];
    let target: Vec<f64> = {
        let bin = |b: usize| (0..POINTS).map(|k| q_hat(PI * (b as f64 + k as f64 / POINTS as f64) / BINS as f64)).sum();
        let bins: Vec<f64> = (0..BINS).map(bin).collect();
        let sum: f64 = bins.iter().sum();
        bins.iter().map(|b| b / sum).chain([0.0]).collect()
    };
    let mut distances = Vec::new();
    for m in [1, 2, 8] {
        let law = exact_law(m);
        // No draw: all proposals had weight 0.
        let dark = (0..BINS * POINTS).filter(|&k| q_hat(PI * (k as f64 + 0.5) / (BINS * POINTS) as f64) == 0.0).count();
        let none = (dark as f64 / (BINS * POINTS) as f64).powi(m as i32);
        assert!((law[BINS] - none).abs() < 1e-3, "{m}: {} {none}", law[BINS]);
        distances.push(law.iter().zip(&target).map(|(a, b)| (a - b).abs()).sum::<f64>());

        let expected: Vec<f64> = law.iter().map(|p| p * RUNS as f64).collect();
        for (k, (name, draw)) in ways.iter().enumerate() {
            let mut stream = pcg32([5, m as u32, k as u32]);
            let (mut counts, mut draws, mut weights) = (vec![0.0; BINS + 1], Vec::new(), vec![0.0; m]);
            for _ in 0..RUNS {
                let theta: Vec<f64> = (0..m).map(|_| PI * f64::from(stream.random::<f32>())).collect();
                weights.iter_mut().zip(&theta).for_each(|(w, &t)| *w = q_hat(t) as f32);
                draw(&weights, stream.random::<f32>(), &mut draws);
                let bin = draws.first().map_or(BINS, |d| (theta[d.index as usize] / PI * BINS as f64) as usize);
                counts[bin] += 1.0;
            }
            let test = chi_squared_test(&counts, &expected, level());
            assert!(!test.rejected, "{name}, M = {m}: {test:?}");
        }
    }
    // From p towards q.
    assert!(distances[0] > 1.5 * distances[1] && distances[1] > 1.5 * distances[2], "{distances:?}");
}

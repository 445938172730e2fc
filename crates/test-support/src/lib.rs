//! Statistical assertions for tests.
#![allow(clippy::unwrap_used)]

pub mod significance;

use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

/// Panics if Pearson's χ² test rejects `observed` counts against `expected` ones at significance `alpha`.
/// Cells that expect fewer than 5 are pooled; a count in a cell that expects none is a rejection.
pub fn assert_chi_squared(observed: &[f64], expected: &[f64], alpha: f64) {
    assert_eq!(observed.len(), expected.len());
    let (mut chi2, mut cells) = (0.0, 0);
    let (mut pooled_observed, mut pooled_expected) = (0.0, 0.0);
    for (i, (&o, &e)) in observed.iter().zip(expected).enumerate() {
        assert!(e > 0.0 || o == 0.0, "{o} counts in cell {i}, which expects none");
        if e >= 5.0 {
            chi2 += (o - e) * (o - e) / e;
            cells += 1;
        } else {
            pooled_observed += o;
            pooled_expected += e;
        }
    }
    if pooled_expected >= 1.0 {
        chi2 += (pooled_observed - pooled_expected) * (pooled_observed - pooled_expected) / pooled_expected;
        cells += 1;
    } else {
        assert!(pooled_observed <= 12.0, "{pooled_observed} counts where {pooled_expected} are expected");
    }
    if cells < 2 {
        let (o, e): (f64, f64) = (observed.iter().sum(), expected.iter().sum());
        assert!((o - e).abs() <= 1e-6 * e, "{o} counts, {e} expected");
        return;
    }
    let p = 1.0 - ChiSquared::new(f64::from(cells - 1)).unwrap().cdf(chi2);
    assert!(p > alpha, "chi-squared {chi2} with {} degrees of freedom: p = {p:e}", cells - 1);
}

/// Mean and standard error of the mean, in f64.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moments {
    count: f64,
    mean: f64,
    m2: f64,
}

impl Moments {
    /// Adds a value [Welford 1962].
    pub fn add(&mut self, x: f64) {
        self.count += 1.0;
        let d = x - self.mean;
        self.mean += d / self.count;
        self.m2 += d * (x - self.mean);
    }

    /// Panics if a two-sided z-test rejects that the mean is `expected` at significance `alpha`; a bias below
    /// `tolerance`·|expected|, for rounding, is let pass.
    pub fn assert_mean(&self, expected: f64, alpha: f64, tolerance: f64) {
        let error = (self.m2 / (self.count - 1.0) / self.count).sqrt();
        let z = Normal::new(0.0, 1.0).unwrap().inverse_cdf(1.0 - alpha / 2.0);
        let limit = z * error + tolerance * expected.abs();
        let Moments { mean, .. } = self;
        assert!((mean - expected).abs() <= limit, "mean {mean} ± {error}, expected {expected}");
    }
}

//! What tests of several crates use: statistical assertions, integrals of known value, and files of volumes and of
//! textures.

pub mod integrals;
pub mod nanovdb;
pub mod power;
pub mod ptex;
pub mod random;
pub mod significance;

use lumiris_numbers::estimators::stats::{Welford, chi_squared_test, z_test};

/// Panics if Pearson's χ² test rejects `observed` counts against `expected` ones at significance `alpha`.
/// Cells that expect few are pooled; a count in a cell that expects none is a rejection.
pub fn assert_chi_squared(observed: &[f64], expected: &[f64], alpha: f64) {
    let test = chi_squared_test(observed, expected, alpha);
    assert!(!test.rejected, "{test:?}");
}

/// Mean and standard error of the mean, in f64.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moments(Welford);

impl Moments {
    /// Adds a value.
    pub fn add(&mut self, x: f64) {
        self.0.add(x);
    }

    /// Panics if a two-sided z-test rejects that the mean is `expected` at significance `alpha`; a bias below
    /// `tolerance`·|expected|, for rounding, is let pass.
    pub fn assert_mean(&self, expected: f64, alpha: f64, tolerance: f64) {
        let (mean, error) = (self.0.mean(), self.0.standard_error());
        let beyond = ((mean - expected).abs() - tolerance * expected.abs()).max(0.0);
        let p = z_test(beyond, 0.0, error).p_value;
        assert!(p >= alpha, "mean {mean} ± {error}, expected {expected}: p = {p:e}");
    }
}

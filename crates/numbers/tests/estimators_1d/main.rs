//! Estimators on integrals in one and two dimensions whose values and variances are known by quadrature.
//!
//! Seeds are fixed. The hypotheses of all tests here together, less than [`HYPOTHESES`], reject a true model with
//! probability 1 %; a run that passes once always passes.
//!
//! The integrals are those of `lumiris_test_support::integrals`.
//!
//! - [`unbiased`]: mean and variance of every way of drawing (thesis 4.2, 4.6; paper 2)
//! - [`law`]: the distribution of the resampled point
//! - [`stratification`]: strata against none, and the strata of equal weights against their printed form
//! - [`parameters`]: the optimal numbers of proposals and samples
//! - [`techniques`]: two techniques
//! - [`mixtures`]: integrals that a deterministic mixture of densities samples
//! - [`ocv`]: optimizing control variates, optimal multiple importance sampling, correlated sampling
//! - [`oracle`]: slow versions in f64 of what ships in f32 and lanes
//! - [`baselines`], [`biased`]: estimators that others are measured against have the bias that is predicted

mod baselines;
mod biased;
mod law;
mod mixtures;
mod ocv;
mod oracle;
mod parameters;
mod pixels;
mod stratification;
mod techniques;
mod unbiased;

use lumiris_numbers::estimators::stats::{Welford, sidak, z_test};

/// At least the number of hypotheses that are tested in this module.
const HYPOTHESES: usize = 1500;

/// Significance of one hypothesis.
fn level() -> f64 {
    sidak(0.01, HYPOTHESES)
}

/// The mean of each channel is `expected`.
fn assert_means(name: &str, channels: &[Welford; 3], expected: [f64; 3]) {
    for (i, (w, expected)) in channels.iter().zip(expected).enumerate() {
        let z = z_test(w.mean(), expected, w.standard_error());
        assert!(z.p_value > level(), "{name}, channel {i}: {} is not {expected}: {z:?}", w.mean());
    }
}

/// The variance of each channel is `expected` within 2 %.
fn assert_variances(name: &str, channels: &[Welford; 3], expected: [f64; 3]) {
    for (i, (w, expected)) in channels.iter().zip(expected).enumerate() {
        let ratio = w.variance() / expected;
        assert!((ratio - 1.0).abs() < 0.02, "{name}, channel {i}: variance {} / {expected} = {ratio}", w.variance());
    }
}

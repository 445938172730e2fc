//! Estimators on integrals in one and two dimensions whose values and variances are known by quadrature.
//!
//! Seeds are fixed, so tests are deterministic. All hypotheses together, fewer than [`HYPOTHESES`], reject a true model
//! with probability 1 %.
//!
//! The integrals are those of `lumiris_test_support::integrals`.
//!
//! - [`unbiased`]: mean and variance of every drawing method (thesis 4.2, 4.6; paper 2)
//! - [`law`]: the distribution of the resampled point
//! - [`stratification`]: strata compared with none, and strata of equal weights compared with their printed form
//! - [`parameters`]: the optimal numbers of proposals and samples
//! - [`techniques`]: two techniques
//! - [`mixtures`]: integrals sampled by a deterministic mixture of densities
//! - [`ocv`]: optimizing control variates, optimal multiple importance sampling, correlated sampling
//! - [`oracle`]: slow f64 versions of the shipping f32 and vectorised code
//! - [`baselines`], [`biased`]: baseline estimators have their predicted bias

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

/// Upper bound of the number of hypotheses tested in this module.
const HYPOTHESES: usize = 1500;

/// Significance of one hypothesis.
fn level() -> f64 {
    sidak(0.01, HYPOTHESES)
}

/// Asserts that the mean of each channel is `expected`.
fn assert_means(name: &str, channels: &[Welford; 3], expected: [f64; 3]) {
    for (i, (w, expected)) in channels.iter().zip(expected).enumerate() {
        let z = z_test(w.mean(), expected, w.standard_error());
        assert!(z.p_value > level(), "{name}, channel {i}: {} is not {expected}: {z:?}", w.mean());
    }
}

/// Asserts that the variance of each channel is `expected` within 2 %.
fn assert_variances(name: &str, channels: &[Welford; 3], expected: [f64; 3]) {
    for (i, (w, expected)) in channels.iter().zip(expected).enumerate() {
        let ratio = w.variance() / expected;
        assert!((ratio - 1.0).abs() < 0.02, "{name}, channel {i}: variance {} / {expected} = {ratio}", w.variance());
    }
}

//! Criteria for the reproduction of a figure, based on the measurements only.

use super::measure::Estimate;

/// Number of standard errors by which two numbers must differ to be significantly different.
const ERRORS: f64 = 2.0;
/// Maximum relative change of a mean luminance that is hardly perceivable: the contrast threshold of the eye is one to
/// two percent.
const PERCEIVABLE: f64 = 0.02;

/// True if the reduction from 1 to `left` is at least `percent`; false for 0, which means no measurement.
pub fn reduced_by(left: Estimate, percent: f64) -> bool {
    left.value > 0.0 && (1.0 - left.value) * 100.0 >= percent
}

/// The same for resampling of `proposals` to `samples`; false if they are equal, since nothing is resampled.
pub fn reduced_by_resampling([proposals, samples]: [u32; 2], left: Estimate, percent: f64) -> bool {
    proposals > samples && reduced_by(left, percent)
}

/// True if each number is significantly lower than the one before it.
pub fn falls(steps: &[Estimate]) -> bool {
    let is_lower = |a: Estimate, b: Estimate| b.value + ERRORS * a.error.hypot(b.error) < a.value;
    steps.len() > 1 && steps.windows(2).all(|pair| is_lower(pair[0], pair[1]))
}

/// True if the remaining fraction of the variance is greater in lit pixels than in penumbra and in shadow.
pub fn helps_most_in_shadow([lit, penumbra, shadow]: [f64; 3]) -> bool {
    penumbra < lit && shadow < lit
}

/// True if a relative bias, including its uncertainty, is below the perception threshold.
pub fn hardly_perceivable(bias: Estimate) -> bool {
    bias.value.abs() + ERRORS * bias.error < PERCEIVABLE
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(value: f64, error: f64) -> Estimate {
        Estimate { value, error }
    }

    fn steps(values: &[f64], error: f64) -> Vec<Estimate> {
        values.iter().map(|&value| of(value, error)).collect()
    }

    #[test]
    fn a_reduction_of_just_less_than_was_asked_for_is_not_enough() {
        // Figure 5.3 of the thesis with its own M and N: 43 % with a target of 45 %
        assert!(!reduced_by(of(0.567, 0.011), 45.0));
        assert!(reduced_by(of(0.5499, 0.011), 45.0));
        assert!(!reduced_by(of(1.049, 0.021), 45.0));
        assert!(!reduced_by(Estimate::default(), 45.0));
        assert!(!reduced_by(of(f64::NAN, 0.0), 45.0));
    }

    #[test]
    fn a_reduction_without_resampling_does_not_count() {
        assert!(reduced_by_resampling([139, 138], of(0.12, 0.005), 45.0));
        assert!(!reduced_by_resampling([138, 138], of(0.12, 0.005), 45.0));
        assert!(!reduced_by_resampling([229, 64], of(0.567, 0.011), 45.0));
    }

    #[test]
    fn every_step_has_to_fall_and_not_only_below_the_first() {
        let error = 0.001;
        assert!(falls(&steps(&[1.0, 0.72, 0.36, 0.33, 0.29], error)));
        // Equal weights are worse than equal proposals; both are better than stratified proposals
        assert!(!falls(&steps(&[1.0, 0.72, 0.33, 0.36, 0.29], error)));
        assert!(!falls(&steps(&[1.0, 0.72, 0.36, 0.33, 0.34], error)));
        assert!(!falls(&steps(&[1.0, 1.0], 0.0)));
        assert!(!falls(&steps(&[0.5], 0.0)));
    }

    #[test]
    fn a_step_within_its_noise_is_no_step() {
        assert!(!falls(&steps(&[1.0, 0.72, 0.36, 0.33, 0.29], 0.02)));
        assert!(falls(&[of(0.36, 0.01), of(0.33, 0.01)]));
        assert!(!falls(&[of(0.36, 0.011), of(0.33, 0.011)]));
    }

    #[test]
    fn strata_of_samples_must_help_in_both_penumbra_and_shadow() {
        assert!(helps_most_in_shadow([0.73, 0.36, 0.49]));
        assert!(!helps_most_in_shadow([0.45, 0.36, 0.49]));
        assert!(!helps_most_in_shadow([0.36, 0.36, 0.36]));
        assert!(!helps_most_in_shadow([0.73, f64::NAN, 0.49]));
    }

    #[test]
    fn a_third_of_the_light_is_perceivable() {
        assert!(!hardly_perceivable(of(-0.358, 0.011)));
        assert!(!hardly_perceivable(of(0.358, 0.011)));
        assert!(hardly_perceivable(of(-0.0009, 0.0005)));
        // Too uncertain
        assert!(!hardly_perceivable(of(0.0, 0.011)));
        assert!(!hardly_perceivable(of(f64::NAN, 0.0)));
    }
}

//! The power of t-tests: critical values, and the bias that is detected with a given power.
//!
//! A test of level α rejects where the mean is t_α standard errors or more from the answer; a mean that is off by
//! (t_α + t_β) standard errors is then rejected with probability 1 − β, t_β being the quantile of Student's
//! distribution.

use lumiris_numbers::estimators::stats::Welford;
use statrs::function::beta::beta_reg;

/// |t| that is reached with probability `p` if the mean is right: where `t_test` has this p-value.
pub fn critical_t(p: f64, dof: u64) -> f64 {
    let dof = dof as f64;
    let p_value = |t: f64| beta_reg(0.5 * dof, 0.5, dof / (dof + t * t));
    let mut high = 1.0;
    while p_value(high) > p {
        high *= 2.0;
    }
    let mut low = 0.0;
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        *(if p_value(middle) > p { &mut low } else { &mut high }) = middle;
    }
    high
}

/// Standard errors between the answer and a mean that a two-sided test of this level rejects with probability `power`.
pub fn detectable_deviation(significance: f64, power: f64, dof: u64) -> f64 {
    critical_t(significance, dof) + critical_t(2.0 * (1.0 - power), dof)
}

/// b so that `count` values with a mean of this relative standard error are rejected with probability `power` once all
/// of them, and so their noise, are multiplied by 1 + b.
pub fn detectable_bias(relative_error: f64, count: u64, significance: f64, power: f64) -> f64 {
    if relative_error == 0.0 {
        return 0.0;
    }
    let deviation = detectable_deviation(significance, power, count - 1) * relative_error;
    if deviation < 1.0 { deviation / (1.0 - deviation) } else { f64::INFINITY }
}

/// Whether a two-sided t-test of this level rejects that the mean is within `limit` of `expected`.
pub fn is_beyond(samples: &Welford, expected: f64, limit: f64, significance: f64) -> bool {
    let excess = (samples.mean() - expected).abs() - limit;
    excess > critical_t(significance, samples.count() - 1) * samples.standard_error()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{normal, pcg32};
    use lumiris_numbers::estimators::stats::t_test;

    #[test]
    fn critical_values_are_those_of_printed_tables() {
        for (p, dof, expected) in [(0.05, 4, 2.776_445), (0.01, 10, 3.169_273), (0.05, 1_000_000, 1.959_966)] {
            assert!((critical_t(p, dof) - expected).abs() < 2e-6, "{p} {dof}: {}", critical_t(p, dof));
        }
    }

    #[test]
    fn a_detectable_bias_is_found_as_often_as_the_power_says() {
        const RUNS: usize = 4000;
        let (significance, power) = (1e-5, 0.99);
        let mut found = 0;
        for run in 0..RUNS {
            let mut stream = pcg32([run as u32, 5, 71]);
            let values: Vec<f64> = (0..32).map(|_| 1.0 + 0.05 * normal(&mut stream)).collect();
            let right: Welford = values.iter().copied().collect();
            let bias = detectable_bias(right.standard_error(), 32, significance, power);
            let wrong: Welford = values.iter().map(|v| v * (1.0 + bias)).collect();
            let is_found = t_test(&wrong, 1.0).p_value < significance;
            assert_eq!(is_found, is_beyond(&wrong, 1.0, 0.0, significance));
            found += usize::from(is_found);
        }
        // The share of 4000 runs has σ = 0.0016; four of them
        let share = found as f64 / RUNS as f64;
        assert!((share - power).abs() < 4.0 * (power * (1.0 - power) / RUNS as f64).sqrt(), "{share}");
    }
}

//! Running moments and hypothesis tests, in f64.
//!
//! - χ²: Σ (observed − expected)² / expected against the χ² distribution [Pearson 1900]; bins with few expected counts
//!   are pooled, since the approximation needs about five of them [Cochran 1954].
//! - z and t: (mean − expected) / standard error against the normal and Student distributions.
//! - Running mean and variance: [Welford 1962], merged by [Chan et al. 1979].

use statrs::function::beta::beta_reg;
use statrs::function::erf::erfc;
use statrs::function::gamma::gamma_ur;

/// Expected count below which [`chi_squared_test`] pools a bin.
pub const MIN_EXPECTED: f64 = 5.0;

/// Outcome of [`chi_squared_test`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChiSquared {
    /// Σ (observed − expected)² / expected over the pooled bins.
    pub statistic: f64,
    /// Degrees of freedom: pooled bins minus one.
    pub dof: usize,
    /// Probability of a statistic at least as large if the model is true.
    pub p_value: f64,
    /// True if `p_value` is below the significance, or if counts occurred in a bin of expectation 0.
    pub rejected: bool,
}

/// Pearson's χ² test of `observed` counts against `expected` counts. Bins are processed in the order of their expected
/// counts; bins below [`MIN_EXPECTED`] are pooled until they reach it. A count in a bin whose expectation is 0 rejects
/// the model. Panics if the slices differ in length.
pub fn chi_squared_test(observed: &[f64], expected: &[f64], significance: f64) -> ChiSquared {
    assert_eq!(observed.len(), expected.len(), "one expectation per bin");
    let mut order: Vec<usize> = (0..expected.len()).collect();
    order.sort_by(|&a, &b| expected[a].total_cmp(&expected[b]));

    // Pool bins until the expectation of each pool is large enough.
    let mut pools: Vec<(f64, f64)> = Vec::new();
    let mut open = (0.0, 0.0);
    let mut impossible = false;
    for i in order {
        impossible |= expected[i] <= 0.0 && observed[i] > 0.0;
        open = (open.0 + observed[i], open.1 + expected[i]);
        if open.1 >= MIN_EXPECTED {
            pools.push(open);
            open = (0.0, 0.0);
        }
    }
    // Bins are in ascending order, so an incomplete pool at the end is small: add it to the last pool.
    match pools.last_mut() {
        Some(last) => *last = (last.0 + open.0, last.1 + open.1),
        None => pools.push(open),
    }

    let statistic = pools.iter().map(|&(o, e)| if e > 0.0 { (o - e) * (o - e) / e } else { 0.0 }).sum::<f64>();
    let dof = pools.len() - 1;
    let p_value = if impossible { 0.0 } else { chi_squared_tail(statistic, dof) };
    ChiSquared { statistic, dof, p_value, rejected: p_value < significance }
}

/// Probability that χ² with `dof` degrees of freedom is at least `statistic`; 1 without degrees of freedom. Above a
/// hundred thousand degrees, where the incomplete gamma function is slow, the cube root of χ² / dof is approximated as
/// normal [Wilson and Hilferty 1931].
pub fn chi_squared_tail(statistic: f64, dof: usize) -> f64 {
    if dof == 0 || statistic <= 0.0 {
        return 1.0;
    }
    if statistic == f64::INFINITY {
        return 0.0;
    }
    let n = dof as f64;
    if dof <= 100_000 {
        return gamma_ur(0.5 * n, 0.5 * statistic);
    }
    let spread = 2.0 / (9.0 * n);
    let z = ((statistic / n).cbrt() - (1.0 - spread)) / spread.sqrt();
    0.5 * erfc(z * std::f64::consts::FRAC_1_SQRT_2)
}

/// Significance of each of `tests` independent tests such that together they reject a true model with probability
/// `familywise` [Šidák 1967].
pub fn sidak(familywise: f64, tests: usize) -> f64 {
    -((-familywise).ln_1p() / tests as f64).exp_m1()
}

/// Outcome of [`z_test`] and [`t_test`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeanTest {
    /// (mean − expected) / standard error.
    pub statistic: f64,
    /// Two-sided probability of a deviation at least as large if the model is true.
    pub p_value: f64,
}

/// Two-sided test of a mean against `expected`, whose `standard_error` is known (or estimated from many samples).
pub fn z_test(mean: f64, expected: f64, standard_error: f64) -> MeanTest {
    let statistic = standardised(mean - expected, standard_error);
    MeanTest { statistic, p_value: erfc(statistic.abs() * std::f64::consts::FRAC_1_SQRT_2) }
}

/// Two-sided Student test of the mean of `samples` against `expected`. With fewer than two samples nothing is rejected,
/// and the p-value is 1.
pub fn t_test(samples: &Welford, expected: f64) -> MeanTest {
    if samples.count() < 2 {
        return MeanTest { statistic: 0.0, p_value: 1.0 };
    }
    let statistic = standardised(samples.mean() - expected, samples.standard_error());
    let dof = (samples.count() - 1) as f64;
    let p_value =
        if statistic.is_infinite() { 0.0 } else { beta_reg(0.5 * dof, 0.5, dof / (dof + statistic * statistic)) };
    MeanTest { statistic, p_value }
}

/// Two-sided test of the equality of two means by their pooled standard errors.
pub fn two_sample_z_test(a: &Welford, b: &Welford) -> MeanTest {
    z_test(a.mean(), b.mean(), a.standard_error().hypot(b.standard_error()))
}

/// `difference / standard_error`; 0 instead of NaN for an exact match of constants.
fn standardised(difference: f64, standard_error: f64) -> f64 {
    if difference == 0.0 { 0.0 } else { difference / standard_error }
}

/// The median: the middle value, or the mean of the middle two; 0 without values.
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.into_iter().collect();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => 0.0,
        n => 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]),
    }
}

/// Running mean and variance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Welford {
    count: u64,
    mean: f64,
    /// Sum of squared deviations from the mean.
    m2: f64,
}

impl Welford {
    /// No samples yet.
    pub const fn new() -> Self {
        Welford { count: 0, mean: 0.0, m2: 0.0 }
    }

    /// Adds a sample.
    #[inline]
    pub fn add(&mut self, x: f64) {
        self.count += 1;
        let delta = x - self.mean;
        self.mean += delta / self.count as f64;
        self.m2 += delta * (x - self.mean);
    }

    /// Adds the samples of `other`.
    pub fn merge(&mut self, other: &Welford) {
        if other.count == 0 {
            return;
        }
        let (a, b) = (self.count as f64, other.count as f64);
        let delta = other.mean - self.mean;
        self.count += other.count;
        self.mean += delta * b / (a + b);
        self.m2 += other.m2 + delta * delta * a * b / (a + b);
    }

    /// Number of samples.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Mean of the samples; 0 if there are none.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Unbiased variance of a sample; 0 with fewer than two.
    pub fn variance(&self) -> f64 {
        if self.count < 2 { 0.0 } else { self.m2 / (self.count - 1) as f64 }
    }

    /// Standard error of the mean; 0 with fewer than two samples.
    pub fn standard_error(&self) -> f64 {
        if self.count < 2 { 0.0 } else { (self.variance() / self.count as f64).sqrt() }
    }
}

impl FromIterator<f64> for Welford {
    fn from_iter<I: IntoIterator<Item = f64>>(iter: I) -> Self {
        let mut w = Welford::new();
        iter.into_iter().for_each(|x| w.add(x));
        w
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn p_values_match_printed_tables() {
        // χ² upper 5 % point of 10 degrees of freedom is 18.307, of the normal 1.95996, of t with 4 degrees 2.7764.
        let expected = [100.0; 11];
        let mut observed = expected;
        let d = (18.307_f64 * 100.0 / 2.0).sqrt();
        observed[0] += d;
        observed[1] -= d;
        let chi = chi_squared_test(&observed, &expected, 0.05);
        assert_eq!(chi.dof, 10);
        assert!((chi.p_value - 0.05).abs() < 1e-4, "{chi:?}");
        assert!((z_test(1.959_964, 0.0, 1.0).p_value - 0.05).abs() < 1e-6);
        let w: Welford = [-1.0, 0.0, 1.0, 2.0, 3.0].into_iter().collect();
        let t = t_test(&w, w.mean() - 2.776_445 * w.standard_error());
        assert!((t.p_value - 0.05).abs() < 1e-6, "{t:?}");
    }

    #[test]
    fn the_tail_of_chi_squared_is_one_function_for_few_and_many_degrees() {
        assert!((chi_squared_tail(18.307, 10) - 0.05).abs() < 1e-4);
        assert_eq!(
            (chi_squared_tail(3.0, 0), chi_squared_tail(0.0, 4), chi_squared_tail(f64::INFINITY, 4)),
            (1.0, 1.0, 0.0)
        );
        for z in [-2.0, 0.0, 1.0, 3.0, 5.0] {
            let at = |n: usize| chi_squared_tail(n as f64 + z * (2.0 * n as f64).sqrt(), n);
            let (exact, normal) = (at(100_000), at(100_001));
            assert!((exact / normal - 1.0).abs() < 2e-3, "{z}: {exact} {normal}");
        }
    }

    #[test]
    fn small_bins_are_pooled_and_impossible_counts_reject() {
        let expected = [0.5, 1.0, 2.0, 2.5, 50.0, 60.0];
        let chi = chi_squared_test(&expected, &expected, 0.01);
        assert_eq!((chi.dof, chi.p_value, chi.rejected), (2, 1.0, false));
        assert!(chi_squared_test(&[1.0, 100.0], &[0.0, 100.0], 0.01).rejected);
        assert!(!chi_squared_test(&[0.0, 100.0], &[0.0, 100.0], 0.01).rejected);
    }

    #[test]
    fn welford_merge_equals_one_pass() {
        let values: Vec<f64> = (0..1000).map(|i| 1e6 + f64::from(i % 17) * 0.25).collect();
        let whole: Welford = values.iter().copied().collect();
        let mut parts = Welford::new();
        for chunk in values.chunks(77) {
            parts.merge(&chunk.iter().copied().collect());
        }
        assert_eq!(whole.count(), parts.count());
        assert!((whole.mean() - parts.mean()).abs() < 1e-7);
        assert!((whole.variance() / parts.variance() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn median_is_the_middle_or_the_mean_of_the_middle_two() {
        assert_eq!(median([3.0, 1.0, 2.0, 10.0]), 2.5);
        assert_eq!((median([3.0, -1.0, 2.0]), median([7.0]), median([])), (2.0, 7.0, 0.0));
    }

    #[test]
    fn sidak_of_one_test_is_the_level_itself() {
        assert!((sidak(0.01, 1) - 0.01).abs() < 1e-15);
        assert!((1.0 - (1.0 - sidak(0.01, 40)).powi(40) - 0.01).abs() < 1e-12);
    }

    #[test]
    fn welford_has_the_moments_of_few_values() {
        let of = |values: &[f64]| values.iter().copied().collect::<Welford>();
        let [none, one, two, four] = [&[][..], &[3.0], &[3.0, 7.0], &[1.0, 2.0, 3.0, 6.0]].map(of);
        assert_eq!((none.count(), none.mean(), none.variance(), none.standard_error()), (0, 0.0, 0.0, 0.0));
        assert_eq!((one.count(), one.mean(), one.variance(), one.standard_error()), (1, 3.0, 0.0, 0.0));
        assert_eq!((two.count(), two.mean(), two.variance(), two.standard_error()), (2, 5.0, 8.0, 2.0));
        assert_eq!((four.mean(), four.variance()), (3.0, 14.0 / 3.0));
        let mut merged = two;
        merged.merge(&none);
        assert_eq!(merged, two);
        let mut merged = none;
        merged.merge(&two);
        assert_eq!((merged.count(), merged.mean(), merged.variance()), (2, 5.0, 8.0));
    }

    #[test]
    fn tests_of_means_say_nothing_without_samples_and_everything_without_noise() {
        let of = |values: &[f64]| values.iter().copied().collect::<Welford>();
        assert_eq!(t_test(&of(&[3.0]), 9.0), MeanTest { statistic: 0.0, p_value: 1.0 });
        assert_eq!(t_test(&of(&[3.0, 3.0]), 3.0).p_value, 1.0);
        assert_eq!(t_test(&of(&[3.0, 3.0]), 9.0), MeanTest { statistic: f64::NEG_INFINITY, p_value: 0.0 });
        // Two values, one degree of freedom: Cauchy, so that p = 1/2 at t = 1
        let cauchy = t_test(&of(&[3.0, 7.0]), 3.0);
        assert!((cauchy.statistic - 1.0).abs() < 1e-12 && (cauchy.p_value - 0.5).abs() < 1e-9, "{cauchy:?}");
        // Standard errors 3 and 4 have 5 between them
        let (a, b) = (of(&[-3.0, 3.0]), of(&[6.0, 14.0]));
        let both = two_sample_z_test(&a, &b);
        assert!((both.statistic + 2.0).abs() < 1e-12 && (both.p_value - 0.0455).abs() < 1e-4, "{both:?}");
    }

    #[test]
    fn pools_hold_what_they_must_and_the_statistic_is_their_sum() {
        // The two small bins form one pool of 6; a bin at exactly the minimum remains alone
        let chi = chi_squared_test(&[6.0, 3.0, 1.0, 20.0], &[5.0, 4.0, 2.0, 16.0], 0.3);
        assert_eq!(chi.dof, 2);
        assert!((chi.statistic - (4.0 / 6.0 + 1.0 / 5.0 + 1.0)).abs() < 1e-12, "{chi:?}");
        assert!(!chi.rejected && chi_squared_test(&[6.0, 3.0, 1.0, 40.0], &[5.0, 4.0, 2.0, 16.0], 0.3).rejected);
        // A bin without expectation and without counts has no effect
        assert_eq!(chi_squared_test(&[0.0], &[0.0], 0.5).statistic, 0.0);
    }
}

//! The reference image, and the errors of renderings.
//!
//! E = √(mean ((L − L_true)/tvi(L_true))²) [Fan et al. 2006, Eq. 12] with luminances L in cd/m², where a luminance of 1
//! in the image is [`CANDELAS`]. L_true is the mean of K long renderings and has noise of its own. Its variance,
//! estimated from the differences of the K renderings, is subtracted from each square, so that E² has the same
//! expectation as with the exact L_true.

use super::super::measure::{Estimate, Measured};
use lumiris::imaging::metrics::tvi;
use lumiris_numbers::estimators::stats::Welford;
use lumiris_numbers::math::luminance;

/// Luminance (cd/m²) of a pixel whose luminance is 1: white on a display.
pub(super) const CANDELAS: f64 = 100.0;

/// The reference image, from long renderings.
pub(super) struct Truth {
    /// Mean radiance.
    pub radiance: Vec<[f32; 3]>,
    /// Mean luminance.
    luminance: Vec<f64>,
    /// Variance of that mean.
    variance: Vec<f64>,
    /// tvi of each pixel, in the unit of the luminance.
    threshold: Vec<f64>,
    /// Mean luminance of the whole image.
    pub mean: Estimate,
}

/// Errors of the renderings of one method.
#[derive(Clone, Debug)]
pub(super) struct Errors {
    /// Mean square of eq. (12), turn by turn.
    squares: Welford,
    /// Mean over the pixels of the square of their expected error, in units of eq. (12): the part that does not
    /// decrease with the number of turns.
    pub systematic: f64,
    /// Ratio of the mean luminance of the image to the reference, minus 1, with half the width of its 95 % confidence
    /// interval.
    pub bias: Interval,
}

/// A number and half the width of its 95 % confidence interval.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interval {
    /// The number.
    pub value: f64,
    /// Half the width.
    pub half: f64,
}

impl Truth {
    /// From turns of an unbiased method.
    pub(super) fn new(long: &Measured) -> Self {
        let turns = long.turns() as f64;
        let mean = long.mean_radiance();
        let bright: Vec<f64> = mean.iter().map(|&p| luminance(p)).collect();
        let of_turn = |t: &Vec<f32>| t.iter().map(|&v| f64::from(v)).sum::<f64>() / t.len().max(1) as f64;
        let mut means = Welford::new();
        long.luminances().iter().for_each(|t| means.add(of_turn(t)));
        Truth {
            radiance: mean.iter().map(|p| p.map(|v| v as f32)).collect(),
            threshold: bright.iter().map(|&l| tvi(l * CANDELAS) / CANDELAS).collect(),
            variance: long.variance_map().iter().map(|v| v / turns).collect(),
            luminance: bright,
            mean: Estimate { value: means.mean(), error: means.standard_error() },
        }
    }

    /// Mean square of the noise of this reference, in units of eq. (12).
    pub(super) fn noise(&self) -> f64 {
        let noise = |(v, t): (&f64, &f64)| v / (t * t);
        (self.variance.iter().zip(&self.threshold).map(noise).sum::<f64>() / self.variance.len().max(1) as f64).sqrt()
    }

    /// A variance image in units of eq. (12): variance over the square of the threshold.
    pub(super) fn weighted(&self, variances: &[f64]) -> Vec<f64> {
        variances.iter().zip(&self.threshold).map(|(v, t)| v / (t * t)).collect()
    }

    /// Mean square of eq. (12) of an image with this luminance, without the noise of the reference.
    fn square(&self, image: impl Iterator<Item = f64>) -> f64 {
        let error = |(i, l): (usize, f64)| {
            let (difference, t) = (l - self.luminance[i], self.threshold[i]);
            (difference * difference - self.variance[i]) / (t * t)
        };
        image.enumerate().map(error).sum::<f64>() / self.luminance.len().max(1) as f64
    }

    /// Compares the turns of a method with the reference.
    pub(super) fn errors(&self, m: &Measured) -> Errors {
        let (mut squares, mut means) = (Welford::new(), Welford::new());
        for turn in m.luminances() {
            squares.add(self.square(turn.iter().map(|&v| f64::from(v))));
            means.add(turn.iter().map(|&v| f64::from(v)).sum::<f64>() / turn.len().max(1) as f64);
        }
        // The mean image, minus the contribution of its own noise
        let turns = m.turns() as f64;
        let mean = self.square(m.mean_radiance().iter().map(|&p| luminance(p)));
        let noise = self.weighted(&m.variance_map()).iter().sum::<f64>() / (turns * self.luminance.len().max(1) as f64);
        let truth = self.mean.value.max(1e-300);
        let error = means.standard_error().hypot(self.mean.error) / truth;
        let bias = Interval { value: means.mean() / truth - 1.0, half: student(m.turns() - 1) * error };
        Errors { squares, systematic: mean - noise, bias }
    }
}

impl Errors {
    /// E of eq. (12), from the mean square.
    pub(super) fn error(&self) -> Estimate {
        let value = self.squares.mean().max(0.0).sqrt();
        Estimate { value, error: 0.5 * self.squares.standard_error() / value.max(1e-300) }
    }

    /// Ratio of E to another method's.
    pub(super) fn relative(&self, base: &Errors) -> Estimate {
        let (a, b) = (self.error(), base.error());
        if !(a.value > 0.0 && b.value > 0.0) {
            return Estimate::default();
        }
        let value = a.value / b.value;
        Estimate { value, error: value * (a.error / a.value).hypot(b.error / b.value) }
    }

    /// 1/(E²·time) relative to another method, for the ratio of their times.
    pub(super) fn efficiency(&self, base: &Errors, time_ratio: f64) -> Estimate {
        let left = self.relative(base);
        let value = 1.0 / (left.value * left.value * time_ratio).max(1e-300);
        Estimate { value, error: 2.0 * value * left.error / left.value.max(1e-300) }
    }
}

/// The factor of a standard error with `freedom` degrees of freedom for a 95 % confidence interval: Student's
/// distribution by the expansion of Cornish and Fisher.
fn student(freedom: usize) -> f64 {
    let (z, n) = (1.959_964_f64, freedom.max(1) as f64);
    z + (z.powi(3) + z) / (4.0 * n)
        + (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / (96.0 * n * n)
        + (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / (384.0 * n.powi(3))
}

#[cfg(test)]
mod tests {
    use super::super::super::method::Method;
    use super::*;

    fn measured(turns: &[[f32; 2]]) -> Measured {
        Measured::from_luminances(Method::mc(1), turns.iter().map(|t| t.to_vec()).collect())
    }

    #[test]
    fn the_noise_of_the_truth_takes_no_part() {
        // The reference is 2, and its mean has variance 8/4; an image of 2 differs from it by no more than its noise.
        let truth = Truth::new(&measured(&[[0.0, 0.0], [4.0, 4.0]]));
        assert!((truth.square([2.0, 2.0].into_iter()) + 4.0 / truth.threshold[0].powi(2)).abs() < 1e-6);
        let exact = Truth::new(&measured(&[[2.0, 2.0], [2.0, 2.0]]));
        let t = tvi(2.0 * CANDELAS) / CANDELAS;
        let errors = exact.errors(&measured(&[[3.0, 2.0], [1.0, 2.0]]));
        assert!((errors.error().value - 0.5_f64.sqrt() / t).abs() < 1e-4);
        assert!(errors.bias.value.abs() < 1e-9);
        assert!((exact.noise()).abs() < 1e-9);
    }

    #[test]
    fn what_all_turns_share_is_systematic() {
        let exact = Truth::new(&measured(&[[2.0, 2.0], [2.0, 2.0]]));
        let errors = exact.errors(&measured(&[[3.0, 3.0], [3.0, 3.0]]));
        assert!((errors.systematic / errors.error().value.powi(2) - 1.0).abs() < 1e-6);
        assert!((errors.bias.value - 0.5).abs() < 1e-6);
        // Four turns with a correct mean: its square is 0, and their variance 4/3 implies a noise of 1/3.
        let noisy = exact.errors(&measured(&[[3.0, 1.0], [1.0, 3.0], [3.0, 1.0], [1.0, 3.0]]));
        assert!((noisy.systematic / noisy.error().value.powi(2) + 1.0 / 3.0).abs() < 1e-6);
    }

    #[test]
    fn the_factor_of_few_turns_is_that_of_the_tables() {
        for (freedom, factor) in [(3, 3.182), (5, 2.571), (10, 2.228), (30, 2.042)] {
            assert!((student(freedom) / factor - 1.0).abs() < 0.02, "{freedom}: {}", student(freedom));
        }
    }

    #[test]
    fn half_the_error_in_the_same_time_is_four_times_the_efficiency() {
        let exact = Truth::new(&measured(&[[2.0, 2.0], [2.0, 2.0]]));
        let a = exact.errors(&measured(&[[3.0, 1.0], [1.0, 3.0]]));
        let b = exact.errors(&measured(&[[2.5, 1.5], [1.5, 2.5]]));
        assert!((b.relative(&a).value - 0.5).abs() < 1e-6);
        assert!((b.efficiency(&a, 1.0).value - 4.0).abs() < 1e-4);
        assert!((b.efficiency(&a, 2.0).value - 2.0).abs() < 1e-4);
    }
}

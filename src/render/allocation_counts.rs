//! How many camera samples pixels get, from the variance and the cost of each.

/// Steps by which the rate converges at which error is exchanged for cost.
const ITERATIONS: usize = 8;
/// Fewest and most samples of a pixel, relative to the mean.
const RANGE: [f64; 2] = [0.5, 8.0];

/// What numbers follow from.
#[derive(Clone, Copy)]
pub(super) struct Rules {
    /// Samples of the pilot as a fraction of those of the image.
    pub(super) fraction: f64,
    /// Pixels to each side over which means are averaged.
    pub(super) mean_radius: usize,
    /// The same of variances; `None`: over all pixels of a material.
    pub(super) radius: Option<usize>,
    /// True if pixels have this number of samples or twice, 4 times or 8 times as many.
    pub(super) doubles: bool,
    /// Gain below which numbers remain uniform.
    pub(super) min_gain: f64,
}

/// Where pixels have paths of their own.
pub(super) const ALONE: Rules =
    Rules { fraction: 0.05, mean_radius: 1, radius: Some(2), doubles: false, min_gain: 1.05 };
/// Where they share them: few samples do not tell what is left of the noise of one pixel from that of others, so numbers
/// follow from visible lights, whose edges gain nothing by sharing, and from materials: metal and glass share nothing
/// either. All others have as many samples as each other, so that they share all of their paths.
pub(super) const SHARED: Rules = Rules { fraction: 0.025, mean_radius: 4, radius: None, doubles: true, min_gain: 1.03 };

/// Numbers of samples n ∝ √(v/c), limited to [`RANGE`], of the same cost as `spp` everywhere; or [`doubled`] ones.
pub(super) fn counts(weights: &[f32], costs: &[f32], (rules, spp): (&Rules, u32)) -> Vec<u32> {
    if rules.doubles {
        return doubled(weights, costs, spp);
    }
    let wanted: Vec<f32> = weights.iter().zip(costs).map(|(v, c)| (v / c.max(1.0)).sqrt()).collect();
    let limit = |n: f64| n.clamp(RANGE[0], RANGE[1]);
    let of_pixel = |factor: f64, (w, c): (&f32, &f32)| limit(factor * f64::from(*w)) * f64::from(*c);
    let cost_of = |factor: f64| wanted.iter().zip(costs).map(|pixel| of_pixel(factor, pixel)).sum::<f64>();
    let all = costs.iter().map(|c| f64::from(*c)).sum::<f64>();
    // Bisection of the logarithm; costs rise with the factor
    let (mut low, mut high) = (-60.0_f64, 60.0_f64);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if cost_of(middle.exp2()) < all { low = middle } else { high = middle }
    }
    let factor = low.exp2();
    // Where nothing varies, all pixels have the mean
    let is_open = |w: f64| w > 0.0 && factor.is_finite();
    let count = |w: f64| if is_open(w) { limit(factor * w) } else { RANGE[0] };
    wanted.iter().map(|w| ((count(f64::from(*w)) * f64::from(spp)).round() as u32).max(1)).collect()
}

/// `spp` samples, or 2, 4 or 8 times as many where that lowers error × cost of the image.
fn doubled(weights: &[f32], costs: &[f32], spp: u32) -> Vec<u32> {
    let pixels = || weights.iter().zip(costs).map(|(v, c)| [f64::from(*v), f64::from(c.max(1.0))]);
    // From n to 2n samples the error falls by v/2n, and the cost rises by c n
    let factor = |[v, c]: [f64; 2], rate: f64| {
        let mut n = 1.0;
        while n < RANGE[1] && v > 2.0 * n * n * c * rate {
            n *= 2.0;
        }
        n
    };
    let mut rate = f64::INFINITY;
    for _ in 0..ITERATIONS {
        let (error, cost) = pixels().fold((0.0, 0.0), |(error, cost), [v, c]| {
            let n = factor([v, c], rate);
            (error + v / n, cost + c * n)
        });
        rate = error / cost;
    }
    pixels().map(|pixel| factor(pixel, rate) as u32 * spp).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::SQRT_2;

    #[test]
    fn numbers_of_samples_follow_noise_and_cost_and_keep_the_time() {
        // Two in three pixels have a quarter of the variance of the others, and one of these costs twice as much
        let weights: Vec<f32> = (0..300).map(|i| if i % 3 == 0 { 4.0 } else { 1.0 }).collect();
        let costs: Vec<f32> = (0..300).map(|i| if i % 3 == 1 { 2.0 } else { 1.0 }).collect();
        let counts = counts(&weights, &costs, (&ALONE, 64));
        assert!((f64::from(counts[0]) / f64::from(counts[2]) - 2.0).abs() < 0.05, "{:?}", &counts[..3]);
        assert!((f64::from(counts[2]) / f64::from(counts[1]) - SQRT_2).abs() < 0.05, "{:?}", &counts[..3]);
        let time: f64 = counts.iter().zip(&costs).map(|(&n, &c)| f64::from(n) * f64::from(c)).sum();
        let uniform = 64.0 * f64::from(costs.iter().sum::<f32>());
        assert!((time / uniform - 1.0).abs() < 0.01, "{time} {uniform}");
    }

    #[test]
    fn no_pixel_has_less_than_half_or_more_than_eight_times_the_mean() {
        let weights: Vec<f32> = (0..1000_u16).map(|i| if i == 5 { 1e12 } else { f32::from(i % 2) * 1e-9 }).collect();
        let counts = counts(&weights, &[1.0; 1000], (&ALONE, 16));
        assert_eq!((counts[5], counts[0]), (128, 8));
        assert!(counts.iter().all(|n| (8..=128).contains(n)));
        let still = super::counts(&[0.0; 4], &[1.0; 4], (&ALONE, 16));
        assert!(still.iter().all(|n| *n >= 1), "nothing varies: {still:?}");
    }

    #[test]
    fn who_shares_has_a_power_of_two_of_samples_and_the_others_as_many_as_each_other() {
        // One pixel in 100 has 10,000 times the variance, one 20 times, one 1.5 times
        let weight = |i: usize| {
            if i % 100 == 7 {
                1e4
            } else if i % 100 == 8 {
                20.0
            } else if i % 100 == 9 {
                1.5
            } else {
                1.0
            }
        };
        let weights: Vec<f32> = (0..1000).map(weight).collect();
        let counts = counts(&weights, &[2.0; 1000], (&SHARED, 12));
        let error_and_cost = |counts: &[u32]| {
            let error: f64 = weights.iter().zip(counts).map(|(v, &n)| f64::from(*v) / f64::from(n)).sum();
            error * counts.iter().map(|&n| f64::from(n)).sum::<f64>()
        };
        assert_eq!(counts[7], 96);
        assert!(
            counts
                .iter()
                .enumerate()
                .all(|(i, n)| [12, 24, 48, 96].contains(n) && (i % 100 == 7 || i % 100 == 8 || *n == 12))
        );
        // None is better with twice or half as many, all pixels of its kind together
        let best = error_and_cost(&counts);
        for kind in [7, 8, 9] {
            for factor in [0.5, 2.0] {
                let mut other = counts.clone();
                other.iter_mut().skip(kind).step_by(100).for_each(|n| *n = (f64::from(*n) * factor) as u32);
                let is_allowed = (12..=96).contains(&other[kind]);
                assert!(!is_allowed || error_and_cost(&other) >= 0.999 * best, "{kind} {factor}");
            }
        }
    }
}

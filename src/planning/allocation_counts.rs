//! Numbers of camera samples and of emission rays per pixel, computed from variance and cost of both.

use super::constants::{BISECTIONS, CHUNK, ITERATIONS, MAX_EMISSION_RAYS, MIN_SPLIT, RANGE};
use rayon::prelude::*;

/// Parameters of the computation.
#[derive(Clone, Copy)]
pub(super) struct Rules {
    /// Samples of the pilot as a fraction of the samples of the image.
    pub(super) fraction: f64,
    /// Radius of the neighbourhood over which means are averaged (pixels).
    pub(super) mean_radius: usize,
    /// Radius of the neighbourhood over which variances are averaged (pixels). `None`: all pixels of a material.
    pub(super) radius: Option<usize>,
    /// True if counts are 1, 2, 4 or 8 times the count of the settings.
    pub(super) doubles: bool,
    /// Minimum gain for counts that are not uniform.
    pub(super) min_gain: f64,
}

/// Parameters for pixels with paths of their own.
pub(super) const ALONE: Rules =
    Rules { fraction: 0.05, mean_radius: 1, radius: Some(2), doubles: false, min_gain: 1.05 };
/// Parameters for pixels that share paths. Few samples cannot separate the remaining noise of one pixel from the noise
/// of others, so counts follow from visible lights and from materials. The edges of lights gain nothing by sharing, and
/// metal and glass share nothing. All other pixels have the same count, so that they share all of their paths.
pub(super) const SHARED: Rules = Rules { fraction: 0.025, mean_radius: 4, radius: None, doubles: true, min_gain: 1.03 };

/// Estimates of a pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pixel {
    /// Relative variance of a sample without visible emission.
    pub(super) rest: f32,
    /// Relative variance of the visible emission of a sample.
    pub(super) emission: f32,
    /// Cost of a sample.
    pub(super) cost: f32,
    /// Cost of an emission ray.
    pub(super) ray_cost: f32,
}

/// Samples and emission rays of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Share {
    /// Samples, relative to the mean.
    pub(super) samples: f64,
    /// Emission rays per sample, including its own.
    pub(super) emission_rays: u8,
}

impl Share {
    /// The share of every pixel if sampling is uniform.
    pub(super) const ONE: Share = Share { samples: 1.0, emission_rays: 1 };

    /// Error and cost of a pixel with this share. The path of a sample includes one emission ray. If there are more,
    /// this ray is traced again, to separate its emission from the rest of the path.
    pub(super) fn of(self, pixel: &Pixel) -> [f64; 2] {
        let Pixel { rest, emission, cost, ray_cost } = *pixel;
        let emission_rays = f64::from(self.emission_rays);
        let error = (f64::from(rest) + f64::from(emission) / emission_rays) / self.samples;
        let of_rays = if self.emission_rays > 1 { emission_rays * f64::from(ray_cost) } else { 0.0 };
        [error, (f64::from(cost.max(1.0)) + of_rays) * self.samples]
    }

    /// The share with the least error + rate × cost. Samples and emission rays each follow from their own variance:
    /// n ∝ √(v/c).
    fn best(pixel: &Pixel, rate: f64, rules: &Rules) -> Share {
        let [rest, emission, cost, ray_cost] =
            [pixel.rest, pixel.emission, pixel.cost.max(1.0), pixel.ray_cost.max(1.0)].map(f64::from);
        let all_rays = (emission / (ray_cost * rate)).sqrt();
        let with_rays = |samples: f64| {
            // NaN if nothing varies, which `max` replaces by 1
            let emission_rays = (all_rays / samples + 0.5).max(1.0).min(f64::from(MAX_EMISSION_RAYS));
            Share { samples, emission_rays: emission_rays as u8 }
        };
        let loss = |share: Share| {
            let [error, cost] = share.of(pixel);
            error + rate * cost
        };
        let limit = |variance: f64| (variance / (cost * rate)).sqrt().clamp(RANGE[0], RANGE[1]);
        let together = if rules.doubles { 1.0 } else { limit(rest + emission) };
        let first = Share { samples: together, emission_rays: 1 };
        let mut best = (first, loss(first));
        let mut consider = |share: Share| {
            let loss = loss(share);
            best = if loss < best.1 { (share, loss) } else { best };
        };
        // Without visible emission, further emission rays are never worth their cost
        let is_lit = emission > 0.0;
        if rules.doubles {
            for samples in [1.0, 2.0, 4.0, 8.0] {
                consider(Share { samples, emission_rays: 1 });
                if is_lit {
                    consider(with_rays(samples));
                }
            }
        } else if is_lit {
            consider(with_rays(together.max(MIN_SPLIT)));
            consider(with_rays(limit(rest).max(MIN_SPLIT)));
        }
        best.0
    }
}

/// Counts for all pixels.
pub(super) struct PixelCounts {
    /// Samples per pixel.
    pub(super) samples: Vec<u32>,
    /// Emission rays per sample.
    pub(super) emission_rays: Vec<u8>,
}

/// Computes the counts. Minimises the error at the cost of `spp` samples everywhere. With
/// [`Rules::doubles`], counts are 1, 2, 4 or 8 times `spp`, and minimise error × cost of the image. Pixels of cost 0,
/// without estimates, are not counted.
pub(super) fn counts(pixels: &[Pixel], rules: &Rules, spp: u32) -> PixelCounts {
    let sums = |rate: f64| -> [f64; 2] {
        let of_chunk = |pixels: &[Pixel]| {
            pixels.iter().filter(|pixel| pixel.cost > 0.0).fold([0.0; 2], |sum, pixel| {
                let of_pixel = Share::best(pixel, rate, rules).of(pixel);
                [sum[0] + of_pixel[0], sum[1] + of_pixel[1]]
            })
        };
        // Summed in the order of chunks, independent of threads
        let of_chunks: Vec<[f64; 2]> = pixels.par_chunks(CHUNK).map(of_chunk).collect();
        of_chunks.into_iter().fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]])
    };
    let rate = if rules.doubles {
        (0..ITERATIONS).fold(f64::INFINITY, |rate, _| {
            let [error, cost] = sums(rate);
            error / cost
        })
    } else {
        let costs = pixels.iter().map(|pixel| pixel.cost).filter(|cost| *cost > 0.0);
        let all: f64 = costs.map(|cost| f64::from(cost.max(1.0))).sum();
        // Bisection of the logarithm: the cost falls as the rate rises
        let (mut low, mut high) = (-100.0_f64, 60.0_f64);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if sums(middle.exp2())[1] > all { low = middle } else { high = middle }
        }
        high.exp2()
    };
    let share = |pixel: &Pixel| {
        let Share { samples, emission_rays } = Share::best(pixel, rate, rules);
        (((samples * f64::from(spp)).round() as u32).max(1), emission_rays)
    };
    let (samples, emission_rays) = pixels.par_iter().map(share).unzip();
    PixelCounts { samples, emission_rays }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::SQRT_2;

    /// Pixels with these variances and costs, without visible emission.
    fn pixels(variances: &[f32], costs: &[f32]) -> Vec<Pixel> {
        let pixel = |(&rest, &cost): (&f32, &f32)| Pixel { rest, emission: 0.0, cost, ray_cost: 1.0 };
        variances.iter().zip(costs).map(pixel).collect()
    }

    /// Sample counts of pixels without visible emission.
    fn numbers(variances: &[f32], costs: &[f32], rules: &Rules, spp: u32) -> Vec<u32> {
        let PixelCounts { samples, emission_rays } = counts(&pixels(variances, costs), rules, spp);
        assert!(emission_rays.iter().all(|n| *n == 1));
        samples
    }

    /// Error and cost of pixels with the computed counts.
    fn error_and_cost(pixels: &[Pixel], PixelCounts { samples, emission_rays }: &PixelCounts, spp: u32) -> [f64; 2] {
        let all = pixels.iter().zip(samples.iter().zip(emission_rays));
        all.fold([0.0; 2], |sum, (pixel, (&n, &emission_rays))| {
            let [error, cost] = Share { samples: f64::from(n) / f64::from(spp), emission_rays }.of(pixel);
            [sum[0] + error, sum[1] + cost]
        })
    }

    #[test]
    fn numbers_of_samples_follow_noise_and_cost_and_keep_the_time() {
        // Two in three pixels have a quarter of the variance of the third, and one of the two costs twice as much
        let weights: Vec<f32> = (0..300).map(|i| if i % 3 == 0 { 4.0 } else { 1.0 }).collect();
        let costs: Vec<f32> = (0..300).map(|i| if i % 3 == 1 { 2.0 } else { 1.0 }).collect();
        let counts = numbers(&weights, &costs, &ALONE, 64);
        assert!((f64::from(counts[0]) / f64::from(counts[2]) - 2.0).abs() < 0.05, "{:?}", &counts[..3]);
        assert!((f64::from(counts[2]) / f64::from(counts[1]) - SQRT_2).abs() < 0.05, "{:?}", &counts[..3]);
        let time: f64 = counts.iter().zip(&costs).map(|(&n, &c)| f64::from(n) * f64::from(c)).sum();
        let uniform = 64.0 * f64::from(costs.iter().sum::<f32>());
        assert!((time / uniform - 1.0).abs() < 0.01, "{time} {uniform}");
    }

    #[test]
    fn no_pixel_has_less_than_half_or_more_than_eight_times_the_mean() {
        let weights: Vec<f32> = (0..1000_u16).map(|i| if i == 5 { 1e12 } else { f32::from(i % 2) * 1e-9 }).collect();
        let counts = numbers(&weights, &[1.0; 1000], &ALONE, 16);
        assert_eq!((counts[5], counts[0]), (128, 8));
        assert!(counts.iter().all(|n| (8..=128).contains(n)));
        for rules in [ALONE, SHARED] {
            let still = numbers(&[0.0; 4], &[1.0; 4], &rules, 16);
            assert!(still.iter().all(|n| *n >= 1), "nothing varies: {still:?}");
        }
    }

    #[test]
    fn what_varies_by_visible_lights_has_more_emission_rays_and_not_more_paths() {
        // One pixel in 50 covers the edge of a lamp; a path costs 10 emission rays
        let pixel = |i: usize| Pixel {
            rest: 1.0,
            emission: if i.is_multiple_of(50) { 400.0 } else { 0.0 },
            cost: 20.0,
            ray_cost: 2.0,
        };
        let all: Vec<Pixel> = (0..1000).map(pixel).collect();
        for rules in [ALONE, SHARED] {
            let given = counts(&all, &rules, 64);
            let [edge, other] = [0, 1].map(|i| (given.samples[i], given.emission_rays[i]));
            assert_eq!(other.1, 1);
            // √(s c/(r c_look)) if neither count is at a limit
            assert!((50..64).contains(&edge.1), "{edge:?} {other:?}");
            assert!(edge.0 < 2 * other.0, "{edge:?} {other:?}");
            let [_, cost] = error_and_cost(&all, &given, 64);
            let uniform: f64 = all.iter().map(|pixel| f64::from(pixel.cost)).sum();
            assert!(
                rules.doubles || (cost / uniform - 1.0).abs() < 0.01,
                "emission rays are in the time: {cost} {uniform}"
            );
            // Much better than samples alone, and better than half or twice as many emission rays
            let alone: Vec<Pixel> =
                all.iter().map(|p| Pixel { rest: p.rest + p.emission, emission: 0.0, ..*p }).collect();
            let loss = |given: &PixelCounts| error_and_cost(&all, given, 64).iter().product::<f64>();
            assert!(loss(&given) < 0.65 * loss(&counts(&alone, &rules, 64)));
            for emission_rays in [edge.1 / 2, 2 * edge.1] {
                let changed = given.emission_rays.iter().map(|&n| if n > 1 { emission_rays } else { 1 }).collect();
                let changed = PixelCounts { samples: given.samples.clone(), emission_rays: changed };
                assert!(loss(&given) <= 1.001 * loss(&changed), "{emission_rays}");
            }
        }
        // If the rest varies as much, few additional emission rays are worth their cost
        let still: Vec<Pixel> = all.iter().map(|p| Pixel { rest: 400.0, ..*p }).collect();
        assert!(counts(&still, &ALONE, 64).emission_rays.iter().all(|n| *n <= 3));
    }

    #[test]
    fn who_is_split_has_as_many_samples_as_the_mean_at_least() {
        let power_of_two = |i: usize, by: usize| (i / by % 9) as f32 - 4.0;
        let pixel = |i: usize| {
            let [rest, emission] = [1, 9].map(|by| 0.1 * power_of_two(i, by).exp2());
            Pixel { rest, emission: 4.0 * emission, cost: 20.0, ray_cost: 2.0 }
        };
        let PixelCounts { samples, emission_rays } = counts(&(0..810).map(pixel).collect::<Vec<_>>(), &ALONE, 64);
        assert!(emission_rays.iter().any(|n| *n > 2));
        assert!(samples.iter().zip(&emission_rays).all(|(&n, &emission_rays)| emission_rays == 1 || n >= 64));
    }

    #[test]
    fn pixels_that_are_not_measured_have_no_part_in_the_cost() {
        let measured = Pixel { rest: 1.0, emission: 0.0, cost: 20.0, ray_cost: 2.0 };
        let noisy = Pixel { rest: 4.0, ..measured };
        let some: Vec<Pixel> = (0..300).map(|i| if i % 3 == 0 { noisy } else { measured }).collect();
        for rules in [ALONE, SHARED] {
            let alone = counts(&some, &rules, 64);
            let beside: Vec<Pixel> = some.iter().copied().chain(vec![Pixel::default(); 600]).collect();
            let PixelCounts { samples: numbers, emission_rays } = counts(&beside, &rules, 64);
            assert_eq!((&numbers[..300], &emission_rays[..300]), (&alone.samples[..], &alone.emission_rays[..]));
        }
    }

    #[test]
    fn who_shares_has_a_power_of_two_of_samples_and_the_others_as_many_as_each_other() {
        // One pixel in 100 has 10,000 times the variance, one 20 times, and one 1.5 times
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
        let counts = numbers(&weights, &[2.0; 1000], &SHARED, 12);
        let all = pixels(&weights, &[2.0; 1000]);
        let loss = |samples: &[u32]| {
            let counts = PixelCounts { samples: samples.to_vec(), emission_rays: vec![1; 1000] };
            error_and_cost(&all, &counts, 12).iter().product::<f64>()
        };
        assert_eq!(counts[7], 96);
        assert!(
            counts
                .iter()
                .enumerate()
                .all(|(i, n)| [12, 24, 48, 96].contains(n) && (i % 100 == 7 || i % 100 == 8 || *n == 12))
        );
        // No count is better halved or doubled for all pixels of its kind
        let best = loss(&counts);
        for kind in [7, 8, 9] {
            for factor in [0.5, 2.0] {
                let mut other = counts.clone();
                other.iter_mut().skip(kind).step_by(100).for_each(|n| *n = (f64::from(*n) * factor) as u32);
                let is_allowed = (12..=96).contains(&other[kind]);
                assert!(!is_allowed || loss(&other) >= 0.999 * best, "{kind} {factor}");
            }
        }
    }
}

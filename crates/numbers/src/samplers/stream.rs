//! Streams: nodes in the tree of domains.

use super::blue_noise::BLOCK;
use super::kind::SamplerKind;
use super::net::Net;
use crate::math::ONE_MINUS_EPSILON;
use crate::math::hash::{pcg4d, unit_f32};

/// Combined with the key of a stream of independent numbers to give its numbers.
pub const INDEPENDENT: u32 = 0x5bd1_e995;

/// A node in the tree of domains of one sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleStream(pub(super) Kind);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Independent { key: [u32; 3] },
    Sobol(Net),
    SobolBlueNoise(Net),
}

impl SampleStream {
    /// The root stream of sample `sample` of a pixel. Streams of different seeds are independent.
    pub fn new(kind: SamplerKind, pixel: [u32; 2], sample: u32, seed: u32) -> Self {
        SampleStream(match kind {
            SamplerKind::Independent => {
                let h = pcg4d([pixel[0], pixel[1], sample, seed]);
                Kind::Independent { key: [h[0], h[1], h[2]] }
            }
            SamplerKind::Stratified => {
                let [a, b, ..] = pcg4d([pixel[0], pixel[1], sample, seed]);
                Kind::Sobol(Net { key: [a, b], index: 0, pixel: [0; 2] })
            }
            SamplerKind::Sobol => Kind::Sobol(Net::new(pixel, pixel, sample, seed)),
            SamplerKind::SobolBlueNoise => {
                Kind::SobolBlueNoise(Net::new(pixel.map(|x| x / BLOCK), pixel, sample, seed))
            }
        })
    }

    /// The domain `key` below this node.
    #[inline]
    pub fn domain(&self, key: u32) -> Self {
        SampleStream(match &self.0 {
            Kind::Independent { key: k } => {
                let h = pcg4d([k[0], k[1], k[2], key]);
                Kind::Independent { key: [h[0], h[1], h[2]] }
            }
            Kind::Sobol(net) => Kind::Sobol(net.domain(key)),
            Kind::SobolBlueNoise(net) => Kind::SobolBlueNoise(net.domain(key)),
        })
    }

    /// Point `index` of the `count` points of the domain `key` for this sample.
    #[inline]
    pub fn split(&self, key: u32, count: u32, index: u32) -> Self {
        SampleStream(match &self.0 {
            Kind::Independent { .. } => return self.domain(key).domain(index),
            Kind::Sobol(net) => Kind::Sobol(net.split(key, count, index)),
            Kind::SobolBlueNoise(net) => Kind::SobolBlueNoise(net.split(key, count, index)),
        })
    }

    /// Up to four numbers in [0, 1) of this domain.
    #[inline]
    pub fn draw<const N: usize>(&self) -> [f32; N] {
        let mut u: [f32; N] = match &self.0 {
            Kind::Independent { key } => {
                let h = pcg4d([key[0], key[1], key[2], INDEPENDENT]);
                std::array::from_fn(|i| unit_f32(h[i]))
            }
            Kind::Sobol(net) => net.draw(),
            Kind::SobolBlueNoise(net) => net.draw_blue_noise(),
        };
        for x in &mut u {
            *x = x.min(ONE_MINUS_EPSILON);
        }
        u
    }

    /// One number in [0, 1) of a sub-domain, for decisions that do not benefit from stratification (Russian roulette).
    #[inline]
    pub fn draw_random(&self, key: u32) -> f32 {
        let domain = self.domain(key);
        match &domain.0 {
            Kind::Independent { .. } => domain.draw::<1>()[0],
            Kind::Sobol(net) | Kind::SobolBlueNoise(net) => net.random(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use strum::IntoEnumIterator;

    #[test]
    fn streams_are_functions_of_their_arguments() {
        for kind in SamplerKind::iter() {
            let draw = |seed| SampleStream::new(kind, [3, 9], 17, seed).domain(4).split(2, 8, 5).draw::<4>();
            assert_eq!(draw(1), draw(1));
            assert_ne!(draw(1), draw(2));
        }
    }

    #[test]
    fn a_seed_does_not_shift_the_image_of_another() {
        for kind in SamplerKind::iter() {
            let draw = |x, y, seed| SampleStream::new(kind, [x, y], 0, seed).domain(4).draw::<2>();
            for seed in 1..200 {
                for shift in 0..64 {
                    assert_ne!(draw(70 + shift, 9, 0), draw(70, 9, seed), "{kind:?} {seed} {shift}");
                    assert_ne!(draw(70, 9 + shift, 0), draw(70, 9, seed), "{kind:?} {seed} {shift}");
                }
            }
        }
    }

    #[test]
    fn nothing_comes_again_in_other_pixels_samples_and_seeds() {
        for kind in SamplerKind::iter() {
            let draw =
                |[x, y]: [u32; 2], sample, seed| SampleStream::new(kind, [x, y], sample, seed).domain(4).draw::<2>();
            for [x, y] in [[3, 200], [70, 9], [255, 0]] {
                for (dx, dy) in [(256, 0), (0, 256), (256, 256), (512, 0), (65_536, 0)] {
                    assert_ne!(draw([x, y], 5, 0), draw([x + dx, y + dy], 5, 0), "{kind:?} {dx} {dy}");
                }
                for sample in [65_536, 131_072, 1 << 31] {
                    assert_ne!(draw([x, y], 5, 0), draw([x, y], 5 + sample, 0), "{kind:?} {sample}");
                    assert_ne!(draw([x, y], 5 + sample, 0), draw([x, y], 5, 1), "{kind:?} {sample}");
                }
                // Seeds whose multiples of the golden ratio are close
                assert_ne!(draw([x, y], 5, 0), draw([x, y], 5, 244_002_641), "{kind:?}");
            }
        }
    }

    /// Keys of 10⁵ random (domain, seed) pairs.
    fn pairs() -> impl Iterator<Item = (u32, u32)> {
        (0..100_000).map(|i| {
            let [domain, seed, ..] = pcg4d([i, 1, 2, 3]);
            (domain, seed)
        })
    }

    #[test]
    fn random_domains_and_seeds_draw_different_numbers() {
        for kind in SamplerKind::iter() {
            let draw = |(domain, seed)| SampleStream::new(kind, [70, 9], 3, seed).domain(domain).draw::<4>();
            let drawn: std::collections::HashSet<_> = pairs().map(|pair| draw(pair).map(f32::to_bits)).collect();
            assert_eq!(drawn.len(), 100_000, "{kind:?}");
        }
    }

    /// The correlation of two independent streams over 64 pixels exceeds 0.65 with probability 10⁻⁸; correlated streams
    /// would have equal samples.
    #[test]
    fn random_domains_and_seeds_are_not_correlated() {
        for kind in SamplerKind::iter() {
            let numbers = |(domain, seed)| {
                let at = |i: u32| SampleStream::new(kind, [i % 8 * 9, i / 8 * 9], i % 3, seed).domain(domain);
                std::array::from_fn::<f32, 64, _>(|i| at(i as u32).draw::<1>()[0] - 0.5)
            };
            let dot = |a: &[f32; 64], b: &[f32; 64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
            let mut last = numbers((0, 0));
            for pair in pairs() {
                let this = numbers(pair);
                let r = dot(&last, &this) / (dot(&last, &last) * dot(&this, &this)).sqrt();
                assert!(r.abs() < 0.65, "{kind:?} {pair:?}: {r}");
                last = this;
            }
        }
    }

    /// The fraction of 256 × 256 numbers inside a disk. Over 64 seeds it has the standard deviation of independent
    /// pixels, or is up to 1.6 times smaller if neighbouring errors have opposite signs. The standard deviation of 64
    /// values has a standard error of 9 %: the bounds are 4 of them. The mean of all is the area, within 4 standard
    /// errors as well.
    #[test]
    fn means_of_images_of_different_seeds_are_independent() {
        let area = std::f64::consts::PI * 0.1;
        for kind in SamplerKind::iter() {
            let mean = |seed| {
                let is_in = |i: u32| {
                    let [x, y] = SampleStream::new(kind, [i % 256, i / 256], 0, seed).domain(4).draw::<2>();
                    (x - 0.5).powi(2) + (y - 0.4).powi(2) < 0.1
                };
                (0..65_536).filter(|&i| is_in(i)).count() as f64 / 65_536.0
            };
            let means: Vec<f64> = (0..64).map(mean).collect();
            let expected = (area * (1.0 - area) / 65_536.0).sqrt();
            let spread = (means.iter().map(|m| (m - area).powi(2)).sum::<f64>() / 64.0).sqrt() / expected;
            let error = (means.iter().sum::<f64>() / 64.0 - area) / (expected / 8.0);
            assert!((0.64 / 1.6..1.36).contains(&spread) && error.abs() < 4.0, "{kind:?}: {spread} {error}");
        }
    }

    #[test]
    fn every_dimension_has_mean_one_half_over_pixels_and_samples() {
        for kind in SamplerKind::iter() {
            let mut sums = [0.0_f64; 4];
            let n = 64 * 64 * 4;
            for i in 0..n {
                let stream = SampleStream::new(kind, [i % 64, i / 64 % 64], i / 4096, 7).domain(11);
                for (sum, u) in sums.iter_mut().zip(stream.draw::<4>()) {
                    assert!((0.0..1.0).contains(&u));
                    *sum += f64::from(u);
                }
            }
            for sum in sums {
                // Independent numbers: σ of the mean is 0.289/√n = 0.00226; four of them.
                assert!((sum / f64::from(n) - 0.5).abs() < 0.009, "{kind:?} {}", sum / f64::from(n));
            }
        }
    }

    #[test]
    fn sobol_splits_are_stratified_over_samples_and_points() {
        for kind in [SamplerKind::Sobol, SamplerKind::SobolBlueNoise] {
            let mut counts = [0; 64];
            for sample in 0..8 {
                for i in 0..8 {
                    let [u] = SampleStream::new(kind, [5, 6], sample, 0).split(3, 8, i).draw::<1>();
                    counts[(u * 64.0) as usize] += 1;
                }
            }
            assert!(counts.iter().all(|&c| c == 1), "{kind:?}: each of the 64 intervals holds one of 64 points");
        }
    }

    #[test]
    fn numbers_of_roulette_are_uniform_and_differ_between_domains() {
        for kind in SamplerKind::iter() {
            let (mut sum, mut squares) = (0.0_f64, 0.0_f64);
            let n = 64 * 64 * 4;
            for i in 0..n {
                let stream = SampleStream::new(kind, [i % 64, i / 64 % 64], i / 4096, 7).domain(11);
                let u = stream.draw_random(3);
                assert!((0.0..1.0).contains(&u) && u != stream.draw_random(4));
                sum += f64::from(u);
                squares += f64::from(u * u);
            }
            // σ of the means: 0.289/√n = 0.00226 and 0.298/√n = 0.00233; four of them
            let (mean, square) = (sum / f64::from(n), squares / f64::from(n));
            assert!((mean - 0.5).abs() < 0.009 && (square - 1.0 / 3.0).abs() < 0.0094, "{kind:?} {mean} {square}");
        }
    }

    #[test]
    fn samplers_say_whether_their_samples_are_independent() {
        let independent = |kind: SamplerKind| kind.has_independent_samples();
        assert!(independent(SamplerKind::Independent) && independent(SamplerKind::Stratified));
        assert!(!independent(SamplerKind::Sobol) && !independent(SamplerKind::SobolBlueNoise));
    }
}

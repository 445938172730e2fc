//! Stateless random numbers: `u(pixel, sample, domain)`, independent of the order in which they are drawn.
//!
//! A [`SampleStream`] is a small value. The root stream of a (pixel, sample) pair is split into *domains*, one for
//! each decision (lens, light choice, BSDF, …); each domain gives up to four numbers that are well distributed
//! over the samples of the pixel. [`SampleStream::split`] gives several points to one decision, and these are
//! well distributed over both the points and the samples. The sequences are those of the `openqmc` crate:
//! Owen-scrambled Sobol' [Burley 2020], and the same with its error made blue noise over the image
//! [Belcour and Heitz 2021].

use crate::math::ONE_MINUS_EPSILON;
use crate::math::hash::{pcg4d, unit_f32};
use openqmc::bntables::{self, table_value};
use openqmc::float::uint_to_float;
use openqmc::owen::shuffled_scrambled_sobol;
use openqmc::{State64Bit, pcg};
use strum::{EnumIter, EnumString, IntoStaticStr, VariantNames};

/// The sequence.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, EnumIter, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum SamplerKind {
    /// Independent uniform numbers.
    Independent,
    /// The points of each sample and decision an Owen-scrambled Sobol' net by themselves, samples independent of each
    /// other.
    Stratified,
    /// Owen-scrambled Sobol', pixels independent of each other.
    Sobol,
    /// Owen-scrambled Sobol' whose error is blue noise over the image.
    #[default]
    #[strum(serialize = "zsobol")]
    SobolBlueNoise,
}

impl SamplerKind {
    /// True if the samples of a pixel are independent of each other.
    pub fn has_independent_samples(self) -> bool {
        match self {
            SamplerKind::Independent | SamplerKind::Stratified => true,
            SamplerKind::Sobol | SamplerKind::SobolBlueNoise => false,
        }
    }
}

/// A place in the tree of domains of one sample.
#[derive(Clone, Copy, Debug)]
pub struct SampleStream(Kind);

#[derive(Clone, Copy, Debug)]
enum Kind {
    Independent { key: [u32; 3] },
    Sobol(State64Bit),
    SobolBlueNoise(State64Bit),
}

/// A point of an Owen-scrambled Sobol' sequence in four dimensions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NetPoint {
    /// Its index.
    pub index: u32,
    /// Seed of the scramble.
    pub seed: u32,
}

impl NetPoint {
    /// The first coordinates.
    #[inline]
    fn coordinates<const N: usize>(self) -> [f32; N] {
        shuffled_scrambled_sobol::<N>(self.index, self.seed).map(uint_to_float)
    }
}

#[inline]
fn sobol_point(s: &State64Bit) -> NetPoint {
    NetPoint { index: u32::from(s.sample_id), seed: pcg::output(s.pattern_id) }
}

/// Index and seed are such that neighbouring pixels have errors of opposite signs.
#[inline]
fn blue_noise_point(s: &State64Bit) -> NetPoint {
    let (keys, ranks) = (bntables::sobol::key_table(), bntables::sobol::rank_table());
    let t = table_value::<8, 8, 0>(s.pixel_id, pcg::output(s.pattern_id) as u16, keys, ranks);
    NetPoint { index: u32::from(s.sample_id) ^ t.rank, seed: t.key }
}

impl SampleStream {
    /// The root stream of sample `sample` of a pixel. Streams of different seeds are independent.
    pub fn new(kind: SamplerKind, pixel: [u32; 2], sample: u32, seed: u32) -> Self {
        // openqmc knows 256 × 256 pixels and 65,536 samples, and a frame number to which it adds that of the pixel: what is
        // beyond these, and seeds, make frames that have nothing in common, or there would be shifted copies of one image
        let (x, y) = ((pixel[0] & 0xff) as i32, (pixel[1] & 0xff) as i32);
        let index = (sample & 0xffff) as i32;
        let [frame, ..] = pcg4d([pixel[0] >> 8, pixel[1] >> 8, sample >> 16, seed]);
        let frame = (frame >> 2) as i32;
        SampleStream(match kind {
            SamplerKind::Independent => {
                let h = pcg4d([pixel[0], pixel[1], sample, seed]);
                Kind::Independent { key: [h[0], h[1], h[2]] }
            }
            SamplerKind::Stratified => {
                let [frame, ..] = pcg4d([pixel[0], pixel[1], sample, seed]);
                Kind::Sobol(State64Bit::new(x, y, (frame >> 2) as i32, 0).pixel_decorrelate())
            }
            SamplerKind::Sobol => Kind::Sobol(State64Bit::new(x, y, frame, index).pixel_decorrelate()),
            SamplerKind::SobolBlueNoise => Kind::SobolBlueNoise(State64Bit::new(x, y, frame, index)),
        })
    }

    /// The domain `key` below this place.
    #[inline]
    pub fn domain(&self, key: u32) -> Self {
        SampleStream(match &self.0 {
            Kind::Independent { key: k } => {
                let h = pcg4d([k[0], k[1], k[2], key]);
                Kind::Independent { key: [h[0], h[1], h[2]] }
            }
            Kind::Sobol(s) => Kind::Sobol(s.new_domain(key as i32)),
            Kind::SobolBlueNoise(s) => Kind::SobolBlueNoise(s.new_domain(key as i32)),
        })
    }

    /// Point `index` of `count` points that the domain `key` gives to this one sample.
    #[inline]
    pub fn split(&self, key: u32, count: u32, index: u32) -> Self {
        SampleStream(match &self.0 {
            Kind::Independent { .. } => return self.domain(key).domain(index),
            Kind::Sobol(s) => Kind::Sobol(s.new_domain_split(key as i32, count as i32, index as i32)),
            Kind::SobolBlueNoise(s) => Kind::SobolBlueNoise(s.new_domain_split(key as i32, count as i32, index as i32)),
        })
    }

    /// Up to four numbers in [0, 1) of this domain.
    #[inline]
    pub fn draw<const N: usize>(&self) -> [f32; N] {
        let mut u: [f32; N] = match &self.0 {
            Kind::Independent { key } => {
                let h = pcg4d([key[0], key[1], key[2], 0x5bd1_e995]);
                std::array::from_fn(|i| unit_f32(h[i]))
            }
            Kind::Sobol(s) => sobol_point(s).coordinates(),
            Kind::SobolBlueNoise(s) => blue_noise_point(s).coordinates(),
        };
        for x in &mut u {
            *x = x.min(ONE_MINUS_EPSILON);
        }
        u
    }

    /// The point whose coordinates [`draw`](Self::draw) gives; `None` if the numbers are independent.
    #[inline]
    pub fn net_point(&self) -> Option<NetPoint> {
        match &self.0 {
            Kind::Independent { .. } => None,
            Kind::Sobol(s) => Some(sobol_point(s)),
            Kind::SobolBlueNoise(s) => Some(blue_noise_point(s)),
        }
    }

    /// One number in [0, 1) of a sub-domain where stratification gains nothing (roulette).
    #[inline]
    pub fn draw_random(&self, key: u32) -> f32 {
        let domain = self.domain(key);
        let u = match &domain.0 {
            Kind::Independent { .. } => domain.draw::<1>()[0],
            Kind::Sobol(s) => uint_to_float(s.draw_rnd::<1>()[0]),
            Kind::SobolBlueNoise(s) => uint_to_float(s.pixel_decorrelate().draw_rnd::<1>()[0]),
        };
        u.min(ONE_MINUS_EPSILON)
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
                // Seeds whose multiples of the golden ratio are neighbours
                assert_ne!(draw([x, y], 5, 0), draw([x, y], 5, 244_002_641), "{kind:?}");
            }
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

//! Exact sums over the samples of a pixel. They do not depend, bit for bit, on the order of the samples and their
//! division over passes, processes and machines. [`PixelSums`] has their values as floating-point numbers.

use super::fixed_sums::{FixedSum, LIMIT, SquareSum, UnitSum};
use super::pixel::{PixelSample, PixelSums};
use lumiris_lanes::level;
use lumiris_lanes::sums::{self, Sums, TERM, Term};
use lumiris_numbers::math::Rgb;

/// Fewer samples are added one by one, which takes less time.
const FEW: usize = 3;
/// Number of binary digits between the two parts of a sum.
const FIXED_SHIFT: u32 = (sums::HIGH[0] - sums::QUANTA[0]) as u32;
const SQUARE_SHIFT: u32 = (sums::HIGH[1] - sums::QUANTA[1]) as u32;

impl Term for PixelSample {
    #[inline(always)]
    fn numbers(&self) -> [f32; TERM] {
        let Rgb { r, g, b } = self.radiance;
        let Some(f) = &self.features else { return [r, g, b, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] };
        // The number after the albedo counts hits
        [r, g, b, f.depth, f.albedo.r, f.albedo.g, f.albedo.b, 1.0, f.normal.x, f.normal.y, f.normal.z, 0.0]
    }
}

/// Exact sums of radiance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RadianceAccumulator {
    /// Number of samples.
    pub count: u32,
    /// Samples with a radiance that is not finite, or beyond [`LIMIT`]. They count as black.
    pub invalid: u32,
    /// Σ radiance.
    pub radiance: [FixedSum; 3],
}

impl RadianceAccumulator {
    /// Adds a sample. Returns false if it is invalid.
    #[inline(always)]
    pub fn add(&mut self, radiance: Rgb) -> bool {
        self.count = self.count.wrapping_add(1);
        let channels = radiance.to_array();
        // False for NaN
        let is_valid = channels.iter().all(|value| value.abs() < LIMIT);
        if is_valid {
            self.radiance.iter_mut().zip(channels).for_each(|(sum, value)| sum.add(value));
        } else {
            self.invalid += 1;
        }
        is_valid
    }

    /// Adds the sums of other samples.
    pub fn merge(&mut self, other: &RadianceAccumulator) {
        self.count = self.count.wrapping_add(other.count);
        self.invalid = self.invalid.wrapping_add(other.invalid);
        self.radiance.iter_mut().zip(&other.radiance).for_each(|(a, b)| a.merge(b));
    }

    /// Σ radiance.
    pub fn values(&self) -> [f64; 3] {
        self.radiance.each_ref().map(FixedSum::value)
    }
}

/// Exact sums over the samples of a pixel: 216 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PixelAccumulator {
    /// Number of samples and Σ radiance.
    pub radiance: RadianceAccumulator,
    /// Σ radiance², per channel.
    pub squares: [SquareSum; 3],
    /// Σ albedo.
    pub albedo: [UnitSum; 3],
    /// Σ normal.
    pub normal: [UnitSum; 3],
    /// Σ depth of the samples that hit a surface.
    pub depth: FixedSum,
    /// Number of samples that hit a surface.
    pub hits: u32,
    /// Lowest index of a sample that hit a surface; 0 if there is none.
    pub first_hit: u32,
    /// Material index of that sample, plus one; 0 if there is none.
    pub material: u32,
    /// Geometry index of that sample, plus one; 0 if there is none.
    pub object: u32,
    /// Records of the irradiance cache requested by this pixel.
    pub records: u32,
}

impl PixelAccumulator {
    /// Adds the sample with the given index.
    #[inline]
    pub fn add(&mut self, index: u32, sample: &PixelSample) {
        if self.radiance.add(sample.radiance) {
            self.squares.iter_mut().zip(sample.radiance.to_array()).for_each(|(sum, value)| sum.add_square(value));
        }
        let Some(features) = &sample.features else { return };
        for c in 0..3 {
            self.albedo[c].add(features.albedo[c]);
            self.normal[c].add(features.normal[c]);
        }
        if features.depth.abs() < LIMIT {
            self.depth.add(features.depth);
        }
        self.first(1, index, features.material + 1, features.object + 1);
    }

    /// Adds consecutive samples; `index` is the index of the first one.
    pub fn add_all(&mut self, index: u32, samples: &[PixelSample]) {
        let mut index = index;
        for samples in samples.chunks(sums::MOST) {
            let sums = if samples.len() < FEW { None } else { sums::sums(level(), samples) };
            match sums {
                Some(sums) => self.add_sums(index, samples, &sums),
                None => (index..).zip(samples).for_each(|(index, sample)| self.add(index, sample)),
            }
            index = index.wrapping_add(samples.len() as u32);
        }
    }

    /// Adds samples with their sums computed in lanes.
    #[inline]
    fn add_sums(&mut self, index: u32, samples: &[PixelSample], sums: &Sums) {
        self.radiance.count = self.radiance.count.wrapping_add(samples.len() as u32);
        let number = |of: &[[f64; 4]; 2], c: usize| [of[0][c], of[1][c]];
        for c in 0..3 {
            self.radiance.radiance[c].add_parts(number(&sums.numbers, c), FIXED_SHIFT);
            self.squares[c].add_parts(number(&sums.squares, c), SQUARE_SHIFT);
            self.albedo[c].add_quanta(sums.others[0][c]);
            self.normal[c].add_quanta(sums.others[1][c]);
        }
        self.depth.add_parts(number(&sums.numbers, 3), FIXED_SHIFT);

        let mut hits = UnitSum::default();
        hits.add_quanta(sums.others[0][3]);
        let first = (index..).zip(samples).find_map(|(index, sample)| Some((index, sample.features.as_ref()?)));
        if let Some((index, features)) = first {
            self.first(hits.value() as u32, index, features.material + 1, features.object + 1);
        }
    }

    /// Adds the sums of other samples. All parts of an image have the records of the whole image.
    pub fn merge(&mut self, other: &PixelAccumulator) {
        self.radiance.merge(&other.radiance);
        for c in 0..3 {
            self.squares[c].merge(&other.squares[c]);
            self.albedo[c].merge(&other.albedo[c]);
            self.normal[c].merge(&other.normal[c]);
        }
        self.depth.merge(&other.depth);
        self.records = self.records.max(other.records);
        if other.hits > 0 {
            self.first(other.hits, other.first_hit, other.material, other.object);
        }
    }

    /// Counts `hits` samples that hit a surface. Index, material and geometry belong to the first of them.
    #[inline(always)]
    fn first(&mut self, hits: u32, index: u32, material: u32, object: u32) {
        if self.hits == 0 || index < self.first_hit {
            (self.first_hit, self.material, self.object) = (index, material, object);
        }
        self.hits = self.hits.wrapping_add(hits);
    }

    /// The sums as floating-point numbers.
    pub fn sums(&self) -> PixelSums {
        PixelSums {
            count: self.radiance.count.into(),
            radiance: self.radiance.values(),
            radiance_squared: self.squares.each_ref().map(SquareSum::value),
            hits: self.hits.into(),
            albedo: self.albedo.each_ref().map(UnitSum::value),
            normal: self.normal.each_ref().map(UnitSum::value),
            depth: self.depth.value(),
            material: self.material,
            object: self.object,
            invalid: self.radiance.invalid.into(),
            records: self.records,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Features;
    use lumiris_numbers::math::Vec3;
    use lumiris_test_support::random::{RngExt, pcg32};

    #[test]
    fn sums_do_not_drift_at_high_sample_counts() {
        // 0.1 as f32, 10⁷ times: an f32 sum would have an error of some percent
        let sample = PixelSample { radiance: Rgb::splat(0.1), ..PixelSample::default() };
        let mut sums = PixelAccumulator::default();
        (0..10_000_000).for_each(|i| sums.add(i, &sample));
        assert_eq!(sums.sums().mean()[0], f64::from(0.1_f32));
        assert!(sums.sums().variance_of_mean()[0] < 1e-22, "all samples are equal");
    }

    #[test]
    fn variance_of_mean_is_that_of_the_samples_over_n() {
        let mut sums = PixelAccumulator::default();
        for (i, v) in [1.0, 2.0, 3.0, 6.0].into_iter().enumerate() {
            sums.add(i as u32, &PixelSample { radiance: Rgb::splat(v), ..PixelSample::default() });
        }
        // Sample variance 14/3, divided by 4.
        assert!((sums.sums().variance_of_mean()[1] - 14.0 / 12.0).abs() < 1e-12);
    }

    #[test]
    fn a_sample_that_is_not_finite_or_too_bright_is_counted_and_not_added() {
        for value in [f32::NAN, f32::INFINITY, LIMIT, -LIMIT, f32::MAX] {
            let mut sums = PixelAccumulator::default();
            sums.add(0, &PixelSample { radiance: Rgb::new(value, 1.0, 1.0), ..PixelSample::default() });
            let sums = sums.sums();
            assert_eq!((sums.count, sums.invalid, sums.mean(), sums.radiance_squared), (1, 1, [0.0; 3], [0.0; 3]));
        }
    }

    #[test]
    fn many_samples_at_once_have_the_sums_of_each_by_itself() {
        let mut s = pcg32([7, 8, 7]);
        let special = [f32::NAN, f32::INFINITY, -4.0, 4.0, 64.0, 5e11, LIMIT, 1e-45, -0.0];
        for round in 0..2000 {
            let exponents = [1.0, 8.0, 40.0][round % 3];
            let mut number = |limit: f32| {
                let [a, b, c] = s.random::<[f32; 3]>();
                match round % 7 {
                    // Halves of quanta
                    0 => ((a * 64.0).floor() + 0.5) * [1.0_f32, 0.5][(b < 0.5) as usize] * 2.0_f32.powi(-29),
                    1 => ((a * 64.0).floor() - 31.5) * 2.0_f32.powi(-56),
                    2 if c < 0.01 => special[(b * special.len() as f32) as usize],
                    _ => (b - 0.3).signum() * (1.0 + c) * ((exponents * (a - 1.0)).exp2() * limit),
                }
            };
            let mut sample = |i| {
                let features = Features {
                    albedo: Rgb::new(number(2.0), number(1.0), number(0.5)),
                    normal: Vec3::new(number(1.0), number(1.0), number(1.0)),
                    depth: number(1e8),
                    material: i,
                    object: 2 * i,
                };
                let features = Some(features).filter(|f| i > 3 && f.normal.x < 0.7);
                PixelSample {
                    radiance: Rgb::new(number(31.0), number(1.0), number(1e-3)),
                    features,
                    ..PixelSample::default()
                }
            };
            let samples: Vec<PixelSample> = (0..1 + round as u32 % 300).map(&mut sample).collect();
            let [mut each, mut all] = [PixelAccumulator::default(); 2];
            (5..).zip(&samples).for_each(|(i, sample)| each.add(i, sample));
            all.add_all(5, &samples);
            assert_eq!(all, each, "{round}");
            let sums = (samples.len() <= sums::MOST).then(|| sums::sums(level(), &samples));
            let is_plain = !matches!(round % 7, 2) && exponents < 40.0;
            assert!(!is_plain || sums.is_none_or(|sums| sums.is_some()), "{round}: not one by one");
        }
    }

    #[test]
    fn the_parts_of_a_pixel_add_up_in_any_order() {
        let mut s = pcg32([7, 7, 7]);
        let samples: Vec<PixelSample> = (0..64)
            .map(|i| {
                let [a, b, c] = s.random::<[f32; 3]>();
                let features = Features {
                    albedo: Rgb::new(a, b, c),
                    normal: Vec3::new(a - 0.5, b, c),
                    depth: 100.0 * a,
                    material: i,
                    object: 2 * i,
                };
                let radiance = Rgb::new(a, 1e6 * b * b * b, 1e-4 * c);
                PixelSample { radiance, features: (i > 3 && b < 0.7).then_some(features), ..PixelSample::default() }
            })
            .collect();

        // Parts in reverse order
        let part = |range: std::ops::Range<usize>| {
            let mut sums = PixelAccumulator::default();
            range.rev().for_each(|i| sums.add(i as u32, &samples[i]));
            sums
        };
        let mut whole = PixelAccumulator::default();
        (0..).zip(&samples).for_each(|(i, sample)| whole.add(i, sample));
        assert!(whole.hits > 20 && whole.material == whole.first_hit + 1 && whole.first_hit > 3);

        // Any division gives the same sums
        for parts in [vec![0..1, 1..64], vec![32..64, 0..32], vec![60..64, 5..60, 0..2, 2..5]] {
            let mut merged = PixelAccumulator::default();
            parts.into_iter().for_each(|range| merged.merge(&part(range)));
            assert_eq!(merged, whole);
        }
        assert_eq!(size_of::<PixelAccumulator>(), 216);
    }
}

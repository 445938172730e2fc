//! Media defined by samples on a grid over the unit cube, with linear interpolation.
//!
//! As in pbrt-v4, sample i of n of a dense grid lies at (i + ½)/n, and the samples beyond the outermost ones are zero.
//! A sparse grid has a map from its indices to positions.

use super::coefficients::Coefficients;
use super::sparse::SparseSamples;
use lumiris_numbers::math::{Rgb, Vec3};
use std::ops::{Add, Mul};

/// Samples on a grid, x fastest.
#[derive(Clone, Debug)]
pub struct Samples<T> {
    resolution: [usize; 3],
    values: Vec<T>,
}

impl<T: Copy + Default + Add<Output = T> + Mul<f32, Output = T>> Samples<T> {
    /// A grid of the given resolution; `None` if the number of values does not match.
    pub fn new(resolution: [usize; 3], values: Vec<T>) -> Option<Self> {
        let count = resolution.iter().try_fold(1_usize, |product, &n| product.checked_mul(n))?;
        (count == values.len() && count > 0).then_some(Samples { resolution, values })
    }

    /// Number of samples along each axis.
    pub fn resolution(&self) -> [usize; 3] {
        self.resolution
    }

    /// Bytes of the values.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.values[..])
    }

    /// All values, x fastest.
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// The same grid with other values.
    #[must_use]
    pub fn map(mut self, f: impl Fn(T) -> T) -> Self {
        self.values.iter_mut().for_each(|value| *value = f(*value));
        self
    }

    #[inline]
    fn sample(&self, x: isize, y: isize, z: isize) -> T {
        let [nx, ny, nz] = self.resolution.map(|n| n as isize);
        if (0..nx).contains(&x) && (0..ny).contains(&y) && (0..nz).contains(&z) {
            self.values[(x + nx * (y + ny * z)) as usize]
        } else {
            T::default()
        }
    }

    /// The value at a point of the unit cube.
    pub fn at(&self, p: Vec3) -> T {
        let [nx, ny, nz] = self.resolution.map(|n| n as f32);
        let place = p * Vec3::new(nx, ny, nz) - 0.5;
        let base = place.floor();
        let t = place - base;
        let [x, y, z] = base.to_array().map(|v| v as isize);
        let lerp = |t: f32, a: T, b: T| a * (1.0 - t) + b * t;
        let row = |y, z| lerp(t.x, self.sample(x, y, z), self.sample(x + 1, y, z));
        let plane = |z| lerp(t.y, row(y, z), row(y + 1, z));
        lerp(t.z, plane(z), plane(z + 1))
    }

    /// The maximum of `measure` over the samples that contribute to values in a box of the unit cube. Samples outside
    /// the grid are zero, and so is their measure.
    pub fn bound(&self, low: Vec3, high: Vec3, measure: impl Fn(T) -> f32) -> f32 {
        let range = |axis: usize| {
            let n = self.resolution[axis] as f32;
            let first = (low[axis] * n - 0.5).floor() as isize;
            // One sample more, since rounding may shift a point on the wall
            let last = (high[axis] * n - 0.5).floor() as isize + 1;
            (first - 1).max(0) as usize..(last + 2).clamp(0, self.resolution[axis] as isize) as usize
        };
        let [nx, ny, _] = self.resolution;
        let mut greatest = 0.0_f32;
        for z in range(2) {
            for y in range(1) {
                let row = nx * (y + ny * z);
                greatest = range(0).fold(greatest, |max, x| max.max(measure(self.values[row + x])));
            }
        }
        greatest
    }
}

/// A scalar field in the unit cube.
#[derive(Clone, Debug)]
pub enum Scalars {
    /// A sample for each cell.
    Dense(Samples<f32>),
    /// A tree of voxels.
    Sparse(SparseSamples),
}

impl Scalars {
    /// The value at a point of the unit cube.
    #[inline]
    pub fn at(&self, p: Vec3) -> f32 {
        match self {
            Scalars::Dense(samples) => samples.at(p),
            Scalars::Sparse(samples) => samples.at(p),
        }
    }

    /// A bound of the values in a box in the unit cube; at least zero.
    pub fn bound(&self, low: Vec3, high: Vec3) -> f32 {
        match self {
            Scalars::Dense(samples) => samples.bound(low, high, |value| value),
            Scalars::Sparse(samples) => samples.bound(low, high),
        }
    }

    /// Number of samples along each axis.
    pub fn resolution(&self) -> [usize; 3] {
        match self {
            Scalars::Dense(samples) => samples.resolution(),
            Scalars::Sparse(samples) => samples.resolution(),
        }
    }

    /// The least and the greatest sample.
    pub fn extremes(&self) -> [f32; 2] {
        match self {
            Scalars::Dense(samples) => {
                let ends = [f32::INFINITY, f32::NEG_INFINITY];
                samples.values().iter().fold(ends, |[low, high], &v| [low.min(v), high.max(v)])
            }
            Scalars::Sparse(samples) => samples.extremes(),
        }
    }

    /// Bytes of the samples.
    pub fn bytes(&self) -> usize {
        match self {
            Scalars::Dense(samples) => samples.bytes(),
            Scalars::Sparse(samples) => samples.bytes(),
        }
    }
}

/// Emitted radiance by temperature: colours of black bodies between which it is interpolated.
#[derive(Clone, Debug)]
pub struct Temperature {
    /// Samples of it.
    pub samples: Scalars,
    /// Subtracted from the samples.
    pub offset: f32,
    /// Then a factor: kelvins.
    pub scale: f32,
    /// Radiance at temperatures from 0 on in equal steps.
    pub radiance: Vec<Rgb>,
    /// Step between these (K).
    pub step: f32,
}

/// Maximum temperature without emission (K).
const COLD: f32 = 100.0;

impl Temperature {
    /// Emitted radiance at a point of the unit cube.
    fn le(&self, p: Vec3) -> Rgb {
        let kelvin = (self.samples.at(p) - self.offset) * self.scale;
        if !(kelvin > COLD) || self.radiance.len() < 2 {
            return Rgb::BLACK;
        }
        let place = (kelvin / self.step).min((self.radiance.len() - 1) as f32);
        let i = (place as usize).min(self.radiance.len() - 2);
        self.radiance[i].lerp(self.radiance[i + 1], place - i as f32)
    }
}

/// Coefficients of one colour, times a density.
#[derive(Clone, Debug)]
pub struct UniformGrid {
    /// Absorption where the density is 1 (1/m).
    pub sigma_a: Rgb,
    /// Scattering where the density is 1 (1/m).
    pub sigma_s: Rgb,
    /// The density.
    pub density: Scalars,
    /// Emitted radiance; with a temperature, a factor of its radiance.
    pub le: Rgb,
    /// Spatially varying factor of the emission, if any.
    pub le_scale: Option<Samples<f32>>,
    /// Determines the colour of the emission, if present.
    pub temperature: Option<Temperature>,
}

impl UniformGrid {
    /// The medium at a point of the unit cube.
    pub(super) fn at(&self, p: Vec3) -> Coefficients {
        let density = self.density.at(p);
        let le = if self.is_emissive() {
            let glow = self.temperature.as_ref().map_or(Rgb::WHITE, |t| t.le(p));
            self.le * glow * self.le_scale.as_ref().map_or(1.0, |scale| scale.at(p))
        } else {
            Rgb::BLACK
        };
        Coefficients { sigma_a: self.sigma_a * density, sigma_s: self.sigma_s * density, le }
    }

    pub(super) fn is_emissive(&self) -> bool {
        !(self.le * self.sigma_a).is_black()
    }

    pub(super) fn bytes(&self) -> usize {
        let temperature = self.temperature.as_ref().map_or(0, |t| t.samples.bytes());
        self.density.bytes() + self.le_scale.as_ref().map_or(0, Samples::bytes) + temperature
    }
}

/// An RGB coefficient for each sample.
#[derive(Clone, Debug)]
pub struct RgbGrid {
    /// Absorption before scale; 1 if there is none.
    pub sigma_a: Option<Samples<Rgb>>,
    /// Scattering before scale; 1 if there is none.
    pub sigma_s: Option<Samples<Rgb>>,
    /// Factor of both (1/m).
    pub scale: f32,
    /// Emitted radiance, if any.
    pub le: Option<Samples<Rgb>>,
}

impl RgbGrid {
    /// The medium at a point of the unit cube.
    pub(super) fn at(&self, p: Vec3) -> Coefficients {
        let of = |samples: &Option<Samples<Rgb>>| samples.as_ref().map_or(Rgb::WHITE, |s| s.at(p)) * self.scale;
        let le = self.le.as_ref().map_or(Rgb::BLACK, |s| s.at(p));
        Coefficients { sigma_a: of(&self.sigma_a), sigma_s: of(&self.sigma_s), le }
    }

    /// A bound of σ_t in a box.
    pub(super) fn bound(&self, low: Vec3, high: Vec3) -> f32 {
        let of =
            |samples: &Option<Samples<Rgb>>| samples.as_ref().map_or(1.0, |s| s.bound(low, high, Rgb::max_component));
        (of(&self.sigma_a) + of(&self.sigma_s)) * self.scale
    }

    pub(super) fn resolution(&self) -> [usize; 3] {
        self.sigma_a.as_ref().or(self.sigma_s.as_ref()).map_or([1; 3], Samples::resolution)
    }

    pub(super) fn bytes(&self) -> usize {
        [&self.sigma_a, &self.sigma_s, &self.le].into_iter().flatten().map(Samples::bytes).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::random::{RngExt, pcg32};

    #[test]
    fn values_are_interpolated_and_bounded_by_their_boxes() {
        let mut stream = pcg32([2, 7, 1]);
        let resolution = [3, 5, 2];
        let samples = Samples::new(resolution, (0..30).map(|_| stream.random::<f32>()).collect()).unwrap();
        for z in 0..2 {
            for x in 0..3 {
                let p = Vec3::new((x as f32 + 0.5) / 3.0, 0.3, (z as f32 + 0.5) / 2.0);
                assert!((samples.at(p) - samples.values[x + 3 * (1 + 5 * z)]).abs() < 1e-5);
            }
        }
        for _ in 0..10_000 {
            let [a, b] = [0, 1].map(|_| Vec3::from(std::array::from_fn::<f32, 3, _>(|_| stream.random::<f32>())));
            let (low, high) = (a.min(b), a.max(b));
            let p = low + (high - low) * stream.random::<f32>();
            assert!(samples.at(p) <= samples.bound(low, high, |v| v) + 1e-6);
        }
        assert_eq!(samples.at(Vec3::splat(-0.4)), 0.0);
        assert!(Samples::new([2, 2, 2], vec![0.0; 7]).is_none());
        assert!(Samples::<f32>::new([0, 2, 2], vec![]).is_none());
    }
}

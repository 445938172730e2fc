//! Pixel filters and their importance sampling.
//!
//! The position of a sample in the pixel has the density |f|/∫|f| and the weight f/(pdf·∫f) = ±∫|f|/∫f. So the mean
//! weight is 1, and the weighted mean of radiance is the filtered image [Ernst, Stamminger and Greiner 2006; Pharr et
//! al. 2023, §8.8]. All filters are products of a function of x and a function of y. Box and triangle are sampled in
//! closed form; all others from piecewise constant tables of [`ENTRIES_PER_UNIT`] equal steps per pixel.
//!
//! `integrators/camera_sampler.rs` draws the positions; `render/tile_samples.rs` adds the weighted samples.

use lumiris_numbers::math::distribution::BinPosition;
use lumiris_numbers::math::warp::sample_tent;
use lumiris_numbers::math::{PiecewiseConstant1D, Vec2};
use std::f32::consts::PI;

/// Table entries per pixel, as in pbrt-v4. The table covers twice the radius.
pub const ENTRIES_PER_UNIT: f32 = 32.0;

/// A pixel filter; radii in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PixelFilter {
    /// Constant.
    Box {
        /// Radius in x.
        rx: f32,
        /// Radius in y.
        ry: f32,
    },
    /// Tent that is 0 at the radius.
    Triangle {
        /// Radius in x.
        rx: f32,
        /// Radius in y.
        ry: f32,
    },
    /// Gaussian, shifted down to 0 at the radius.
    Gaussian {
        /// Radius in x.
        rx: f32,
        /// Radius in y.
        ry: f32,
        /// Standard deviation.
        sigma: f32,
    },
    /// Cubic of [Mitchell and Netravali 1988], scaled to the radius.
    Mitchell {
        /// Radius in x.
        rx: f32,
        /// Radius in y.
        ry: f32,
        /// Blur.
        b: f32,
        /// Ringing.
        c: f32,
    },
    /// sinc(x)·sinc(x/τ), truncated at the radius.
    LanczosSinc {
        /// Radius in x.
        rx: f32,
        /// Radius in y.
        ry: f32,
        /// Width of the window.
        tau: f32,
    },
}

/// A position in the filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterSample {
    /// Offset from the centre of the pixel, in pixels.
    pub offset: Vec2,
    /// f/(pdf·∫f).
    pub weight: f32,
}

fn gaussian(x: f32, sigma: f32) -> f32 {
    (-x * x / (2.0 * sigma * sigma)).exp()
}

fn mitchell(x: f32, b: f32, c: f32) -> f32 {
    let x = x.abs();
    let cubic = if x <= 1.0 {
        ((12.0 - 9.0 * b - 6.0 * c) * x + (-18.0 + 12.0 * b + 6.0 * c)) * x * x + (6.0 - 2.0 * b)
    } else if x <= 2.0 {
        (((-b - 6.0 * c) * x + (6.0 * b + 30.0 * c)) * x + (-12.0 * b - 48.0 * c)) * x + (8.0 * b + 24.0 * c)
    } else {
        0.0
    };
    cubic / 6.0
}

fn sinc(x: f32) -> f32 {
    let x = PI * x;
    if x.abs() < 1e-3 { 1.0 - x * x / 6.0 } else { x.sin() / x }
}

impl PixelFilter {
    /// Radii in pixels.
    pub fn radius(&self) -> Vec2 {
        match *self {
            PixelFilter::Box { rx, ry }
            | PixelFilter::Triangle { rx, ry }
            | PixelFilter::Gaussian { rx, ry, .. }
            | PixelFilter::Mitchell { rx, ry, .. }
            | PixelFilter::LanczosSinc { rx, ry, .. } => Vec2::new(rx, ry),
        }
    }

    /// Value at `offset` from the centre of the pixel, not normalised; 0 outside the radius.
    pub fn evaluate(&self, offset: Vec2) -> f32 {
        let r = self.radius();
        self.evaluate_axis(offset.x, r.x) * self.evaluate_axis(offset.y, r.y)
    }

    fn evaluate_axis(&self, x: f32, r: f32) -> f32 {
        if x.abs() > r {
            return 0.0;
        }
        match *self {
            PixelFilter::Box { .. } => 1.0,
            PixelFilter::Triangle { .. } => r - x.abs(),
            PixelFilter::Gaussian { sigma, .. } => (gaussian(x, sigma) - gaussian(r, sigma)).max(0.0),
            PixelFilter::Mitchell { b, c, .. } => mitchell(2.0 * x / r, b, c),
            PixelFilter::LanczosSinc { tau, .. } => sinc(x) * sinc(x / tau),
        }
    }

    /// A sampler of the filter. A filter that cannot be sampled (radius or integral not positive) becomes a point at
    /// the centre of the pixel.
    pub fn sampler(&self) -> FilterSampler {
        let r = self.radius();
        FilterSampler { x: self.axis_sampler(r.x), y: self.axis_sampler(r.y) }
    }

    fn axis_sampler(&self, r: f32) -> AxisSampler {
        if r <= 0.0 || !r.is_finite() {
            return AxisSampler::Point;
        }
        match self {
            PixelFilter::Box { .. } => AxisSampler::Box { r },
            PixelFilter::Triangle { .. } => AxisSampler::Tent { r },
            PixelFilter::Gaussian { .. } | PixelFilter::Mitchell { .. } | PixelFilter::LanczosSinc { .. } => {
                self.table_sampler(r)
            }
        }
    }

    fn table_sampler(&self, r: f32) -> AxisSampler {
        let n = ((2.0 * ENTRIES_PER_UNIT * r).ceil() as usize).clamp(8, 4096);
        let values: Vec<f32> =
            (0..n).map(|i| self.evaluate_axis(((i as f32 + 0.5) / n as f32 * 2.0 - 1.0) * r, r)).collect();
        let absolute: Vec<f32> = values.iter().map(|v| v.abs()).collect();
        let sum: f64 = values.iter().map(|&v| f64::from(v)).sum();
        let absolute_sum: f64 = absolute.iter().map(|&v| f64::from(v)).sum();
        let weight = (absolute_sum / sum) as f32;
        if !weight.is_finite() {
            return AxisSampler::Point;
        }
        let is_negative = values.iter().map(|&v| v < 0.0).collect();
        let (bin_width, distribution) = (2.0 * r / n as f32, PiecewiseConstant1D::new(&absolute));
        AxisSampler::Table { r, bin_width, distribution, is_negative, weight }
    }
}

#[derive(Clone, Debug)]
enum AxisSampler {
    Point,
    Box { r: f32 },
    Tent { r: f32 },
    Table { r: f32, bin_width: f32, distribution: PiecewiseConstant1D, is_negative: Vec<bool>, weight: f32 },
}

/// A sample of a filter along one axis.
struct AxisSample {
    offset: f32,
    weight: f32,
}

impl AxisSampler {
    #[inline]
    fn sample(&self, u: f32) -> AxisSample {
        let with_weight_one = |offset| AxisSample { offset, weight: 1.0 };
        match self {
            AxisSampler::Point => with_weight_one(0.0),
            AxisSampler::Box { r } => with_weight_one((2.0 * u - 1.0) * r),
            AxisSampler::Tent { r } => with_weight_one(sample_tent(u, *r)),
            AxisSampler::Table { r, bin_width, distribution, is_negative, weight } => {
                match distribution.bin_position(u) {
                    Some(BinPosition { index, fraction }) => AxisSample {
                        offset: (index as f32 + fraction) * bin_width - r,
                        weight: if is_negative[index] { -weight } else { *weight },
                    },
                    None => with_weight_one(0.0),
                }
            }
        }
    }

    fn radius(&self) -> f32 {
        match self {
            AxisSampler::Point => 0.0,
            AxisSampler::Box { r } | AxisSampler::Tent { r } | AxisSampler::Table { r, .. } => *r,
        }
    }

    /// The sampled filter, normalised.
    fn value(&self, x: f32) -> f32 {
        match self {
            AxisSampler::Point => 0.0,
            AxisSampler::Box { r } if x.abs() <= *r => 0.5 / r,
            AxisSampler::Tent { r } if x.abs() <= *r => (r - x.abs()) / (r * r),
            AxisSampler::Box { .. } | AxisSampler::Tent { .. } => 0.0,
            AxisSampler::Table { r, distribution, is_negative, weight, .. } => {
                let place = (x / r + 1.0) * 0.5;
                if !(0.0..1.0).contains(&place) {
                    return 0.0;
                }
                let index = ((place * is_negative.len() as f32) as usize).min(is_negative.len() - 1);
                let sign = if is_negative[index] { -1.0 } else { 1.0 };
                distribution.pdf(place) * 0.5 / r * weight * sign
            }
        }
    }
}

/// Samples positions from a [`PixelFilter`].
#[derive(Clone, Debug)]
pub struct FilterSampler {
    x: AxisSampler,
    y: AxisSampler,
}

impl FilterSampler {
    /// The position for two uniform numbers in [0, 1).
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> FilterSample {
        let (x, y) = (self.x.sample(u[0]), self.y.sample(u[1]));
        FilterSample { offset: Vec2::new(x.offset, y.offset), weight: x.weight * y.weight }
    }

    /// The filter sampled by [`Self::sample`], normalised, at an offset from the centre of the pixel. For filters
    /// sampled from a table, the value of the table.
    pub fn value(&self, offset: Vec2) -> f32 {
        self.x.value(offset.x) * self.y.value(offset.y)
    }

    /// Radii in pixels; the filter is 0 beyond.
    pub fn radius(&self) -> Vec2 {
        Vec2::new(self.x.radius(), self.y.radius())
    }

    /// True if all samples are at the centre of the pixel.
    pub fn is_point(&self) -> bool {
        matches!(self.x, AxisSampler::Point) || matches!(self.y, AxisSampler::Point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::random::{RngExt, pcg32};
    use lumiris_test_support::{Moments, assert_chi_squared};

    const FILTERS: [PixelFilter; 7] = [
        PixelFilter::Box { rx: 0.5, ry: 0.5 },
        PixelFilter::Triangle { rx: 2.0, ry: 1.5 },
        PixelFilter::Gaussian { rx: 1.5, ry: 1.5, sigma: 0.5 },
        PixelFilter::Gaussian { rx: 3.0, ry: 0.3, sigma: 0.2 },
        PixelFilter::Mitchell { rx: 2.0, ry: 2.0, b: 1.0 / 3.0, c: 1.0 / 3.0 },
        PixelFilter::Mitchell { rx: 2.5, ry: 2.0, b: 0.0, c: 0.75 },
        PixelFilter::LanczosSinc { rx: 4.0, ry: 4.0, tau: 3.0 },
    ];

    /// Integrals of f and |f| over a cell of an n×n grid.
    fn cell_integrals(filter: &PixelFilter, n: usize, cell: usize) -> [f64; 2] {
        let r = filter.radius();
        let sub = 16;
        let mut sums = [0.0; 2];
        for i in 0..sub * sub {
            let x = ((cell % n) as f32 + ((i % sub) as f32 + 0.5) / sub as f32) / n as f32;
            let y = ((cell / n) as f32 + ((i / sub) as f32 + 0.5) / sub as f32) / n as f32;
            let f = f64::from(filter.evaluate((Vec2::new(x, y) * 2.0 - 1.0) * r));
            sums[0] += f;
            sums[1] += f.abs();
        }
        sums.map(|s| s / (sub * sub) as f64)
    }

    #[test]
    fn places_follow_the_magnitude_and_weights_the_sign() {
        const N: usize = 16;
        for (k, filter) in FILTERS.into_iter().enumerate() {
            let cells: Vec<[f64; 2]> = (0..N * N).map(|c| cell_integrals(&filter, N, c)).collect();
            let total: f64 = cells.iter().map(|c| c[0]).sum();
            let magnitude: f64 = cells.iter().map(|c| c[1]).sum();

            // Sample, and check signs and magnitudes
            let (sampler, r) = (filter.sampler(), filter.radius());
            let mut stream = pcg32([k as u32, 8, 8]);
            let count = 100_000;
            let mut observed = vec![0.0; N * N];
            let mut weights = Moments::default();
            for _ in 0..count {
                let s = sampler.sample(stream.random::<[f32; 2]>());
                assert!(s.offset.abs().cmple(r).all());
                let f = filter.evaluate(s.offset);
                assert!(f == 0.0 || f.signum() == s.weight.signum() || f.abs() < 0.02, "{filter:?} {s:?} {f}");
                let ratio = f64::from(s.weight.abs()) / (magnitude / total);
                assert!((ratio - 1.0).abs() < 0.02, "{filter:?}: {ratio}");
                weights.add(f64::from(s.weight));
                let cell = ((s.offset / r + 1.0) * 0.5 * N as f32).min(Vec2::splat(N as f32 - 1.0));
                observed[cell.y as usize * N + cell.x as usize] += 1.0;
            }

            // Check the mean weight and the density
            weights.assert_mean(1.0, 1e-5, 1e-5);
            let expected: Vec<f64> = cells.iter().map(|c| (c[1] / magnitude * f64::from(count)).max(0.05)).collect();
            assert_chi_squared(&observed, &expected, 1e-5);
        }
    }

    #[test]
    fn weighted_moments_are_those_of_the_filter() {
        for (k, filter) in FILTERS.into_iter().enumerate() {
            let n = 64;
            let r = filter.radius();
            let (mut total, mut exact) = (0.0, 0.0);
            for cell in 0..n * n {
                let [f, _] = cell_integrals(&filter, n, cell);
                let x = f64::from(((cell % n) as f32 + 0.5) / n as f32 * 2.0 - 1.0) * f64::from(r.x);
                total += f;
                exact += f * x * x;
            }
            let sampler = filter.sampler();
            let mut stream = pcg32([k as u32, 9, 9]);
            let mut moments = Moments::default();
            for _ in 0..200_000 {
                let s = sampler.sample(stream.random::<[f32; 2]>());
                moments.add(f64::from(s.weight * s.offset.x * s.offset.x));
            }
            // Tolerance for the steps of the table: 0.004 of the squared radius
            let expected = exact / total;
            let slack = 0.004 * f64::from(r.x * r.x) / expected.abs();
            moments.assert_mean(expected, 1e-5, slack);
        }
    }

    #[test]
    fn values_are_those_of_the_samples_and_integrate_to_one() {
        for (k, filter) in FILTERS.into_iter().enumerate() {
            let (sampler, r) = (filter.sampler(), filter.radius());
            let mut stream = pcg32([k as u32, 10, 10]);
            let n = 480;

            // Integrate the values
            let (mut integral, mut moment) = (0.0, 0.0);
            for i in 0..n * n {
                let [x, y] = [i % n, i / n].map(|i| (i as f32 + 0.5) / n as f32 * 2.0 - 1.0);
                let value = f64::from(sampler.value(Vec2::new(x, y) * r) * 4.0 * r.x * r.y) / f64::from(n * n);
                integral += value;
                moment += value * f64::from(x * x);
            }
            assert!((integral - 1.0).abs() < 2e-3, "{filter:?}: {integral}");

            // Compare the second moment of samples
            let mut sampled = Moments::default();
            for _ in 0..100_000 {
                let s = sampler.sample(stream.random::<[f32; 2]>());
                sampled.add(f64::from(s.weight * s.offset.x * s.offset.x / (r.x * r.x)));
            }
            sampled.assert_mean(moment, 1e-5, 2e-3 / moment.abs());
            assert_eq!(sampler.value(r * 1.01), 0.0);
        }
        assert!(PixelFilter::Box { rx: 0.0, ry: 0.0 }.sampler().is_point());
    }

    #[test]
    fn filters_have_their_published_values() {
        let at = |filter: PixelFilter, x: f32| filter.evaluate(Vec2::new(x, 0.0)) / filter.evaluate(Vec2::ZERO);
        let mitchell = PixelFilter::Mitchell { rx: 2.0, ry: 2.0, b: 1.0 / 3.0, c: 1.0 / 3.0 };
        // (6 − 2B)/6 = 8/9 at 0, B/6 = 1/18 at 1.
        assert!((at(mitchell, 1.0) - 1.0 / 16.0).abs() < 1e-6);
        assert_eq!(at(mitchell, 2.1), 0.0);
        let lanczos = PixelFilter::LanczosSinc { rx: 3.0, ry: 3.0, tau: 3.0 };
        assert!(at(lanczos, 1.0).abs() < 1e-6 && at(lanczos, 2.0).abs() < 1e-6);
        assert!((at(lanczos, 1.5) - (-2.0 / (3.0 * PI)) * (2.0 / PI)).abs() < 1e-6);
        let triangle = PixelFilter::Triangle { rx: 2.0, ry: 2.0 };
        assert!((at(triangle, 0.5) - 0.75).abs() < 1e-6);
    }

    #[test]
    fn filters_that_cannot_be_sampled_are_points() {
        for filter in [
            PixelFilter::Box { rx: 0.0, ry: -1.0 },
            PixelFilter::Gaussian { rx: 1.0, ry: f32::NAN, sigma: 0.0 },
            PixelFilter::LanczosSinc { rx: f32::INFINITY, ry: 0.0, tau: 3.0 },
        ] {
            let s = filter.sampler().sample([0.3, 0.9]);
            assert!(s.offset.is_finite() && s.weight == 1.0);
        }
    }
}

//! Environment maps: radiance from all directions by an image, importance sampled.
//!
//! The image covers the unit square, which [`EnvironmentMapping`] maps to directions. The density is constant per
//! texel, or per block of nearly equal texels ([`TexelDistribution`]). It is proportional to the mean of the
//! interpolated luminance over the texel, times the solid angle of its row for latitude-longitude images.
//!
//! For bilinear lookups this mean is the image smoothed by [1/8, 6/8, 1/8] in both axes, which is positive wherever a
//! lookup is. The density per steradian is pdf(u, v)/4π for equal-area images, and pdf(u, v)/(2π² sin θ) for
//! latitude-longitude images.

use crate::lights::{LeAndPdf, LightSample};
use lumiris_lanes::environment::{Environment, equal_area_squares};
use lumiris_lanes::level;
use lumiris_lanes::prefetch::prefetch_square;
use lumiris_numbers::math::sphere_map::{
    equal_area_sphere_to_square, equal_area_square_to_sphere, lat_long_to_sphere, pdf_equal_area_square_to_sphere,
    pdf_lat_long_to_sphere, sphere_to_lat_long, wrap_equal_area_texel,
};
use lumiris_numbers::math::{Affine3A, Mat3, Rgb, TexelDistribution, Vec2, Vec3};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Minimum number of texel parts that an integral looks up.
const PARTS: usize = 1 << 18;
/// Directions that are looked up together.
const CHUNK: usize = 64;

/// How the unit square covers the sphere; z is up in the space of the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EnvironmentMapping {
    /// Equal-area octahedral map of a square image [Clarberg 2008], as in pbrt-v4.
    EqualArea,
    /// Longitude (x) and colatitude (y, 0 = +z), as in pbrt-v3.
    LatLong,
}

/// How texels are looked up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EnvironmentFilter {
    /// The texel that contains the point, as in pbrt-v4.
    Nearest,
    /// Blend of the four nearest texels, continuous on the sphere.
    Bilinear,
}

/// A direction sampled from an environment map, in the space of the light.
#[derive(Clone, Copy, Debug)]
pub struct EnvironmentSample {
    /// Unit direction.
    pub w: Vec3,
    /// Radiance from it.
    pub le: Rgb,
    /// Density per steradian.
    pub pdf: f32,
}

/// The first of four texels, and a position between their centres (0 to 1 per axis).
struct BilinearCorner {
    first: usize,
    fraction: Vec2,
}

/// The direction of a point of the unit square.
struct MappedDirection {
    w: Vec3,
    /// Density per steradian if the point is uniform.
    pdf: f32,
}

/// An image of the radiance that arrives from all directions.
#[derive(Clone, Debug)]
pub struct EnvironmentMap {
    width: usize,
    height: usize,
    mapping: EnvironmentMapping,
    filter: EnvironmentFilter,
    /// Red, green, blue and the density per unit area of the square, with a border that continues the image.
    texels: Vec<[f32; 4]>,
    distribution: TexelDistribution,
    luminance_integral: f32,
}

/// The colour with components that are negative or not finite set to 0.
pub(super) fn cleaned(c: Rgb) -> Rgb {
    c.map(|x| if x.is_finite() { x.max(0.0) } else { 0.0 })
}

/// The rotation of a transform, with a reflection if it has one: the nearby orthogonal map with the same x axis.
pub fn orthogonal(world_from_light: &Affine3A) -> Mat3 {
    let m = &world_from_light.matrix3;
    let x = Vec3::from(m.x_axis).normalize_or(Vec3::X);
    let (y0, z0) = (Vec3::from(m.y_axis), Vec3::from(m.z_axis));
    let y = (y0 - x * x.dot(y0)).normalize_or(x.any_orthonormal_vector());
    let z = x.cross(y);
    let z = if z.dot(z0) < 0.0 { -z } else { z };
    Mat3::from_cols(x, y, z)
}

/// The colour of a texel.
#[inline]
fn color([r, g, b, _]: [f32; 4]) -> Rgb {
    Rgb::new(r, g, b)
}

/// The cleaned texels with a border of one texel that continues the image around the sphere.
fn with_border(texels: &[Rgb], [width, height]: [usize; 2], mapping: EnvironmentMapping) -> Vec<[f32; 4]> {
    let (w, h) = (width as isize, height as isize);
    let mut bordered = Vec::with_capacity((width + 2) * (height + 2));
    for y in -1..=h {
        for x in -1..=w {
            let [x, y] = match mapping {
                EnvironmentMapping::EqualArea => wrap_equal_area_texel([x, y], w),
                // Beyond a pole, the opposite meridian follows.
                EnvironmentMapping::LatLong => {
                    let over_pole = y < 0 || y >= h;
                    let x = if over_pole { x + w / 2 } else { x };
                    [x.rem_euclid(w), y.clamp(0, h - 1)]
                }
            };
            let [r, g, b] = cleaned(texels[y as usize * width + x as usize]).to_array();
            bordered.push([r, g, b, 0.0]);
        }
    }
    bordered
}

/// A sample of an infinite light.
#[inline]
pub(in crate::lights) fn infinite_sample(wi: Vec3, li: Rgb, pdf: f32) -> LightSample {
    LightSample { li, wi, pdf, t: f32::INFINITY, p: Vec3::ZERO, n: Vec3::ZERO, p_error: Vec3::ZERO, is_delta: false }
}

impl EnvironmentMap {
    /// A map of linear RGB texels, rows from y = 0. Components that are negative or not finite become 0.
    ///
    /// Returns `Err` with a message if the sizes do not fit the mapping.
    pub fn new(
        texels: Vec<Rgb>,
        [width, height]: [usize; 2],
        mapping: EnvironmentMapping,
        filter: EnvironmentFilter,
    ) -> Result<Self, String> {
        if width == 0 || height == 0 || texels.len() != width * height {
            return Err(format!("an environment map of {width}×{height} has {} texels", texels.len()));
        }
        if mapping == EnvironmentMapping::EqualArea && width != height {
            return Err(format!("an equal-area environment map must be square, but it is {width}×{height}"));
        }

        // Table of the density; its values are stored beside the texels
        let texels = with_border(&texels, [width, height], mapping);
        let distribution = TexelDistribution::new(&[], 1);
        let mut map = EnvironmentMap { width, height, mapping, filter, texels, distribution, luminance_integral: 0.0 };
        map.distribution = TexelDistribution::new(&map.texel_weights(), width);
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let index = map.texel_index(x as isize, y as isize);
            map.texels[index][3] = map.distribution.pdf_of_texel([x, y]);
        }
        map.luminance_integral = map.distribution.integral() * map.weight_scale();
        Ok(map)
    }

    /// Width and height in texels.
    pub fn resolution(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// ∫ luminance dω over the sphere.
    pub fn luminance_integral(&self) -> f32 {
        self.luminance_integral
    }

    /// Radiance from the unit direction `w`.
    #[inline]
    pub fn le(&self, w: Vec3) -> Rgb {
        self.lookup(self.to_square(w))
    }

    /// Samples a direction; `None` if the map is black.
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> Option<EnvironmentSample> {
        let ([x, y], p) = self.distribution.sample(u)?;
        let texel = &self.texels[self.texel_index(x as isize, y as isize)];
        let MappedDirection { w, pdf } = self.to_sphere(p);
        let pdf = texel[3] * pdf;
        (pdf > 0.0 && pdf.is_finite()).then(|| EnvironmentSample { w: w.normalize(), le: self.lookup(p), pdf })
    }

    /// The data for vectorised sampling.
    pub(in crate::lights) fn lanes(&self, world_from_light: Mat3, scale: f32) -> Environment<'_> {
        Environment {
            distribution: &self.distribution,
            texels: &self.texels,
            is_equal_area: self.mapping == EnvironmentMapping::EqualArea,
            is_bilinear: self.filter == EnvironmentFilter::Bilinear,
            world_from_light,
            scale,
        }
    }

    /// Density of [`sample`](Self::sample) per steradian.
    #[inline]
    pub fn pdf(&self, w: Vec3) -> f32 {
        self.pdf_at(w, self.to_square(w))
    }

    /// [`le`](Self::le) and [`pdf`](Self::pdf).
    #[inline]
    pub fn le_and_pdf(&self, w: Vec3) -> LeAndPdf {
        let p = self.to_square(w);
        LeAndPdf { le: self.lookup(p), pdf: self.pdf_at(w, p) }
    }

    /// [`le_and_pdf`](Self::le_and_pdf) of `n` directions. The lookups are in a loop of their own, so that the cache
    /// misses of distant texels overlap.
    pub fn le_and_pdf_many(&self, n: usize, w: impl Fn(usize) -> Vec3, mut out: impl FnMut(usize, LeAndPdf)) {
        let (mut directions, mut points) = ([[0.0; CHUNK]; 3], [[0.0; CHUNK]; 2]);
        let mut values = [LeAndPdf::ZERO; CHUNK];
        for start in (0..n).step_by(CHUNK) {
            let count = CHUNK.min(n - start);
            for i in 0..count {
                (directions[0][i], directions[1][i], directions[2][i]) = w(start + i).into();
            }

            // Map coordinates, in lanes where possible
            let w = |i: usize| Vec3::new(directions[0][i], directions[1][i], directions[2][i]);
            match self.mapping {
                EnvironmentMapping::EqualArea => {
                    let w = directions.each_ref().map(|axis| &axis[..]);
                    equal_area_squares(level(), w, points.each_mut().map(|axis| &mut axis[..]));
                }
                EnvironmentMapping::LatLong => {
                    (0..count).for_each(|i| (points[0][i], points[1][i]) = self.to_square(w(i)).into());
                }
            }

            // Lookups, all of whose texels are requested first
            for (&x, &y) in points[0].iter().zip(&points[1]).take(count) {
                let first = self.bilinear_corner(Vec2::new(x, y)).first;
                prefetch_square(&self.texels, first, self.width + 2);
            }
            for (i, value) in values[..count].iter_mut().enumerate() {
                let p = Vec2::new(points[0][i], points[1][i]);
                *value = LeAndPdf { le: self.lookup(p), pdf: self.pdf_at(w(i), p) };
            }
            for (i, value) in values[..count].iter().enumerate() {
                out(start + i, *value);
            }
        }
    }

    /// Density in the direction `w`, which the mapping takes to the point `p` of the square.
    #[inline]
    fn pdf_at(&self, w: Vec3, p: Vec2) -> f32 {
        let density = match self.mapping {
            EnvironmentMapping::EqualArea => pdf_equal_area_square_to_sphere(),
            EnvironmentMapping::LatLong => pdf_lat_long_to_sphere(w),
        };
        let pdf = self.texels[self.nearest(p)][3] * density;
        if pdf.is_finite() { pdf } else { 0.0 }
    }

    #[inline]
    fn to_square(&self, w: Vec3) -> Vec2 {
        match self.mapping {
            EnvironmentMapping::EqualArea => equal_area_sphere_to_square(w),
            EnvironmentMapping::LatLong => sphere_to_lat_long(w),
        }
    }

    /// Index of a texel whose coordinates may be out of range by one.
    #[inline]
    fn texel_index(&self, x: isize, y: isize) -> usize {
        (y + 1) as usize * (self.width + 2) + (x + 1) as usize
    }

    /// Index of the texel that contains a point of the unit square.
    #[inline]
    fn nearest(&self, p: Vec2) -> usize {
        let bin = |x: f32, n: usize| ((x * n as f32) as usize).min(n - 1) as isize;
        self.texel_index(bin(p.x, self.width), bin(p.y, self.height))
    }

    /// Radiance at a point of the unit square.
    #[inline]
    fn lookup(&self, p: Vec2) -> Rgb {
        match self.filter {
            EnvironmentFilter::Nearest => color(self.texels[self.nearest(p)]),
            EnvironmentFilter::Bilinear => {
                let BilinearCorner { first, fraction } = self.bilinear_corner(p);
                let pair = |i: usize| color(self.texels[i]).lerp(color(self.texels[i + 1]), fraction.x);
                pair(first).lerp(pair(first + self.width + 2), fraction.y)
            }
        }
    }

    /// The first of the four texels around a point of the unit square, and the position between them.
    #[inline]
    fn bilinear_corner(&self, p: Vec2) -> BilinearCorner {
        // With the border, texel centres are at 1.5, 2.5, …
        let (x, y) = (p.x * self.width as f32 + 0.5, p.y * self.height as f32 + 0.5);
        let (x0, y0) = ((x as usize).min(self.width), (y as usize).min(self.height));
        BilinearCorner { first: y0 * (self.width + 2) + x0, fraction: Vec2::new(x - x0 as f32, y - y0 as f32) }
    }

    /// ∫ luminance · `weight` dω over the sphere, by lookups in parts of texels.
    pub(in crate::lights) fn integral(&self, weight: impl Fn(Vec3) -> f32 + Sync) -> f64 {
        let parts = (PARTS / (self.width * self.height)).isqrt().max(1);
        let (width, height) = (self.width * parts, self.height * parts);
        let row = |y: usize| -> f64 {
            let at = |x: usize| {
                let p = Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
                let MappedDirection { w, pdf } = self.to_sphere(p);
                f64::from(self.lookup(p).luminance() * weight(w) / pdf)
            };
            (0..width).map(at).sum()
        };
        // Each row has its own sum, so that the total does not depend on the threads
        let rows: Vec<f64> = (0..height).into_par_iter().map(row).collect();
        rows.iter().sum::<f64>() / (width * height) as f64
    }

    /// Approximate angular width and height of a texel (radians).
    pub(in crate::lights) fn texel_angle(&self) -> f32 {
        match self.mapping {
            EnvironmentMapping::EqualArea => (4.0 * PI).sqrt() as f32 / self.width as f32,
            EnvironmentMapping::LatLong => PI as f32 / self.height as f32,
        }
    }

    /// The direction of a point of the square.
    #[inline]
    fn to_sphere(&self, p: Vec2) -> MappedDirection {
        match self.mapping {
            EnvironmentMapping::EqualArea => {
                MappedDirection { w: equal_area_square_to_sphere(p), pdf: pdf_equal_area_square_to_sphere() }
            }
            EnvironmentMapping::LatLong => {
                let w = lat_long_to_sphere(p);
                MappedDirection { w, pdf: pdf_lat_long_to_sphere(w) }
            }
        }
    }

    /// Relative solid angle of a texel per row: its mean sine, or 1.
    fn row_scales(&self) -> Vec<f32> {
        let cos = |y: usize| (PI * y as f64 / self.height as f64).cos();
        (0..self.height)
            .map(|y| match self.mapping {
                EnvironmentMapping::EqualArea => 1.0,
                EnvironmentMapping::LatLong => ((cos(y) - cos(y + 1)) * self.height as f64 / PI) as f32,
            })
            .collect()
    }

    /// Steradians of the unit square per unit of row scale.
    fn weight_scale(&self) -> f32 {
        match self.mapping {
            EnvironmentMapping::EqualArea => (4.0 * PI) as f32,
            EnvironmentMapping::LatLong => (2.0 * PI * PI) as f32,
        }
    }

    /// Mean luminance of lookups in each texel, times the row scale.
    fn texel_weights(&self) -> Vec<f32> {
        let luminances: Vec<f32> = self.texels.iter().map(|&t| color(t).luminance()).collect();
        let mut weights = Vec::with_capacity(self.texels.len());
        for (y, &row_scale) in self.row_scales().iter().enumerate() {
            for x in 0..self.width {
                let mean = match self.filter {
                    EnvironmentFilter::Nearest => luminances[self.texel_index(x as isize, y as isize)],
                    EnvironmentFilter::Bilinear => self.smoothed(&luminances, x, y),
                };
                weights.push(row_scale * mean);
            }
        }
        weights
    }

    /// Mean of the bilinear interpolant over a texel.
    fn smoothed(&self, luminances: &[f32], x: usize, y: usize) -> f32 {
        const KERNEL: [f32; 3] = [0.125, 0.75, 0.125];
        let mut sum = 0.0;
        for (j, ky) in KERNEL.into_iter().enumerate() {
            for (i, kx) in KERNEL.into_iter().enumerate() {
                sum += kx * ky * luminances[self.texel_index((x + i) as isize - 1, (y + j) as isize - 1)];
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_numbers::math::warp::sample_uniform_sphere;
    use lumiris_test_support::random::{RngExt, pcg32};
    use lumiris_test_support::{Moments, assert_chi_squared};

    fn one_bright(mapping: EnvironmentMapping, size: [usize; 2], at: usize) -> EnvironmentMap {
        let mut texels = vec![Rgb::BLACK; size[0] * size[1]];
        texels[at] = Rgb::new(3.0, 5.0, 1.0);
        EnvironmentMap::new(texels, size, mapping, EnvironmentFilter::Bilinear).unwrap()
    }

    fn random_map(mapping: EnvironmentMapping, filter: EnvironmentFilter) -> EnvironmentMap {
        let size = if mapping == EnvironmentMapping::EqualArea { [8, 8] } else { [10, 5] };
        let mut stream = pcg32([11, 12, 13]);
        let mut texel = || stream.random::<f32>().powi(8) * 20.0;
        let texels = (0..size[0] * size[1]).map(|_| Rgb::new(texel(), texel(), texel())).collect();
        EnvironmentMap::new(texels, size, mapping, filter).unwrap()
    }

    const MAPPINGS: [EnvironmentMapping; 2] = [EnvironmentMapping::EqualArea, EnvironmentMapping::LatLong];

    #[test]
    fn the_density_is_positive_wherever_the_radiance_is() {
        for mapping in MAPPINGS {
            let size = if mapping == EnvironmentMapping::EqualArea { [4, 4] } else { [6, 3] };
            for at in 0..size[0] * size[1] {
                let map = one_bright(mapping, size, at);
                let mut stream = pcg32([at as u32, 1, 2]);
                let mut integral = Moments::default();
                for _ in 0..20_000 {
                    let w = sample_uniform_sphere(stream.random::<[f32; 2]>());
                    let (le, pdf) = (map.le(w), map.pdf(w));
                    assert!(le.is_black() || pdf > 0.0, "{mapping:?} {at} {w}");
                    integral.add(f64::from(pdf) * 4.0 * PI);
                }
                integral.assert_mean(1.0, 1e-5, 1e-4);
            }
        }
    }

    #[test]
    fn directions_follow_the_density_by_chi_squared() {
        for mapping in MAPPINGS {
            for filter in [EnvironmentFilter::Nearest, EnvironmentFilter::Bilinear] {
                check_chi_squared(&random_map(mapping, filter));
            }
        }
    }

    /// Cells of equal height in cos θ and equal width in φ; the density is integrated by 48² points in each.
    fn check_chi_squared(map: &EnvironmentMap) {
        const ROWS: usize = 20;
        const COLUMNS: usize = 40;
        let count = 200_000;
        let mut stream = pcg32([21, 22, 23]);
        let mut observed = vec![0.0; ROWS * COLUMNS];
        let mut disagreements = 0;
        for _ in 0..count {
            let s = map.sample(stream.random::<[f32; 2]>()).unwrap();
            // Rounding may carry a direction at an edge into the next texel.
            disagreements += u32::from((map.pdf(s.w) - s.pdf).abs() > 1e-3 * s.pdf);
            let row = ((s.w.z + 1.0) * 0.5 * ROWS as f32).clamp(0.0, ROWS as f32 - 1.0) as usize;
            let phi = lumiris_numbers::math::warp::azimuth(s.w) / std::f32::consts::TAU;
            observed[row * COLUMNS + ((phi * COLUMNS as f32) as usize).min(COLUMNS - 1)] += 1.0;
        }
        assert!(disagreements < 20, "{disagreements} directions have another density than their samples");
        let sub = 48;
        let expected: Vec<f64> = (0..ROWS * COLUMNS)
            .map(|cell| {
                let (row, column) = (cell / COLUMNS, cell % COLUMNS);
                // Integrate over the angle from the pole: near it, a density over rows of an image grows like 1/sin θ
                let [low, high] = [row + 1, row].map(|r| (2.0 * r as f32 / ROWS as f32 - 1.0).acos());
                let mut sum = 0.0;
                for i in 0..sub * sub {
                    let theta = low + (high - low) * ((i / sub) as f32 + 0.5) / sub as f32;
                    let x = (column as f32 + ((i % sub) as f32 + 0.5) / sub as f32) / COLUMNS as f32;
                    let w = lumiris_numbers::math::warp::direction(theta.cos(), std::f32::consts::TAU * x);
                    sum += f64::from(map.pdf(w) * theta.sin());
                }
                sum * f64::from(high - low) * 2.0 * PI / (sub * sub * COLUMNS) as f64 * f64::from(count)
            })
            .collect();
        let total: f64 = expected.iter().sum::<f64>() / f64::from(count);
        assert!((total - 1.0).abs() < 5e-3, "the density integrates to {total}");
        // The integration points may miss a cell of which only a corner is lit.
        let expected: Vec<f64> = expected.into_iter().map(|e| e.max(0.05)).collect();
        assert_chi_squared(&observed, &expected, 1e-5);
    }

    #[test]
    fn importance_sampling_estimates_the_flux() {
        for mapping in MAPPINGS {
            for filter in [EnvironmentFilter::Nearest, EnvironmentFilter::Bilinear] {
                let map = random_map(mapping, filter);
                let mut stream = pcg32([31, 32, 33]);
                let (mut sampled, mut uniform) = (Moments::default(), Moments::default());
                for _ in 0..100_000 {
                    let s = map.sample(stream.random::<[f32; 2]>()).unwrap();
                    sampled.add(f64::from(s.le.luminance() / s.pdf));
                    uniform.add(
                        f64::from(map.le(sample_uniform_sphere(stream.random::<[f32; 2]>())).luminance()) * 4.0 * PI,
                    );
                }
                // Smoothing does not commute with the solid angle of rows, so bilinear latitude-longitude maps are only
                // approximate.
                let exact = mapping == EnvironmentMapping::EqualArea || filter == EnvironmentFilter::Nearest;
                let tolerance = if exact { 1e-4 } else { 0.1 };
                sampled.assert_mean(f64::from(map.luminance_integral()), 1e-5, tolerance);
                uniform.assert_mean(f64::from(map.luminance_integral()), 1e-5, tolerance);
            }
        }
    }

    #[test]
    fn lookups_are_continuous_across_seams_and_constant_maps_are_uniform() {
        for mapping in MAPPINGS {
            let map = random_map(mapping, EnvironmentFilter::Bilinear);
            let mut stream = pcg32([41, 42, 43]);
            for _ in 0..20_000 {
                let w = sample_uniform_sphere(stream.random::<[f32; 2]>());
                // Towards the seams: the equator's planes x = 0 and y = 0, and the lower pole.
                // At its poles a latitude-longitude image has a value for each meridian.
                if w.y.abs() > 0.9 || (mapping == EnvironmentMapping::LatLong && w.x.abs() < 0.1) {
                    continue;
                }
                let w = (w * Vec3::new(1.0, 1e-4, 1.0)).normalize();
                let mirrored = Vec3::new(w.x, -w.y, w.z);
                let change = (map.le(w).luminance() - map.le(mirrored).luminance()).abs();
                assert!(change < 0.1, "{mapping:?} {w} {change}");
            }
            let size = if mapping == EnvironmentMapping::EqualArea { [2, 2] } else { [3, 2] };
            let texels = vec![Rgb::WHITE; size[0] * size[1]];
            let map = EnvironmentMap::new(texels, size, mapping, EnvironmentFilter::Bilinear).unwrap();
            assert!((f64::from(map.luminance_integral()) - 4.0 * PI).abs() < 1e-4);
            assert!((map.le(Vec3::Z).r - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn wrong_sizes_are_errors_and_black_maps_have_no_samples() {
        let make = |n, size| {
            EnvironmentMap::new(vec![Rgb::BLACK; n], size, EnvironmentMapping::EqualArea, EnvironmentFilter::Nearest)
        };
        assert!(make(3, [2, 2]).is_err() && make(2, [2, 1]).is_err() && make(0, [0, 0]).is_err());
        let black = make(4, [2, 2]).unwrap();
        assert!(black.sample([0.5, 0.5]).is_none() && black.pdf(Vec3::X) == 0.0);
    }
}

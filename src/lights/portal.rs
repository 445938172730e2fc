//! An environment map that is seen through a rectangle: portal-masked sampling [Bitterli et al. 2015], with the portals of
//! pbrt-v4.
//!
//! In the frame of the portal (x and y along its edges, z towards the sky) a direction is u = atan(x/z)/π + ½ and
//! v = atan(y/z)/π + ½. Straight edges are lines of constant u or v there, so what a point sees through the portal is a
//! rectangle, the window. The map is resampled to cells of (u, v), by its means over them, so that no light is lost however
//! small its source is. Within a window the density is proportional to luminance times the mean of J over the cell, per
//! steradian, where J = dω/d(u, v) = π²(1 − x²)(1 − y²)/z: running sums over the cells give the integral over any rectangle,
//! and are inverted.

use super::emit::EmissionSample;
use super::environment::infinite_sample;
use super::{EnvironmentMap, LightCtx, LightSample};
use lumiris_numbers::math::{Bounds3, Mat3, PiecewiseConstant2D, Rgb, Vec3};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Cells along each side, at least and at most.
const CELLS: [usize; 2] = [256, 4096];
/// Steps of the lookups of the map along each side of a cell.
const LOOKUPS: usize = 3;
/// Luminance by the mean beyond which light is placed by where it comes from, and not found by lookups.
const BRIGHT: f32 = 4.0;
/// By how much edges may miss being perpendicular and of the same length, relatively.
const TOLERANCE: f32 = 1e-3;

/// What passes through the portal.
#[derive(Clone, Debug)]
pub struct PortalLight {
    portal: Portal,
    /// Cells along each side.
    cells: usize,
    /// Radiances of the cells, row by row.
    radiances: Vec<Rgb>,
    /// Integrals of luminance times J from (0, 0) to the corners of the cells, row by row; 1 at the last one.
    sums: Vec<f64>,
    /// What passes through the portal by (u, v): luminance times z.
    emitted: PiecewiseConstant2D,
    /// Luminance of the power that passes.
    phi: f32,
}

/// A rectangle that light comes through.
#[derive(Clone, Copy, Debug)]
pub struct Portal {
    corner: Vec3,
    /// Edges x and y, and the normal towards the sky.
    world_from_portal: Mat3,
    /// Lengths of the edges (m).
    extent: [f32; 2],
}

/// The cells that a point sees: its corners in (u, v).
type Window = [[f64; 2]; 2];

impl Portal {
    /// The rectangle of four `corners` (m), one after the other; `Err` with a message if they are none. Seen from the
    /// side that is lit, they go counterclockwise.
    pub fn new(corners: [Vec3; 4]) -> Result<Self, String> {
        let [p0, p1, p2, p3] = corners;
        let (x, y) = (p3 - p0, p1 - p0);
        let extent = [x.length(), y.length()];
        let size = extent[0].max(extent[1]);
        let is_rectangle = extent.iter().all(|&e| e > 0.0 && e.is_finite())
            && (p2 - p1 - x).length() <= TOLERANCE * size
            && x.dot(y).abs() <= TOLERANCE * extent[0] * extent[1];
        if !is_rectangle {
            return Err("a portal is a rectangle: four corners, one after the other".to_owned());
        }
        let x = x / extent[0];
        let z = x.cross(y / extent[1]).normalize();
        Ok(Portal { corner: p0, world_from_portal: Mat3::from_cols(x, z.cross(x), z), extent })
    }

    /// True if light that comes through can reach any part of the box.
    pub fn lights(&self, bounds: &Bounds3) -> bool {
        let n = self.world_from_portal.z_axis;
        let inmost = Vec3::select(n.cmpgt(Vec3::ZERO), bounds.min, bounds.max);
        n.dot(inmost - self.corner) < -TOLERANCE * self.extent[0].min(self.extent[1])
    }

    /// True if a ray from `p` in direction `w` goes out through it.
    #[inline]
    fn is_passed(&self, p: Vec3, w: Vec3) -> bool {
        let to_portal = self.world_from_portal.transpose();
        let (v, o) = (to_portal * w, to_portal * (p - self.corner));
        let t = -o.z / v.z;
        let (x, y) = (o.x + t * v.x, o.y + t * v.y);
        v.z > 0.0 && o.z < 0.0 && x >= 0.0 && x <= self.extent[0] && y >= 0.0 && y <= self.extent[1]
    }

    /// What is seen from `p`; `None` from the side of the sky.
    #[inline]
    fn window(&self, p: Vec3) -> Option<Window> {
        let a = (self.world_from_portal.transpose() * (self.corner - p)).as_dvec3();
        let [width, height] = self.extent.map(f64::from);
        let at = |x: f64| (x / a.z).atan() / PI + 0.5;
        (a.z > 0.0).then(|| [[at(a.x), at(a.y)], [at(a.x + width), at(a.y + height)]])
    }
}

/// The direction in the frame of the portal, and J.
#[inline]
fn direction([u, v]: [f64; 2]) -> (Vec3, f64) {
    let (x, y) = ((PI * (u - 0.5)).tan(), (PI * (v - 0.5)).tan());
    let z2 = 1.0 / (1.0 + x * x + y * y);
    let z = z2.sqrt();
    // 1 − (xz)² = z²(1 + y²)
    let jacobian = PI * PI * z2 * (1.0 + y * y) * (1.0 + x * x) * z;
    (Vec3::new((x * z) as f32, (y * z) as f32, z as f32), jacobian)
}

impl PortalLight {
    /// Light of `map`, whose directions the orthogonal `world_from_light` turns, through `portal`.
    pub fn new(map: &EnvironmentMap, world_from_light: Mat3, scale: f32, portal: Portal) -> Self {
        let [width, height] = map.resolution();
        let cells = width.max(height).clamp(CELLS[0], CELLS[1]);
        let light_from_portal = world_from_light.transpose() * portal.world_from_portal;
        let mut means = means(map, light_from_portal, cells, f32::INFINITY);
        let mean = means.iter().map(|m| f64::from(m.radiance.luminance()) * m.jacobian).sum::<f64>()
            / means.iter().map(|m| m.jacobian).sum::<f64>();
        let bright = BRIGHT * mean as f32;
        if means.iter().any(|m| m.radiance.luminance() > bright) {
            // Those of a large map are half a gigabyte: not twice at once
            drop(means);
            means = self::means(map, light_from_portal, cells, bright);
            add_bright(map, light_from_portal, cells, bright, &mut means);
        }
        let flux = |m: &Cell| f64::from(m.radiance.luminance()) * m.projected;
        let sums = running_sums(means.iter().map(|m| f64::from(m.radiance.luminance()) * m.jacobian), cells);
        let area = f64::from(portal.extent[0] * portal.extent[1] * scale);
        let phi = area * means.iter().map(flux).sum::<f64>() / means.len() as f64;
        let emitted: Vec<f32> = means.iter().map(|m| flux(m) as f32).collect();
        let emitted = PiecewiseConstant2D::new(&emitted, cells);
        let radiances = means.iter().map(|m| m.radiance * scale).collect();
        PortalLight { portal, cells, radiances, sums, emitted, phi: phi as f32 }
    }

    /// Luminance of the power that passes through the portal (W).
    pub fn phi(&self) -> f32 {
        self.phi
    }

    /// Index of the cell of a place.
    #[inline]
    fn cell(&self, uv: [f64; 2]) -> usize {
        let [x, y] = uv.map(|x| self.place(x).0);
        y * self.cells + x
    }

    /// Where a direction lies, and J.
    #[inline]
    fn project(&self, w: Vec3) -> ([f64; 2], f64) {
        let v = (self.portal.world_from_portal.transpose() * w).as_dvec3();
        // 1 − x² by the other components: rounding does not cancel there
        let [x2, y2, z2] = [v.x * v.x, v.y * v.y, v.z * v.z];
        ([v.x, v.y].map(|x| (x / v.z).atan() / PI + 0.5), PI * PI * (y2 + z2) * (x2 + z2) / v.z)
    }

    /// Radiance that arrives at `p` from the unit direction `w`.
    #[inline]
    pub fn le(&self, p: Vec3, w: Vec3) -> Rgb {
        if self.portal.is_passed(p, w) { self.radiances[self.cell(self.project(w).0)] } else { Rgb::BLACK }
    }

    /// [`le`](Self::le), and the density of [`sample_li`](Self::sample_li) per steradian.
    #[inline]
    pub fn le_and_pdf(&self, p: Vec3, w: Vec3) -> (Rgb, f32) {
        let Some(window) = self.portal.window(p).filter(|_| self.portal.is_passed(p, w)) else {
            return (Rgb::BLACK, 0.0);
        };
        let (uv, jacobian) = self.project(w);
        let pdf = (self.density(uv) / self.integral(&window) / jacobian) as f32;
        (self.radiances[self.cell(uv)], if pdf.is_finite() { pdf } else { 0.0 })
    }

    /// See [`super::Light::sample_li`].
    #[inline]
    pub(super) fn sample_li(&self, ctx: &LightCtx, u: [f32; 2]) -> Option<LightSample> {
        let window = self.portal.window(ctx.p)?;
        let integral = self.integral(&window);
        let uv = self.sample_window(&window, integral, u.map(f64::from))?;
        let (w, jacobian) = direction(uv);
        let wi = (self.portal.world_from_portal * w).normalize();
        let pdf = (self.density(uv) / integral / jacobian) as f32;
        (pdf > 0.0 && pdf.is_finite()).then(|| infinite_sample(wi, self.radiances[self.cell(uv)], pdf))
    }

    /// See [`super::Light::sample_le`]: in proportion to what passes, evenly over the portal. It starts outside of the scene, so
    /// that what stands before the portal has its shadow.
    pub(super) fn sample_le(
        &self,
        (centre, radius): (Vec3, f32),
        u_position: [f32; 2],
        u_direction: [f32; 2],
    ) -> Option<EmissionSample> {
        let s = self.emitted.sample(u_direction)?;
        let uv = [s.p.x.into(), s.p.y.into()];
        let (w, jacobian) = direction(uv);
        let Portal { corner, world_from_portal, extent } = self.portal;
        let wi = (world_from_portal * w).normalize();
        let [x, y] = [u_position[0] * extent[0], u_position[1] * extent[1]];
        let p = corner + world_from_portal * Vec3::new(x, y, 0.0);
        let power = self.radiances[self.cell(uv)] * (w.z * extent[0] * extent[1] * jacobian as f32 / s.pdf);
        EmissionSample::in_space(p + wi * ((p - centre).length() + radius), -wi, power)
    }

    /// The table at a place, its integral being 1.
    #[inline]
    fn density(&self, uv: [f64; 2]) -> f64 {
        let n = self.cells;
        let [x, y] = uv.map(|x| ((x * n as f64) as usize).min(n - 1));
        let at = |x: usize, y: usize| self.sums[y * (n + 1) + x];
        let cell = (at(x + 1, y + 1) - at(x, y + 1)) - (at(x + 1, y) - at(x, y));
        cell.max(0.0) * (n * n) as f64
    }

    /// The sum at column `x` and at a height of `y` rows.
    #[inline]
    fn at_column(&self, x: usize, (row, within): (usize, f64)) -> f64 {
        let lower = self.sums[row * (self.cells + 1) + x];
        let upper = self.sums[(row + 1) * (self.cells + 1) + x];
        lower + (upper - lower) * within
    }

    /// The row or column of a coordinate, and the place within it.
    #[inline]
    fn place(&self, x: f64) -> (usize, f64) {
        let x = x * self.cells as f64;
        let index = (x as usize).min(self.cells - 1);
        (index, x - index as f64)
    }

    /// Integral of the table from (0, 0).
    #[inline]
    fn sum(&self, [u, v]: [f64; 2]) -> f64 {
        let ((column, within), row) = (self.place(u), self.place(v));
        let [left, right] = [0, 1].map(|i| self.at_column(column + i, row));
        left + (right - left) * within
    }

    #[inline]
    fn integral(&self, &[[u0, v0], [u1, v1]]: &Window) -> f64 {
        (self.sum([u1, v1]) - self.sum([u0, v1])) - (self.sum([u1, v0]) - self.sum([u0, v0]))
    }

    /// The place in a window by two numbers, in proportion to the table: u by the integral over all of its v, and v within
    /// the column of that.
    #[inline]
    fn sample_window(&self, &[[u0, v0], [u1, v1]]: &Window, integral: f64, xi: [f64; 2]) -> Option<[f64; 2]> {
        if !(integral > 0.0) {
            return None;
        }
        // Choose u
        let rows = [v0, v1].map(|v| self.place(v));
        let strip = |x: usize| self.at_column(x, rows[1]) - self.at_column(x, rows[0]);
        let (first, within) = self.place(u0);
        let begin = strip(first) + (strip(first + 1) - strip(first)) * within;
        let u = invert(&strip, begin + xi[0] * integral, [first, self.place(u1).0], self.cells).clamp(u0, u1);

        // Choose v in its column
        let column = self.place(u).0;
        let n = self.cells + 1;
        let strip = |y: usize| self.sums[y * n + column + 1] - self.sums[y * n + column];
        let at = |(row, within): (usize, f64)| strip(row) + (strip(row + 1) - strip(row)) * within;
        let [begin, end] = rows.map(at);
        let rows = [rows[0].0, rows[1].0];
        let v = invert(&strip, begin + xi[1] * (end - begin), rows, self.cells).clamp(v0, v1);
        Some([u, v])
    }
}

/// Where the running integral `f` over `n` cells, linear in each, has the value `target`: in one of the cells `within`.
#[inline]
fn invert(f: &impl Fn(usize) -> f64, target: f64, within: [usize; 2], n: usize) -> f64 {
    let [mut low, mut high] = within;
    while low < high {
        let middle = (low + high).div_ceil(2);
        if f(middle) <= target { low = middle } else { high = middle - 1 }
    }
    let (begin, end) = (f(low), f(low + 1));
    let part = if end > begin { ((target - begin) / (end - begin)).clamp(0.0, 1.0) } else { 0.5 };
    (low as f64 + part) / n as f64
}

/// What the map has in a cell.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    /// Mean radiance over its solid angle.
    radiance: Rgb,
    /// Means of J and of z·J.
    jacobian: f64,
    projected: f64,
}

/// A colour scaled down to the luminance `most`.
fn limited(c: Rgb, most: f32) -> Rgb {
    let luminance = c.luminance();
    if luminance > most { c * (most / luminance) } else { c }
}

/// Adds what the map has beyond the luminance `bright`.
fn add_bright(map: &EnvironmentMap, light_from_portal: Mat3, cells: usize, bright: f32, means: &mut [Cell]) {
    let portal_from_light = light_from_portal.transpose();
    map.each_bright_part(bright, |w, le, steradians| {
        let v = portal_from_light * w;
        if v.z > 0.0 {
            let bin = |x: f32| (((x / v.z).atan() / std::f32::consts::PI + 0.5) * cells as f32) as usize;
            let cell = &mut means[bin(v.y).min(cells - 1) * cells + bin(v.x).min(cells - 1)];
            let solid_angle = cell.jacobian / (cells * cells) as f64;
            cell.radiance += (le - limited(le, bright)) * (steradians / solid_angle as f32);
        }
    });
}

/// The cells row by row, by the trapezoidal rule, of radiances limited to the luminance `most`.
fn means(map: &EnvironmentMap, light_from_portal: Mat3, cells: usize, most: f32) -> Vec<Cell> {
    let last = cells * LOOKUPS;
    let weight = |k: usize| if k == 0 || k == LOOKUPS { 0.5 } else { 1.0 } / LOOKUPS as f64;
    let look = |x: usize, y: usize| {
        let (w, jacobian) = direction([x, y].map(|k| k as f64 / last as f64));
        (limited(map.le(light_from_portal * w), most), jacobian, jacobian * f64::from(w.z))
    };
    let row = |y: usize| {
        let mut row = vec![Cell::default(); cells];
        for k in 0..=LOOKUPS {
            let found: Vec<(Rgb, f64, f64)> = (0..=last).map(|x| look(x, y * LOOKUPS + k)).collect();
            for (x, cell) in row.iter_mut().enumerate() {
                for (i, &(le, jacobian, projected)) in found[x * LOOKUPS..=(x + 1) * LOOKUPS].iter().enumerate() {
                    let weight = weight(i) * weight(k);
                    cell.radiance += le * (weight * jacobian) as f32;
                    cell.jacobian += weight * jacobian;
                    cell.projected += weight * projected;
                }
            }
        }
        row.iter_mut().for_each(|cell| cell.radiance = cell.radiance / cell.jacobian as f32);
        row
    };
    (0..cells).into_par_iter().flat_map_iter(row).collect()
}

/// Integrals from the first corner to all corners of `n` × `n` values, divided by that of all.
fn running_sums(values: impl Iterator<Item = f64>, n: usize) -> Vec<f64> {
    let stride = n + 1;
    let mut sums = vec![0.0; stride * stride];
    let mut row = 0.0;
    for (i, value) in values.enumerate() {
        let (x, y) = (i % n + 1, i / n + 1);
        row = if x == 1 { value } else { row + value };
        sums[y * stride + x] = sums[(y - 1) * stride + x] + row;
    }
    let whole = sums[stride * stride - 1];
    if whole > 0.0 {
        sums.iter_mut().for_each(|s| *s /= whole);
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lights::{EnvironmentFilter, EnvironmentMapping};
    use lumiris_numbers::math::warp::sample_uniform_sphere;
    use lumiris_test_support::random::{Pcg32, RngExt, pcg32};
    use lumiris_test_support::{Moments, assert_chi_squared};

    const X: Vec3 = Vec3::new(0.8, 0.6, 0.0);
    const Y: Vec3 = Vec3::new(-0.36, 0.48, 0.8);

    fn portal() -> Portal {
        let corner = Vec3::new(0.2, -0.3, 1.0);
        Portal::new([corner, corner + Y, corner + Y + X * 1.5, corner + X * 1.5]).unwrap()
    }

    fn sky(texel: impl FnMut(usize) -> f32, size: usize) -> EnvironmentMap {
        let texels = (0..size * size).map(texel).map(|x| Rgb::new(x, 0.5 * x, 2.0 * x)).collect();
        EnvironmentMap::new(texels, [size; 2], EnvironmentMapping::EqualArea, EnvironmentFilter::Nearest).unwrap()
    }

    fn light(texel: impl FnMut(usize) -> f32, size: usize) -> PortalLight {
        PortalLight::new(&sky(texel, size), Mat3::from_rotation_x(0.4), 0.5, portal())
    }

    /// A bright texel in an image that is dark elsewhere, and one with all kinds of values.
    fn lights() -> [PortalLight; 2] {
        let mut stream = pcg32([1, 2, 3]);
        [light(|i| if i == 70 { 50.0 } else { 0.01 }, 16), light(|_| stream.random::<f32>().powi(6) * 9.0, 16)]
    }

    /// Points on the lit side: far, near, and very near to the portal.
    fn points(stream: &mut Pcg32) -> Vec<Vec3> {
        let Portal { corner, world_from_portal, .. } = portal();
        let place =
            |h: f32, s: [f32; 2]| corner + world_from_portal * Vec3::new(s[0] * 4.0 - 1.0, s[1] * 3.0 - 1.0, -h);
        [4.0, 1.0, 0.1, 1e-3].map(|h| place(h, stream.random::<[f32; 2]>())).to_vec()
    }

    #[test]
    fn a_direction_is_lit_if_it_passes_through_the_rectangle() {
        let (light, portal) = (light(|_| 1.0, 1), portal());
        let n = portal.world_from_portal.z_axis;
        assert!((n - X.cross(Y)).length() < 1e-6);
        let at = |x: f32, y: f32| portal.corner + X * x + Y * y;
        let p = at(0.7, 0.2) - n * 2.0;
        for (x, y, is_lit) in
            [(0.01, 0.01, true), (1.49, 0.99, true), (-0.01, 0.5, false), (1.51, 0.5, false), (0.5, 1.01, false)]
        {
            let w = (at(x, y) - p).normalize();
            assert_eq!(!light.le(p, w).is_black(), is_lit, "{x} {y}");
            assert_eq!(light.le_and_pdf(p, w).1 > 0.0, is_lit, "{x} {y}");
            // Neither from behind, nor away from it
            let behind = at(0.7, 0.2) + n;
            assert!(light.le(p, -w).is_black() && light.le(behind, (at(x, y) - behind).normalize()).is_black());
            assert!(light.sample_li(&LightCtx::at(behind), [0.5; 2]).is_none());
        }
        // The whole sky from next to it is a half-space, whose flux through 1.5 m² is π·1.5
        let expected = 1.5 * std::f32::consts::PI * Rgb::new(0.5, 0.25, 1.0).luminance();
        assert!((light.phi() - expected).abs() < 2e-4 * expected, "{} {expected}", light.phi());
    }

    #[test]
    fn samples_have_the_radiance_and_the_density_of_their_directions() {
        let stream = &mut pcg32([5, 6, 7]);
        for light in lights() {
            for p in points(stream) {
                for _ in 0..2000 {
                    let s = light.sample_li(&LightCtx::at(p), stream.random::<[f32; 2]>()).unwrap();
                    let pdf = light.le_and_pdf(p, s.wi).1;
                    // Rounding may carry a direction over an edge of a cell, of a texel, or of the portal
                    let is_near = (pdf - s.pdf).abs() <= 2e-3 * s.pdf && light.le(p, s.wi) == s.li;
                    let moved = |e: f32| {
                        light.le_and_pdf(p, (s.wi + portal().world_from_portal * Vec3::splat(e)).normalize()).1
                    };
                    let is_edge = [-2e-5, 2e-5].into_iter().any(|e| (moved(e) - pdf).abs() > 1e-3 * pdf);
                    assert!(is_near || is_edge, "{p} {} {pdf} {}", s.wi, s.pdf);
                }
            }
        }
    }

    #[test]
    fn densities_integrate_to_one_and_all_light_is_found() {
        let stream = &mut pcg32([9, 6, 7]);
        for light in lights() {
            for p in points(stream).into_iter().take(2) {
                let [mut density, mut difference] = [Moments::default(); 2];
                for _ in 0..200_000 {
                    let w = sample_uniform_sphere(stream.random::<[f32; 2]>());
                    density.add(f64::from(light.le_and_pdf(p, w).1) * 4.0 * PI);
                    let s = light.sample_li(&LightCtx::at(p), stream.random::<[f32; 2]>()).unwrap();
                    difference.add(f64::from(light.le(p, w).g) * 4.0 * PI - f64::from(s.li.g / s.pdf));
                }
                density.assert_mean(1.0, 1e-5, 0.0);
                difference.assert_mean(0.0, 1e-5, 0.0);
            }
        }
    }

    #[test]
    fn directions_follow_the_density_by_chi_squared() {
        const N: usize = 24;
        let stream = &mut pcg32([2, 6, 7]);
        let count = 100_000;
        for light in lights() {
            for p in points(stream) {
                // Cells of the window
                let window @ [low, high] = light.portal.window(p).unwrap();
                let place = |uv: [f64; 2]| [0, 1].map(|i| (uv[i] - low[i]) / (high[i] - low[i]) * N as f64);
                let mut observed = vec![0.0; N * N];
                for _ in 0..count {
                    let s = light.sample_li(&LightCtx::at(p), stream.random::<[f32; 2]>()).unwrap();
                    let v = (light.portal.world_from_portal.transpose() * s.wi).as_dvec3();
                    let [x, y] =
                        place([v.x, v.y].map(|x| (x / v.z).atan() / PI + 0.5)).map(|x| (x as usize).min(N - 1));
                    observed[y * N + x] += 1.0;
                }

                // The density is constant between the edges of these cells and of those of the table
                let edges = |k: usize| {
                    let own = (0..=N).map(|i| low[k] + (high[k] - low[k]) * i as f64 / N as f64);
                    let table = (0..=light.cells).map(|i| i as f64 / light.cells as f64);
                    let inside = table.filter(|x| (low[k]..high[k]).contains(x));
                    let mut edges: Vec<f64> = own.chain(inside).collect();
                    edges.sort_by(f64::total_cmp);
                    edges
                };
                let (columns, rows, integral) = (edges(0), edges(1), light.integral(&window));
                let mut expected = vec![0.0; N * N];
                for (u, v) in columns.windows(2).flat_map(|u| rows.windows(2).map(move |v| (u, v))) {
                    let uv = [u, v].map(|edges| 0.5 * (edges[0] + edges[1]));
                    let [x, y] = place(uv).map(|x| (x as usize).min(N - 1));
                    let probability = light.density(uv) / integral * (u[1] - u[0]) * (v[1] - v[0]);
                    expected[y * N + x] += probability * f64::from(count);
                }
                assert_chi_squared(&observed, &expected, 1e-6);
            }
        }
    }

    /// A sun of one texel, which lies across cells.
    #[test]
    fn no_light_is_lost_or_added_where_the_map_is_resampled() {
        for at in [70, 105, 118, 135, 150] {
            let light = light(|i| if i == at { 900.0 } else { 0.1 }, 16);
            let flux = |w: Vec3, le: Rgb, steradians: f32| {
                let z = portal().world_from_portal.z_axis.dot(Mat3::from_rotation_x(0.4) * w);
                f64::from(le.luminance() * z.max(0.0) * steradians)
            };
            let mut sum = 0.0;
            sky(|i| if i == at { 900.0 } else { 0.1 }, 16).each_bright_part(0.0, |w, le, s| sum += flux(w, le, s));
            let expected = sum * 0.5 * 1.5;
            assert!((f64::from(light.phi()) - expected).abs() < 3e-3 * expected, "{at}: {} {expected}", light.phi());
        }
    }

    #[test]
    fn what_is_no_rectangle_is_an_error() {
        let corner = Vec3::ONE;
        let [a, b] = [corner + Y, corner + X];
        for corners in [
            [corner; 4],
            [corner, a, a + X * 1.1, b],
            [corner, a + X * 0.1, a + X * 1.1, b],
            [corner, a, b, a + X],
            [corner, a, a + X, b * f32::INFINITY],
        ] {
            assert!(Portal::new(corners).is_err(), "{corners:?}");
        }
    }
}

//! An environment map visible through a rectangle: portal-masked sampling [Bitterli et al. 2015], with the portals of
//! pbrt-v4.
//!
//! The frame of the portal has x and y along its edges, and z towards the sky. A direction (x, y, 1)/√(1 + x² + y²) has
//! the coordinates (s, t), each by x = 4a(1 + a²)/(1 − a²)² with a = 2s − 1. Straight edges are lines of constant s or
//! t, so the part visible from a point is a rectangle of (s, t), the window.
//!
//! Samples have the density of a table of (s, t) within the window. Running sums over the cells give the integral over
//! any rectangle, and are inverted. The value of a cell is the root mean square of its luminance, times the mean of J =
//! dω/d(s, t); this is the optimal density that is constant per cell. Near the horizon x grows as (1 − |a|)⁻², the
//! least power for which J, and with it the weight of a sample, is bounded if both x and y are large.
//!
//! The radiance of a direction is a lookup of the map. The table is only a density and positive everywhere, so the
//! expectation does not depend on it.

use super::environment::{EnvironmentMap, infinite_sample};
use crate::lights::{EmissionSample, LeAndPdf, LightCtx, LightSample, Sphere};
use lumiris_numbers::math::{Bounds3, Mat3, PiecewiseConstant2D, Rgb, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

/// Minimum and maximum number of cells along each side.
const CELLS: [usize; 2] = [512, 4096];
/// Minimum and maximum number of map lookups along a side of a cell; in between, proportional to the number of texels.
const LOOKUPS: [f32; 2] = [2.0, 64.0];
const LOOKUPS_PER_TEXEL: f32 = 1.5;
/// Fraction of a cell's mean square added to each neighbour along an axis, as lookups may miss the corner of a sun.
const SMOOTHING: f64 = 1.0 / 16.0;
/// Minimum value of a cell, as a fraction of the mean over all cells.
const FLOOR: f64 = 0.01;
/// Sum of the table in units of its rounding. Sums of whole numbers below 2⁵³ are exact, so no cell is lost.
const TOTAL: f64 = (1_u64 << 50) as f64;
/// Maximum deviation of the edges from right angles and equal lengths, relative.
const TOLERANCE: f32 = 1e-3;

/// An environment map that illuminates the scene through a portal.
#[derive(Clone, Debug)]
pub struct PortalLight {
    portal: Portal,
    map: Arc<EnvironmentMap>,
    /// Orthogonal map of directions.
    light_from_world: Mat3,
    /// Factor of the radiances of the map.
    scale: f32,
    /// Cells of the table along each side.
    cells: usize,
    /// Integrals of the table from (0, 0) to the corners of the cells, row by row: whole numbers.
    sums: Vec<f64>,
    /// Density of emitted directions over (s, t).
    emitted: PiecewiseConstant2D,
    /// Luminance of the power through the portal.
    power_luminance: f32,
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

/// A row or column of the table, and the relative position within it.
#[derive(Clone, Copy)]
struct CellPosition {
    index: usize,
    within: f64,
}

/// The directions to the sky that are visible from a point, as corners in (s, t).
type Window = [[f64; 2]; 2];

impl Portal {
    /// The rectangle with four `corners` (m), in order. Seen from the illuminated side they are counterclockwise.
    ///
    /// Returns `Err` with a message if they do not form a rectangle.
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

    /// True if light through the portal can reach any part of the box.
    pub fn lights(&self, bounds: &Bounds3) -> bool {
        let n = self.world_from_portal.z_axis;
        let inmost = Vec3::select(n.cmpgt(Vec3::ZERO), bounds.min, bounds.max);
        n.dot(inmost - self.corner) < -TOLERANCE * self.extent[0].min(self.extent[1])
    }

    /// True if a ray from `p` in direction `w` leaves through the portal.
    #[inline]
    fn is_passed(&self, p: Vec3, w: Vec3) -> bool {
        let to_portal = self.world_from_portal.transpose();
        let (v, o) = (to_portal * w, to_portal * (p - self.corner));
        let t = -o.z / v.z;
        let (x, y) = (o.x + t * v.x, o.y + t * v.y);
        v.z > 0.0 && o.z < 0.0 && x >= 0.0 && x <= self.extent[0] && y >= 0.0 && y <= self.extent[1]
    }

    /// The window of the point `p`; `None` on the sky side.
    #[inline]
    fn window(&self, p: Vec3) -> Option<Window> {
        let a = (self.world_from_portal.transpose() * (self.corner - p)).as_dvec3();
        let [width, height] = self.extent.map(f64::from);
        let at = |x: f64| coordinate(x / a.z);
        (a.z > 0.0).then(|| [[at(a.x), at(a.y)], [at(a.x + width), at(a.y + height)]])
    }
}

/// The coordinate s, in 0..=1, of x.
#[inline]
fn coordinate(x: f64) -> f64 {
    // With x = tan θ: h = tan(θ/2) = 2a/(1 + a²), and 1 − h² = 2/(1 + r)
    let r = (1.0 + x * x).sqrt();
    let h = x / (1.0 + r);
    0.5 + 0.5 * h / (1.0 + (2.0 / (1.0 + r)).sqrt())
}

/// The tangent x of a coordinate s, and its derivative dx/ds.
struct Tangent {
    x: f64,
    dx: f64,
}

#[inline]
fn tangent(s: f64) -> Tangent {
    let a = 2.0 * s - 1.0;
    let (a2, rest) = (a * a, (1.0 - a) * (1.0 + a));
    Tangent { x: 4.0 * a * (1.0 + a2) / (rest * rest), dx: 8.0 * (1.0 + a2 * (6.0 + a2)) / (rest * rest * rest) }
}

/// A direction in the frame of the portal, and J.
#[derive(Clone, Copy)]
struct PortalDirection {
    w: Vec3,
    jacobian: f64,
}

/// The direction with the coordinates (s, t).
#[inline]
fn direction([s, t]: [f64; 2]) -> PortalDirection {
    let (Tangent { x, dx }, Tangent { x: y, dx: dy }) = (tangent(s), tangent(t));
    let z = 1.0 / (1.0 + x * x + y * y).sqrt();
    let w = Vec3::new((x * z) as f32, (y * z) as f32, z as f32);
    PortalDirection { w, jacobian: dx * dy * z * z * z }
}

impl PortalLight {
    /// Light of `map` through `portal`; the orthogonal `world_from_light` rotates its directions.
    pub fn new(map: Arc<EnvironmentMap>, world_from_light: Mat3, scale: f32, portal: Portal) -> Self {
        let [width, height] = map.resolution();
        let n = (2 * width.max(height)).clamp(CELLS[0], CELLS[1]);
        let light_from_world = world_from_light.transpose();
        let cells = cells(&map, light_from_world * portal.world_from_portal, n);
        let luminances = smoothed_luminances(&cells, n);
        let of = |measure: fn(&Cell) -> f32| luminances.iter().zip(&cells).map(move |(l, cell)| l * measure(cell));
        let sums = running_sums(|| of(|cell| cell.jacobian), n);
        let emitted = PiecewiseConstant2D::new(&of(|cell| cell.projected).collect::<Vec<f32>>(), n);

        let to_sky = portal.world_from_portal.z_axis;
        let flux = map.integral(|w| (world_from_light * w).dot(to_sky).max(0.0));
        let power_luminance = flux as f32 * portal.extent[0] * portal.extent[1] * scale;
        PortalLight { portal, map, light_from_world, scale, cells: n, sums, emitted, power_luminance }
    }

    /// Luminance of the power that passes through the portal (W).
    pub fn power_luminance(&self) -> f32 {
        self.power_luminance
    }

    /// Radiance of the sky in the unit direction `w`.
    #[inline]
    fn radiance(&self, w: Vec3) -> Rgb {
        self.map.le(self.light_from_world * w) * self.scale
    }

    /// Radiance that arrives at `p` from the unit direction `w`.
    #[inline]
    pub fn le(&self, p: Vec3, w: Vec3) -> Rgb {
        if self.portal.is_passed(p, w) { self.radiance(w) } else { Rgb::BLACK }
    }

    /// [`le`](Self::le), and the density of [`sample_li`](Self::sample_li) per steradian.
    #[inline]
    pub fn le_and_pdf(&self, p: Vec3, w: Vec3) -> LeAndPdf {
        let Some(window) = self.portal.window(p).filter(|_| self.portal.is_passed(p, w)) else {
            return LeAndPdf::ZERO;
        };
        let v = (self.portal.world_from_portal.transpose() * w).as_dvec3();
        let pdf = self.pdf([v.x / v.z, v.y / v.z].map(coordinate), self.integral(&window));
        LeAndPdf { le: self.radiance(w), pdf: pdf.unwrap_or(0.0) }
    }

    /// Density per steradian at a point of a window with this integral; `None` unless it is positive and finite.
    #[inline]
    fn pdf(&self, st: [f64; 2], integral: f64) -> Option<f32> {
        let pdf = (self.density(st) / integral / direction(st).jacobian) as f32;
        (pdf > 0.0 && pdf.is_finite()).then_some(pdf)
    }

    /// See [`crate::lights::Light::sample_li`].
    #[inline]
    pub(in crate::lights) fn sample_li(&self, ctx: &LightCtx, u: [f32; 2]) -> Option<LightSample> {
        let window = self.portal.window(ctx.p)?;
        let integral = self.integral(&window);
        let st = self.sample_window(&window, integral, u.map(f64::from))?;
        let wi = (self.portal.world_from_portal * direction(st).w).normalize();
        Some(infinite_sample(wi, self.radiance(wi), self.pdf(st, integral)?))
    }

    /// See [`crate::lights::Light::sample_le`]: directions in proportion to the radiance through the portal, origins
    /// uniform over it. The origin is moved out of the scene, so that objects in front of the portal cast shadows.
    pub(in crate::lights) fn sample_le(
        &self,
        scene: Sphere,
        u_position: [f32; 2],
        u_direction: [f32; 2],
    ) -> Option<EmissionSample> {
        let sample = self.emitted.sample(u_direction)?;
        let PortalDirection { w, jacobian } = direction([sample.p.x.into(), sample.p.y.into()]);
        let Portal { corner, world_from_portal, extent } = self.portal;
        let wi = (world_from_portal * w).normalize();
        let [x, y] = [u_position[0] * extent[0], u_position[1] * extent[1]];
        let p = corner + world_from_portal * Vec3::new(x, y, 0.0);
        let power = self.radiance(wi) * (w.z * extent[0] * extent[1] * jacobian as f32 / sample.pdf);
        EmissionSample::in_space(p + wi * ((p - scene.center).length() + scene.radius), -wi, power)
    }

    /// The density of the table at a point, per unit of area in (s, t).
    #[inline]
    fn density(&self, st: [f64; 2]) -> f64 {
        let n = self.cells;
        let [x, y] = st.map(|x| self.position(x).index);
        let at = |x: usize, y: usize| self.sums[y * (n + 1) + x];
        ((at(x + 1, y + 1) - at(x, y + 1)) - (at(x + 1, y) - at(x, y))) * (n * n) as f64
    }

    /// The sum at column `x` and at a position among the rows.
    #[inline]
    fn at_column(&self, x: usize, CellPosition { index: row, within }: CellPosition) -> f64 {
        let lower = self.sums[row * (self.cells + 1) + x];
        let upper = self.sums[(row + 1) * (self.cells + 1) + x];
        lower + (upper - lower) * within
    }

    /// The position of a coordinate among the rows or columns.
    #[inline]
    fn position(&self, x: f64) -> CellPosition {
        let x = x * self.cells as f64;
        let index = (x as usize).min(self.cells - 1);
        CellPosition { index, within: x - index as f64 }
    }

    /// Integral of the table from (0, 0).
    #[inline]
    fn sum(&self, [s, t]: [f64; 2]) -> f64 {
        let (column, row) = (self.position(s), self.position(t));
        let [left, right] = [0, 1].map(|i| self.at_column(column.index + i, row));
        left + (right - left) * column.within
    }

    #[inline]
    fn integral(&self, &[[s0, t0], [s1, t1]]: &Window) -> f64 {
        (self.sum([s1, t1]) - self.sum([s0, t1])) - (self.sum([s1, t0]) - self.sum([s0, t0]))
    }

    /// A point of the window by two random numbers, in proportion to the table: s by the integral over its t, then t
    /// within the column of s.
    #[inline]
    fn sample_window(&self, &[[s0, t0], [s1, t1]]: &Window, integral: f64, xi: [f64; 2]) -> Option<[f64; 2]> {
        if !(integral > 0.0) {
            return None;
        }
        // Choose s
        let rows = [t0, t1].map(|t| self.position(t));
        let strip = |x: usize| self.at_column(x, rows[1]) - self.at_column(x, rows[0]);
        let CellPosition { index: first, within } = self.position(s0);
        let begin = strip(first) + (strip(first + 1) - strip(first)) * within;
        let s = invert(&strip, begin + xi[0] * integral, [first, self.position(s1).index], self.cells).clamp(s0, s1);

        // Choose t in its column
        let column = self.position(s).index;
        let n = self.cells + 1;
        let strip = |y: usize| self.sums[y * n + column + 1] - self.sums[y * n + column];
        let at = |row: CellPosition| strip(row.index) + (strip(row.index + 1) - strip(row.index)) * row.within;
        let [begin, end] = rows.map(at);
        let rows = rows.map(|row| row.index);
        let t = invert(&strip, begin + xi[1] * (end - begin), rows, self.cells).clamp(t0, t1);
        Some([s, t])
    }
}

/// The coordinate at which the running integral `f` over `n` cells, linear in each, has the value `target`. The result
/// is in one of the cells `within`.
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

/// Statistics of the map in a cell.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    /// Root mean square of the luminance over its solid angle.
    luminance: f32,
    /// Means of J and of z·J.
    jacobian: f32,
    projected: f32,
}

/// The cells row by row, by lookups in their interior: J is not defined on the edges of the table.
fn cells(map: &EnvironmentMap, light_from_portal: Mat3, n: usize) -> Vec<Cell> {
    let cell = |x: usize, y: usize| {
        let at = |dx: f64, dy: f64| direction([(x as f64 + dx) / n as f64, (y as f64 + dy) / n as f64]);
        // Cells next to a corner have a wide range of azimuths
        let lookups = |a: PortalDirection, b: PortalDirection| {
            let texels = (a.w - b.w).length() / map.texel_angle();
            (LOOKUPS_PER_TEXEL * texels).ceil().clamp(LOOKUPS[0], LOOKUPS[1]) as usize
        };
        let across = lookups(at(0.01, 0.5), at(0.99, 0.5));
        let down = lookups(at(0.5, 0.01), at(0.5, 0.99));
        let [mut square, mut sum, mut projected] = [0.0; 3];
        for k in 0..across * down {
            let midpoint = |i: usize, n: usize| (i as f64 + 0.5) / n as f64;
            let PortalDirection { w, jacobian } = at(midpoint(k % across, across), midpoint(k / across, down));
            square += jacobian * f64::from(map.le(light_from_portal * w).luminance()).powi(2);
            sum += jacobian;
            projected += jacobian * f64::from(w.z);
        }
        let count = (across * down) as f64;
        let [luminance, jacobian, projected] =
            [(square / sum).sqrt(), sum / count, projected / count].map(|x| x as f32);
        Cell { luminance, jacobian, projected }
    };
    (0..n).into_par_iter().flat_map_iter(|y| (0..n).map(move |x| cell(x, y))).collect()
}

/// Luminances of the cells smoothed with their neighbours; all are positive unless all are 0.
fn smoothed_luminances(cells: &[Cell], n: usize) -> Vec<f32> {
    let smoothed = |row: [f32; 3]| {
        let [before, own, after] = row.map(|x| f64::from(x) * f64::from(x));
        ((1.0 - 2.0 * SMOOTHING) * own + SMOOTHING * (before + after)).sqrt() as f32
    };
    let near = |i: usize| [i.saturating_sub(1), i, (i + 1).min(n - 1)];
    let along_rows: Vec<f32> =
        (0..n * n).map(|i| smoothed(near(i % n).map(|x| cells[i / n * n + x].luminance))).collect();
    let mut luminances: Vec<f32> =
        (0..n * n).map(|i| smoothed(near(i / n).map(|y| along_rows[y * n + i % n]))).collect();

    // Add the floor
    let (mut flux, mut solid_angle) = (0.0, 0.0);
    for (luminance, cell) in luminances.iter().zip(cells) {
        flux += f64::from(*luminance) * f64::from(cell.jacobian);
        solid_angle += f64::from(cell.jacobian);
    }
    let least = (FLOOR * flux / solid_angle) as f32;
    luminances.iter_mut().for_each(|luminance| *luminance += least);
    luminances
}

/// Integrals from the first corner to all corners of `n` × `n` values. The values are rounded to whole numbers of at
/// least 1 with a sum near [`TOTAL`]. If all values are 0, so are the integrals.
fn running_sums<I: Iterator<Item = f32>>(values: impl Fn() -> I, n: usize) -> Vec<f64> {
    let stride = n + 1;
    let mut sums = vec![0.0; stride * stride];
    let whole: f64 = values().map(f64::from).sum();
    if !(whole > 0.0) {
        return sums;
    }
    let mut row = 0.0;
    for (i, value) in values().enumerate() {
        let (x, y) = (i % n + 1, i / n + 1);
        let value = (f64::from(value) / whole * TOTAL).round().max(1.0);
        row = if x == 1 { value } else { row + value };
        sums[y * stride + x] = sums[(y - 1) * stride + x] + row;
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lights::{EnvironmentFilter, EnvironmentMapping};
    use lumiris_numbers::estimators::stats::Welford;
    use lumiris_numbers::math::Frame;
    use lumiris_numbers::math::sphere_map::equal_area_sphere_to_square;
    use lumiris_numbers::math::warp::{sample_cosine_hemisphere, sample_uniform_sphere};
    use lumiris_test_support::random::{Pcg32, RngExt, pcg32};
    use lumiris_test_support::{Moments, assert_chi_squared};
    use std::f64::consts::PI;

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

    fn light_of(sky: EnvironmentMap) -> PortalLight {
        PortalLight::new(Arc::new(sky), Mat3::from_rotation_x(0.4), 0.5, portal())
    }

    fn light(texel: impl FnMut(usize) -> f32, size: usize) -> PortalLight {
        light_of(sky(texel, size))
    }

    /// A bright texel in an image that is dark elsewhere, and one with all kinds of values.
    fn lights() -> [PortalLight; 2] {
        let mut stream = pcg32([1, 2, 3]);
        [light(|i| if i == 70 { 50.0 } else { 0.01 }, 16), light(|_| stream.random::<f32>().powi(6) * 9.0, 16)]
    }

    /// Points on the illuminated side: far, near, and very near to the portal.
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
            assert_eq!(light.le_and_pdf(p, w).pdf > 0.0, is_lit, "{x} {y}");
            // No light from behind, nor in directions that miss the portal
            let behind = at(0.7, 0.2) + n;
            assert!(light.le(p, -w).is_black() && light.le(behind, (at(x, y) - behind).normalize()).is_black());
            assert!(light.sample_li(&LightCtx::at(behind), [0.5; 2]).is_none());
        }
        // From next to the portal the visible sky is a hemisphere, whose flux through 1.5 m² is π·1.5
        let expected = 1.5 * std::f32::consts::PI * Rgb::new(0.5, 0.25, 1.0).luminance();
        assert!((light.power_luminance() - expected).abs() < 2e-4 * expected, "{} {expected}", light.power_luminance());
    }

    #[test]
    fn samples_have_the_radiance_and_the_density_of_their_directions() {
        let stream = &mut pcg32([5, 6, 7]);
        for light in lights() {
            for p in points(stream) {
                for _ in 0..2000 {
                    let s = light.sample_li(&LightCtx::at(p), stream.random::<[f32; 2]>()).unwrap();
                    let pdf = light.le_and_pdf(p, s.wi).pdf;
                    // Rounding may carry a direction over an edge of a cell, of a texel, or of the portal
                    let is_near = (pdf - s.pdf).abs() <= 2e-3 * s.pdf && light.le(p, s.wi) == s.li;
                    let moved = |e: f32| {
                        light.le_and_pdf(p, (s.wi + portal().world_from_portal * Vec3::splat(e)).normalize()).pdf
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
                    density.add(f64::from(light.le_and_pdf(p, w).pdf) * 4.0 * PI);
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
                let place = |st: [f64; 2]| [0, 1].map(|i| (st[i] - low[i]) / (high[i] - low[i]) * N as f64);
                let mut observed = vec![0.0; N * N];
                for _ in 0..count {
                    let s = light.sample_li(&LightCtx::at(p), stream.random::<[f32; 2]>()).unwrap();
                    let v = (light.portal.world_from_portal.transpose() * s.wi).as_dvec3();
                    let [x, y] = place([v.x / v.z, v.y / v.z].map(coordinate)).map(|x| (x as usize).min(N - 1));
                    observed[y * N + x] += 1.0;
                }

                // The density is constant between the edges of these cells and of the table's cells
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
                for (s, t) in columns.windows(2).flat_map(|s| rows.windows(2).map(move |t| (s, t))) {
                    let st = [s, t].map(|edges| 0.5 * (edges[0] + edges[1]));
                    let [x, y] = place(st).map(|x| (x as usize).min(N - 1));
                    let probability = light.density(st) / integral * (s[1] - s[0]) * (t[1] - t[0]);
                    expected[y * N + x] += probability * f64::from(count);
                }
                assert_chi_squared(&observed, &expected, 1e-6);
            }
        }
    }

    #[test]
    fn the_power_is_the_flux_of_a_sun_of_one_texel() {
        for at in [70, 105, 118, 135, 150] {
            let sky = || sky(|i| if i == at { 900.0 } else { 0.1 }, 16);
            let (map, turn, z) = (sky(), Mat3::from_rotation_x(0.4), portal().world_from_portal.z_axis);
            let mut flux = Welford::default();
            for i in 0..1_000_000_u32 {
                // Cosine-distributed lattice, whose errors are far below the errors of random points
                let u = [(f64::from(i) + 0.5) / 1e6, f64::from(i) * 0.618_033_988_749_895 % 1.0].map(|u| u as f32);
                let w = Frame::from_z(z).to_world(sample_cosine_hemisphere(u));
                flux.add(PI * f64::from(map.le(turn.transpose() * w).luminance()));
            }
            let (expected, power) = (flux.mean() * 0.5 * 1.5, f64::from(light_of(sky()).power_luminance()));
            assert!((power - expected).abs() < 3e-3 * expected, "{at}: {power} {expected}");
        }
    }

    /// Points below the portal and beside it, next to its plane and far from it.
    fn points_of_all_kinds() -> Vec<Vec3> {
        let Portal { corner, world_from_portal, .. } = portal();
        let at = |x: f32, y: f32, h: f32| corner + world_from_portal * Vec3::new(x, y, -h);
        let places = [[0.7, 0.4], [0.01, 0.3], [2.5, 0.4], [4.0, 5.0], [-0.5, 9.0]];
        places.into_iter().flat_map(|[x, y]| [10.0, 1.0, 0.05, 1e-3].map(|h| at(x, y, h))).collect()
    }

    #[test]
    fn an_even_sky_has_samples_of_similar_weights() {
        let (light, stream) = (light(|_| 1.0, 4), &mut pcg32([3, 6, 7]));
        for p in points_of_all_kinds() {
            let (mut weights, mut largest) = (Welford::default(), 0.0_f64);
            for _ in 0..20_000 {
                let s = light.sample_li(&LightCtx::at(p), stream.random::<[f32; 2]>()).unwrap();
                weights.add(f64::from(1.0 / s.pdf));
                largest = largest.max(f64::from(1.0 / s.pdf));
            }
            assert!(largest < 6.0 * weights.mean(), "{p}: {largest}, mean {}", weights.mean());
        }
    }

    /// A sun of one texel outside the window, across its edge, and inside, in a sky 10⁴ times darker.
    #[test]
    fn a_sun_at_the_edge_of_the_window_makes_no_outliers() {
        const SIZE: usize = 64;
        let Portal { corner, world_from_portal, .. } = portal();
        let w = world_from_portal * Vec3::new(0.4, 0.3, 0.866);
        let place = equal_area_sphere_to_square(Mat3::from_rotation_x(-0.4) * w.normalize());
        let [x, y] = [place.x, place.y].map(|x| (x * SIZE as f32) as usize);
        let (light, stream) = (light(|i| if i == y * SIZE + x { 1e4 } else { 1.0 }, SIZE), &mut pcg32([4, 6, 7]));
        for k in 0..40 {
            let p = corner + world_from_portal * Vec3::new(0.01 * k as f32 - 0.2, 0.5, 0.0) - w * 3.0;
            let mut values = Welford::default();
            for _ in 0..4000 {
                let s = light.sample_li(&LightCtx::at(p), stream.random::<[f32; 2]>());
                values.add(s.map_or(0.0, |s| f64::from(s.li.g / s.pdf)));
            }
            let variance = values.variance() / values.mean().powi(2);
            assert!(variance < 2.5, "{k}: {variance}");
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

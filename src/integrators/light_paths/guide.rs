//! Sampling of the first segments of light paths: light, point and direction.
//!
//! Few directions lead from a light over glass or metal to surfaces visible to the camera. A pilot learns them: first,
//! rays in all directions locate metal and glass; then light paths in these directions measure their contribution to
//! the image. Lights of one geometry share a table over the directions of world space. Directions missed by the pilot
//! have the density 0, and remain with camera paths. So the estimate is unbiased for any pilot.

use crate::lights::sample_columns::ChosenLight;
use crate::lights::{EmittingPoint, Light, LightId, LightSet};
use crate::photons::LightDistribution;
use lumiris_numbers::math::sphere_map::{
    equal_area_sphere_to_square, equal_area_square_to_sphere, pdf_equal_area_square_to_sphere, wrap_equal_area_texel,
};
use lumiris_numbers::math::{PiecewiseConstant2D, Rgb, Vec2, Vec3};

/// Cells along the edge of the direction table.
const EDGE: usize = 64;
/// Maximum number of tables. The lights of all further geometries share the last one.
const MAX_GROUPS: usize = 256;

/// The start of a light path.
#[derive(Clone, Copy, Debug)]
pub(super) struct Emitted {
    pub(super) light: LightId,
    pub(super) p: Vec3,
    pub(super) p_error: Vec3,
    /// Normal on the emitting side.
    pub(super) n: Vec3,
    pub(super) d: Vec3,
    /// Power (W) if the image had only this light path.
    pub(super) power: Rgb,
    /// See [`LightPathGuide::density`].
    pub(super) density: f32,
}

/// Distribution of the first segments of light paths.
#[derive(Clone, Debug)]
pub(in crate::integrators) struct LightPathGuide {
    lights: LightDistribution,
    /// Table of each light.
    group_of: Vec<u16>,
    tables: Vec<PiecewiseConstant2D>,
    /// Light paths per area of each light (1/m²).
    rates: Vec<f32>,
    /// Number of light paths in a set.
    pub(super) paths: u32,
}

/// Contributions of the paths of a pilot, by light and by direction.
#[derive(Clone, Debug)]
pub(super) struct Contributions {
    of_light: Vec<f64>,
    /// By table and cell.
    of_direction: Vec<f64>,
}

impl LightPathGuide {
    /// The first guide of a pilot: lights in proportion to power, and uniform directions. `None` without area lights.
    pub(super) fn everywhere(set: &LightSet, paths: u32) -> Option<Self> {
        let sources = set.sources();
        let last = sources.iter().flatten().max().map_or(0, |&last| (last as usize).min(MAX_GROUPS - 1));
        let group_of = sources.iter().map(|source| source.map_or(0, |s| (s as usize).min(last) as u16)).collect();
        let uniform = PiecewiseConstant2D::new(&[1.0; EDGE * EDGE], EDGE);
        Self::new(set, group_of, vec![uniform; last + 1], paths, |light| f64::from(power(set, light)))
    }

    fn new(
        set: &LightSet,
        group_of: Vec<u16>,
        tables: Vec<PiecewiseConstant2D>,
        paths: u32,
        weight: impl Fn(LightId) -> f64,
    ) -> Option<Self> {
        let of_area = |light: LightId| if area(set, light) > 0.0 { weight(light) as f32 } else { 0.0 };
        let lights = LightDistribution::by_weights(set, 0.0, of_area)?;
        let rate = |light: LightId| match area(set, light) {
            area if area > 0.0 => lights.pmf(light) / area * paths as f32,
            _ => 0.0,
        };
        let rates = (0..set.lights.len() as LightId).map(rate).collect();
        Some(LightPathGuide { lights, group_of, tables, rates, paths })
    }

    /// The same distribution with another number of paths.
    #[must_use]
    pub(in crate::integrators) fn with_paths(&self, paths: u32) -> Self {
        let factor = paths as f32 / self.paths as f32;
        let rates = self.rates.iter().map(|rate| rate * factor).collect();
        let LightPathGuide { lights, group_of, tables, .. } = self.clone();
        LightPathGuide { lights, group_of, tables, rates, paths }
    }

    /// Empty contributions.
    pub(super) fn begin(&self) -> Contributions {
        let cells = self.tables.len() * EDGE * EDGE;
        Contributions { of_light: vec![0.0; self.rates.len()], of_direction: vec![0.0; cells] }
    }

    /// Adds the contribution `value` of a path that left `light` in the direction `d`.
    pub(super) fn add(&self, contributions: &mut Contributions, light: LightId, d: Vec3, value: f64) {
        let cell = (equal_area_sphere_to_square(d) * EDGE as f32).clamp(Vec2::ZERO, Vec2::splat((EDGE - 1) as f32));
        let cell = cell.y as usize * EDGE + cell.x as usize;
        contributions.of_light[light as usize] += value;
        contributions.of_direction[usize::from(self.group_of[light as usize]) * EDGE * EDGE + cell] += value;
    }

    /// A guide in proportion to the contributions; `None` if all are 0.
    pub(super) fn learned(&self, set: &LightSet, contributions: &Contributions) -> Option<Self> {
        let tables = contributions.of_direction.chunks(EDGE * EDGE).map(table).collect();
        Self::new(set, self.group_of.clone(), tables, self.paths, |light| contributions.of_light[light as usize])
    }

    /// Density of light paths (1/(m² sr), projected) that leave `light` in the direction `d`, at a point with the
    /// normal `n`. 0 if there are none.
    #[inline]
    pub(in crate::integrators) fn density(&self, light: LightId, n: Vec3, d: Vec3) -> f32 {
        let rate = self.rates[light as usize];
        if rate > 0.0 { rate * self.pdf(light, d) / n.dot(d).abs() } else { 0.0 }
    }

    /// Density of the direction (1/sr).
    #[inline]
    fn pdf(&self, light: LightId, d: Vec3) -> f32 {
        let table = &self.tables[usize::from(self.group_of[light as usize])];
        table.pdf(equal_area_sphere_to_square(d)) * pdf_equal_area_square_to_sphere()
    }

    /// Samples a light path by two random numbers each for the light, the point and the direction; `None` if it carries
    /// no power.
    pub(super) fn emit(&self, set: &LightSet, u_light: [f32; 2], [u_point, u_d]: [[f32; 2]; 2]) -> Option<Emitted> {
        let ChosenLight { light, pmf } = self.lights.sample(u_light);
        let place = self.tables[usize::from(self.group_of[light as usize])].sample(u_d)?;
        let d = equal_area_square_to_sphere(place.p);
        let Light::Area(area) = &set.lights[light as usize] else { return None };
        let EmittingPoint { p, p_error, n, pdf_area, radiance } = area.sample_point_towards(u_point, d);
        let pdf = pdf_area * pmf * place.pdf * pdf_equal_area_square_to_sphere();
        let power = radiance * (n.dot(d) / pdf);
        let density = self.density(light, n, d);
        (!power.is_black() && power.is_finite()).then_some(Emitted { light, p, p_error, n, d, power, density })
    }
}

/// Area of a light; 0 if it has none.
fn area(set: &LightSet, light: LightId) -> f32 {
    if let Light::Area(area) = &set.lights[light as usize] { area.area() } else { 0.0 }
}

/// Power of a light with an area.
fn power(set: &LightSet, light: LightId) -> f32 {
    if let Light::Area(area) = &set.lights[light as usize] { area.power_luminance() } else { 0.0 }
}

/// A table in proportion to the contributions, smoothed over neighbouring cells.
fn table(cells: &[f64]) -> PiecewiseConstant2D {
    let edge = EDGE as isize;
    let around = |x: isize, y: isize| {
        let mut sum = 0.0;
        for (dy, wy) in (-1..).zip([1.0, 2.0, 1.0]) {
            for (dx, wx) in (-1..).zip([1.0, 2.0, 1.0]) {
                let [x, y] = wrap_equal_area_texel([x + dx, y + dy], edge);
                sum += wx * wy * cells[(y * edge + x) as usize];
            }
        }
        sum
    };
    let total: f64 = 16.0 * cells.iter().sum::<f64>();
    let value = |(x, y)| if total > 0.0 { (around(x, y) / total) as f32 } else { 0.0 };
    let cells: Vec<f32> = (0..edge).flat_map(|y| (0..edge).map(move |x| (x, y))).map(value).collect();
    PiecewiseConstant2D::new(&cells, EDGE)
}

impl Contributions {
    /// The sum of both, each normalised over the lights, and over the directions of each table.
    pub(super) fn mixed(&self, other: &Contributions) -> Contributions {
        let mix = |a: &[f64], b: &[f64]| {
            let [all_a, all_b] = [a, b].map(|values| values.iter().sum::<f64>());
            let share = |value: f64, all: f64| if all > 0.0 { value / all } else { 0.0 };
            a.iter().zip(b).map(|(a, b)| share(*a, all_a) + share(*b, all_b)).collect()
        };
        let of_tables = |contributions: &Contributions| -> Vec<f64> {
            let normalised = |cells: &[f64]| {
                let all: f64 = cells.iter().sum();
                cells.iter().map(move |cell| if all > 0.0 { cell / all } else { 0.0 }).collect::<Vec<f64>>()
            };
            contributions.of_direction.chunks(EDGE * EDGE).flat_map(normalised).collect()
        };
        let of_direction = of_tables(self).iter().zip(of_tables(other)).map(|(a, b)| a + b).collect();
        Contributions { of_light: mix(&self.of_light, &other.of_light), of_direction }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{BilinearMesh, Shape, TriangleMesh};
    use crate::lights::{Emission, LightSetBuilder, PointLight};
    use lumiris_numbers::math::Bounds3;
    use lumiris_test_support::random::{RngExt, pcg32};
    use lumiris_test_support::{Moments, assert_chi_squared};

    /// A point light, which has no area, a bent patch, and a mesh of two triangles that emit on both sides.
    fn lights() -> LightSet {
        let mut builder = LightSetBuilder::default();
        builder.add(Light::Point(PointLight { p: Vec3::ZERO, intensity: Rgb::WHITE }));
        let positions = vec![v(-0.5, -0.5, 2.0), v(-0.4, 0.7, 2.1), v(0.5, -0.6, 1.8), v(0.6, 0.5, 2.2)];
        let patch = BilinearMesh { positions, indices: vec![[0, 1, 2, 3]], ..BilinearMesh::default() };
        builder.add_area(3, &Shape::Bilinear(patch), &Emission::constant(Rgb::new(3.0, 1.0, 0.5)));
        let corners = vec![v(0.0, 0.0, 0.0), v(2.0, 0.0, 0.0), v(0.0, 1.0, 0.3), v(2.0, 2.0, 0.0)];
        let mesh = Shape::Mesh(TriangleMesh::new(corners, vec![[0, 1, 2], [1, 3, 2]]).unwrap());
        builder.add_area(1, &mesh, &Emission { two_sided: true, ..Emission::constant(Rgb::new(1.0, 2.0, 4.0)) });
        builder.build(&Bounds3 { min: Vec3::splat(-2.0), max: Vec3::splat(3.0) })
    }

    #[test]
    fn light_paths_carry_the_power_of_all_lights_with_an_area() {
        let set = lights();
        let guide = LightPathGuide::everywhere(&set, 1).unwrap();
        let power: f32 = (1..4).map(|light| power(&set, light)).sum();
        let mut s = pcg32([1, 2, 3]);
        let mut moments = Moments::default();
        for _ in 0..200_000 {
            let emitted = guide.emit(&set, s.random(), [s.random(), s.random()]);
            moments.add(f64::from(emitted.map_or(0.0, |e| e.power.luminance())));
        }
        moments.assert_mean(f64::from(power), 1e-5, 1e-5);
    }

    #[test]
    fn learned_light_paths_have_their_density() {
        let set = lights();
        let all = LightPathGuide::everywhere(&set, 1000).unwrap();
        let mut contributions = all.begin();
        for (light, d, value) in [(1, v(0.3, 0.2, -0.9), 1.0), (1, v(-0.5, 0.1, -0.4), 0.5), (2, v(0.1, 0.9, 0.4), 2.0)]
        {
            all.add(&mut contributions, light, d.normalize(), value);
        }
        let guide = all.learned(&set, &contributions).unwrap().with_paths(500);
        assert!(all.learned(&set, &all.begin()).is_none());
        // Counts by light and by cell of the direction table
        const CELLS: usize = 32;
        let cell = |d: Vec3| {
            let p = (equal_area_sphere_to_square(d) * CELLS as f32).clamp(Vec2::ZERO, Vec2::splat(31.0));
            p.y as usize * CELLS + p.x as usize
        };
        let mut s = pcg32([1, 2, 4]);
        let mut observed = vec![0.0; 4 * CELLS * CELLS];
        let count = 100_000;
        for _ in 0..count {
            let Some(e) = guide.emit(&set, s.random(), [s.random(), s.random()]) else { continue };
            observed[e.light as usize * CELLS * CELLS + cell(e.d)] += 1.0;
            let density = guide.density(e.light, e.n, e.d);
            assert!((density / e.density - 1.0).abs() < 1e-5 && e.n.dot(e.d) > 0.0);
            // Power is radiance over the density. The density of the guide includes its number of paths, 500
            let Light::Area(area) = &set.lights[e.light as usize] else { panic!("it has no area") };
            let radiance = area.emission.radiance(Vec2::ZERO).luminance();
            let is_flat = e.light > 1;
            assert!(!is_flat || (e.power.luminance() * density / (500.0 * radiance) - 1.0).abs() < 1e-3);
        }
        // Integrate the density over the sphere, for the mesh, which emits in all directions
        let fine = 16 * CELLS;
        let mut expected = vec![0.0_f64; observed.len()];
        for i in 0..fine * fine {
            let p = Vec2::new((i % fine) as f32 + 0.5, (i / fine) as f32 + 0.5) / fine as f32;
            let d = equal_area_square_to_sphere(p);
            for light in [2, 3] {
                let pdf = guide.rates[light as usize] * area(&set, light) / 500.0 * guide.pdf(light, d);
                let solid_angle = 4.0 * std::f32::consts::PI / (fine * fine) as f32;
                expected[light as usize * CELLS * CELLS + cell(d)] += f64::from(pdf * solid_angle * count as f32);
            }
        }
        let of_mesh = 2 * CELLS * CELLS..4 * CELLS * CELLS;
        assert_chi_squared(&observed[of_mesh.clone()], &expected[of_mesh], 1e-5);
    }

    fn v(x: f32, y: f32, z: f32) -> Vec3 {
        Vec3::new(x, y, z)
    }
}

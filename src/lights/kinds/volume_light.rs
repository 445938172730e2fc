//! Emission of media as lights: a light is a part of a medium's box, in which points are sampled.
//!
//! A path collects the emission of a medium at points along its rays, at a rate λ. These points have the density p(ω)·λ
//! per solid angle and length. A light sample with the density p per volume has the density p·r² in the same measure at
//! the distance r.
//!
//! λ is divided out of both. As a light, the medium has the radiance σ_a L_e/λ, and its samples have the density p·r²/λ
//! per steradian. That density is compared with p(ω), as for any other light. The weights of the two techniques add up
//! to 1 at every point of the volume, as multiple importance sampling requires [Veach and Guibas 1995], and the path
//! samples bound the contribution of near points. [Simon et al. 2017] use line integrals instead of points.
//!
//! Cells that appear dark to the probes have the density 0 and are left to paths.

use crate::lights::{LightBounds, LightCtx, LightSample};
use crate::media::{Heterogeneous, MediumId};
use lumiris_numbers::math::hash::{hash_floats, pcg4d, unit_f32};
use lumiris_numbers::math::{Bounds3, ONE_MINUS_EPSILON, Vec3, cumulative};
use rayon::prelude::*;
use std::sync::Arc;

/// Cells along an axis of a part.
const CELLS: usize = 4;
/// Maximum number of parts along an axis of a medium.
const MAX_PARTS: usize = 8;
/// Lookups of the medium along an axis of a cell.
const PROBES: usize = 2;

/// An emitting part of a medium.
#[derive(Clone, Debug)]
pub struct VolumeLight {
    medium: Arc<Heterogeneous>,
    /// The medium.
    pub id: MediumId,
    /// Lower corner and size in the unit cube of the medium.
    corner: Vec3,
    size: Vec3,
    /// Running sums of the probabilities of the cells, x fastest.
    sums: Vec<f32>,
    /// Volume of a cell (m³).
    cell_volume: f32,
    bounds: LightBounds,
}

/// The division of a medium's box into parts: numbers of parts along the axes.
#[derive(Clone, Copy, Debug)]
pub struct Parts([usize; 3]);

impl Parts {
    /// The division of a medium.
    pub fn of(medium: &Heterogeneous) -> Self {
        Parts(medium.resolution().map(|n| n.div_ceil(CELLS).clamp(1, MAX_PARTS)))
    }

    /// The emitting parts, x fastest; `None` for dark ones.
    pub fn lights(self, medium: &Arc<Heterogeneous>, id: MediumId) -> Vec<Option<VolumeLight>> {
        let [nx, ny, nz] = self.0;
        let of = |i: usize| {
            let place = [i % nx, i / nx % ny, i / (nx * ny)].map(|x| x as f32);
            let size = Vec3::ONE / Vec3::new(nx as f32, ny as f32, nz as f32);
            VolumeLight::new(medium, id, Vec3::from(place) * size, size)
        };
        (0..nx * ny * nz).into_par_iter().map(of).collect()
    }

    /// Index of the part that contains a point of the unit cube.
    #[inline]
    pub fn at(self, p: Vec3) -> usize {
        let [nx, ny, _] = self.0;
        let [x, y, z] = [0, 1, 2].map(|axis| place(p[axis], self.0[axis]));
        x + nx * (y + ny * z)
    }
}

/// Index of the interval that contains `x`, out of `n` equal intervals of [0, 1].
#[inline]
fn place(x: f32, n: usize) -> usize {
    ((x * n as f32).max(0.0) as usize).min(n - 1)
}

impl VolumeLight {
    /// A part; `None` if it is dark.
    fn new(medium: &Arc<Heterogeneous>, id: MediumId, corner: Vec3, size: Vec3) -> Option<Self> {
        // Mean luminance of the probes in each cell
        let step = size / (CELLS * PROBES) as f32;
        let mut emitting = Bounds3::EMPTY;
        let mut weights = [0.0_f32; CELLS.pow(3)];
        for (i, weight) in weights.iter_mut().enumerate() {
            let first = [i % CELLS, i / CELLS % CELLS, i / CELLS.pow(2)].map(|x| (x * PROBES) as f32);
            let low = corner + Vec3::from(first) * step;
            let probe = |k: usize| {
                let offset = [k % PROBES, k / PROBES % PROBES, k / PROBES.pow(2)].map(|x| x as f32 + 0.5);
                medium.emission(low + Vec3::from(offset) * step).luminance()
            };
            *weight = (0..PROBES.pow(3)).map(probe).sum::<f32>() / PROBES.pow(3) as f32;
            if *weight > 0.0 {
                let high = low + step * PROBES as f32;
                emitting = emitting.union(medium.world_bounds(Bounds3 { min: low, max: high }));
            }
        }

        // Normalise to running sums
        let total: f32 = weights.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let mut sum = 0.0;
        let mut sums: Vec<f32> = Vec::with_capacity(weights.len());
        sums.extend(weights.iter().map(|weight| {
            sum += weight / total;
            sum
        }));
        let cell_volume = medium.volume() * size.element_product() / CELLS.pow(3) as f32;
        let bounds = LightBounds {
            bounds: emitting,
            axis: Vec3::Z,
            cos_theta_o: -1.0,
            cos_theta_e: 0.0,
            two_sided: false,
            intensity: total * cell_volume,
        };
        let is_bright = bounds.intensity > 0.0 && bounds.intensity.is_finite() && emitting.diagonal().is_finite();
        is_bright.then(|| VolumeLight { medium: Arc::clone(medium), id, corner, size, sums, cell_volume, bounds })
    }

    /// Bounds for the light tree.
    pub fn bounds(&self) -> LightBounds {
        self.bounds
    }

    /// Density of the samples at a point of the unit cube of the medium (1/m³).
    #[inline]
    fn density(&self, p: Vec3) -> f32 {
        let [x, y, z] = [0, 1, 2].map(|axis| place((p[axis] - self.corner[axis]) / self.size[axis], CELLS));
        cumulative::weight(&self.sums, x + CELLS * (y + CELLS * z)) / self.cell_volume
    }

    /// Samples a point. The third random number is a hash of the other two.
    pub fn sample_li(&self, ctx: &LightCtx, u: [f32; 2]) -> Option<LightSample> {
        // Choose a cell
        let last = self.sums[self.sums.len() - 1];
        let x = u[0] * last;
        let cell = cumulative::find(&self.sums, x).min(self.sums.len() - 1);
        let pmf = cumulative::weight(&self.sums, cell);
        let u0 = ((x - cumulative::sum_before(&self.sums, cell)) / pmf).clamp(0.0, ONE_MINUS_EPSILON);
        let u2 = unit_f32(pcg4d([hash_floats(&u), u[0].to_bits(), u[1].to_bits(), cell as u32])[0]);

        // Choose a point of the cell
        let low = [cell % CELLS, cell / CELLS % CELLS, cell / CELLS.pow(2)].map(|x| x as f32);
        let p = self.corner + (Vec3::from(low) + Vec3::new(u0, u[1], u2)) * self.size / CELLS as f32;
        let rate = self.medium.emission_lookup_rate(p);
        let point = self.medium.world_point(p);
        let to_point = point - ctx.p;
        let t = to_point.length();
        let sample = LightSample {
            li: self.medium.emission(p) / rate,
            wi: to_point / t,
            pdf: self.pdf(ctx, p, point, rate),
            t,
            p: point,
            n: Vec3::ZERO,
            p_error: Vec3::ZERO,
            is_delta: false,
        };
        (sample.pdf > 0.0 && sample.pdf.is_finite() && sample.li.is_finite()).then_some(sample)
    }

    /// Density per steradian of [`sample_li`](Self::sample_li) in the direction of a point, which is given in the unit
    /// cube and in world space. `rate` (1/m) is the rate at which paths collect emission there.
    #[inline]
    pub fn pdf(&self, ctx: &LightCtx, unit: Vec3, p: Vec3, rate: f32) -> f32 {
        self.density(unit) * (p - ctx.p).length_squared() / rate
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::media::{Field, Samples, Scalars, UniformGrid};
    use lumiris_numbers::math::{DAffine3, DVec3, Rgb};
    use lumiris_test_support::Moments;
    use lumiris_test_support::random::{RngExt, pcg32};

    /// A medium that emits in some cells, stretched and rotated.
    fn medium() -> Arc<Heterogeneous> {
        let density: Vec<f32> = (0..9 * 7 * 5).map(|i| if i % 3 == 0 { 0.0 } else { (i * 7 % 11) as f32 }).collect();
        let grid = UniformGrid {
            sigma_a: Rgb::new(0.3, 0.2, 0.1),
            sigma_s: Rgb::splat(0.5),
            density: Scalars::Dense(Samples::new([9, 7, 5], density).unwrap()),
            le: Rgb::new(2.0, 3.0, 1.0),
            le_scale: None,
            temperature: None,
        };
        let place = DAffine3::from_rotation_y(0.4) * DAffine3::from_scale(DVec3::new(1.0, 2.0, 0.5));
        Arc::new(Heterogeneous::new(Field::Uniform(grid), [DVec3::ZERO, DVec3::ONE], &place, 0.0))
    }

    #[test]
    fn samples_of_all_parts_integrate_what_glows_and_have_their_density() {
        let (medium, ctx) = (medium(), LightCtx::at(Vec3::new(-1.0, 0.3, 2.0)));
        let parts = Parts::of(&medium);
        let lights = parts.lights(&medium, 3);
        assert!(lights.iter().flatten().count() > 4);
        // ∫ σ_a L_e/r² dV, by the midpoint rule in the unit cube
        let steps = 90;
        let term = |i: i32| {
            let place = [i % steps, i / steps % steps, i / (steps * steps)];
            let unit = Vec3::from(place.map(|x| (x as f32 + 0.5) / steps as f32));
            f64::from(medium.emission(unit).g / (medium.world_point(unit) - ctx.p).length_squared())
        };
        let count = steps * steps * steps;
        let integral = (0..count).map(term).sum::<f64>() * f64::from(medium.volume()) / f64::from(count);

        let (mut s, mut moments) = (pcg32([5, 2, 1]), Moments::default());
        for _ in 0..200_000 {
            let i = s.random_range(0..lights.len());
            let sample =
                lights[i].as_ref().and_then(|light| Some((light, light.sample_li(&ctx, s.random::<[f32; 2]>())?)));
            moments.add(sample.map_or(0.0, |(light, sample)| {
                let unit = medium.unit_point(sample.p);
                assert!(light.bounds().bounds.contains(sample.p) && parts.at(unit) == i, "{i}: {unit} {sample:?}");
                let pdf = light.pdf(&ctx, unit, sample.p, medium.emission_lookup_rate(unit));
                assert!((pdf - sample.pdf).abs() < 1e-3 * pdf, "{pdf} {}", sample.pdf);
                lights.len() as f64 * f64::from(sample.li.g / sample.pdf)
            }));
        }
        moments.assert_mean(integral, 1e-5, 2e-3);
    }
}

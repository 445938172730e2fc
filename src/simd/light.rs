//! Directions to one light from one point, many at once.

use super::lane::{F, LANES, Vec3s, safe_sqrt, sin_cos_turns};
use crate::math::warp;
use fearless_simd::{Level, Simd, dispatch, prelude::*};

/// Directions to one light. All slices have the same length.
#[derive(Debug)]
pub struct LightLanes<'a> {
    /// Unit directions to the light, by component.
    pub wi: [&'a mut [f32]; 3],
    /// Radiance that arrives if nothing is between, by channel. For delta lights it is the weight of the delta.
    pub li: [&'a mut [f32]; 3],
    /// Density per steradian; 1 for delta lights; 0 where there is no sample, whose direction and radiance are arbitrary.
    pub pdf: &'a mut [f32],
}

impl LightLanes<'_> {
    /// Gives the same radiance and density to all.
    pub fn fill(&mut self, li: [f32; 3], pdf: f32) {
        for (channel, value) in self.li.iter_mut().zip(li) {
            channel.fill(value);
        }
        self.pdf.fill(pdf);
    }
}

/// Directions uniform on the sphere; see [`warp::sample_uniform_sphere`].
pub fn sample_uniform_sphere(level: Level, u: [&[f32]; 2], li: [f32; 3], out: &mut LightLanes<'_>) {
    out.fill(li, warp::pdf_uniform_sphere());
    dispatch!(level, simd => sample_uniform_sphere_lanes(simd, u, out));
}

#[inline(always)]
fn sample_uniform_sphere_lanes<S: Simd>(simd: S, u: [&[f32]; 2], out: &mut LightLanes<'_>) {
    for i in (0..out.pdf.len()).step_by(LANES) {
        let z = F::splat(simd, 1.0) - super::lane::load(simd, u[0], i) * 2.0;
        let sin_theta = safe_sqrt(F::splat(simd, 1.0) - z * z);
        let (sin_phi, cos_phi) = sin_cos_turns(super::lane::load(simd, u[1], i));
        Vec3s { x: sin_theta * cos_phi, y: sin_theta * sin_phi, z }.store(&mut out.wi, i);
    }
}

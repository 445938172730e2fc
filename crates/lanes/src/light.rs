//! Directions from one point to one light, many samples at once.

use super::lane::{F, LANES, Vec3s, begin, load, padded, safe_sqrt};
use super::wide::sin_cos_turns;
use fearless_simd::{Level, Simd, dispatch, prelude::*};
use lumiris_numbers::math::elementary::SinCos;
use lumiris_numbers::math::warp;

/// Samples of directions to one light. All slices have the same length.
#[derive(Debug)]
pub struct LightLanes<'a> {
    /// Unit directions to the light, by component.
    pub wi: [&'a mut [f32]; 3],
    /// Unoccluded incident radiance, by channel. For delta lights, the weight of the delta.
    pub li: [&'a mut [f32]; 3],
    /// Density per steradian; 1 for delta lights. 0 if there is no sample; direction and radiance are then arbitrary.
    pub pdf: &'a mut [f32],
}

impl LightLanes<'_> {
    /// Sets the same radiance and density for all samples.
    pub fn fill(&mut self, li: [f32; 3], pdf: f32) {
        for (channel, value) in self.li.iter_mut().zip(li) {
            channel.fill(value);
        }
        self.pdf.fill(pdf);
    }

    /// Calls `sample` with at least [`LANES`] numbers, the first of which are `u`. A trait object, so that the kernel
    /// is compiled once and not for each of the two calls.
    pub(super) fn with_padding(&mut self, u: [&[f32]; 2], sample: &dyn Fn([&[f32]; 2], &mut LightLanes<'_>)) {
        let n = self.pdf.len();
        if n >= LANES {
            return sample(u, self);
        }
        let u = u.map(padded);
        let [mut x, mut y, mut z, mut r, mut g, mut b, mut pdf] = [[0.0; LANES]; 7];
        let mut out = LightLanes { wi: [&mut x, &mut y, &mut z], li: [&mut r, &mut g, &mut b], pdf: &mut pdf };
        sample([&u[0], &u[1]], &mut out);
        for (to, from) in self.wi.iter_mut().chain(&mut self.li).zip([x, y, z, r, g, b]) {
            to.copy_from_slice(&from[..n]);
        }
        self.pdf.copy_from_slice(&pdf[..n]);
    }
}

/// Directions uniform over the sphere; see [`warp::sample_uniform_sphere`].
pub fn sample_uniform_sphere(level: Level, u: [&[f32]; 2], li: [f32; 3], out: &mut LightLanes<'_>) {
    out.with_padding(u, &|u, out| dispatch!(level, simd => sample_uniform_sphere_lanes(simd, u, out)));
    out.fill(li, warp::pdf_uniform_sphere());
}

#[inline(always)]
fn sample_uniform_sphere_lanes<S: Simd>(simd: S, u: [&[f32]; 2], out: &mut LightLanes<'_>) {
    for i in (0..out.pdf.len()).step_by(LANES) {
        let i = begin(i, out.pdf.len());
        let z = F::splat(simd, 1.0) - load(simd, u[0], i) * 2.0;
        let sin_theta = safe_sqrt(F::splat(simd, 1.0) - z * z);
        let SinCos { sin: sin_phi, cos: cos_phi } = sin_cos_turns(load(simd, u[1], i));
        Vec3s { x: sin_theta * cos_phi, y: sin_theta * sin_phi, z }.store(&mut out.wi, i);
    }
}

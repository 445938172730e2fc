//! A BSDF in the shading frame of a hit, for directions in world space.

use crate::bsdfs::{Bsdf, BsdfSample, Resampled, resample};
use crate::math::{Frame, Rgb, Vec3};

/// The scattering at a hit. Sides are told by the shading normal alone, as in pbrt-v4: where it disagrees with the
/// geometric normal, light may leak through or fail to arrive, and the integrator finds the former blocked.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceBsdf<'a> {
    /// Scattering in the shading frame.
    pub bsdf: Bsdf<'a>,
    /// Shading frame.
    pub frame: Frame,
    /// Geometric normal, unit, not turned to the viewer.
    pub n: Vec3,
}

impl SurfaceBsdf<'_> {
    /// Value without cosine (1/sr), without deltas.
    #[inline]
    pub fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        self.bsdf.f(self.frame.to_local(wo), self.frame.to_local(wi))
    }

    /// f·|cos θi| about the shading normal (1/sr).
    #[inline]
    pub fn f_cos(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let wi = self.frame.to_local(wi);
        self.bsdf.f(self.frame.to_local(wo), wi) * wi.z.abs()
    }

    /// Density of the non-specular part of [`Self::sample`] per steradian.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.bsdf.pdf(self.frame.to_local(wo), self.frame.to_local(wi))
    }

    /// [`f_cos`](Self::f_cos) and [`pdf`](Self::pdf) for many directions `wi` in world space, by component and channel;
    /// those of single calls up to rounding. All slices have the same length.
    pub fn eval_lanes(&self, wo: Vec3, wi: [&[f32]; 3], f_cos: [&mut [f32]; 3], pdf: &mut [f32]) {
        let wo = self.frame.to_local(wo);
        for i in 0..pdf.len() {
            let wi = self.frame.to_local(Vec3::new(wi[0][i], wi[1][i], wi[2][i]));
            let value = self.bsdf.f(wo, wi) * wi.z.abs();
            for c in 0..3 {
                f_cos[c][i] = value[c];
            }
            pdf[i] = self.bsdf.pdf(wo, wi);
        }
    }

    /// A direction to the light, in world space.
    #[inline]
    pub fn sample(&self, wo: Vec3, uc: f32, u: [f32; 2]) -> Option<BsdfSample> {
        let mut sample = self.bsdf.sample(self.frame.to_local(wo), uc, u)?;
        sample.wi = self.frame.to_world(sample.wi);
        Some(sample)
    }

    /// One of `proposals` directions to the light, in world space, see [`resample()`].
    #[inline]
    pub fn resample(
        &self,
        wo: Vec3,
        proposals: u32,
        u_proposal: impl Fn(u32) -> [f32; 3],
        u_choice: f32,
    ) -> Option<Resampled> {
        let mut drawn = resample(&self.bsdf, self.frame.to_local(wo), proposals, u_proposal, u_choice)?;
        drawn.wi = self.frame.to_world(drawn.wi);
        Some(drawn)
    }

    /// |cos θ| of a world-space direction about the shading normal.
    #[inline]
    pub fn cos(&self, w: Vec3) -> f32 {
        self.frame.z.dot(w).abs()
    }

    /// Fraction of uniform light that reaches `wo`, see [`Bsdf::albedo_estimate`].
    #[inline]
    pub fn albedo_estimate(&self, wo: Vec3) -> Rgb {
        self.bsdf.albedo_estimate(self.frame.to_local(wo))
    }
}

//! A point at which direct light is estimated, and the rays that leave it.

use crate::bsdfs::LobeWidth;
use crate::lights::{GlossyLobe, JobLights, LightCtx, LightSample};
use crate::materials::SurfaceBsdf;
use crate::media::{MediumId, Sides};
use crate::settings::SampleCounts;
use lumiris_numbers::math::ray::{SEGMENT_END, offset_origin};
use lumiris_numbers::math::{Ray, Vec3};
use lumiris_numbers::samplers::SampleStream;

/// A point on a light.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightPoint {
    pub(super) p: Vec3,
    /// Bound of its rounding error.
    pub(super) p_error: Vec3,
    pub(super) n: Vec3,
}

/// A point at which direct light is estimated.
#[derive(Clone, Copy, Debug)]
pub struct ShadingPoint<'a> {
    /// The point.
    pub p: Vec3,
    /// Bound of the rounding error of `p`.
    pub p_error: Vec3,
    /// Direction to the viewer, unit.
    pub wo: Vec3,
    /// Scattering at the point, with the frame and the geometric normal.
    pub bsdf: SurfaceBsdf<'a>,
    /// The lobe used by the choice of lights, see [`lobe_for_lights`].
    pub lobe: GlossyLobe,
    /// Time in 0..1.
    pub time: f32,
    /// Random numbers of this point; each technique uses its own domain.
    pub stream: SampleStream,
    /// Sample and proposal counts.
    pub sample_counts: SampleCounts,
    /// Index of the fit of the point, if there are fits.
    pub fit: u32,
    /// Index of the camera sample in its batch.
    pub sample: u32,
    /// The media on both sides of the surface.
    pub media: Sides,
}

/// The glossy lobe reflected to `wo`, if the light sampler uses it.
#[inline]
pub fn lobe_for_lights(lights: &JobLights, bsdf: &SurfaceBsdf<'_>, wo: Vec3) -> GlossyLobe {
    if !lights.sampler.needs_lobes() {
        return GlossyLobe::NONE;
    }
    let frame = &bsdf.frame;
    let lobe = bsdf.bsdf.glossy_lobe(frame.to_local(wo));
    lobe.map_or(GlossyLobe::NONE, |LobeWidth { alpha, share }| GlossyLobe::new(wo, frame.z, alpha, share))
}

impl ShadingPoint<'_> {
    /// The shading normal on the side of the viewer.
    pub fn viewer_normal(&self) -> Vec3 {
        let z = self.bsdf.frame.z;
        if z.dot(self.wo) < 0.0 { -z } else { z }
    }

    /// The context for sampling lights.
    #[inline]
    pub fn light_ctx(&self) -> LightCtx {
        if !self.bsdf.bsdf.has_surface() {
            return LightCtx::at(self.p);
        }
        LightCtx { p: self.p, n: self.bsdf.lit_normal(self.wo), ns: self.bsdf.frame.z, lobe: self.lobe }
    }

    /// The origin of a ray that leaves the point towards `w`.
    #[inline]
    pub fn origin(&self, w: Vec3) -> Vec3 {
        offset_origin(self.p, self.p_error, self.bsdf.n, w)
    }

    /// The medium into which the direction `w` leads.
    #[inline]
    pub fn medium(&self, w: Vec3) -> Option<MediumId> {
        self.media.towards(self.bsdf.n.dot(w))
    }

    /// The ray that leaves the point towards `w`.
    #[inline]
    pub fn ray(&self, w: Vec3) -> Ray {
        Ray { o: self.origin(w), d: w, t_max: f32::INFINITY, time: self.time }
    }

    /// The segment to a point on a light, or to infinity.
    pub(super) fn segment(&self, wi: Vec3, end: Option<LightPoint>) -> Ray {
        let ray = self.ray(wi);
        match end {
            None => ray,
            Some(LightPoint { p, p_error, n }) => {
                let end = offset_origin(p, p_error, n, ray.o - p);
                Ray { d: end - ray.o, t_max: SEGMENT_END, ..ray }
            }
        }
    }

    /// The segment to a point on a light, or to infinity.
    pub(super) fn light_segment(&self, sample: &LightSample) -> Ray {
        let end = LightPoint { p: sample.p, p_error: sample.p_error, n: sample.n };
        self.segment(sample.wi, sample.t.is_finite().then_some(end))
    }
}

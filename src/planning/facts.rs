//! Facts of a scene, the inputs of the [rule](super::rule): number of lights, sky, and diffuse surfaces in view.
//!
//! Measured by camera rays, light samples at their hits, and one more ray from each diffuse hit. Nothing is timed, so
//! the facts of a scene are the same on all machines.

use super::constants::{FACT_RAYS, LIGHT_SAMPLES};
use crate::accel::{Coherence, RayBatch};
use crate::bsdfs::Bsdf;
use crate::integrators::camera_sampler::CameraSampler;
use crate::lights::{LightCtx, SampleOfLight};
use crate::scene::{RayHit, RenderJob, SurfaceInteraction};
use lumiris_numbers::math::hash::{pcg4d, unit_f32};
use lumiris_numbers::math::ray::SEGMENT_END;
use lumiris_numbers::math::warp::sample_cosine_hemisphere;
use lumiris_numbers::math::{Frame, Ray, Vec3};

/// Seed of the rays.
const SEED: u32 = 0x66_61_63_74;

/// Facts of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Facts {
    /// Number of lights with power, each triangle of an emitting mesh being one.
    pub lights: usize,
    /// Fraction of lights at infinity in the direct light at the surfaces visible to the camera.
    pub sky: f64,
    /// Fraction of the light samples of all other lights that are occluded. The light sampler chooses them nearly in
    /// proportion to their unoccluded light, and a count is less noisy than a sum.
    pub hidden: f64,
    /// Fraction of these surfaces that are diffuse and next to another diffuse surface: a cosine-distributed ray hits
    /// one.
    pub diffuse_pairs: f64,
    /// Fraction of the rays from diffuse surfaces that leave the scene.
    pub open: f64,
}

impl Facts {
    /// Measures the facts of the scene of a job.
    pub fn of(job: &RenderJob) -> Self {
        // Visible surfaces and their light
        let rays: Vec<Ray> = camera_rays(job).collect();
        let visible: Vec<SurfaceInteraction> = hits(job, &rays).into_iter().flatten().collect();
        let light = DirectLight::at(job, &visible);
        let lights = job.world.scene.lights.lit.len();
        let mut facts = Facts { lights, sky: light.sky(), hidden: light.hidden(), ..Facts::default() };

        // Diffuse surfaces, and the surfaces around them
        let diffuse: Vec<&SurfaceInteraction> = visible.iter().filter(|at| is_diffuse(job, at)).collect();
        let rays: Vec<Ray> = (0..).zip(&diffuse).map(|(i, at)| cosine_ray(at, i)).collect();
        let (mut pairs, mut left) = (0, 0);
        for at in hits(job, &rays) {
            match at {
                Some(at) if is_diffuse(job, &at) => pairs += 1,
                Some(_) => {}
                None => left += 1,
            }
        }
        facts.diffuse_pairs = f64::from(pairs) / visible.len().max(1) as f64;
        facts.open = f64::from(left) / rays.len().max(1) as f64;
        facts
    }
}

/// Camera rays distributed over the image.
fn camera_rays(job: &RenderJob) -> impl Iterator<Item = Ray> {
    let bounds = job.world.scene.film.bounds;
    let camera = CameraSampler::new(job, 0);
    (1..=FACT_RAYS).map(move |i| {
        // R2 sequence [Roberts 2018]
        let place = |step: f64, size: u32| ((f64::from(i) * step).fract() * f64::from(size)) as u32;
        let pixel =
            [bounds.x0 + place(0.754_877_666, bounds.width()), bounds.y0 + place(0.569_840_291, bounds.height())];
        camera.sample_of_seed(pixel, i, SEED).ray.ray
    })
}

/// The geometric normal on the side of the viewer.
fn normal(at: &SurfaceInteraction) -> Vec3 {
    if at.surface.n.dot(at.wo) < 0.0 { -at.surface.n } else { at.surface.n }
}

/// A cosine-distributed ray from a surface.
fn cosine_ray(at: &SurfaceInteraction, i: u32) -> Ray {
    let [u, v, ..] = pcg4d([i, SEED, 0, 0]).map(unit_f32);
    let d = Frame::from_z(normal(at)).to_world(sample_cosine_hemisphere([u, v]));
    Ray { o: at.origin(d), d, t_max: f32::INFINITY, time: 0.0 }
}

/// The irradiance of surfaces, estimated by traced light samples.
#[derive(Clone, Copy, Debug, Default)]
struct DirectLight {
    /// Light from infinity that arrives.
    sky: f64,
    /// Light of all other lights that arrives.
    lamps: f64,
    /// Number of samples of all other lights, and of those that are occluded.
    samples: u32,
    occluded: u32,
}

impl DirectLight {
    fn at(job: &RenderJob, surfaces: &[SurfaceInteraction]) -> Self {
        // Sample lights at each surface
        let (mut segments, mut found) = (RayBatch::default(), Vec::new());
        for (i, at) in (0..).zip(surfaces) {
            let n = normal(at);
            for k in 0..LIGHT_SAMPLES {
                let [choice, u, v, _] = pcg4d([i, SEED, 1, k]).map(unit_f32);
                let drawn = job.lights.sample(&LightCtx::on(at.surface.p, n), choice, [u, v]);
                let Some(SampleOfLight { light, sample: s }) = drawn else { continue };
                let value = f64::from(s.li.luminance()) * f64::from(s.wi.dot(n).max(0.0)) / f64::from(s.pdf);
                if value > 0.0 && value.is_finite() {
                    segments.push(&Ray { o: at.origin(s.wi), d: s.wi, t_max: s.t * SEGMENT_END, time: 0.0 });
                    found.push((job.world.scene.lights.lights[light as usize].is_infinite(), value));
                }
            }
        }

        // Trace shadow rays
        let (mut occluded, mut light) = (Vec::new(), DirectLight::default());
        job.world.accel.occluded(&segments, Coherence::Incoherent, &mut occluded);
        for (&(is_sky, value), &is_occluded) in found.iter().zip(&occluded) {
            let sum = if is_sky { &mut light.sky } else { &mut light.lamps };
            *sum += if is_occluded { 0.0 } else { value };
            if !is_sky {
                light.samples += 1;
                light.occluded += u32::from(is_occluded);
            }
        }
        light
    }

    /// Fraction of the light from infinity; 0 if there is no light.
    fn sky(&self) -> f64 {
        let all = self.sky + self.lamps;
        if all > 0.0 { self.sky / all } else { 0.0 }
    }

    /// Fraction of the samples of lamps that are occluded; 0 without samples.
    fn hidden(&self) -> f64 {
        f64::from(self.occluded) / f64::from(self.samples.max(1))
    }
}

/// The first hits of rays.
fn hits(job: &RenderJob, rays: &[Ray]) -> Vec<Option<SurfaceInteraction>> {
    let (mut batch, mut hits) = (RayBatch::default(), Vec::new());
    batch.set(rays.iter());
    job.world.accel.intersect(&batch, Coherence::Incoherent, &mut hits);
    let ray_hits = rays.iter().zip(&hits).map(|(ray, hit)| Some(RayHit::of_ray(ray, hit.as_ref()?)));
    ray_hits.map(|ray_hit| Some(SurfaceInteraction::new(job, &ray_hit?))).collect()
}

/// True if the only lobe of a surface is diffuse.
fn is_diffuse(job: &RenderJob, at: &SurfaceInteraction) -> bool {
    at.scatter(job).is_some_and(|bsdf| matches!(bsdf.bsdf, Bsdf::Diffuse(_)))
}

//! Facts of a scene that the [rule](super::rule) chooses by: counts of its lights and of what the camera sees.
//!
//! Some camera rays, light samples where they arrive, and one more ray from each diffuse surface there show how much of the image is
//! diffuse surfaces beside others, and whether these see the sky. Nothing is timed, so the facts of a scene are the same on all
//! machines.

use super::constants::{FACT_RAYS, LIGHT_SAMPLES};
use crate::accel::{Coherence, RayBatch};
use crate::bsdfs::Bsdf;
use crate::integrators::camera_samples::CameraSampler;
use crate::lights::{LightCtx, LightId};
use crate::scene::{RenderJob, SurfaceInteraction};
use lumiris_numbers::math::hash::{pcg4d, unit_f32};
use lumiris_numbers::math::ray::SEGMENT_END;
use lumiris_numbers::math::warp::sample_cosine_hemisphere;
use lumiris_numbers::math::{Frame, Ray, Vec3};
use std::collections::BTreeSet;

/// Seed of the rays.
const SEED: u32 = 0x66_61_63_74;

/// Facts of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Facts {
    /// Lights with power; all triangles of a mesh are one.
    pub lights: usize,
    /// Share of the lights at infinity in the direct light that arrives at the surfaces that the camera sees.
    pub sky: f64,
    /// Fraction of these surfaces that are diffuse, and see another diffuse surface by the cosine.
    pub diffuse_pairs: f64,
    /// Fraction of the rays from diffuse surfaces that leave the scene.
    pub open: f64,
}

impl Facts {
    /// The facts of the scene of a job.
    pub fn of(job: &RenderJob) -> Self {
        let set = &job.world.scene.lights;
        let sources = set.sources();
        let of_mesh = |light: &LightId| sources[*light as usize];
        let meshes: BTreeSet<u32> = set.lit.iter().filter_map(of_mesh).collect();
        let lights = meshes.len() + set.lit.iter().filter(|light| of_mesh(light).is_none()).count();
        let mut facts = Facts { lights, ..Facts::default() };

        let rays: Vec<Ray> = camera_rays(job).collect();
        let seen: Vec<SurfaceInteraction> = hits(job, &rays).into_iter().flatten().collect();
        facts.sky = sky(job, &seen);
        let diffuse: Vec<&SurfaceInteraction> = seen.iter().filter(|at| is_diffuse(job, at)).collect();
        let rays: Vec<Ray> = (0..).zip(&diffuse).map(|(i, at)| cosine_ray(at, i)).collect();
        let (mut pairs, mut left) = (0, 0);
        for at in hits(job, &rays) {
            match at {
                Some(at) if is_diffuse(job, &at) => pairs += 1,
                Some(_) => {}
                None => left += 1,
            }
        }
        facts.diffuse_pairs = f64::from(pairs) / seen.len().max(1) as f64;
        facts.open = f64::from(left) / rays.len().max(1) as f64;
        facts
    }
}

/// Camera rays all over the image.
fn camera_rays(job: &RenderJob) -> impl Iterator<Item = Ray> {
    let bounds = job.world.scene.film.bounds;
    let camera = CameraSampler::new(job, 0);
    (1..=FACT_RAYS).map(move |i| {
        // Points of the R2 sequence [Roberts 2018]
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

/// A ray by the cosine from a surface.
fn cosine_ray(at: &SurfaceInteraction, i: u32) -> Ray {
    let [u, v, ..] = pcg4d([i, SEED, 0, 0]).map(unit_f32);
    let d = Frame::from_z(normal(at)).to_world(sample_cosine_hemisphere([u, v]));
    Ray { o: at.origin(d), d, t_max: f32::INFINITY, time: 0.0 }
}

/// Share of the lights at infinity in the irradiance of surfaces, by light samples that are traced; 0 where there is no light.
fn sky(job: &RenderJob, seen: &[SurfaceInteraction]) -> f64 {
    let (mut segments, mut found) = (RayBatch::default(), Vec::new());
    for (i, at) in (0..).zip(seen) {
        let n = normal(at);
        for k in 0..LIGHT_SAMPLES {
            let [choice, u, v, _] = pcg4d([i, SEED, 1, k]).map(unit_f32);
            let Some((light, s)) = job.lights.sample(&LightCtx::on(at.surface.p, n), choice, [u, v]) else { continue };
            segments.push(&Ray { o: at.origin(s.wi), d: s.wi, t_max: s.t * SEGMENT_END, time: 0.0 });
            let value = f64::from(s.li.luminance()) * f64::from(s.wi.dot(n).max(0.0)) / f64::from(s.pdf);
            found.push((job.world.scene.lights.lights[light as usize].is_infinite(), value));
        }
    }
    let mut occluded = Vec::new();
    job.world.accel.occluded(&segments, Coherence::Incoherent, &mut occluded);
    let sum = |is_counted: fn(bool) -> bool| -> f64 {
        let visible = found
            .iter()
            .zip(&occluded)
            .filter(|((is_sky, v), hidden)| is_counted(*is_sky) && !**hidden && v.is_finite());
        visible.map(|((_, value), _)| value).sum()
    };
    let (of_sky, all) = (sum(|is_sky| is_sky), sum(|_| true));
    if all > 0.0 { of_sky / all } else { 0.0 }
}

/// What rays meet first.
fn hits(job: &RenderJob, rays: &[Ray]) -> Vec<Option<SurfaceInteraction>> {
    let (mut batch, mut hits) = (RayBatch::default(), Vec::new());
    batch.set(rays.iter());
    job.world.accel.intersect(&batch, Coherence::Incoherent, &mut hits);
    let at =
        |(ray, hit): (&Ray, &Option<_>)| hit.as_ref().map(|hit| SurfaceInteraction::new(job, ray, (0.0, 0.0), hit));
    rays.iter().zip(&hits).map(at).collect()
}

/// True if a surface reflects alike to all directions, and does nothing else.
fn is_diffuse(job: &RenderJob, at: &SurfaceInteraction) -> bool {
    at.scatter(job).is_some_and(|bsdf| matches!(bsdf.bsdf, Bsdf::Diffuse(_)))
}

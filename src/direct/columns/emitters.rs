//! Emitters in the directions of BSDF samples.

use super::samples::SampleColumns;
use crate::accel::RayBatch;
use crate::direct::bsdf_samples::{EmitterInDirection, emitter_at};
use crate::direct::point::LightPoint;
use crate::direct::vertices::Vertices;
use crate::lights::LightId;
use crate::lights::sample_columns::LightSamples;
use crate::scene::{EmitterHit, EmitterScratch, RenderJob};
use lumiris_lanes::columns::{padded, select_rows};
use lumiris_numbers::math::Ray;

/// Rays of BSDF samples, traced against emitters only.
#[derive(Debug, Default)]
pub(super) struct EmitterRays {
    /// Rows of their vertices.
    rows: Vec<u32>,
    rays: RayBatch,
    scratch: EmitterScratch,
    emitter_hits: Vec<Option<EmitterHit>>,
    /// The light that each sample hits; `None` for infinite lights or no light.
    pub(super) lights: Vec<Option<LightId>>,
    /// Rows whose rays hit nothing.
    far: Vec<u32>,
}

impl EmitterRays {
    /// Finds the emitters of the BSDF samples of the first `n` vertices. Samples without an emitter get the density 0.
    /// Returns the number of emitter rays.
    pub(super) fn find(
        &mut self,
        job: &RenderJob,
        vertices: &Vertices<'_>,
        n: usize,
        samples: &mut SampleColumns,
    ) -> u64 {
        let len = padded(n);
        let EmitterRays { rows, rays, scratch, emitter_hits, lights, far } = self;
        let (at, time) = (vertices.surface.lit_points(), &vertices.time);
        lights.clear();
        lights.resize(n, None);
        select_rows(n, |i| samples.bsdf.pdf[i] > 0.0, rows);
        far.clear();
        let has_infinite = !job.lights.infinite.is_empty();
        let mut add = |samples: &mut SampleColumns, i: usize, hit: Option<EmitterHit>| {
            let hit = match hit {
                Some(hit) => hit,
                None if has_infinite => return far.push(i as u32),
                None => {
                    samples.bsdf.pdf[i] = 0.0;
                    return;
                }
            };
            lights[i] = hit.light;
            let pmf = |ctx: &_, light| job.lights.sampler.pmf(ctx, light);
            match emitter_at(job, &at.get(i), samples.incident.wi.vec3(i), &hit, time[i], pmf) {
                Some(emitter) => set_emitter(&mut samples.incident, i, &emitter),
                None => samples.bsdf.pdf[i] = 0.0,
            }
        };
        let ray = |samples: &SampleColumns, i: usize| {
            let (o, d) = (samples.o.vec3(i), samples.incident.wi.vec3(i));
            Ray { o, d, t_max: f32::INFINITY, time: time[i] }
        };

        // A few emitters are intersected in lanes, many by the ray tracer
        let (o, d) = (samples.o.get(len), samples.incident.wi.get(len));
        if let Some(hit) = job.world.intersect_few_emitters(o, d, scratch) {
            for i in rows.iter().map(|&i| i as usize) {
                let hit = hit(i, &ray(samples, i));
                add(samples, i, hit);
            }
        } else {
            rays.clear();
            rows.iter().for_each(|&i| rays.push(&ray(samples, i as usize)));
            job.world.intersect_emitters(rays, scratch, emitter_hits);
            rows.iter().zip(&*emitter_hits).for_each(|(&i, hit)| add(samples, i as usize, *hit));
        }

        self.add_infinite(job, vertices, samples);
        self.rows.len() as u64
    }

    /// Sets the infinite lights of the rays that hit nothing.
    fn add_infinite(&self, job: &RenderJob, vertices: &Vertices<'_>, samples: &mut SampleColumns) {
        let (far, at) = (&self.far, vertices.surface.lit_points());
        let SampleColumns { incident: LightSamples { wi, li, pdf, is_far, is_delta, .. }, bsdf, .. } = samples;
        let p_bsdf = &mut bsdf.pdf;
        let directions = wi;
        job.lights.infinite_in_directions(
            far.len(),
            |k| at.get(far[k] as usize),
            |k| directions.vec3(far[k] as usize),
            |k, le, p_light| {
                let i = far[k] as usize;
                p_bsdf[i] = if le.is_black() { 0.0 } else { p_bsdf[i] };
                li.set_rgb(i, le);
                pdf[i] = if is_delta[i] { 0.0 } else { p_light };
                is_far[i] = 1.0;
            },
        );
    }
}

/// Sets the emitter of BSDF sample `i`.
fn set_emitter(samples: &mut LightSamples, i: usize, emitter: &EmitterInDirection) {
    samples.li.set_rgb(i, emitter.li);
    samples.pdf[i] = if samples.is_delta[i] { 0.0 } else { emitter.p_light };
    samples.is_far[i] = if emitter.end.is_some() { 0.0 } else { 1.0 };
    if let Some(LightPoint { p, p_error, n }) = emitter.end {
        samples.p.set(i, p);
        samples.p_error.set(i, p_error);
        samples.n.set(i, n);
    }
}

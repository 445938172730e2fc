//! T2 through media: shadow segments continue through surfaces that only bound a medium, with an estimate of the
//! transmittance per channel.
//!
//! The estimate has the expectation exp(−∫σ_t) and is independent of the sample of the segment. So the expected
//! contribution is the contribution of the sample times T. Densities of directions do not include the transmittance.

use crate::accel::{Coherence, Hit, RayBatch};
use crate::lights::LightId;
use crate::media::{FlightSampler, MediumId, Segment};
use crate::scene::{RayHit, RenderJob, SurfaceInteraction};
use lumiris_numbers::math::ray::SEGMENT_END;
use lumiris_numbers::math::{Ray, Rgb, Vec3};
use lumiris_numbers::samplers::SampleStream;

/// Maximum number of surfaces that a segment passes; after that it counts as occluded.
const MAX_PASSED: u32 = 64;

/// Segments through media.
#[derive(Debug, Default)]
pub(super) struct Crossing {
    all: Vec<Crossed>,
    /// Indices, rays and hits of the unfinished segments.
    active: Vec<u32>,
    rays: RayBatch,
    hits: Vec<Option<Hit>>,
}

/// A segment.
#[derive(Clone, Copy, Debug)]
struct Crossed {
    /// The remaining part.
    ray: Ray,
    /// The end point; `None` for an infinite segment.
    end: Option<Vec3>,
    /// The medium at the end, if the light is an emitting medium.
    medium_of_end: Option<MediumId>,
    /// The current medium.
    medium: Option<MediumId>,
    numbers: FlightSampler,
    /// Estimate of the transmittance.
    transmittance: Rgb,
}

/// The start of a segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Departure {
    /// The light at its end.
    pub(super) light: LightId,
    /// The medium at its start.
    pub(super) medium: Option<MediumId>,
    /// Random numbers, determined by the index of the segment at its point, not in the batch.
    pub(super) stream: SampleStream,
}

impl Crossing {
    /// Starts segments along `rays`. `departure` is called with the index and the direction of each.
    pub(super) fn start(
        &mut self,
        job: &RenderJob,
        rays: &RayBatch,
        mut departure: impl FnMut(usize, Vec3) -> Departure,
    ) {
        self.all.clear();

        // A finite t_max marks a segment to a point on a light
        self.all.extend((0..rays.len()).map(|i| {
            let ray = rays.get(i);
            let Departure { light, medium, stream } = departure(i, ray.d);
            Crossed {
                ray,
                end: ray.t_max.is_finite().then(|| ray.o + ray.d),
                medium_of_end: job.lights.medium_of(light),
                medium,
                numbers: FlightSampler::new(stream),
                transmittance: Rgb::WHITE,
            }
        }));
    }

    /// Transmittance of each segment; black if occluded.
    pub(super) fn transmittance(&self) -> impl Iterator<Item = Rgb> {
        self.all.iter().map(|crossed| crossed.transmittance)
    }

    /// Approximate number of tentative collisions of all segments.
    pub(super) fn collisions(&self) -> u64 {
        self.all.iter().map(|crossed| u64::from(crossed.numbers.drawn)).sum()
    }

    /// Traces all segments. Returns the number of rays.
    pub(super) fn trace(&mut self, job: &RenderJob) -> u64 {
        let mut traced = 0;
        self.active.clear();
        self.active.extend(0..self.all.len() as u32);
        let mut coherence = Coherence::Packets;
        for _ in 0..=MAX_PASSED {
            let Crossing { all, active, rays, hits, .. } = &mut *self;
            if active.is_empty() {
                return traced;
            }

            // Trace the unfinished segments to their next surface
            rays.clear();
            active.iter().for_each(|&i| rays.push(&all[i as usize].ray));
            traced += active.len() as u64;
            job.world.accel.intersect(rays, coherence, hits);
            coherence = Coherence::Incoherent;
            let mut hit = hits.iter();
            active.retain(|&i| all[i as usize].goes_on(job, hit.next().and_then(Option::as_ref)));
        }

        // Too many surfaces: occluded
        for &i in &self.active {
            self.all[i as usize].transmittance = Rgb::BLACK;
        }
        traced
    }
}

impl Crossed {
    /// Advances the segment to the hit of its ray; true if it continues from there.
    fn goes_on(&mut self, job: &RenderJob, hit: Option<&Hit>) -> bool {
        // The surface, if it only bounds a medium; any other surface occludes
        let passed = match hit {
            None => None,
            Some(hit) if !job.may_pass(hit) => {
                self.transmittance = Rgb::BLACK;
                return false;
            }
            Some(hit) => {
                let interaction = SurfaceInteraction::new(job, &RayHit::of_ray(&self.ray, hit));
                if interaction.scatter(job).is_some() {
                    self.transmittance = Rgb::BLACK;
                    return false;
                }
                Some(interaction)
            }
        };

        // Transmittance up to the surface or the end
        if let Some(id) = self.medium {
            let length = self.ray.d.length();
            let d = self.ray.d / length;
            let whole = if self.end.is_some() { length } else { f32::INFINITY };
            let segment = Segment { o: self.ray.o, d, length: passed.map_or(whole, |passed| passed.distance) };
            let medium = &job.world.scene.media.media[id as usize];
            self.transmittance *= medium.transmittance(&segment, &mut self.numbers);
        }

        // Continue beyond the surface
        let Some(interaction) = passed.filter(|_| !self.transmittance.is_black()) else { return self.ends() };
        let d = self.ray.d;
        self.medium = interaction.medium_beyond(job, d, self.medium);
        let o = interaction.origin(d);
        self.ray = match self.end {
            None => Ray { o, ..self.ray },
            Some(end) if (end - o).dot(d) > 0.0 => Ray { o, d: end - o, t_max: SEGMENT_END, ..self.ray },
            Some(_) => return self.ends(),
        };
        true
    }

    /// Ends the segment. An emitting medium fills only a part of its box: outside of it there is no emission.
    fn ends(&mut self) -> bool {
        if self.medium_of_end.is_some() && self.medium != self.medium_of_end {
            self.transmittance = Rgb::BLACK;
        }
        false
    }
}

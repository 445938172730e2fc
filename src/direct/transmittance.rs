//! T2 through media: segments go on through surfaces that only bound a medium, and carry an estimate of how much light
//! passes, per channel.
//!
//! The estimate has the expectation exp(−∫σ_t) and is independent of the sample that the segment belongs to, so the
//! expectation of its contribution is that of the sample times T. Densities of directions do not know of it.

use crate::accel::{Coherence, Hit, RayBatch};
use crate::lights::LightId;
use crate::media::{MediumId, Numbers, Segment};
use crate::scene::{RenderJob, SurfaceInteraction};
use lumiris_numbers::math::ray::SEGMENT_END;
use lumiris_numbers::math::{Ray, Rgb, Vec3};
use lumiris_numbers::samplers::SampleStream;

/// Surfaces that a segment may pass: it counts as occluded behind them.
const MAX_PASSED: u32 = 64;

/// Segments on their way through media.
#[derive(Debug, Default)]
pub(super) struct Crossing {
    all: Vec<Crossed>,
    /// Those that are under way, their rays, and what these meet.
    active: Vec<u32>,
    rays: RayBatch,
    hits: Vec<Option<Hit>>,
}

/// A segment.
#[derive(Clone, Copy, Debug)]
struct Crossed {
    /// What is left of it.
    ray: Ray,
    /// Where it ends; `None` for a direction.
    end: Option<Vec3>,
    /// The medium that has to be there, if it is one that glows.
    medium_of_end: Option<MediumId>,
    /// What it goes through.
    medium: Option<MediumId>,
    numbers: Numbers,
    /// Estimate of what passes.
    transmittance: Rgb,
}

/// How a segment begins.
#[derive(Clone, Copy, Debug)]
pub(super) struct Departure {
    /// The light that it leads to.
    pub(super) light: LightId,
    /// What it goes through.
    pub(super) medium: Option<MediumId>,
    /// Its random numbers. They follow from its place among the segments of the same point, not of the batch.
    pub(super) stream: SampleStream,
}

impl Crossing {
    /// Begins with segments; `departure` has the index and the direction of each.
    pub(super) fn start(
        &mut self,
        job: &RenderJob,
        rays: &RayBatch,
        mut departure: impl FnMut(usize, Vec3) -> Departure,
    ) {
        self.all.clear();
        self.all.extend((0..rays.len()).map(|i| {
            let ray = rays.get(i);
            let Departure { light, medium, stream } = departure(i, ray.d);
            Crossed {
                ray,
                end: ray.t_max.is_finite().then(|| ray.o + ray.d),
                medium_of_end: job.lights.medium_of(light),
                medium,
                numbers: Numbers::new(stream),
                transmittance: Rgb::WHITE,
            }
        }));
    }

    /// What passes of each segment; black where it is occluded.
    pub(super) fn transmittance(&self) -> impl Iterator<Item = Rgb> {
        self.all.iter().map(|crossed| crossed.transmittance)
    }

    /// Tentative collisions of all segments, about.
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
            rays.clear();
            active.iter().for_each(|&i| rays.push(&all[i as usize].ray));
            traced += active.len() as u64;
            job.world.accel.intersect(rays, coherence, hits);
            coherence = Coherence::Incoherent;
            let mut hit = hits.iter();
            active.retain(|&i| all[i as usize].goes_on(job, hit.next().and_then(Option::as_ref)));
        }
        for &i in &self.active {
            self.all[i as usize].transmittance = Rgb::BLACK;
        }
        traced
    }
}

impl Crossed {
    /// Goes as far as what the ray meets; true if it goes on from there.
    fn goes_on(&mut self, job: &RenderJob, hit: Option<&Hit>) -> bool {
        let passed = match hit {
            None => None,
            Some(hit) if !job.may_pass(hit) => {
                self.transmittance = Rgb::BLACK;
                return false;
            }
            Some(hit) => {
                let interaction = SurfaceInteraction::new(job, &self.ray, (0.0, 0.0), hit);
                if interaction.scatter(job).is_some() {
                    self.transmittance = Rgb::BLACK;
                    return false;
                }
                Some(interaction)
            }
        };
        if let Some(id) = self.medium {
            let length = self.ray.d.length();
            let d = self.ray.d / length;
            let whole = if self.end.is_some() { length } else { f32::INFINITY };
            let segment = Segment { o: self.ray.o, d, length: passed.map_or(whole, |passed| passed.distance) };
            let medium = &job.world.scene.media.media[id as usize];
            self.transmittance *= medium.transmittance(&segment, &mut self.numbers);
        }
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

    /// At its end: what glows is seen only where it is, which is not all of its box.
    fn ends(&mut self) -> bool {
        if self.medium_of_end.is_some() && self.medium != self.medium_of_end {
            self.transmittance = Rgb::BLACK;
        }
        false
    }
}

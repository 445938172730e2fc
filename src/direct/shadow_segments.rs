//! T2: shadow segments in the order of their shading points, and their visibility bits.

use super::candidates::Candidates;
use super::domain;
use super::point::ShadingPoint;
use super::transmittance::{Crossing, Departure};
use crate::accel::{Coherence, RayBatch};
use crate::lights::LightId;
use crate::scene::RenderJob;
use lumiris_numbers::math::{Ray, Rgb};

/// True if a candidate with this contribution needs a shadow segment: the contribution is finite and not zero.
#[inline]
fn is_traced(contribution: &Rgb) -> bool {
    !contribution.is_black() && contribution.is_finite()
}

/// Shadow segments with the unshadowed contributions.
#[derive(Debug, Default)]
pub struct Segments {
    rays: RayBatch,
    contributions: Vec<Rgb>,
    points: Vec<u32>,
    lights: Vec<LightId>,
    occluded: Vec<bool>,
    crossing: Crossing,
    /// Number of segments per point so far.
    counts: Vec<u32>,
}

/// A shadow segment with its visibility.
#[derive(Clone, Copy, Debug)]
pub struct SegmentOutcome {
    /// Index of the shading point.
    pub point: u32,
    /// The light at the end.
    pub light: LightId,
    /// Contribution if the segment is free.
    pub unshadowed: Rgb,
    /// True if the segment is unoccluded.
    pub is_free: bool,
}

impl Segments {
    /// Removes all segments.
    pub fn clear(&mut self) {
        self.rays.clear();
        self.contributions.clear();
        self.points.clear();
        self.lights.clear();
    }

    /// Adds a segment from a point to a light, with its unshadowed contribution.
    pub fn push(&mut self, segment: &Ray, point: u32, light: LightId, contribution: Rgb) {
        self.rays.push(segment);
        self.contributions.push(contribution);
        self.points.push(point);
        self.lights.push(light);
    }

    /// Collects the segments of all candidates with a finite, non-zero contribution, in candidate order: the segments
    /// of a shading point and technique, which share their origin, are neighbours.
    pub fn gather(&mut self, candidates: &Candidates) {
        self.clear();
        for (candidate, &contribution) in candidates.records.iter().zip(&candidates.contributions) {
            if is_traced(&contribution) {
                self.push(&candidate.segment, candidate.point, candidate.light, contribution);
            }
        }
    }

    /// The segments.
    pub fn rays(&self) -> &RayBatch {
        &self.rays
    }

    /// Traces all segments, which start at `points`. With media or passable surfaces, contributions are multiplied by
    /// an estimate of the transmittance. Returns the numbers of rays and of tentative collisions.
    pub fn trace(&mut self, job: &RenderJob, points: &[ShadingPoint<'_>]) -> [u64; 2] {
        if job.world.scene.media.is_empty() && !job.shadows_pass() {
            job.world.accel.occluded(&self.rays, Coherence::Packets, &mut self.occluded);
            return [self.rays.len() as u64, 0];
        }

        // Transmittance, with random numbers by the index of the segment at its point
        let Segments { rays, contributions, points: of, lights, occluded, crossing, counts } = self;
        counts.clear();
        counts.resize(points.len(), 0);
        crossing.start(job, rays, |i, d| {
            let (point, count) = (&points[of[i] as usize], &mut counts[of[i] as usize]);
            *count += 1;
            let stream = point.stream.domain(domain::TRANSMITTANCE + *count - 1);
            Departure { light: lights[i], medium: point.medium(d), stream }
        });

        // Visibility and contributions
        let traced = crossing.trace(job);
        occluded.clear();
        occluded.extend(crossing.transmittance().map(Rgb::is_black));
        for (contribution, transmittance) in contributions.iter_mut().zip(crossing.transmittance()) {
            *contribution *= transmittance;
        }
        [traced, crossing.collisions()]
    }

    /// Marks all segments as unoccluded without tracing them.
    pub fn set_free(&mut self) {
        self.occluded.clear();
        self.occluded.resize(self.rays.len(), false);
    }

    /// Occlusion of each segment.
    pub fn occluded(&self) -> &[bool] {
        &self.occluded
    }

    /// For each candidate: true if its segment was traced and is unoccluded.
    pub fn are_free(&self, contributions: &[Rgb]) -> impl Iterator<Item = bool> {
        let mut occluded = self.occluded.iter();
        contributions.iter().map(move |contribution| is_traced(contribution) && occluded.next() == Some(&false))
    }

    /// The segments with their visibility, in the order of [`Self::rays`].
    pub fn outcomes(&self) -> impl Iterator<Item = SegmentOutcome> {
        let segments = self.points.iter().zip(&self.contributions).zip(&self.lights).zip(&self.occluded);
        segments.map(|(((&point, &unshadowed), &light), &occluded)| SegmentOutcome {
            point,
            light,
            unshadowed,
            is_free: !occluded,
        })
    }

    /// Adds the contributions of the unoccluded segments to their points, in order.
    pub fn resolve(&self, out: &mut [Rgb]) {
        for SegmentOutcome { point, unshadowed, .. } in self.outcomes().filter(|outcome| outcome.is_free) {
            out[point as usize] += unshadowed;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_numbers::math::Vec3;

    #[test]
    fn free_segments_add_their_contributions_to_their_points() {
        let mut segments = Segments::default();
        let ray = Ray { o: Vec3::ZERO, d: Vec3::Z, t_max: 1.0, time: 0.0 };
        for (point, value) in [(0, 1.0), (0, 2.0), (2, 4.0)] {
            segments.push(&ray, point, 0, Rgb::splat(value));
        }
        segments.occluded = vec![false, true, false];
        let mut out = [Rgb::BLACK; 3];
        segments.resolve(&mut out);
        assert_eq!(out.map(|l| l.r), [1.0, 0.0, 4.0]);

        // Candidates without a contribution have no segment, and are not free
        let contributions = [0.0, 1.0, f32::NAN, 2.0, 4.0].map(Rgb::splat);
        let are_free: Vec<bool> = segments.are_free(&contributions).collect();
        assert_eq!(are_free, [false, true, false, false, true]);
    }
}

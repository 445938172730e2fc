//! Random walks through the interiors of materials, from the entry point of a path to its exit point.
//!
//! A walk belongs to the segment between two vertices. It scatters by the phase function, and the boundary reflects it
//! inwards, any number of times. None of these events is a vertex: they do not count as bounces, and light is not
//! sampled at them, since the boundary would hide it. Emission inside an interior is hit by chance, with its full
//! weight.
//!
//! At the boundary a walk either stays, by reflection only, or leaves at a vertex that only refracts ([`Bsdf::Exit`]).
//! If the boundary is rough, light is sampled at that vertex. The walk stays with probability F, the reflectance of a
//! smooth boundary, and either case is divided by its probability.
//!
//! In a half-space of albedo 1, a walk has more than n events with a probability ~ n^(−1/2). Russian roulette that
//! continues from event n to n + 1 with probability √(1 − 1/n) balances cost and weight: the means of both grow like
//! log n. Roulette at vertices is in `roulette`.

use super::domain;
use super::path_state::{BsdfTechnique, PathState, TracedPath};
use super::vertex_search::{FlightOutcome, TraceStep, VertexSearch};
use crate::accel::Hit;
use crate::bsdfs::dielectric::{Select, Transport};
use crate::bsdfs::fresnel::fr_dielectric;
use crate::bsdfs::{Bsdf, Dielectric, Phase};
use crate::materials::SurfaceBsdf;
use crate::media::{EmissionLookups, End, Flight, FlightSampler, Medium, Segment, Sides};
use crate::scene::{RenderJob, SurfaceInteraction};
use lumiris_numbers::math::{Rgb, Vec3};

/// Number of events before roulette by throughput.
const FREE_EVENTS: u32 = 8;
/// Number of events before roulette by event count.
const MANY_EVENTS: u32 = 1024;
/// Maximum number of events, reached only by walks that cannot leave.
const MAX_EVENTS: u32 = 1 << 22;
/// Minimum probability of either case at a rough boundary, where F is only an approximation.
const LEAST_CHANCE: f32 = 0.1;

impl VertexSearch {
    /// True if the path is in the interior of a material.
    pub(super) fn walks(&self, job: &RenderJob, path: &PathState) -> bool {
        path.passed < MAX_EVENTS && path.medium.is_some_and(|id| job.world.scene.media.media[id as usize].is_interior())
    }

    /// Samples the free flight of a path through an interior, up to the hit of its ray.
    pub(super) fn walk(
        &mut self,
        at: &TraceStep<'_, '_>,
        medium: &Medium,
        traced: &mut TracedPath<'_>,
        hit: Option<&Hit>,
    ) -> FlightOutcome {
        let TracedPath { state: path, ray, .. } = traced;
        let scale = ray.d.length();
        let (o, d) = (ray.o, ray.d / scale);
        let segment = Segment { o, d, length: hit.map_or(f32::INFINITY, |hit| hit.t * scale) };
        let stream = at.samples.streams.get(path.sample as usize);
        let mut numbers = FlightSampler::new(stream.domain(domain::FLIGHT + at.vertex).domain(path.passed));
        let Flight { end, .. } = medium.fly(&segment, path.beta, &mut numbers, || None, EmissionLookups::UNWEIGHTED);
        let (t, weight) = match end {
            End::Through { weight } => {
                path.beta *= weight;
                return FlightOutcome::Through;
            }
            End::Scattered { t, weight } => (t, weight),
        };
        // After the last vertex, the walk cannot reach another one
        if at.vertex < at.depth
            && path.passed < MAX_EVENTS
            && let Some(scattered) = self.scatter_inside(at, path, weight, medium, d)
        {
            (path.width, path.travelled) = (path.width + path.spread * t, path.travelled + t);
            go_on(traced, o + d * t, scattered);
            self.passing.push(traced.index);
        }
        FlightOutcome::Ended
    }

    /// Scatters a path of direction `d` in an interior, with the throughput factor `weight` of its flight.
    fn scatter_inside(
        &self,
        at: &TraceStep<'_, '_>,
        path: &PathState,
        weight: Rgb,
        medium: &Medium,
        d: Vec3,
    ) -> Option<Scattered> {
        let [u_survival, u0, u1] = self.walk_numbers(at, path);
        let beta = survive_walk(path.beta_beyond_emitter()? * weight, path, u_survival)?;
        let sample = Phase::new(medium.g()).sample(-d, [u0, u1])?;
        Some(Scattered { wi: sample.wi, beta })
    }

    /// The BSDF of a path at a surface; the throughput is divided by the probability of the choice. Returns `None` if
    /// the boundary reflects a path back into its interior; the path is then queued for the next trace.
    pub(super) fn exit_or_reflect<'w>(
        &mut self,
        at: &TraceStep<'_, '_>,
        traced: &mut TracedPath<'_>,
        interaction: &SurfaceInteraction,
        bsdf: SurfaceBsdf<'w>,
        sides: Sides,
    ) -> Option<SurfaceBsdf<'w>> {
        let path = &mut *traced.state;
        let Bsdf::Dielectric(interface) = bsdf.bsdf else { return Some(bsdf) };
        let is_boundary = sides.differ() && sides.towards(interaction.surface.n.dot(interaction.wo)) == path.medium;
        if !is_boundary || !self.walks(at.job, path) {
            return Some(bsdf);
        }

        // Leave: only refraction remains for the vertex
        let wo = bsdf.frame.to_local(interaction.wo);
        let p_stay = chance_to_stay(&interface, wo);
        let [u_stay, u0, u1] = self.walk_numbers(at, path);
        if u_stay >= p_stay {
            path.beta = path.beta / (1.0 - p_stay);
            return Some(SurfaceBsdf { bsdf: Bsdf::Exit(interface), ..bsdf });
        }

        // Stay: reflect the path back into the interior
        let s = interface.sample_select(wo, 0.0, [u0, u1], Transport::Radiance, Select::Reflection)?;
        let beta = path.beta * s.f * (s.wi.z.abs() / (s.pdf * p_stay));
        if beta.is_black() || !beta.is_finite() {
            return None;
        }
        let wi = bsdf.frame.to_world(s.wi);
        path.medium = interaction.medium_beyond(at.job, wi, path.medium);
        (path.width, path.travelled) = (interaction.width, path.depth(interaction));
        go_on(traced, interaction.origin(wi), Scattered { wi, beta });
        self.passing.push(traced.index);
        None
    }

    /// Random numbers of the event at the end of a flight.
    fn walk_numbers(&self, at: &TraceStep<'_, '_>, path: &PathState) -> [f32; 3] {
        let stream = at.samples.streams.get(path.sample as usize);
        stream.domain(domain::WALK + at.vertex).domain(path.passed).draw::<3>()
    }
}

/// A direction after an event of a walk, with the throughput in that direction.
struct Scattered {
    wi: Vec3,
    beta: Rgb,
}

/// Continues a path from `o`. No light is sampled at `o`, so emission that the segment hits has the weight 1.
fn go_on(TracedPath { state: path, ray, .. }: &mut TracedPath<'_>, o: Vec3, Scattered { wi, beta }: Scattered) {
    let technique = BsdfTechnique { row: BsdfTechnique::NO_ROW, pdf: 0.0, survival: 0.0 };
    (path.beta, path.passed, path.technique) = (beta, path.passed + 1, Some(technique));
    (ray.o, ray.d) = (o, wi);
}

/// Probability that the boundary reflects a walk back; `wo` is in the shading frame.
fn chance_to_stay(interface: &Dielectric, wo: Vec3) -> f32 {
    let fresnel = fr_dielectric(wo.z, interface.eta);
    if interface.is_specular() { fresnel } else { fresnel.clamp(LEAST_CHANCE, 1.0 - LEAST_CHANCE) }
}

/// Russian roulette at an event of a walk. Returns the throughput of a path that survives.
fn survive_walk(beta: Rgb, path: &PathState, u: f32) -> Option<Rgb> {
    if beta.is_black() || !beta.is_finite() {
        return None;
    }
    let events = path.passed;
    let by_throughput = if events < FREE_EVENTS { 1.0 } else { (beta * path.eta_scale).map(f32::abs).max_component() };
    let by_number = if events < MANY_EVENTS { 1.0 } else { (1.0 - 1.0 / events as f32).sqrt() };
    let survival = by_throughput.min(1.0) * by_number;
    (u < survival).then(|| beta / survival)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrators::light_paths::Chain;

    #[test]
    fn roulette_of_walks_keeps_the_mean_of_the_throughput() {
        let path = |passed| PathState {
            sample: 0,
            beta: Rgb::WHITE,
            eta_scale: 2.0,
            width: 0.0,
            spread: 0.0,
            passed,
            travelled: 0.0,
            technique: None,
            medium: None,
            wavelength: None,
            is_ghost: false,
            chain: Chain::NONE,
        };
        let mean = |beta: Rgb, passed| {
            let survivors = (0..1000).filter_map(|i| survive_walk(beta, &path(passed), (i as f32 + 0.5) / 1000.0));
            survivors.fold([0.0, 0.0], |[count, sum], survivor| [count + 1.0, sum + survivor.r / 1000.0])
        };

        // No roulette in the first events, then by 2·β, then also by the number of events
        let dim = Rgb::splat(0.1);
        for (passed, share) in
            [(FREE_EVENTS - 1, 1.0), (FREE_EVENTS, 0.2), (MANY_EVENTS, 0.2 * (1.0 - 1.0 / 1024.0_f32).sqrt())]
        {
            let [count, sum] = mean(dim, passed);
            assert!((count / 1000.0 - share).abs() <= 1e-3 && (sum / 0.1 - 1.0).abs() < 0.01, "{passed} {count} {sum}");
        }
        assert_eq!(survive_walk(Rgb::BLACK, &path(0), 0.0), None);
    }
}

//! Walks through the interiors of materials: from the surface where a path enters to that where it leaves.
//!
//! A walk is a part of the way from one vertex to the next. It scatters by the phase function and is reflected inwards by the
//! boundary any number of times; none of this is a vertex, so it neither counts as a bounce nor samples lights, which the
//! boundary would hide anyway. What emits in an interior is found by chance, with its full weight.
//!
//! At the boundary a walk either stays, which only the reflection is responsible for, or leaves at a vertex that only
//! refracts ([`Bsdf::Exit`]), there being light samples where the boundary is rough. The choice has the probability F of a
//! reflection at a smooth boundary, and both ways are divided by theirs.
//!
//! In a half-space of albedo 1, walks have more than n events with a probability ~ n^(−1/2). A roulette that lets them go on
//! from event n to n + 1 with √(1 − 1/n) balances their costs and their weights: the mean of each grows like log n.

use super::segment::{BsdfTechnique, PathState, domain};
use super::vertices::{Flown, Stage, VertexSearch};
use crate::accel::Hit;
use crate::bsdfs::dielectric::{Select, Transport};
use crate::bsdfs::fresnel::fr_dielectric;
use crate::bsdfs::{Bsdf, Dielectric, Phase};
use crate::materials::SurfaceBsdf;
use crate::media::{End, Flight, Glimpse, Medium, Numbers, Segment, Sides};
use crate::scene::{RenderJob, SurfaceInteraction};
use lumiris_numbers::math::{Ray, Rgb, Vec3};

/// Events before roulette by throughput.
const FREE_EVENTS: u32 = 8;
/// Events before roulette by their number.
const MANY_EVENTS: u32 = 1024;
/// Events at most: only walks that cannot leave have so many.
const MAX_EVENTS: u32 = 1 << 22;
/// Least probability of either way at a rough boundary, where F is no more than a guess.
const LEAST_CHANCE: f32 = 0.1;

impl VertexSearch {
    /// True if the path is in an interior.
    pub(super) fn walks(&self, job: &RenderJob, path: &PathState) -> bool {
        path.passed < MAX_EVENTS && path.medium.is_some_and(|id| job.world.scene.media.media[id as usize].is_interior())
    }

    /// Lets a path fly through an interior towards what its ray meets.
    pub(super) fn walk(
        &mut self,
        at: &Stage<'_, '_>,
        medium: &Medium,
        (index, path): (u32, &mut PathState),
        hit: Option<&Hit>,
    ) -> Flown {
        let scale = path.ray.d.length();
        let (o, d) = (path.ray.o, path.ray.d / scale);
        let segment = Segment { o, d, length: hit.map_or(f32::INFINITY, |hit| hit.t * scale) };
        let stream = at.samples[path.sample as usize].stream;
        let mut numbers = Numbers::new(stream.domain(domain::FLIGHT + at.vertex).domain(path.passed));
        let Flight { end, .. } = medium.fly(&segment, path.beta, &mut numbers, || None, (0.0, |_: &Glimpse| 1.0));
        let (t, weight) = match end {
            End::Through { weight } => {
                path.weaken(weight);
                return Flown::Through;
            }
            End::Scattered { t, weight } => (t, weight),
        };
        // There is no vertex beyond the last for it to arrive at
        if at.vertex < at.depth
            && path.passed < MAX_EVENTS
            && let Some(next) = self.scatter_inside(at, path, (d, t, weight), medium)
        {
            *path = next;
            self.passing.push(index);
        }
        Flown::Ended
    }

    /// A path that is scattered in an interior, after the distance `t` in the direction `d` and with the factor `weight`.
    fn scatter_inside(
        &self,
        at: &Stage<'_, '_>,
        path: &PathState,
        (d, t, weight): (Vec3, f32, Rgb),
        medium: &Medium,
    ) -> Option<PathState> {
        let [u_survival, u0, u1] = self.walk_numbers(at, path);
        let beta = survive(path.beta_beyond_emitter()? * weight, path, u_survival)?;
        let sample = Phase::new(medium.g()).sample(-d, [u0, u1])?;
        let next = PathState { width: path.width + path.spread * t, travelled: path.travelled + t, ..*path };
        Some(go_on(next, path.ray.o + d * t, sample.wi, beta))
    }

    /// The BSDF and the throughput of a path at a surface. Where a path in an interior meets the boundary it may be reflected:
    /// then it is kept for the next trace, and the answer is `None`.
    pub(super) fn leave<'w>(
        &mut self,
        at: &Stage<'_, '_>,
        (index, path, beta): (u32, &mut PathState, Rgb),
        interaction: &SurfaceInteraction,
        (bsdf, sides): (SurfaceBsdf<'w>, Sides),
    ) -> Option<(SurfaceBsdf<'w>, Rgb)> {
        let Bsdf::Dielectric(interface) = bsdf.bsdf else { return Some((bsdf, beta)) };
        let is_boundary = sides.differ() && sides.towards(interaction.surface.n.dot(interaction.wo)) == path.medium;
        if !is_boundary || !self.walks(at.job, path) {
            return Some((bsdf, beta));
        }
        let wo = bsdf.frame.to_local(interaction.wo);
        let p_stay = chance_to_stay(&interface, wo);
        let [u_stay, u0, u1] = self.walk_numbers(at, path);
        if u_stay >= p_stay {
            return Some((SurfaceBsdf { bsdf: Bsdf::Exit(interface), ..bsdf }, beta / (1.0 - p_stay)));
        }
        let s = interface.sample_select(wo, 0.0, [u0, u1], Transport::Radiance, Select::Reflection)?;
        let beta = beta * s.f * (s.wi.z.abs() / (s.pdf * p_stay));
        if beta.is_black() || !beta.is_finite() {
            return None;
        }
        let wi = bsdf.frame.to_world(s.wi);
        let next = PathState {
            medium: interaction.medium_beyond(at.job, wi, path.medium),
            width: interaction.width,
            travelled: path.depth(interaction),
            ..*path
        };
        *path = go_on(next, interaction.origin(wi), wi, beta);
        self.passing.push(index);
        None
    }

    /// Random numbers of what happens at the end of a flight.
    fn walk_numbers(&self, at: &Stage<'_, '_>, path: &PathState) -> [f32; 3] {
        let stream = at.samples[path.sample as usize].stream;
        stream.domain(domain::WALK + at.vertex).domain(path.passed).draw::<3>()
    }
}

/// The path from `o` on in the direction `wi`. No light is sampled at `o`, so the segment has the full weight of what it
/// finds.
fn go_on(path: PathState, o: Vec3, wi: Vec3, beta: Rgb) -> PathState {
    let technique = BsdfTechnique { row: BsdfTechnique::NO_ROW, pdf: None, survivor: None };
    let ray = Ray { o, d: wi, ..path.ray };
    PathState { ray, beta, passed: path.passed + 1, technique: Some(technique), ..path }
}

/// Probability that a walk from `wo`, in the shading frame, is reflected by the boundary.
fn chance_to_stay(interface: &Dielectric, wo: Vec3) -> f32 {
    let fresnel = fr_dielectric(wo.z, interface.eta);
    if interface.is_specular() { fresnel } else { fresnel.clamp(LEAST_CHANCE, 1.0 - LEAST_CHANCE) }
}

/// Russian roulette at an event of a walk: the throughput if it goes on.
fn survive(beta: Rgb, path: &PathState, u: f32) -> Option<Rgb> {
    if beta.is_black() || !beta.is_finite() {
        return None;
    }
    let events = path.passed;
    let by_throughput = if events < FREE_EVENTS { 1.0 } else { (beta * path.eta_scale).map(f32::abs).max_component() };
    let by_number = if events < MANY_EVENTS { 1.0 } else { (1.0 - 1.0 / events as f32).sqrt() };
    let survival = by_throughput.min(1.0) * by_number;
    (u < survival).then(|| beta / survival)
}

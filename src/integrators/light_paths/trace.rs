//! Light paths over metal and glass to surfaces visible to the camera, a batch at a time.

use super::chain::{camera_density, light_weight};
use super::guide::{Emitted, LightPathGuide};
use crate::accel::{Coherence, Hit, RayBatch};
use crate::film::filter::FilterSampler;
use crate::integrators::statistics::LightPathStats;
use crate::lights::LightId;
use crate::materials::SurfaceBsdf;
use crate::photons::path_stream::{BATCH, domain, path_stream};
use crate::scene::{RayHit, RenderJob, SurfaceInteraction, SurfaceInteractions};
use lumiris_numbers::math::ray::{SEGMENT_END, offset_origin};
use lumiris_numbers::math::{Ray, Rgb, Vec2, Vec3};
use lumiris_numbers::samplers::SampleStream;
use rayon::prelude::*;
use std::ops::Range;
use std::time::Instant;

/// Random-number domains of a light path after its emission: position on the lens and in the filter, and vertex k at
/// `VERTEX + k`.
const FILM: u32 = 3;
const VERTEX: u32 = 16;

/// The state of a light path.
#[derive(Clone, Copy, Debug)]
struct LightPath {
    ray: Ray,
    power: Rgb,
    stream: SampleStream,
    light: LightId,
    /// Direction at the light, and density of the emission ([`LightPathGuide::density`]).
    d: Vec3,
    density: f32,
}

/// The connection of a light path to the camera, possibly occluded.
#[derive(Clone, Copy, Debug)]
pub(super) struct CameraConnection {
    pub(super) pixel: [u32; 2],
    /// Contribution to a pixel with one camera sample, if there were only one light path. Includes the MIS weight.
    pub(super) value: Rgb,
    /// MIS weight.
    pub(super) weight: f32,
    /// The light, and the direction of the emission.
    pub(super) light: LightId,
    pub(super) d: Vec3,
}

/// A connection and its shadow segment.
struct Connected {
    connection: CameraConnection,
    segment: Ray,
}

/// Traces light paths; holds the buffers of one worker.
#[derive(Debug, Default)]
pub(super) struct LightPathWalker {
    active: Vec<LightPath>,
    next: Vec<LightPath>,
    rays: RayBatch,
    hits: Vec<Option<Hit>>,
    surfaces: SurfaceInteractions,
    pub(super) connections: Vec<CameraConnection>,
    shadows: RayBatch,
    occluded: Vec<bool>,
    /// Rays and segments traced so far.
    pub(super) traced: u64,
}

/// Common data of all light paths.
pub(super) struct TraceInput<'a> {
    pub(super) job: &'a RenderJob,
    pub(super) guide: &'a LightPathGuide,
    pub(super) filter: FilterSampler,
}

impl<'a> TraceInput<'a> {
    pub(super) fn new(job: &'a RenderJob, guide: &'a LightPathGuide) -> Self {
        TraceInput { job, guide, filter: job.world.scene.film.filter.sampler() }
    }
}

impl LightPathWalker {
    /// Traces some of the light paths of a seed. `self.connections` becomes their unoccluded connections to the camera.
    pub(super) fn trace(&mut self, input: &TraceInput<'_>, seed: u32, paths: Range<u64>) {
        let job = input.job;
        self.connections.clear();
        self.shadows.clear();
        self.active.clear();
        self.active.extend(paths.filter_map(|path| emit(input, path_stream(seed, path))));
        // The last scattering event is the connection to the camera. Paths with one more event are left to camera paths
        for scattered in 0..job.settings().integrator.depth().saturating_sub(1) {
            self.rays.set(self.active.iter().map(|path| &path.ray));
            job.world.accel.intersect(&self.rays, Coherence::Incoherent, &mut self.hits);
            self.traced += self.active.len() as u64;
            self.next.clear();
            let LightPathWalker { active, next, hits, surfaces, connections, shadows, .. } = &mut *self;
            surfaces.visit(
                job,
                active,
                |path| &path.ray,
                hits,
                |path, interaction| {
                    let Some(bsdf) = interaction.scatter(job) else { return };
                    if bsdf.makes_caustics {
                        next.extend(path.scattered(interaction, &bsdf, VERTEX + scattered));
                    }
                    // A mixture may be metal for the light and another surface for the camera
                    let may_connect = !bsdf.makes_caustics || interaction.is_mixture(job);
                    if scattered > 0
                        && may_connect
                        && let Some(Connected { connection, segment }) = path.connect(input, interaction)
                    {
                        connections.push(connection);
                        shadows.push(&segment);
                    }
                },
            );
            std::mem::swap(&mut self.active, &mut self.next);
        }

        // Keep unoccluded connections
        job.world.accel.occluded(&self.shadows, Coherence::Packets, &mut self.occluded);
        self.traced += self.connections.len() as u64;
        let mut occluded = self.occluded.iter();
        self.connections.retain(|_| !occluded.next().copied().unwrap_or(true));
    }
}

/// Metal or glass hit by a ray from a light.
#[derive(Clone, Copy, Debug)]
pub(super) struct CausticHit {
    pub(super) light: LightId,
    pub(super) d: Vec3,
    /// Incident power (W) if there were only one path.
    pub(super) value: Rgb,
}

impl LightPathWalker {
    /// Light paths whose first hit is metal or glass.
    pub(super) fn first_hits(&mut self, input: &TraceInput<'_>, seed: u32, paths: Range<u64>) -> Vec<CausticHit> {
        let job = input.job;
        self.active.clear();
        self.active.extend(paths.filter_map(|path| emit(input, path_stream(seed, path))));
        self.rays.set(self.active.iter().map(|path| &path.ray));
        job.world.accel.intersect(&self.rays, Coherence::Incoherent, &mut self.hits);
        let mut found = Vec::new();
        self.surfaces.visit(
            job,
            &self.active,
            |path| &path.ray,
            &self.hits,
            |path, interaction| {
                if interaction.scatter(job).is_some_and(|bsdf| bsdf.makes_caustics) {
                    found.push(CausticHit { light: path.light, d: path.d, value: path.power });
                }
            },
        );
        found
    }
}

/// Samples the emission of a light path.
fn emit(input: &TraceInput<'_>, stream: SampleStream) -> Option<LightPath> {
    let [p0, p1, d0, d1] = stream.domain(domain::EMISSION).draw::<4>();
    let choice = stream.domain(domain::LIGHT).draw::<2>();
    let Emitted { light, p, p_error, n, d, power, density } =
        input.guide.emit(&input.job.world.scene.lights, choice, [[p0, p1], [d0, d1]])?;
    let ray = Ray { o: offset_origin(p, p_error, n, d), d, t_max: f32::INFINITY, time: 0.0 };
    Some(LightPath { ray, power, stream, light, d, density })
}

impl LightPath {
    /// The path after scattering at metal or glass.
    fn scattered(&self, at: &SurfaceInteraction, bsdf: &SurfaceBsdf<'_>, key: u32) -> Option<LightPath> {
        let [uc, u0, u1] = self.stream.domain(key).draw::<3>();
        let s = bsdf.sample(at.wo, uc, [u0, u1])?;
        let power = self.power * s.f * (bsdf.adjoint_cos(at.wo, s.wi, s.eta) / s.pdf);
        let ray = Ray { o: at.origin(s.wi), d: s.wi, ..self.ray };
        (!power.is_black() && power.is_finite()).then_some(LightPath { ray, power, ..*self })
    }

    /// Connects the path at any other surface to the camera.
    fn connect(&self, input: &TraceInput<'_>, at: &SurfaceInteraction) -> Option<Connected> {
        let (job, film) = (input.job, &input.job.world.scene.film);
        let camera = &job.world.scene.camera;

        // Project the point onto the film, and choose a pixel
        let [l0, l1, u] = self.stream.domain(FILM).draw::<3>();
        let p = at.surface.p;
        let projected = camera.project(p, [l0, l1], 0.0)?;
        let CoveringPixel { pixel, weight: filter_weight } = sample_pixel(&input.filter, projected.film_xy, u)?;
        if !film.bounds.contains(pixel) {
            return None;
        }

        // The surface with the footprint of a camera ray
        let from = camera.ray(projected.film_xy, [l0, l1], 0.0);
        let d = p - projected.o;
        let distance = d.length();
        let ray = Ray { o: projected.o, d: d / distance, t_max: f32::INFINITY, time: self.ray.time };
        let at_camera = SurfaceInteraction::new(
            job,
            &RayHit { ray, hit: Hit { t: distance, ..at.hit }, width: from.width0, spread: from.spread },
        );
        let bsdf = at_camera.scatter(job)?;
        if bsdf.makes_caustics || !bsdf.bsdf.is_evaluated_exactly() {
            return None;
        }

        // MIS weight
        let (wo, wi) = (at_camera.wo, at.wo);
        let (cos, cos_light) = (bsdf.n.dot(wo).abs(), bsdf.n.dot(wi).abs());
        let of_camera = camera_density(cos, at_camera.width, bsdf.pdf(wo, wi), cos_light);
        let weight = light_weight(self.density, of_camera);
        if !(weight > 0.0) {
            return None;
        }

        // Contribution
        let measure = cos * projected.density / (distance * distance * cos_light);
        let value = self.power * bsdf.f_cos(wo, wi) * (measure * weight * filter_weight * film.scale);
        if value.is_black() || !value.is_finite() {
            return None;
        }
        let o = offset_origin(p, at.surface.p_error, bsdf.n, wo);
        let segment = Ray { o, d: projected.o - o, t_max: SEGMENT_END, time: self.ray.time };
        let connection = CameraConnection { pixel, value, weight, light: self.light, d: self.d };
        Some(Connected { connection, segment })
    }
}

/// A pixel whose filter covers a film point.
#[derive(Clone, Copy, Debug)]
struct CoveringPixel {
    pixel: [u32; 2],
    /// Filter value over the probability of the pixel.
    weight: f32,
}

/// Samples one of the pixels whose filters cover the film point, in proportion to the magnitude of the filter.
fn sample_pixel(filter: &FilterSampler, film_xy: Vec2, u: f32) -> Option<CoveringPixel> {
    // All pixels with their filter values
    let reach = filter.radius() + 0.5;
    let pixels = |x: f32, reach: f32| (x - reach).floor().max(0.0) as u32..=(x + reach).max(0.0) as u32;
    let all = || {
        let rows = pixels(film_xy.y, reach.y);
        let of_row = move |y| pixels(film_xy.x, reach.x).map(move |x| [x, y]);
        let value = |[x, y]: [u32; 2]| filter.value(film_xy - Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
        rows.flat_map(of_row).map(move |pixel| (pixel, value(pixel))).filter(|(_, value)| *value != 0.0)
    };

    // Choose by the cumulative sum
    let total: f32 = all().map(|(_, value)| value.abs()).sum();
    let (mut left, mut chosen) = (u * total, None);
    for (pixel, value) in all() {
        chosen = Some(CoveringPixel { pixel, weight: total * value.signum() });
        left -= value.abs();
        if left < 0.0 {
            break;
        }
    }
    chosen
}

/// A batch of light paths.
#[derive(Clone, Debug)]
pub(super) struct PathBatch {
    /// Round of a pilot, or step of share groups: determines the seed.
    pub(super) round: u32,
    /// Indices of its paths in the round.
    pub(super) paths: Range<u64>,
}

/// Divides the `paths` light paths of a round into batches.
pub(super) fn batches(round: u32, paths: u64) -> impl Iterator<Item = PathBatch> {
    (0..paths.div_ceil(BATCH)).map(move |i| PathBatch { round, paths: i * BATCH..((i + 1) * BATCH).min(paths) })
}

/// Traces batches of light paths. Returns the connections to the camera, in the order of the
/// batches.
pub(super) fn trace(
    input: &TraceInput<'_>,
    batches: &[PathBatch],
    seed: impl Fn(u32) -> u32 + Sync,
    stats: &mut LightPathStats,
) -> Vec<Vec<CameraConnection>> {
    let one = |walker: &mut LightPathWalker, PathBatch { round, paths }: &PathBatch| {
        let start = Instant::now();
        walker.traced = 0;
        walker.trace(input, seed(*round), paths.clone());
        (walker.connections.clone(), walker.traced, start.elapsed())
    };
    let all: Vec<_> = batches.par_iter().with_max_len(1).map_init(LightPathWalker::default, one).collect();

    // Statistics, in the order of the batches
    stats.paths += batches.iter().map(|batch| batch.paths.end - batch.paths.start).sum::<u64>();
    all.into_iter()
        .map(|(connections, rays, time)| {
            stats.connected += connections.len() as u64;
            stats.rays += rays;
            stats.time += time;
            connections
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::filter::PixelFilter;

    #[test]
    fn pixels_are_drawn_by_their_filters() {
        for filter in [
            PixelFilter::Box { rx: 0.5, ry: 0.5 },
            PixelFilter::Gaussian { rx: 1.5, ry: 1.5, sigma: 0.5 },
            PixelFilter::LanczosSinc { rx: 3.0, ry: 2.0, tau: 3.0 },
        ] {
            // Sums of the values by pixel
            let sampler = filter.sampler();
            let film = Vec2::new(20.37, 11.81);
            let count = 100_000;
            let mut sums = std::collections::BTreeMap::<[u32; 2], f64>::new();
            for i in 0..count {
                let u = (i as f32 + 0.5) / count as f32;
                let CoveringPixel { pixel, weight } = sample_pixel(&sampler, film, u).unwrap();
                *sums.entry(pixel).or_default() += f64::from(weight) / f64::from(count);
            }

            // They equal the filter values
            for y in 5..18 {
                for x in 14..27 {
                    let expected = sampler.value(film - Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
                    let sum = sums.get(&[x, y]).copied().unwrap_or(0.0);
                    assert!((sum - f64::from(expected)).abs() < 1e-3, "{filter:?} {x} {y}: {sum} {expected}");
                }
            }
        }
    }
}

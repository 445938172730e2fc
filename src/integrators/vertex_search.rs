//! Traces paths to their next vertices, and adds the emission on the way.

use super::camera_sample::CameraSamples;
use super::domain;
use super::light_layers::LayerSums;
use super::light_paths::{Chain, LightPathGuide};
use super::path_state::{LastVertices, PathState, Paths, TracedPath};
use super::recording::Recording;
use super::statistics::PathStats;
use crate::accel::{Coherence, Hit, RayBatch};
use crate::direct::Vertices;
use crate::direct::vertices::VertexData;
use crate::film::{FeatureSet, Features, PixelSample};
use crate::geometry::{GeometryId, Shape, SurfaceHit};
use crate::lights::LightCtx;
use crate::materials::SurfaceBsdf;
use crate::materials::dispersion::{WavelengthSample, sample_wavelength};
use crate::media::{EmissionLookup, EmissionLookups, End, Flight, FlightSampler, Segment, Sides};
use crate::scene::{RayHit, RenderJob, SurfaceInteraction, SurfaceInteractions};
use lumiris_lanes::{level, sampler};
use lumiris_numbers::math::{Rgb, Vec3};
use lumiris_numbers::samplers::SampleStream;
use std::sync::Arc;
use std::time::Instant;

/// Maximum number of non-scattering surfaces between two vertices.
const MAX_PASSED: u32 = 64;

/// A batch of paths to be traced to the next vertices.
pub(super) struct TraceStep<'a, 'w> {
    pub(super) job: &'w RenderJob,
    /// Index of the vertices along their paths, and the maximum number of vertices.
    pub(super) vertex: u32,
    pub(super) depth: u32,
    pub(super) samples: &'a CameraSamples,
    /// The last vertices.
    pub(super) left: LastVertices<'a, 'w>,
    /// Receives emission and features.
    pub(super) out: &'a mut [PixelSample],
    /// Receives the vertices.
    pub(super) vertices: &'a mut Vertices<'w>,
}

/// The result of a flight through a medium.
pub(super) enum FlightOutcome {
    /// No collision before the hit of the ray.
    Through,
    /// The path was scattered or absorbed.
    Ended,
    /// The path was scattered. The ghost continues straight on, for the features of the first surface, used by
    /// denoisers.
    Ghost(PathState),
}

/// The active paths of a batch; holds the buffers of one worker.
#[derive(Debug, Default)]
pub(super) struct VertexSearch {
    pub(super) active: Paths,
    /// Indices of the paths that are traced.
    traced: Vec<u32>,
    /// Indices of the paths that continue in the next trace, without a vertex.
    pub(super) passing: Vec<u32>,
    /// Indices of paths of a group that hit surfaces, and these hits.
    reached: Vec<u32>,
    surfaces: SurfaceInteractions,
    /// Indices of the paths that hit nothing, and receive light from infinite lights.
    escaped: Vec<u32>,
    /// Rays of the paths that are traced, if these are not all.
    rays: RayBatch,
    hits: Vec<Option<Hit>>,
    /// Lengths of the directions of these rays.
    lengths: Vec<f32>,
    /// Camera samples of the vertices, in the order of these vertices.
    sampled: Vec<u32>,
    /// Geometry and distance from the camera of first vertices on plain meshes, in the order of these vertices.
    plain: Vec<(GeometryId, f32)>,
    /// Counts and times.
    pub(super) stats: PathStats,
    /// Omits emission towards the camera, and all features except the depth.
    pub(super) only_reflected: bool,
    /// Requested features of first surfaces.
    pub(super) features: FeatureSet,
    /// Sums per light group.
    pub(super) layers: LayerSums,
    /// Guide of the light paths, if light paths contribute.
    pub(super) guide: Option<Arc<LightPathGuide>>,
    /// Copies of the traced rays, if requested.
    pub(super) recording: Option<Recording>,
}

impl VertexSearch {
    /// Starts paths with the camera rays.
    pub(super) fn start(&mut self, job: &RenderJob, samples: &CameraSamples, out: &mut Vec<PixelSample>) {
        out.clear();
        out.resize(samples.len(), PixelSample::default());
        self.layers.begin(samples.len());

        // One path per camera sample
        let Paths { states, rays } = &mut self.active;
        rays.copy_from(&samples.rays);
        states.clear();
        let of_samples = (0..).zip(&samples.weight).zip(&samples.width0).zip(&samples.spread);
        states.extend(of_samples.map(|(((sample, &weight), &width), &spread)| PathState {
            sample,
            beta: Rgb::splat(weight),
            eta_scale: 1.0,
            width,
            spread,
            passed: 0,
            travelled: 0.0,
            technique: None,
            medium: job.world.scene.media.camera,
            wavelength: None,
            is_ghost: false,
            chain: Chain::NONE,
        }));
    }

    /// Traces the active paths to their next vertices, and adds the emission on the way. `at.vertices` receives the
    /// vertices of the paths that reach a scattering surface or scatter in a medium.
    pub(super) fn find(&mut self, mut at: TraceStep<'_, '_>) {
        let mut is_first = true;
        self.plain.clear();
        self.traced.clear();
        self.traced.extend(0..self.active.len() as u32);
        while !self.traced.is_empty() {
            // Trace, and process each hit
            self.trace(at.job, at.vertex, is_first);
            is_first = false;
            let start = Instant::now();
            let (mut paths, hits, traced): (Paths, _, _) =
                (std::mem::take(&mut self.active), std::mem::take(&mut self.hits), std::mem::take(&mut self.traced));
            let lengths = std::mem::take(&mut self.lengths);
            for first in (0..traced.len()).step_by(SurfaceInteractions::GROUP) {
                for i in first..traced.len().min(first + SurfaceInteractions::GROUP) {
                    let (index, hit, length) = (traced[i], hits[i], lengths[i]);
                    let is_done =
                        hit.is_some_and(|hit| self.add_plain_mesh_hit(&mut at, &mut paths, index, &hit, length));
                    if !is_done {
                        self.process_hit(&mut at, &mut paths, index, hit.as_ref());
                    }
                }
                self.process_surfaces(&mut at, &mut paths);
            }
            (self.active, self.hits, self.traced, self.lengths) = (paths, hits, traced, lengths);

            // Trace the paths again that passed a surface
            self.add_infinite(&mut at);
            std::mem::swap(&mut self.traced, &mut self.passing);
            self.passing.clear();
            self.escaped.clear();
            self.stats.shade_time += start.elapsed();
        }

        let start = Instant::now();
        at.vertices.finish(&at.job.lights);
        self.set_numbers(&mut at);
        if at.vertex == 0 && self.features != FeatureSet::None {
            self.set_plain_features(&mut at);
        }
        self.stats.shade_time += start.elapsed();
    }

    /// Processes a traced path: flight through its medium, and the surface that it reaches, which is left to
    /// [`Self::process_surfaces`].
    fn process_hit(&mut self, at: &mut TraceStep<'_, '_>, paths: &mut Paths, index: u32, hit: Option<&Hit>) {
        let mut index = index;

        // Medium
        if paths.states[index as usize].medium.is_some() {
            let mut traced = paths.traced(index);
            let (outcome, ray) = (self.sample_flight(at, &mut traced, hit), traced.ray);
            match outcome {
                FlightOutcome::Through => {}
                FlightOutcome::Ended => return paths.rays.replace(index as usize, &ray),
                FlightOutcome::Ghost(ghost) => {
                    index = paths.len() as u32;
                    paths.push(ghost, &ray);
                }
            }
        }

        // Surface or environment
        match hit {
            Some(hit) => {
                let TracedPath { state: path, ray, .. } = paths.traced(index);
                self.reached.push(index);
                self.surfaces.push(RayHit { ray, hit: *hit, width: path.width, spread: path.spread });
            }
            None if self.adds_emission(at.vertex, &paths.states[index as usize]) => self.escaped.push(index),
            None => {}
        }
    }

    /// Processes the surfaces that paths have reached: emission, and vertex or continuation.
    fn process_surfaces(&mut self, at: &mut TraceStep<'_, '_>, paths: &mut Paths) {
        let (mut reached, mut surfaces) = (std::mem::take(&mut self.reached), std::mem::take(&mut self.surfaces));
        for (&index, interaction) in reached.iter().zip(surfaces.find(at.job)) {
            let mut traced = paths.traced(index);
            self.process_surface(at, &mut traced, interaction);
            let ray = traced.ray;
            paths.rays.replace(index as usize, &ray);
        }
        reached.clear();
        (self.reached, self.surfaces) = (reached, surfaces);
    }

    /// Sets times and random numbers of the vertices.
    fn set_numbers(&mut self, at: &mut TraceStep<'_, '_>) {
        let Vertices { path, time, streams, direct, .. } = &mut *at.vertices;
        let VertexSearch { active: Paths { states, rays }, sampled, .. } = self;
        sampled.clear();
        sampled.extend(path.iter().map(|&path| states[path as usize].sample));
        time.extend(path.iter().map(|&path| rays.time[path as usize]));

        // Streams of the vertices, and below them the streams of direct light
        let key = domain::VERTEX + at.vertex;
        streams.gather(&at.samples.streams, sampled);
        sampler::enter(level(), streams, key);
        if at.samples.direct.is_empty() {
            direct.copy_from(streams);
        } else {
            direct.gather(&at.samples.direct, sampled);
            sampler::enter(level(), direct, key);
        }
        sampler::enter(level(), direct, domain::DIRECT);
    }

    /// Sets the features of first vertices on plain meshes.
    fn set_plain_features(&self, at: &mut TraceStep<'_, '_>) {
        let Vertices { path, surface, .. } = &*at.vertices;
        for (row, &(object, depth)) in at.vertices.plain_rows().zip(&self.plain) {
            let (z, wo) = (surface.ns.vec3(row), surface.wo.vec3(row));
            at.out[self.active.states[path[row] as usize].sample as usize].features = Some(Features {
                albedo: surface.rho.rgb(row),
                normal: if z.dot(wo) < 0.0 { -z } else { z },
                depth,
                material: at.job.world.scene.surfaces[object as usize].material,
                object,
            });
        }
    }

    #[inline]
    fn adds_emission(&self, vertex: u32, path: &PathState) -> bool {
        !path.is_ghost && (path.technique.is_some() || vertex == 0 && !self.only_reflected)
    }

    /// Handles the hit of a mesh with a constant Lambertian reflectance, whose points are computed together with
    /// others. `length` is the length of the ray's direction. Returns false for all other hits.
    #[inline(always)]
    fn add_plain_mesh_hit(
        &mut self,
        at: &mut TraceStep<'_, '_>,
        paths: &mut Paths,
        index: u32,
        hit: &Hit,
        length: f32,
    ) -> bool {
        let is_last = at.vertex >= at.depth;
        let Some(rho) = at.job.plain_reflectance(hit) else { return false };
        let path = &mut paths.states[index as usize];
        if path.medium.is_some() || path.is_ghost || is_last && at.vertex == 0 {
            return false;
        }

        // Add the vertex
        let Some(beta) = path.beta_beyond_emitter().filter(|_| !is_last) else { return true };
        let Shape::Mesh(mesh) = &at.job.world.scene.geometry.geometries[hit.geometry as usize].shape else {
            return false;
        };
        let d = paths.rays.direction(index as usize);
        let distance = hit.t * length;
        if at.vertex == 0 {
            self.plain.push((hit.geometry, path.travelled + distance));
        }
        (path.beta, path.width) = (beta, path.width + path.spread * distance);

        // Density of light paths
        path.chain = if self.begins_chain(at.vertex, path) {
            Chain::at_first(facing_normal(at.job, hit, d).dot(d), path.width)
        } else {
            Chain::NONE
        };
        at.vertices.push_plain_mesh(index, mesh, hit.primitive, hit.uv, d, rho);
        true
    }

    /// Handles any other hit, and adds its vertex if the path continues.
    #[inline]
    fn process_surface(
        &mut self,
        at: &mut TraceStep<'_, '_>,
        traced: &mut TracedPath<'_>,
        interaction: &SurfaceInteraction,
    ) {
        let TracedPath { index, state: path, ray } = traced;
        let out = &mut at.out[path.sample as usize];

        // Emission
        if self.adds_emission(at.vertex, path) {
            let emission = path.emission(ray, at.job, &at.left, interaction, self.guide.as_deref());
            out.radiance += emission;
            self.layers.add_emission(at.job, path.sample, &interaction.hit, emission);
        }

        // Surfaces without scattering
        let Some(mut beta) = path.beta_beyond_emitter() else { return };
        let Some(mut bsdf) = interaction.scatter(at.job) else {
            if path.passed < MAX_PASSED || self.walks(at.job, path) {
                path.pass(ray, at.job, beta, interaction);
                self.passing.push(*index);
            }
            return;
        };

        // Features of the first surface
        if at.vertex == 0 && self.features != FeatureSet::None {
            out.features.get_or_insert_with(|| {
                if self.only_reflected {
                    Features { depth: path.depth(interaction), ..Features::default() }
                } else {
                    let stream = at.samples.streams.get(path.sample as usize).domain(domain::VERTEX);
                    path.features(at.job, interaction, &bsdf, self.features, &stream)
                }
            });
        }
        if at.vertex >= at.depth || path.is_ghost {
            return;
        }

        // Dispersion
        if let Some(eta) = bsdf.bsdf.eta_mut()
            && let Some(dispersion) = interaction.dispersion(at.job)
        {
            let WavelengthSample { lambda, weight } = self.wavelength(at, path);
            (*eta, path.wavelength, beta) = (dispersion.eta(lambda), Some(lambda), beta * weight);
        }

        // The vertex, unless the path stays in an interior
        let media = interaction.sides(at.job, path.medium);
        path.beta = beta;
        let Some(bsdf) = self.exit_or_reflect(at, traced, interaction, bsdf, media) else { return };
        let TracedPath { index, state: path, .. } = traced;
        let SurfaceInteraction { surface, wo, width, .. } = *interaction;
        path.chain = self.chain(at, path, interaction, &bsdf);
        path.width = width;
        at.vertices.push(VertexData { path: *index, p: surface.p, p_error: surface.p_error, wo, bsdf, media });
    }

    /// True if light paths may reach the vertex.
    #[inline]
    fn begins_chain(&self, vertex: u32, path: &PathState) -> bool {
        self.guide.is_some() && vertex == 0 && path.passed == 0
    }

    /// The part of the path that light paths can sample as well, at a vertex with this BSDF.
    fn chain(
        &self,
        at: &TraceStep<'_, '_>,
        path: &PathState,
        met: &SurfaceInteraction,
        bsdf: &SurfaceBsdf<'_>,
    ) -> Chain {
        if self.guide.is_none() || path.passed > 0 {
            return Chain::NONE;
        }
        // The emitter must be hit by the next segment, and the last vertex has none
        match (bsdf.makes_caustics, path.chain.is_open()) {
            (true, true) if at.vertex + 1 < at.depth => path.chain.bundled(),
            (false, _) if at.vertex == 0 && bsdf.bsdf.is_evaluated_exactly() => {
                Chain::at_first(bsdf.n.dot(met.wo), met.width)
            }
            _ => Chain::NONE,
        }
    }

    /// The wavelength of a path, and the throughput factor of its sampling.
    fn wavelength(&self, at: &TraceStep<'_, '_>, path: &PathState) -> WavelengthSample {
        path.wavelength.map_or_else(
            || {
                let stream = at.samples.streams.get(path.sample as usize);
                sample_wavelength(stream.domain(domain::WAVELENGTH).draw::<1>()[0])
            },
            |lambda| WavelengthSample { lambda, weight: Rgb::WHITE },
        )
    }

    /// Samples the free flight of a path through its medium, and adds the emission of the medium.
    fn sample_flight(
        &mut self,
        at: &mut TraceStep<'_, '_>,
        traced: &mut TracedPath<'_>,
        hit: Option<&Hit>,
    ) -> FlightOutcome {
        let TracedPath { index, state: path, ray } = &mut *traced;
        let Some(id) = path.medium.filter(|_| !path.is_ghost) else { return FlightOutcome::Through };
        let medium = &at.job.world.scene.media.media[id as usize];
        if medium.is_interior() {
            return self.walk(at, medium, traced, hit);
        }

        // Segment and random numbers
        let scale = ray.d.length();
        let (o, d) = (ray.o, ray.d / scale);
        let segment = Segment { o, d, length: hit.map_or(f32::INFINITY, |hit| hit.t * scale) };
        let stream = at.samples.streams.get(path.sample as usize);
        let mut numbers = FlightSampler::new(stream.domain(domain::FLIGHT + at.vertex).domain(path.passed));
        // Emission lookups with their MIS weight. Where light is sampled as well, no minimum rate of lookups is needed
        let technique = path.technique.filter(|technique| technique.pdf > 0.0);
        let min_rate = if technique.is_none() { at.job.lights.emission_lookup_rate(id) } else { 0.0 };
        let weight = |lookup: &EmissionLookup| {
            let p = o + d * lookup.t;
            at.left.weight(path, ray, |ctx| at.job.lights.pdf_volume(ctx, id, lookup, p))
        };
        let focus = || focus(at.job, &segment, &stream, at.vertex);
        let flight = medium.fly(&segment, path.beta, &mut numbers, focus, EmissionLookups { min_rate, weight });
        self.stats.collisions += u64::from(numbers.drawn);

        // Add the emission, and make the vertex
        let Flight { emitted, end } = flight;
        at.out[path.sample as usize].radiance += path.beta * emitted;
        match end {
            End::Through { weight } => {
                path.beta *= weight;
                FlightOutcome::Through
            }
            End::Scattered { t, weight } => {
                let ghost = PathState { is_ghost: true, ..**path };
                if let Some(beta) = path.beta_beyond_emitter().filter(|_| at.vertex < at.depth) {
                    (path.beta, path.width) = (beta * weight, path.width + path.spread * t);
                    path.chain = Chain::NONE;
                    let SurfaceHit { p, p_error, .. } = SurfaceHit::in_space(o + d * t);
                    let bsdf = SurfaceBsdf::in_medium(medium.g(), -d);
                    let media = Sides::both(path.medium);
                    at.vertices.push(VertexData { path: *index, p, p_error, wo: bsdf.frame.z, bsdf, media });
                }
                let wants_features = at.vertex == 0 && self.features != FeatureSet::None;
                if wants_features { FlightOutcome::Ghost(ghost) } else { FlightOutcome::Ended }
            }
        }
    }

    /// Adds the radiance of infinite lights along the escaped paths, with the weights of the techniques that drew them.
    fn add_infinite(&mut self, at: &mut TraceStep<'_, '_>) {
        let (lights, layers, left, out) = (&at.job.lights, &mut self.layers, &at.left, &mut *at.out);
        let (Paths { states, rays }, escaped) = (&self.active, &self.escaped);
        let path = |i: usize| &states[escaped[i] as usize];
        let ray = |i: usize| rays.get(escaped[i] as usize);
        lights.infinite_in_directions_by(
            escaped.len(),
            |i| left.ctx(path(i), &ray(i)),
            |i| ray(i).d,
            // No light was sampled at the camera
            |i, ctx, light| if path(i).technique.is_some() { lights.sampler.pmf(ctx, light) } else { 0.0 },
            |i, le, p_light| {
                let (path, ray) = (path(i), ray(i));
                let l = path.beta * le;
                let weight = if l.is_black() { 1.0 } else { left.weight(path, &ray, |_| p_light) };
                out[path.sample as usize].radiance += l * weight;
                if layers.are_kept() {
                    layers.add_infinite(lights, path.sample, left.ctx(path, &ray).p, ray.d, l * weight);
                }
            },
        );
    }

    /// Traces the first hits of the paths: of all of them the first time, later of those that passed a surface.
    fn trace(&mut self, job: &RenderJob, vertex: u32, is_first: bool) {
        let coherence = if is_first && vertex == 0 { Coherence::Coherent } else { Coherence::Incoherent };
        let rays = if is_first {
            &self.active.rays
        } else {
            self.rays.gather(&self.active.rays, &self.traced);
            &self.rays
        };

        // Copy for measurements, if requested
        if let Some(r) = &mut self.recording {
            let batches = if coherence == Coherence::Coherent { &mut r.camera } else { &mut r.bounces };
            batches.push(rays.clone());
        }

        // Trace
        let start = Instant::now();
        job.world.accel.intersect(rays, coherence, &mut self.hits);
        let (count, time) = (rays.len() as u64, start.elapsed());
        rays.lengths(&mut self.lengths);
        if vertex == 0 {
            self.stats.camera_rays += count;
            self.stats.camera_time += time;
        } else {
            self.stats.bounce_rays += count;
            self.stats.bounce_time += time;
        }
    }
}

/// The centre of a light that the light sampler chooses for a point of the segment; `None` if the light is infinite.
/// The choice of the point only affects the noise. It is at most the scene radius away, since most light is expected
/// near the origin.
fn focus(job: &RenderJob, segment: &Segment, stream: &SampleStream, vertex: u32) -> Option<Vec3> {
    let lights = &job.lights;
    if lights.infinite.len() == lights.lit.len() {
        return None;
    }
    let u = stream.domain(domain::FLIGHT + vertex).draw_random(domain::FOCUS);
    let p = segment.o + segment.d * (0.5 * segment.length.min(lights.scene_radius));
    let chosen = lights.sampler.sample(&LightCtx::at(p), u)?;
    lights.lights[chosen.light as usize].bounds().map(|bounds| bounds.bounds.center())
}

/// The geometric normal at a hit of a mesh in world space, on the side from which a ray of direction `d` comes.
fn facing_normal(job: &RenderJob, hit: &Hit, d: Vec3) -> Vec3 {
    let Shape::Mesh(mesh) = &job.world.scene.geometry.geometries[hit.geometry as usize].shape else { return -d };
    let [a, b, c] = mesh.triangle(hit.primitive as usize);
    let n = (b - a).cross(c - a).normalize_or(-d);
    if n.dot(d) > 0.0 { -n } else { n }
}

//! From rays to vertices: paths are traced to the next surface that scatters, and carry what they see of emitters on the
//! way.

use super::light_layers::LayerSums;
use super::light_paths::{Chain, Guide};
use super::segment::{CameraSample, LastVertices, PathState, PathStats, domain};
use crate::accel::{Coherence, Hit, RayBatch};
use crate::direct::Vertices;
use crate::direct::vertices::{Single, VertexHeader};
use crate::film::{FeatureSet, Features, PixelSample};
use crate::geometry::{Shape, SurfaceHit};
use crate::lights::LightCtx;
use crate::materials::SurfaceBsdf;
use crate::materials::dispersion::sample_wavelength;
use crate::media::{End, Flight, Glimpse, Numbers, Segment, Sides};
use crate::scene::{RenderJob, SurfaceInteraction};
use lumiris_numbers::math::{Rgb, Vec3};
use lumiris_numbers::samplers::{Domain, SampleStream};
use std::sync::Arc;
use std::time::Instant;

/// Surfaces without scattering that a path may pass between two vertices.
const MAX_PASSED: u32 = 64;

/// Copies of the rays traced, batch by batch, for measurements.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    /// Camera rays up to their first surface.
    pub camera: Vec<RayBatch>,
    /// All other path segments.
    pub bounces: Vec<RayBatch>,
    /// Shadow segments of first vertices.
    pub segments: Vec<RayBatch>,
    /// Shadow segments of later vertices.
    pub bounce_segments: Vec<RayBatch>,
}

impl Recording {
    /// The shadow segments of a vertex, counted from 0.
    pub(super) fn segments_at(&mut self, vertex: u32) -> &mut Vec<RayBatch> {
        if vertex == 0 { &mut self.segments } else { &mut self.bounce_segments }
    }
}

/// A batch of paths whose next vertices are found.
pub(super) struct Stage<'a, 'w> {
    pub(super) job: &'w RenderJob,
    /// Index of the vertices along their paths, and the maximum number of these.
    pub(super) vertex: u32,
    pub(super) depth: u32,
    pub(super) samples: &'a [CameraSample],
    /// What the paths come from.
    pub(super) left: LastVertices<'a, 'w>,
    /// Takes what the paths see.
    pub(super) out: &'a mut [PixelSample],
    /// Takes the vertices.
    pub(super) vertices: &'a mut Vertices<'w>,
}

impl Stage<'_, '_> {
    /// The header of the vertex of a path, which gets the given index.
    #[inline]
    fn header(&self, path: &PathState, index: usize, numbers: &mut VertexNumbers) -> VertexHeader {
        let sample = &self.samples[path.sample as usize];
        VertexHeader { path: index as u32, time: path.ray.time, streams: numbers.of(sample) }
    }
}

/// The random numbers of vertices, and of their direct light.
#[derive(Debug)]
struct VertexNumbers([Domain; 3]);

impl Default for VertexNumbers {
    fn default() -> Self {
        VertexNumbers::new(0)
    }
}

impl VertexNumbers {
    fn new(vertex: u32) -> Self {
        let key = domain::VERTEX + vertex;
        VertexNumbers([Domain::new(key), Domain::new(key), Domain::new(domain::DIRECT)])
    }

    #[inline]
    fn of(&mut self, sample: &CameraSample) -> [SampleStream; 2] {
        let VertexNumbers([of_vertex, outer, inner]) = self;
        [of_vertex.of(&sample.stream), inner.of(&outer.of(&sample.direct))]
    }
}

/// Paths on their way to the next vertex.
#[derive(Debug, Default)]
pub(super) struct VertexSearch {
    pub(super) active: Vec<PathState>,
    kept: Vec<PathState>,
    pub(super) passing: Vec<PathState>,
    /// Indices of active paths that meet nothing and look for emitters.
    escaped: Vec<u32>,
    rays: RayBatch,
    hits: Vec<Option<Hit>>,
    numbers: VertexNumbers,
    /// Counts and times.
    pub(super) stats: PathStats,
    /// Omits emission towards the camera, and all features except the depth.
    pub(super) only_reflected: bool,
    /// The features of first surfaces that are determined.
    pub(super) features: FeatureSet,
    /// What is of each light group.
    pub(super) layers: LayerSums,
    /// Of the light paths that bring a part of the light, if any do.
    pub(super) guide: Option<Arc<Guide>>,
    /// Copies of what is traced, if requested.
    pub(super) recording: Option<Recording>,
}

impl VertexSearch {
    /// Starts paths with the camera rays.
    pub(super) fn start(&mut self, job: &RenderJob, samples: &[CameraSample], out: &mut Vec<PixelSample>) {
        out.clear();
        out.resize(samples.len(), PixelSample::default());
        self.layers.begin(samples.len());
        self.active.clear();
        self.active.extend(samples.iter().enumerate().map(|(i, s)| PathState {
            sample: i as u32,
            ray: s.ray.ray,
            beta: Rgb::splat(s.weight),
            eta_scale: 1.0,
            width: s.ray.width0,
            spread: s.ray.spread,
            passed: 0,
            travelled: 0.0,
            technique: None,
            medium: job.world.scene.media.camera,
            wavelength: None,
            is_ghost: false,
            chain: Chain::NONE,
        }));
    }

    /// Traces the active paths to their next vertex, adds what they see at the first one, and keeps those that hit
    /// something that scatters: `at.vertices` belong to the paths that `self.active` then holds.
    pub(super) fn find(&mut self, mut at: Stage<'_, '_>) {
        self.kept.clear();
        self.numbers = VertexNumbers::new(at.vertex);
        let mut coherence = if at.vertex == 0 { Coherence::Coherent } else { Coherence::Incoherent };
        while !self.active.is_empty() {
            self.trace(at.job, at.vertex, coherence);
            coherence = Coherence::Incoherent;
            let start = Instant::now();
            self.passing.clear();
            self.escaped.clear();
            let (mut active, hits) = (std::mem::take(&mut self.active), std::mem::take(&mut self.hits));
            for (k, (path, hit)) in active.iter_mut().zip(&hits).enumerate() {
                if path.medium.is_some() && self.fly(&mut at, path, hit.as_ref()) {
                    continue;
                }
                match hit {
                    Some(hit) if self.take_plain(&mut at, path, hit) => {}
                    Some(hit) => self.take(&mut at, path, hit),
                    None if self.looks_for_emitters(at.vertex, path) => self.escaped.push(k as u32),
                    None => {}
                }
            }
            (self.active, self.hits) = (active, hits);
            self.add_infinite(&mut at);
            std::mem::swap(&mut self.active, &mut self.passing);
            self.stats.shade_time += start.elapsed();
        }
        let start = Instant::now();
        std::mem::swap(&mut self.active, &mut self.kept);
        at.vertices.finish(&at.job.lights);
        if at.vertex == 0 {
            self.set_normals(&mut at);
        }
        self.stats.shade_time += start.elapsed();
    }

    /// The shading normals at plain vertices as features of their camera samples.
    fn set_normals(&self, at: &mut Stage<'_, '_>) {
        let Vertices { path, surface, .. } = &*at.vertices;
        for i in at.vertices.plain() {
            if let Some(features) = &mut at.out[self.active[path[i] as usize].sample as usize].features {
                let (z, wo) = (surface.ns.vec3(i), surface.wo.vec3(i));
                features.normal = if z.dot(wo) < 0.0 { -z } else { z };
            }
        }
    }

    #[inline]
    fn looks_for_emitters(&self, vertex: u32, path: &PathState) -> bool {
        !path.is_ghost && (path.technique.is_some() || vertex == 0 && !self.only_reflected)
    }

    /// Takes a hit of a mesh that reflects the same everywhere, whose point is found together with others; false if
    /// this is none.
    #[inline]
    fn take_plain(&mut self, at: &mut Stage<'_, '_>, path: &PathState, hit: &Hit) -> bool {
        let is_last = at.vertex >= at.depth;
        let Some(rho) = at.job.plain_reflectance(hit) else { return false };
        if path.medium.is_some() || path.is_ghost || is_last && at.vertex == 0 {
            return false;
        }
        let Some(beta) = path.beta_beyond_emitter().filter(|_| !is_last) else { return true };
        let distance = hit.t * path.ray.d.length();
        if at.vertex == 0 && self.features != FeatureSet::None {
            let features = &mut at.out[path.sample as usize].features;
            features.get_or_insert_with(|| path.plain_features(at.job, hit, distance, rho));
        }
        let Shape::Mesh(mesh) = &at.job.world.scene.geometry.geometries[hit.geometry as usize].shape else {
            return false;
        };
        let (d, width) = (path.ray.d, path.width + path.spread * distance);
        let chain = if self.begins_chain(at.vertex, path) {
            Chain::at_first(facing_normal(at.job, hit, d).dot(d), width)
        } else {
            Chain::NONE
        };
        at.vertices.push_plain(
            at.header(path, self.kept.len(), &mut self.numbers),
            (mesh, hit.primitive, hit.uv),
            d,
            rho,
        );
        self.kept.push(PathState { beta, width, chain, ..*path });
        true
    }

    /// Takes any other hit, and adds its vertex, if the path goes on from one.
    #[inline]
    fn take(&mut self, at: &mut Stage<'_, '_>, path: &PathState, hit: &Hit) {
        let interaction = SurfaceInteraction::new(at.job, &path.ray, (path.width, path.spread), hit);
        let (sample, out) = (&at.samples[path.sample as usize], &mut at.out[path.sample as usize]);
        if self.looks_for_emitters(at.vertex, path) {
            let emission = path.emission(at.job, &at.left, &interaction, self.guide.as_deref());
            out.radiance += emission;
            self.layers.add_emission(at.job, path.sample, &interaction.hit, emission);
        }
        let Some(beta) = path.beta_beyond_emitter() else { return };
        let Some(bsdf) = interaction.scatter(at.job) else {
            if path.passed < MAX_PASSED || self.walks(at.job, path) {
                self.passing.push(path.pass(at.job, beta, &interaction));
            }
            return;
        };
        if at.vertex == 0 && self.features != FeatureSet::None {
            out.features.get_or_insert_with(|| {
                if self.only_reflected {
                    Features { depth: path.depth(&interaction), ..Features::default() }
                } else {
                    let stream = sample.stream.domain(domain::VERTEX);
                    path.features(at.job, &interaction, &bsdf, (self.features, &stream))
                }
            });
        }
        let width = interaction.width;
        if at.vertex >= at.depth || path.is_ghost {
            return;
        }
        let (mut path, mut bsdf, mut beta) = (*path, bsdf, beta);
        if let Some(eta) = bsdf.bsdf.eta_mut()
            && let Some(dispersion) = interaction.dispersion(at.job)
        {
            let (lambda, weight) = self.wavelength(at, &path);
            (*eta, path.wavelength, beta) = (dispersion.eta(lambda), Some(lambda), beta * weight);
        }
        let path = &path;
        let media = interaction.sides(at.job, path.medium);
        let Some((bsdf, beta)) = self.leave(at, (path, beta), &interaction, (bsdf, media)) else { return };
        let chain = self.chain(at, path, &interaction, &bsdf);
        let SurfaceInteraction { surface, wo, .. } = interaction;
        self.keep(at, PathState { beta, width, chain, ..*path }, (surface, wo), (bsdf, media));
    }

    /// Keeps a path at a vertex.
    #[inline]
    fn keep<'w>(
        &mut self,
        at: &mut Stage<'_, 'w>,
        path: PathState,
        (surface, wo): (SurfaceHit, Vec3),
        (bsdf, media): (SurfaceBsdf<'w>, Sides),
    ) {
        let header = at.header(&path, self.kept.len(), &mut self.numbers);
        at.vertices.push(Single { header, p: surface.p, p_error: surface.p_error, wo, bsdf, media });
        self.kept.push(path);
    }

    /// True if light paths bring light to what the path has met.
    #[inline]
    fn begins_chain(&self, vertex: u32, path: &PathState) -> bool {
        self.guide.is_some() && vertex == 0 && path.passed == 0
    }

    /// What light paths could have found as well, at a vertex of this BSDF.
    fn chain(&self, at: &Stage<'_, '_>, path: &PathState, met: &SurfaceInteraction, bsdf: &SurfaceBsdf<'_>) -> Chain {
        if self.guide.is_none() || path.passed > 0 {
            return Chain::NONE;
        }
        // The emitter is to be found by the next segment, and the last vertex has none
        match (bsdf.makes_caustics, path.chain.is_open()) {
            (true, true) if at.vertex + 1 < at.depth => path.chain.bundled(),
            (false, _) if at.vertex == 0 && bsdf.bsdf.is_evaluated_exactly() => {
                Chain::at_first(bsdf.n.dot(met.wo), met.width)
            }
            _ => Chain::NONE,
        }
    }

    /// The wavelength of a path, and the factor of its throughput for choosing one.
    fn wavelength(&self, at: &Stage<'_, '_>, path: &PathState) -> (f32, Rgb) {
        path.wavelength.map_or_else(
            || {
                let stream = at.samples[path.sample as usize].stream;
                sample_wavelength(stream.domain(domain::WAVELENGTH).draw::<1>()[0])
            },
            |lambda| (lambda, Rgb::WHITE),
        )
    }

    /// Lets a path fly through its medium towards what its ray meets, and adds what the medium sends out. True if it is
    /// scattered on the way: then what it meets does not matter, but as the first surface that denoisers want to know of.
    fn fly(&mut self, at: &mut Stage<'_, '_>, path: &mut PathState, hit: Option<&Hit>) -> bool {
        let Some(id) = path.medium.filter(|_| !path.is_ghost) else { return false };
        let medium = &at.job.world.scene.media.media[id as usize];
        if medium.is_interior() {
            return self.walk(at, medium, path, hit);
        }
        let scale = path.ray.d.length();
        let (o, d) = (path.ray.o, path.ray.d / scale);
        let segment = Segment { o, d, length: hit.map_or(f32::INFINITY, |hit| hit.t * scale) };
        let stream = at.samples[path.sample as usize].stream;
        let mut numbers = Numbers::new(stream.domain(domain::FLIGHT + at.vertex).domain(path.passed));
        // What light samples could have found as well, which need no more to be seen than what is near
        let technique = path.technique.filter(|technique| technique.pdf.is_some());
        let least = if technique.is_none() { at.job.lights.glimpse_rate(id) } else { 0.0 };
        let weigh = |glimpse: &Glimpse| {
            let p = o + d * glimpse.t;
            at.left.weight(path, |ctx| at.job.lights.pdf_glow(ctx, id, (glimpse, p)))
        };
        let focus = || focus(at.job, &segment, &stream, at.vertex);
        let flight = medium.fly(&segment, path.beta, &mut numbers, focus, (least, weigh));
        self.stats.collisions += u64::from(numbers.drawn);
        let Flight { emitted, end } = flight;
        at.out[path.sample as usize].radiance += path.beta * emitted;
        match end {
            End::Through { weight } => {
                path.weaken(weight);
                false
            }
            End::Scattered { t, weight } => {
                if at.vertex < at.depth {
                    let surface = SurfaceHit::in_space(o + d * t);
                    let bsdf = SurfaceBsdf::in_medium(medium.g(), -d);
                    self.scatter(at, (path, t, weight), (surface, bsdf));
                }
                path.is_ghost = at.vertex == 0 && self.features != FeatureSet::None;
                !path.is_ghost
            }
        }
    }

    /// Keeps a path that is scattered in its medium after the distance `t`, where its throughput gets the factor `weight`.
    fn scatter<'w>(
        &mut self,
        at: &mut Stage<'_, 'w>,
        (path, t, weight): (&PathState, f32, Rgb),
        (surface, bsdf): (SurfaceHit, SurfaceBsdf<'w>),
    ) {
        let Some(beta) = path.beta_beyond_emitter() else { return };
        let (beta, width) = (beta * weight, path.width + path.spread * t);
        let next = PathState { beta, width, chain: Chain::NONE, ..*path };
        self.keep(at, next, (surface, bsdf.frame.z), (bsdf, Sides::both(path.medium)));
    }

    /// Adds what the escaped paths carry of infinite lights, with the weight of the technique that found it.
    fn add_infinite(&mut self, at: &mut Stage<'_, '_>) {
        let (lights, active, layers) = (&at.job.lights, &self.active, &mut self.layers);
        let (left, out) = (&at.left, &mut *at.out);
        self.escaped.retain(|&k| {
            let path = &active[k as usize];
            if path.technique.is_none() {
                let l = path.beta * lights.le(path.ray.o, path.ray.d);
                out[path.sample as usize].radiance += l;
                layers.add_infinite(lights, path.sample, (path.ray.o, path.ray.d), l);
            }
            path.technique.is_some()
        });
        let escaped = &self.escaped;
        let path = |i: usize| &active[escaped[i] as usize];
        let ctx = |i: usize| left.ctx(path(i));
        lights.infinite_in_directions(
            escaped.len(),
            |i| (ctx(i), path(i).ray.d),
            |i, le, p_light| {
                let path = path(i);
                let l = path.beta * le;
                let weight = if l.is_black() { 1.0 } else { left.weight(path, |_| p_light) };
                out[path.sample as usize].radiance += l * weight;
                layers.add_infinite(lights, path.sample, (ctx(i).p, path.ray.d), l * weight);
            },
        );
    }

    /// First hits of the active paths.
    fn trace(&mut self, job: &RenderJob, vertex: u32, coherence: Coherence) {
        self.rays.set(self.active.iter().map(|path| &path.ray));
        if let Some(r) = &mut self.recording {
            let batches = if coherence == Coherence::Coherent { &mut r.camera } else { &mut r.bounces };
            batches.push(self.rays.clone());
        }
        let start = Instant::now();
        job.world.accel.intersect(&self.rays, coherence, &mut self.hits);
        let (count, time) = (self.rays.len() as u64, start.elapsed());
        if vertex == 0 {
            self.stats.camera_rays += count;
            self.stats.camera_time += time;
        } else {
            self.stats.bounce_rays += count;
            self.stats.bounce_time += time;
        }
    }
}

/// The middle of a light that the light sampler chooses for a point of a segment; `None` if that is at infinity. Where the
/// point is only changes the noise: light is expected from the near part of the segment.
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

/// The geometric normal at a hit of a mesh in world space by a ray of direction `d`, on the side that it comes from.
fn facing_normal(job: &RenderJob, hit: &Hit, d: Vec3) -> Vec3 {
    let Shape::Mesh(mesh) = &job.world.scene.geometry.geometries[hit.geometry as usize].shape else { return -d };
    let [a, b, c] = mesh.triangle(hit.primitive as usize);
    let n = (b - a).cross(c - a).normalize_or(-d);
    if n.dot(d) > 0.0 { -n } else { n }
}

//! From rays to vertices: paths are traced to the next surface that scatters, and carry what they see of emitters on the
//! way.

use super::light_layers::LayerSums;
use super::light_paths::{Chain, Guide};
use super::segment::{CameraSample, Carried, PathState, PathStats, Vertex, domain, emptied};
use super::wavefront::Batch;
use crate::accel::{Coherence, Hit, RayBatch};
use crate::film::{FeatureSet, Features, PixelSample};
use crate::geometry::{Shape, SurfaceHit};
use crate::lights::LightCtx;
use crate::materials::SurfaceBsdf;
use crate::materials::dispersion::sample_wavelength;
use crate::media::{End, Flight, Glimpse, Numbers, Segment, Sides};
use crate::scene::{RenderJob, SurfaceInteraction};
use lumiris_numbers::math::{Rgb, Vec3};
use lumiris_numbers::samplers::SampleStream;
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
    /// Takes what the paths see.
    pub(super) out: &'a mut [PixelSample],
    /// Takes the vertices that it can.
    pub(super) batch: Option<&'a mut Batch<'w>>,
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
    /// Memory of the vertices of earlier batches.
    spare: Vec<Vertex<'static>>,
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

    /// Keeps the memory of vertices that are done with for those of the next batch.
    pub(super) fn recycle(&mut self, vertices: Vec<Vertex<'_>>) {
        self.spare = emptied(vertices);
    }

    /// Traces the active paths to their next vertex, adds what they see at the first one, and keeps those that hit
    /// something that scatters. The answer's items belong to the paths that `self.active` then holds; those that the
    /// batch takes are not among them.
    pub(super) fn find<'w>(&mut self, mut at: Stage<'_, 'w>) -> Vec<Vertex<'w>> {
        let mut vertices: Vec<Vertex<'w>> = emptied(std::mem::take(&mut self.spare));
        self.kept.clear();
        let mut coherence = if at.vertex == 0 { Coherence::Coherent } else { Coherence::Incoherent };
        while !self.active.is_empty() {
            self.trace(at.job, at.vertex, coherence);
            coherence = Coherence::Incoherent;
            let start = Instant::now();
            self.passing.clear();
            self.escaped.clear();
            let (mut active, hits) = (std::mem::take(&mut self.active), std::mem::take(&mut self.hits));
            for (k, (path, hit)) in active.iter_mut().zip(&hits).enumerate() {
                if path.medium.is_some() && self.fly(&mut at, path, hit.as_ref(), &mut vertices) {
                    continue;
                }
                match hit {
                    Some(hit) if self.take_plain(&mut at, path, hit) => {}
                    Some(hit) => self.take(&mut at, path, hit, &mut vertices),
                    None if self.looks_for_emitters(at.vertex, path) => self.escaped.push(k as u32),
                    None => {}
                }
            }
            (self.active, self.hits) = (active, hits);
            self.add_infinite(at.job, at.out);
            std::mem::swap(&mut self.active, &mut self.passing);
            self.stats.shade_time += start.elapsed();
        }
        std::mem::swap(&mut self.active, &mut self.kept);
        vertices
    }

    #[inline]
    fn looks_for_emitters(&self, vertex: u32, path: &PathState) -> bool {
        !path.is_ghost && (path.technique.is_some() || vertex == 0 && !self.only_reflected)
    }

    /// Takes a hit of a mesh that reflects the same everywhere, whose point is found together with others; false if
    /// this is none.
    #[inline]
    fn take_plain(&mut self, at: &mut Stage<'_, '_>, path: &PathState, hit: &Hit) -> bool {
        let Some(batch) = at.batch.as_mut().filter(|_| path.medium.is_none()) else { return false };
        let Some(rho) = at.job.plain_reflectance(hit) else { return false };
        let Some(beta) = path.beta_beyond_emitter() else { return true };
        let distance = hit.t * path.ray.d.length();
        if at.vertex == 0 && self.features != FeatureSet::None {
            let features = &mut at.out[path.sample as usize].features;
            features.get_or_insert_with(|| path.plain_features(at.job, hit, distance, rho));
        }
        if at.vertex < at.depth {
            let mut carried = path.carried(beta, path.width + path.spread * distance);
            let (sample, d) = (&at.samples[path.sample as usize], path.ray.d);
            carried.chain = if self.begins_chain(at.vertex, path) {
                Chain::at_first(facing_normal(at.job, hit, d).dot(d), carried.width)
            } else {
                Chain::NONE
            };
            batch.push_hit(at.job, (&carried, d), hit, rho, [sample.stream, sample.direct]);
        }
        true
    }

    /// Takes any other hit, and adds its vertex, if the path goes on from one that the batch does not take.
    #[inline]
    fn take<'w>(&mut self, at: &mut Stage<'_, 'w>, path: &PathState, hit: &Hit, vertices: &mut Vec<Vertex<'w>>) {
        let interaction = SurfaceInteraction::new(at.job, &path.ray, (path.width, path.spread), hit);
        let (sample, out) = (&at.samples[path.sample as usize], &mut at.out[path.sample as usize]);
        if self.looks_for_emitters(at.vertex, path) {
            let emission = path.emission(at.job, &interaction, self.guide.as_deref());
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
        let mut carried = path.carried(beta, width);
        carried.chain = self.chain(at, path, &interaction, &bsdf);
        let streams = [sample.stream, sample.direct];
        let is_taken = |batch: &mut &mut Batch<'w>| batch.push_vertex(&carried, &interaction, &bsdf, streams);
        if media == Sides::default() && at.batch.as_mut().is_some_and(is_taken) {
            return;
        }
        let (surface, wo) = (interaction.surface, interaction.wo);
        let [stream, direct] = streams.map(|s| s.domain(domain::VERTEX + at.vertex));
        self.keep(path, &carried);
        vertices.push(Vertex { surface, bsdf, wo, stream, direct, is_next: path.passed == 0, media });
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

    /// Keeps a path at a vertex, with what it has carried there.
    #[inline]
    fn keep(&mut self, path: &PathState, carried: &Carried) {
        let Carried { beta, width, wavelength, chain, .. } = *carried;
        self.kept.push(PathState {
            beta,
            width,
            wavelength,
            chain,
            passed: 0,
            travelled: 0.0,
            technique: None,
            ..*path
        });
    }

    /// Lets a path fly through its medium towards what its ray meets, and adds what the medium sends out. True if it is
    /// scattered on the way: then what it meets does not matter, but as the first surface that denoisers want to know of.
    fn fly<'w>(
        &mut self,
        at: &mut Stage<'_, 'w>,
        path: &mut PathState,
        hit: Option<&Hit>,
        vertices: &mut Vec<Vertex<'w>>,
    ) -> bool {
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
            technique.map_or(1.0, |t| t.weight(|ctx| at.job.lights.pdf_glow(ctx, id, (glimpse, p))))
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
                    self.scatter(at, (path, t, weight), (surface, bsdf), vertices);
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
        vertices: &mut Vec<Vertex<'w>>,
    ) {
        let Some(beta) = path.beta_beyond_emitter() else { return };
        let sample = &at.samples[path.sample as usize];
        let (width, wo) = (path.width + path.spread * t, bsdf.frame.z);
        let [stream, direct] = [sample.stream, sample.direct].map(|s| s.domain(domain::VERTEX + at.vertex));
        self.keep(path, &path.carried(beta * weight, width));
        let media = Sides::both(path.medium);
        vertices.push(Vertex { surface, bsdf, wo, stream, direct, is_next: path.passed == 0, media });
    }

    /// Adds what the escaped paths carry of infinite lights, with the weight of the technique that found it.
    fn add_infinite(&mut self, job: &RenderJob, out: &mut [PixelSample]) {
        let (lights, active, layers) = (&job.lights, &self.active, &mut self.layers);
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
        let ctx = |i: usize| path(i).technique.map_or(LightCtx::at(Vec3::ZERO), |technique| technique.ctx);
        lights.infinite_in_directions(
            escaped.len(),
            |i| (ctx(i), path(i).ray.d),
            |i, le, p_light| {
                let path = path(i);
                let l = path.beta * le;
                let weight =
                    path.technique.filter(|_| !l.is_black()).map_or(1.0, |technique| technique.weight(|_| p_light));
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

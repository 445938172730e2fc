//! Path tracing with next-event estimation, a batch of paths at a time. The integrator `direct` is the case of one
//! bounce.
//!
//! The radiance along a camera ray is L_e(x₁) + Σ_k β_k L_direct(x_k). β_k = Π f_s |cos θ|/p is the throughput up to
//! the k-th vertex. L_direct, estimated by [`PointDirectLighting`], is the light that the vertex reflects and that
//! comes straight from emitters. So emission is added at the hit of the camera ray, and never twice.
//!
//! If `mis` has one BSDF sample and the path continues, this sample is the next segment of the path, which hits the
//! emitter itself. The estimate at x_k then lacks the emission of x_{k+1}, MIS-weighted against light sampling at x_k.
//! It is added at x_{k+1} (`BsdfTechnique`). This takes one ray instead of three, and one BSDF sample instead of two.
//!
//! All integrators use this path loop. [`AtVertices`] is the hook for their own work at vertices.

use super::camera_sample::CameraSamples;
use super::cells::Blocks;
use super::integrator::{Integrator, Tracer};
use super::light_layers::LayerSums;
use super::light_paths::{LightImage, LightPilot};
use super::path_state::{LastVertices, PathState, Paths};
pub use super::recording::Recording;
use super::reuse::{self, LambertianVertex, Reuse};
use super::scatter::{Continuation, Scatter};
use super::statistics::{PathStats, Statistics};
use super::vertex_search::{TraceStep, VertexSearch};
use crate::direct::{ColumnDirectLighting, Estimator, Fits, PointDirectLighting, ShadingPoint, Techniques, Vertices};
use crate::film::{FeatureSet, PixelSample};
use crate::materials::SurfaceBsdf;
use crate::photons::PhotonError;
use crate::scene::RenderJob;
use crate::settings::{IntegratorSettings, SampleCounts};
use lumiris_numbers::math::{Ray, Rgb};
use lumiris_numbers::samplers::SampleStream;
use std::sync::Arc;
use std::time::Instant;

/// Path tracing. Only light paths, if enabled, are prepared.
pub struct PathIntegrator<'a> {
    job: &'a RenderJob,
    /// Blocks of pixels that share paths.
    blocks: Blocks,
    light: Option<LightImage>,
}

impl<'a> PathIntegrator<'a> {
    /// The integrator of an image that is rendered in whole cells.
    pub(super) fn new(job: &'a RenderJob) -> Self {
        let blocks = if reuse::edge(job) > 1 { Blocks::Cells } else { Blocks::None };
        PathIntegrator { job, blocks, light: LightImage::new(job) }
    }
}

impl Integrator for PathIntegrator<'_> {
    fn prepare(&mut self, first: u32) -> Result<u32, PhotonError> {
        Ok(self.light.as_mut().map_or(u32::MAX, |light| light.prepare(self.job, first)))
    }

    fn tracer(&self, features: FeatureSet) -> Box<dyn Tracer + '_> {
        let mut paths = PathTracer::sharing(self.blocks, features);
        let Some(light) = &self.light else { return Box::new(paths) };
        paths.search.guide = Some(Arc::clone(&light.guide));
        Box::new(WithLightPaths { paths, light })
    }

    fn statistics(&self, paths: PathStats) -> Statistics {
        Statistics { paths, light: self.light.as_ref().map(|light| light.stats), ..Statistics::default() }
    }
}

/// Traces camera paths, and adds the contributions of light paths.
struct WithLightPaths<'a> {
    paths: PathTracer,
    light: &'a LightImage,
}

impl Tracer for WithLightPaths<'_> {
    fn trace(&mut self, job: &RenderJob, samples: &CameraSamples, fits: &mut Fits, out: &mut Vec<PixelSample>) {
        Tracer::trace(&mut self.paths, job, samples, fits, out);
        self.light.add(samples, out);
    }

    fn take_stats(&mut self) -> PathStats {
        Tracer::take_stats(&mut self.paths)
    }
}

/// The vertices of a batch of paths.
pub(super) struct BatchVertices<'a, 'w> {
    /// Index of the vertices along the paths, from 0.
    pub(super) vertex: u32,
    pub(super) paths: &'a Paths,
    pub(super) vertices: &'a Vertices<'w>,
}

/// A single vertex.
pub(super) struct PathVertex<'a, 'w> {
    pub(super) path: &'a PathState,
    /// The ray to the vertex.
    pub(super) ray: Ray,
    pub(super) point: ShadingPoint<'w>,
    /// Its random numbers.
    pub(super) stream: SampleStream,
}

impl<'a, 'w> BatchVertices<'a, 'w> {
    /// The vertices one by one.
    pub(super) fn each(&self) -> impl Iterator<Item = PathVertex<'a, 'w>> {
        let (paths, vertices) = (self.paths, self.vertices);
        (0..vertices.len()).map(move |i| {
            let index = vertices.path[i] as usize;
            let (path, ray) = (&paths.states[index], paths.rays.get(index));
            let point = vertices.point(i, SampleCounts::default(), [path.sample, 0]);
            PathVertex { path, ray, point, stream: vertices.streams.get(i) }
        })
    }
}

/// The integrator's own work at vertices, called once per batch: it adds the part of the reflected light that it
/// computes itself to the samples, and returns the remaining work for each vertex.
pub(super) type AtVertices<'s> = dyn for<'w> FnMut(&BatchVertices<'_, 'w>, &mut [PixelSample]) -> Vec<Shading<'w>> + 's;

/// Remaining work at a vertex; by default none.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Shading<'w> {
    /// BSDF of the direct light.
    pub(super) direct: Option<SurfaceBsdf<'w>>,
    /// BSDF of the next segment.
    pub(super) next: Option<SurfaceBsdf<'w>>,
}

/// The result of a direct-light sample at a first vertex.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// Index of the camera sample.
    pub sample: u32,
    /// Its contribution if visible.
    pub unshadowed: Rgb,
    /// Its contribution.
    pub contribution: Rgb,
}

/// Paths per batch: large enough for long stages, small enough that their data, about 1 kB each, stay in the cache of a
/// core.
pub const BATCH_PATHS: usize = 1024;

/// Traces paths; holds the buffers of one worker.
#[derive(Debug, Default)]
pub struct PathTracer {
    pub(super) search: VertexSearch,
    next: Paths,
    scatter: Scatter,
    pub(super) radiance: Vec<Rgb>,
    pub(super) direct: PointDirectLighting,
    pub(super) columns: ColumnDirectLighting,
    /// Vertex columns of earlier batches, kept for their memory.
    spare: [Vertices<'static>; 4],
    /// Path sharing within a batch.
    reuse: Reuse,
    /// If set, all vertices use the estimator of this vertex index.
    pub(super) estimator_of: Option<u32>,
    /// Paths continue by specular lobes only.
    pub(super) only_specular: bool,
    /// Samples of direct light at first vertices, if requested.
    pub outcomes: Option<Vec<Outcome>>,
}

/// Common input of the steps at the vertices of a batch.
pub(super) struct ShadeStep<'s> {
    pub(super) job: &'s RenderJob,
    pub(super) settings: &'s IntegratorSettings,
    pub(super) samples: &'s CameraSamples,
    /// Index along the paths.
    pub(super) vertex: u32,
    pub(super) estimator: Estimator,
    /// The direct-light techniques, if the estimator traces all its samples.
    pub(super) techniques: Option<Techniques>,
    /// True if paths continue from the vertices.
    pub(super) continues: bool,
}

impl PathTracer {
    /// A tracer that records these features of first surfaces.
    pub fn new(features: FeatureSet) -> Self {
        let mut tracer = PathTracer::default();
        tracer.search.features = features;
        tracer
    }

    /// The same, with path sharing if the settings enable it.
    pub fn sharing(blocks: Blocks, features: FeatureSet) -> Self {
        PathTracer { reuse: Reuse::of(blocks), ..PathTracer::new(features) }
    }

    /// Weights the camera paths against light paths from now on, with `per_sample` light paths per camera sample. The
    /// estimates then lack the contributions of light paths.
    pub fn weigh_against_light_paths(&mut self, job: &RenderJob, pilot: &LightPilot, per_sample: f64) {
        let paths = per_sample * job.world.scene.film.bounds.area() as f64;
        self.search.guide = Some(Arc::new(pilot.guide().with_paths(paths.clamp(1.0, f64::from(u32::MAX)) as u32)));
    }

    /// Copies the rays that are traced from now on, for measurements.
    pub fn record(&mut self) {
        self.search.recording = Some(Recording::default());
    }

    /// The recorded rays. Ends recording.
    pub fn take_recording(&mut self) -> Recording {
        self.search.recording.take().unwrap_or_default()
    }

    /// Estimates the radiance of each camera sample; `out[i]` belongs to `samples[i]`. `fits` belong to the pixels of
    /// the samples, and may be empty.
    pub fn trace(
        &mut self,
        job: &RenderJob,
        settings: &IntegratorSettings,
        samples: &CameraSamples,
        fits: &mut Fits,
        out: &mut Vec<PixelSample>,
    ) {
        self.search.start(job, samples, out);
        self.follow(job, settings, None, samples, fits, out);
    }

    /// The path loop, vertex by vertex: L = Σ β (L_e·w + L_d). `own` is the integrator's own work at vertices.
    pub(super) fn follow(
        &mut self,
        job: &RenderJob,
        settings: &IntegratorSettings,
        mut own: Option<&mut AtVertices<'_>>,
        samples: &CameraSamples,
        fits: &mut Fits,
        out: &mut [PixelSample],
    ) {
        let [mut vertices, mut left, mut of_direct, mut of_next] =
            std::mem::take(&mut self.spare).map(Vertices::emptied);
        let mut drawn = None;
        let depth = settings.depth();
        // Paths of an integrator with its own work do not carry all light, so they cannot be shared
        let may_share = own.is_none() && self.outcomes.is_none();
        self.reuse.begin(settings.path_reuse.filter(|_| may_share), samples.len());
        fits.begin_batch(samples.len());
        for vertex in 0..=depth {
            if self.search.active.is_empty() {
                break;
            }

            // Trace to the vertices, and add β·L_e·w of the emitters that are hit
            let from = LastVertices { vertices: &left, techniques: drawn };
            self.search.find(TraceStep { job, vertex, depth, samples, left: from, out, vertices: &mut vertices });
            let step = self.step(job, settings, vertex, samples, own.is_some());

            // The integrator's own work, and path sharing
            let (of_direct, of_next) = match &mut own {
                Some(own) => {
                    self.leave_to_integrator(*own, job, vertex, &vertices, [&mut of_direct, &mut of_next], out);
                    (&of_direct, &of_next)
                }
                None => (&vertices, &vertices),
            };
            self.share(vertex, &vertices, out);

            // Add β·L_d
            self.add_direct_light(&step, of_direct, fits, out);

            // Scatter
            self.scatter(&step, of_next);
            std::mem::swap(&mut left, &mut vertices);
            vertices.clear();
            drawn = step.techniques;
        }
        self.resolve_shared(job, samples, out);
        fits.end_batch(samples.fit.iter().copied().zip(samples.weight.iter().copied()));
        self.spare = [vertices, left, of_direct, of_next].map(Vertices::emptied);
    }

    /// The direct-light estimator at vertices of this index, and the continuation of paths.
    fn step<'s>(
        &self,
        job: &'s RenderJob,
        settings: &'s IntegratorSettings,
        vertex: u32,
        samples: &'s CameraSamples,
        has_own: bool,
    ) -> ShadeStep<'s> {
        let estimator = Estimator::at_vertex(settings, self.estimator_of.unwrap_or(vertex));
        // Light samples do not cover all emission of media: beyond the last vertex it takes another segment
        let beyond_last = job.world.scene.media.is_emissive() && vertex < settings.depth();
        let continues = vertex + 1 < settings.depth() || beyond_last;
        // Only the stages provide outcomes
        let techniques = Techniques::of(&estimator, continues && !has_own).filter(|_| self.outcomes.is_none());
        ShadeStep { job, settings, samples, vertex, estimator, techniques, continues }
    }

    /// Calls the integrator's own work. `of_direct` becomes the vertices at which direct light is estimated, `of_next`
    /// the vertices from which paths continue.
    fn leave_to_integrator<'w>(
        &self,
        own: &mut AtVertices<'_>,
        job: &'w RenderJob,
        vertex: u32,
        vertices: &Vertices<'w>,
        [of_direct, of_next]: [&mut Vertices<'w>; 2],
        out: &mut [PixelSample],
    ) {
        let shadings = own(&BatchVertices { vertex, paths: &self.search.active, vertices }, out);
        of_direct.clear();
        of_direct.select(vertices, &job.lights, |i| shadings[i].direct);
        of_next.clear();
        of_next.select(vertices, &job.lights, |i| shadings[i].next);
    }

    /// Samples the next segments of paths.
    fn scatter(&mut self, step: &ShadeStep<'_>, vertices: &Vertices<'_>) {
        let start = Instant::now();
        self.next.clear();
        if step.continues {
            let ShadeStep { settings, vertex, techniques, .. } = *step;
            let how = Continuation { settings, vertex, techniques, only_specular: self.only_specular };
            self.scatter.extend(&how, vertices, &self.search.active, &mut self.next);
        }
        std::mem::swap(&mut self.search.active, &mut self.next);
        self.search.stats.shade_time += start.elapsed();
    }

    /// Adds the light of shared paths.
    fn resolve_shared(&mut self, job: &RenderJob, samples: &CameraSamples, out: &mut [PixelSample]) {
        let Some(reuse) = self.reuse.active() else { return };
        let start = Instant::now();
        self.direct.stats.segments += reuse.resolve(job, samples, out);
        self.direct.stats.t2 += start.elapsed();
    }

    /// Registers the Lambertian vertices for path sharing.
    fn share(&mut self, vertex: u32, vertices: &Vertices<'_>, out: &mut [PixelSample]) {
        let Some(reuse) = self.reuse.active() else { return };
        let start = Instant::now();
        let surface = &vertices.surface;
        for i in vertices.bsdfs.len()..vertices.len() {
            let path = &mut self.search.active.states[vertices.path[i] as usize];
            let [p, p_error] = [&surface.p, &surface.p_error].map(|column| column.vec3(i));
            let at = LambertianVertex::new(p, p_error, surface.n.vec3(i), surface.ns.vec3(i), surface.wo.vec3(i));
            reuse.add(path, vertex, at, surface.rho.rgb(i), &mut out[path.sample as usize].radiance);
        }
        self.search.stats.shade_time += start.elapsed();
    }
}

impl Tracer for PathTracer {
    fn trace(&mut self, job: &RenderJob, samples: &CameraSamples, fits: &mut Fits, out: &mut Vec<PixelSample>) {
        PathTracer::trace(self, job, &job.settings().integrator, samples, fits, out);
    }

    fn keep_light_layers(&mut self, count: usize) {
        self.search.layers.keep(count);
    }

    fn light_layers(&mut self) -> Option<&mut LayerSums> {
        Some(&mut self.search.layers)
    }

    fn take_stats(&mut self) -> PathStats {
        let direct = std::mem::take(&mut self.direct.stats);
        PathStats { direct, ..std::mem::take(&mut self.search.stats) }
    }
}

//! Path tracing with next-event estimation, a batch of paths at a time; `direct` is the case of one bounce.
//!
//! The radiance along a camera ray is L_e(x₁) + Σ_k β_k L_direct(x_k), where β_k = Π f_s |cos θ|/p is the throughput up
//! to the k-th vertex and L_direct is what [`DirectStage`] estimates there, from all light that reaches
//! the vertex straight from an emitter. So emission is added at the camera ray's hit, and never twice.
//!
//! Where `mis` has one BSDF sample and the path goes on, the sample's direction is that of the next segment, which finds
//! the emitter itself: what is missing in the estimate at x_k, the emission that x_{k+1} sends back weighted against
//! light sampling at x_k, is added there (`BsdfTechnique`). One ray instead of three, and one BSDF sample instead of
//! two.
//!
//! All integrators follow their paths through the one loop here; [`AtVertices`] is what they do differently.

use super::cells::Groups;
use super::light_paths::{LightImage, LightPilot};
use super::reuse::{self, Place, Reuse};
use super::scatter::{Continuation, Scatter};
pub use super::segment::{CameraSample, PathStats};
use super::segment::{LastVertices, PathState};
pub use super::vertices::Recording;
use super::vertices::{Stage, VertexSearch};
use super::{Integrator, Statistics, Tracer};
use crate::direct::{ColumnStage, DirectStage, Estimator, Fits, ShadingPoint, Techniques, Vertices};
use crate::film::{FeatureSet, PixelSample};
use crate::materials::SurfaceBsdf;
use crate::photons::PhotonError;
use crate::scene::RenderJob;
use crate::settings::{IntegratorSettings, SampleCounts};
use lumiris_numbers::math::Rgb;
use lumiris_numbers::samplers::SampleStream;
use std::sync::Arc;
use std::time::Instant;

/// Path tracing: nothing is prepared, but light paths if there are any.
pub struct PathIntegrator<'a> {
    job: &'a RenderJob,
    /// Which samples share paths.
    groups: Groups,
    light: Option<LightImage>,
}

impl<'a> PathIntegrator<'a> {
    /// Of an image that is rendered in whole cells.
    pub(super) fn new(job: &'a RenderJob) -> Self {
        let groups = if reuse::edge(job) > 1 { Groups::Cells } else { Groups::None };
        PathIntegrator { job, groups, light: LightImage::new(job) }
    }
}

impl Integrator for PathIntegrator<'_> {
    fn prepare(&mut self, first: u32) -> Result<u32, PhotonError> {
        Ok(self.light.as_mut().map_or(u32::MAX, |light| light.prepare(self.job, first)))
    }

    fn tracer(&self, features: FeatureSet) -> Box<dyn Tracer + '_> {
        let mut paths = PathTracer::sharing(self.groups, features);
        let Some(light) = &self.light else { return Box::new(paths) };
        paths.search.guide = Some(Arc::clone(&light.guide));
        Box::new(WithLightPaths { paths, light })
    }

    fn statistics(&self, paths: PathStats) -> Statistics {
        Statistics { paths, light: self.light.as_ref().map(|light| light.stats), ..Statistics::default() }
    }
}

/// Traces camera paths, and adds what light paths have found.
struct WithLightPaths<'a> {
    paths: PathTracer,
    light: &'a LightImage,
}

impl Tracer for WithLightPaths<'_> {
    fn trace(&mut self, job: &RenderJob, samples: &[CameraSample], fits: &mut Fits, out: &mut Vec<PixelSample>) {
        Tracer::trace(&mut self.paths, job, samples, fits, out);
        self.light.add(samples.iter().map(|s| (s.pixel, s.turn, s.is_replica)), out);
    }

    fn take_stats(&mut self) -> PathStats {
        Tracer::take_stats(&mut self.paths)
    }
}

/// The vertices of a batch of paths.
pub(super) struct BatchVertices<'a, 'w> {
    /// Their index along the paths, from 0.
    pub(super) vertex: u32,
    pub(super) paths: &'a [PathState],
    pub(super) vertices: &'a Vertices<'w>,
}

/// A vertex by itself.
pub(super) struct PathVertex<'a, 'w> {
    pub(super) path: &'a PathState,
    pub(super) point: ShadingPoint<'w>,
    /// Its random numbers.
    pub(super) stream: SampleStream,
}

impl<'a, 'w> BatchVertices<'a, 'w> {
    /// The vertices one by one.
    pub(super) fn each(&self) -> impl Iterator<Item = PathVertex<'a, 'w>> {
        let (paths, vertices) = (self.paths, self.vertices);
        (0..vertices.len()).map(move |i| {
            let path = &paths[vertices.path[i] as usize];
            let point = vertices.point(i, SampleCounts::default(), [path.sample, 0]);
            PathVertex { path, point, stream: vertices.streams[i] }
        })
    }
}

/// What an integrator does at vertices where it is not path tracing: it adds to the samples what is known of the light
/// that is reflected there, and says of each vertex what remains to be done. Called once per batch.
pub(super) type AtVertices<'s> = dyn for<'w> FnMut(&BatchVertices<'_, 'w>, &mut [PixelSample]) -> Vec<Shading<'w>> + 's;

/// What remains to be done at a vertex; by default nothing.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Shading<'w> {
    /// BSDF for which direct light is estimated.
    pub(super) lit: Option<SurfaceBsdf<'w>>,
    /// BSDF by which the path continues.
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

/// Paths that are traced together: enough that stages run long, few enough that their data, about 1 kB each, stays in the
/// cache of a core.
pub const BATCH_PATHS: usize = 1024;

/// Traces paths; holds the buffers of one worker.
#[derive(Debug, Default)]
pub struct PathTracer {
    pub(super) search: VertexSearch,
    next: Vec<PathState>,
    scatter: Scatter,
    pub(super) radiance: Vec<Rgb>,
    pub(super) direct: DirectStage,
    pub(super) columns: ColumnStage,
    /// Memory of the vertices of earlier batches.
    spare: [Vertices<'static>; 4],
    /// Paths that samples of a batch share.
    reuse: Reuse,
    /// The vertex whose estimator all have, if not each its own.
    pub(super) estimator_of: Option<u32>,
    /// Paths go on by specular lobes only.
    pub(super) only_specular: bool,
    /// Samples of direct light at first vertices, if requested.
    pub outcomes: Option<Vec<Outcome>>,
}

/// What the steps at the vertices of a batch read.
pub(super) struct Step<'s> {
    pub(super) job: &'s RenderJob,
    pub(super) settings: &'s IntegratorSettings,
    pub(super) samples: &'s [CameraSample],
    /// Index along the paths.
    pub(super) vertex: u32,
    pub(super) estimator: Estimator,
    /// The samples of direct light, if all of them are traced.
    pub(super) techniques: Option<Techniques>,
    /// Paths go on from the vertices.
    pub(super) continues: bool,
}

impl PathTracer {
    /// With these features of first surfaces.
    pub fn new(features: FeatureSet) -> Self {
        let mut tracer = PathTracer::default();
        tracer.search.features = features;
        tracer
    }

    /// The same, where these samples of a batch share paths if the settings say so.
    pub fn sharing(groups: Groups, features: FeatureSet) -> Self {
        PathTracer { reuse: Reuse::of(groups), ..PathTracer::new(features) }
    }

    /// Leaves to light paths what these find, as many for each camera sample of the image as given, from now on: what remains is
    /// less than the radiance. `None`: nothing.
    pub fn leave(&mut self, job: &RenderJob, light: Option<(&LightPilot, f64)>) {
        self.search.guide = light.map(|(pilot, per_sample)| {
            let paths = per_sample * job.world.scene.film.bounds.area() as f64;
            Arc::new(pilot.guide().with_paths(paths.clamp(1.0, f64::from(u32::MAX)) as u32))
        });
    }

    /// Copies the rays that are traced from now on, for measurements.
    pub fn record(&mut self) {
        self.search.recording = Some(Recording::default());
    }

    /// The rays that were recorded; no more are.
    pub fn take_recording(&mut self) -> Recording {
        self.search.recording.take().unwrap_or_default()
    }

    /// Estimates the radiance of each camera sample; `out[i]` belongs to `samples[i]`. `fits` are those of the samples'
    /// pixels; they may be none.
    pub fn trace(
        &mut self,
        job: &RenderJob,
        settings: &IntegratorSettings,
        samples: &[CameraSample],
        fits: &mut Fits,
        out: &mut Vec<PixelSample>,
    ) {
        self.search.start(job, samples, out);
        self.follow((job, settings), None, samples, fits, out);
    }

    /// Follows the paths that were started, vertex by vertex: L = Σ β (L_e·w + L_d). `own` is the integrator's own work at
    /// vertices.
    pub(super) fn follow(
        &mut self,
        (job, settings): (&RenderJob, &IntegratorSettings),
        mut own: Option<&mut AtVertices<'_>>,
        samples: &[CameraSample],
        fits: &mut Fits,
        out: &mut [PixelSample],
    ) {
        let [mut vertices, mut left, mut lit, mut next] = std::mem::take(&mut self.spare).map(Vertices::emptied);
        let mut drawn = None;
        let depth = settings.depth();
        // Paths of an integrator with work of its own do not carry all light, so neighbours cannot share them
        let may_share = own.is_none() && self.outcomes.is_none();
        self.reuse.begin(settings.path_reuse.filter(|_| may_share), samples.len());
        fits.begin_batch(samples.len());
        for vertex in 0..=depth {
            if self.search.active.is_empty() {
                break;
            }

            // Trace, add β·L_e·w of the emitters that are hit, and arrive at the vertices
            let from = LastVertices { vertices: &left, techniques: drawn };
            self.search.find(Stage { job, vertex, depth, samples, left: from, out, vertices: &mut vertices });
            let step = self.step((job, settings), vertex, samples, own.is_some());

            // Let the integrator answer for its part of the light, and neighbours share their paths
            let (lit, next) = match &mut own {
                Some(own) => {
                    self.leave_to_integrator(*own, (job, vertex), &vertices, [&mut lit, &mut next], out);
                    (&lit, &next)
                }
                None => (&vertices, &vertices),
            };
            self.share(vertex, &vertices, out);

            // Add β·L_d
            self.light(&step, lit, fits, out);

            // Scatter
            self.scatter(&step, next);
            std::mem::swap(&mut left, &mut vertices);
            vertices.clear();
            drawn = step.techniques;
        }
        self.resolve_shared(job, samples, out);
        fits.end_batch(samples.iter().map(|s| (s.fit, s.weight)));
        self.spare = [vertices, left, lit, next].map(Vertices::emptied);
    }

    /// How light is sampled at vertices of this index, and how paths go on.
    fn step<'s>(
        &self,
        (job, settings): (&'s RenderJob, &'s IntegratorSettings),
        vertex: u32,
        samples: &'s [CameraSample],
        has_own: bool,
    ) -> Step<'s> {
        let estimator = Estimator::at_vertex(settings, self.estimator_of.unwrap_or(vertex));
        // Light samples do not find all emission of media: that beyond the last vertex takes another segment
        let beyond_last = job.world.scene.media.is_emissive() && vertex < settings.depth();
        let continues = vertex + 1 < settings.depth() || beyond_last;
        // Outcomes are those of the stages
        let techniques = Techniques::of(&estimator, continues && !has_own).filter(|_| self.outcomes.is_none());
        Step { job, settings, samples, vertex, estimator, techniques, continues }
    }

    /// Lets an integrator add the light that it knows. `rest` become the vertices that are lit, and those from which paths
    /// go on.
    fn leave_to_integrator<'w>(
        &self,
        own: &mut AtVertices<'_>,
        (job, vertex): (&'w RenderJob, u32),
        vertices: &Vertices<'w>,
        rest: [&mut Vertices<'w>; 2],
        out: &mut [PixelSample],
    ) {
        let [lit, next] = rest;
        let shadings = own(&BatchVertices { vertex, paths: &self.search.active, vertices }, out);
        lit.clear();
        lit.select(vertices, &job.lights, |i| shadings[i].lit);
        next.clear();
        next.select(vertices, &job.lights, |i| shadings[i].next);
    }

    /// Makes the next segments of the paths that go on from vertices.
    fn scatter(&mut self, step: &Step<'_>, vertices: &Vertices<'_>) {
        let start = Instant::now();
        self.next.clear();
        if step.continues {
            let Step { settings, vertex, techniques, .. } = *step;
            let how = Continuation { settings, vertex, techniques, only_specular: self.only_specular };
            self.scatter.extend(&how, vertices, &self.search.active, &mut self.next);
        }
        std::mem::swap(&mut self.search.active, &mut self.next);
        self.search.stats.shade_time += start.elapsed();
    }

    /// Adds the light that neighbours share.
    fn resolve_shared(&mut self, job: &RenderJob, samples: &[CameraSample], out: &mut [PixelSample]) {
        let Some(reuse) = self.reuse.active() else { return };
        let start = Instant::now();
        self.direct.stats.segments += reuse.resolve(job, samples, out);
        self.direct.stats.t2 += start.elapsed();
    }

    /// Lets the paths at Lambertian vertices be shared.
    fn share(&mut self, vertex: u32, vertices: &Vertices<'_>, out: &mut [PixelSample]) {
        let Some(reuse) = self.reuse.active() else { return };
        let start = Instant::now();
        let surface = &vertices.surface;
        for i in vertices.bsdfs.len()..vertices.len() {
            let path = &mut self.search.active[vertices.path[i] as usize];
            let point = (surface.p.vec3(i), surface.p_error.vec3(i));
            let at = Place::new(point, (surface.n.vec3(i), surface.ns.vec3(i)), surface.wo.vec3(i));
            let radiance = &mut out[path.sample as usize].radiance;
            let arrival = (path.sample, vertex, path.passed == 0);
            path.beta = reuse.arrive(arrival, at, (path.beta, surface.rho.rgb(i)), radiance);
        }
        self.search.stats.shade_time += start.elapsed();
    }
}

impl Tracer for PathTracer {
    fn trace(&mut self, job: &RenderJob, samples: &[CameraSample], fits: &mut Fits, out: &mut Vec<PixelSample>) {
        PathTracer::trace(self, job, &job.settings().integrator, samples, fits, out);
    }

    fn keep_light_layers(&mut self, count: usize) {
        self.search.layers.layers = count;
    }

    fn light_layers(&mut self) -> &mut [Rgb] {
        self.search.layers.sums()
    }

    fn take_stats(&mut self) -> PathStats {
        let direct = std::mem::take(&mut self.direct.stats);
        PathStats { direct, ..std::mem::take(&mut self.search.stats) }
    }
}

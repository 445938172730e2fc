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
use crate::direct::columns::Sinks;
use crate::direct::{ColumnStage, DirectStage, Estimator, Fits, ShadingPoint, Techniques, Vertices};
use crate::film::{FeatureSet, PixelSample};
use crate::materials::SurfaceBsdf;
use crate::photons::PhotonError;
use crate::scene::RenderJob;
use crate::settings::{IntegratorSettings, SampleCounts};
use lumiris_numbers::math::{Rgb, Vec3};
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
    radiance: Vec<Rgb>,
    direct: DirectStage,
    columns: ColumnStage,
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
struct Step<'s> {
    job: &'s RenderJob,
    samples: &'s [CameraSample],
    /// Index along the paths.
    vertex: u32,
    estimator: Estimator,
    /// The samples of direct light, if all of them are traced.
    techniques: Option<Techniques>,
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

    /// Follows the paths that were started, vertex by vertex; `own` is what the integrator does there itself.
    pub(super) fn follow(
        &mut self,
        (job, settings): (&RenderJob, &IntegratorSettings),
        mut own: Option<&mut AtVertices<'_>>,
        samples: &[CameraSample],
        fits: &mut Fits,
        out: &mut [PixelSample],
    ) {
        let depth = settings.depth();
        let is_emissive = job.world.scene.media.is_emissive();
        // Samples that are listed are those of the stages; what an integrator does itself is not in the paths of others
        let (is_listed, is_plain) = (self.outcomes.is_some(), own.is_none() && self.outcomes.is_none());
        let [mut vertices, mut left, mut lit, mut next] = std::mem::take(&mut self.spare).map(Vertices::emptied);
        let mut drawn = None;
        fits.begin_batch(samples.len());
        self.reuse.begin(settings.path_reuse.filter(|_| is_plain), samples.len());
        for vertex in 0..=depth {
            if self.search.active.is_empty() {
                break;
            }

            // Trace, add β·L_e of what is met, and arrive at the vertices
            let from = LastVertices { vertices: &left, techniques: drawn };
            self.search.find(Stage { job, vertex, depth, samples, left: from, out, vertices: &mut vertices });

            // The samples there. Light samples alone do not find all that media send out: beyond the last vertex there is another
            // segment for it
            let estimator = Estimator::at_vertex(settings, self.estimator_of.unwrap_or(vertex));
            let continues = vertex + 1 < depth || is_emissive && vertex < depth;
            let techniques = Techniques::of(&estimator, continues && own.is_none()).filter(|_| !is_listed);
            let step = Step { job, samples, vertex, estimator, techniques };

            // What the integrator knows of the light, and what neighbours share of the path
            let own = own.as_mut().map(|own| {
                let found = BatchVertices { vertex, paths: &self.search.active, vertices: &vertices };
                let shadings = own(&found, out);
                lit.clear();
                lit.select(&vertices, &job.lights, |i| shadings[i].lit);
                next.clear();
                next.select(&vertices, &job.lights, |i| shadings[i].next);
            });
            let (lit, next) = if own.is_some() { (&lit, &next) } else { (&vertices, &vertices) };
            self.share(vertex, &vertices, out);

            // Add β·L_d
            self.light(&step, lit, fits, out);

            // Scatter
            self.next.clear();
            if continues {
                let start = Instant::now();
                let how = Continuation { settings, vertex, techniques, only_specular: self.only_specular };
                self.scatter.extend(&how, next, &self.search.active, &mut self.next);
                self.search.stats.shade_time += start.elapsed();
            }
            std::mem::swap(&mut self.search.active, &mut self.next);
            std::mem::swap(&mut left, &mut vertices);
            vertices.clear();
            drawn = techniques;
        }
        if let Some(reuse) = self.reuse.active() {
            let start = Instant::now();
            self.direct.stats.segments += reuse.resolve(job, samples, out);
            self.direct.stats.t2 += start.elapsed();
        }
        fits.end_batch(samples.iter().map(|s| (s.fit, s.weight)));
        self.spare = [vertices, left, lit, next].map(Vertices::emptied);
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

    /// Adds the direct light of vertices.
    fn light(&mut self, step: &Step<'_>, vertices: &Vertices<'_>, fits: &mut Fits, out: &mut [PixelSample]) {
        match &step.techniques {
            Some(techniques) => self.light_columns(step, techniques, vertices, fits, out),
            None => self.light_points(step, vertices, fits, out),
        }
    }

    /// Adds the direct light of vertices whose samples are all traced.
    fn light_columns(
        &mut self,
        step: &Step<'_>,
        techniques: &Techniques,
        vertices: &Vertices<'_>,
        fits: &mut Fits,
        out: &mut [PixelSample],
    ) {
        let job = step.job;
        let VertexSearch { active, layers, guide, recording, .. } = &mut self.search;
        let path = |row: usize| &active[vertices.path[row] as usize];
        let rest = guide.as_ref().map(|guide| {
            move |row: usize, light, n, wi: Vec3| {
                let chain = path(row).chain;
                if chain.is_caustic() { chain.rest(guide.density(light, n, -wi)) } else { 1.0 }
            }
        });
        let are_kept = layers.are_kept();
        let mut visible = |row: usize, light: Option<_>, wi, contribution| {
            let (path, p) = (path(row), vertices.surface.p.vec3(row));
            match light {
                Some(light) => layers.add(&job.lights, path.sample, (light, p, wi), path.beta * contribution),
                None => layers.add_infinite(&job.lights, path.sample, (p, wi), path.beta * contribution),
            }
        };
        let mut sinks = Sinks {
            rest: rest.as_ref().map(|rest| rest as _),
            visible: if are_kept { Some(&mut visible) } else { None },
            segments: recording.as_mut().map(|r| r.segments_at(step.vertex)),
        };
        self.columns.estimate(job, techniques, vertices, &mut sinks, &mut self.direct.stats);

        let start = Instant::now();
        for row in 0..vertices.len() {
            let (path, radiance) = (path(row), self.columns.radiance(row));
            out[path.sample as usize].radiance += path.beta * radiance;
            if techniques.has_controls {
                let value = job.world.scene.film.balanced(radiance).to_array();
                fits.set_controls(path.sample, value, self.columns.controls(job, row));
            }
        }
        self.direct.stats.select += start.elapsed();
    }

    /// Adds the direct light of vertices by the stages of an estimator that selects among its samples.
    fn light_points(&mut self, step: &Step<'_>, vertices: &Vertices<'_>, fits: &mut Fits, out: &mut [PixelSample]) {
        let (job, active) = (step.job, &self.search.active);
        // In the order of the paths: fits are sums over the points of a pixel
        let mut rows = vec![u32::MAX; active.len()];
        vertices.path.iter().zip(0..).for_each(|(&path, row)| rows[path as usize] = row);
        rows.retain(|&row| row != u32::MAX);
        let path = |point: usize| &active[vertices.path[rows[point] as usize] as usize];
        let counts = step.estimator.sample_counts();
        let point = |(point, &row): (usize, &u32)| {
            let sample = &step.samples[path(point).sample as usize];
            let counts = if step.vertex == 0 { sample.sample_counts } else { counts };
            vertices.point(row as usize, counts, [path(point).sample, sample.fit])
        };
        let points: Vec<ShadingPoint<'_>> = rows.iter().enumerate().map(point).collect();
        self.direct.estimate(job, &step.estimator, &points, fits, &mut self.radiance);

        if let Some(r) = &mut self.search.recording {
            r.segments_at(step.vertex).push(self.direct.segments().clone());
        }
        if let Some(outcomes) = self.outcomes.as_mut().filter(|_| step.vertex == 0) {
            outcomes.extend(self.direct.outcomes().map(|(point, unshadowed, is_free)| {
                let contribution = if is_free { unshadowed } else { Rgb::BLACK };
                Outcome { sample: path(point as usize).sample, unshadowed, contribution }
            }));
        }
        for (point, &radiance) in self.radiance.iter().enumerate() {
            out[path(point).sample as usize].radiance += path(point).beta * radiance;
        }
        if self.search.layers.are_kept() {
            for (point, (light, wi), contribution) in self.direct.visible() {
                let (path, p) = (path(point as usize), points[point as usize].light_ctx().p);
                self.search.layers.add(&job.lights, path.sample, (light, p, wi), path.beta * contribution);
            }
        }
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

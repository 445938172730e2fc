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
pub use super::segment::{CameraSample, PathStats};
use super::segment::{PathState, Vertex, emptied, extend, extend_to_emitter};
pub use super::vertices::Recording;
use super::vertices::{Stage, VertexSearch};
use super::wavefront::{Batch, Buffers, Estimate, Output};
use super::{Integrator, Statistics, Tracer};
use crate::bsdfs::{Bsdf, Diffuse};
use crate::direct::{DirectStage, Estimator, Fits, ShadingPoint, lobe_for_lights};
use crate::film::{FeatureSet, PixelSample};
use crate::lights::LightSampling;
use crate::materials::SurfaceBsdf;
use crate::media::Sides;
use crate::photons::PhotonError;
use crate::scene::RenderJob;
use crate::settings::IntegratorSettings;
use lumiris_numbers::math::Rgb;
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
pub(super) struct Found<'a, 'w> {
    /// Their index along the paths, from 0.
    pub(super) vertex: u32,
    pub(super) paths: &'a [PathState],
    pub(super) vertices: &'a [Vertex<'w>],
}

/// What an integrator does at vertices where it is not path tracing: it adds to the samples what is known of the light
/// that is reflected there, and says of each vertex what remains to be done. Called once per batch.
pub(super) type AtVertices<'s> = dyn for<'w> FnMut(&Found<'_, 'w>, &mut [PixelSample]) -> Vec<Shading<'w>> + 's;

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

/// Paths that are traced together: enough that stages run long, few enough that their data stays in the cache.
pub const BATCH_PATHS: usize = 4096;

/// Traces paths; holds the buffers of one worker.
#[derive(Debug, Default)]
pub struct PathTracer {
    pub(super) search: VertexSearch,
    next: Vec<PathState>,
    /// Memory of the shading points of earlier batches.
    spare_points: Vec<ShadingPoint<'static>>,
    radiance: Vec<Rgb>,
    direct: DirectStage,
    buffers: Option<Box<Buffers>>,
    /// Paths that samples of a batch share.
    reuse: Reuse,
    /// The vertex whose estimator all have, if not each its own.
    pub(super) estimator_of: Option<u32>,
    /// Paths go on by specular lobes only.
    pub(super) only_specular: bool,
    /// Samples of direct light at first vertices, if requested.
    pub outcomes: Option<Vec<Outcome>>,
}

/// The vertices of a batch of paths, as the loop passes them on.
struct Step<'s, 'w> {
    settings: &'s IntegratorSettings,
    estimator: Estimator,
    /// Index along the paths.
    vertex: u32,
    /// Paths go on from here, if only to see what media send out.
    continues: bool,
    vertices: Vec<Vertex<'w>>,
    /// Of each vertex, if the integrator decides that.
    shadings: Option<Vec<Shading<'w>>>,
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
        fits.begin_batch(samples.len());
        let is_plain = own.is_none() && self.outcomes.is_none();
        self.reuse.begin(settings.path_reuse.filter(|_| is_plain), samples.len());
        for vertex in 0..=depth {
            let count = self.search.active.len();
            if count == 0 {
                break;
            }
            let estimate = Estimate::new(settings, vertex).filter(|_| is_plain && !job.shadows_pass());
            let mut batch = estimate.map(|e| Batch::new(self.buffers.take().unwrap_or_default(), e, count));
            let stage = Stage { job, vertex, depth, samples, out: &mut *out, batch: batch.as_mut() };
            let vertices = self.search.find(stage);
            let found = Found { vertex, paths: &self.search.active, vertices: &vertices };
            let shadings = own.as_mut().map(|own| own(&found, out));
            let estimator = Estimator::at_vertex(settings, self.estimator_of.unwrap_or(vertex));
            // Light samples alone do not find all that media send out: beyond the last vertex there is another segment for it
            let continues = vertex + 1 < depth || is_emissive && vertex < depth;
            let step = Step { settings, estimator, vertex, continues, vertices, shadings };
            let points = self.points(&job.lights, &step, samples);
            self.share(&step, out);
            self.light_points(job, &step, &points, fits, out);
            self.extend_paths(&step, &points);
            if let Some(mut batch) = batch {
                let (stats, direct) = (&mut self.search.stats, &mut self.direct.stats);
                let segments = self.search.recording.as_mut().map(|r| r.segments_at(vertex));
                let (samples, next, reuse) = (&mut *out, &mut self.next, self.reuse.active());
                let (layers, guide) = (&mut self.search.layers, self.search.guide.as_deref());
                batch.shade(job, &mut Output { samples, fits, next, stats, direct, segments, reuse, layers, guide });
                self.buffers = Some(batch.into_buffers());
            }
            std::mem::swap(&mut self.search.active, &mut self.next);
            self.spare_points = emptied(points);
            self.search.recycle(step.vertices);
        }
        if let Some(reuse) = self.reuse.active() {
            let start = Instant::now();
            self.direct.stats.segments += reuse.resolve(job, samples, out);
            self.direct.stats.t2 += start.elapsed();
        }
        fits.end_batch(samples.iter().map(|s| (s.fit, s.weight)));
    }

    /// The points whose direct light is estimated.
    fn points<'w>(
        &mut self,
        lights: &LightSampling,
        step: &Step<'_, 'w>,
        samples: &[CameraSample],
    ) -> Vec<ShadingPoint<'w>> {
        let sample_counts = step.estimator.sample_counts();
        // Outcomes are those of all samples of a first vertex
        let may_continue = step.continues && step.shadings.is_none() && (step.vertex > 0 || self.outcomes.is_none());
        let point = |(v, path): (&Vertex<'w>, &PathState)| {
            let sample = &samples[path.sample as usize];
            let sample_counts = if step.vertex == 0 { sample.sample_counts } else { sample_counts };
            let bsdf_by_path = may_continue
                && matches!(step.estimator, Estimator::Mis(mis) if mis.has_one_bsdf_sample(sample_counts.samples))
                && !v.bsdf.bsdf.is_only_evaluated();
            ShadingPoint {
                bsdf_by_path,
                lobe: lobe_for_lights(lights, &v.bsdf, v.wo),
                sample: path.sample,
                ..v.shading_point(path.ray.time, sample_counts, sample.fit)
            }
        };
        let mut points: Vec<ShadingPoint<'_>> = emptied(std::mem::take(&mut self.spare_points));
        let all = step.vertices.iter().zip(&self.search.active).map(point);
        match &step.shadings {
            None => points.extend(all),
            Some(shadings) => points.extend(all.zip(shadings).filter_map(|(point, s)| {
                let bsdf = s.lit?;
                Some(ShadingPoint { bsdf, lobe: lobe_for_lights(lights, &bsdf, point.wo), ..point })
            })),
        }
        points
    }

    /// Lets the paths at Lambertian vertices that are not in columns be shared.
    fn share(&mut self, step: &Step<'_, '_>, out: &mut [PixelSample]) {
        let Some(reuse) = self.reuse.active() else { return };
        for (path, v) in self.search.active.iter_mut().zip(&step.vertices) {
            let Bsdf::Diffuse(Diffuse { reflectance }) = v.bsdf.bsdf else { continue };
            if v.media != Sides::default() {
                continue;
            }
            let at = Place::new((v.surface.p, v.surface.p_error), (v.bsdf.n, v.bsdf.frame.z), v.wo);
            let radiance = &mut out[path.sample as usize].radiance;
            path.beta = reuse.arrive((path.sample, step.vertex, v.is_next), at, (path.beta, reflectance), radiance);
        }
    }

    /// Adds the direct light of the vertices of the active paths.
    fn light_points(
        &mut self,
        job: &RenderJob,
        step: &Step<'_, '_>,
        points: &[ShadingPoint<'_>],
        fits: &mut Fits,
        out: &mut [PixelSample],
    ) {
        self.direct.estimate(job, &step.estimator, points, fits, &mut self.radiance);
        let active = &self.search.active;
        if let Some(r) = &mut self.search.recording {
            r.segments_at(step.vertex).push(self.direct.segments().clone());
        }
        if let Some(outcomes) = self.outcomes.as_mut().filter(|_| step.vertex == 0) {
            outcomes.extend(self.direct.outcomes().map(|(point, unshadowed, is_free)| {
                let contribution = if is_free { unshadowed } else { Rgb::BLACK };
                Outcome { sample: active[point as usize].sample, unshadowed, contribution }
            }));
        }
        let is_lit = |i: usize| step.shadings.as_ref().is_none_or(|shadings| shadings[i].lit.is_some());
        let lit = active.iter().enumerate().filter(|&(i, _)| is_lit(i)).map(|(_, path)| path);
        for (path, &radiance) in lit.clone().zip(&self.radiance) {
            out[path.sample as usize].radiance += path.beta * radiance;
        }
        let layers = &mut self.search.layers;
        if layers.are_kept() {
            let lit: Vec<&PathState> = lit.collect();
            for (point, (light, wi), contribution) in self.direct.visible() {
                let (path, p) = (lit[point as usize], points[point as usize].light_ctx().p);
                layers.add(&job.lights, path.sample, (light, p, wi), path.beta * contribution);
            }
        }
    }

    /// Fills `self.next` with the paths that go on.
    fn extend_paths(&mut self, step: &Step<'_, '_>, points: &[ShadingPoint<'_>]) {
        let start = Instant::now();
        self.next.clear();
        let Step { settings, vertex, .. } = *step;
        let paths = self.search.active.iter().zip(&step.vertices);
        match &step.shadings {
            _ if !step.continues => {}
            None => self.next.extend(paths.zip(points).filter_map(|((path, v), point)| match &step.estimator {
                Estimator::Mis(mis) if point.bsdf_by_path => extend_to_emitter(path, v, point, vertex, (settings, mis)),
                _ => Some(extend(path, v, vertex, settings)?.0),
            })),
            Some(shadings) => self.next.extend(paths.zip(shadings).filter_map(|((path, v), s)| {
                let (next, lobe) = extend(path, &Vertex { bsdf: s.next?, ..*v }, vertex, settings)?;
                (!self.only_specular || lobe.is_specular()).then_some(next)
            })),
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

//! Path tracing with next-event estimation, a batch of paths at a time; `direct` is the case of one bounce.
//!
//! The radiance along a camera ray is L_e(x₁) + Σ_k β_k L_direct(x_k), where β_k = Π f_s |cos θ|/p is the throughput up
//! to the k-th vertex and L_direct is what [`DirectStage`] estimates there, from all light that reaches
//! the vertex straight from an emitter. So emission is added at the camera ray's hit, and never twice.
//!
//! Where `mis` has one BSDF sample and the path goes on, the sample's direction is that of the next segment, which finds
//! the emitter itself: what is missing in the estimate at x_k, the emission that x_{k+1} sends back weighted against
//! light sampling at x_k, is added there ([`BsdfTechnique`]). One ray instead of three, and one BSDF sample instead of
//! two.

use super::segment::{BsdfTechnique, Direction, PathState, domain, emptied, sampled_direction, survive};
pub use super::segment::{CameraSample, PathStats};
use super::wavefront::{Batch, Buffers, Estimate, Output};
use crate::accel::{Coherence, Hit, RayBatch};
use crate::bsdfs::Lobe;
use crate::direct::estimators::mis::Mis;
use crate::direct::{DirectStage, Estimator, Fits, ShadingPoint};
use crate::film::{Features, PixelSample};
use crate::geometry::SurfaceHit;
use crate::lights::{LightCtx, LightHit};
use crate::materials::SurfaceBsdf;
use crate::scene::{RenderJob, SurfaceInteraction};
use crate::settings::{IntegratorSettings, SampleCounts};
use lumiris_numbers::math::{Ray, Rgb, Vec3};
use lumiris_numbers::samplers::SampleStream;
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
    fn segments_at(&mut self, vertex: u32) -> &mut Vec<RayBatch> {
        if vertex == 0 { &mut self.segments } else { &mut self.bounce_segments }
    }
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

/// Traces paths; holds the buffers of one worker.
#[derive(Debug, Default)]
pub struct PathIntegrator {
    pub(super) active: Vec<PathState>,
    pub(super) next: Vec<PathState>,
    kept: Vec<PathState>,
    passing: Vec<PathState>,
    /// Indices of active paths that meet nothing and look for emitters.
    escaped: Vec<u32>,
    rays: RayBatch,
    hits: Vec<Option<Hit>>,
    /// Memory of the vertices and shading points of earlier batches.
    spare_vertices: Vec<Vertex<'static>>,
    spare_points: Vec<ShadingPoint<'static>>,
    pub(super) radiance: Vec<Rgb>,
    pub(super) direct: DirectStage,
    buffers: Option<Box<Buffers>>,
    pub(super) stats: PathStats,
    /// Omits emission towards the camera, and all features except the depth.
    pub(super) only_reflected: bool,
    /// Omits all features.
    pub omits_features: bool,
    /// Copies of what is traced, if requested.
    pub recording: Option<Recording>,
    /// Samples of direct light at first vertices, if requested.
    pub outcomes: Option<Vec<Outcome>>,
}

impl PathIntegrator {
    /// The counts and times since the last call.
    pub fn take_stats(&mut self) -> PathStats {
        let direct = std::mem::take(&mut self.direct.stats);
        PathStats { direct, ..std::mem::take(&mut self.stats) }
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
        self.start(samples, out);
        let depth = settings.depth();
        for vertex in 0..=depth {
            if self.active.is_empty() {
                break;
            }
            let estimate = Estimate::new(settings, vertex).filter(|_| self.outcomes.is_none());
            let count = self.active.len();
            let mut batch = estimate.map(|e| Batch::new(self.buffers.take().unwrap_or_default(), e, count));
            let vertices = self.find_vertices(job, vertex, depth, samples, out, batch.as_mut());
            let estimator = Estimator::at_vertex(settings, vertex);
            let sample_counts = estimator.sample_counts();
            // Outcomes are those of all samples of a first vertex
            let may_continue = vertex + 1 < depth && (vertex > 0 || self.outcomes.is_none());
            let mut points: Vec<ShadingPoint<'_>> = emptied(std::mem::take(&mut self.spare_points));
            points.extend(vertices.iter().zip(&self.active).map(|(v, path)| {
                let sample = &samples[path.sample as usize];
                let sample_counts = if vertex == 0 { sample.sample_counts } else { sample_counts };
                let bsdf_by_path = may_continue
                    && matches!(estimator, Estimator::Mis(mis) if mis.has_one_bsdf_sample(sample_counts.samples))
                    && !v.bsdf.bsdf.is_only_evaluated();
                ShadingPoint { bsdf_by_path, ..v.shading_point(path.ray.time, sample_counts, sample.fit) }
            }));
            self.light_points(job, &estimator, vertex, &points, fits, out);
            self.extend_paths((settings, &estimator), vertex, &vertices, &points);
            if let Some(mut batch) = batch {
                let segments = self.recording.as_mut().map(|r| r.segments_at(vertex));
                let (next, stats, direct) = (&mut self.next, &mut self.stats, &mut self.direct.stats);
                batch.shade(job, &mut Output { samples: out, next, stats, direct, segments });
                self.buffers = Some(batch.into_buffers());
            }
            std::mem::swap(&mut self.active, &mut self.next);
            self.spare_points = emptied(points);
            self.recycle(vertices);
        }
    }

    /// Starts paths with the camera rays.
    pub(super) fn start(&mut self, samples: &[CameraSample], out: &mut Vec<PixelSample>) {
        out.clear();
        out.resize(samples.len(), PixelSample::default());
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
        }));
    }

    /// Keeps the memory of vertices that are done with for those of the next batch.
    pub(super) fn recycle(&mut self, vertices: Vec<Vertex<'_>>) {
        self.spare_vertices = emptied(vertices);
    }

    /// Traces the active paths to their next vertex, adds what they see at the first one, and keeps those that hit
    /// something that scatters. The answer's items belong to the paths that `self.active` then holds.
    pub(super) fn find_vertices<'w>(
        &mut self,
        job: &'w RenderJob,
        vertex: u32,
        depth: u32,
        samples: &[CameraSample],
        out: &mut [PixelSample],
        mut batch: Option<&mut Batch<'w>>,
    ) -> Vec<Vertex<'w>> {
        let mut vertices: Vec<Vertex<'w>> = emptied(std::mem::take(&mut self.spare_vertices));
        self.kept.clear();
        let mut coherence = if vertex == 0 { Coherence::Coherent } else { Coherence::Incoherent };
        while !self.active.is_empty() {
            self.trace_active(job, vertex, coherence);
            coherence = Coherence::Incoherent;
            let start = Instant::now();
            self.passing.clear();
            self.escaped.clear();
            for (k, (path, hit)) in self.active.iter().zip(&self.hits).enumerate() {
                let looks_for_emitters = path.technique.is_some() || vertex == 0 && !self.only_reflected;
                let interaction = match hit {
                    None => {
                        if looks_for_emitters {
                            self.escaped.push(k as u32);
                        }
                        continue;
                    }
                    Some(hit) => {
                        if let (Some(batch), Some(rho)) = (&mut batch, job.plain_reflectance(hit)) {
                            let Some(beta) = path.beta_beyond_emitter() else { continue };
                            let distance = hit.t * path.ray.d.length();
                            if vertex == 0 && !self.omits_features {
                                let features = &mut out[path.sample as usize].features;
                                features.get_or_insert_with(|| path.plain_features(job, hit, distance, rho));
                            }
                            if vertex < depth {
                                let carried = path.carried(beta, path.width + path.spread * distance);
                                batch.push_hit(job, (&carried, path.ray.d), hit, rho, &samples[path.sample as usize]);
                            }
                            continue;
                        }
                        SurfaceInteraction::new(job, &path.ray, (path.width, path.spread), hit)
                    }
                };
                if looks_for_emitters {
                    out[path.sample as usize].radiance += path.emission(job, &interaction);
                }
                let Some(beta) = path.beta_beyond_emitter() else { continue };
                match interaction.scatter(job) {
                    Some(bsdf) => {
                        if vertex == 0 && !self.omits_features {
                            let depth_only = self.only_reflected;
                            out[path.sample as usize].features.get_or_insert_with(|| {
                                if depth_only {
                                    Features { depth: path.depth(&interaction), ..Features::default() }
                                } else {
                                    let stream = samples[path.sample as usize].stream.domain(domain::VERTEX);
                                    path.features(job, &interaction, &bsdf, &stream)
                                }
                            });
                        }
                        if vertex < depth {
                            let sample = &samples[path.sample as usize];
                            let width = interaction.width;
                            let carried = path.carried(beta, width);
                            if batch.as_mut().is_some_and(|b| b.push_vertex(&carried, &interaction, &bsdf, sample)) {
                                continue;
                            }
                            let [stream, direct] =
                                [sample.stream, sample.direct].map(|s| s.domain(domain::VERTEX + vertex));
                            vertices.push(Vertex {
                                surface: interaction.surface,
                                bsdf,
                                wo: interaction.wo,
                                stream,
                                direct,
                            });
                            self.kept.push(PathState {
                                beta,
                                width,
                                passed: 0,
                                travelled: 0.0,
                                technique: None,
                                ..*path
                            });
                        }
                    }
                    None if path.passed < MAX_PASSED => self.passing.push(path.pass(beta, &interaction)),
                    None => {}
                }
            }
            self.add_infinite(job, out);
            std::mem::swap(&mut self.active, &mut self.passing);
            self.stats.shade_time += start.elapsed();
        }
        std::mem::swap(&mut self.active, &mut self.kept);
        vertices
    }

    /// Adds what the escaped paths carry of infinite lights, with the weight of the technique that found it.
    fn add_infinite(&mut self, job: &RenderJob, out: &mut [PixelSample]) {
        let (lights, active) = (&job.lights, &self.active);
        self.escaped.retain(|&k| {
            let path = &active[k as usize];
            if path.technique.is_none() {
                out[path.sample as usize].radiance += path.beta * lights.le(path.ray.d);
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
            },
        );
    }

    /// First hits of the active paths.
    fn trace_active(&mut self, job: &RenderJob, vertex: u32, coherence: Coherence) {
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

    /// Adds the direct light of the vertices of the active paths.
    fn light_points(
        &mut self,
        job: &RenderJob,
        estimator: &Estimator,
        vertex: u32,
        points: &[ShadingPoint<'_>],
        fits: &mut Fits,
        out: &mut [PixelSample],
    ) {
        self.direct.estimate(job, estimator, points, fits, &mut self.radiance);
        if let Some(r) = &mut self.recording {
            r.segments_at(vertex).push(self.direct.segments().clone());
        }
        if let Some(outcomes) = self.outcomes.as_mut().filter(|_| vertex == 0) {
            outcomes.extend(self.direct.outcomes().map(|(point, unshadowed, is_free)| {
                let contribution = if is_free { unshadowed } else { Rgb::BLACK };
                Outcome { sample: self.active[point as usize].sample, unshadowed, contribution }
            }));
        }
        for (path, &radiance) in self.active.iter().zip(&self.radiance) {
            out[path.sample as usize].radiance += path.beta * radiance;
        }
    }

    /// Fills `self.next` with the paths that go on.
    fn extend_paths(
        &mut self,
        (settings, estimator): (&IntegratorSettings, &Estimator),
        vertex: u32,
        vertices: &[Vertex<'_>],
        points: &[ShadingPoint<'_>],
    ) {
        let depth = settings.depth();
        let start = Instant::now();
        self.next.clear();
        if vertex + 1 < depth {
            let paths = self.active.iter().zip(vertices).zip(points);
            self.next.extend(paths.filter_map(|((path, v), point)| {
                if let (true, Estimator::Mis(mis)) = (point.bsdf_by_path, estimator) {
                    return extend_to_emitter(path, v, point, vertex, (settings, mis));
                }
                Some(extend(path, v, point, vertex, settings)?.0)
            }));
        }
        self.stats.shade_time += start.elapsed();
    }
}

/// A vertex that scatters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex<'w> {
    pub(super) surface: SurfaceHit,
    pub(super) bsdf: SurfaceBsdf<'w>,
    pub(super) wo: Vec3,
    pub(super) stream: SampleStream,
    pub(super) direct: SampleStream,
}

impl<'w> Vertex<'w> {
    pub(super) fn shading_point(&self, time: f32, sample_counts: SampleCounts, fit: u32) -> ShadingPoint<'w> {
        ShadingPoint {
            p: self.surface.p,
            p_error: self.surface.p_error,
            wo: self.wo,
            bsdf: self.bsdf,
            time,
            stream: self.direct.domain(domain::DIRECT),
            sample_counts,
            fit,
            bsdf_by_path: false,
        }
    }
}

/// The next path segment by BSDF sampling and Russian roulette, with the lobe that it took; `None` if the path ends.
pub(super) fn extend(
    path: &PathState,
    v: &Vertex<'_>,
    point: &ShadingPoint<'_>,
    vertex: u32,
    settings: &IntegratorSettings,
) -> Option<(PathState, Lobe)> {
    let direction = next_direction(v, settings)?;
    let carried = path.carried(path.beta, path.width);
    let (beta, eta_scale) = carried.beyond(&direction)?;
    let beta = survive(beta, eta_scale, &v.stream, vertex + 1, settings)?;
    let next = carried.segment(point.origin(direction.wi), direction.wi, beta, eta_scale);
    Some((next, direction.lobe))
}

/// The next path segment by BSDF sampling, which looks for the emitter of the sample as well. Roulette ends it only behind
/// that; `None` if the direction carries no light.
fn extend_to_emitter(
    path: &PathState,
    v: &Vertex<'_>,
    point: &ShadingPoint<'_>,
    vertex: u32,
    (settings, mis): (&IntegratorSettings, &Mis),
) -> Option<PathState> {
    let direction = next_direction(v, settings)?;
    let carried = path.carried(path.beta, path.width);
    let (beta, eta_scale) = carried.beyond(&direction)?;
    debug_assert!(direction.pdf.is_some(), "a resampled direction has no weight against light sampling");
    let technique = BsdfTechnique {
        ctx: point.light_ctx(),
        n_light: point.light_samples_beside_path() as f32,
        pdf: direction.pdf.filter(|_| !direction.lobe.is_specular()),
        heuristic: mis.heuristic,
        survivor: survive(beta, eta_scale, &v.stream, vertex + 1, settings),
    };
    let next = carried.segment(point.origin(direction.wi), direction.wi, beta, eta_scale);
    Some(PathState { technique: Some(technique), ..next })
}

/// A direction by BSDF sampling; of a BSDF that can only be evaluated, by resampling M proposals.
fn next_direction(v: &Vertex<'_>, settings: &IntegratorSettings) -> Option<Direction> {
    if v.bsdf.bsdf.is_only_evaluated() {
        let count = settings.bsdf_proposals.max(1);
        let proposal = |i| v.stream.split(domain::BSDF, count, i).draw::<3>();
        let [u_choice] = v.stream.domain(domain::RESAMPLE).draw::<1>();
        let r = v.bsdf.resample(v.wo, count, proposal, u_choice)?;
        return Some(Direction {
            wi: r.wi,
            weight: r.f * (v.bsdf.cos(r.wi) * r.weight),
            eta: r.eta,
            lobe: r.lobe,
            pdf: None,
        });
    }
    sampled_direction(&v.bsdf, v.wo, v.stream.domain(domain::BSDF).draw::<3>())
}

impl PathState {
    /// What the path carries of the emission of a surface, with the weight of the technique that found it.
    fn emission(&self, job: &RenderJob, interaction: &SurfaceInteraction) -> Rgb {
        let lights = &job.lights;
        if interaction.hit.instance != Hit::NO_INSTANCE {
            return Rgb::BLACK;
        }
        let Some(light) = lights.light_of(interaction.hit.geometry, interaction.hit.primitive) else {
            return Rgb::BLACK;
        };
        let s = &interaction.surface;
        let hit = LightHit { t: self.depth(interaction), p: s.p, n: s.n, uv: s.uv };
        let l = self.beta * lights.lights[light as usize].l(&hit, interaction.wo);
        match &self.technique {
            Some(technique) if !l.is_black() => l * technique.weight(|ctx| lights.pdf(ctx, light, self.ray.d, &hit)),
            _ => l,
        }
    }

    /// The throughput beyond what the last segment has hit; `None` if roulette ends the path there.
    #[inline]
    fn beta_beyond_emitter(&self) -> Option<Rgb> {
        match &self.technique {
            Some(technique) if self.passed == 0 => technique.survivor,
            _ => Some(self.beta),
        }
    }

    /// Features of a hit of a mesh that reflects `rho`, without the normal.
    fn plain_features(&self, job: &RenderJob, hit: &Hit, distance: f32, rho: Rgb) -> Features {
        Features {
            albedo: rho,
            normal: Vec3::ZERO,
            depth: self.travelled + distance,
            material: job.world.scene.surfaces[hit.geometry as usize].material,
            object: hit.geometry,
        }
    }

    fn features(
        &self,
        job: &RenderJob,
        interaction: &SurfaceInteraction,
        bsdf: &SurfaceBsdf<'_>,
        stream: &SampleStream,
    ) -> Features {
        let z = bsdf.frame.z;
        Features {
            albedo: bsdf.albedo_estimate(interaction.wo, || stream.domain(domain::ALBEDO).draw::<3>()),
            normal: if z.dot(interaction.wo) < 0.0 { -z } else { z },
            depth: self.depth(interaction),
            material: job.world.scene.surfaces[interaction.hit.geometry as usize].material,
            object: interaction.hit.geometry,
        }
    }

    /// Distance from the camera along the ray.
    fn depth(&self, interaction: &SurfaceInteraction) -> f32 {
        self.travelled + interaction.distance
    }

    /// The path beyond a surface that does not scatter, with the throughput `beta`.
    fn pass(&self, beta: Rgb, interaction: &SurfaceInteraction) -> PathState {
        PathState {
            beta,
            ray: Ray { o: interaction.origin(self.ray.d), ..self.ray },
            width: interaction.width,
            passed: self.passed + 1,
            travelled: self.travelled + interaction.distance,
            ..*self
        }
    }
}

//! The vertices of a batch of paths side by side, for estimators that trace every sample that they draw.
//!
//! ```text
//! hits ─points─▶ vertices ─light samples─▶ f·cos, weights ─segments─▶ T2 ─▶ radiance
//!                         └BSDF samples──▶ rays of the next vertex, or emitters among which they are looked up
//! ```
//!
//! Each step is a loop over columns. What nearly all vertices have in common is a kernel: points of triangles,
//! Lambertian reflection, weights, segments, and the random numbers. What is particular to few is done one by one, and
//! written into the same columns: other shapes, textured reflectance, and all other BSDFs. A vertex whose estimate has
//! another form than that of its neighbours (resampled or purely specular BSDFs) is left to [`crate::direct`].
//!
//! Reading order: [`columns`], [`emitters`] (what BSDF samples point at), [`controls`] (control variates, for `ocv`),
//! [`buffers`] (kernels over the columns); this file goes through the steps.

mod buffers;
mod columns;
mod controls;
mod emitters;

pub(super) use buffers::Buffers;
use buffers::Stream;
use columns::{Single, Surface, others};

use super::light_layers::LayerSums;
use super::light_paths::Guide;
use super::reuse::{Place, Reuse};
use super::segment::{
    BsdfTechnique, Carried, Direction, PathState, PathStats, domain, emptied, sampled_direction, survive,
};
use crate::accel::{Coherence, Hit, RayBatch};
use crate::bsdfs::{Bsdf, Diffuse, Lobe};
use crate::direct::estimators::ocv::Ocv;
use crate::direct::{self, DirectStats, Estimator, Fits, lobe_for_lights};
use crate::film::PixelSample;
use crate::geometry::Shape;
use crate::lights::{GlossyLobe, LightSampling};
use crate::materials::SurfaceBsdf;
use crate::scene::{RenderJob, SurfaceInteraction};
use crate::settings::{IntegratorSettings, OcvForm};
use lumiris_lanes::columns::padded;
use lumiris_lanes::lane::LANES;
use lumiris_lanes::level;
use lumiris_lanes::vertex as kernels;
use lumiris_numbers::estimators::mis::Heuristic;
use lumiris_numbers::math::ray::offset_origin;
use lumiris_numbers::math::{Rgb, Vec3};
use lumiris_numbers::samplers::SampleStream;
use std::time::{Duration, Instant};

/// The samples of an estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Counts {
    light: u32,
    bsdf: u32,
    /// The only BSDF sample is the next segment of the path.
    by_path: bool,
}

/// The estimates at one vertex of all paths.
#[derive(Clone, Copy, Debug)]
pub(super) struct Estimate {
    counts: Counts,
    /// Weights of the techniques.
    heuristic: Heuristic,
    settings: IntegratorSettings,
    /// Index of the vertex along the path.
    vertex: u32,
    /// The path goes on.
    continues: bool,
    /// Control variates are determined as well.
    has_controls: bool,
}

impl Estimate {
    /// The estimates at vertex `vertex`, if they can be made side by side.
    pub(super) fn new(settings: &IntegratorSettings, vertex: u32) -> Option<Self> {
        let continues = vertex + 1 < settings.depth();
        let estimator = Estimator::at_vertex(settings, vertex);
        let (counts, heuristic) = match estimator {
            // A single technique has the weight 1 by any heuristic
            Estimator::Mc(mc) => (Counts { light: mc.samples, bsdf: 0, by_path: false }, Heuristic::Balance),
            Estimator::Mis(mis) if mis.samples >= 2 => {
                let (n, bsdf) = (mis.samples, mis.bsdf_samples(mis.samples));
                let by_path = continues && mis.has_one_bsdf_sample(n);
                (Counts { light: n - bsdf, bsdf, by_path }, mis.heuristic)
            }
            Estimator::Ocv(Ocv { mis, form: OcvForm::Pixels }) if mis.samples >= 2 => {
                let (n, bsdf) = (mis.samples, mis.bsdf_samples(mis.samples));
                (Counts { light: n - bsdf, bsdf, by_path: false }, mis.heuristic)
            }
            _ => return None,
        };
        let has_controls = estimator.is_over_pixels();
        Some(Estimate { counts, heuristic, settings: *settings, vertex, continues, has_controls })
    }

    /// True if vertices of this BSDF have as many samples of each technique as all others.
    fn takes(&self, bsdf: &Bsdf<'_>) -> bool {
        let alike = self.counts.by_path || bsdf.has_non_specular() && (self.counts.bsdf > 0 || !bsdf.has_specular());
        alike && !bsdf.is_only_evaluated()
    }

    /// Numbers of light and BSDF samples, for weights.
    fn n(&self) -> [f32; 2] {
        [self.counts.light as f32, self.counts.bsdf as f32]
    }
}

/// The vertices of a batch of paths, which have the same index along their paths.
pub(super) struct Batch<'w> {
    estimate: Estimate,
    singles: Vec<Single<'w>>,
    buffers: Box<Buffers>,
}

/// What the paths and their counts are added to.
pub(super) struct Output<'a> {
    pub(super) samples: &'a mut [PixelSample],
    pub(super) fits: &'a mut Fits,
    pub(super) next: &'a mut Vec<PathState>,
    pub(super) stats: &'a mut PathStats,
    pub(super) direct: &'a mut DirectStats,
    /// Copies of the segments, if requested.
    pub(super) segments: Option<&'a mut Vec<RayBatch>>,
    /// Takes the vertices of paths that pixels share, if they do.
    pub(super) reuse: Option<&'a mut Reuse>,
    /// Takes what is of each light group, if that is kept.
    pub(super) layers: &'a mut LayerSums,
    /// Of the light paths that bring a part of the light, if any do.
    pub(super) guide: Option<&'a Guide>,
}

impl<'w> Batch<'w> {
    /// At most `count` vertices.
    pub(super) fn new(mut buffers: Box<Buffers>, estimate: Estimate, count: usize) -> Self {
        buffers.begin(padded(count));
        let singles = emptied(std::mem::take(&mut buffers.spare_singles));
        Batch { estimate, singles, buffers }
    }

    /// The buffers of a batch that is done with.
    pub(super) fn into_buffers(mut self) -> Box<Buffers> {
        self.buffers.spare_singles = emptied(self.singles);
        self.buffers
    }

    /// Adds the vertex where `path` has hit a mesh in world space that reflects `rho` everywhere.
    #[inline]
    pub(super) fn push_hit(
        &mut self,
        job: &RenderJob,
        (path, d): (&Carried, Vec3),
        hit: &Hit,
        rho: Rgb,
        streams: [SampleStream; 2],
    ) {
        let Shape::Mesh(mesh) = &job.world.scene.geometry.geometries[hit.geometry as usize].shape else { return };
        let i = self.buffers.paths.len();
        let (hits, k) = (&mut self.buffers.hits[i / LANES], i % LANES);
        let vertices = mesh.indices[hit.primitive as usize];
        for (rows, p) in hits.corners.iter_mut().zip(mesh.corners(vertices)) {
            set_lane(rows, k, p);
        }
        if mesh.normals.is_empty() {
            hits.normals.iter_mut().for_each(|rows| set_lane(rows, k, Vec3::ZERO));
        } else {
            for (rows, v) in hits.normals.iter_mut().zip(vertices) {
                set_lane(rows, k, mesh.normals[v as usize]);
            }
        }
        [hits.b[0][k], hits.b[1][k]] = hit.uv;
        hits.orientation[k] = if mesh.flip_normal { -1.0 } else { 1.0 };
        set_lane(&mut hits.d, k, d);
        self.buffers.surface.rho.set_rgb(i, rho);
        self.push(path, streams);
    }

    /// Adds any other vertex; false if it needs an estimate of another form.
    #[inline]
    pub(super) fn push_vertex(
        &mut self,
        path: &Carried,
        interaction: &SurfaceInteraction,
        bsdf: &SurfaceBsdf<'w>,
        streams: [SampleStream; 2],
    ) -> bool {
        if !self.estimate.takes(&bsdf.bsdf) {
            return false;
        }
        let (index, s) = (self.buffers.paths.len() as u32, &interaction.surface);
        self.singles.push(Single { index, p: s.p, p_error: s.p_error, wo: interaction.wo, bsdf: *bsdf });
        self.push(path, streams);
        true
    }

    #[inline]
    fn push(&mut self, path: &Carried, [stream, direct]: [SampleStream; 2]) {
        let key = domain::VERTEX + self.estimate.vertex;
        self.buffers.paths.push(*path);
        self.buffers.streams.push(stream.domain(key));
        self.buffers.direct.push(direct.domain(key).domain(domain::DIRECT));
    }

    /// Adds the direct light of all vertices, and the next segments of their paths.
    pub(super) fn shade(&mut self, job: &RenderJob, out: &mut Output<'_>) {
        let Counts { light, bsdf, by_path } = self.estimate.counts;
        let n = self.buffers.paths.len();
        if n == 0 {
            return;
        }
        self.buffers.radiance.get_mut(padded(n)).into_iter().for_each(|c| c.fill(0.0));
        let start = Instant::now();
        self.buffers.find_points(n);
        self.set_singles(&job.lights);
        if self.estimate.vertex == 0 {
            self.buffers.set_normals(out.samples);
        }
        self.share(out);
        let Buffers { scratch, controls, surface, .. } = &mut *self.buffers;
        scratch.begin(&job.lights, n, surface.lit_points());
        if self.estimate.has_controls {
            controls.begin(job, n, (surface, scratch), &self.singles);
        }
        out.stats.shade_time += start.elapsed();

        for k in 0..light {
            let start = Instant::now();
            self.sample_lights(job, out.guide, k);
            let t1 = self.trace(job, out, (true, start));
            out.direct.t1_light += t1;
            self.add_controls(job, true);
        }
        let bsdf = if by_path { 0 } else { bsdf };
        for k in 0..bsdf {
            let start = Instant::now();
            out.direct.emitter_rays += self.sample_bsdfs(job, k);
            self.trace(job, out, (false, start));
            self.add_controls(job, false);
        }
        out.direct.proposals += (n as u64) * u64::from(light + bsdf);
        out.direct.light_proposals += (n as u64) * u64::from(light);

        let start = Instant::now();
        for (i, path) in self.buffers.paths.iter().enumerate() {
            let radiance = self.buffers.radiance.rgb(i);
            out.samples[path.sample as usize].radiance += path.beta * radiance;
            if self.estimate.has_controls {
                let controls = &self.buffers.controls.of(i)[..job.controls()];
                let value = job.world.scene.film.balanced(radiance).to_array();
                out.fits.set_controls(path.sample, value, controls);
            }
        }
        if self.estimate.continues {
            self.extend(out.next);
        }
        out.stats.shade_time += start.elapsed();
    }

    /// Adds the last sample of each vertex to its control variates, if there are any.
    fn add_controls(&mut self, job: &RenderJob, by_light: bool) {
        if !self.estimate.has_controls {
            return;
        }
        let Buffers { controls, samples, traced, scratch, emitter_rays, .. } = &mut *self.buffers;
        if by_light {
            controls.add_light_samples(job, self.estimate.n(), (samples, traced, scratch), &self.singles);
        } else {
            controls.add_bsdf_samples(job, self.estimate.n(), (samples, emitter_rays), &self.singles);
        }
    }

    /// Writes the singles into the columns.
    fn set_singles(&mut self, lights: &LightSampling) {
        let Surface { p, p_error, n, lit, ns, lobes, wo, rho } = &mut self.buffers.surface;
        lobes.clear();
        if lights.sampler.needs_lobes() && others(&self.singles).next().is_some() {
            lobes.resize(self.buffers.paths.len(), GlossyLobe::NONE);
            for single in others(&self.singles) {
                lobes[single.index as usize] = lobe_for_lights(lights, &single.bsdf, single.wo);
            }
        }
        for single in &self.singles {
            let (i, bsdf) = (single.index as usize, &single.bsdf);
            p.set(i, single.p);
            p_error.set(i, single.p_error);
            n.set(i, bsdf.n);
            lit.set(i, bsdf.lit_normal(single.wo));
            ns.set(i, bsdf.frame.z);
            wo.set(i, single.wo);
            rho.set_rgb(
                i,
                if let Bsdf::Diffuse(Diffuse { reflectance }) = bsdf.bsdf { reflectance } else { Rgb::BLACK },
            );
        }
    }

    /// Lets the paths at Lambertian vertices be shared.
    fn share(&mut self, out: &mut Output<'_>) {
        let Some(reuse) = &mut out.reuse else { return };
        let Buffers { paths, surface, samples, .. } = &mut *self.buffers;
        let is_lambertian = &mut samples.light.is_delta;
        is_lambertian[..paths.len()].fill(true);
        others(&self.singles).for_each(|single| is_lambertian[single.index as usize] = false);
        for (i, path) in paths.iter_mut().enumerate().filter(|(i, _)| is_lambertian[*i]) {
            let point = (surface.p.vec3(i), surface.p_error.vec3(i));
            let at = Place::new(point, (surface.n.vec3(i), surface.ns.vec3(i)), surface.wo.vec3(i));
            let radiance = &mut out.samples[path.sample as usize].radiance;
            let arrival = (path.sample, self.estimate.vertex, path.passed == 0);
            path.beta = reuse.arrive(arrival, at, (path.beta, surface.rho.rgb(i)), radiance);
        }
    }

    /// Light sample `k` of each vertex: contributions and segments.
    fn sample_lights(&mut self, job: &RenderJob, guide: Option<&Guide>, k: u32) {
        let n = self.buffers.paths.len();
        let only = job.lights.sampler.only_light();
        self.buffers.draw(Stream::Direct(direct::domain::LIGHT, self.estimate.counts.light, k));
        let Buffers { paths, surface, samples, scratch, .. } = &mut *self.buffers;
        job.lights.sample_many(n, surface.lit_points(), &samples.u, scratch, &mut samples.light);

        let len = padded(n);
        let at = surface.lambertian(len);
        let (wi, p_bsdf) = (samples.light.wi.get(len), &mut samples.p_bsdf[..len]);
        kernels::evaluate_lambertian(level(), &at, wi, &mut samples.f_cos.get_mut(len), p_bsdf);
        for single in others(&self.singles) {
            let i = single.index as usize;
            if samples.light.pdf[i] > 0.0 {
                let wi = samples.light.wi.vec3(i);
                let (mut f_cos, pdf) = single.bsdf.f_cos_and_pdf(single.wo, wi);
                if let Some(guide) = guide.filter(|_| paths[i].chain.is_caustic() && samples.light.is_far[i] == 0.0) {
                    let light = only.unwrap_or_else(|| scratch.chosen(i));
                    f_cos *= paths[i].chain.rest(guide.density(light, samples.light.n.vec3(i), -wi));
                }
                samples.f_cos.set_rgb(i, f_cos);
                samples.p_bsdf[i] = pdf;
            }
        }
        for (p, is_delta) in samples.p_bsdf.iter_mut().zip(&samples.light.is_delta) {
            *p = if *is_delta { 0.0 } else { *p };
        }
        self.buffers.weigh(n, self.estimate.n(), self.estimate.heuristic, true);
    }

    /// BSDF sample `k` of each vertex and the emitter in its direction: contributions and segments. Returns the number of
    /// rays among the emitters.
    fn sample_bsdfs(&mut self, job: &RenderJob, k: u32) -> u64 {
        let n = self.buffers.paths.len();
        let len = padded(n);
        self.buffers.draw(Stream::Direct(direct::domain::BSDF, self.estimate.counts.bsdf, k));
        self.buffers.sample_lambertian(len);
        let Buffers { paths, surface, samples, emitter_rays, .. } = &mut *self.buffers;
        for (f_cos, rho) in samples.f_cos.get_mut(n).into_iter().zip(surface.rho.get(n)) {
            for ((f_cos, rho), pdf) in f_cos.iter_mut().zip(rho).zip(&samples.p_bsdf) {
                *f_cos = rho * pdf;
            }
        }
        samples.light.is_delta[..n].fill(false);
        for single in others(&self.singles) {
            let i = single.index as usize;
            let u = samples.u.each_ref().map(|u| u[i]);
            let drawn = single.bsdf.sample(single.wo, u[0], [u[1], u[2]]);
            samples.p_bsdf[i] = drawn.map_or(0.0, |s| s.pdf);
            let Some(drawn) = drawn else { continue };
            samples.light.wi.set(i, drawn.wi);
            samples.light.is_delta[i] = drawn.lobe.is_specular();
            samples.f_cos.set_rgb(i, drawn.f * single.bsdf.cos(drawn.wi));
        }
        surface.origins(samples, len);

        let count = emitter_rays.find(job, paths, surface, samples);
        self.buffers.weigh(n, self.estimate.n(), self.estimate.heuristic, false);
        count
    }

    /// Traces the segments of the samples that contribute, of light or of BSDF sampling, and adds the contributions of those
    /// that are unoccluded. Returns the time since `start`, when sampling began, until tracing began.
    fn trace(&mut self, job: &RenderJob, out: &mut Output<'_>, (by_light, start): (bool, Instant)) -> Duration {
        let n = self.buffers.paths.len();
        // Without a weight, a light sample that an emitter hides has columns of its own all the same
        let hides = by_light && self.estimate.has_controls && job.world.emitters_hide();
        self.buffers.make_segments(n, |samples, i| {
            !samples.c.rgb(i).is_black() || hides && samples.p_bsdf[i] > 0.0 && samples.has_integrand(i, true)
        });
        let Buffers { samples, traced, radiance, .. } = &mut *self.buffers;
        let proposed = Instant::now();
        job.world.accel.occluded(&traced.rays, Coherence::Packets, &mut traced.occluded);
        let traced_at = Instant::now();
        for (&i, _) in traced.index.iter().zip(&traced.occluded).filter(|(_, occluded)| !**occluded) {
            let i = i as usize;
            radiance.set_rgb(i, radiance.rgb(i) + samples.c.rgb(i));
        }
        if out.layers.are_kept() {
            self.buffers.add_to_layers(job, by_light, out.layers);
        }
        let traced = &self.buffers.traced;
        if let Some(segments) = &mut out.segments {
            segments.push(traced.rays.clone());
        }
        out.direct.segments += traced.rays.len() as u64;
        out.direct.t1 += proposed - start;
        out.direct.t2 += traced_at - proposed;
        out.direct.select += traced_at.elapsed();
        proposed - start
    }

    /// The next segments of the paths, by BSDF sampling.
    fn extend(&mut self, next: &mut Vec<PathState>) {
        let n = self.buffers.paths.len();
        let len = padded(n);
        self.buffers.draw(Stream::Vertex(domain::BSDF));
        self.buffers.sample_lambertian(len);
        let Estimate { counts, heuristic, settings, vertex, .. } = &self.estimate;
        let Buffers { paths, streams, surface, samples, .. } = &mut *self.buffers;
        // Those follow below
        others(&self.singles).for_each(|single| samples.p_bsdf[single.index as usize] = 0.0);
        surface.origins(samples, len);
        let mut follow = |i: usize, direction: &Direction, o: Vec3, n_light: u32, n: Vec3| {
            let Some((beta, eta_scale)) = paths[i].beyond(direction) else { return };
            let survivor = survive(beta, eta_scale, &streams[i], vertex + 1, settings);
            let chain = paths[i].chain_beyond(n, direction);
            if counts.by_path {
                let pdf = direction.pdf.filter(|_| !direction.lobe.is_specular());
                let (ctx, heuristic) = (surface.lit_points().get(i), *heuristic);
                let technique = BsdfTechnique { ctx, n_light: n_light as f32, pdf, heuristic, survivor };
                let segment = paths[i].segment(o, direction.wi, beta, eta_scale);
                next.push(PathState { technique: Some(technique), chain, ..segment });
            } else if let Some(beta) = survivor {
                next.push(PathState { chain, ..paths[i].segment(o, direction.wi, beta, eta_scale) });
            }
        };
        for i in (0..n).filter(|&i| samples.p_bsdf[i] > 0.0) {
            let direction = Direction {
                wi: samples.light.wi.vec3(i),
                weight: surface.rho.rgb(i),
                eta: 1.0,
                lobe: Lobe::DIFFUSE | Lobe::REFLECTION,
                pdf: Some(samples.p_bsdf[i]),
            };
            follow(i, &direction, samples.o.vec3(i), counts.light, surface.n.vec3(i));
        }
        for single in others(&self.singles) {
            let (i, bsdf) = (single.index as usize, &single.bsdf);
            let u = samples.u.each_ref().map(|u| u[i]);
            let Some(direction) = sampled_direction(bsdf, single.wo, u) else { continue };
            let o = offset_origin(single.p, single.p_error, bsdf.n, direction.wi);
            let n_light = if bsdf.bsdf.has_non_specular() { counts.light } else { 0 };
            follow(i, &direction, o, n_light, bsdf.n);
        }
    }
}

/// Sets a vector of a lane.
#[inline]
fn set_lane(rows: &mut [[f32; LANES]; 3], k: usize, v: Vec3) {
    (rows[0][k], rows[1][k], rows[2][k]) = v.into();
}

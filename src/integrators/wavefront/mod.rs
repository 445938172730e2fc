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

use super::segment::{
    BsdfTechnique, CameraSample, Carried, Direction, PathState, PathStats, domain, emptied, sampled_direction, survive,
};
use crate::accel::{Coherence, Hit, RayBatch};
use crate::bsdfs::{Bsdf, Diffuse, Lobe};
use crate::direct::{self, DirectStats, EmitterInDirection, Estimator};
use crate::film::PixelSample;
use crate::geometry::Shape;
use crate::lights::many::{LightSamples, LitPoints, Scratch};
use crate::materials::SurfaceBsdf;
use crate::scene::{EmitterHit, EmitterScratch, RenderJob, SurfaceInteraction};
use crate::settings::IntegratorSettings;
use lumiris_lanes::columns::{Column, Columns3, padded, reserve};
use lumiris_lanes::lane::LANES;
use lumiris_lanes::vertex::{self as kernels, Ends, Lambertian, Points, Rays, Samples, TriangleHits};
use lumiris_lanes::{level, sampler};
use lumiris_numbers::estimators::mis::Heuristic;
use lumiris_numbers::math::ray::offset_origin;
use lumiris_numbers::math::{Ray, Rgb, Vec3};
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
}

impl Estimate {
    /// The estimates at vertex `vertex`, if they can be made side by side.
    pub(super) fn new(settings: &IntegratorSettings, vertex: u32) -> Option<Self> {
        let continues = vertex + 1 < settings.depth();
        let (counts, heuristic) = match Estimator::at_vertex(settings, vertex) {
            // A single technique has the weight 1 by any heuristic
            Estimator::Mc(mc) => (Counts { light: mc.samples, bsdf: 0, by_path: false }, Heuristic::Balance),
            Estimator::Mis(mis) if mis.samples >= 2 => {
                let (n, bsdf) = (mis.samples, mis.bsdf_samples(mis.samples));
                let by_path = continues && mis.has_one_bsdf_sample(n);
                (Counts { light: n - bsdf, bsdf, by_path }, mis.heuristic)
            }
            _ => return None,
        };
        Some(Estimate { counts, heuristic, settings: *settings, vertex, continues })
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

/// A vertex that the kernels do not determine.
#[derive(Clone, Copy, Debug)]
struct Single<'w> {
    /// Its place in the columns.
    index: u32,
    p: Vec3,
    p_error: Vec3,
    wo: Vec3,
    bsdf: SurfaceBsdf<'w>,
}

impl Single<'_> {
    fn is_lambertian(&self) -> bool {
        matches!(self.bsdf.bsdf, Bsdf::Diffuse(_))
    }
}

/// Vertices that the kernels of Lambertian reflection leave out.
fn others<'s, 'w>(singles: &'s [Single<'w>]) -> impl Iterator<Item = &'s Single<'w>> {
    singles.iter().filter(|single| !single.is_lambertian())
}

/// The vertices of a batch of paths, which have the same index along their paths.
pub(super) struct Batch<'w> {
    estimate: Estimate,
    singles: Vec<Single<'w>>,
    buffers: Box<Buffers>,
}

/// What the next batch needs as well.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    paths: Vec<Carried>,
    /// Random numbers of the vertices, and of their direct light.
    streams: Vec<SampleStream>,
    direct: Vec<SampleStream>,
    /// What determines points, so many at a time as lanes.
    hits: Vec<TriangleHits>,
    surface: Surface,
    /// Direct light.
    radiance: Columns3,
    samples: SampleColumns,
    drawn: Vec<SampleStream>,
    scratch: Scratch,
    traced: Traced,
    emitter_rays: EmitterRays,
    spare_singles: Vec<Single<'static>>,
}

/// Points of surfaces, and Lambertian reflection there.
#[derive(Debug, Default)]
struct Surface {
    p: Columns3,
    p_error: Columns3,
    n: Columns3,
    /// The normal on the side that is lit; zero if both are.
    lit: Columns3,
    ns: Columns3,
    wo: Columns3,
    rho: Columns3,
}

/// Samples of one technique, one for each vertex.
#[derive(Debug, Default)]
struct SampleColumns {
    u: [Column; 3],
    /// Directions and the light that comes along them, with the density of light sampling.
    light: LightSamples,
    f_cos: Columns3,
    /// Density of BSDF sampling. That of the technique is 0 where there is no sample, that of the other one where only
    /// this one can draw it.
    p_bsdf: Column,
    /// Contributions.
    c: Columns3,
    /// Rays.
    o: Columns3,
    d: Columns3,
    t_max: Column,
}

/// Segments of the samples that contribute.
#[derive(Debug, Default)]
struct Traced {
    /// Places of their vertices.
    index: Vec<u32>,
    rays: RayBatch,
    occluded: Vec<bool>,
}

/// Directions of BSDF sampling among the emitters.
#[derive(Debug, Default)]
struct EmitterRays {
    /// Places of their vertices.
    index: Vec<u32>,
    rays: RayBatch,
    scratch: EmitterScratch,
    emitter_hits: Vec<Option<EmitterHit>>,
    /// Those of them that meet nothing.
    far: Vec<u32>,
}

/// What the paths and their counts are added to.
pub(super) struct Output<'a> {
    pub(super) samples: &'a mut [PixelSample],
    pub(super) next: &'a mut Vec<PathState>,
    pub(super) stats: &'a mut PathStats,
    pub(super) direct: &'a mut DirectStats,
    /// Copies of the segments, if requested.
    pub(super) segments: Option<&'a mut Vec<RayBatch>>,
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
        sample: &CameraSample,
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
        self.push(path, sample);
    }

    /// Adds any other vertex; false if it needs an estimate of another form.
    #[inline]
    pub(super) fn push_vertex(
        &mut self,
        path: &Carried,
        interaction: &SurfaceInteraction,
        bsdf: &SurfaceBsdf<'w>,
        sample: &CameraSample,
    ) -> bool {
        if !self.estimate.takes(&bsdf.bsdf) {
            return false;
        }
        let (index, s) = (self.buffers.paths.len() as u32, &interaction.surface);
        self.singles.push(Single { index, p: s.p, p_error: s.p_error, wo: interaction.wo, bsdf: *bsdf });
        self.push(path, sample);
        true
    }

    #[inline]
    fn push(&mut self, path: &Carried, sample: &CameraSample) {
        let key = domain::VERTEX + self.estimate.vertex;
        self.buffers.paths.push(*path);
        self.buffers.streams.push(sample.stream.domain(key));
        self.buffers.direct.push(sample.direct.domain(key).domain(domain::DIRECT));
    }

    /// Adds the direct light of all vertices, and the next segments of their paths.
    pub(super) fn shade(&mut self, job: &RenderJob, out: &mut Output<'_>) {
        let Counts { light, bsdf, by_path } = self.estimate.counts;
        let n = self.buffers.paths.len();
        if n == 0 {
            return;
        }
        let start = Instant::now();
        self.buffers.find_points(n);
        self.set_singles();
        if self.estimate.vertex == 0 {
            self.buffers.set_normals(out.samples);
        }
        out.stats.shade_time += start.elapsed();

        for k in 0..light {
            let start = Instant::now();
            self.sample_lights(job, k);
            let t1 = self.trace(job, out, start);
            out.direct.t1_light += t1;
        }
        let bsdf = if by_path { 0 } else { bsdf };
        for k in 0..bsdf {
            let start = Instant::now();
            out.direct.emitter_rays += self.sample_bsdfs(job, k);
            self.trace(job, out, start);
        }
        out.direct.proposals += (n as u64) * u64::from(light + bsdf);
        out.direct.light_proposals += (n as u64) * u64::from(light);

        let start = Instant::now();
        for (i, path) in self.buffers.paths.iter().enumerate() {
            out.samples[path.sample as usize].radiance += path.beta * self.buffers.radiance.rgb(i);
        }
        if self.estimate.continues {
            self.extend(out.next);
        }
        out.stats.shade_time += start.elapsed();
    }

    /// Writes the singles into the columns.
    fn set_singles(&mut self) {
        let Surface { p, p_error, n, lit, ns, wo, rho } = &mut self.buffers.surface;
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

    /// Light sample `k` of each vertex: contributions and segments.
    fn sample_lights(&mut self, job: &RenderJob, k: u32) {
        let n = self.buffers.paths.len();
        self.buffers.draw(Stream::Direct(direct::domain::LIGHT, self.estimate.counts.light, k));
        let Buffers { surface, samples, scratch, .. } = &mut *self.buffers;
        job.lights.sample_many(n, surface.lit_points(), &samples.u, scratch, &mut samples.light);

        let len = padded(n);
        let at = surface.lambertian(len);
        let (wi, p_bsdf) = (samples.light.wi.get(len), &mut samples.p_bsdf[..len]);
        kernels::evaluate_lambertian(level(), &at, wi, &mut samples.f_cos.get_mut(len), p_bsdf);
        for single in others(&self.singles) {
            let i = single.index as usize;
            if samples.light.pdf[i] > 0.0 {
                let wi = samples.light.wi.vec3(i);
                samples.f_cos.set_rgb(i, single.bsdf.f_cos(single.wo, wi));
                samples.p_bsdf[i] = single.bsdf.pdf(single.wo, wi);
            }
        }
        for (p, is_delta) in samples.p_bsdf.iter_mut().zip(&samples.light.is_delta) {
            *p = if *is_delta { 0.0 } else { *p };
        }
        self.buffers.weigh(n, &self.estimate, true);
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

        let EmitterRays { index, rays, scratch, emitter_hits, far } = emitter_rays;
        index.clear();
        index.extend((0..n as u32).filter(|&i| samples.p_bsdf[i as usize] > 0.0));
        far.clear();
        let mut add = |samples: &mut SampleColumns, i: usize, hit: Option<EmitterHit>| {
            let Some(hit) = hit else { return far.push(i as u32) };
            let (ctx, wi) = (surface.lit_points().get(i), samples.light.wi.vec3(i));
            match direct::emitter_at(job, &ctx, wi, &hit, paths[i].time) {
                Some(found) => set_emitter(&mut samples.light, i, &found),
                None => samples.p_bsdf[i] = 0.0,
            }
        };
        let (o, d) = (samples.o.get(len), samples.light.wi.get(len));
        if let Some(hit) = job.world.intersect_few_emitters(o, d, scratch) {
            index.iter().for_each(|&i| add(samples, i as usize, hit(i as usize)));
        } else {
            rays.clear();
            for i in index.iter().map(|&i| i as usize) {
                let (o, d) = (samples.o.vec3(i), samples.light.wi.vec3(i));
                rays.push(&Ray { o, d, t_max: f32::INFINITY, time: paths[i].time });
            }
            job.world.intersect_emitters(rays, scratch, emitter_hits);
            index.iter().zip(&*emitter_hits).for_each(|(&i, hit)| add(samples, i as usize, *hit));
        }
        let SampleColumns { light: LightSamples { wi, li, pdf, is_far, is_delta, .. }, p_bsdf, .. } = samples;
        let (at, directions) = (surface.lit_points(), wi);
        job.lights.infinite_in_directions(
            far.len(),
            |k| (at.get(far[k] as usize), directions.vec3(far[k] as usize)),
            |k, le, p_light| {
                let i = far[k] as usize;
                p_bsdf[i] = if le.is_black() { 0.0 } else { p_bsdf[i] };
                li.set_rgb(i, le);
                pdf[i] = if is_delta[i] { 0.0 } else { p_light };
                is_far[i] = 1.0;
            },
        );
        let count = index.len() as u64;
        self.buffers.weigh(n, &self.estimate, false);
        count
    }

    /// Traces the segments of the samples that contribute, and adds the contributions of those that are unoccluded.
    /// Returns the time since `start`, when sampling began, until tracing began.
    fn trace(&mut self, job: &RenderJob, out: &mut Output<'_>, start: Instant) -> Duration {
        let n = self.buffers.paths.len();
        self.buffers.make_segments(n);
        let Buffers { samples, traced, radiance, .. } = &mut *self.buffers;
        let proposed = Instant::now();
        job.world.accel.occluded(&traced.rays, Coherence::Packets, &mut traced.occluded);
        let traced_at = Instant::now();
        for (&i, _) in traced.index.iter().zip(&traced.occluded).filter(|(_, occluded)| !**occluded) {
            let i = i as usize;
            radiance.set_rgb(i, radiance.rgb(i) + samples.c.rgb(i));
        }
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
        let mut follow = |i: usize, direction: &Direction, o: Vec3, n_light: u32| {
            let Some((beta, eta_scale)) = paths[i].beyond(direction) else { return };
            let survivor = survive(beta, eta_scale, &streams[i], vertex + 1, settings);
            if counts.by_path {
                let pdf = direction.pdf.filter(|_| !direction.lobe.is_specular());
                let (ctx, heuristic) = (surface.lit_points().get(i), *heuristic);
                let technique = BsdfTechnique { ctx, n_light: n_light as f32, pdf, heuristic, survivor };
                let segment = paths[i].segment(o, direction.wi, beta, eta_scale);
                next.push(PathState { technique: Some(technique), ..segment });
            } else if let Some(beta) = survivor {
                next.push(paths[i].segment(o, direction.wi, beta, eta_scale));
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
            follow(i, &direction, samples.o.vec3(i), counts.light);
        }
        for single in others(&self.singles) {
            let (i, bsdf) = (single.index as usize, &single.bsdf);
            let u = samples.u.each_ref().map(|u| u[i]);
            let Some(direction) = sampled_direction(bsdf, single.wo, u) else { continue };
            let o = offset_origin(single.p, single.p_error, bsdf.n, direction.wi);
            let n_light = if bsdf.bsdf.has_non_specular() { counts.light } else { 0 };
            follow(i, &direction, o, n_light);
        }
    }
}

/// What BSDF sample `i` points at.
fn set_emitter(samples: &mut LightSamples, i: usize, found: &EmitterInDirection) {
    samples.li.set_rgb(i, found.li);
    samples.pdf[i] = if samples.is_delta[i] { 0.0 } else { found.p_light };
    samples.is_far[i] = if found.end.is_some() { 0.0 } else { 1.0 };
    if let Some((p, p_error, n)) = found.end {
        samples.p.set(i, p);
        samples.p_error.set(i, p_error);
        samples.n.set(i, n);
    }
}

/// Sets a vector of a lane.
#[inline]
fn set_lane(rows: &mut [[f32; LANES]; 3], k: usize, v: Vec3) {
    (rows[0][k], rows[1][k], rows[2][k]) = v.into();
}

/// Which random numbers of a vertex.
enum Stream {
    /// A domain of the vertex.
    Vertex(u32),
    /// Point k of n of a domain of its direct light: (domain, n, k).
    Direct(u32, u32, u32),
}

impl Buffers {
    fn begin(&mut self, len: usize) {
        self.paths.clear();
        self.streams.clear();
        self.direct.clear();
        if self.hits.len() < len / LANES {
            self.hits.resize(len / LANES, TriangleHits::default());
        }
        self.radiance.reserve(len);
        let Surface { p, p_error, n, lit, ns, wo, rho } = &mut self.surface;
        [p, p_error, n, lit, ns, wo, rho].into_iter().for_each(|c| c.reserve(len));
        let SampleColumns { u: [u0, u1, u2], light, f_cos, p_bsdf, c, o, d, t_max } = &mut self.samples;
        light.reserve(len);
        [f_cos, c, o, d].into_iter().for_each(|c| c.reserve(len));
        reserve(&mut [u0, u1, u2, p_bsdf, t_max], len);
        self.radiance.get_mut(len).into_iter().for_each(|c| c.fill(0.0));
    }

    /// The points of hits.
    fn find_points(&mut self, n: usize) {
        let len = padded(n);
        let Surface { p, p_error, n, lit, ns, wo, .. } = &mut self.surface;
        let [p, p_error, n, facing, ns, wo] = [p, p_error, n, lit, ns, wo].map(|c| c.get_mut(len));
        kernels::points(level(), &self.hits[..len / LANES], &mut Points { p, p_error, n, facing, ns, wo });
    }

    /// The shading normals as features of the camera samples that have features.
    fn set_normals(&self, samples: &mut [PixelSample]) {
        for (i, path) in self.paths.iter().enumerate() {
            if let Some(features) = &mut samples[path.sample as usize].features {
                let (z, wo) = (self.surface.ns.vec3(i), self.surface.wo.vec3(i));
                features.normal = if z.dot(wo) < 0.0 { -z } else { z };
            }
        }
    }

    /// Draws three numbers for each vertex.
    fn draw(&mut self, stream: Stream) {
        self.drawn.clear();
        match stream {
            Stream::Vertex(key) => self.drawn.extend(self.streams.iter().map(|s| s.domain(key))),
            Stream::Direct(key, n, k) => self.drawn.extend(self.direct.iter().map(|s| s.split(key, n, k))),
        }
        let n = self.drawn.len();
        sampler::draw(level(), &self.drawn, self.samples.u.each_mut().map(|u| &mut u[..n]));
    }

    /// Directions by the cosine.
    fn sample_lambertian(&mut self, len: usize) {
        let SampleColumns { u, light, p_bsdf, .. } = &mut self.samples;
        let u = [&u[1][..len], &u[2][..len]];
        let at = self.surface.lambertian(len);
        kernels::sample_lambertian(level(), &at, u, &mut light.wi.get_mut(len), &mut p_bsdf[..len]);
    }

    /// Contributions of the samples of light or of BSDF sampling.
    fn weigh(&mut self, n: usize, estimate: &Estimate, by_light: bool) {
        let len = padded(n);
        let SampleColumns { light, f_cos, p_bsdf, c, .. } = &mut self.samples;
        let [n_light, n_bsdf] = estimate.n();
        let (of_light, of_bsdf) = ((&light.pdf[..len], n_light), (&p_bsdf[..len], n_bsdf));
        let ((p, n), (p_other, n_other)) = if by_light { (of_light, of_bsdf) } else { (of_bsdf, of_light) };
        let (f_cos, li, heuristic) = (f_cos.get(len), light.li.get(len), estimate.heuristic);
        let samples = Samples { f_cos, li, p, p_other, n, n_other, heuristic };
        kernels::weigh(level(), &samples, &mut c.get_mut(len));
    }

    /// The segments of the samples that contribute.
    fn make_segments(&mut self, n: usize) {
        let len = padded(n);
        let SampleColumns { light, c, o, d, t_max, .. } = &mut self.samples;
        let from = self.surface.ends(len);
        let to = Ends { p: light.p.get(len), p_error: light.p_error.get(len), n: light.n.get(len) };
        let mut rays = Rays { o: o.get_mut(len), d: d.get_mut(len), t_max: &mut t_max[..len] };
        kernels::segments(level(), &from, light.wi.get(len), &to, &light.is_far[..len], &mut rays);

        let Traced { index, rays, .. } = &mut self.traced;
        index.clear();
        index.extend((0..n as u32).filter(|&i| !c.rgb(i as usize).is_black()));
        rays.clear();
        let ([ox, oy, oz], [dx, dy, dz]) = (o.get(len), d.get(len));
        let columns = [
            (&mut rays.ox, ox),
            (&mut rays.oy, oy),
            (&mut rays.oz, oz),
            (&mut rays.dx, dx),
            (&mut rays.dy, dy),
            (&mut rays.dz, dz),
            (&mut rays.t_max, &t_max[..len]),
        ];
        for (to, from) in columns {
            to.extend(index.iter().map(|&i| from[i as usize]));
        }
        rays.time.extend(index.iter().map(|&i| self.paths[i as usize].time));
    }
}

impl Surface {
    fn lit_points(&self) -> LitPoints<'_> {
        LitPoints { p: &self.p, n: &self.lit, ns: &self.ns }
    }

    fn lambertian(&self, len: usize) -> Lambertian<'_> {
        Lambertian { rho: self.rho.get(len), ns: self.ns.get(len), wo: self.wo.get(len) }
    }

    fn ends(&self, len: usize) -> Ends<'_> {
        Ends { p: self.p.get(len), p_error: self.p_error.get(len), n: self.n.get(len) }
    }

    /// Origins of rays in the directions of the samples.
    fn origins(&self, samples: &mut SampleColumns, len: usize) {
        kernels::origins(level(), &self.ends(len), samples.light.wi.get(len), &mut samples.o.get_mut(len));
    }
}

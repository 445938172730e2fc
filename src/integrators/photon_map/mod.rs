//! Photon mapping [Jensen 1996] with the extensions of [Keller and Wald 2000].
//!
//! Direct light is estimated at every vertex by any estimator. Specular and glossy lobes are followed by paths
//! (`diffuse.rs`). The remaining light at Lambertian lobes comes from photons: from the caustic map, if the light was
//! last scattered by another lobe, otherwise from a final gather, whose rays look up the maps at Lambertian surfaces.
//! Each light path counts once, since its last scattering before the vertex was either Lambertian (final gather) or not
//! (caustic map).
//!
//! If a gather ray is shorter than the search radius at its end, density estimation is inaccurate near the corner
//! between the two surfaces. The ray then continues as a path, with direct light and another ray.
//!
//! Biased by density estimation, and because the base below a coat is treated as Lambertian. With `progressive`,
//! density estimation is consistent. Bounces are counted from the vertex that looks up the maps, not counting mirrors
//! before.
//!
//! Reading order: [`maps`], `boundary`, [`mod@guide`]; this file has the integrator.

mod boundary;
pub mod guide;
pub mod maps;

pub use maps::{MapMaker, MapStats, PhotonMaps};

use super::path::{AtVertices, BatchVertices, PathStats, PathTracer, PathVertex, Shading};
use super::segment::CameraSample;
use super::{Cameras, Integrator, Statistics, Tracer, diffuse};
use crate::bsdfs::{Bsdf, Diffuse, DiffuseTransmission, Lambertian};
use crate::cameras::CameraRay;
use crate::direct::{Estimator, Fits, ShadingPoint};
use crate::film::{FeatureSet, PixelSample};
use crate::materials::SurfaceBsdf;
use crate::photons::{GatherPoint, GatherScratch, PhotonError, Search};
use crate::scene::RenderJob;
use crate::settings::{IntegratorSettings, PhotonMapSettings};
use boundary::{Boundary, Probe};
use guide::Guide;
use lumiris_numbers::math::ray::offset_origin;
use lumiris_numbers::math::{Frame, Ray, Rgb, Vec3};
use lumiris_numbers::samplers::SampleStream;
use maps::DensityEstimate;
use std::f32::consts::FRAC_1_PI;
use std::sync::atomic::AtomicBool;

/// Random-number domain of the final gather at a vertex.
const GATHER: u32 = 4;
/// Random-number domains of the kernel trials there, one per side.
const CAUSTIC: u32 = 5;
const GLOBAL: u32 = 7;
/// Number of photons that guide the directions of a gather.
const GUIDES: u32 = 32;

/// Renders with photon maps.
pub struct PhotonMapIntegrator<'a> {
    job: &'a RenderJob,
    maker: MapMaker<'a>,
    /// Maps of the current samples.
    maps: Option<PhotonMaps>,
}

impl<'a> PhotonMapIntegrator<'a> {
    /// Prepares the data common to all maps.
    pub fn new(job: &'a RenderJob, cameras: Cameras<'_>, stop: &'a AtomicBool) -> Result<Self, PhotonError> {
        let maker = MapMaker::new(job, &maps::visible_points(job, cameras), stop)?;
        Ok(PhotonMapIntegrator { job, maker, maps: None })
    }
}

impl Integrator for PhotonMapIntegrator<'_> {
    /// Progressive maps serve one sample per pixel. A map for all samples does not depend on `first`.
    fn prepare(&mut self, first: u32) -> Result<u32, PhotonError> {
        self.maps = None;
        match self.maker.make(self.job, if self.shares_noise() { first } else { 0 }) {
            Ok(maps) => self.maps = Some(maps),
            Err(PhotonError::Stopped { .. }) if self.maker.stats.maps > 0 => return Ok(0),
            Err(error) => return Err(error),
        }
        Ok(if self.shares_noise() { 1 } else { u32::MAX })
    }

    fn tracer(&self, features: FeatureSet) -> Box<dyn Tracer + '_> {
        let maps = self.maps.as_ref().expect("maps are prepared before samples are traced");
        Box::new(PhotonMapTracer {
            maps,
            paths: PathTracer::new(features),
            gather: PathTracer::default(),
            lookups: Lookups::default(),
            samples: Vec::new(),
            results: Vec::new(),
        })
    }

    /// True for progressive maps: all pixels of a pass share a map.
    fn shares_noise(&self) -> bool {
        self.job.settings().integrator.photons.progressive.is_some()
    }

    fn statistics(&self, paths: PathStats) -> Statistics {
        Statistics { paths, photons: Some(self.maker.stats), ..Statistics::default() }
    }
}

/// Traces with photon maps.
struct PhotonMapTracer<'m> {
    maps: &'m PhotonMaps,
    paths: PathTracer,
    gather: PathTracer,
    lookups: Lookups,
    /// Gather rays, and their radiance.
    samples: Vec<CameraSample>,
    results: Vec<PixelSample>,
}

/// Lookups in the maps, with pending corrections and gather requests.
#[derive(Debug, Default)]
struct Lookups {
    scratch: GatherScratch,
    requests: Vec<GatherRequest>,
    pending: Vec<Pending>,
    boundary: Boundary,
    probes: Vec<Probe>,
    trials: Vec<u32>,
}

/// Radiance that awaits the correction of boundary bias.
#[derive(Clone, Copy, Debug)]
struct Pending {
    /// Index of the camera sample, or of the gather ray.
    owner: u32,
    radiance: Rgb,
    probe: Probe,
}

/// A point at which a final gather is requested.
#[derive(Clone, Copy, Debug)]
struct GatherRequest {
    /// Index of the camera sample.
    sample: u32,
    /// Weight of radiance sampled with the cosine density: throughput times albedo.
    beta: Rgb,
    /// Index of the vertex along its path, from 0.
    vertex: u32,
    point: GatherPoint,
    p_error: Vec3,
    time: f32,
    stream: SampleStream,
    /// Pixel width, and its growth per unit length.
    width: f32,
    spread: f32,
}

impl Tracer for PhotonMapTracer<'_> {
    fn trace(&mut self, job: &RenderJob, samples: &[CameraSample], fits: &mut Fits, out: &mut Vec<PixelSample>) {
        let settings = &job.settings().integrator;
        let (maps, lookups) = (self.maps, &mut self.lookups);
        lookups.requests.clear();
        let own: &mut AtVertices<'_> = &mut |vertices, out| {
            diffuse::shade(vertices, false, out, |v, part| {
                if vertices.vertex + 1 < settings.depth() {
                    lookups.look_up(maps, &settings.photons, vertices.vertex, v, part);
                }
                // Added later
                Some(Rgb::BLACK)
            })
        };
        self.paths.search.start(job, samples, out);
        self.paths.follow(job, settings, Some(own), samples, fits, out);
        self.lookups.correct(job, out);

        self.start_gather(settings);
        self.finish_gather(job, settings);
        let rays_of_request = self.results.chunks(settings.photons.gather.max(1) as usize);
        for (request, rays) in self.lookups.requests.iter().zip(rays_of_request) {
            for ray in rays {
                out[request.sample as usize].radiance += request.beta * ray.radiance;
            }
        }
    }

    fn take_stats(&mut self) -> PathStats {
        let mut stats = self.paths.take_stats();
        let mut gather = self.gather.take_stats();
        // Gather rays are not camera rays
        gather.bounce_rays += std::mem::take(&mut gather.camera_rays);
        gather.bounce_time += std::mem::take(&mut gather.camera_time);
        stats.merge(&gather);
        stats
    }
}

impl PhotonMapTracer<'_> {
    /// Generates the rays of all gathers.
    fn start_gather(&mut self, settings: &IntegratorSettings) {
        self.samples.clear();
        let sample_counts = Estimator::at_vertex(settings, 1).sample_counts();
        let PhotonMapSettings { gather: count, guide: fraction, .. } = settings.photons;
        for request in &self.lookups.requests {
            let frame = Frame::from_z(request.point.ns);
            let guide = guide(self.maps, &request.point, &frame, fraction, &mut self.lookups.scratch);
            for i in 0..count {
                let stream = request.stream.split(GATHER, count, i);
                let [u_choice, u0, u1] = stream.draw::<3>();
                let w = guide.sample(u_choice, [u0, u1]);
                let pdf = guide.pdf(w);
                let d = frame.to_world(w);
                // Directions below the surface contribute nothing
                let is_above = w.z > 0.0 && pdf > 0.0 && d.dot(request.point.n) > 0.0;
                let weight = if is_above { w.z * FRAC_1_PI / (pdf * count as f32) } else { 0.0 };
                let o = offset_origin(request.point.p, request.p_error, request.point.n, d);
                let ray = Ray { o, d, t_max: f32::INFINITY, time: request.time };
                let ray = CameraRay { ray, spread: request.spread, width0: request.width, weight: 1.0 };
                self.samples.push(CameraSample::of_ray(ray, weight, stream, sample_counts));
            }
        }
    }

    /// Traces the rays of all gathers, and looks up the maps at their hits.
    fn finish_gather(&mut self, job: &RenderJob, settings: &IntegratorSettings) {
        let (maps, lookups) = (self.maps, &mut self.lookups);
        (self.gather.search.only_reflected, self.gather.estimator_of) = (true, Some(1));
        self.gather.search.start(job, &self.samples, &mut self.results);
        self.gather.search.active.retain(|path| !path.beta.is_black());
        let own: &mut AtVertices<'_> = &mut |vertices, out| lookups.shade_hits(maps, settings, vertices, out);
        let (samples, fits) = (&self.samples, &mut Fits::default());
        self.gather.follow(job, settings, Some(own), samples, fits, &mut self.results);
        self.lookups.correct(job, &mut self.results);
    }
}

impl Lookups {
    /// Looks up caustics. The remaining light is requested by a final gather, or looked up as well if gathering is
    /// disabled.
    fn look_up(
        &mut self,
        maps: &PhotonMaps,
        settings: &PhotonMapSettings,
        vertex: u32,
        v: &PathVertex<'_, '_>,
        part: &Lambertian<'_>,
    ) {
        // Both sides, with a final gather for each
        let path = v.path;
        for (i, side) in (0..).zip(sides(&v.point, part)) {
            let Side { albedo, point } = side;
            wait(v, CAUSTIC + i, &side, maps.caustics(&point, &mut self.scratch), &mut self.pending);
            if settings.gather == 0 {
                wait(v, GLOBAL + i, &side, maps.indirect(&point, &mut self.scratch), &mut self.pending);
                continue;
            }
            self.requests.push(GatherRequest {
                sample: path.sample,
                beta: path.beta * albedo,
                vertex,
                point,
                p_error: v.point.p_error,
                time: path.ray.time,
                stream: v.stream,
                width: path.width,
                spread: path.spread,
            });
        }
    }

    /// Looks up the maps at the hits of gather rays. A ray shorter than the search radius continues as a path scattered
    /// by the Lambertian lobe.
    fn shade_hits<'w>(
        &mut self,
        maps: &PhotonMaps,
        settings: &IntegratorSettings,
        vertices: &BatchVertices<'_, 'w>,
        out: &mut [PixelSample],
    ) -> Vec<Shading<'w>> {
        let rays_per_request = settings.photons.gather.max(1);
        let shading = |v: PathVertex<'_, 'w>| {
            // Lookup at the hit
            let (path, point) = (v.path, &v.point);
            let Some(part) = point.bsdf.lambertian(point.wo) else { return Shading::default() };
            let first = self.pending.len();
            let (radiance, reach) = reflected(maps, &v, &part, &mut self.scratch, &mut self.pending);
            let is_near = point.p.distance(path.ray.o) < reach;
            if !is_near {
                out[path.sample as usize].radiance += path.beta * radiance;
                return Shading::default();
            }

            // Too near: caustics, direct light and another segment instead
            self.pending.truncate(first);
            for (i, side) in (0..).zip(sides(point, &part)) {
                wait(&v, CAUSTIC + i, &side, maps.caustics(&side.point, &mut self.scratch), &mut self.pending);
            }
            let lit = Some(only_lambertian(&point.bsdf, &part));
            let before = self.requests[(path.sample / rays_per_request) as usize].vertex;
            Shading { lit, next: lit.filter(|_| before + vertices.vertex + 2 < settings.depth()) }
        };
        vertices.each().map(shading).collect()
    }

    /// Adds the pending radiance, multiplied by the numbers of trials.
    fn correct(&mut self, job: &RenderJob, out: &mut [PixelSample]) {
        self.probes.clear();
        self.probes.extend(self.pending.iter().map(|p| p.probe));
        self.boundary.trials(&job.world, &self.probes, &mut self.trials);
        for (pending, &trials) in self.pending.iter().zip(&self.trials) {
            out[pending.owner as usize].radiance += pending.radiance * trials as f32;
        }
        self.pending.clear();
    }
}

/// A side of a vertex.
#[derive(Clone, Copy, Debug)]
struct Side {
    albedo: Rgb,
    point: GatherPoint,
}

/// The sides of a vertex that scatter light to the viewer.
fn sides(v: &ShadingPoint<'_>, part: &Lambertian<'_>) -> impl Iterator<Item = Side> {
    let (n, ns, p) = (v.bsdf.n, v.viewer_normal(), v.p);
    let n = if n.dot(v.wo) < 0.0 { -n } else { n };
    let front = Side { albedo: part.reflectance, point: GatherPoint { p, n, ns } };
    let back = Side { albedo: part.transmittance, point: GatherPoint { p, n: -n, ns: -ns } };
    [front, back].into_iter().filter(|side| !side.albedo.is_black())
}

/// Adds the light scattered by one side of a vertex to the pending radiance. `key` is the random-number domain of the
/// trials.
fn wait(
    v: &PathVertex<'_, '_>,
    key: u32,
    &Side { albedo, point }: &Side,
    DensityEstimate { e, radius }: DensityEstimate,
    pending: &mut Vec<Pending>,
) {
    if !e.is_black() {
        let path = v.path;
        let probe = Probe { point, radius, time: path.ray.time, stream: v.stream.domain(key) };
        pending.push(Pending { owner: path.sample, radiance: path.beta * albedo * e * FRAC_1_PI, probe });
    }
}

/// Reflected radiance of all photons at the Lambertian lobe that needs no boundary correction, and the distance of the
/// photons. Radiance that needs the correction is added to `pending`.
fn reflected(
    maps: &PhotonMaps,
    v: &PathVertex<'_, '_>,
    part: &Lambertian<'_>,
    scratch: &mut GatherScratch,
    pending: &mut Vec<Pending>,
) -> (Rgb, f32) {
    let (mut radiance, mut reach) = (Rgb::BLACK, 0.0_f32);
    for (i, side) in (0..).zip(sides(&v.point, part)) {
        let answer = maps.irradiance(&side.point, scratch);
        reach = reach.max(answer.reach);
        radiance += side.albedo * answer.uncorrected * FRAC_1_PI;
        wait(v, GLOBAL + i, &side, answer.global, pending);
        wait(v, CAUSTIC + i, &side, answer.caustic, pending);
    }
    (radiance, reach)
}

/// The Lambertian lobe as a BSDF.
fn only_lambertian<'a>(bsdf: &SurfaceBsdf<'a>, part: &Lambertian<'_>) -> SurfaceBsdf<'a> {
    let (reflectance, transmittance) = (part.reflectance, part.transmittance);
    let lambertian = if transmittance.is_black() {
        Bsdf::Diffuse(Diffuse { reflectance })
    } else {
        Bsdf::DiffuseTransmission(DiffuseTransmission { reflectance, transmittance })
    };
    SurfaceBsdf { bsdf: lambertian, ..*bsdf }
}

/// A guide from the photons around a vertex.
fn guide(maps: &PhotonMaps, point: &GatherPoint, frame: &Frame, fraction: f32, scratch: &mut GatherScratch) -> Guide {
    let mut photons = Vec::new();
    if fraction > 0.0 {
        let search = match maps.search {
            Search::Nearest { max_radius, .. } => Search::Nearest { count: GUIDES, max_radius },
            Search::Radius(radius) => Search::Radius(radius),
        };
        maps.global.gather(point, search, scratch, |photon, _| {
            if !photon.is_primary() {
                photons.push((frame.to_local(photon.wi()), photon.power().luminance()));
            }
        });
    }
    Guide::new(photons, fraction)
}

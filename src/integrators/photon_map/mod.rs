//! Photon mapping [Jensen 1996] with the extensions of [Keller and Wald 2000].
//!
//! Direct light is estimated at every vertex, by any estimator; specular and glossy lobes are followed by paths
//! (`diffuse.rs`). The remaining light reflected by Lambertian parts comes from photons: from the caustic map, if the
//! last scattering of the light was by another lobe, and otherwise by a final gather, whose rays look up in the maps
//! what Lambertian surfaces reflect where they arrive. So each light path counts once: its last scattering before the
//! vertex was either by a Lambertian lobe, which the gather covers, or not, which the caustic map covers.
//!
//! Where a gather ray is shorter than the search radius of the photons at its end, the density estimate there says
//! little about the corner between the two surfaces: the ray continues as a path, with direct light and another ray.
//!
//! Biased by density estimation, and because the base below a coat is treated as Lambertian; with `progressive`,
//! density estimation is consistent. Bounces are counted from the vertex that looks up the maps, whatever mirrors
//! precede it.
//!
//! Reading order: [`maps`], `boundary`, [`mod@guide`]; this file renders.

mod boundary;
pub mod guide;
pub mod maps;

pub use maps::{MapMaker, MapStats, PhotonMaps};

use super::diffuse::{self, Reflected, viewer_normal};
use super::path::{self, CameraSample, PathIntegrator, PathStats, Vertex};
use super::segment::PathState;
use crate::bsdfs::{Bsdf, Diffuse, DiffuseTransmission, Lambertian};
use crate::cameras::CameraRay;
use crate::direct::{Estimator, Fits, ShadingPoint};
use crate::film::PixelSample;
use crate::materials::SurfaceBsdf;
use crate::photons::{GatherScratch, Place, Search};
use crate::scene::RenderJob;
use crate::settings::PhotonMapSettings;
use boundary::{Boundary, Probe};
use guide::Guide;
use lumiris_numbers::math::ray::offset_origin;
use lumiris_numbers::math::{Frame, Ray, Rgb, Vec3};
use lumiris_numbers::samplers::SampleStream;
use std::f32::consts::FRAC_1_PI;

/// Random-number domain of the final gather at a vertex.
const GATHER: u32 = 4;
/// Random-number domains of the kernel trials there, one per side.
const CAUSTIC: u32 = 5;
const GLOBAL: u32 = 7;
/// Photons that guide the directions of a gather.
const GUIDES: u32 = 32;

/// Renders with photon maps; holds the buffers of one worker.
#[derive(Debug, Default)]
pub struct PhotonMapIntegrator {
    paths: PathIntegrator,
    gather: PathIntegrator,
    scratch: GatherScratch,
    requests: Vec<GatherRequest>,
    samples: Vec<CameraSample>,
    results: Vec<PixelSample>,
    boundary: Boundary,
    pending: Vec<Pending>,
    probes: Vec<Probe>,
    trials: Vec<u32>,
}

/// Radiance whose kernel has yet to be corrected for boundary bias.
#[derive(Clone, Copy, Debug)]
struct Pending {
    /// Index of the camera sample, or of the ray of a gather.
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
    /// The vertex of its path, from 0.
    vertex: u32,
    place: Place,
    p_error: Vec3,
    time: f32,
    stream: SampleStream,
    /// Width of a pixel, and its growth.
    width: f32,
    spread: f32,
}

impl PhotonMapIntegrator {
    /// Whether features of first surfaces are left out.
    pub fn omit_features(&mut self, omit: bool) {
        self.paths.omits_features = omit;
    }

    /// The counts and times since the last call.
    pub fn take_stats(&mut self) -> PathStats {
        let mut stats = self.paths.take_stats();
        let mut gather = self.gather.take_stats();
        // Rays of the gather are no camera rays
        gather.bounce_rays += std::mem::take(&mut gather.camera_rays);
        gather.bounce_time += std::mem::take(&mut gather.camera_time);
        stats.merge(&gather);
        stats
    }

    /// Estimates the radiance of each camera sample; `out[i]` belongs to `samples[i]`. `fits` are those of the samples'
    /// pixels.
    pub fn trace(
        &mut self,
        job: &RenderJob,
        maps: &PhotonMaps,
        samples: &[CameraSample],
        fits: &mut Fits,
        out: &mut Vec<PixelSample>,
    ) {
        self.requests.clear();
        self.pending.clear();
        let settings = &job.settings().integrator;
        let mut lookup = Lookup {
            maps,
            settings: &settings.photons,
            depth: settings.depth(),
            samples,
            scratch: &mut self.scratch,
            requests: &mut self.requests,
            pending: &mut self.pending,
        };
        diffuse::trace(&mut self.paths, job, &mut lookup, samples, fits, out);
        self.correct(job, out);
        self.start_gather(maps, &settings.photons);
        self.finish_gather(job, maps);
        let rays_of_request = self.results.chunks(settings.photons.gather.max(1) as usize);
        for (request, rays) in self.requests.iter().zip(rays_of_request) {
            for ray in rays {
                out[request.sample as usize].radiance += request.beta * ray.radiance;
            }
        }
    }

    /// Adds the pending radiance, times the numbers of trials of its kernels.
    fn correct(&mut self, job: &RenderJob, out: &mut [PixelSample]) {
        self.probes.clear();
        self.probes.extend(self.pending.iter().map(|p| p.probe));
        self.boundary.trials(&job.world, &self.probes, &mut self.trials);
        for (pending, &trials) in self.pending.iter().zip(&self.trials) {
            out[pending.owner as usize].radiance += pending.radiance * trials as f32;
        }
        self.pending.clear();
    }

    /// Generates the rays of all gathers.
    fn start_gather(&mut self, maps: &PhotonMaps, settings: &PhotonMapSettings) {
        self.samples.clear();
        let count = settings.gather;
        for request in &self.requests {
            let frame = Frame::from_z(request.place.ns);
            let guide = guide(maps, &request.place, &frame, settings.guide, &mut self.scratch);
            for i in 0..count {
                let stream = request.stream.split(GATHER, count, i);
                let [u_choice, u0, u1] = stream.draw::<3>();
                let w = guide.sample(u_choice, [u0, u1]);
                let pdf = guide.pdf(w);
                let d = frame.to_world(w);
                // Directions below the surface contribute nothing
                let is_above = w.z > 0.0 && pdf > 0.0 && d.dot(request.place.n) > 0.0;
                let weight = if is_above { w.z * FRAC_1_PI / (pdf * count as f32) } else { 0.0 };
                let o = offset_origin(request.place.p, request.p_error, request.place.n, d);
                let ray = Ray { o, d, t_max: f32::INFINITY, time: request.time };
                let ray = CameraRay { ray, spread: request.spread, width0: request.width, weight: 1.0 };
                let sample_counts = crate::settings::SampleCounts { samples: 1, proposals: 1 };
                self.samples.push(CameraSample { ray, weight, stream, direct: stream, sample_counts, fit: 0 });
            }
        }
    }

    /// Traces the rays of all gathers and adds what they see.
    fn finish_gather(&mut self, job: &RenderJob, maps: &PhotonMaps) {
        let settings = &job.settings().integrator;
        let depth = settings.depth();
        let (gather, scratch) = (&mut self.gather, &mut self.scratch);
        let rays_per_request = settings.photons.gather.max(1);
        gather.only_reflected = true;
        gather.start(&self.samples, &mut self.results);
        gather.active.retain(|path| !path.beta.is_black());
        for vertex in 0..depth {
            if gather.active.is_empty() {
                break;
            }
            let vertices = gather.find_vertices(job, vertex, depth, &self.samples, &mut self.results, None);

            // Look up the maps, except where a ray is shorter than their search radius
            let mut near = Vec::new();
            for (path, v) in gather.active.iter().zip(&vertices) {
                let Some(part) = v.bsdf.lambertian(v.wo) else { continue };
                let first = self.pending.len();
                let (radiance, reach) = reflected(maps, path, v, &part, (&mut *scratch, &mut self.pending));
                if v.surface.p.distance(path.ray.o) < reach {
                    self.pending.truncate(first);
                    near.push((*path, Vertex { bsdf: only_lambertian(v, &part), ..*v }, part));
                } else {
                    self.results[path.sample as usize].radiance += path.beta * radiance;
                }
            }

            // Treat these as vertices of a path
            let estimator = Estimator::at_vertex(settings, 1);
            let sample_counts = estimator.sample_counts();
            let points: Vec<ShadingPoint<'_>> =
                near.iter().map(|(path, v, _)| v.shading_point(path.ray.time, sample_counts, 0)).collect();
            gather.direct.estimate(job, &estimator, &points, &mut Fits::default(), &mut gather.radiance);
            gather.next.clear();
            for (((path, v, part), point), &radiance) in near.iter().zip(&points).zip(&gather.radiance) {
                self.results[path.sample as usize].radiance += path.beta * radiance;
                for (i, side) in (0..).zip(sides(v, part)) {
                    wait((path, v, CAUSTIC + i), side, maps.caustics(&side.1, scratch), &mut self.pending);
                }
                let before = self.requests[(path.sample / rays_per_request) as usize].vertex;
                if before + vertex + 2 < depth {
                    gather.next.extend(path::extend(path, v, point, vertex, settings).map(|(next, _)| next));
                }
            }
            std::mem::swap(&mut gather.active, &mut gather.next);
            gather.recycle(vertices);
        }
        let mut results = std::mem::take(&mut self.results);
        self.correct(job, &mut results);
        self.results = results;
    }
}

/// Takes caustics from the map, and collects the requests for gathers.
struct Lookup<'a> {
    maps: &'a PhotonMaps,
    settings: &'a PhotonMapSettings,
    depth: u32,
    samples: &'a [CameraSample],
    scratch: &'a mut GatherScratch,
    requests: &'a mut Vec<GatherRequest>,
    pending: &'a mut Vec<Pending>,
}

impl Reflected for Lookup<'_> {
    fn reflected(&mut self, path: &PathState, vertex: u32, v: &Vertex<'_>, part: &Lambertian<'_>) -> Option<Rgb> {
        if vertex + 1 >= self.depth {
            return Some(Rgb::BLACK);
        }
        let (maps, scratch) = (self.maps, &mut *self.scratch);
        for (i, side) in (0..).zip(sides(v, part)) {
            wait((path, v, CAUSTIC + i), side, maps.caustics(&side.1, scratch), self.pending);
            if self.settings.gather == 0 {
                wait((path, v, GLOBAL + i), side, maps.indirect(&side.1, scratch), self.pending);
            }
        }
        if self.settings.gather == 0 {
            return Some(Rgb::BLACK);
        }
        self.requests.extend(sides(v, part).map(|(albedo, place)| GatherRequest {
            sample: path.sample,
            beta: path.beta * albedo,
            vertex,
            place,
            p_error: v.surface.p_error,
            time: path.ray.time,
            stream: v.stream,
            width: path.width,
            spread: self.samples[path.sample as usize].ray.spread,
        }));
        Some(Rgb::BLACK)
    }

    fn has_sources(&self) -> bool {
        false
    }
}

/// The sides of a vertex that reflect to the viewer, with their albedos.
fn sides(v: &Vertex<'_>, part: &Lambertian<'_>) -> impl Iterator<Item = (Rgb, Place)> {
    let (n, ns, p) = (v.surface.n, viewer_normal(v), v.surface.p);
    let n = if n.dot(v.wo) < 0.0 { -n } else { n };
    let both = [(part.reflectance, Place { p, n, ns }), (part.transmittance, Place { p, n: -n, ns: -ns })];
    both.into_iter().filter(|(albedo, _)| !albedo.is_black())
}

/// Adds light reflected by the side of a vertex to the pending radiance: irradiance `e`, by a kernel of `radius`.
fn wait(
    (path, v, key): (&PathState, &Vertex<'_>, u32),
    (albedo, place): (Rgb, Place),
    (e, radius): (Rgb, f32),
    pending: &mut Vec<Pending>,
) {
    if !e.is_black() {
        let probe = Probe { place, radius, time: path.ray.time, stream: v.stream.domain(key) };
        pending.push(Pending { owner: path.sample, radiance: path.beta * albedo * e * FRAC_1_PI, probe });
    }
}

/// Radiance that the Lambertian part of a vertex reflects by all photons, as far as it needs no correction, and the
/// distance of these photons; what needs correction is left pending.
fn reflected(
    maps: &PhotonMaps,
    path: &PathState,
    v: &Vertex<'_>,
    part: &Lambertian<'_>,
    (scratch, pending): (&mut GatherScratch, &mut Vec<Pending>),
) -> (Rgb, f32) {
    let (mut radiance, mut reach) = (Rgb::BLACK, 0.0_f32);
    for (i, (albedo, place)) in (0..).zip(sides(v, part)) {
        let answer = maps.irradiance(&place, scratch);
        reach = reach.max(answer.reach);
        radiance += albedo * answer.known * FRAC_1_PI;
        wait((path, v, GLOBAL + i), (albedo, place), answer.global, pending);
        wait((path, v, CAUSTIC + i), (albedo, place), answer.caustic, pending);
    }
    (radiance, reach)
}

/// The Lambertian part as a BSDF.
fn only_lambertian<'a>(v: &Vertex<'a>, part: &Lambertian<'_>) -> SurfaceBsdf<'a> {
    let (reflectance, transmittance) = (part.reflectance, part.transmittance);
    let bsdf = if transmittance.is_black() {
        Bsdf::Diffuse(Diffuse { reflectance })
    } else {
        Bsdf::DiffuseTransmission(DiffuseTransmission { reflectance, transmittance })
    };
    SurfaceBsdf { bsdf, ..v.bsdf }
}

/// Guide from the photons around a vertex.
fn guide(maps: &PhotonMaps, place: &Place, frame: &Frame, fraction: f32, scratch: &mut GatherScratch) -> Guide {
    let mut photons = Vec::new();
    if fraction > 0.0 {
        let search = match maps.search {
            Search::Nearest { max_radius, .. } => Search::Nearest { count: GUIDES, max_radius },
            Search::Radius(radius) => Search::Radius(radius),
        };
        maps.global.gather(place, search, scratch, |photon, _| {
            if !photon.is_primary() {
                photons.push((frame.to_local(photon.wi()), photon.power().luminance()));
            }
        });
    }
    Guide::new(photons, fraction)
}

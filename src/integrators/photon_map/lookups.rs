//! Lookups in the maps at Lambertian surfaces, with corrections of boundary bias and requests of final gathers.

use super::boundary::{Boundary, Probe};
use super::maps::{DensityEstimate, PhotonMaps};
use crate::bsdfs::{Bsdf, Diffuse, DiffuseTransmission, Lambertian};
use crate::direct::ShadingPoint;
use crate::film::PixelSample;
use crate::integrators::path::{BatchVertices, PathVertex, Shading};
use crate::materials::SurfaceBsdf;
use crate::photons::{GatherPoint, GatherScratch};
use crate::scene::RenderJob;
use crate::settings::{IntegratorSettings, PhotonMapSettings};
use lumiris_numbers::math::{Rgb, Vec3};
use lumiris_numbers::samplers::SampleStream;
use std::f32::consts::FRAC_1_PI;

/// Random-number domains of the kernel trials there, one per side.
const CAUSTIC: u32 = 5;
const GLOBAL: u32 = 7;

/// Lookups in the maps, with pending corrections and gather requests.
#[derive(Debug, Default)]
pub(super) struct Lookups {
    pub(super) scratch: GatherScratch,
    pub(super) requests: Vec<GatherRequest>,
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
pub(super) struct GatherRequest {
    /// Index of the camera sample.
    pub(super) sample: u32,
    /// Weight of radiance sampled with the cosine density: throughput times albedo.
    pub(super) beta: Rgb,
    /// Index of the vertex along its path, from 0.
    pub(super) vertex: u32,
    pub(super) point: GatherPoint,
    pub(super) p_error: Vec3,
    pub(super) time: f32,
    pub(super) stream: SampleStream,
    /// Pixel width, and its growth per unit length.
    pub(super) width: f32,
    pub(super) spread: f32,
}

impl Lookups {
    /// Looks up caustics. The remaining light is requested by a final gather, or looked up as well if gathering is
    /// disabled.
    pub(super) fn look_up(
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
                time: v.ray.time,
                stream: v.stream,
                width: path.width,
                spread: path.spread,
            });
        }
    }

    /// Looks up the maps at the hits of gather rays. A ray shorter than the search radius continues as a path scattered
    /// by the Lambertian lobe.
    pub(super) fn shade_hits<'w>(
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
            let ReflectedPhotons { radiance, reach } = reflected(maps, &v, &part, &mut self.scratch, &mut self.pending);
            let is_near = point.p.distance(v.ray.o) < reach;
            if !is_near {
                out[path.sample as usize].radiance += path.beta * radiance;
                return Shading::default();
            }

            // Too near: caustics, direct light and another segment instead
            self.pending.truncate(first);
            for (i, side) in (0..).zip(sides(point, &part)) {
                wait(&v, CAUSTIC + i, &side, maps.caustics(&side.point, &mut self.scratch), &mut self.pending);
            }
            let direct = Some(only_lambertian(&point.bsdf, &part));
            let before = self.requests[(path.sample / rays_per_request) as usize].vertex;
            Shading { direct, next: direct.filter(|_| before + vertices.vertex + 2 < settings.depth()) }
        };
        vertices.each().map(shading).collect()
    }

    /// Adds the pending radiance, multiplied by the numbers of trials.
    pub(super) fn correct(&mut self, job: &RenderJob, out: &mut [PixelSample]) {
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
        let probe = Probe { point, radius, time: v.ray.time, stream: v.stream.domain(key) };
        pending.push(Pending { owner: path.sample, radiance: path.beta * albedo * e * FRAC_1_PI, probe });
    }
}

/// Light of photons that a Lambertian lobe reflects.
#[derive(Clone, Copy, Debug)]
struct ReflectedPhotons {
    /// Radiance that needs no boundary correction.
    radiance: Rgb,
    /// Distance of the photons.
    reach: f32,
}

/// Reflected radiance of all photons at the Lambertian lobe. Radiance that needs the boundary correction is added to
/// `pending`.
fn reflected(
    maps: &PhotonMaps,
    v: &PathVertex<'_, '_>,
    part: &Lambertian<'_>,
    scratch: &mut GatherScratch,
    pending: &mut Vec<Pending>,
) -> ReflectedPhotons {
    let (mut radiance, mut reach) = (Rgb::BLACK, 0.0_f32);
    for (i, side) in (0..).zip(sides(&v.point, part)) {
        let answer = maps.irradiance(&side.point, scratch);
        reach = reach.max(answer.reach);
        radiance += side.albedo * answer.uncorrected * FRAC_1_PI;
        wait(v, GLOBAL + i, &side, answer.global, pending);
        wait(v, CAUSTIC + i, &side, answer.caustic, pending);
    }
    ReflectedPhotons { radiance, reach }
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

//! Irradiance caching [Ward et al. 1988]: the light that diffuse surfaces reflect is interpolated between records.
//!
//! Irradiance has two parts, E = E_sources + E_indirect [Fan et al. 2006, §5.1]. Records hold the second one
//! ([`Cached::Indirect`], direct light being estimated at every hit) or both ([`Cached::All`]). They are computed where
//! the camera looks, before the picture is ([`build()`]), and do not change after that.
//!
//! At each vertex of a camera path the Lambertian part of the BSDF ([`crate::bsdfs::Bsdf::lambertian`]) takes its irradiance from the
//! records, and the path goes on with the other lobes: mirrors, glass, coats, metals, up to the next vertex, which does the
//! same. Where no record serves a vertex, its path goes on as in `path`. So no light is counted twice or lost.
//!
//! Biased: irradiance is interpolated, the base below a coat is taken for Lambertian, and the light of a record counts its
//! bounces from the record, whatever mirrors lie before it; records at different times of the shutter are not told apart.
//! Where nothing is interpolated, the answer is that of `path`.
//!
//! Reading order: [`gradients`], [`record`], [`octree`], [`cache`], [`gather`], [`mod@build`]; this file renders.

pub mod build;
pub mod cache;
pub mod gather;
pub mod gradients;
pub mod octree;
pub mod record;

pub use build::{BuildStats, build};
pub use cache::IrradianceCache;
pub use record::Record;

use super::path::{self, CameraSample, PathIntegrator, PathStats, Vertex};
use crate::bsdfs::Bsdf;
use crate::direct::{Fits, ShadePoint};
use crate::film::PixelSample;
use crate::materials::SurfaceBsdf;
use crate::math::{Rgb, Vec3};
use crate::scene::{Cached, IntegratorSettings, World};
use std::f32::consts::FRAC_1_PI;

/// How often vertices were served.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LookupStats {
    /// Diffuse vertices of camera paths.
    pub lookups: u64,
    /// Those that no record served, which path tracing took over.
    pub fallbacks: u64,
}

impl LookupStats {
    /// Adds the counts of another worker.
    pub fn merge(&mut self, other: &LookupStats) {
        self.lookups += other.lookups;
        self.fallbacks += other.fallbacks;
    }
}

/// Renders with a cache; holds the buffers of one worker.
#[derive(Debug, Default)]
pub struct CacheIntegrator {
    paths: PathIntegrator,
    lookups: LookupStats,
}

/// What a vertex does with its light.
struct Shading<'w> {
    /// Radiance that needs no more samples.
    known: Rgb,
    /// What direct light is estimated for; `None` if that is known.
    lit: Option<SurfaceBsdf<'w>>,
    /// What the path goes on by; `None` if it ends.
    next: Option<SurfaceBsdf<'w>>,
}

impl CacheIntegrator {
    /// The counts and times since the last call.
    pub fn take_stats(&mut self) -> (PathStats, LookupStats) {
        (self.paths.take_stats(), std::mem::take(&mut self.lookups))
    }

    /// Estimates the radiance of each camera sample; `out[i]` belongs to `samples[i]`. `fits` are those of the samples' pixels.
    pub fn trace(
        &mut self,
        world: &World,
        cache: &IrradianceCache,
        samples: &[CameraSample],
        fits: &mut Fits,
        out: &mut Vec<PixelSample>,
    ) {
        let settings = &world.scene.integrator;
        let depth = settings.depth();
        self.paths.start(samples, out);
        for vertex in 0..=depth {
            if self.paths.active.is_empty() {
                break;
            }
            let vertices = self.paths.find_vertices(world, vertex, depth, samples, out);
            let split = settings.split_at_vertex(vertex);
            let shadings: Vec<Shading<'_>> = vertices.iter().map(|v| self.shade(cache, v)).collect();
            let points: Vec<ShadePoint<'_>> = (vertices.iter().zip(&self.paths.active))
                .map(|(v, path)| {
                    let split = if vertex == 0 { samples[path.sample as usize].split } else { split };
                    v.shade_point(path.ray.time, split, samples[path.sample as usize].fit)
                })
                .collect();
            self.light(world, &settings.at_vertex(vertex), (&shadings, &points), fits, out);
            self.extend(settings, vertex, (&vertices, &shadings, &points));
        }
    }

    /// Asks the cache.
    fn shade<'w>(&mut self, cache: &IrradianceCache, v: &Vertex<'w>) -> Shading<'w> {
        let by_path = Shading { known: Rgb::BLACK, lit: Some(v.bsdf), next: Some(v.bsdf) };
        let Some(part) = v.bsdf.lambertian(v.wo) else { return by_path };
        self.lookups.lookups += 1;
        let ns = viewer_normal(v);
        let mut known = Rgb::BLACK;
        for (albedo, ns) in [(part.reflectance, ns), (part.transmittance, -ns)] {
            if albedo.is_black() {
                continue;
            }
            let Some(e) = cache.irradiance(v.surface.p, ns) else {
                self.lookups.fallbacks += 1;
                return by_path;
            };
            known += albedo * e * FRAC_1_PI;
        }
        let rest = part.rest.map(|bsdf: Bsdf<'w>| SurfaceBsdf { bsdf, ..v.bsdf });
        let lit = match cache.settings().cached {
            Cached::Indirect => Some(v.bsdf),
            Cached::All => rest,
        };
        Shading { known, lit, next: rest }
    }

    /// Adds what is known, and estimates of the direct light that is not.
    fn light(
        &mut self,
        world: &World,
        settings: &IntegratorSettings,
        (shadings, points): (&[Shading<'_>], &[ShadePoint<'_>]),
        fits: &mut Fits,
        out: &mut [PixelSample],
    ) {
        let paths = &mut self.paths;
        for (path, shading) in paths.active.iter().zip(shadings) {
            out[path.sample as usize].radiance += path.beta * shading.known;
        }
        let lit: Vec<ShadePoint<'_>> = (shadings.iter().zip(points))
            .filter_map(|(shading, point)| shading.lit.map(|bsdf| ShadePoint { bsdf, ..*point }))
            .collect();
        paths.direct.estimate(world, settings, &lit, fits, &mut paths.radiance);
        let lit_paths = paths.active.iter().zip(shadings).filter(|(_, shading)| shading.lit.is_some());
        for ((path, _), &radiance) in lit_paths.zip(&paths.radiance) {
            out[path.sample as usize].radiance += path.beta * radiance;
        }
    }

    /// Goes on with the paths that have a lobe to go on by.
    fn extend(
        &mut self,
        settings: &IntegratorSettings,
        vertex: u32,
        (vertices, shadings, points): (&[Vertex<'_>], &[Shading<'_>], &[ShadePoint<'_>]),
    ) {
        let paths = &mut self.paths;
        paths.next.clear();
        if vertex + 1 < settings.depth() {
            let all = paths.active.iter().zip(vertices).zip(shadings).zip(points);
            paths.next.extend(all.filter_map(|(((path, v), shading), point)| {
                let v = Vertex { bsdf: shading.next?, ..*v };
                Some(path::extend(path, &v, point, vertex, settings)?.0)
            }));
        }
        std::mem::swap(&mut paths.active, &mut paths.next);
    }
}

/// The shading normal on the side of the viewer.
fn viewer_normal(v: &Vertex<'_>) -> Vec3 {
    let z = v.bsdf.frame.z;
    if z.dot(v.wo) < 0.0 { -z } else { z }
}

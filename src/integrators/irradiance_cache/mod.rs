//! Irradiance caching [Ward et al. 1988]: the light that diffuse surfaces reflect is interpolated between records.
//!
//! Irradiance has two parts, E = E_sources + E_indirect [Fan et al. 2006, §5.1]. Records hold either the second one
//! ([`Cached::Indirect`]; direct light is estimated at every hit) or both ([`Cached::All`]). They are computed where
//! the camera looks, before rendering ([`build()`]), and do not change after that.
//!
//! Camera paths take the light reflected by the Lambertian part of a BSDF from the records, and continue with the other
//! lobes (`diffuse.rs`).
//!
//! Biased: irradiance is interpolated, the base below a coat is treated as Lambertian, and the bounces of a record's
//! light are counted from the record, whatever mirrors precede it; records at different shutter times are not
//! distinguished. Where nothing is interpolated, the result is that of `path`.
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

use super::diffuse::{self, Reflected, viewer_normal};
use super::path::{CameraSample, PathIntegrator, PathStats, Vertex};
use super::segment::PathState;
use crate::bsdfs::Lambertian;
use crate::direct::Fits;
use crate::film::PixelSample;
use crate::scene::RenderJob;
use crate::settings::Cached;
use lumiris_numbers::math::Rgb;
use std::f32::consts::FRAC_1_PI;

/// Lookups and cache misses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LookupStats {
    /// Diffuse vertices of camera paths.
    pub lookups: u64,
    /// Cache misses: lookups without a usable record, where path tracing takes over.
    pub misses: u64,
}

impl LookupStats {
    /// Adds the counts of another worker.
    pub fn merge(&mut self, other: &LookupStats) {
        self.lookups += other.lookups;
        self.misses += other.misses;
    }
}

/// Renders with a cache; holds the buffers of one worker.
#[derive(Debug, Default)]
pub struct CacheIntegrator {
    paths: PathIntegrator,
    lookups: LookupStats,
}

impl CacheIntegrator {
    /// Whether features of first surfaces are left out.
    pub fn omit_features(&mut self, omit: bool) {
        self.paths.omits_features = omit;
    }

    /// The counts and times since the last call.
    pub fn take_stats(&mut self) -> (PathStats, LookupStats) {
        (self.paths.take_stats(), std::mem::take(&mut self.lookups))
    }

    /// Estimates the radiance of each camera sample; `out[i]` belongs to `samples[i]`. `fits` are those of the samples'
    /// pixels.
    pub fn trace(
        &mut self,
        job: &RenderJob,
        cache: &IrradianceCache,
        samples: &[CameraSample],
        fits: &mut Fits,
        out: &mut Vec<PixelSample>,
    ) {
        let mut lookup = Lookup { cache, stats: &mut self.lookups };
        diffuse::trace(&mut self.paths, job, &mut lookup, samples, fits, out);
    }
}

/// Queries the cache and counts lookups and misses.
struct Lookup<'a> {
    cache: &'a IrradianceCache,
    stats: &'a mut LookupStats,
}

impl Reflected for Lookup<'_> {
    fn reflected(&mut self, _: &PathState, _: u32, v: &Vertex<'_>, part: &Lambertian<'_>) -> Option<Rgb> {
        self.stats.lookups += 1;
        let ns = viewer_normal(v);
        let mut known = Rgb::BLACK;
        for (albedo, ns) in [(part.reflectance, ns), (part.transmittance, -ns)] {
            if albedo.is_black() {
                continue;
            }
            let Some(e) = self.cache.irradiance(v.surface.p, ns) else {
                self.stats.misses += 1;
                return None;
            };
            known += albedo * e * FRAC_1_PI;
        }
        Some(known)
    }

    fn has_sources(&self) -> bool {
        self.cache.settings().cached == Cached::All
    }
}

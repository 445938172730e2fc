//! Irradiance caching [Ward et al. 1988]: irradiance of diffuse surfaces is interpolated between records.
//!
//! Irradiance has two parts, E = E_sources + E_indirect [Fan et al. 2006, §5.1]. Records hold either E_indirect
//! ([`Cached::Indirect`]; direct light is estimated at every hit) or both ([`Cached::All`]). They are computed at
//! points visible to the camera, before rendering ([`build()`]), and do not change afterwards.
//!
//! Camera paths take the light reflected by Lambertian lobes from the records, and continue with the other lobes
//! (`diffuse.rs`).
//!
//! Biased: irradiance is interpolated, and the base below a coat is treated as Lambertian. The bounces of a record's
//! light are counted from the record, not counting mirrors before. Records of different shutter times are not
//! distinguished. Without interpolation, the result equals the integrator `path`.
//!
//! Reading order: [`gradients`], [`record`], [`octree`], [`cache`], [`gather`], [`mod@build`]; this file has the
//! integrator.

pub mod build;
pub mod cache;
pub mod gather;
pub mod gradients;
pub mod octree;
pub mod record;

pub use build::{BuildStats, build};
pub use cache::IrradianceCache;
pub use record::Record;

use super::path::{AtVertices, PathStats, PathTracer, PathVertex};
use super::segment::CameraSample;
pub use super::segment::LookupStats;
use super::{Cameras, Integrator, Statistics, Tracer, diffuse};
use crate::bsdfs::Lambertian;
use crate::direct::Fits;
use crate::film::{FeatureSet, PixelSample};
use crate::scene::RenderJob;
use crate::settings::Cached;
use lumiris_numbers::math::Rgb;
use std::f32::consts::FRAC_1_PI;
use std::sync::atomic::AtomicBool;

/// Statistics of an irradiance cache.
#[derive(Clone, Copy, Debug)]
pub struct CacheReport {
    /// Number of records.
    pub records: usize,
    /// Memory of the records (bytes).
    pub bytes: usize,
    /// Statistics of the build. Its ray counts are included in the counts of the image.
    pub build: BuildStats,
    /// Lookups and cache misses.
    pub lookups: LookupStats,
}

/// Renders with a cache.
#[derive(Debug)]
pub struct CacheIntegrator {
    cache: IrradianceCache,
    build: BuildStats,
}

impl CacheIntegrator {
    /// Builds the cache.
    pub fn new(job: &RenderJob, cameras: Cameras<'_>, stop: &AtomicBool) -> Self {
        let (cache, build) = build(job, job.world.scene.film.bounds, cameras, stop);
        CacheIntegrator { cache, build }
    }
}

impl Integrator for CacheIntegrator {
    fn tracer(&self, features: FeatureSet) -> Box<dyn Tracer + '_> {
        let (paths, lookups) = (PathTracer::new(features), LookupStats::default());
        Box::new(CacheTracer { cache: &self.cache, paths, lookups })
    }

    fn statistics(&self, mut paths: PathStats) -> Statistics {
        paths.merge(&self.build.paths);
        let records: Vec<[u32; 2]> = self.cache.records().iter().map(|r| r.pixel).collect();
        let bytes = self.cache.bytes();
        let cache = Some(CacheReport { records: records.len(), bytes, build: self.build, lookups: paths.lookups });
        Statistics { paths, cache, records, ..Statistics::default() }
    }
}

/// Traces with a cache.
struct CacheTracer<'c> {
    cache: &'c IrradianceCache,
    paths: PathTracer,
    lookups: LookupStats,
}

impl Tracer for CacheTracer<'_> {
    fn trace(&mut self, job: &RenderJob, samples: &[CameraSample], fits: &mut Fits, out: &mut Vec<PixelSample>) {
        let includes_direct = self.cache.settings().cached == Cached::All;
        let mut look_up = |v: &PathVertex<'_, '_>, part: &Lambertian<'_>| {
            let known = reflected(self.cache, v, part);
            self.lookups.lookups += 1;
            self.lookups.misses += u64::from(known.is_none());
            known
        };
        self.paths.search.start(job, samples, out);
        let own: &mut AtVertices<'_> =
            &mut |found, out| diffuse::shade(found, includes_direct, out, |v, part| look_up(v, part));
        self.paths.follow(job, &job.settings().integrator, Some(own), samples, fits, out);
    }

    fn take_stats(&mut self) -> PathStats {
        PathStats { lookups: std::mem::take(&mut self.lookups), ..self.paths.take_stats() }
    }
}

/// Radiance that the Lambertian lobe reflects to the viewer; `None` without usable records.
fn reflected(cache: &IrradianceCache, v: &PathVertex<'_, '_>, part: &Lambertian<'_>) -> Option<Rgb> {
    let ns = v.point.viewer_normal();
    let sides = [(part.reflectance, ns), (part.transmittance, -ns)];
    sides
        .into_iter()
        .filter(|(albedo, _)| !albedo.is_black())
        .try_fold(Rgb::BLACK, |known, (albedo, ns)| Some(known + albedo * cache.irradiance(v.point.p, ns)? * FRAC_1_PI))
}

//! The integrator with an irradiance cache.

use super::build::{BuiltCache, build};
use super::cache::IrradianceCache;
use crate::bsdfs::Lambertian;
use crate::direct::Fits;
use crate::film::{FeatureSet, PixelSample};
use crate::integrators::camera_sample::CameraSamples;
use crate::integrators::diffuse;
use crate::integrators::integrator::{Cameras, Integrator, Tracer};
use crate::integrators::path::{AtVertices, PathTracer, PathVertex};
use crate::integrators::statistics::{BuildStats, CacheReport, LookupStats, PathStats, Statistics};
use crate::scene::RenderJob;
use crate::settings::Cached;
use lumiris_numbers::math::Rgb;
use std::f32::consts::FRAC_1_PI;
use std::sync::atomic::AtomicBool;

/// Renders with a cache.
#[derive(Debug)]
pub struct CacheIntegrator {
    cache: IrradianceCache,
    build: BuildStats,
}

impl CacheIntegrator {
    /// Builds the cache.
    pub fn new(job: &RenderJob, cameras: Cameras<'_>, stop: &AtomicBool) -> Self {
        let BuiltCache { cache, stats } = build(job, cameras, stop);
        CacheIntegrator { cache, build: stats }
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
    fn trace(&mut self, job: &RenderJob, samples: &CameraSamples, fits: &mut Fits, out: &mut Vec<PixelSample>) {
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

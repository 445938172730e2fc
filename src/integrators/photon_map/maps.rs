//! The photon maps of an image: number of photons, density estimation, and precomputed irradiance.
//!
//! Without `progressive`, estimates use the k nearest photons. The final gather uses irradiance precomputed at every
//! fourth photon of the global map, at the nearest of these photons [Christensen 1999]. A pilot determines the number
//! of photon paths of all maps.
//!
//! With `progressive`, each pass has new photons and smaller radii. The mean over the passes converges with the memory
//! of one map [Knaus and Zwicker 2011].

use super::boundary::{Boundary, Probe};
use crate::direct::Vertices;
use crate::integrators::camera_sample::CameraSamples;
use crate::integrators::integrator::Cameras;
use crate::integrators::path::BatchVertices;
use crate::integrators::path_state::LastVertices;
use crate::integrators::statistics::MapStats;
use crate::integrators::vertex_search::{TraceStep, VertexSearch};
use crate::photons::{
    GatherPoint, GatherScratch, Importance, ImportanceSettings, LowImportance, Origin, Photon, PhotonBudget,
    PhotonError, PhotonMap, Search, Traced, Tracing, path_count, trace_importons, trace_photons,
};
use crate::scene::{RenderJob, World};
use crate::settings::{PhotonMapSettings, PhotonStorage};
use lumiris_numbers::math::Rgb;
use lumiris_numbers::math::hash::pcg4d;
use lumiris_numbers::samplers::{SampleStream, SamplerKind};
use rayon::prelude::*;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Irradiance is precomputed at every `RECORD_STRIDE`-th photon of the global map.
const RECORD_STRIDE: usize = 4;
/// Photons per thread and step when irradiances are computed.
const CHUNK: usize = 1024;
/// Number of photons at which radii are measured.
const PROBES: usize = 512;
/// Fraction of the visible points where p(x) may be below 1. With 0, one dark corner would set p = 1 everywhere else.
const QUANTILE: f32 = 0.1;
/// Number of boundary tests per photon, averaged for precomputed irradiance.
const TRIES: u32 = 4;
/// Seed of these tests.
const RECORD_SEED: u32 = 0x65_64_67_65;
/// Seeds of passes, and of the maps that determine the first radii.
const PASS_SEED: u32 = 0x70_68_6f_74;
const RADIUS_SEED: u32 = 0x72_61_64_69;

/// Photon maps of one pass, or of a whole image.
#[derive(Debug)]
pub struct PhotonMaps {
    pub(super) global: PhotonMap,
    pub(super) caustic: PhotonMap,
    /// Irradiance at photons of the global map, stored in place of their power.
    records: Option<PhotonMap>,
    pub(super) search: Search,
    pub(super) caustic_search: Search,
    nearest: u32,
}

/// Irradiance by density estimation.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct DensityEstimate {
    /// Irradiance (W/m²).
    pub(super) e: Rgb,
    /// Radius of the kernel.
    pub(super) radius: f32,
}

/// Irradiance (W/m²) in three parts.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Answer {
    /// Precomputed irradiance.
    pub(super) uncorrected: Rgb,
    /// By photons of the global map.
    pub(super) global: DensityEstimate,
    /// By photons of caustics.
    pub(super) caustic: DensityEstimate,
    /// Radius of the photons used.
    pub(super) reach: f32,
}

/// Builds the maps of an image.
#[derive(Debug)]
pub struct MapMaker<'a> {
    /// Ends tracing when it becomes true.
    stop: &'a AtomicBool,
    settings: PhotonMapSettings,
    max_depth: u32,
    seed: u32,
    importance: Option<Importance>,
    /// Photon paths per map. Determined before tracing, since a number that depends on the stored photons would bias
    /// the estimate.
    paths: u64,
    /// First radii of progressive maps: global, caustic.
    radii: Option<[f32; 2]>,
    /// Statistics so far.
    pub stats: MapStats,
}

impl<'a> MapMaker<'a> {
    /// Traces importons if enabled, and determines the number of photon paths per map. For progressive maps, also
    /// determines the first radii: the distance of the nearest photons at `visible`, points visible to the camera.
    pub fn new(job: &RenderJob, visible: &[GatherPoint], stop: &'a AtomicBool) -> Result<Self, PhotonError> {
        let settings = job.settings().integrator.photons;
        let max_depth = job.settings().integrator.max_depth;
        let seed = job.settings().sampling.seed;

        // Importance
        let low_importance = match settings.storage {
            PhotonStorage::All => None,
            PhotonStorage::Floor(min) => Some(LowImportance::Floor(min)),
            PhotonStorage::CutOff(min) => Some(LowImportance::CutOff(min)),
        };
        let importance = match low_importance {
            None => None,
            Some(low_importance) => {
                let settings =
                    ImportanceSettings { seed, low_importance, quantile: QUANTILE, ..ImportanceSettings::default() };
                Some(trace_importons(job, &settings)?)
            }
        };

        // Number of photon paths
        let (radii, stats) = (None, MapStats::default());
        let mut maker = MapMaker { stop, settings, max_depth, seed, importance, paths: 0, radii, stats };
        let start = Instant::now();
        let budget = PhotonBudget::Stored { global: u64::from(settings.photons), max_paths: settings.paths };
        maker.paths = path_count(job, &maker.tracing(seed), maker.importance.as_ref(), budget)?;
        maker.stats.tracing = start.elapsed();

        // First radii of progressive maps
        if let Some(progressive) = settings.progressive {
            maker.radii = Some(match progressive.radius {
                Some(radius) => [radius; 2],
                None => {
                    let traced = maker.traced(job, [0, RADIUS_SEED])?;
                    let global = PhotonMap::new(traced.global);
                    let caustic = PhotonMap::new(traced.caustic);
                    let max = job.lights.scene_radius;
                    let radius = median_reach(&global, visible, settings.nearest, max).unwrap_or(0.01 * max);
                    let at_caustics = points_of(&caustic);
                    [radius, median_reach(&caustic, &at_caustics, settings.nearest, radius).unwrap_or(radius)]
                }
            });
        }
        Ok(maker)
    }

    /// The importance that decides which photons are stored.
    pub fn importance(&self) -> Option<&Importance> {
        self.importance.as_ref()
    }

    fn tracing(&self, seed: u32) -> Tracing<'a> {
        let s = &self.settings;
        Tracing {
            seed,
            // After n scattering events, a photon is light of n + 1 bounces at its position, and of n + 2 bounces by a
            // final gather
            max_depth: self.max_depth.saturating_sub(1),
            max_global_depth: self.max_depth.saturating_sub(1 + u32::from(s.gather > 0)),
            q: s.caustic_ratio,
            memory: Some(s.memory),
            stop: Some(self.stop),
            ..Tracing::default()
        }
    }

    /// Traces photons with the random numbers of a pass.
    fn traced(&self, job: &RenderJob, [pass, purpose]: [u32; 2]) -> Result<Traced, PhotonError> {
        let [seed, ..] = pcg4d([self.seed, pass, purpose, 0]);
        let budget = PhotonBudget::Paths(self.paths);
        trace_photons(job, &self.tracing(seed), self.importance.as_ref(), budget)
    }

    /// The maps of a pass.
    pub fn make(&mut self, job: &RenderJob, pass: u32) -> Result<PhotonMaps, PhotonError> {
        let start = Instant::now();
        let traced = self.traced(job, [pass, PASS_SEED])?;
        let traced_at = Instant::now();
        self.stats.maps += 1;
        self.stats.paths += traced.paths;
        self.stats.global += traced.global.len() as u64;
        self.stats.caustic += traced.caustic.len() as u64;
        self.stats.importons = self.importance.as_ref().map_or(0, |i| i.map().len() as u64);
        let maps = self.maps(job, pass, traced);
        self.stats.bytes = self.stats.bytes.max(maps.bytes());
        self.stats.tracing += traced_at - start;
        self.stats.sorting += traced_at.elapsed();
        Ok(maps)
    }

    fn maps(&self, job: &RenderJob, pass: u32, traced: Traced) -> PhotonMaps {
        let nearest = self.settings.nearest;
        let global = PhotonMap::new(traced.global);
        let caustic = PhotonMap::new(traced.caustic);
        if let (Some(progressive), Some(radii)) = (self.settings.progressive, self.radii) {
            let [search, caustic_search] = radii.map(|r| Search::Radius(r * progressive.factor(pass)));
            return PhotonMaps { global, caustic, records: None, search, caustic_search, nearest };
        }
        let max = job.lights.scene_radius;
        // At the border of a caustic, the nearest photons are far away and unrelated
        let reach = median_reach(&caustic, &points_of(&caustic), nearest, max).unwrap_or(0.01 * max);
        let search = Search::Nearest { count: nearest, max_radius: max };
        let caustic_search = Search::Nearest { count: nearest, max_radius: 2.0 * reach };
        let mut maps = PhotonMaps { global, caustic, records: None, search, caustic_search, nearest };
        if self.settings.gather > 0 {
            maps.records = Some(PhotonMap::new(maps.irradiances(&job.world)));
        }
        maps
    }
}

impl PhotonMaps {
    /// Memory of the maps (bytes).
    pub fn bytes(&self) -> u64 {
        self.global.bytes() + self.caustic.bytes() + self.records.as_ref().map_or(0, PhotonMap::bytes)
    }

    /// Photons of the global map.
    pub fn global(&self) -> &PhotonMap {
        &self.global
    }

    /// Photons of the caustic map.
    pub fn caustic(&self) -> &PhotonMap {
        &self.caustic
    }

    /// Irradiance of all photons.
    pub(super) fn irradiance(&self, at: &GatherPoint, scratch: &mut GatherScratch) -> Answer {
        if let Some(records) = &self.records {
            // The nearest record: the second one lies on the rim of the kernel and has no weight
            let max = Search::Nearest { count: 2, max_radius: self.max_radius() };
            let mut e = None;
            let spacing = records.gather(at, max, scratch, |record, _| e = Some(record.power()));
            if let Some(uncorrected) = e {
                // The disk with k/4 records holds k photons
                let reach = spacing * (self.nearest as f32 / (2 * RECORD_STRIDE) as f32).sqrt();
                return Answer { uncorrected, reach, ..Answer::default() };
            }
        }
        let [global, caustic] = self.estimate(at, scratch);
        Answer { global, caustic, reach: global.radius, ..Answer::default() }
    }

    fn max_radius(&self) -> f32 {
        match self.search {
            Search::Nearest { max_radius, .. } => max_radius,
            Search::Radius(radius) => radius,
        }
    }

    /// Irradiance by density estimation from both maps.
    fn estimate(&self, at: &GatherPoint, scratch: &mut GatherScratch) -> [DensityEstimate; 2] {
        let mut e = Rgb::BLACK;
        let radius = self.global.gather(at, self.search, scratch, |photon, weight| e += photon.power() * weight);
        [DensityEstimate { e, radius }, self.caustics(at, scratch)]
    }

    /// Irradiance of the caustic map.
    pub(super) fn caustics(&self, at: &GatherPoint, scratch: &mut GatherScratch) -> DensityEstimate {
        let mut e = Rgb::BLACK;
        let radius =
            self.caustic.gather(at, self.caustic_search, scratch, |photon, weight| e += photon.power() * weight);
        DensityEstimate { e, radius }
    }

    /// Irradiance of scattered photons of the global map.
    pub(super) fn indirect(&self, at: &GatherPoint, scratch: &mut GatherScratch) -> DensityEstimate {
        let mut e = Rgb::BLACK;
        let radius = self.global.gather(at, self.search, scratch, |photon, weight| {
            if !photon.is_primary() {
                e += photon.power() * weight;
            }
        });
        DensityEstimate { e, radius }
    }

    /// Irradiance at every fourth photon, as photons with the irradiance in place of their power.
    fn irradiances(&self, world: &World) -> Vec<Photon> {
        let chosen: Vec<&Photon> = self.global.photons().iter().step_by(RECORD_STRIDE).collect();
        let of_chunk = |(c, chunk): (usize, &[&Photon])| {
            // Density estimates, with several boundary tests each
            let (mut scratch, mut boundary) = (GatherScratch::default(), Boundary::default());
            let (mut probes, mut parts) = (Vec::new(), Vec::new());
            for (i, photon) in chunk.iter().enumerate() {
                let point = GatherPoint::flat(photon.p(), photon.n());
                for (part, DensityEstimate { e, radius }) in self.estimate(&point, &mut scratch).into_iter().enumerate()
                {
                    if e.is_black() {
                        continue;
                    }
                    parts.push((i, e * (1.0 / TRIES as f32)));
                    let stream =
                        SampleStream::new(SamplerKind::Independent, [c as u32, i as u32], part as u32, RECORD_SEED);
                    probes.extend((0..TRIES).map(|k| Probe { point, radius, time: 0.0, stream: stream.domain(k) }));
                }
            }

            // Correct the estimates by the mean number of trials
            let mut trials = Vec::new();
            boundary.trials(world, &probes, &mut trials);
            let mut irradiances = vec![Rgb::BLACK; chunk.len()];
            for (&(i, e), trials) in parts.iter().zip(trials.chunks(TRIES as usize)) {
                irradiances[i] += e * trials.iter().sum::<u32>() as f32;
            }
            let record =
                |(photon, &e): (&&Photon, &Rgb)| Photon::new(photon.p(), photon.n(), photon.n(), e, Origin::Diffuse);
            chunk.iter().zip(&irradiances).map(record).collect::<Vec<_>>()
        };
        chosen.par_chunks(CHUNK).enumerate().map(of_chunk).collect::<Vec<_>>().concat()
    }
}

/// Diffuse points visible to the camera, spread over the image, with their normals.
pub fn visible_points(job: &RenderJob, cameras: Cameras<'_>) -> Vec<GatherPoint> {
    let b = job.world.scene.film.bounds;
    let stride = (b.area() / PROBES).max(1);
    let pixels = (0..b.area() as u32).step_by(stride).map(|i| b.pixel_at(i));
    let samples: CameraSamples = pixels.map(|pixel| cameras(pixel, 0)).collect();

    // Trace to the first vertices
    let (mut search, mut results) = (VertexSearch::default(), Vec::new());
    search.start(job, &samples, &mut results);
    let (left, mut vertices) = (Vertices::default(), Vertices::default());
    let left = LastVertices { vertices: &left, techniques: None };
    search.find(TraceStep {
        job,
        vertex: 0,
        depth: 1,
        samples: &samples,
        left,
        out: &mut results,
        vertices: &mut vertices,
    });

    // Keep Lambertian surfaces, with the normal on the side of the camera
    let first = BatchVertices { vertex: 0, paths: &search.active, vertices: &vertices };
    let points = first.each().map(|v| v.point).filter(|v| v.bsdf.lambertian(v.wo).is_some());
    points.map(|v| GatherPoint::flat(v.p, if v.bsdf.n.dot(v.wo) < 0.0 { -v.bsdf.n } else { v.bsdf.n })).collect()
}

/// Position and normal of some photons of a map.
fn points_of(map: &PhotonMap) -> Vec<GatherPoint> {
    let stride = (map.len() / PROBES).max(1);
    map.photons().iter().step_by(stride).map(|photon| GatherPoint::flat(photon.p(), photon.n())).collect()
}

/// Median over `points` of the radius that holds `nearest` photons. `None` if, at half of the points or more, `max`
/// holds fewer.
fn median_reach(map: &PhotonMap, points: &[GatherPoint], nearest: u32, max: f32) -> Option<f32> {
    let mut scratch = GatherScratch::default();
    let search = Search::Nearest { count: nearest, max_radius: max };
    let mut radii: Vec<f32> = points
        .iter()
        .map(|point| {
            let radius = map.gather(point, search, &mut scratch, |_, _| ());
            if radius > 0.0 { radius } else { max }
        })
        .collect();
    radii.sort_by(f32::total_cmp);
    radii.get(radii.len() / 2).copied().filter(|&radius| radius < max)
}

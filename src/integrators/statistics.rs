//! Counts and times of tracing, of preparations, and of a whole image.

use crate::direct::DirectStats;
use std::iter::Sum;
use std::time::Duration;

/// Counts and times.
#[derive(Clone, Copy, Debug, Default)]
pub struct PathStats {
    /// Camera rays.
    pub camera_rays: u64,
    /// Rays of later path segments.
    pub bounce_rays: u64,
    /// Time in tracing camera rays.
    pub camera_time: Duration,
    /// Time in tracing later segments.
    pub bounce_time: Duration,
    /// Time in hits, textures and materials.
    pub shade_time: Duration,
    /// Approximate number of tentative collisions in media.
    pub collisions: u64,
    /// Direct light.
    pub direct: DirectStats,
    /// Lookups in an irradiance cache.
    pub lookups: LookupStats,
}

/// Lookups and cache misses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LookupStats {
    /// Diffuse vertices of camera paths.
    pub lookups: u64,
    /// Cache misses: lookups without a usable record, where path tracing takes over.
    pub misses: u64,
}

impl PathStats {
    /// Times of the stages of tracing, without overlap.
    pub fn stages(&self) -> [(&'static str, Duration); 6] {
        [
            ("camera_rays", self.camera_time),
            ("bounce_rays", self.bounce_time),
            ("shade", self.shade_time),
            ("t1_propose", self.direct.t1),
            ("select_resolve", self.direct.select),
            ("t2_trace", self.direct.t2),
        ]
    }

    /// The part of the time `tracing` outside all stages.
    pub fn beside_stages(&self, tracing: Duration) -> Duration {
        tracing.saturating_sub(self.stages().iter().map(|(_, time)| *time).sum())
    }

    /// Adds the counts of another worker.
    pub fn merge(&mut self, other: &PathStats) {
        self.camera_rays += other.camera_rays;
        self.bounce_rays += other.bounce_rays;
        self.camera_time += other.camera_time;
        self.bounce_time += other.bounce_time;
        self.shade_time += other.shade_time;
        self.collisions += other.collisions;
        self.direct.merge(&other.direct);
        self.lookups.lookups += other.lookups.lookups;
        self.lookups.misses += other.lookups.misses;
    }
}

impl Sum for PathStats {
    fn sum<I: Iterator<Item = PathStats>>(all: I) -> Self {
        all.fold(PathStats::default(), |mut sum, stats| {
            sum.merge(&stats);
            sum
        })
    }
}

/// Counts and times of light paths.
#[derive(Clone, Copy, Debug, Default)]
pub struct LightPathStats {
    /// Light paths.
    pub paths: u64,
    /// Light paths that contribute to a pixel.
    pub connected: u64,
    /// Rays and segments traced.
    pub rays: u64,
    /// Time (s), summed over threads.
    pub time: Duration,
}

/// Statistics of building the cache.
#[derive(Clone, Copy, Debug, Default)]
pub struct BuildStats {
    /// Rounds.
    pub rounds: u32,
    /// Requests served by another record of their round.
    pub dropped: u64,
    /// Camera samples traced.
    pub camera_samples: u64,
    /// Counts and times of tracing, summed over threads.
    pub paths: PathStats,
    /// Wall-clock time.
    pub elapsed: Duration,
}

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

/// Statistics of the maps.
#[derive(Clone, Copy, Debug, Default)]
pub struct MapStats {
    /// Number of maps.
    pub maps: u64,
    /// Photon paths traced, over all maps.
    pub paths: u64,
    /// Photons in the global map, over all maps.
    pub global: u64,
    /// Photons in the caustic map, over all maps.
    pub caustic: u64,
    /// Importons of the last map.
    pub importons: u64,
    /// Maximum memory of the maps of one pass (bytes).
    pub bytes: u64,
    /// Time of tracing.
    pub tracing: Duration,
    /// Time of sorting, and of precomputing irradiance.
    pub sorting: Duration,
}

/// Statistics of an image.
#[derive(Clone, Debug, Default)]
pub struct Statistics {
    /// Counts and times, summed over threads.
    pub paths: PathStats,
    /// The irradiance cache, if there is one.
    pub cache: Option<CacheReport>,
    /// The photon maps, if there are any.
    pub photons: Option<MapStats>,
    /// Light paths, if there are any.
    pub light: Option<LightPathStats>,
    /// The pixel that requested each record of the irradiance cache.
    pub records: Vec<[u32; 2]>,
}

//! Visual importance: importons, and the probability with which a photon is stored [Keller and Wald 2000, §2.3].
//!
//! Importons are particles of importance, emitted by the camera and scattered like light [Peter and Pietrek 1998]. With
//! I(x) the density of their importance, p(x) = min(1, f·I(x)), where 1/f is the minimum of I over the hits of test
//! rays from the camera. Therefore p = 1 on all surfaces visible to the camera, and photons there keep their power.
//!
//! Where p is small, stored photons are rare and have the large power Φ/p. Either p is at least ε, which preserves the
//! expectation of every map, or photons with p < ε are dropped, which loses their light.

use super::error::PhotonError;
use super::map::{GatherPoint, GatherScratch, PhotonMap, Search};
use super::path_stream::{BATCH, domain, path_stream};
use super::photon::{Origin, Photon};
use super::walk::{Particle, WalkSettings, Walker};
use crate::bsdfs::dielectric::Transport;
use crate::scene::RenderJob;
use lumiris_numbers::math::{Rgb, Vec2, Vec3};
use rayon::prelude::*;

/// XORed with the seed of the photons, for the seeds of importons and of test rays.
const SEEDS: [u32; 2] = [0x696d_706f, 0x7465_7374];

/// Treatment of photons with low importance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LowImportance {
    /// p(x) is at least this, in (0, 1]: unbiased.
    Floor(f32),
    /// Photons with p(x) below this are dropped: biased, light is missing.
    CutOff(f32),
}

/// Settings of importon tracing.
#[derive(Clone, Copy, Debug)]
pub struct ImportanceSettings {
    /// Importance maps of different seeds are independent.
    pub seed: u32,
    /// Number of importon paths.
    pub paths: u64,
    /// Maximum number of scattering events of an importon.
    pub max_depth: u32,
    /// Number of camera rays that determine the minimum importance.
    pub test_rays: u64,
    /// Fraction of the test rays whose importance may be below 1/f; 0 takes the minimum.
    pub quantile: f32,
    /// Importons per query.
    pub count: u32,
    /// Maximum radius of a query, relative to the radius of the scene.
    pub max_radius: f32,
    /// Treatment of photons with low importance.
    pub low_importance: LowImportance,
}

impl Default for ImportanceSettings {
    fn default() -> Self {
        ImportanceSettings {
            seed: 0,
            paths: 100_000,
            max_depth: 4,
            test_rays: 1024,
            quantile: 0.0,
            count: 40,
            max_radius: 0.05,
            low_importance: LowImportance::Floor(0.01),
        }
    }
}

/// The probability p(x) of storing a photon.
#[derive(Clone, Debug)]
pub struct Importance {
    map: PhotonMap,
    /// The factor f.
    scale: f32,
    search: Search,
    low_importance: LowImportance,
    rays: u64,
}

impl Importance {
    /// p(x), for photons that arrive at `p` on the side of the geometric normal `n`.
    pub fn probability(&self, p: Vec3, n: Vec3, scratch: &mut GatherScratch) -> f32 {
        let important = (self.scale * density(&self.map, p, n, self.search, scratch)).min(1.0);
        match self.low_importance {
            LowImportance::Floor(min) => important.max(min),
            LowImportance::CutOff(min) if important < min => 0.0,
            LowImportance::CutOff(_) => important,
        }
    }

    /// True if maps built with it have the correct expectation.
    pub fn is_unbiased(&self) -> bool {
        matches!(self.low_importance, LowImportance::Floor(_))
    }

    /// The importons.
    pub fn map(&self) -> &PhotonMap {
        &self.map
    }

    /// f, the reciprocal of the importance density at which p reaches 1 (m²).
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// Number of rays traced for importons and tests.
    pub fn rays(&self) -> u64 {
        self.rays
    }
}

/// Importance per area (1/m²).
fn density(map: &PhotonMap, p: Vec3, n: Vec3, search: Search, scratch: &mut GatherScratch) -> f32 {
    map.irradiance(&GatherPoint::flat(p, n), search, scratch).average()
}

/// Traces importons on all threads of the current pool.
pub fn trace_importons(job: &RenderJob, settings: &ImportanceSettings) -> Result<Importance, PhotonError> {
    if settings.paths == 0 || settings.test_rays == 0 {
        return Err(PhotonError::NothingRequested);
    }
    let (LowImportance::Floor(min) | LowImportance::CutOff(min)) = settings.low_importance;
    if !(min > 0.0 && min <= 1.0) {
        return Err(PhotonError::InvalidProbability(min));
    }

    // The map
    let Importons { importons, rays } = trace(job, settings.seed ^ SEEDS[0], settings.paths, settings.max_depth, false);
    let map = PhotonMap::new(importons);
    let search =
        Search::Nearest { count: settings.count.max(2), max_radius: settings.max_radius * job.lights.scene_radius };

    // The scale, from the first diffuse surfaces visible to the camera
    let visible = trace(job, settings.seed ^ SEEDS[1], settings.test_rays, settings.max_depth, true);
    let rays = rays + visible.rays;
    let importance = |scratch: &mut GatherScratch, at: &Photon| density(&map, at.p(), at.n(), search, scratch);
    let mut sorted: Vec<f32> = visible.importons.par_iter().map_init(GatherScratch::default, importance).collect();
    sorted.retain(|&importance| importance > 0.0 && importance.is_finite());
    sorted.sort_by(f32::total_cmp);
    let index = (settings.quantile.clamp(0.0, 1.0) * sorted.len() as f32) as usize;
    let min = sorted.get(index.min(sorted.len().saturating_sub(1))).ok_or(PhotonError::CameraSeesNothing)?;
    Ok(Importance { scale: 1.0 / min, map, search, low_importance: settings.low_importance, rays })
}

/// Importons at their arrivals: `paths` paths of at most `max_depth` scattering events.
pub fn importons(job: &RenderJob, seed: u32, paths: u64, max_depth: u32) -> Vec<Photon> {
    trace(job, seed ^ SEEDS[0], paths, max_depth, false).importons
}

/// Importons at their arrivals.
struct Importons {
    importons: Vec<Photon>,
    /// Number of rays.
    rays: u64,
}

/// Traces importons. If `only_first`, only the first hit of each path.
fn trace(job: &RenderJob, seed: u32, count: u64, max_depth: u32, only_first: bool) -> Importons {
    let settings = WalkSettings { transport: Transport::Radiance, max_depth };
    let power = Rgb::splat((1.0 / count as f64) as f32);
    let batches: Vec<Importons> = (0..count.div_ceil(BATCH) as usize)
        .into_par_iter()
        .with_max_len(1)
        .map_init(Walker::default, |walker, i| {
            let begin = i as u64 * BATCH;
            let paths = begin..(begin + BATCH).min(count);
            walker.traced = 0;
            walker.active.clear();
            walker.active.extend((0..).zip(paths).map(|(i, t)| emit(job, seed, i, t, power)));
            let mut importons: Vec<(u32, Photon)> = Vec::new();
            walker.walk(job, &settings, |hit| {
                let (wi, n, particle) = (hit.wi, hit.n, hit.particle);
                let importon = |wi, n| (particle.index, Photon::new(hit.p, wi, n, particle.power, particle.origin));
                if !hit.part.reflectance.is_black() {
                    importons.push(importon(wi, n));
                }
                // Light on the other side matters as well
                if !hit.part.transmittance.is_black() {
                    importons.push(importon(wi - n * (2.0 * wi.dot(n)), -n));
                }
            });
            importons.sort_by_key(|(index, _)| *index);
            if only_first {
                importons.dedup_by_key(|(index, _)| *index);
            }
            let importons = importons.into_iter().map(|(_, importon)| importon).collect();
            Importons { importons, rays: walker.traced }
        })
        .collect();
    let rays = batches.iter().map(|batch| batch.rays).sum();
    Importons { importons: batches.into_iter().flat_map(|batch| batch.importons).collect(), rays }
}

/// An importon that leaves the camera at a random point of the image.
fn emit(job: &RenderJob, seed: u32, index: u32, path: u64, power: Rgb) -> Particle {
    let stream = path_stream(seed, path);
    let [x, y, lens_u, lens_v] = stream.domain(domain::EMISSION).draw::<4>();
    let [u_time] = stream.domain(domain::TIME).draw::<1>();
    let bounds = &job.world.scene.film.bounds;
    let film = Vec2::new(
        bounds.x0 as f32 + x * bounds.width() as f32,
        bounds.y0 as f32 + y * (bounds.area() as f32 / bounds.width().max(1) as f32),
    );
    let ray = job.world.scene.camera.ray(film, [lens_u, lens_v], u_time);
    Particle::new(index, ray.ray, power * ray.weight, Origin::Primary(0), stream)
}

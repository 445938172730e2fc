//! Photon tracing: random walks from the lights in batches, assembled in the order of the photon paths.
//!
//! The random numbers of a photon path determine the light, the emitted ray, and every scattering event. The stored
//! photons depend only on the scene, the settings and the number of photon paths, which is fixed before tracing; see
//! [`path_count`].
//!
//! The photons of the global map (from lights, and scattered by Lambertian surfaces) and those of caustics come from
//! the same photon paths, of which there are more than the global map needs, so that the caustic map is finer [Keller
//! and Wald 2000, §2.3]: the first ⌊qN⌋ of N paths fill both maps, the others only the caustic map. Photons are stored
//! with probability p(x), by which their powers are divided.

use super::error::PhotonError;
use super::importance::Importance;
use super::light_distribution::LightDistribution;
use super::map::GatherScratch;
use super::path_stream::{BATCH, domain, path_stream};
use super::photon::{Origin, Photon};
use super::walk::{Particle, ParticleHit, WalkSettings, Walker};
use crate::bsdfs::dielectric::Transport;
use crate::lights::LightSet;
use crate::lights::sample_columns::ChosenLight;
use crate::scene::RenderJob;
use lumiris_numbers::math::Ray;
use lumiris_numbers::math::hash::pcg4d;
use lumiris_numbers::math::ray::offset_origin;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Batches between two checks of the memory limit.
const ROUND: u64 = 32;
/// Photon paths of the first round of a pilot; each later round doubles the number traced.
const PILOT_PATHS: u64 = 128;
/// A pilot stores the requested number of photons divided by this.
const PILOT_DIVISOR: u64 = 8;
/// Minimum and maximum number of photons of a pilot.
const PILOT_PHOTONS: [u64; 2] = [1024, 16_384];
/// Seed of pilots.
const PILOT_SEED: u32 = 0x70_69_6c_6f;
/// Bytes per photon in a map, including the tree.
const BYTES: u64 = 31;

/// Settings of photon tracing.
#[derive(Clone, Copy, Debug)]
pub struct Tracing<'a> {
    /// Maps of different seeds are independent.
    pub seed: u32,
    /// Maximum number of scattering events before a photon is stored; 0 stores only photons straight from lights.
    pub max_depth: u32,
    /// The same for photons of the global map.
    pub max_global_depth: u32,
    /// Fraction q of the photon paths that fill the global map, in (0, 1].
    pub q: f32,
    /// Fraction of the photon paths distributed evenly over the lights, whatever their powers (0..1).
    pub floor: f32,
    /// Weights of the lights that replace their powers.
    pub light_weights: Option<&'a [f32]>,
    /// Maximum number of photon paths of a pilot. Storing no photon by then is an error.
    pub max_in_pilot: u64,
    /// Stops tracing between two rounds when it becomes true.
    pub stop: Option<&'a AtomicBool>,
    /// Maximum memory of the maps (bytes).
    pub memory: Option<u64>,
}

impl Default for Tracing<'_> {
    fn default() -> Self {
        Tracing {
            seed: 0,
            max_depth: 16,
            max_global_depth: 16,
            q: 1.0,
            floor: 0.1,
            light_weights: None,
            max_in_pilot: 1_000_000,
            stop: None,
            memory: None,
        }
    }
}

impl Tracing<'_> {
    /// The distribution of photon paths over the lights; `None` if no light has emission.
    pub fn light_distribution(&self, lights: &LightSet) -> Option<LightDistribution> {
        match self.light_weights {
            None => LightDistribution::new(lights, self.floor),
            Some(weights) => LightDistribution::by_weights(lights, self.floor, |light| weights[light as usize]),
        }
    }
}

/// The amount of photon tracing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhotonBudget {
    /// N photon paths.
    Paths(u64),
    /// The number of photon paths that stores about the given number of photons; see [`path_count`].
    Stored {
        /// Photons of the global map.
        global: u64,
        /// Maximum number of photon paths.
        max_paths: u64,
    },
}

/// The result of photon tracing.
#[derive(Clone, Debug, Default)]
pub struct Traced {
    /// Photons from lights and from Lambertian surfaces, in the order of photon paths.
    pub global: Vec<Photon>,
    /// Photons whose last scattering was not Lambertian.
    pub caustic: Vec<Photon>,
    /// N, the number of photon paths.
    pub paths: u64,
    /// Number of photon paths that filled the global map.
    pub global_paths: u64,
    /// Photons that arrived at Lambertian surfaces, stored or not, on photon paths of either map.
    pub arrivals: u64,
    /// Number of rays traced.
    pub rays: u64,
    /// Elapsed time.
    pub elapsed: Duration,
}

impl Traced {
    /// Number of photons stored.
    pub fn stored(&self) -> u64 {
        (self.global.len() + self.caustic.len()) as u64
    }

    /// Photons that arrived, per second.
    pub fn arrivals_per_second(&self) -> f64 {
        self.arrivals as f64 / self.elapsed.as_secs_f64().max(1e-9)
    }

    /// Memory of the photons (bytes).
    pub fn bytes(&self) -> u64 {
        self.stored() * size_of::<Photon>() as u64
    }
}

/// Traces photons on all threads of the current pool. The powers are scaled such that Σ weight·power of a map's photons
/// estimates its irradiance; a map without photons estimates 0.
pub fn trace_photons(
    job: &RenderJob,
    tracing: &Tracing<'_>,
    importance: Option<&Importance>,
    budget: PhotonBudget,
) -> Result<Traced, PhotonError> {
    let start = Instant::now();
    let count = path_count(job, tracing, importance, budget)?;
    let mut traced = Run::new(job, tracing, importance)?.trace(count)?;
    let per_path = |photons: &mut [Photon], count: u64| {
        let factor = (1.0 / count as f64) as f32;
        photons.par_iter_mut().for_each(|photon| *photon = photon.scaled(factor));
    };
    per_path(&mut traced.global, traced.global_paths);
    per_path(&mut traced.caustic, traced.paths);
    traced.elapsed = start.elapsed();
    Ok(traced)
}

/// The number N of photon paths that [`trace_photons`] traces. If a number of photons is requested, a pilot determines
/// N with random numbers that no map uses. Maps of N photon paths have the correct expectation for every N, while the
/// number of stored photons varies. If tracing ended with the last requested photon instead, powers would be divided by
/// a random number of paths, and n photons would be too bright by about one part in n [Haldane 1945].
///
/// The pilot stores about an eighth of the photons, at least 1024 and at most 16 384; the same N can be used for many
/// maps. It is an error if the pilot stores nothing.
pub fn path_count(
    job: &RenderJob,
    tracing: &Tracing<'_>,
    importance: Option<&Importance>,
    budget: PhotonBudget,
) -> Result<u64, PhotonError> {
    match budget {
        PhotonBudget::Paths(0) | PhotonBudget::Stored { global: 0, .. } | PhotonBudget::Stored { max_paths: 0, .. } => {
            Err(PhotonError::NothingRequested)
        }
        PhotonBudget::Paths(count) => Ok(count),
        PhotonBudget::Stored { global, max_paths } => {
            let tracing = Tracing { seed: pilot_seed(tracing.seed), ..*tracing };
            Run::new(job, &tracing, importance)?.pilot(global, max_paths)
        }
    }
}

/// A photon with the index of its path.
type Deposit = (u64, Photon);

/// The photons stored by a batch, in the order of photon paths.
#[derive(Default)]
struct Batch {
    global: Vec<Deposit>,
    caustic: Vec<Deposit>,
    arrivals: u64,
    rays: u64,
}

struct Run<'a> {
    job: &'a RenderJob,
    tracing: &'a Tracing<'a>,
    importance: Option<&'a Importance>,
    light_distribution: LightDistribution,
}

impl<'a> Run<'a> {
    fn new(
        job: &'a RenderJob,
        tracing: &'a Tracing<'a>,
        importance: Option<&'a Importance>,
    ) -> Result<Self, PhotonError> {
        let lights = &job.lights;
        if lights.lights.is_empty() {
            return Err(PhotonError::NoLight);
        }
        if !(tracing.q > 0.0 && tracing.q <= 1.0) {
            return Err(PhotonError::InvalidRatio(tracing.q));
        }
        let light_distribution = tracing.light_distribution(lights).ok_or(PhotonError::NoEmission)?;
        Ok(Run { job, tracing, importance, light_distribution })
    }

    /// Number of photon paths of the global map among `all`.
    fn global_part(&self, all: u64) -> u64 {
        ((f64::from(self.tracing.q) * all as f64) as u64).max(1)
    }

    /// The number of photon paths that store about `wanted` photons in the global map, from paths with a separate seed.
    fn pilot(&self, wanted: u64, max: u64) -> Result<u64, PhotonError> {
        let enough = (wanted / PILOT_DIVISOR).clamp(PILOT_PHOTONS[0], PILOT_PHOTONS[1]);
        let limit = self.tracing.max_in_pilot.min(max);
        let (mut traced, mut global, mut stored, mut arrivals) = (0, 0, 0, 0);
        while global < enough && traced < limit {
            self.check_stop(traced)?;
            let end = (2 * traced).max(PILOT_PATHS).min(traced + ROUND * BATCH).min(limit);
            for batch in self.round(traced..end, u64::MAX) {
                global += batch.global.len() as u64;
                stored += (batch.global.len() + batch.caustic.len()) as u64;
                arrivals += batch.arrivals;
            }
            traced = end;
        }
        if stored == 0 {
            return Err(PhotonError::NothingStored { paths: traced, by_importance: arrivals > 0 });
        }

        // If only caustics are stored, use the number of paths of the pilot
        let of_global = if global > 0 { wanted as f64 * traced as f64 / global as f64 } else { traced as f64 };
        Ok(((of_global / f64::from(self.tracing.q)).ceil() as u64).clamp(1, max))
    }

    fn check_stop(&self, paths: u64) -> Result<(), PhotonError> {
        let is_stopped = self.tracing.stop.is_some_and(|stop| stop.load(Ordering::Relaxed));
        if is_stopped { Err(PhotonError::Stopped { paths }) } else { Ok(()) }
    }

    /// Traces `count` photon paths, round by round.
    fn trace(&self, count: u64) -> Result<Traced, PhotonError> {
        let global_paths = self.global_part(count);
        let mut traced = Traced { global_paths, ..Traced::default() };
        while traced.paths < count {
            self.check_stop(traced.paths)?;
            let end = (traced.paths + ROUND * BATCH).min(count);
            for batch in self.round(traced.paths..end, global_paths) {
                traced.global.extend(batch.global.into_iter().map(|(_, photon)| photon));
                traced.caustic.extend(batch.caustic.into_iter().map(|(_, photon)| photon));
                traced.arrivals += batch.arrivals;
                traced.rays += batch.rays;
            }
            traced.paths = end;
            if let Some(limit) = self.tracing.memory.filter(|limit| traced.stored() * BYTES > *limit) {
                return Err(PhotonError::OutOfMemory { limit, photons: traced.stored() });
            }
        }
        Ok(traced)
    }

    /// Traces a range of photon paths in parallel; the results are in their order.
    fn round(&self, paths: Range<u64>, global: u64) -> Vec<Batch> {
        let batches = (paths.end - paths.start).div_ceil(BATCH) as usize;
        (0..batches)
            .into_par_iter()
            .with_max_len(1)
            .map_init(<(Walker, GatherScratch)>::default, |(walker, scratch), i| {
                let begin = paths.start + i as u64 * BATCH;
                self.batch(walker, scratch, begin..(begin + BATCH).min(paths.end), global)
            })
            .collect()
    }

    fn batch(&self, walker: &mut Walker, scratch: &mut GatherScratch, paths: Range<u64>, global: u64) -> Batch {
        walker.traced = 0;
        walker.active.clear();
        walker.active.extend((0_u32..).zip(paths.clone()).filter_map(|(i, t)| self.emit(i, t)));
        let settings = WalkSettings { transport: Transport::Importance, max_depth: self.tracing.max_depth };
        let mut batch = Batch::default();
        walker.walk(self.job, &settings, |hit| {
            if hit.part.reflectance.is_black() && hit.part.transmittance.is_black() {
                return;
            }
            batch.arrivals += 1;
            let path = paths.start + u64::from(hit.particle.index);
            self.deposit(&mut batch, hit, path, path < global, scratch);
        });
        batch.rays = walker.traced;
        // Stable sort from the order of vertices to the order of photon paths
        batch.global.sort_by_key(|(t, _)| *t);
        batch.caustic.sort_by_key(|(t, _)| *t);
        batch
    }

    /// A photon that leaves a light.
    fn emit(&self, index: u32, path: u64) -> Option<Particle> {
        let scene = &self.job.world.scene;
        let stream = path_stream(self.tracing.seed, path);
        let ChosenLight { light, pmf } = self.light_distribution.sample(stream.domain(domain::LIGHT).draw::<2>());
        let [p0, p1, d0, d1] = stream.domain(domain::EMISSION).draw::<4>();
        let s = scene.lights.lights[light as usize].sample_le(scene.lights.scene_sphere(), [p0, p1], [d0, d1])?;
        let o = if s.n == glam::Vec3::ZERO { s.p } else { offset_origin(s.p, s.p_error, s.n, s.d) };
        let [u_time] = stream.domain(domain::TIME).draw::<1>();
        let ray = Ray { o, d: s.d, t_max: f32::INFINITY, time: u_time };
        Some(Particle::new(index, ray, s.power / pmf, Origin::Primary(light), stream))
    }

    /// Decides whether a hit is stored, and stores it.
    fn deposit(
        &self,
        batch: &mut Batch,
        hit: &ParticleHit<'_>,
        path: u64,
        fills_global: bool,
        scratch: &mut GatherScratch,
    ) {
        // The map, by the last scattering event
        let particle = hit.particle;
        let deposits = match particle.origin {
            Origin::Caustic => &mut batch.caustic,
            Origin::Primary(_) | Origin::Diffuse
                if !fills_global || hit.scatterings > self.tracing.max_global_depth =>
            {
                return;
            }
            Origin::Primary(_) | Origin::Diffuse => &mut batch.global,
        };

        // Russian roulette by visual importance
        let p = self.importance.map_or(1.0, |importance| importance.probability(hit.p, hit.n, scratch));
        if hit.xi() < p {
            let power = particle.power * (1.0 / p);
            deposits.push((path, Photon::new(hit.p, hit.wi, hit.n, power, particle.origin)));
        }
    }
}

/// The seed of the pilot of maps of `seed`.
fn pilot_seed(seed: u32) -> u32 {
    let [pilot, ..] = pcg4d([seed, PILOT_SEED, 0, 0]);
    pilot
}

//! Photon tracing: random walks from the lights in batches, put together in the order of trajectories.
//!
//! Trajectory t is a point of a scrambled Sobol' sequence over path space [Keller 1998, ch. 3; Burley 2020], whose
//! numbers choose the light, where and which way the photon leaves it, and every scattering. The sequence has 2¹⁶
//! points, so trajectories come in blocks of as many, which are scrambled independently. What is stored depends on the
//! scene, the settings and the number of trajectories only.
//!
//! Photons that the global map holds (from lights, and scattered by Lambertian surfaces) and those of caustics come
//! from the same trajectories, see [`super::rules`].

use super::error::PhotonError;
use super::importance::Importance;
use super::map::GatherScratch;
use super::photon::{Origin, Photon};
use super::rules::{self, CausticRule};
use super::shares::LightShares;
use super::walk::{Arrival, Particle, WalkSettings, Walker};
use crate::bsdfs::dielectric::Transport;
use crate::scene::World;
use lumiris_numbers::math::hash::pcg4d;
use lumiris_numbers::math::ray::offset_origin;
use lumiris_numbers::math::{Ray, Vec2};
use lumiris_numbers::samplers::{SampleStream, SamplerKind};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Trajectories that are traced together.
pub(super) const BATCH: u64 = 4096;
/// Most batches between two looks at what is stored; there are few at first, since few photons may be wanted.
const ROUND: u64 = 32;
/// log₂ of the points of a sequence.
const SEQUENCE_BITS: u32 = 16;
/// Bytes that a photon takes in a map, tree included.
const BYTES: u64 = 31;

/// Domains below the stream of a trajectory.
pub(super) mod domain {
    pub const LIGHT: u32 = 0;
    pub const EMISSION: u32 = 1;
    pub const TIME: u32 = 2;
}

/// How photons are traced.
#[derive(Clone, Copy, Debug)]
pub struct Tracing<'a> {
    /// Maps of different seeds are independent.
    pub seed: u32,
    /// Most scatterings of a photon before it is stored; 0 stores photons straight from lights only.
    pub max_depth: u32,
    /// The same for photons of the global map.
    pub max_global_depth: u32,
    /// Ratio q of trajectories that fill the global map to all, in (0, 1].
    pub q: f32,
    /// How that is done.
    pub caustics: CausticRule,
    /// Part of the trajectories that lights share evenly, whatever their powers (0..1).
    pub floor: f32,
    /// Trajectories without a stored photon after which tracing stops with an error: at the beginning, and in a row
    /// while photons of the global map are counted.
    pub most_without_deposit: u64,
    /// Ends it between two rounds when it becomes true.
    pub stop: Option<&'a AtomicBool>,
    /// Most memory of the maps (bytes).
    pub memory: Option<u64>,
}

impl Default for Tracing<'_> {
    fn default() -> Self {
        Tracing {
            seed: 0,
            max_depth: 16,
            max_global_depth: 16,
            q: 1.0,
            caustics: CausticRule::default(),
            floor: 0.1,
            most_without_deposit: 1_000_000,
            stop: None,
            memory: None,
        }
    }
}

/// How many photons are traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Want {
    /// N trajectories.
    Trajectories(u64),
    /// As many trajectories as it takes; the last one is stored as a whole.
    Stored {
        /// Photons of the global map.
        global: u64,
        /// Trajectories after which there are as many as there are.
        most_trajectories: u64,
    },
}

/// What was traced.
#[derive(Clone, Debug, Default)]
pub struct Traced {
    /// Photons from lights and from Lambertian surfaces, in the order of trajectories.
    pub global: Vec<Photon>,
    /// Photons whose last scattering was not Lambertian.
    pub caustic: Vec<Photon>,
    /// N.
    pub trajectories: u64,
    /// Those that filled the global map.
    pub global_trajectories: u64,
    /// Photons that arrived at Lambertian surfaces, stored or not, on trajectories of either map.
    pub arrivals: u64,
    /// Rays traced.
    pub rays: u64,
    /// Time that it took.
    pub elapsed: Duration,
}

impl Traced {
    /// Photons stored.
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

/// Traces photons, on all threads of the current pool. The powers are such that Σ weight·power of a map's photons is an
/// estimate of the irradiance that it holds.
pub fn trace_photons(
    world: &World,
    tracing: &Tracing<'_>,
    importance: Option<&Importance>,
    want: Want,
) -> Result<Traced, PhotonError> {
    let start = Instant::now();
    let lights = &world.scene.lights;
    if lights.lights.is_empty() {
        return Err(PhotonError::NoLight);
    }
    let shares = LightShares::new(lights, tracing.floor).ok_or(PhotonError::NoEmission)?;
    if !(tracing.q > 0.0 && tracing.q <= 1.0) {
        return Err(PhotonError::InvalidRatio(tracing.q));
    }
    let run = Run { world, tracing, importance, shares };
    let mut traced = match want {
        Want::Trajectories(0) | Want::Stored { global: 0, .. } | Want::Stored { most_trajectories: 0, .. } => {
            return Err(PhotonError::NothingWanted);
        }
        Want::Trajectories(count) => run.trajectories(count)?,
        Want::Stored { global, most_trajectories } => run.stored(global, most_trajectories)?,
    };
    let per_trajectory = |photons: &mut [Photon], count: u64| {
        let factor = (1.0 / count as f64) as f32;
        photons.par_iter_mut().for_each(|photon| *photon = photon.scaled(factor));
    };
    per_trajectory(&mut traced.global, traced.global_trajectories);
    per_trajectory(&mut traced.caustic, traced.trajectories);
    traced.elapsed = start.elapsed();
    Ok(traced)
}

/// A photon with its trajectory.
type Deposit = (u64, Photon);

/// What a batch stored, in the order of trajectories.
#[derive(Default)]
struct Batch {
    global: Vec<Deposit>,
    caustic: Vec<Deposit>,
    arrivals: u64,
    rays: u64,
}

/// Which trajectories end up in the maps, as far as is known.
#[derive(Clone, Copy)]
struct Limits {
    global: u64,
    all: u64,
    /// True while it is not known how many trajectories the global map takes.
    is_open: bool,
}

struct Run<'a> {
    world: &'a World,
    tracing: &'a Tracing<'a>,
    importance: Option<&'a Importance>,
    shares: LightShares,
}

impl Run<'_> {
    /// The trajectories of the global map among `all`.
    fn global_part(&self, all: u64) -> u64 {
        match self.tracing.caustics {
            CausticRule::OneRule | CausticRule::TwoTests => all,
            CausticRule::FirstTrajectories => ((f64::from(self.tracing.q) * all as f64) as u64).max(1),
        }
    }

    fn trajectories(&self, count: u64) -> Result<Traced, PhotonError> {
        let limits = Limits { global: self.global_part(count), all: count, is_open: false };
        self.trace(limits, |_| limits)
    }

    fn stored(&self, wanted: u64, most: u64) -> Result<Traced, PhotonError> {
        let mut limits = Limits { global: most, all: most, is_open: true };
        let mut stored = 0;
        self.trace(limits, |round| {
            // Where the global map is full; photons of one trajectory stay together
            let before = stored;
            stored += round.iter().map(|batch| batch.global.len() as u64).sum::<u64>();
            if before < wanted && stored >= wanted {
                let mut deposits = round.iter().flat_map(|batch| &batch.global);
                let last = deposits.nth((wanted - before - 1) as usize);
                let global = last.map_or(most, |(trajectory, _)| trajectory + 1);
                let all = match self.tracing.caustics {
                    CausticRule::OneRule | CausticRule::TwoTests => global,
                    CausticRule::FirstTrajectories => (global as f64 / f64::from(self.tracing.q)).ceil() as u64,
                };
                limits = Limits { global, all: all.clamp(global, most), is_open: false };
            }
            limits
        })
    }

    /// Traces trajectories, round by round, until the limits that `look` makes of each round.
    fn trace(&self, mut limits: Limits, mut look: impl FnMut(&[Batch]) -> Limits) -> Result<Traced, PhotonError> {
        let mut traced = Traced::default();
        let mut last_deposit = 0;
        let mut batches = 1;
        while traced.trajectories < limits.all {
            if self.tracing.stop.is_some_and(|stop| stop.load(Ordering::Relaxed)) {
                return Err(PhotonError::Stopped { trajectories: traced.trajectories });
            }
            let end = (traced.trajectories + batches * BATCH).min(limits.all);
            batches = (2 * batches).min(ROUND);
            let round = self.round(traced.trajectories..end, limits.global);
            limits = look(&round);
            let counted = |traced: &Traced| if limits.is_open { traced.global.len() as u64 } else { traced.stored() };
            let before = counted(&traced);
            for batch in round {
                let kept = |deposits: Vec<Deposit>, limit: u64| {
                    deposits.into_iter().take_while(move |(t, _)| *t < limit).map(|(_, photon)| photon)
                };
                traced.global.extend(kept(batch.global, limits.global));
                traced.caustic.extend(kept(batch.caustic, limits.all));
                traced.arrivals += batch.arrivals;
                traced.rays += batch.rays;
            }
            traced.trajectories = end;
            if counted(&traced) > before {
                last_deposit = end;
            }
            let without = end - last_deposit;
            let is_vain = traced.stored() == 0 && end >= limits.all;
            let is_waiting = traced.stored() == 0 || limits.is_open;
            if is_vain || is_waiting && without >= self.tracing.most_without_deposit {
                return Err(PhotonError::NoDeposit { trajectories: without, by_importance: traced.arrivals > 0 });
            }
            if let Some(limit) = self.tracing.memory.filter(|limit| traced.stored() * BYTES > *limit) {
                return Err(PhotonError::OutOfMemory { limit, photons: traced.stored() });
            }
        }
        traced.trajectories = limits.all;
        traced.global_trajectories = limits.global;
        Ok(traced)
    }

    /// Some trajectories, in parallel, in their order.
    fn round(&self, trajectories: Range<u64>, global: u64) -> Vec<Batch> {
        let batches = (trajectories.end - trajectories.start).div_ceil(BATCH) as usize;
        (0..batches)
            .into_par_iter()
            .with_max_len(1)
            .map_init(<(Walker, GatherScratch)>::default, |(walker, scratch), i| {
                let begin = trajectories.start + i as u64 * BATCH;
                self.batch(walker, scratch, begin..(begin + BATCH).min(trajectories.end), global)
            })
            .collect()
    }

    fn batch(&self, walker: &mut Walker, scratch: &mut GatherScratch, trajectories: Range<u64>, global: u64) -> Batch {
        walker.traced = 0;
        walker.active.clear();
        walker.active.extend((0_u32..).zip(trajectories.clone()).filter_map(|(i, t)| self.emit(i, t)));
        let settings = WalkSettings { transport: Transport::Importance, max_depth: self.tracing.max_depth };
        let mut batch = Batch::default();
        walker.walk(self.world, &settings, |arrival| {
            if arrival.part.reflectance.is_black() && arrival.part.transmittance.is_black() {
                return;
            }
            batch.arrivals += 1;
            let trajectory = trajectories.start + u64::from(arrival.particle.index);
            self.deposit(&mut batch, arrival, trajectory, trajectory < global, scratch);
        });
        batch.rays = walker.traced;
        // From the order of vertices to that of trajectories; stable
        batch.global.sort_by_key(|(t, _)| *t);
        batch.caustic.sort_by_key(|(t, _)| *t);
        batch
    }

    /// A photon as it leaves a light.
    fn emit(&self, index: u32, trajectory: u64) -> Option<Particle> {
        let scene = &self.world.scene;
        let stream = trajectory_stream(self.tracing.seed, trajectory);
        let (light, pmf) = self.shares.sample(stream.domain(domain::LIGHT).draw::<2>());
        let [p0, p1, d0, d1] = stream.domain(domain::EMISSION).draw::<4>();
        let sphere = (scene.lights.scene_centre, scene.lights.scene_radius);
        let s = scene.lights.lights[light as usize].sample_le(sphere, [p0, p1], [d0, d1])?;
        let o = if s.n == glam::Vec3::ZERO { s.p } else { offset_origin(s.p, s.p_error, s.n, s.d) };
        let [u_time] = stream.domain(domain::TIME).draw::<1>();
        // The camera knows its shutter
        let time = scene.camera.ray(Vec2::splat(0.5), [0.5; 2], u_time).ray.time;
        let ray = Ray { o, d: s.d, t_max: f32::INFINITY, time };
        Some(Particle::new(index, ray, s.power / pmf, Origin::Primary(light), stream))
    }

    /// Stores an arrival, or not.
    fn deposit(
        &self,
        batch: &mut Batch,
        arrival: &Arrival<'_>,
        trajectory: u64,
        fills_global: bool,
        scratch: &mut GatherScratch,
    ) {
        let mut p = || self.importance.map_or(1.0, |importance| importance.probability(arrival.p, arrival.n, scratch));
        let xi = arrival.xi();
        let particle = arrival.particle;
        let (factor, deposits) = match particle.origin {
            Origin::Caustic => (rules::caustic(xi[0], p()), &mut batch.caustic),
            Origin::Primary(_) | Origin::Diffuse if arrival.scatterings > self.tracing.max_global_depth => return,
            Origin::Primary(_) | Origin::Diffuse => {
                let factor = self.tracing.caustics.global(self.tracing.q, fills_global, xi, p);
                (factor, &mut batch.global)
            }
        };
        if let Some(factor) = factor {
            let power = particle.power * factor;
            deposits.push((trajectory, Photon::new(arrival.p, arrival.wi, arrival.n, power, particle.origin)));
        }
    }
}

/// Random numbers of a trajectory.
pub(super) fn trajectory_stream(seed: u32, trajectory: u64) -> SampleStream {
    let block = trajectory >> SEQUENCE_BITS;
    let [block_seed, key, ..] = pcg4d([seed, block as u32, (block >> 32) as u32, 0x7068_6f74]);
    let index = (trajectory & ((1 << SEQUENCE_BITS) - 1)) as u32;
    SampleStream::new(SamplerKind::Sobol, [0, 0], index, block_seed).domain(key)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trajectories_of_different_blocks_differ() {
        let draw = |t| trajectory_stream(3, t).domain(domain::EMISSION).draw::<4>();
        for t in [0, 1, 4464, 65_535] {
            for block in 1..50 {
                assert_ne!(draw(t), draw(t + block * 65_536), "{t} {block}");
            }
        }
        assert_ne!(draw(70_000), draw(4464));
        assert_ne!(draw(7), trajectory_stream(4, 7).domain(domain::EMISSION).draw::<4>());
    }

    #[test]
    fn every_block_is_stratified() {
        for block in 0..4_u64 {
            let mut counts = [0; 256];
            for t in 0..1024 {
                let [u, v, ..] = trajectory_stream(3, block << 16 | t).domain(domain::EMISSION).draw::<4>();
                counts[(u * 16.0) as usize * 16 + (v * 16.0) as usize] += 1;
            }
            assert!(counts.iter().all(|&c| c == 4), "block {block}");
        }
    }
}

//! Photon maps of a scene, and their images: from above, and visualised directly.

use super::super::ReproduceError;
use super::super::images::Image;
use super::super::measure::{Stage, View, turns};
use super::super::method::{Method, Transport};
use super::super::page::{Block, Shown};
use super::above::Plan;
use super::seen::{Reference, Seen};
use super::setup::Setup;
use lumiris::photons::{
    GatherPoint, GatherScratch, Importance, Photon, PhotonBudget, PhotonMap, Search, Traced, Tracing, trace_photons,
};
use lumiris::scene::RenderJob;
use lumiris_numbers::math::{Rgb, Vec3};
use rayon::prelude::*;
use std::time::{Duration, Instant};

/// Maximum radius of photon searches (m): the size of furniture.
const MAX_RADIUS: f32 = 0.5;
/// Squares along the longer side of a plan: normal and quick.
const PLAN_SIZE: [u32; 2] = [400, 240];
/// Turns of a reference, whose index determines their seed.
const LONG_TURNS: std::ops::Range<u32> = 1_000_000..1_000_004;
/// Maximum number of camera rays of a turn of a reference: normal and quick.
const MAX_RAYS: [f64; 2] = [16384.0, 256.0];
/// Photon paths of the measurement of tracing speed.
const PILOT: u64 = 50_000;

/// The maps of one run of photon tracing.
pub(super) struct Maps {
    /// Photons from lights, or scattered by diffuse surfaces.
    pub global: PhotonMap,
    /// Photons scattered by other surfaces.
    pub caustic: PhotonMap,
    /// Photon paths traced.
    pub paths: u64,
    /// Photons that arrived at diffuse surfaces, per second.
    pub rate: f64,
    /// Time of tracing (s).
    pub seconds: f64,
}

impl Maps {
    /// Builds the maps of traced photons.
    pub(super) fn new(traced: Traced) -> Self {
        let (rate, seconds) = (traced.arrivals_per_second(), traced.elapsed.as_secs_f64());
        Maps {
            paths: traced.paths,
            global: PhotonMap::new(traced.global),
            caustic: PhotonMap::new(traced.caustic),
            rate,
            seconds,
        }
    }

    /// Photons stored.
    pub(super) fn stored(&self) -> usize {
        self.global.len() + self.caustic.len()
    }

    /// Memory of both (bytes).
    pub(super) fn bytes(&self) -> u64 {
        self.global.bytes() + self.caustic.bytes()
    }

    /// Positions of the photons.
    pub(super) fn positions(&self) -> Vec<Vec3> {
        [&self.global, &self.caustic].into_iter().flat_map(positions).collect()
    }

    /// The radiance of each pixel by the `count` nearest photons of each map.
    pub(super) fn image(&self, setup: &Setup<'_>, seen: &[Option<Seen>], count: u32) -> Vec<[f32; 3]> {
        show(setup, seen, &[&self.global, &self.caustic], count)
    }
}

/// Positions of the photons of a map.
pub(super) fn positions(map: &PhotonMap) -> impl Iterator<Item = Vec3> {
    map.photons().iter().map(Photon::p)
}

/// The radiance of each pixel by the `count` nearest photons of each of some maps.
pub(super) fn show(setup: &Setup<'_>, seen: &[Option<Seen>], maps: &[&PhotonMap], count: u32) -> Vec<[f32; 3]> {
    let search = Search::Nearest { count, max_radius: MAX_RADIUS };
    let pixel = |scratch: &mut GatherScratch, seen: &Option<Seen>| {
        seen.map_or([0.0; 3], |s| {
            let place = GatherPoint::flat(s.p, s.n);
            let add = |e: Rgb, map: &&PhotonMap| e + map.irradiance(&place, search, scratch);
            s.radiance(maps.iter().fold(Rgb::BLACK, add))
        })
    };
    setup.pool.install(|| seen.par_iter().map_init(GatherScratch::default, pixel).collect())
}

/// Traces photons for maps.
pub(super) fn trace(
    setup: &Setup<'_>,
    job: &RenderJob,
    tracing: &Tracing<'_>,
    importance: Option<&Importance>,
    budget: PhotonBudget,
) -> Result<Maps, ReproduceError> {
    if setup.observer.stop.load(std::sync::atomic::Ordering::Relaxed) {
        return Err(ReproduceError::Stopped);
    }
    setup.pool.install(|| Ok(Maps::new(trace_photons(job, tracing, importance, budget)?)))
}

/// Photons stored and photon paths traced per second.
pub(super) fn speed(
    setup: &Setup<'_>,
    job: &RenderJob,
    tracing: &Tracing<'_>,
    importance: Option<&Importance>,
) -> Result<[f64; 2], ReproduceError> {
    let start = Instant::now();
    let maps = trace(setup, job, tracing, importance, PhotonBudget::Paths(PILOT))?;
    let seconds = start.elapsed().as_secs_f64().max(1e-6);
    Ok([maps.stored() as f64 / seconds, maps.paths as f64 / seconds])
}

/// The path-traced image, rendered for about `time`.
pub(super) fn path_traced(setup: &Setup<'_>, stage: &mut Stage, time: Duration) -> Result<Reference, ReproduceError> {
    let observer = setup.observer;
    let method = Method::ris(16, 2).stratified().of(Transport::Path);
    let first = LONG_TURNS.start;
    let pilot = turns(stage, &[method], View::Centres, 1, first - 1..first, observer)?;
    let each = pilot[0].median_seconds(|s| s.wall).max(1e-6) * LONG_TURNS.len() as f64;
    let spp = (time.as_secs_f64() / each).clamp(1.0, MAX_RAYS[usize::from(setup.options.quick)]) as u32;
    Ok(Reference::new(&turns(stage, &[method], View::Centres, spp, LONG_TURNS, observer)?[0]))
}

/// A plan of a scene.
pub(super) fn plan(setup: &Setup<'_>, job: &RenderJob) -> Plan {
    Plan::new(&job.world.scene.geometry.world_bounds(), PLAN_SIZE[usize::from(setup.options.quick)])
}

/// Points from above, with file name, heading and caption.
pub(super) struct Cloud {
    /// Name of the file.
    pub name: String,
    /// Heading.
    pub title: String,
    /// Caption.
    pub caption: String,
    /// The points.
    pub points: Vec<Vec3>,
}

/// Images of points with a common scale. Densities are normalised to the number of points of the last one.
pub(super) fn clouds(setup: &Setup<'_>, plan: &Plan, clouds: &[Cloud]) -> Result<Vec<Block>, ReproduceError> {
    let count = clouds.last().map_or(0, |c| c.points.len()) as f64;
    let density = |c: &Cloud| {
        let factor = count / c.points.len().max(1) as f64;
        plan.density(&c.points).into_iter().map(|d| d * factor).collect()
    };
    let densities: Vec<Vec<f64>> = clouds.iter().map(density).collect();
    let scale = plan.scale(&densities.iter().map(|d| &d[..]).collect::<Vec<_>>());
    let mut shown = Vec::new();
    for (cloud, density) in clouds.iter().zip(&densities) {
        let file = plan.image(density, &scale).write(&setup.options.out, &cloud.name)?;
        shown.push(Shown { file, title: cloud.title.clone(), caption: cloud.caption.clone() });
    }
    let legend = Block::Legend {
        title: "from above: points per square metre of the floor, as if each image had as many as the last".to_owned(),
        scale,
    };
    Ok(vec![Block::Images(shown), legend])
}

/// An image with its name, heading and caption.
pub(super) struct Print<'a> {
    /// Name of the file.
    pub name: String,
    /// Heading.
    pub title: String,
    /// Caption.
    pub caption: String,
    /// Width and height.
    pub size: [u32; 2],
    /// Radiance.
    pub radiance: &'a [[f32; 3]],
}

/// Images with a common exposure.
pub(super) fn prints(setup: &Setup<'_>, exposure: f32, prints: &[Print<'_>]) -> Result<Block, ReproduceError> {
    let mut shown = Vec::new();
    for p in prints {
        let file = Image::tone_mapped(p.size, p.radiance, exposure).write(&setup.options.out, &p.name)?;
        shown.push(Shown { file, title: p.title.clone(), caption: p.caption.clone() });
    }
    Ok(Block::Images(shown))
}

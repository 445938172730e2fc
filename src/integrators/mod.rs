//! Light transport: from camera rays to radiance.
//!
//! All threads share one [`Integrator`]. It prepares the data of the samples, makes a [`Tracer`] for each thread, and
//! reports statistics. Reading order: [`path`] is the loop over vertices, `segment` the state of a path between two
//! vertices, `vertices` traces to the next vertices, `interior` walks through the interiors of materials,
//! `direct_light` adds L_d, and `scatter` samples the next segments. Neighbouring pixels may share paths ([`reuse`],
//! [`cells`]), and light paths add caustics ([`light_paths`]). [`features`] lists the features that exclude each other.
//! [`irradiance_cache`] and [`photon_map`] replace the light reflected by Lambertian lobes (`diffuse`).
//! [`camera_samples`] makes camera rays, and [`light_layers`] sums light by light group.

pub mod camera_samples;
pub mod cells;
mod diffuse;
mod direct_light;
pub mod features;
mod interior;
pub mod irradiance_cache;
pub mod light_layers;
pub mod light_paths;
pub mod path;
pub mod photon_map;
pub mod reuse;
mod scatter;
mod segment;
mod vertices;

pub use irradiance_cache::{CacheIntegrator, CacheReport, IrradianceCache};
pub use light_paths::LightPathStats;
pub use path::{CameraSample, PathIntegrator, PathStats, PathTracer};
pub use photon_map::{MapStats, PhotonMapIntegrator};

use crate::direct::Fits;
use crate::film::{FeatureSet, PixelSample};
use crate::photons::PhotonError;
use crate::scene::RenderJob;
use crate::settings::IntegratorKind;
use light_layers::LayerSums;
use std::sync::atomic::AtomicBool;

/// A light transport algorithm; shared by all threads.
pub trait Integrator: Sync {
    /// Prepares the samples from index `first` on. Returns the number of samples per pixel that the preparation serves.
    /// Returns 0 if it was told to stop; the samples so far are then an image.
    fn prepare(&mut self, _first: u32) -> Result<u32, PhotonError> {
        Ok(u32::MAX)
    }

    /// A tracer for one thread, which uses the prepared data.
    fn tracer(&self, features: FeatureSet) -> Box<dyn Tracer + '_>;

    /// True if pixels share random numbers. The variance of a pixel then cannot be estimated from its few samples.
    fn shares_noise(&self) -> bool {
        false
    }

    /// Statistics of the image, including `paths`, the sum over all tracers.
    fn statistics(&self, paths: PathStats) -> Statistics;
}

/// Traces samples in one thread; holds its buffers and counts.
pub trait Tracer: Send {
    /// Estimates the radiance of each camera sample; `out[i]` belongs to `samples[i]`. `fits` belong to the pixels of
    /// the samples.
    fn trace(&mut self, job: &RenderJob, samples: &[CameraSample], fits: &mut Fits, out: &mut Vec<PixelSample>);

    /// Sums the light of `count` light-group layers from now on, if supported; see [`light_layers`].
    fn keep_light_layers(&mut self, _count: usize) {}

    /// Light-group layers of the last batch, if supported.
    fn light_layers(&mut self) -> Option<&mut LayerSums> {
        None
    }

    /// Counts and times since the last call.
    fn take_stats(&mut self) -> PathStats;
}

/// Camera samples by pixel and index.
pub type Cameras<'a> = &'a (dyn Fn([u32; 2], u32) -> CameraSample + Sync);

/// The integrator of the settings. `cameras` gives the camera samples that preparations trace; `stop` ends preparations
/// early.
pub fn integrator<'a>(
    job: &'a RenderJob,
    cameras: Cameras<'_>,
    stop: &'a AtomicBool,
) -> Result<Box<dyn Integrator + 'a>, PhotonError> {
    Ok(match job.settings().integrator.kind {
        IntegratorKind::Direct | IntegratorKind::Path => Box::new(PathIntegrator::new(job)),
        IntegratorKind::IrradianceCache => Box::new(CacheIntegrator::new(job, cameras, stop)),
        IntegratorKind::PhotonMap => Box::new(PhotonMapIntegrator::new(job, cameras, stop)?),
    })
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

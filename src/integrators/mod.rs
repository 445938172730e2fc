//! Light transport: from camera rays to radiance.
//!
//! An [`Integrator`] is what all threads share while an image is rendered: it prepares what samples need, makes a
//! [`Tracer`] for each thread, and reports. Reading order: [`path`] is the loop over vertices, `segment` the state of a path
//! between two of them, `vertices` traces to the next ones, `interior` walks through materials on the way there,
//! `direct_light` adds L_d, and `scatter` samples the next segments.
//! Pixels that are neighbours may share paths ([`reuse`]; which ones: [`cells`]), and light paths bring caustics
//! ([`light_paths`]). [`features`] is the table of what excludes what. [`irradiance_cache`] and [`photon_map`] replace the
//! light that Lambertian parts reflect (`diffuse`).

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
use lumiris_numbers::math::Rgb;
use std::sync::atomic::AtomicBool;

/// A way to render an image: what all threads share.
pub trait Integrator: Sync {
    /// Prepares the samples from index `first` on. The answer is how many samples per pixel that serves; 0 if it was told
    /// to stop, and the samples so far are an image.
    fn prepare(&mut self, _first: u32) -> Result<u32, PhotonError> {
        Ok(u32::MAX)
    }

    /// What one thread traces samples with, using what is prepared.
    fn tracer(&self, features: FeatureSet) -> Box<dyn Tracer + '_>;

    /// True if pixels share random numbers, so that their variance cannot be told from a few of them.
    fn shares_noise(&self) -> bool {
        false
    }

    /// Statistics of the image, with those of all tracers.
    fn statistics(&self, paths: PathStats) -> Statistics;
}

/// What one thread traces samples with: buffers and counts.
pub trait Tracer: Send {
    /// Estimates the radiance of each camera sample; `out[i]` belongs to `samples[i]`. `fits` are those of the samples'
    /// pixels.
    fn trace(&mut self, job: &RenderJob, samples: &[CameraSample], fits: &mut Fits, out: &mut Vec<PixelSample>);

    /// Keeps the light of so many layers by lights from now on, if it can; see [`light_layers`].
    fn keep_light_layers(&mut self, _count: usize) {}

    /// The light of the layers of the last batch: by sample, then by layer; nothing if none are kept.
    fn light_layers(&mut self) -> &mut [Rgb] {
        &mut []
    }

    /// The counts and times since the last call.
    fn take_stats(&mut self) -> PathStats;
}

/// Camera samples by pixel and index.
pub type Cameras<'a> = &'a (dyn Fn([u32; 2], u32) -> CameraSample + Sync);

/// The integrator that the settings ask for. It looks at the scene with `cameras`; `stop` ends its preparations early.
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
    /// Pixels that asked for the records of the cache, by their coordinates: one entry for each record.
    pub records: Vec<[u32; 2]>,
}

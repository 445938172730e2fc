//! The interface of integrators.

use super::camera_sample::{CameraSample, CameraSamples};
use super::light_layers::LayerSums;
use super::statistics::{PathStats, Statistics};
use crate::direct::Fits;
use crate::film::{FeatureSet, PixelSample};
use crate::photons::PhotonError;
use crate::scene::RenderJob;

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
    /// Estimates the radiance of each camera sample; `out[i]` belongs to sample `i`. `fits` belong to the pixels of
    /// the samples.
    fn trace(&mut self, job: &RenderJob, samples: &CameraSamples, fits: &mut Fits, out: &mut Vec<PixelSample>);

    /// Sums the light of `count` light-group layers from now on, if supported; see [`super::light_layers`].
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

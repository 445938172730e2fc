//! All settings of an image.

use super::integrator::{EstimatorKind, IntegratorKind, IntegratorSettings, OcvForm, OptimalForm};
use super::photon_map::PhotonStorage;
use super::sampling::{Allocation, SamplingSettings};

/// Minimum number of samples per pixel for adaptive sampling.
pub const MIN_ADAPTIVE_SPP: u32 = 8;

/// All settings of an image, except its size and filter, which belong to the film.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    /// Light transport.
    pub integrator: IntegratorSettings,
    /// Random numbers and samples per pixel.
    pub sampling: SamplingSettings,
}

impl Settings {
    /// The biases of these settings: light missing from the image.
    pub fn biases(&self) -> Vec<&'static str> {
        let i = &self.integrator;
        let cuts_off = i.kind == IntegratorKind::PhotonMap && matches!(i.photons.storage, PhotonStorage::CutOff(_));
        let lights = i.leaves_lights_out().then_some("non-contributing lights are left out");
        let photons = cuts_off.then_some("photons where importance is low are left out");
        lights.into_iter().chain(photons).collect()
    }

    /// True if the number of camera samples may vary between pixels. Pixels must not be fitted in blocks, and the
    /// number of samples must suffice for a pilot.
    pub fn allows_adaptive(&self) -> bool {
        let i = &self.integrator;
        let is_progressive = match i.estimator {
            EstimatorKind::Ocv => i.ocv.form == OcvForm::Progressive,
            EstimatorKind::OptimalMis => i.optimal_mis == OptimalForm::Progressive,
            _ => false,
        };
        matches!(i.kind, IntegratorKind::Direct | IntegratorKind::Path)
            && !is_progressive
            && self.sampling.spp >= MIN_ADAPTIVE_SPP
    }

    /// The distribution of camera samples over the pixels.
    pub fn allocation(&self) -> Allocation {
        match self.sampling.allocation {
            _ if self.sampling.noise.is_some() => Allocation::Adaptive,
            Allocation::Adaptive if !self.allows_adaptive() => Allocation::Uniform,
            allocation => allocation,
        }
    }
}

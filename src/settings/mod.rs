//! Settings of an image: integrator, sampling, and random numbers.
//!
//! [`Settings`] is plain data for the renderer. [`table`] has a row for each setting, with its names, range, default,
//! help and applicability. The command line, scene-file parameters, metadata and `lumiris info` are derived from it.
//!
//! Reading order: [`integrator`], [`ris`], [`photon_map`], [`sampling`], [`value`], [`table`], [`given`].

pub mod given;
pub mod integrator;
pub mod photon_map;
pub mod ris;
pub mod sampling;
mod summary;
pub mod table;
pub mod value;

pub use given::Given;
pub use integrator::{
    Cached, ContributingSettings, EstimatorKind, IntegratorKind, IntegratorSettings, IrradianceCacheSettings, OcvForm,
    OcvSettings, OptimalForm, SampleCounts, SamplingTechnique, bsdf_samples,
};
pub use photon_map::{PhotonMapSettings, PhotonStorage, ProgressiveSettings};
pub use ris::{ProposalPoints, Proposals, RisSettings, Strata, Target};
pub use sampling::{Allocation, SamplingSettings};
pub use table::Setting;
pub use value::Value;

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

    /// Every setting that affects the image, by its name in metadata, with the choices of the renderer.
    pub fn recorded(&self) -> impl Iterator<Item = (&'static str, Value)> {
        let rows = table::rows().filter(|row| row.is_recorded && row.applies.to(self));
        rows.filter_map(|row| Some((row.key, (row.resolved.unwrap_or(row.get))(self)?)))
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

    /// The settings that differ from the default, with their values.
    pub fn changed(&self) -> impl Iterator<Item = (&'static Setting, Value)> {
        let default = Settings::default();
        let is_changed = move |row: &&Setting| (row.get)(self) != (row.get)(&default);
        table::rows().filter(is_changed).filter_map(|row| Some((row, (row.get)(self)?)))
    }
}

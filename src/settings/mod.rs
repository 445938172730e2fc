//! Settings of an image: what is computed, how, and with which random numbers.
//!
//! [`Settings`] is plain data, which the renderer reads. [`table`] has a row for each setting, with its names, range,
//! default, help and where it applies; command line, scene-file parameters, metadata and `lumiris info` follow from it.
//!
//! Reading order: [`integrator`], [`ris`], [`photon_map`], [`sampling`], [`value`], [`table`].

pub mod integrator;
pub mod photon_map;
pub mod ris;
pub mod sampling;
pub mod table;
pub mod value;

pub use integrator::{
    Cached, ContributingSettings, ControlVariates, CorrelatedForm, CorrelatedSettings, EstimatorKind, IntegratorKind,
    IntegratorSettings, IrradianceCacheSettings, OcvSettings, OptimalForm, RouletteKind, SampleCounts,
    SamplingTechnique, bsdf_samples,
};
pub use photon_map::{PhotonMapSettings, PhotonStorage, ProgressiveSettings};
pub use ris::{ProposalPoints, Proposals, RisSettings, StageTimes, Strata, Target};
pub use sampling::{Allocation, SamplingSettings};
pub use table::Setting;
pub use value::Value;

/// All settings of an image, except its size and filter, which belong to the film.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    /// Light transport.
    pub integrator: IntegratorSettings,
    /// Random numbers and samples per pixel.
    pub sampling: SamplingSettings,
}

impl Settings {
    /// The biases of these settings: light that is left out of the image.
    pub fn biases(&self) -> Vec<&'static str> {
        let i = &self.integrator;
        let cuts_off = i.kind == IntegratorKind::PhotonMap && matches!(i.photons.storage, PhotonStorage::CutOff(_));
        let lights = i.leaves_lights_out().then_some("non-contributing lights are left out");
        let photons = cuts_off.then_some("photons where importance is low are left out");
        lights.into_iter().chain(photons).collect()
    }

    /// Every setting that the image depends on, by its name in metadata. Where the renderer is to choose, it is its
    /// choice.
    pub fn recorded(&self) -> impl Iterator<Item = (&'static str, Value)> {
        let rows = table::rows().filter(|row| row.is_recorded && row.applies.to(self));
        rows.filter_map(|row| Some((row.key, (row.resolved.unwrap_or(row.get))(self)?)))
    }

    /// The settings that differ from the default, with their values.
    pub fn changed(&self) -> impl Iterator<Item = (&'static Setting, Value)> {
        let default = Settings::default();
        let is_changed = move |row: &&Setting| (row.get)(self) != (row.get)(&default);
        table::rows().filter(is_changed).filter_map(|row| Some((row, (row.get)(self)?)))
    }
}

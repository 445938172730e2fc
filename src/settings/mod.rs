//! Settings of an image: integrator, sampling, and random numbers.
//!
//! [`Settings`] is plain data for the renderer. [`table`] has a row for each setting, with its names, range, default,
//! help and applicability. The command line, scene-file parameters, metadata and `lumiris info` are derived from it.
//!
//! Reading order: [`integrator`], [`ris`], [`photon_map`], [`sampling`], `image_settings`, [`value`], [`table`],
//! [`given`].

pub mod given;
mod image_settings;
pub mod integrator;
pub mod photon_map;
pub mod ris;
pub mod sampling;
mod summary;
pub mod table;
pub mod value;

pub use given::Given;
pub use image_settings::{MIN_ADAPTIVE_SPP, Settings};
pub use integrator::{
    Cached, ContributingSettings, EstimatorKind, IntegratorKind, IntegratorSettings, IrradianceCacheSettings, OcvForm,
    OcvSettings, OptimalForm, SampleCounts, SamplingTechnique, bsdf_samples,
};
pub use photon_map::{PhotonMapSettings, PhotonStorage, ProgressiveSettings};
pub use ris::{ProposalPoints, Proposals, RisSettings, Strata, Target};
pub use sampling::{Allocation, SamplingSettings};
pub use table::Setting;
pub use value::Value;

//! A scene owns everything that is rendered, in vectors; what refers to something holds its index.
//!
//! [`Scene`] is data, as an importer makes it; [`World`] is a scene with its ray tracers, ready to render.

mod found;
mod photon_settings;
mod ris_settings;
mod settings;
mod split_map;
mod world;

pub use found::Found;
pub use photon_settings::{Deposition, PhotonMapSettings, Shrinking};
pub use ris_settings::{ProposalPoints, Proposals, RisSettings, StageTimes, Strata, Target};
pub use settings::{
    Cached, ContributingSettings, CorrelatedForm, CorrelatedSettings, EstimatorKind, IntegratorKind,
    IntegratorSettings, IrradianceCacheSettings, OcvSettings, OptimalForm, SamplingTechnique, Split,
};
pub use split_map::SplitMap;
pub use world::{AccelKind, EmitterHit, World};

use crate::cameras::Camera;
use crate::film::PixelBounds;
use crate::film::filter::PixelFilter;
use crate::geometry::GeometrySet;
use crate::lights::LightSet;
use crate::materials::{MaterialId, MaterialSet};
use crate::textures::TextureSet;
use lumiris_numbers::samplers::SamplerKind;
use std::sync::Arc;

/// What is rendered and how the file asks for it.
#[derive(Debug)]
pub struct Scene {
    /// The camera.
    pub camera: Camera,
    /// Size and filter of the picture.
    pub film: FilmSettings,
    /// Random numbers and samples per pixel.
    pub sampling: SamplingSettings,
    /// Light transport.
    pub integrator: IntegratorSettings,
    /// All textures and texture images.
    pub textures: Arc<TextureSet>,
    /// All materials.
    pub materials: MaterialSet,
    /// All shapes and their placement.
    pub geometry: Arc<GeometrySet>,
    /// One per geometry of `geometry`.
    pub surfaces: Vec<Surface>,
    /// All lights.
    pub lights: LightSet,
}

/// What a geometry is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Its material.
    pub material: MaterialId,
    /// A name for people: the file or shape that it came from.
    pub name: String,
}

/// The picture.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmSettings {
    /// Full size (width, height) in pixels.
    pub resolution: [u32; 2],
    /// The part that is rendered.
    pub bounds: PixelBounds,
    /// Pixel filter.
    pub filter: PixelFilter,
    /// Where the file wants the picture.
    pub file_name: Option<String>,
    /// Factor from radiance to pixel value (ISO and exposure of the sensor); 1 by default.
    pub scale: f32,
}

/// Random numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SamplingSettings {
    /// Which sequence.
    pub sampler: SamplerKind,
    /// Camera samples per pixel.
    pub spp: u32,
    /// Images of different seeds are independent estimates of the same picture.
    pub seed: u32,
}

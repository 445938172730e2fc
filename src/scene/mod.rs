//! A scene owns everything that is rendered, in vectors; what refers to something holds its index.
//!
//! [`Scene`] is data, as an importer makes it; [`World`] is a scene with its ray tracers, ready to render.

mod world;

pub use world::{AccelKind, EmitterHit, World};

use crate::bsdfs::ProposalDensity;
use crate::cameras::Camera;
use crate::estimators::mis::Heuristic;
use crate::film::PixelBounds;
use crate::film::filter::PixelFilter;
use crate::geometry::GeometrySet;
use crate::lights::{LightSamplerKind, LightSet};
use crate::materials::{MaterialId, MaterialSet};
use crate::samplers::SamplerKind;
use crate::textures::TextureSet;
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

/// Light transport.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntegratorSettings {
    /// What is computed.
    pub kind: IntegratorKind,
    /// Number of bounces for `path`; 1 is direct light.
    pub max_depth: u32,
    /// Direct-light estimator at each path vertex.
    pub estimator: EstimatorKind,
    /// Samples per estimate (N): shadow segments per shading point.
    pub samples: u32,
    /// MIS weights of `mis`.
    pub heuristic: Heuristic,
    /// How a light is chosen.
    pub light_choice: LightSamplerKind,
    /// Directions proposed for each that continues a path (M), where the BSDF is one that can only be evaluated; 1 is
    /// plain importance sampling.
    pub bsdf_proposals: u32,
    /// Density that proposes them.
    pub bsdf_density: ProposalDensity,
}

impl Default for IntegratorSettings {
    fn default() -> Self {
        IntegratorSettings {
            kind: IntegratorKind::Path,
            max_depth: 5,
            estimator: EstimatorKind::Mis,
            samples: 2,
            heuristic: Heuristic::Power,
            light_choice: LightSamplerKind::Tree,
            bsdf_proposals: 4,
            bsdf_density: ProposalDensity::Lobes,
        }
    }
}

impl IntegratorSettings {
    /// The number of bounces that is really computed.
    pub fn depth(&self) -> u32 {
        match self.kind {
            IntegratorKind::Direct => self.max_depth.min(1),
            IntegratorKind::Path => self.max_depth,
        }
    }
}

/// What is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IntegratorKind {
    /// Emitted light and one bounce.
    Direct,
    /// Paths of up to `max_depth` bounces.
    Path,
}

impl IntegratorKind {
    /// The name on the command line and in metadata.
    pub fn name(self) -> &'static str {
        match self {
            IntegratorKind::Direct => "direct",
            IntegratorKind::Path => "path",
        }
    }
}

/// How direct light is estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EstimatorKind {
    /// Light sampling only (and the specular lobes of BSDFs).
    Mc,
    /// Light and BSDF sampling, weighted.
    Mis,
}

impl EstimatorKind {
    /// The name on the command line and in metadata.
    pub fn name(self) -> &'static str {
        match self {
            EstimatorKind::Mc => "mc",
            EstimatorKind::Mis => "mis",
        }
    }
}

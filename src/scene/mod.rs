//! A scene owns everything that is rendered, in vectors; what refers to something holds its index.
//!
//! [`Scene`] is data, as an importer makes it; [`World`] is a scene with its ray tracers, ready to render.

mod found;
mod split_map;
mod world;

pub use found::Found;
pub use split_map::SplitMap;
pub use world::{AccelKind, EmitterHit, World};

use crate::cameras::Camera;
use crate::film::PixelBounds;
use crate::film::filter::PixelFilter;
use crate::geometry::GeometrySet;
use crate::lights::LightSet;
use crate::materials::{MaterialId, MaterialSet};
use crate::settings::{IntegratorSettings, SamplingSettings, Settings};
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

impl Scene {
    /// All settings.
    pub fn settings(&self) -> Settings {
        Settings { integrator: self.integrator, sampling: self.sampling }
    }

    /// Renders by other settings from now on.
    pub fn set(&mut self, settings: Settings) {
        if settings.integrator.light_choice != self.integrator.light_choice {
            self.lights.set_kind(settings.integrator.light_choice);
        }
        self.materials.set_proposal_density(settings.integrator.bsdf_density);
        (self.integrator, self.sampling) = (settings.integrator, settings.sampling);
    }
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

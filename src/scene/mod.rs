//! A scene owns everything that is rendered, in vectors; what refers to something holds its index.
//!
//! [`Scene`] is data, as an importer makes it; [`World`] is a scene with its ray tracers; [`RenderJob`] is a world with
//! the settings that it is rendered by, and with what they prepare.

mod job;
mod pixel_samples;
mod sample_count_map;
mod surface_interaction;
mod world;

pub use job::RenderJob;
pub use pixel_samples::PixelSamples;
pub use sample_count_map::SampleCountMap;
pub use surface_interaction::SurfaceInteraction;
pub use world::{AccelKind, EmitterHit, EmitterScratch, World};

use crate::cameras::Camera;
use crate::film::PixelBounds;
use crate::film::filter::PixelFilter;
use crate::geometry::GeometrySet;
use crate::lights::LightSet;
use crate::materials::{MaterialId, MaterialSet};
use crate::media::{MediumSet, Sides};
use crate::textures::TextureSet;
use lumiris_numbers::math::{DVec3, Mat3, Rgb, Vec3};
use std::sync::Arc;

/// What is rendered.
#[derive(Debug)]
pub struct Scene {
    /// The camera.
    pub camera: Camera,
    /// Size and filter of the image.
    pub film: FilmSettings,
    /// All textures and texture images.
    pub textures: Arc<TextureSet>,
    /// All materials.
    pub materials: MaterialSet,
    /// All shapes and their placement.
    pub geometry: Arc<GeometrySet>,
    /// One per geometry of `geometry`.
    pub surfaces: Vec<Surface>,
    /// All lights.
    pub lights: Arc<LightSet>,
    /// What is between surfaces.
    pub media: MediumSet,
    /// What the file has in place of this scene and its camera.
    pub choices: Choices,
    /// The point of the file's world that is the origin of the world which is rendered. It is near to the camera, so that f32
    /// has bits for what that sees: see [`lumiris_numbers::math::origin`].
    pub origin: DVec3,
}

/// Names of what a file lets people choose from, by their indices. A pbrt file has no choice.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Choices {
    /// Cameras of the scene; empty for those without a name.
    pub cameras: Vec<String>,
    /// Scenes of the file; empty for those without a name.
    pub scenes: Vec<String>,
    /// The index of the camera that is shown, unless that is the first.
    pub camera: Option<usize>,
    /// The index of the scene that is shown, unless that is the one of the file.
    pub scene: Option<usize>,
}

/// Surface properties of a geometry.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Its material.
    pub material: MaterialId,
    /// A readable name: the file or shape that it came from.
    pub name: String,
    /// The media on its sides; `None` where both sides are in the same, whatever it is.
    pub sides: Option<Sides>,
}

/// The image.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmSettings {
    /// Full size (width, height) in pixels.
    pub resolution: [u32; 2],
    /// The part that is rendered.
    pub bounds: PixelBounds,
    /// Pixel filter.
    pub filter: PixelFilter,
    /// Output file given in the scene file.
    pub file_name: Option<String>,
    /// Factor from radiance to pixel value (ISO and exposure of the sensor); 1 by default.
    pub scale: f32,
    /// White balance, a linear map of colours; `None` leaves them.
    pub balance: Option<Mat3>,
}

impl FilmSettings {
    /// The colour that the film has for one of the scene.
    #[inline]
    pub fn balanced(&self, c: Rgb) -> Rgb {
        self.balance.map_or(c, |balance| Rgb::from_array((balance * Vec3::from_array(c.to_array())).to_array()))
    }
}

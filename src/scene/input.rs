//! The input of a rendering: data of an importer.

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

/// The input of a rendering.
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
    /// All shapes and their transforms.
    pub geometry: Arc<GeometrySet>,
    /// One per geometry of `geometry`.
    pub surfaces: Vec<Surface>,
    /// All lights.
    pub lights: Arc<LightSet>,
    /// Participating media.
    pub media: MediumSet,
    /// Alternative cameras and scenes of the file.
    pub choices: Choices,
    /// The point of the file's world space that becomes the origin of the rendered world. It is near the camera, so
    /// that f32 coordinates are precise there: see [`lumiris_numbers::math::origin`].
    pub origin: DVec3,
}

/// Cameras and scenes of a file that users can choose from, by index. A pbrt file has none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Choices {
    /// Names of the file's cameras; empty strings for unnamed ones.
    pub cameras: Vec<String>,
    /// Names of the file's scenes; empty strings for unnamed ones.
    pub scenes: Vec<String>,
    /// Index of the chosen camera; `None` for the first.
    pub camera: Option<usize>,
    /// Index of the chosen scene; `None` for the file's default scene.
    pub scene: Option<usize>,
}

/// Surface properties of a geometry.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Its material.
    pub material: MaterialId,
    /// A readable name: the file or shape of origin.
    pub name: Arc<str>,
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
    /// White balance, a linear map of colours; `None` leaves colours unchanged.
    pub balance: Option<Mat3>,
}

impl FilmSettings {
    /// Applies the white balance to a colour.
    #[inline]
    pub fn balanced(&self, c: Rgb) -> Rgb {
        self.balance.map_or(c, |balance| Rgb::from_array((balance * Vec3::from_array(c.to_array())).to_array()))
    }
}

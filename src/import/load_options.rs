//! Options that override scene files.

use super::light_units::LightUnits;
use std::path::PathBuf;

/// Options that override a scene file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadOptions {
    /// Size of the image (width, height).
    pub resolution: Option<[u32; 2]>,
    /// Crop window x0, x1, y0, y1 in fractions of the image.
    pub crop: Option<[f32; 4]>,
    /// Image of the environment of a glTF scene.
    pub environment: Option<PathBuf>,
    /// Name or index of the scene of a glTF file; by default the default scene of the file, or the first.
    pub scene: Option<String>,
    /// Name or index of the camera of a glTF scene; by default the first.
    pub camera: Option<String>,
    /// True for the automatic camera in a glTF scene, even if it has cameras.
    pub camera_auto: bool,
    /// Units of the punctual lights of a glTF scene.
    pub light_units: Option<LightUnits>,
    /// The time (s) at which animations of a glTF scene are evaluated; by default they are not.
    pub time: Option<f32>,
}

impl LoadOptions {
    /// The first given option that is for glTF scenes only.
    pub fn of_gltf(&self) -> Option<&'static str> {
        let options = [
            ("--environment", self.environment.is_some()),
            ("--scene-in-file", self.scene.is_some()),
            ("--camera", self.camera.is_some()),
            ("--camera-auto", self.camera_auto),
            ("--light-units", self.light_units.is_some()),
            ("--time-in-scene", self.time.is_some()),
        ];
        options.into_iter().find_map(|(option, is_given)| is_given.then_some(option))
    }
}

//! The result of loading a scene file.

use super::fingerprint::SceneFiles;
use crate::accel::embree::EmbreeError;
use crate::scene::{AccelKind, RenderJob, Scene, World};
use crate::settings::{Given, Settings};
use lumiris_formats::diagnostic::Report;

/// A scene, its settings, and warnings.
#[derive(Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// The file's settings.
    pub settings: Settings,
    /// Settings given in the file.
    pub given: Given,
    /// Warnings.
    pub warnings: Report,
    /// The files of the scene.
    pub files: SceneFiles,
}

impl Loaded {
    /// Builds the ray tracers, and prepares the data for the settings; see [`World::new`].
    pub fn job(self, kind: AccelKind, packet_width: Option<u32>) -> Result<RenderJob, EmbreeError> {
        Ok(RenderJob::new(World::new(self.scene, kind, packet_width)?, self.settings))
    }
}

//! Plans as files: the choices that followed from measurements.

use anyhow::Context;
use lumiris::render::plan::Plan;
use lumiris::scene::RenderJob;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs::read_to_string;
use std::path::Path;

/// Columns, rows and samples per pixel.
fn image_of(job: &RenderJob) -> [u32; 3] {
    let bounds = job.world.scene.film.bounds;
    [bounds.width(), bounds.height(), job.settings().sampling.spp]
}

/// A plan as it is stored.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub(super) struct PlanFile {
    /// The program that made it.
    version: String,
    /// The scene that it was made for.
    scene: String,
    /// Columns, rows and samples per pixel of the image that it was made for.
    #[serde(default)]
    image: Option<[u32; 3]>,
    /// The settings that were chosen, by their names in metadata.
    pub(super) settings: BTreeMap<String, String>,
    /// What the choice of the estimator follows from; `null` without `--estimator auto`.
    #[serde(default)]
    pub(super) auto: Value,
}

impl PlanFile {
    pub(super) fn read(path: &Path) -> anyhow::Result<Self> {
        let text = read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        serde_json::from_str(&text).with_context(|| format!("{} is no plan", path.display()))
    }

    pub(super) fn new(scene: &Path, job: &RenderJob, plan: &Plan) -> anyhow::Result<Self> {
        Ok(PlanFile {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scene: scene.display().to_string(),
            image: Some(image_of(job)),
            settings: plan.chosen.iter().map(|(key, value)| ((*key).to_owned(), value.clone())).collect(),
            auto: serde_json::to_value(&plan.auto)?,
        })
    }

    /// What it was made for, if that is another image than this one: other frames of an animation are the same to it.
    pub(super) fn other_image(&self, scene: &Path, job: &RenderJob) -> Option<String> {
        let name = |path: &Path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            name.chars().filter(|c| !c.is_ascii_digit()).collect::<String>()
        };
        if name(Path::new(&self.scene)) != name(scene) {
            return Some(self.scene.clone());
        }
        let other = self.image.filter(|image| *image != image_of(job));
        other.map(|[width, height, spp]| format!("{width}x{height} pixels with {spp} samples"))
    }

    /// On one line.
    pub(super) fn text(&self) -> anyhow::Result<String> {
        Ok(serde_json::to_string(self)?)
    }
}

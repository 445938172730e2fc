//! Plan files: choices that follow from measurements.

use super::progress;
use anyhow::{Context, bail};
use lumiris::imaging::oiio::read_metadata;
use lumiris::planning::Plan;
use lumiris::scene::RenderJob;
use lumiris::settings::Settings;
use lumiris::settings::table::{Removed, rows};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs::read_to_string;
use std::path::Path;

/// Metadata key of an image's plan.
pub(super) const PLAN_KEY: &str = "lumiris:plan";

/// Width and height (pixels), and samples per pixel for pilots.
fn image_of(job: &RenderJob) -> [u32; 3] {
    let bounds = job.world.scene.film.bounds;
    [bounds.width(), bounds.height(), job.settings().sampling.pilot_spp()]
}

/// The stored form of a plan.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub(super) struct PlanFile {
    /// Version of the program that made it.
    version: String,
    /// The scene for which it was made.
    scene: String,
    /// Width and height (pixels) and samples per pixel of the image for which it was made.
    #[serde(default)]
    image: Option<[u32; 3]>,
    /// The chosen settings, by their metadata names.
    pub(super) settings: BTreeMap<String, String>,
    /// Results of the trials; `null` without trials.
    #[serde(default)]
    pub(super) tuning: Value,
}

impl PlanFile {
    pub(super) fn read(path: &Path) -> anyhow::Result<Self> {
        let text = read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        serde_json::from_str(&text).with_context(|| format!("{} is no plan", path.display()))
    }

    /// The plan in an image's metadata.
    pub(super) fn of_image(path: &Path) -> Option<Self> {
        serde_json::from_str(read_metadata(path).ok()?.get(PLAN_KEY)?).ok()
    }

    /// Applies the choices. `name` names the plan in messages.
    pub(super) fn apply(&self, name: &str, settings: &mut Settings) -> anyhow::Result<()> {
        for (key, value) in &self.settings {
            if let Some(removed) = Removed::of_key(key) {
                progress::say(&format!("warning: {name}: {}", removed.note(key)));
                continue;
            }
            let row = rows().find(|row| row.key == key);
            let row = row.with_context(|| format!("{name}: there is no setting `{key}`"))?;
            if let Err(expected) = row.set_text(settings, value) {
                bail!("{name}: `{key}`: {expected}, but found `{value}`");
            }
        }
        Ok(())
    }

    pub(super) fn new(scene: &Path, job: &RenderJob, plan: &Plan) -> anyhow::Result<Self> {
        Ok(PlanFile {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scene: scene.display().to_string(),
            image: Some(image_of(job)),
            settings: plan.chosen.iter().map(|(key, value)| ((*key).to_owned(), value.clone())).collect(),
            tuning: serde_json::to_value(&plan.tuning)?,
        })
    }

    /// Describes the image for which the plan was made, if it differs from this one. Frames of one animation do not
    /// differ.
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

    /// The plan as one line of JSON.
    pub(super) fn text(&self) -> anyhow::Result<String> {
        Ok(serde_json::to_string(self)?)
    }
}

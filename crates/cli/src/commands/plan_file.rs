//! Plans as files: the choices that followed from measurements.

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

/// Metadata of an image that hold its plan.
pub(super) const PLAN_KEY: &str = "lumiris:plan";

/// Columns, rows and samples per pixel.
fn image_of(job: &RenderJob) -> [u32; 3] {
    let bounds = job.world.scene.film.bounds;
    [bounds.width(), bounds.height(), job.settings().sampling.pilot_spp()]
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
    /// What trials found; `null` without them.
    #[serde(default)]
    pub(super) tuning: Value,
}

impl PlanFile {
    pub(super) fn read(path: &Path) -> anyhow::Result<Self> {
        let text = read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        serde_json::from_str(&text).with_context(|| format!("{} is no plan", path.display()))
    }

    /// The plan of an image, as its metadata have it.
    pub(super) fn of_image(path: &Path) -> Option<Self> {
        serde_json::from_str(read_metadata(path).ok()?.get(PLAN_KEY)?).ok()
    }

    /// Applies its choices. Messages call it `name`.
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

//! Plans as files: the choices that followed from measurements.

use lumiris::render::plan::Plan;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// A plan as it is stored.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub(super) struct PlanFile {
    /// The program that made it.
    version: String,
    /// The scene that it was made for.
    scene: String,
    /// The settings that were chosen, by their names in metadata.
    pub(super) settings: BTreeMap<String, String>,
    /// What the choice of the estimator follows from; `null` without `--estimator auto`.
    #[serde(default)]
    pub(super) auto: Value,
}

impl PlanFile {
    pub(super) fn new(scene: &Path, plan: &Plan) -> anyhow::Result<Self> {
        Ok(PlanFile {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scene: scene.display().to_string(),
            settings: plan.chosen.iter().map(|(key, value)| ((*key).to_owned(), value.clone())).collect(),
            auto: serde_json::to_value(&plan.auto)?,
        })
    }

    /// On one line.
    pub(super) fn text(&self) -> anyhow::Result<String> {
        Ok(serde_json::to_string(self)?)
    }
}

//! What a rendering goes on from: a checkpoint or an unfinished part.

use super::args::{RenderArgs, parse_crop, parse_resolution, parse_time_in_scene};
use super::part_args::PartArgs;
use anyhow::Context;
use lumiris::render::output::Aov;
use lumiris::render::parts::{FilmHeader, FilmReader, StoredTile};
use lumiris::scene::AccelKind;
use lumiris::settings::Settings;
use lumiris::settings::table::rows;
use std::path::PathBuf;

/// Note of the layers that the image is to have.
pub(super) const AOV_NOTE: &str = "aov";
/// Note of the path of the scene.
pub(super) const SCENE_NOTE: &str = "scene";
/// Note of the plan that was made for it.
pub(super) const PLAN_NOTE: &str = "plan";
/// Note of the time that it took.
pub(super) const SECONDS_NOTE: &str = "seconds";

/// The sums that a rendering goes on from.
pub(super) struct Stored {
    pub(super) path: PathBuf,
    pub(super) header: FilmHeader,
    pub(super) tiles: Vec<StoredTile>,
}

impl Stored {
    /// Those of `--resume`, if there are any.
    pub(super) fn read(args: &PartArgs) -> anyhow::Result<Option<Stored>> {
        let Some(path) = &args.resume else { return Ok(None) };
        let is_begun_here = args.checkpoint.as_ref().is_some_and(|(checkpoint, _)| checkpoint == path);
        if is_begun_here && !path.exists() {
            return Ok(None);
        }
        let reader = FilmReader::open(path)?;
        let header = reader.header().clone();
        Ok(Some(Stored { path: path.clone(), header, tiles: reader.all_tiles()? }))
    }

    /// The options by which it was rendered, where none are given now.
    pub(super) fn complete(&self, args: &mut RenderArgs) -> anyhow::Result<()> {
        let note = |name| self.header.note(name).filter(|text| !text.is_empty());
        let scene = &mut args.scene;
        let option = |name: &str| anyhow::anyhow!("{}: the stored {name} means nothing", self.path.display());
        if let (None, Some(text)) = (scene.resolution, note("resolution")) {
            scene.resolution = Some(parse_resolution(text).map_err(|_| option("resolution"))?);
        }
        if let (None, Some(text)) = (scene.crop, note("crop")) {
            scene.crop = Some(parse_crop(text).map_err(|_| option("crop window"))?);
        }
        if let (AccelKind::Embree, Some(accel)) = (scene.accel, self.header.setting("lumiris:accel")) {
            scene.accel = accel.parse().map_err(|_| option("ray tracer"))?;
        }
        if let (None, Some(path)) = (&scene.environment, note("environment")) {
            scene.environment = Some(path.into());
        }
        scene.camera_auto |= note("camera_auto").is_some();
        if let (None, Some(text)) = (scene.time_in_scene, note("time_in_scene")) {
            scene.time_in_scene = Some(parse_time_in_scene(text).map_err(|_| option("time"))?);
        }
        scene.box_filter |= note("box_filter").is_some();
        if let (None, Some(list)) = (&args.aov, note(AOV_NOTE)) {
            let named = |name: &str| if name == "none" { Ok(None) } else { name.parse::<Aov>().map(Some) };
            args.aov =
                Some(list.split(',').map(named).collect::<Result<_, _>>().map_err(|_| option("list of layers"))?);
        }
        Ok(())
    }

    /// Applies its settings, in the order of the table. What it does not have does not apply.
    pub(super) fn apply(&self, settings: &mut Settings) -> anyhow::Result<()> {
        for row in rows() {
            if let Some(value) = self.header.setting(&format!("lumiris:{}", row.key)) {
                let set = row.set_text(settings, value);
                set.map_err(|e| {
                    anyhow::anyhow!("{}: `{}`: expected {e}, not `{value}`", self.path.display(), row.key)
                })?;
            }
        }
        Ok(())
    }

    /// The samples per pixel by which it was prepared.
    pub(super) fn spp(&self) -> anyhow::Result<u32> {
        let spp = self.header.setting("lumiris:spp").and_then(|text| text.parse().ok());
        spp.with_context(|| format!("{}: there is no number of samples", self.path.display()))
    }
}

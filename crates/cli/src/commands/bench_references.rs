//! The references of `lumiris bench efficiency`, which can be stored.

use super::args::SceneArgs;
use super::progress;
use anyhow::{Context, bail};
use lumiris::film::PixelBounds;
use lumiris::imaging::ColorChannels;
use lumiris::imaging::oiio::{ImageFile, Part, write_image};
use lumiris::import::fingerprint::SceneFiles;
use lumiris::render::RenderSettings;
use lumiris::render::output::metadata;
use lumiris::scene::RenderJob;
use lumiris::settings::Settings;
use lumiris_bench::efficiency::{Colors, reference_image, reference_settings};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;

/// Two independent reference images of a scene.
pub(super) struct References<'a> {
    scene: &'a SceneArgs,
    spp: u32,
    /// Folder of the stored references, and the fingerprint of the scene's files.
    kept: Option<(&'a Path, u64)>,
}

impl<'a> References<'a> {
    /// References with `spp` samples per pixel, stored in `folder` if it is given.
    pub(super) fn new(
        spp: u32,
        folder: Option<&'a Path>,
        scene: &'a SceneArgs,
        files: &SceneFiles,
    ) -> anyhow::Result<Self> {
        let keep = |folder: &'a Path| {
            // Fail before hours are spent if the folder cannot be created
            std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
            let fingerprint = files.fingerprint()?;
            anyhow::Ok((folder, fingerprint))
        };
        Ok(References { scene, spp, kept: folder.map(keep).transpose()? })
    }

    /// Both references: read from the folder if they are there, else rendered.
    pub(super) fn images(
        &self,
        job: &mut RenderJob,
        base: &Settings,
        render_settings: &RenderSettings,
    ) -> anyhow::Result<[Colors; 2]> {
        let scene = self.scene.scene.display();
        // Use the stored reference
        let mut image = |index: u32| -> anyhow::Result<Colors> {
            let settings = reference_settings(base, self.spp, index);
            let kept = self.kept.map(|(folder, fingerprint)| folder.join(self.name(fingerprint, job, &settings)));
            if let Some(path) = kept.as_ref().filter(|path| path.exists()) {
                return read(path, &job.world.scene.film.bounds);
            }

            // Render and store it
            progress::say(&format!("{scene}: reference {}, {} samples", index + 1, self.spp));
            let colors = reference_image(job, settings, render_settings);
            let colors = colors.with_context(|| format!("cannot render {scene}"))?;
            if let Some(path) = kept {
                write(&path, job, &settings, &colors).with_context(|| format!("cannot write {}", path.display()))?;
            }
            Ok(colors)
        };
        Ok([image(0)?, image(1)?])
    }

    /// A file name unique to the scene, the load options and the settings.
    fn name(&self, fingerprint: u64, job: &RenderJob, settings: &Settings) -> String {
        let mut hasher = DefaultHasher::new();
        let shown = format!("{:?}", self.scene.load_options());
        (fingerprint, shown, metadata(&job.world.scene.film, settings)).hash(&mut hasher);
        let name = self.scene.scene.file_stem().unwrap_or_default().to_string_lossy();
        let kind = <&str>::from(settings.integrator.kind);
        format!("{name}-{kind}-{}-{:016x}.exr", self.spp, hasher.finish())
    }
}

/// Reads a reference; fails if its size differs from `bounds`.
fn read(path: &Path, bounds: &PixelBounds) -> anyhow::Result<Colors> {
    let file = ImageFile::open(path)?;
    let asked = [bounds.width() as usize, bounds.height() as usize];
    let found = file.sizes()[0];
    if found != asked {
        bail!(
            "{} is no reference: it has {} × {} pixels, but the image has {} × {}",
            path.display(),
            found[0],
            found[1],
            asked[0],
            asked[1]
        );
    }
    let ColorChannels::Rgb(rgb) = file.layer().channels else {
        bail!("{} is no reference: it has no channels R, G and B", path.display());
    };
    Ok(file.floats(&rgb)?.as_chunks().0.iter().map(|pixel| pixel.map(f64::from)).collect())
}

fn write(path: &Path, job: &RenderJob, settings: &Settings, colors: &Colors) -> anyhow::Result<()> {
    let film = &job.world.scene.film;
    let data = colors.iter().flatten().map(|v| *v as f32).collect();
    let names = ["R", "G", "B"].map(str::to_owned).to_vec();
    let part = Part::linear(film.bounds.width() as usize, film.bounds.height() as usize, names, data);
    Ok(write_image(path, &[part.with_metadata(metadata(film, settings))])?)
}

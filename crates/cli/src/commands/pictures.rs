//! The image files of a rendering.

use super::UsageError;
use super::args::RenderArgs;
use super::denoise_args::{self, DENOISED, Denoised};
use super::exr::{ExrArgs, ExrImage, ExrLayer};
use super::look::{Displayed, LookArgs};
use super::part_args::{extension, is_part};
use super::progress;
use super::rescue::write_or_rescue;
use lumiris::film::Film;
use lumiris::imaging::TextEntries;
use lumiris::imaging::oiio::{self, Part, ROWS_AT_ONCE};
use lumiris::render::Rendering;
use lumiris::render::cryptomatte::Layer;
use lumiris::render::output::{self, Aov};
use lumiris::render::parts::{CameraMatrices, FilmReader};
use lumiris::scene::{RenderJob, SampleCountMap};
use lumiris_formats::output::check_writable;
use std::borrow::Cow;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Extensions of display images.
const DISPLAY_TYPES: [&str; 6] = ["png", "jpg", "jpeg", "tif", "tiff", "tga"];
/// Name of the image's layer.
const IMAGE: &str = "beauty";
/// Metadata key of images that were cut short by Ctrl-C.
const INTERRUPTED_KEY: &str = "lumiris:interrupted";

/// A rendering with everything that its files record.
pub(super) struct Made<'a> {
    /// The options.
    pub args: &'a RenderArgs,
    /// The rendered scene.
    pub job: &'a RenderJob,
    /// The film.
    pub rendering: &'a Rendering,
    /// Requested AOVs; `None` for the default.
    pub asked: Option<&'a [Aov]>,
    /// Requested Cryptomattes.
    pub cryptomattes: Vec<Layer>,
    /// The denoised image, if requested.
    pub denoised: Option<Denoised>,
    /// True if Ctrl-C ended the rendering.
    pub is_interrupted: bool,
}

/// True for names of EXR files.
pub(super) fn is_exr(path: &Path) -> bool {
    extension(path) == "exr"
}

/// True for names of image files, which scenes cannot have.
pub(super) fn is_picture(path: &Path) -> bool {
    const OTHERS: [&str; 5] = ["hdr", "pfm", "webp", "bmp", "gif"];
    let extension = extension(path);
    is_exr(path) || DISPLAY_TYPES.contains(&extension.as_str()) || OTHERS.contains(&extension.as_str())
}

/// Rejects outputs that cannot be written, before time is spent on rendering.
pub(super) fn check_outputs(outputs: &[PathBuf]) -> anyhow::Result<()> {
    for path in outputs {
        if !is_output(path) {
            let text = format!("{}: the output format must be .exr, .{}", path.display(), DISPLAY_TYPES.join(", ."));
            return Err(UsageError(text).into());
        }
        check_writable(path)?;
    }
    Ok(())
}

/// True if the file type can be written.
pub(super) fn is_output(path: &Path) -> bool {
    is_exr(path) || is_part(path) || DISPLAY_TYPES.contains(&extension(path).as_str())
}

/// True if all images and parts exist and none was cut short by Ctrl-C. Files are renamed to their final names when
/// they are complete. Among images, only EXR and PNG record Ctrl-C.
pub(super) fn are_complete(outputs: &[PathBuf]) -> bool {
    outputs.iter().all(|path| match is_part(path) {
        true => FilmReader::open(path).is_ok_and(|part| part.header().is_finished),
        false => {
            path.is_file() && oiio::read_metadata(path).is_ok_and(|metadata| !metadata.contains_key(INTERRUPTED_KEY))
        }
    })
}

/// Written files, and errors of the others.
#[derive(Debug, Default)]
pub(super) struct Written {
    /// Files written to their destinations.
    pub paths: Vec<PathBuf>,
    /// Errors of files that could not be written to their destinations, with the paths of rescued copies.
    pub misplaced: Vec<String>,
}

impl Written {
    /// Writes a file, or a rescued copy.
    pub(super) fn write(&mut self, path: PathBuf, write: impl Fn(&Path) -> anyhow::Result<()>) {
        match write_or_rescue(&path, write) {
            Ok(()) => self.paths.push(path),
            Err(error) => self.misplaced.push(format!("{error:#}")),
        }
    }
}

/// Writes all images of a rendering.
pub(super) fn write_pictures(made: &Made<'_>, outputs: &[PathBuf]) -> anyhow::Result<Written> {
    Ok(write_all(&made.picture()?, outputs))
}

/// Writes an image to all files.
pub(super) fn write_all(picture: &Picture<'_>, outputs: &[PathBuf]) -> Written {
    let mut written = Written::default();
    outputs.iter().for_each(|path| written.write(path.clone(), |path| picture.write(path)));
    written
}

/// An image with its options for writing.
pub(super) struct Picture<'a> {
    /// The film.
    pub film: &'a Film,
    /// Options of display images.
    pub look: &'a LookArgs,
    /// Options of EXR files.
    pub exr: &'a ExrArgs,
    /// AOVs of EXR files.
    pub aovs: Vec<Aov>,
    /// Data of the AOV that shows a sample count map.
    pub sample_count_map: Option<&'a SampleCountMap>,
    /// Cryptomattes.
    pub cryptomattes: &'a [Layer],
    /// The denoised image, which display images show.
    pub denoised: Option<&'a Denoised>,
    /// The camera's matrices.
    pub camera: CameraMatrices,
    /// Wall-clock time of the rendering (s).
    pub seconds: f64,
    /// Settings and provenance of the image.
    pub metadata: TextEntries,
}

impl Picture<'_> {
    /// Writes all channels, or display colours, depending on the type of the file.
    pub(super) fn write(&self, path: &Path) -> anyhow::Result<()> {
        if is_exr(path) {
            return self.write_exr(path);
        }
        let film = self.film;
        let size = [film.bounds.width() as usize, film.bounds.height() as usize];
        let full = [film.resolution[0] as usize, film.resolution[1] as usize];
        let origin = [film.bounds.x0 as usize, film.bounds.y0 as usize];
        let of_denoised = self.denoised.map(Denoised::metadata_shown).unwrap_or_default();
        let metadata = [self.metadata.clone(), of_denoised].concat();
        let image = output::Layers::new(film, true, &[], None);
        let rows = |rows: Range<usize>| match self.denoised {
            Some(denoised) => denoised.pixels[3 * size[0] * rows.start..3 * size[0] * rows.end].to_vec(),
            None => image.rows_in_parallel(film.bounds.y0 + rows.start as u32..film.bounds.y0 + rows.end as u32),
        };
        write_display(path, Placement { size, origin, full }, self.look, &rows, metadata)
    }

    fn write_exr(&self, path: &Path) -> anyhow::Result<()> {
        let of_denoised = self.denoised.map(Denoised::metadata).unwrap_or_default();
        let image = ExrImage {
            film: self.film,
            camera: &self.camera,
            seconds: self.seconds,
            layers: self.layers(),
            metadata: [self.metadata.clone(), of_denoised].concat(),
        };
        if let Some(warning) = self.exr.write(path, &image)? {
            progress::say(&format!("{}: {warning}", path.display()));
        }
        Ok(())
    }

    /// The layers of an EXR file: the film's, one by one if each is a separate part, then the others.
    fn layers(&self) -> Vec<ExrLayer<'_>> {
        // Layers of the film
        let top = self.film.bounds.y0;
        let coordinates = move |rows: Range<usize>| top + rows.start as u32..top + rows.end as u32;
        let layer = |name: &str, channels, rows| ExrLayer {
            name: name.to_owned(),
            channels,
            rows,
            metadata: Vec::new(),
            is_exact: false,
        };
        let of_film = |name: &str, has_image: bool, aovs| {
            let layers = output::Layers::new(self.film, has_image, aovs, self.sample_count_map);
            layer(name, layers.names(), Box::new(move |rows| layers.rows_in_parallel(coordinates(rows))))
        };
        let mut layers = match self.exr.is_multi() {
            false => vec![of_film(IMAGE, true, &self.aovs)],
            true => {
                let aovs = self.aovs.iter().map(|aov| of_film(<&str>::from(aov), false, std::slice::from_ref(aov)));
                std::iter::once(of_film(IMAGE, true, &[])).chain(aovs).collect()
            }
        };

        // Denoised image
        if let Some(denoised) = self.denoised {
            let row = 3 * self.film.bounds.width() as usize;
            let rows = move |rows: Range<usize>| denoised.pixels[row * rows.start..row * rows.end].to_vec();
            layers.push(layer(denoise_args::LAYER, DENOISED.map(str::to_owned).to_vec(), Box::new(rows)));
        }

        // Cryptomattes
        let of_ids = self.cryptomattes.iter().map(|ids| ExrLayer {
            metadata: ids.metadata.clone(),
            is_exact: true,
            ..layer(ids.name, ids.channels.clone(), Box::new(move |rows| ids.rows(coordinates(rows))))
        });
        layers.extend(of_ids);
        layers
    }
}

/// The pixels of an image within the full image.
#[derive(Clone, Copy)]
pub(super) struct Placement {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Position of the first pixel.
    pub origin: [usize; 2],
    /// Size of the full image.
    pub full: [usize; 2],
}

/// Writes a display image. `rows` returns radiance of a range of rows: RGB, interleaved.
pub(super) fn write_display(
    path: &Path,
    Placement { size, origin, full }: Placement,
    look: &LookArgs,
    rows: &dyn Fn(Range<usize>) -> Vec<f32>,
    metadata: TextEntries,
) -> anyhow::Result<()> {
    let names = ["R", "G", "B"].map(str::to_owned).to_vec();
    let part = Part::display(size[0], size[1], names, Vec::new()).with_window(origin, full).with_metadata(metadata);
    let Some(grade) = look.grade() else {
        // The exposure depends on all pixels, or OpenColorIO takes long to set up
        let all: Vec<Vec<f32>> =
            (0..size[1]).step_by(ROWS_AT_ONCE).map(|y| rows(y..size[1].min(y + ROWS_AT_ONCE))).collect();
        let Displayed { pixels, metadata } = look.apply_to(all.concat())?;
        let some =
            |_: usize, rows: Range<usize>| Cow::Borrowed(&pixels[3 * size[0] * rows.start..3 * size[0] * rows.end]);
        return Ok(oiio::write_rows(path, &[part.with_metadata(metadata)], &some)?);
    };
    let graded = |_: usize, of: Range<usize>| {
        let mut pixels = rows(of);
        grade.apply(&mut pixels);
        Cow::Owned(pixels)
    };
    Ok(oiio::write_rows(path, &[part.with_metadata(grade.metadata())], &graded)?)
}

impl Made<'_> {
    /// The image with its options for writing.
    fn picture(&self) -> anyhow::Result<Picture<'_>> {
        Ok(Picture {
            film: &self.rendering.film,
            look: &self.args.look,
            exr: &self.args.exr,
            aovs: self.aovs(),
            sample_count_map: self.job.sample_count_map.as_ref(),
            cryptomattes: &self.cryptomattes,
            denoised: self.denoised.as_ref(),
            camera: CameraMatrices::of(&self.job.world.scene.camera),
            seconds: self.rendering.elapsed.as_secs_f64(),
            metadata: self.metadata(),
        })
    }

    /// The AOVs of EXR files.
    fn aovs(&self) -> Vec<Aov> {
        if let Some(list) = self.asked {
            return list.to_vec();
        }
        let has = (self.job.sample_count_map.is_some(), self.rendering.cache.is_some());
        output::default_aovs(&self.rendering.film, has.0, has.1)
    }

    /// Settings and provenance of the image.
    fn metadata(&self) -> TextEntries {
        let Made { args, job, rendering, .. } = self;
        let mut metadata = output::metadata(&job.world.scene.film, job.settings());
        let mut add = |key: &str, value: String| metadata.push((key.to_owned(), value));
        add("lumiris:scene", args.scene.scene.display().to_string());
        add("lumiris:accel", <&str>::from(args.scene.accel).to_owned());
        if self.is_interrupted {
            add(INTERRUPTED_KEY, "true".to_owned());
        }
        metadata.extend(output::progress_metadata(rendering));
        metadata
    }
}

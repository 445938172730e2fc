//! Options of denoising, and the denoised image.

use super::UsageError;
use super::part_args::extension;
use clap::Args;
use lumiris::film::{Film, PixelBounds};
use lumiris::imaging::TextEntries;
use lumiris::imaging::oidn::{DenoiseError, Denoiser, NoisyImage};
use lumiris::render::output::{Aov, Layers};
use std::path::{Path, PathBuf};

/// Name of the layer, and of its part in multi-part files.
pub(super) const LAYER: &str = "denoised";
/// Channels of the layer.
pub(super) const DENOISED: [&str; 3] = ["denoised.R", "denoised.G", "denoised.B"];
/// Metadata key: denoiser and guide layers.
pub(super) const DENOISED_KEY: &str = "lumiris:denoised";
/// Metadata key: the layer shown by a display image.
const SHOWN_KEY: &str = "lumiris:layer";
/// Environment variable with the path of the library.
const LIBRARY_VARIABLE: &str = "LUMIRIS_OIDN";

/// Options of `render` and `merge`.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Denoising")]
pub(super) struct DenoiseArgs {
    /// Denoise the image with Open Image Denoise, guided by albedo and normal. EXR files, of which at least one is
    /// required, get the layer `denoised`; PNG, JPEG, TIFF and TGA show the denoised image
    #[arg(long)]
    pub denoise: bool,
    /// Library of Open Image Denoise 2 [default: the environment variable LUMIRIS_OIDN, or the system's]
    #[arg(long, value_name = "PATH", requires = "denoise")]
    oidn_library: Option<PathBuf>,
}

impl DenoiseArgs {
    /// Opens the library, if the image is to be denoised.
    pub(super) fn open(&self, threads: Option<u32>) -> anyhow::Result<Option<Denoiser>> {
        self.denoise.then(|| open(self.oidn_library.as_deref(), threads)).transpose()
    }

    /// Refuses `--denoise` without an EXR output, since the noisy image would be lost.
    pub(super) fn check(&self, outputs: &[PathBuf]) -> Result<(), UsageError> {
        if self.denoise && !outputs.iter().any(|path| extension(path) == "exr") {
            let text = "--denoise needs an EXR file among the outputs, which keeps the image as it was rendered";
            return Err(UsageError(text.to_owned()));
        }
        Ok(())
    }
}

/// The denoised image, or an error message: a failure does not lose the rendered image. `has_features`: the film has
/// the features of the first surfaces.
pub(super) fn denoise(denoiser: &Denoiser, film: &Film, has_features: bool) -> Result<Denoised, String> {
    Denoised::of_film(denoiser, film, has_features).map_err(|error| format!("{error}; the image is written as it is"))
}

/// Opens the library named by the option, else by the environment, else the system's.
pub(super) fn open(library: Option<&Path>, threads: Option<u32>) -> anyhow::Result<Denoiser> {
    let of_environment = std::env::var_os(LIBRARY_VARIABLE).filter(|path| !path.is_empty()).map(PathBuf::from);
    let library = library.or(of_environment.as_deref());
    // The dynamic loader does not search the current folder for plain names
    let library = library.map(|path| match std::path::absolute(path) {
        Ok(absolute) if absolute.is_file() => absolute,
        _ => path.to_owned(),
    });
    Denoiser::open(library.as_deref(), threads.map(|n| n as usize)).map_err(|error| {
        let hint = format!("by --oidn-library or the environment variable {LIBRARY_VARIABLE}");
        match error {
            DenoiseError::Library(_) => anyhow::anyhow!("{error} {hint}"),
            _ => error.into(),
        }
    })
}

/// A denoised image.
pub(super) struct Denoised {
    /// RGB, interleaved.
    pub pixels: Vec<f32>,
    /// Denoiser and guide layers.
    pub about: String,
}

impl Denoised {
    /// Denoises an image.
    pub(super) fn new(denoiser: &Denoiser, image: NoisyImage) -> Result<Self, DenoiseError> {
        let guides = match (&image.albedo, &image.normal) {
            (Some(_), Some(_)) => "by colour, albedo and normal",
            (Some(_), None) => "by colour and albedo",
            _ => "by colour",
        };
        let about = format!("Open Image Denoise {}, {guides}", denoiser.version());
        Ok(Denoised { pixels: denoiser.denoise(image)?, about })
    }

    /// Denoises a film, guided by the features of the first surfaces if it has them.
    fn of_film(denoiser: &Denoiser, film: &Film, has_features: bool) -> Result<Self, DenoiseError> {
        let layer = |has_image: bool, aovs: &[Aov]| {
            let PixelBounds { y0, y1, .. } = film.bounds;
            Layers::new(film, has_image, aovs, None).rows_in_parallel(y0..y1)
        };
        let image = NoisyImage {
            width: film.bounds.width() as usize,
            height: film.bounds.height() as usize,
            color: layer(true, &[]),
            albedo: has_features.then(|| layer(false, &[Aov::Albedo])),
            normal: has_features.then(|| layer(false, &[Aov::Normal])),
        };
        Denoised::new(denoiser, image)
    }

    /// Metadata of files with the layer.
    pub(super) fn metadata(&self) -> TextEntries {
        vec![(DENOISED_KEY.to_owned(), self.about.clone())]
    }

    /// Metadata of files that show the layer instead of the rendered image.
    pub(super) fn metadata_shown(&self) -> TextEntries {
        let mut metadata = self.metadata();
        metadata.push((SHOWN_KEY.to_owned(), "denoised".to_owned()));
        metadata
    }
}

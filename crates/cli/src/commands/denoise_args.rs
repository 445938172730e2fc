//! Options of denoising, and what became of it.

use clap::Args;
use lumiris::film::Film;
use lumiris::imaging::oidn::{DenoiseError, Denoiser, NoisyImage};
use lumiris::render::output::{Aov, Channels, channels};
use std::path::{Path, PathBuf};

/// Channels of the layer.
pub(super) const DENOISED: [&str; 3] = ["denoised.R", "denoised.G", "denoised.B"];
/// Metadata: what denoised the image, and by which layers.
pub(super) const DENOISED_KEY: &str = "lumiris:denoised";
/// Metadata of images for a display: which layer they show.
const SHOWN_KEY: &str = "lumiris:layer";
/// Environment variable of the library.
const LIBRARY_VARIABLE: &str = "LUMIRIS_OIDN";

/// Options of `render`.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Denoising")]
pub(super) struct DenoiseArgs {
    /// Denoise the image by Open Image Denoise, albedo and normal: EXR files, of which there must be one, have the layer
    /// `denoised` beside the image; PNG, JPEG, TIFF and TGA show the denoised image
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
}

/// Opens the library: that of the option, of the environment or of the system.
pub(super) fn open(library: Option<&Path>, threads: Option<u32>) -> anyhow::Result<Denoiser> {
    let of_environment = std::env::var_os(LIBRARY_VARIABLE).filter(|path| !path.is_empty()).map(PathBuf::from);
    let library = library.or(of_environment.as_deref());
    // The dynamic loader does not look for mere names in the current folder
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
    /// What denoised it, and by which layers.
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

    /// Denoises a film that has the features of the first surfaces.
    pub(super) fn of_film(denoiser: &Denoiser, film: &Film) -> Result<Self, DenoiseError> {
        let layers = channels(film, &[Aov::Albedo, Aov::Normal], None);
        let pixels = layers.data.as_chunks::<9>().0;
        let layer = |c: usize| pixels.iter().flat_map(|p| [p[c], p[c + 1], p[c + 2]]).collect::<Vec<f32>>();
        let image = NoisyImage {
            width: film.bounds.width() as usize,
            height: film.bounds.height() as usize,
            color: layer(0),
            albedo: Some(layer(3)),
            normal: Some(layer(6)),
        };
        Denoised::new(denoiser, image)
    }

    /// Adds the layer to others of the same image.
    pub(super) fn append_to(&self, layers: &mut Channels) {
        let stride = layers.names.len().max(1);
        let pixels = layers.data.chunks_exact(stride).zip(self.pixels.as_chunks::<3>().0);
        layers.data = pixels.flat_map(|(others, rgb)| others.iter().chain(rgb).copied()).collect();
        layers.names.extend(DENOISED.map(str::to_owned));
    }

    /// Metadata of files that have the layer.
    pub(super) fn metadata(&self) -> Vec<(String, String)> {
        vec![(DENOISED_KEY.to_owned(), self.about.clone())]
    }

    /// Metadata of files that show the layer instead of the image.
    pub(super) fn metadata_shown(&self) -> Vec<(String, String)> {
        let mut metadata = self.metadata();
        metadata.push((SHOWN_KEY.to_owned(), "denoised".to_owned()));
        metadata
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_layer_stands_after_the_others() {
        let denoised = Denoised { pixels: vec![5.0, 6.0, 7.0, 8.0, 9.0, 10.0], about: String::new() };
        let mut layers = Channels { names: vec!["R".to_owned(), "G".to_owned()], data: vec![1.0, 2.0, 3.0, 4.0] };
        denoised.append_to(&mut layers);
        assert_eq!(layers.data, [1.0, 2.0, 5.0, 6.0, 7.0, 3.0, 4.0, 8.0, 9.0, 10.0]);
        assert_eq!(layers.names, ["R", "G", "denoised.R", "denoised.G", "denoised.B"]);
    }
}

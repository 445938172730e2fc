//! `lumiris maketx`: images as tiled files with all levels.

use super::UsageError;
use anyhow::Context;
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use lumiris::imaging::texture_file::write_texture;
use lumiris::import::images::{ImageEncoding, all_maps};
use lumiris_formats::output::write_whole;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Extension of textures.
const EXTENSION: &str = "tx";

/// `lumiris maketx`
#[derive(Args, Clone, Debug)]
pub(super) struct MaketxArgs {
    /// Images
    #[arg(required = true, value_name = "FILE")]
    images: Vec<PathBuf>,
    /// Folder of the textures, which is created if it does not exist; for a single image, also the name of the texture,
    /// which ends in .tx [default: beside the images]
    #[arg(short, long, value_name = "FOLDER|FILE")]
    output: Option<PathBuf>,
    /// Encoding of 8-bit and 16-bit values, as in the scene. `auto` is `srgb`
    #[arg(long, default_value = "auto", value_parser = encoding())]
    encoding: ImageEncoding,
}

fn encoding() -> impl TypedValueParser<Value = ImageEncoding> {
    PossibleValuesParser::new(["auto", "srgb", "linear"]).map(|name| match &*name {
        "srgb" => ImageEncoding::Srgb,
        "linear" => ImageEncoding::Linear,
        _ => ImageEncoding::Auto,
    })
}

pub(super) fn run(args: &MaketxArgs) -> anyhow::Result<ExitCode> {
    // Name the textures
    let is_texture = |path: &PathBuf| path.extension().is_some_and(|extension| extension == EXTENSION);
    let folder = args.output.as_ref().filter(|path| !is_texture(path));
    let textures: Vec<PathBuf> = match (&args.output, &args.images[..]) {
        (Some(texture), [_]) if is_texture(texture) => vec![texture.clone()],
        (Some(texture), _) if is_texture(texture) => {
            return Err(UsageError(format!("{}: several images need a folder", texture.display())).into());
        }
        (_, images) => images.iter().map(|image| texture_of(image, folder)).collect(),
    };
    let mut names = BTreeSet::new();
    if let Some(texture) = textures.iter().find(|texture| !names.insert(*texture)) {
        return Err(UsageError(format!("{}: two images have this texture", texture.display())).into());
    }

    // Write them
    if let Some(folder) = folder {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    args.images.par_iter().zip(&textures).try_for_each(|(image, texture)| make(image, texture, args.encoding))?;
    Ok(ExitCode::SUCCESS)
}

/// The texture of an image, in `folder` or beside the image.
fn texture_of(image: &Path, folder: Option<&PathBuf>) -> PathBuf {
    let texture = image.with_extension(EXTENSION);
    match (folder, texture.file_name()) {
        (Some(folder), Some(name)) => folder.join(name),
        _ => texture,
    }
}

fn make(image: &Path, texture: &Path, encoding: ImageEncoding) -> anyhow::Result<()> {
    let maps = all_maps(image, encoding)?;
    let write = |out: &mut dyn Write| write_texture(out, &maps.iter().collect::<Vec<_>>());
    write_whole(texture, |file| {
        let mut out = BufWriter::with_capacity(1 << 20, file);
        write(&mut out)?;
        out.flush()
    })
    .with_context(|| format!("cannot write {}", texture.display()))
}

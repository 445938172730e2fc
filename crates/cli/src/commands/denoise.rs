//! `lumiris denoise`: adds the layer `denoised` to an image file.

use super::UsageError;
use super::denoise_args::{DENOISED, DENOISED_KEY, Denoised, LAYER, open};
use super::look::LookArgs;
use super::part_args::is_part;
use super::pictures::{Placement, check_outputs, is_exr, write_display};
use super::progress;
use super::rescue::write_or_rescue;
use anyhow::{anyhow, bail};
use clap::Args;
use lumiris::imaging::color_layers::{ColorLayer, choose};
use lumiris::imaging::file_parts::{FilePart, read_file_parts};
use lumiris::imaging::oidn::NoisyImage;
use lumiris::imaging::oiio::{MetaValue, PartHeader, ReadLimits, Storage, write_image};
use lumiris::imaging::{ColorChannels, TextEntries};
use std::ops::Range;
use std::path::PathBuf;
use std::process::ExitCode;

/// `lumiris denoise`
#[derive(Args, Clone, Debug)]
pub(super) struct DenoiseFileArgs {
    /// EXR file with the image, albedo and normal, as written by `render`
    input: PathBuf,
    /// Output image; may be given several times. EXR has all layers of the input and the layer `denoised`; PNG, JPEG,
    /// TIFF and TGA show the denoised image
    #[arg(short, long, value_name = "FILE", required = true)]
    output: Vec<PathBuf>,
    /// Library of Open Image Denoise 2 [default: the environment variable LUMIRIS_OIDN, or the system's]
    #[arg(long, value_name = "PATH")]
    oidn_library: Option<PathBuf>,
    /// Threads [default: all cores]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u32).range(1..=4096))]
    threads: Option<u32>,
    #[command(flatten)]
    look: LookArgs,
    /// Print only warnings and errors
    #[arg(short, long)]
    quiet: bool,
}

pub(super) fn run(args: &DenoiseFileArgs) -> anyhow::Result<ExitCode> {
    // Check the arguments
    check_outputs(&args.output)?;
    if let Some(path) = args.output.iter().find(|path| is_part(path)) {
        return Err(UsageError(format!("{}: a denoised image cannot be written as a part", path.display())).into());
    }
    args.look.check()?;
    if !is_exr(&args.input) {
        let path = args.input.display();
        return Err(UsageError(format!(
            "{path}: only EXR files have the linear light and the layers that denoising needs"
        ))
        .into());
    }
    let denoiser = open(args.oidn_library.as_deref(), args.threads)?;

    // Read and denoise
    let mut parts = read_file_parts(&args.input, &ReadLimits::default())?;
    drop_earlier_result(&mut parts);
    let layer = image_of(&parts).map_err(|reason| anyhow!("{}: {reason}", args.input.display()))?;
    let main = layer.part;
    if shares_paths(&parts) {
        progress::say(&format!(
            "warning: {}: pixels share paths, and the denoiser takes their common noise for detail: render with \
             --path-reuse 1",
            args.input.display()
        ));
    }
    let image = noisy_image(&parts, &layer, |text| progress::say(&format!("{}: {text}", args.input.display())));
    let denoised = Denoised::new(&denoiser, image)?;

    // Write all outputs
    let mut misplaced = Vec::new();
    let mut written = Vec::new();
    for path in &args.output {
        let write = |path: &std::path::Path| {
            if is_exr(path) {
                let parts = with_layer(parts.clone(), &layer, &denoised);
                let parts: Vec<_> = parts.into_iter().map(FilePart::into_part).collect();
                return Ok(write_image(path, &parts)?);
            }
            let part = &parts[main];
            let size = [part.image.width, part.image.height];
            let metadata = [texts(&parts), denoised.metadata_shown()].concat();
            let rows = |rows: Range<usize>| denoised.pixels[3 * size[0] * rows.start..3 * size[0] * rows.end].to_vec();
            let placement = Placement { size, origin: part.origin, full: part.full };
            write_display(path, placement, &args.look, &rows, metadata)
        };
        match write_or_rescue(path, write) {
            Ok(()) => written.push(path.display().to_string()),
            Err(error) => misplaced.push(format!("{error:#}")),
        }
    }

    // Report
    if !args.quiet && !written.is_empty() {
        progress::say(&format!("{}: {}", written.join(", "), denoised.about));
    }
    if !misplaced.is_empty() {
        bail!(misplaced.join("\nlumiris: "));
    }
    Ok(ExitCode::SUCCESS)
}

/// Removes the layer and the metadata of an earlier run.
fn drop_earlier_result(parts: &mut Vec<FilePart>) {
    for part in parts.iter_mut() {
        part.retain_channels(|name| !DENOISED.contains(&name));
        part.metadata.retain(|(name, _)| name != DENOISED_KEY);
    }
    parts.retain(|part| !part.image.channels.is_empty());
}

/// Finds the layer of the image.
fn image_of(parts: &[FilePart]) -> Result<ColorLayer, String> {
    let header = |part: &FilePart| PartHeader {
        name: part.name.clone(),
        channels: part.image.channels.clone(),
        size: [part.image.width, part.image.height],
    };
    let layer = choose(&parts.iter().map(header).collect::<Vec<_>>(), None)?;
    match layer.channels {
        ColorChannels::Rgb(_) => Ok(layer),
        ColorChannels::Grey(_) => Err("has no channels R, G and B".to_owned()),
    }
}

/// Three channels of a part, side by side.
fn layer(part: &FilePart, channels: [usize; 3]) -> Vec<f32> {
    let stride = part.image.channels.len();
    part.image.data.chunks_exact(stride).flat_map(|pixel| channels.map(|c| pixel[c])).collect()
}

/// The image with its guides of the same size. Warns of missing guides.
fn noisy_image(parts: &[FilePart], image: &ColorLayer, warn: impl Fn(&str)) -> NoisyImage {
    // Find the guides
    let part = &parts[image.part];
    let is_beside = |other: &&FilePart| {
        let size = |p: &FilePart| (p.image.width, p.image.height, p.origin);
        size(other) == size(part)
    };
    let guide = |names: [&str; 3]| {
        let find = |part: &FilePart| {
            let [a, b, c] = names.map(|name| position(part, name));
            Some(layer(part, [a?, b?, c?]))
        };
        parts.iter().filter(is_beside).find_map(find)
    };
    let albedo = guide(["albedo.R", "albedo.G", "albedo.B"]);
    let normal = guide(["normal.X", "normal.Y", "normal.Z"]);

    // Warn of missing guides
    match (&albedo, &normal) {
        (Some(_), Some(_)) => {}
        (Some(_), None) => warn("warning: has no layer normal: denoised by colour and albedo"),
        (None, Some(_)) => {
            warn("warning: has no layer albedo, without which normals are of no use: denoised by colour")
        }
        (None, None) => warn("warning: has neither albedo nor normal: denoised by colour, which loses detail"),
    }

    // A grey image fills all three channels
    let at = image.channels.as_slice();
    let rgb = std::array::from_fn(|c| at[c.min(at.len() - 1)]);
    let normal = normal.filter(|_| albedo.is_some());
    let (width, height) = (part.image.width, part.image.height);
    NoisyImage { width, height, color: layer(part, rgb), albedo, normal }
}

/// Index of the channel `name`. Accepts prefixes and other capitalisation, as other programs write: `Albedo.R`,
/// `ViewLayer.Denoising Albedo.R`.
fn position(part: &FilePart, name: &str) -> Option<usize> {
    let names = &part.image.channels;
    let is_named = |channel: &str| {
        let channel = channel.to_lowercase();
        channel.strip_suffix(&name.to_lowercase()).is_some_and(|rest| rest.is_empty() || rest.ends_with(['.', ' ']))
    };
    part.image.channel(name).or_else(|| names.iter().position(|channel| is_named(channel)))
}

/// Adds the layer: as a part of its own if the file has several parts.
fn with_layer(mut parts: Vec<FilePart>, image: &ColorLayer, denoised: &Denoised) -> Vec<FilePart> {
    let (main, channels) = (image.part, image.channels.as_slice());
    let storage = channels.first().and_then(|&red| parts[main].storage.get(red)).copied().unwrap_or(Storage::Float);
    let layer = parts[main].beside(LAYER, &DENOISED, denoised.pixels.clone(), storage);
    if parts.len() > 1 {
        parts.push(layer);
    } else {
        parts[main].append(layer);
    }
    let entries = denoised.metadata().into_iter().map(|(key, value)| (key, MetaValue::Text(value)));
    parts[0].metadata.extend(entries);
    parts
}

/// True if pixels share paths, so that their noise is correlated.
fn shares_paths(parts: &[FilePart]) -> bool {
    let edge = texts(parts).into_iter().find(|(name, _)| name == "lumiris:path_reuse");
    edge.is_some_and(|(_, edge)| edge.parse::<u32>().is_ok_and(|edge| edge > 1))
}

/// The metadata of the settings.
fn texts(parts: &[FilePart]) -> TextEntries {
    let entries = parts.iter().take(1).flat_map(|part| &part.metadata);
    let entries = entries.filter_map(|(name, value)| match value {
        MetaValue::Text(text) if name.starts_with("lumiris:") => Some((name.clone(), text.clone())),
        _ => None,
    });
    entries.collect()
}

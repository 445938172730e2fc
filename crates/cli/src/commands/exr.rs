//! EXR files: parts, channels, storage and standard attributes.

use super::UsageError;
use super::named::named;
use clap::Args;
use clap::builder::PossibleValuesParser;
use lumiris::cameras::Camera;
use lumiris::film::Film;
use lumiris::imaging::oiio::{MetaValue, Part, Storage};
use lumiris::render::cryptomatte::{Cryptomatte, Layer};
use lumiris::render::output::Channels;
use strum::{EnumString, VariantNames};

/// Compressions, and whether they keep every bit of a float.
const COMPRESSIONS: [(&str, bool); 10] = [
    ("none", true),
    ("rle", true),
    ("zips", true),
    ("zip", true),
    ("piz", true),
    ("pxr24", false),
    ("b44", false),
    ("b44a", false),
    ("dwaa", false),
    ("dwab", false),
];
/// Layers that 16 bits suffice for; of others the numbers count, or they are too small.
const COLORS: [&str; 12] = [
    "R",
    "G",
    "B",
    "albedo.R",
    "albedo.G",
    "albedo.B",
    "normal.X",
    "normal.Y",
    "normal.Z",
    "denoised.R",
    "denoised.G",
    "denoised.B",
];
/// Largest number that 16 bits hold.
const MAX_HALF: f32 = 65_504.0;

/// How colours are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, VariantNames)]
#[strum(serialize_all = "kebab-case")]
enum ExrType {
    Half,
    Float,
}

/// How layers are arranged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, VariantNames)]
#[strum(serialize_all = "kebab-case")]
enum ExrParts {
    Single,
    Multi,
}

/// Options of EXR files.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "EXR")]
pub(super) struct ExrArgs {
    /// Floats of the image, denoised or not, albedo and normal; all other channels are always `float`
    #[arg(long, value_name = "TYPE", default_value = "float", value_parser = named::<ExrType>())]
    exr_type: ExrType,
    /// Compression; Cryptomatte layers, which bear no loss, have `zip` where it is pxr24, b44, b44a, dwaa or dwab
    #[arg(long, value_name = "NAME", default_value = "zip", value_parser = PossibleValuesParser::new(COMPRESSIONS.map(|(name, _)| name)))]
    exr_compression: String,
    /// One part with all layers, or a part for each
    #[arg(long, value_name = "PARTS", default_value = "single", value_parser = named::<ExrParts>())]
    exr_parts: ExrParts,
    /// Cryptomatte layers of objects and materials: ids and coverage, for compositing programs
    #[arg(
        long, value_name = "LIST", value_delimiter = ',', num_args = 0..=1, require_equals = true,
        default_missing_value = "object,material", value_parser = named::<Cryptomatte>()
    )]
    pub cryptomatte: Vec<Cryptomatte>,
}

/// An image with its layers.
pub(super) struct ExrImage<'a> {
    pub film: &'a Film,
    pub camera: &'a CameraMatrices,
    /// Wall-clock time of the rendering (s).
    pub seconds: f64,
    pub channels: Channels,
    pub cryptomattes: &'a [Layer],
    pub metadata: Vec<(String, String)>,
}

impl ExrArgs {
    fn is_lossless(&self) -> bool {
        COMPRESSIONS.iter().any(|(name, lossless)| *name == self.exr_compression && *lossless)
    }

    /// Refuses what cannot be, before time is spent on rendering.
    pub(super) fn check(&self) -> anyhow::Result<()> {
        if !self.cryptomatte.is_empty() && !self.is_lossless() && self.exr_parts == ExrParts::Single {
            let text = "--cryptomatte: the ids would not survive the compression; --exr-parts multi keeps them apart";
            return Err(UsageError(text.to_owned()).into());
        }
        Ok(())
    }

    /// The parts of a file, and a warning.
    pub(super) fn parts(&self, image: ExrImage<'_>) -> (Vec<Part>, Option<String>) {
        let warning = self.overflow(&image.channels);
        let film = image.film;
        let size = [film.bounds.width() as usize, film.bounds.height() as usize];
        let new_part = |channels: Channels, compression: &str| {
            let part = Part::linear(size[0], size[1], channels.names, channels.data).compressed_by(compression);
            let full = film.resolution.map(|n| n as usize);
            part.with_window([film.bounds.x0 as usize, film.bounds.y0 as usize], full)
        };
        let of_crypto = image.cryptomattes.iter().flat_map(|layer| layer.metadata.clone()).collect();
        let mut parts = match self.exr_parts {
            ExrParts::Single => {
                let layers = image.cryptomattes.iter().map(|layer| &layer.channels);
                vec![new_part(joined(std::iter::once(&image.channels).chain(layers)), &self.exr_compression)]
            }
            ExrParts::Multi => {
                let layers = split(&image.channels).into_iter();
                let parts = layers.map(|(name, channels)| new_part(channels, &self.exr_compression).named(&name));
                let lossless = if self.is_lossless() { &self.exr_compression } else { "zip" };
                let ids = image.cryptomattes.iter().map(|layer| {
                    let part = new_part(layer.channels.clone(), lossless).named(layer.name);
                    part.with_metadata(layer.metadata.clone())
                });
                parts.chain(ids).collect()
            }
        };
        if self.exr_type == ExrType::Half {
            parts = parts.into_iter().map(|part| part.channels_stored_as(&COLORS, Storage::Half)).collect();
        }
        // Readers of several parts look into the first for what concerns all
        let first = parts.remove(0).with_metadata(image.metadata).with_metadata(of_crypto);
        parts.insert(0, with_standard_attributes(first, image.camera, image.seconds));
        (parts, warning)
    }

    /// What the user should know of values that 16 bits do not hold.
    fn overflow(&self, channels: &Channels) -> Option<String> {
        let colors = channels.names.iter().map(|name| COLORS.contains(&name.as_str()));
        let colors: Vec<bool> = colors.collect();
        let pixels = channels.data.chunks_exact(channels.names.len().max(1));
        let is_large = |pixel: &[f32]| pixel.iter().zip(&colors).any(|(v, color)| *color && v.abs() > MAX_HALF);
        let count = pixels.filter(|pixel| is_large(pixel)).count();
        (self.exr_type == ExrType::Half && count > 0).then(|| {
            format!("warning: {count} pixels are brighter than 65504, and infinite as half floats; --exr-type float keeps them")
        })
    }
}

/// All channels side by side.
fn joined<'a>(layers: impl Iterator<Item = &'a Channels>) -> Channels {
    let layers: Vec<&Channels> = layers.collect();
    let names: Vec<String> = layers.iter().flat_map(|layer| layer.names.iter().cloned()).collect();
    let mut rows: Vec<_> = layers.iter().map(|layer| layer.data.chunks_exact(layer.names.len().max(1))).collect();
    let mut data = Vec::with_capacity(layers.iter().map(|layer| layer.data.len()).sum());
    let pixels = layers.first().map_or(0, |layer| layer.data.len() / layer.names.len().max(1));
    for _ in 0..pixels {
        rows.iter_mut().filter_map(Iterator::next).for_each(|values| data.extend_from_slice(values));
    }
    Channels { names, data }
}

/// The layers of channels, which stand one after the other: `beauty`, and others by what precedes the point in their
/// names.
fn split(channels: &Channels) -> Vec<(String, Channels)> {
    let layer = |name: &str| match name {
        "R" | "G" | "B" => "beauty".to_owned(),
        _ => name.split_once('.').map_or(name, |(layer, _)| layer).to_owned(),
    };
    let mut layers: Vec<(String, std::ops::Range<usize>)> = Vec::new();
    for (index, name) in channels.names.iter().enumerate() {
        match layers.last_mut() {
            Some((last, range)) if *last == layer(name) => range.end = index + 1,
            _ => layers.push((layer(name), index..index + 1)),
        }
    }
    let pixels = || channels.data.chunks_exact(channels.names.len());
    let of_layer = |(name, range): (String, std::ops::Range<usize>)| {
        let data = pixels().flat_map(|pixel| pixel[range.clone()].iter().copied()).collect();
        (name, Channels { names: channels.names[range].to_vec(), data })
    };
    layers.into_iter().map(of_layer).collect()
}

/// Where the camera stood, as columns of 4 × 4 matrices.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct CameraMatrices {
    camera_from_world: Option<[f32; 16]>,
    ndc_from_world: Option<[f32; 16]>,
}

/// Notes of parts that hold them.
const MATRIX_NOTES: [&str; 2] = ["camera_from_world", "ndc_from_world"];

impl CameraMatrices {
    /// Those of a camera.
    pub(super) fn of(camera: &Camera) -> Self {
        CameraMatrices {
            camera_from_world: Some(camera.camera_from_world().to_cols_array()),
            ndc_from_world: camera.ndc_from_world().map(|m| m.to_cols_array()),
        }
    }

    /// As notes of a part.
    pub(super) fn notes(&self) -> impl Iterator<Item = (String, String)> {
        let text = |m: [f32; 16]| m.map(|v| v.to_string()).join(",");
        let matrices = MATRIX_NOTES.into_iter().zip([self.camera_from_world, self.ndc_from_world]);
        matrices.filter_map(move |(key, m)| Some((key.to_owned(), text(m?))))
    }

    /// From the notes of a part.
    pub(super) fn from_notes<'a>(note: impl Fn(&str) -> Option<&'a str>) -> Self {
        let matrix = |key| {
            let values: Vec<f32> = note(key)?.split(',').map_while(|v| v.parse().ok()).collect();
            <[f32; 16]>::try_from(values).ok()
        };
        let [camera_from_world, ndc_from_world] = MATRIX_NOTES.map(matrix);
        CameraMatrices { camera_from_world, ndc_from_world }
    }
}

/// Adds the attributes that other programs know.
fn with_standard_attributes(part: Part, camera: &CameraMatrices, seconds: f64) -> Part {
    // OpenEXR has row vectors: the columns of a matrix for column vectors, one after the other
    let part = part
        .with_value("software", MetaValue::Text(format!("Lumiris {}", env!("CARGO_PKG_VERSION"))))
        .with_value("renderTime", MetaValue::Number(seconds as f32));
    let matrices = [("worldToCamera", camera.camera_from_world), ("worldToNDC", camera.ndc_from_world)];
    matrices.into_iter().fold(part, |part, (name, matrix)| match matrix {
        Some(matrix) => part.with_value(name, MetaValue::Matrix(matrix)),
        None => part,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channels(names: &[&str], data: &[f32]) -> Channels {
        Channels { names: names.iter().map(|&n| n.to_owned()).collect(), data: data.to_vec() }
    }

    #[test]
    fn layers_are_split_by_name_and_joined_by_pixel() {
        let names = ["R", "G", "B", "samples", "depth.Z", "normal.X", "normal.Y"];
        let data: Vec<f32> = (0..14).map(|i| i as f32).collect();
        let layers = split(&channels(&names, &data));
        let found: Vec<_> = layers.iter().map(|(name, c)| (name.as_str(), c.names.len(), c.data.clone())).collect();
        let expected = [
            ("beauty", 3, vec![0.0, 1.0, 2.0, 7.0, 8.0, 9.0]),
            ("samples", 1, vec![3.0, 10.0]),
            ("depth", 1, vec![4.0, 11.0]),
            ("normal", 2, vec![5.0, 6.0, 12.0, 13.0]),
        ];
        assert_eq!(found, expected);
        let again = joined(layers.iter().map(|(_, channels)| channels));
        assert_eq!((again.names, again.data), (names.map(str::to_owned).to_vec(), data));
    }
}

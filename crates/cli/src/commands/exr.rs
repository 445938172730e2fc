//! EXR files: parts, channels, storage and standard attributes.

use super::UsageError;
use super::named::named;
use clap::Args;
use clap::builder::PossibleValuesParser;
use lumiris::film::Film;
use lumiris::imaging::TextEntries;
use lumiris::imaging::oiio::{MetaValue, Part, Storage, write_rows};
use lumiris::render::cryptomatte::Cryptomatte;
use lumiris::render::parts::CameraMatrices;
use std::borrow::Cow;
use std::cell::RefCell;
use std::ops::Range;
use std::path::Path;
use strum::{EnumString, VariantNames};

/// Compressions; true if lossless for 32-bit floats.
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
/// Channels for which 16 bits are enough. Other channels need exact numbers, or have values too small for 16 bits.
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
/// Largest finite 16-bit float.
const MAX_HALF: f32 = 65_504.0;

/// Storage of colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, VariantNames)]
#[strum(serialize_all = "kebab-case")]
enum ExrType {
    Half,
    Float,
}

/// Arrangement of layers.
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
    /// Storage of the image, denoised or not, of albedo and of normal; all other channels are always `float`
    #[arg(long, value_name = "TYPE", default_value = "float", value_parser = named::<ExrType>())]
    exr_type: ExrType,
    /// Compression. Cryptomatte layers need a lossless one: they get `zip` instead of pxr24, b44, b44a, dwaa or dwab
    #[arg(
        long, value_name = "NAME", default_value = "zip",
        value_parser = PossibleValuesParser::new(COMPRESSIONS.map(|(name, _)| name))
    )]
    exr_compression: String,
    /// One part with all layers, or one part per layer
    #[arg(long, value_name = "PARTS", default_value = "single", value_parser = named::<ExrParts>())]
    exr_parts: ExrParts,
    /// Cryptomatte layers of objects and materials: ids and coverage, for compositing programs
    #[arg(
        long, value_name = "LIST", value_delimiter = ',', num_args = 0..=1, require_equals = true,
        default_missing_value = "object,material", value_parser = named::<Cryptomatte>()
    )]
    pub cryptomatte: Vec<Cryptomatte>,
}

/// Channels that belong together, computed row by row.
pub(super) struct ExrLayer<'a> {
    /// Name of its part in files with a part per layer.
    pub name: String,
    pub channels: Vec<String>,
    /// Returns the values of a range of rows, interleaved. Row 0 is the first.
    pub rows: Box<dyn Fn(Range<usize>) -> Vec<f32> + 'a>,
    /// Metadata of the layer.
    pub metadata: TextEntries,
    /// True if the values are ids, which need lossless compression.
    pub is_exact: bool,
}

/// An image with its layers.
pub(super) struct ExrImage<'a> {
    pub film: &'a Film,
    pub camera: &'a CameraMatrices,
    /// Wall-clock time of the rendering (s).
    pub seconds: f64,
    pub layers: Vec<ExrLayer<'a>>,
    pub metadata: TextEntries,
}

impl ExrArgs {
    fn is_lossless(&self) -> bool {
        COMPRESSIONS.iter().any(|(name, lossless)| *name == self.exr_compression && *lossless)
    }

    /// Refuses impossible combinations before time is spent on rendering.
    pub(super) fn check(&self) -> anyhow::Result<()> {
        if !self.cryptomatte.is_empty() && !self.is_lossless() && self.exr_parts == ExrParts::Single {
            let text = "--cryptomatte: the ids would not survive the compression; --exr-parts multi keeps them apart";
            return Err(UsageError(text.to_owned()).into());
        }
        Ok(())
    }

    /// True if each layer is a separate part.
    pub(super) fn is_multi(&self) -> bool {
        self.exr_parts == ExrParts::Multi
    }

    /// Writes a file. Returns a warning if pixels are too bright for 16 bits.
    pub(super) fn write(&self, path: &Path, image: &ExrImage<'_>) -> anyhow::Result<Option<String>> {
        // Assign layers to parts
        let parts: Vec<&[ExrLayer<'_>]> = match self.exr_parts {
            ExrParts::Single => vec![&image.layers],
            ExrParts::Multi => image.layers.chunks(1).collect(),
        };

        // Write, and count pixels beyond the range of 16 bits
        let mut bright = vec![0; parts.len()];
        let counts = RefCell::new(&mut bright);
        let is_color = |name: &String| COLORS.contains(&name.as_str());
        let colors: Vec<Vec<bool>> =
            parts.iter().map(|layers| channels(layers).iter().map(is_color).collect()).collect();
        let values = |part: usize, rows: Range<usize>| {
            let data = joined(parts[part], rows);
            if self.exr_type == ExrType::Half {
                let is_bright = |(v, color): (&f32, &bool)| *color && v.abs() > MAX_HALF;
                let pixels = data.chunks_exact(colors[part].len().max(1));
                let count = pixels.filter(|pixel| pixel.iter().zip(&colors[part]).any(is_bright)).count();
                counts.borrow_mut()[part] += count;
            }
            Cow::Owned(data)
        };
        write_rows(path, &self.parts(image, &parts), &values)?;
        let count = bright.into_iter().max().unwrap_or(0);
        Ok((count > 0).then(|| {
            format!(
                "warning: {count} pixels are brighter than 65504, the maximum of half floats, and become infinite; \
                 --exr-type float keeps them"
            )
        }))
    }

    /// The parts of a file without their values.
    fn parts(&self, image: &ExrImage<'_>, parts: &[&[ExrLayer<'_>]]) -> Vec<Part> {
        let film = image.film;
        let [width, height] = [film.bounds.width() as usize, film.bounds.height() as usize];
        let is_multi = self.is_multi();
        let new_part = |layers: &&[ExrLayer<'_>]| {
            let is_exact = is_multi && layers.iter().any(|layer| layer.is_exact);
            let compression = if is_exact && !self.is_lossless() { "zip" } else { &self.exr_compression };
            let part = Part::linear(width, height, channels(layers), Vec::new()).compressed_by(compression);
            let part = part
                .with_window([film.bounds.x0 as usize, film.bounds.y0 as usize], film.resolution.map(|n| n as usize));
            let part =
                if self.exr_type == ExrType::Half { part.channels_stored_as(&COLORS, Storage::Half) } else { part };
            match layers {
                [layer] if is_multi => part.named(&layer.name).with_metadata(layer.metadata.clone()),
                _ => part,
            }
        };
        let mut parts: Vec<Part> = parts.iter().map(new_part).collect();
        // Readers of multi-part files look for common metadata in the first part
        let of_layers = image.layers.iter().flat_map(|layer| layer.metadata.clone()).collect();
        let first = parts.remove(0).with_metadata(image.metadata.clone()).with_metadata(of_layers);
        parts.insert(0, with_standard_attributes(first, image.camera, image.seconds));
        parts
    }
}

/// Names of the channels of layers.
fn channels(layers: &[ExrLayer<'_>]) -> Vec<String> {
    layers.iter().flat_map(|layer| layer.channels.iter().cloned()).collect()
}

/// Some rows of all layers, interleaved by pixel.
fn joined(layers: &[ExrLayer<'_>], rows: Range<usize>) -> Vec<f32> {
    if let [layer] = layers {
        return (layer.rows)(rows);
    }
    let values: Vec<Vec<f32>> = layers.iter().map(|layer| (layer.rows)(rows.clone())).collect();
    let mut data = Vec::with_capacity(values.iter().map(Vec::len).sum());
    let mut pixels: Vec<_> =
        values.iter().zip(layers).map(|(values, layer)| values.chunks_exact(layer.channels.len())).collect();
    while data.len() < data.capacity() {
        let before = data.len();
        pixels.iter_mut().filter_map(Iterator::next).for_each(|values| data.extend_from_slice(values));
        if data.len() == before {
            break;
        }
    }
    data
}

/// Adds standard EXR attributes, which other programs read.
fn with_standard_attributes(part: Part, camera: &CameraMatrices, seconds: f64) -> Part {
    // OpenEXR uses row vectors, so the columns of a matrix for column vectors are stored one after the other
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

    #[test]
    fn layers_are_joined_by_pixel() {
        let layer = |name: &str, channels: &[&str], first: f32| ExrLayer {
            name: name.to_owned(),
            channels: channels.iter().map(|&n| n.to_owned()).collect(),
            rows: Box::new({
                let stride = channels.len();
                move |rows| (rows.start * stride..rows.end * stride).map(|i| first + i as f32).collect()
            }),
            metadata: Vec::new(),
            is_exact: false,
        };
        // Rows of one pixel
        let layers = [layer("beauty", &["R", "G", "B"], 0.0), layer("samples", &["samples"], 50.0)];
        assert_eq!(joined(&layers, 1..3), [3.0, 4.0, 5.0, 51.0, 6.0, 7.0, 8.0, 52.0]);
        assert_eq!(joined(&layers[1..], 0..2), [50.0, 51.0]);
        assert_eq!(channels(&layers), ["R", "G", "B", "samples"]);
    }
}

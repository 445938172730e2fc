//! Image files as scenes ask for them, and how they are read.

use crate::imaging::color_layers::ColorLayer;
use crate::imaging::oiio::{ImageError, ImageFile, Values};
use crate::imaging::tiles::TileStore;
use crate::imaging::{ColorChannels, ColorEncoding, Filter, Lookup, MipMap, Wrap};
use crate::import::memory::FileSize;
use crate::textures::Udim;
use lumiris_formats::color_space::{Chromaticities, Colored, is_rec709, rec709_from};
use lumiris_formats::names::nfc;
use lumiris_numbers::math::{Mat3, Rgb, Vec3};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A linear image.
#[derive(Clone, Debug)]
pub struct RgbImage {
    /// Rows from the top.
    pub texels: Vec<Rgb>,
    /// Width and height.
    pub size: [usize; 2],
}

/// How the numbers of an image mean light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ImageEncoding {
    /// sRGB for integers, linear for floats.
    Auto,
    /// sRGB curve.
    Srgb,
    /// As they are.
    Linear,
    /// A power.
    Gamma(f32),
}

/// Which channels of an image are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageChannels {
    /// Colour or grey.
    Color,
    /// Opacity; 1 where there is none.
    Alpha,
    /// What a texture of numbers reads: opacity where not all is opaque, and colour or grey otherwise.
    Number,
}

/// An image as textures ask for it.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageRequest {
    /// File.
    pub path: PathBuf,
    /// The part of it.
    pub channels: ImageChannels,
    /// Meaning of its numbers.
    pub encoding: ImageEncoding,
    /// Outside of 0..1.
    pub wrap: Wrap,
    /// Between texels.
    pub filter: Filter,
}

/// Most columns and rows of the level of a file by which its opacity is judged.
const SMALL: usize = 128;

impl ImageRequest {
    /// The same with channels that are known, by those of the image, and by whether channel `a` is 1 everywhere.
    fn resolved(&self, layer: &ColorLayer, is_opaque: impl Fn(usize) -> bool) -> ImageRequest {
        // The opacity of Targa files is no number of theirs in pbrt-v4
        let is_targa = self.path.extension().is_some_and(|e| e.eq_ignore_ascii_case("tga"));
        let alpha = layer.alpha.filter(|_| !is_targa);
        let channels = match (self.channels, alpha) {
            (ImageChannels::Number, Some(a)) if !is_opaque(a) => ImageChannels::Alpha,
            (ImageChannels::Number, _) => ImageChannels::Color,
            (channels, _) => channels,
        };
        ImageRequest { channels, ..self.clone() }
    }
}

/// From the colour space that a file tells to Rec.709, if they differ and `channels` are colours.
fn rec709_of(chromaticities: Option<&str>, channels: ImageChannels, of: Colored) -> Option<Mat3> {
    let numbers = chromaticities?.split([',', ' ']).filter_map(|number| number.parse::<f64>().ok());
    let numbers: [f64; 8] = numbers.collect::<Vec<_>>().try_into().ok()?;
    let xy = |i: usize| [numbers[2 * i], numbers[2 * i + 1]];
    let space: Chromaticities = std::array::from_fn(xy);
    let is_other = channels == ImageChannels::Color && !is_rec709(&space);
    is_other.then(|| rec709_from(&space, of)).flatten()
}

/// What stands for the number of a tile in the name of an image file.
pub const UDIM: &str = "<UDIM>";

/// A tile of an image.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Tile {
    /// Its number, from 1001.
    pub number: u32,
    /// Its file.
    pub path: PathBuf,
}

/// The tiles of a path whose file name has [`UDIM`], in the order of their numbers; those that are there.
pub fn tiles(path: &Path) -> Vec<Tile> {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let Some((before, after)) = name.split_once(UDIM) else { return Vec::new() };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let [before, after] = [before, after].map(nfc);
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let number = |name: &str| {
        let digits = name.strip_prefix(&*before)?.strip_suffix(&*after)?;
        let is_number = digits.len() == 4 && digits.bytes().all(|b| b.is_ascii_digit());
        digits.parse().ok().filter(|&number| is_number && Udim::is_number(number))
    };
    let tile = |entry: std::fs::DirEntry| {
        Some(Tile { number: number(&nfc(entry.file_name().to_str()?))?, path: entry.path() })
    };
    let mut tiles: Vec<Tile> = entries.filter_map(tile).collect();
    tiles.sort();
    tiles
}

/// Reads an image as textures ask for it. A file that holds all levels of a pyramid, as `.tx` files do, gives them.
pub fn load_map(request: &ImageRequest) -> Result<MipMap, ImageError> {
    let file = ImageFile::open(&request.path)?;
    if gives_levels(&file, request) { map_of_levels(file, request, None) } else { image_map(&file, request) }
}

/// True if a file holds all levels, in a colour space whose numbers can be taken as they are.
pub(super) fn gives_levels(file: &ImageFile, request: &ImageRequest) -> bool {
    file.has_levels() && rec709_of(file.chromaticities(), request.channels, Colored::Factor).is_none()
}

/// The same with levels of more than a tile in `store`: read from the file when they are wanted, if it holds them.
pub fn load_tiled_map(request: &ImageRequest, store: &Arc<TileStore>) -> Result<MipMap, ImageError> {
    let file = ImageFile::open(&request.path)?;
    if gives_levels(&file, request) {
        return map_of_levels(file, request, Some(store));
    }
    into_tiles(image_map(&file, request)?, request, store)
}

/// Moves a pyramid into the temporary file of `store`.
pub(super) fn into_tiles(map: MipMap, request: &ImageRequest, store: &Arc<TileStore>) -> Result<MipMap, ImageError> {
    map.tiled(store).map_err(|error| {
        let reason = format!("does not fit into the temporary file for tiles of textures: {error}");
        ImageError::Unreadable { path: request.path.clone(), reason }
    })
}

/// Bytes of the pyramid of an image; none if it is unreadable, which reading it reports.
pub fn map_size(request: &ImageRequest) -> FileSize {
    let Ok(file) = ImageFile::open(&request.path) else { return FileSize::default() };
    let (colors, alpha) = (file.layer().channels.as_slice().len(), file.layer().alpha.as_slice().len());
    let bytes = |channels: usize| file.pixels().saturating_mul(channels as u64 * if file.is_bytes() { 1 } else { 4 });
    // Coarser levels add a third. A texture of numbers has colours and opacity while it is read
    let [kept, read] = match request.channels {
        ImageChannels::Color => [colors, 0],
        ImageChannels::Alpha => [alpha, 0],
        ImageChannels::Number => [colors, alpha * (colors + alpha)],
    };
    let kept = bytes(kept);
    FileSize { kept: kept.saturating_add(kept / 3), loading: bytes(read).saturating_add(file.decoding_bytes()) }
}

/// Bytes of an image that lights the scene: its radiance and its distribution; and its values as read.
pub fn light_image_size(path: &Path) -> FileSize {
    const TEXEL: u64 = 16;
    const READ: u64 = 12;
    ImageFile::open(path).map_or_else(
        |_| FileSize::default(),
        |file| FileSize {
            kept: file.pixels().saturating_mul(TEXEL),
            loading: file.pixels().saturating_mul(READ).saturating_add(file.decoding_bytes()),
        },
    )
}

/// The pyramids of all that textures may ask for, with default lookups: of the colours, and of the opacity if there is
/// one. `Err` if the file has them.
pub fn all_maps(path: &Path, encoding: ImageEncoding) -> Result<Vec<MipMap>, ImageError> {
    let file = ImageFile::open(path)?;
    if file.has_levels() {
        let reason = "has all levels already".to_owned();
        return Err(ImageError::Unreadable { path: path.to_owned(), reason });
    }
    let (wrap, filter) = (Wrap::default(), Filter::default());
    let request = |channels| ImageRequest { path: path.to_owned(), channels, encoding, wrap, filter };
    let alpha = file.layer().alpha.map(|_| ImageChannels::Alpha);
    let wanted = [ImageChannels::Color].into_iter().chain(alpha);
    wanted.map(|channels| image_map(&file, &request(channels))).collect()
}

/// The pyramid of an image, computed.
pub(super) fn image_map(file: &ImageFile, request: &ImageRequest) -> Result<MipMap, ImageError> {
    // A texture of numbers reads colours and opacity, since either may be used
    let layer = file.layer();
    let (colors, alpha) = (layer.channels.as_slice(), layer.alpha.as_slice());
    let read = match request.channels {
        ImageChannels::Color => colors.to_vec(),
        ImageChannels::Alpha => alpha.to_vec(),
        ImageChannels::Number => [colors, alpha].concat(),
    };
    if read.is_empty() {
        return Ok(without_channels(request));
    }
    let mut values = file.level(0, &read)?;

    // Colours of another space
    let chromaticities = file.chromaticities().filter(|_| file.encoding() == ColorEncoding::Linear);
    let matrix = rec709_of(chromaticities, request.channels, Colored::Factor);
    if let (Some(matrix), Values::Floats(values), ColorChannels::Rgb(_)) = (matrix, &mut values, layer.channels) {
        for pixel in values.as_chunks_mut::<3>().0 {
            *pixel = (matrix * Vec3::from_array(*pixel)).to_array();
        }
    }

    // The channels in use
    let position = |channel: usize| read.iter().position(|&c| c == channel).unwrap_or(0);
    let resolved = request.resolved(layer, |a| values.is_one(position(a), read.len()));
    let Meaning { channels, encoding } = meaning(&resolved, layer, file.encoding());
    let kept: Vec<usize> = channels.into_iter().flatten().map(position).collect();
    let lookup = Lookup { wrap: request.wrap, filter: request.filter, encoding };
    Ok(MipMap::of_values(values.of_channels(&kept, read.len()), file.sizes()[0], kept.len(), lookup))
}

/// The pyramid that a file holds.
pub(super) fn map_of_levels(
    file: ImageFile,
    request: &ImageRequest,
    store: Option<&Arc<TileStore>>,
) -> Result<MipMap, ImageError> {
    // A level of few texels tells whether all are opaque
    let small = file.sizes().iter().position(|size| size[0].max(size[1]) <= SMALL).unwrap_or(0);
    let is_opaque = |a| file.level(small, &[a]).is_ok_and(|level| level.is_one(0, 1));
    let request = &request.resolved(file.layer(), is_opaque);
    let Meaning { channels, encoding } = meaning(request, file.layer(), file.encoding());
    let lookup = Lookup { wrap: request.wrap, filter: request.filter, encoding };
    channels.map_or_else(|| Ok(without_channels(request)), |channels| MipMap::of_file(file, channels, lookup, store))
}

/// The requested channels of an image.
struct Meaning {
    /// Their positions, if the image has them.
    channels: Option<Vec<usize>>,
    encoding: ColorEncoding,
}

/// The requested channels. `usual` is the usual encoding of the file.
fn meaning(request: &ImageRequest, layer: &ColorLayer, usual: ColorEncoding) -> Meaning {
    let channels = match request.channels {
        // Opacity is stored linear
        ImageChannels::Alpha => {
            return Meaning { channels: layer.alpha.map(|a| vec![a]), encoding: ColorEncoding::Linear };
        }
        ImageChannels::Color | ImageChannels::Number => Some(layer.channels.as_slice().to_vec()),
    };
    let encoding = match request.encoding {
        // Floats are light already, whatever the scene says: pbrt-v4 decodes integers only.
        _ if usual == ColorEncoding::Linear => ColorEncoding::Linear,
        ImageEncoding::Auto => usual,
        ImageEncoding::Srgb => ColorEncoding::Srgb,
        ImageEncoding::Linear => ColorEncoding::Linear,
        ImageEncoding::Gamma(gamma) => ColorEncoding::Gamma(gamma),
    };
    Meaning { channels, encoding }
}

/// What stands for channels that are not there: opaque, and black.
fn without_channels(request: &ImageRequest) -> MipMap {
    let value = if request.channels == ImageChannels::Alpha { 1.0 } else { 0.0 };
    MipMap::constant(value, request.wrap, request.filter)
}

/// Reads an image as linear RGB, rows from the top, with its size.
pub fn load_rgb(path: &Path) -> Result<RgbImage, ImageError> {
    let file = ImageFile::open(path)?;
    let channels = file.layer().channels;
    let values = file.floats(channels.as_slice())?;
    let matrix = rec709_of(file.chromaticities(), ImageChannels::Color, Colored::Light).unwrap_or(Mat3::IDENTITY);
    let color = |p: [f32; 3]| matrix * Vec3::from_array(p.map(|v| file.encoding().to_linear(v)));
    let color = |p| Rgb::from_array(color(p).to_array());
    let texels = match channels {
        ColorChannels::Rgb(_) => values.as_chunks().0.iter().map(|p| color(*p)).collect(),
        ColorChannels::Grey(_) => values.iter().map(|&y| color([y; 3])).collect(),
    };
    Ok(RgbImage { texels, size: file.sizes()[0] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::imaging::oiio::{Part, write_image};
    use std::fmt::Write;

    /// An image of two pixels, as 8-bit or 16-bit integers or floats, that no code of this program wrote.
    struct Sample {
        name: &'static str,
        bytes: Vec<u8>,
        /// The values that are stored.
        stored: [[f32; 3]; 2],
        is_integer: bool,
        tolerance: f32,
    }

    const BYTES: [[u8; 3]; 2] = [[0, 51, 188], [128, 10, 255]];
    const WORDS: [[u16; 3]; 2] = [[0, 13107, 48000], [32768, 2570, 65535]];
    /// Multiples of 1/16, which halves and shared exponents hold.
    const FLOATS: [[f32; 3]; 2] = [[0.0, 0.1875, 0.75], [0.5, 0.0625, 2.5]];

    fn of_bytes(name: &'static str, bytes: Vec<u8>) -> Sample {
        Sample { name, bytes, stored: BYTES.map(|p| p.map(|v| f32::from(v) / 255.0)), is_integer: true, tolerance: 0.0 }
    }

    fn of_words(name: &'static str, bytes: Vec<u8>) -> Sample {
        Sample {
            name,
            bytes,
            stored: WORDS.map(|p| p.map(|v| f32::from(v) / 65535.0)),
            is_integer: true,
            tolerance: 0.0,
        }
    }

    fn of_floats(name: &'static str, bytes: Vec<u8>) -> Sample {
        Sample { name, bytes, stored: FLOATS, is_integer: false, tolerance: 0.0 }
    }

    /// Targa of 24 bits or, with `alpha`, of 32.
    fn tga(alpha: Option<u8>) -> Vec<u8> {
        let (bits, of_alpha) = if alpha.is_some() { (32, 8) } else { (24, 0) };
        // Rows from the top
        let mut file = vec![0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 1, 0, bits, 0x20 | of_alpha];
        for [r, g, b] in BYTES {
            file.extend([b, g, r].into_iter().chain(alpha));
        }
        file
    }

    /// PNG of RGB, in a block that is not compressed.
    fn png(bits: u8, pixels: &[u8]) -> Vec<u8> {
        let crc = |bytes: &[u8]| {
            let shift = |c: u32, _| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 };
            !bytes.iter().fold(!0_u32, |c, &byte| (0..8).fold(c ^ u32::from(byte), shift))
        };

        // zlib stream with one stored block
        let rows = [&[0], pixels].concat();
        let adler = rows.iter().fold((1_u32, 0_u32), |(a, b), &v| (a + u32::from(v), b + a + u32::from(v)));
        let len = rows.len() as u16;
        let mut data = vec![0x78, 0x01, 1];
        data.extend([len, !len].iter().flat_map(|v| v.to_le_bytes()));
        data.extend(rows);
        data.extend((((adler.1 % 65521) << 16) | (adler.0 % 65521)).to_be_bytes());

        // Chunks
        let header = [&[0, 0, 0, 2, 0, 0, 0, 1, bits][..], &[2, 0, 0, 0]].concat();
        let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
        for (name, content) in [(b"IHDR", &header), (b"IDAT", &data), (b"IEND", &Vec::new())] {
            let chunk = [&name[..], content].concat();
            file.extend((content.len() as u32).to_be_bytes());
            file.extend(&chunk);
            file.extend(crc(&chunk).to_be_bytes());
        }
        file
    }

    /// Little-endian TIFF of one strip without compression: bits per sample, and 1 for integers or 3 for floats.
    fn tiff(bits: u16, kind: u16, pixels: &[u8]) -> Vec<u8> {
        const ENTRIES: u16 = 11;
        let end_of_directory = 8 + 2 + 12 * u32::from(ENTRIES) + 4;
        let (triples, data) = (end_of_directory, end_of_directory + 12);
        let mut file = b"II\x2a\0\x08\0\0\0".to_vec();
        file.extend(ENTRIES.to_le_bytes());
        let mut entry = |tag: u16, kind: u16, count: u32, value: u32| {
            file.extend([tag, kind].iter().flat_map(|v| v.to_le_bytes()));
            file.extend([count, value].iter().flat_map(|v| v.to_le_bytes()));
        };
        let (short, long) = (3, 4);
        entry(256, short, 1, 2); // width
        entry(257, short, 1, 1); // height
        entry(258, short, 3, triples); // bits per sample
        entry(259, short, 1, 1); // no compression
        entry(262, short, 1, 2); // RGB
        entry(273, long, 1, data);
        entry(277, short, 1, 3); // samples per pixel
        entry(278, short, 1, 1); // rows per strip
        entry(279, long, 1, pixels.len() as u32);
        entry(284, short, 1, 1); // interleaved
        entry(339, short, 3, triples + 6); // sample format
        file.extend([0; 4]);
        file.extend([bits, bits, bits, kind, kind, kind].iter().flat_map(|v| v.to_le_bytes()));
        file.extend(pixels);
        file
    }

    /// OpenEXR of one scan line without compression, of halves or floats.
    fn exr(is_half: bool, chromaticities: Option<[f32; 8]>) -> Vec<u8> {
        let mut file = [0x0131_2f76_u32, 2].iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        let mut attribute = |name: &str, kind: &str, value: &[u8]| {
            file.extend(format!("{name}\0{kind}\0").bytes());
            file.extend((value.len() as u32).to_le_bytes());
            file.extend(value);
        };
        let channel = |name: &str| {
            let numbers = [if is_half { 1_u32 } else { 2 }, 0, 1, 1];
            [format!("{name}\0").into_bytes(), numbers.iter().flat_map(|v| v.to_le_bytes()).collect()].concat()
        };
        let channels: Vec<u8> = ["B", "G", "R"].into_iter().flat_map(channel).chain([0]).collect();
        let window: Vec<u8> = [0_u32, 0, 1, 0].iter().flat_map(|v| v.to_le_bytes()).collect();
        attribute("channels", "chlist", &channels);
        attribute("compression", "compression", &[0]);
        attribute("dataWindow", "box2i", &window);
        attribute("displayWindow", "box2i", &window);
        attribute("lineOrder", "lineOrder", &[0]);
        attribute("pixelAspectRatio", "float", &1.0_f32.to_le_bytes());
        attribute("screenWindowCenter", "v2f", &[0; 8]);
        attribute("screenWindowWidth", "float", &1.0_f32.to_le_bytes());
        if let Some(xy) = chromaticities {
            attribute("chromaticities", "chromaticities", xy.map(f32::to_le_bytes).as_flattened());
        }
        file.push(0);
        // Halves of normal numbers: the exponent's bias is 15 instead of 127
        let half = |v: f32| if v == 0.0 { 0 } else { ((v.to_bits() >> 13) - ((127 - 15) << 10)) as u16 };
        let line = [2, 1, 0].into_iter().flat_map(|c| FLOATS.map(|p| p[c]));
        let line: Vec<u8> = if is_half {
            line.flat_map(|v| half(v).to_le_bytes()).collect()
        } else {
            line.flat_map(f32::to_le_bytes).collect()
        };
        file.extend((file.len() as u64 + 8).to_le_bytes());
        file.extend([0_u32, line.len() as u32].iter().flat_map(|v| v.to_le_bytes()));
        file.extend(line);
        file
    }

    /// Radiance's picture of shared exponents, without runs.
    fn hdr() -> Vec<u8> {
        let mut file = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n".to_vec();
        for pixel in FLOATS {
            let exponent = pixel.into_iter().fold(0.0, f32::max).log2().floor() as i32 + 1;
            file.extend(pixel.map(|v| (v * 2.0_f32.powi(8 - exponent)) as u8));
            file.push((exponent + 128) as u8);
        }
        file
    }

    fn samples() -> Vec<Sample> {
        let bytes = BYTES.concat();
        let words = |of: fn(u16) -> [u8; 2]| WORDS.concat().into_iter().flat_map(of).collect::<Vec<u8>>();
        let floats: Vec<u8> = FLOATS.concat().into_iter().flat_map(f32::to_le_bytes).collect();
        let with_header = |header: &str, pixels: &[u8]| [header.as_bytes(), pixels].concat();
        vec![
            of_bytes("a.tga", tga(None)),
            of_bytes("b.tga", tga(Some(100))),
            of_bytes("a.png", png(8, &bytes)),
            of_bytes("a.ppm", with_header("P6 2 1 255\n", &bytes)),
            of_bytes("a.tif", tiff(8, 1, &bytes)),
            of_words("b.png", png(16, &words(u16::to_be_bytes))),
            // OpenImageIO is one level off
            Sample { tolerance: 4e-5, ..of_words("b.ppm", with_header("P6 2 1 65535\n", &words(u16::to_be_bytes))) },
            of_words("b.tif", tiff(16, 1, &words(u16::to_le_bytes))),
            of_floats("c.tif", tiff(32, 3, &floats)),
            of_floats("a.exr", exr(true, None)),
            of_floats("b.exr", exr(false, None)),
            of_floats("a.pfm", with_header("PF\n2 1\n-1.0\n", &floats)),
            of_floats("a.hdr", hdr()),
        ]
    }

    #[test]
    fn texels_are_linear_whatever_the_format_and_the_encoding() {
        let folder = tempfile::tempdir().unwrap();
        let srgb = |v: f32| if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
        let decoded = |encoding: ImageEncoding, v: f32| match encoding {
            ImageEncoding::Auto | ImageEncoding::Srgb => srgb(v),
            ImageEncoding::Linear => v,
            ImageEncoding::Gamma(gamma) => v.powf(gamma),
        };
        let encodings = [ImageEncoding::Auto, ImageEncoding::Srgb, ImageEncoding::Linear, ImageEncoding::Gamma(1.8)];
        let store = Arc::new(TileStore::new(1 << 20).unwrap());
        let mut wrong = String::new();
        for sample in samples() {
            let path = folder.path().join(sample.name);
            std::fs::write(&path, &sample.bytes).unwrap();
            for encoding in encodings {
                let request = ImageRequest {
                    path: path.clone(),
                    channels: ImageChannels::Color,
                    encoding,
                    wrap: Wrap::Clamp,
                    filter: Filter::Point,
                };
                let map = load_map(&request).unwrap_or_else(|error| panic!("{error}"));
                let tiled = load_map(&request).unwrap().tiled(&store).unwrap();
                for (x, stored) in sample.stored.iter().enumerate() {
                    // What is stored as a float is light already
                    let expected = stored.map(|v| if sample.is_integer { decoded(encoding, v) } else { v });
                    let found = map.texel(0, x as i64, 0).to_array();
                    assert_eq!(found, tiled.texel(0, x as i64, 0).to_array());
                    if found.iter().zip(expected).any(|(a, b)| (a - b).abs() > 1e-6 + 2e-6 * b + sample.tolerance) {
                        writeln!(wrong, "{} {encoding:?} pixel {x}: {found:?} for {expected:?}", sample.name).unwrap();
                    }
                }
            }
        }
        assert!(wrong.is_empty(), "{wrong}");
    }

    fn request(path: &Path, channels: ImageChannels) -> ImageRequest {
        let (wrap, filter) = (Wrap::Clamp, Filter::Point);
        ImageRequest { path: path.to_owned(), channels, encoding: ImageEncoding::Auto, wrap, filter }
    }

    #[test]
    fn files_of_floats_may_have_another_colour_space() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        // Red, green, blue and white
        let rec709 = [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329];
        let rec2020 = [0.708, 0.292, 0.17, 0.797, 0.131, 0.046, 0.3127, 0.329];
        // The primaries of Rec.2020 in Rec.709 [ITU-R BT.2087]
        let matrix = [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]];
        let converted = |p: [f32; 3]| matrix.map(|row: [f32; 3]| row.iter().zip(p).map(|(a, b)| a * b).sum::<f32>());
        for (chromaticities, is_other) in [(None, false), (Some(rec709), false), (Some(rec2020), true)] {
            std::fs::write(&path, exr(false, chromaticities)).unwrap();
            let RgbImage { texels, .. } = load_rgb(&path).unwrap();
            let [colors, numbers] =
                [ImageChannels::Color, ImageChannels::Number].map(|c| load_map(&request(&path, c)).unwrap());
            for (x, stored) in FLOATS.into_iter().enumerate() {
                let expected = if is_other { converted(stored) } else { stored };
                let near = |found: Rgb, expected: [f32; 3]| {
                    assert!((found - Rgb::from_array(expected)).map(f32::abs).max_component() < 1e-3, "{found:?}");
                };
                near(texels[x], expected);
                near(colors.texel(0, x as i64, 0), expected);
                // What is no colour has no space
                near(numbers.texel(0, x as i64, 0), stored);
            }
        }
    }

    #[test]
    fn an_image_that_is_a_layer_is_found_and_of_several_the_names_are_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("layers.exr");
        let write = |names: &[&str], values: &[f32]| {
            let part = Part::linear(1, 1, names.iter().map(|&name| name.to_owned()).collect(), values.to_vec());
            write_image(&path, &[part]).unwrap();
        };
        // Beside a depth, and in the order of files
        let names = ["Depth.Z", "View.Combined.A", "View.Combined.B", "View.Combined.G", "View.Combined.R"];
        write(&names, &[9.0, 0.25, 1.0, 0.5, 0.125]);
        let texel = |channels| load_map(&request(&path, channels)).unwrap().texel(0, 0, 0).to_array();
        assert_eq!(texel(ImageChannels::Color), [0.125, 0.5, 1.0]);
        assert_eq!(texel(ImageChannels::Alpha), [0.25; 3]);
        assert_eq!(load_rgb(&path).unwrap().texels, [Rgb::new(0.125, 0.5, 1.0)]);

        write(&["left.R", "left.G", "left.B", "right.R", "right.G", "right.B"], &[1.0; 6]);
        let expected = "layers.exr: has several images, none of which is plain R G B: left, right";
        let map = load_map(&request(&path, ImageChannels::Color)).map(drop).unwrap_err().to_string();
        assert!(map.ends_with(expected), "{map}");
        assert_eq!(load_rgb(&path).unwrap_err().to_string(), map);
    }

    #[test]
    fn numbers_are_the_opacity_of_an_image_that_is_not_all_opaque() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("leaf.exr");
        let texel = |alpha: f32, channels| {
            let names = ["R", "G", "B", "A"].map(str::to_owned).to_vec();
            let part = Part::linear(2, 1, names, vec![0.2, 0.4, 0.9, alpha, 0.2, 0.4, 0.9, 1.0]);
            write_image(&path, &[part]).unwrap();
            load_map(&request(&path, channels)).unwrap().texel(0, 0, 0).to_array()
        };
        assert_eq!(texel(0.25, ImageChannels::Number), [0.25; 3]);
        assert_eq!(texel(1.0, ImageChannels::Number), texel(1.0, ImageChannels::Color));
        assert!((texel(0.25, ImageChannels::Color)[2] - 0.9).abs() < 1e-3);
    }
}

//! From the film to images: channels with names, and metadata.

use super::Rendering;
use crate::film::{Film, PixelSums};
use crate::imaging::{IMAGE_LAYER, Image};
use crate::scene::{FilmSettings, SampleCountMap};
use crate::settings::Settings;
use strum::{EnumString, IntoStaticStr, VariantNames};

/// A group of channels beside the image itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum Aov {
    /// Variance of the pixel's mean, `variance.R/G/B`.
    Variance,
    /// Number of samples, `samples`.
    Samples,
    /// Albedo estimate of the first surface, `albedo.R/G/B`.
    Albedo,
    /// Shading normal of the first surface, world space, `normal.X/Y/Z`.
    Normal,
    /// Mean distance to the first surface, `depth.Z`; infinity where there is none.
    Depth,
    /// Material of the first sample's surface plus one, `material`; 0 where there is none.
    Material,
    /// Geometry of the first sample's surface plus one, `object`; 0 where there is none.
    Object,
    /// The best M/N of `ris`: as a colour `ratio.R/G/B`, green where more proposals and red where more samples are best
    /// [Talbot et al. 2005, Fig. 3], and as numbers `ratio.proposals` and `ratio.samples`.
    Ratio,
    /// Records of the irradiance cache that were computed for the pixel, `records`.
    Records,
}

impl Aov {
    /// All that every image has, in the order of the file.
    pub const ALL: [Aov; 7] =
        [Aov::Variance, Aov::Samples, Aov::Albedo, Aov::Normal, Aov::Depth, Aov::Material, Aov::Object];

    /// True if it shows a feature of the first surfaces.
    pub fn is_feature(self) -> bool {
        match self {
            Aov::Albedo | Aov::Normal | Aov::Depth | Aov::Material | Aov::Object => true,
            Aov::Variance | Aov::Samples | Aov::Ratio | Aov::Records => false,
        }
    }

    fn channels(self) -> &'static [&'static str] {
        match self {
            Aov::Variance => &["variance.R", "variance.G", "variance.B"],
            Aov::Samples => &["samples"],
            Aov::Albedo => &["albedo.R", "albedo.G", "albedo.B"],
            Aov::Normal => &["normal.X", "normal.Y", "normal.Z"],
            Aov::Depth => &["depth.Z"],
            Aov::Material => &["material"],
            Aov::Object => &["object"],
            Aov::Ratio => &["ratio.R", "ratio.G", "ratio.B", "ratio.proposals", "ratio.samples"],
            Aov::Records => &["records"],
        }
    }
}

/// Channels of the image itself.
const COLOUR: [&str; 3] = ["R", "G", "B"];

/// Named channels, interleaved, row-major from the top left of the crop window.
#[derive(Clone, Debug)]
pub struct Channels {
    /// Names in the order of the data.
    pub names: Vec<String>,
    /// Values.
    pub data: Vec<f32>,
}

/// The image `R G B` and the chosen AOVs, linear. `sample_count_map` is the map that [`Aov::Ratio`] shows; without one
/// it is black.
pub fn channels(film: &Film, aovs: &[Aov], sample_count_map: Option<&SampleCountMap>) -> Channels {
    let aov_names = aovs.iter().flat_map(|a| a.channels().iter().copied());
    let names: Vec<String> = COLOUR.into_iter().chain(aov_names).map(str::to_owned).collect();
    let mut data = Vec::with_capacity(names.len() * film.pixels.len());
    let variances = variances(film, aovs);
    for (i, pixel) in film.pixels.iter().enumerate() {
        data.extend(pixel.mean().map(|v| v as f32));
        aovs.iter().for_each(|aov| push(*aov, (i, pixel), &variances, sample_count_map, &mut data));
    }
    Channels { names, data }
}

/// The same values, with an image of its own for each AOV; by their names, the image itself first.
pub fn layers(film: &Film, aovs: &[Aov], sample_count_map: Option<&SampleCountMap>) -> Vec<(&'static str, Image)> {
    let variances = variances(film, aovs);
    let image = |channels: &[&str], data| Image {
        width: film.bounds.width() as usize,
        height: film.bounds.height() as usize,
        channels: channels.iter().map(|&c| c.to_owned()).collect(),
        data,
    };
    let colours = image(&COLOUR, film.pixels.iter().flat_map(|p| p.mean().map(|v| v as f32)).collect());
    let of_aovs = aovs.iter().map(|&aov| {
        let mut data = Vec::with_capacity(aov.channels().len() * film.pixels.len());
        let pixels = film.pixels.iter().enumerate();
        pixels.for_each(|pixel| push(aov, pixel, &variances, sample_count_map, &mut data));
        (aov.into(), image(aov.channels(), data))
    });
    [(IMAGE_LAYER, colours)].into_iter().chain(of_aovs).collect()
}

/// The AOVs that an image has unless others are asked for.
pub fn default_aovs(has_ratio: bool, has_records: bool) -> Vec<Aov> {
    let more = has_ratio.then_some(Aov::Ratio).into_iter().chain(has_records.then_some(Aov::Records));
    Aov::ALL.into_iter().chain(more).collect()
}

/// Variances of all pixels, if an AOV is made of them.
fn variances(film: &Film, aovs: &[Aov]) -> Vec<[f64; 3]> {
    if aovs.contains(&Aov::Variance) { film.variances() } else { Vec::new() }
}

/// Appends the values of a pixel.
fn push(
    aov: Aov,
    (i, pixel): (usize, &PixelSums),
    variances: &[[f64; 3]],
    sample_count_map: Option<&SampleCountMap>,
    data: &mut Vec<f32>,
) {
    let count = pixel.count.max(1) as f64;
    match aov {
        Aov::Variance => data.extend(variances[i].map(|v| v as f32)),
        Aov::Samples => data.push(pixel.count as f32),
        Aov::Albedo => data.extend(pixel.albedo.map(|v| (v / count) as f32)),
        Aov::Normal => data.extend(pixel.normal.map(|v| (v / count) as f32)),
        Aov::Depth if pixel.hits == 0 => data.push(f32::INFINITY),
        Aov::Depth => data.push((pixel.depth / pixel.hits as f64) as f32),
        Aov::Material => data.push(pixel.material as f32),
        Aov::Object => data.push(pixel.object as f32),
        Aov::Ratio => data.extend(sample_count_map.map_or([0.0; 5], |map| ratio_values(map, i))),
        Aov::Records => data.push(pixel.records as f32),
    }
}

/// Colour and numbers of a pixel of the map: from red at the minimum ratio (1) to green at the maximum of the map,
/// logarithmically.
fn ratio_values(map: &SampleCountMap, pixel: usize) -> [f32; 5] {
    let ratio = map.ratios[pixel];
    let max = map.ratios.iter().copied().fold(1.0, f32::max).max(1.0 + f32::EPSILON);
    let green = (ratio.ln() / max.ln()).clamp(0.0, 1.0);
    let samples = (map.time / (f64::from(ratio) * map.t1 + map.t2)) as f32;
    [1.0 - green, green, 0.0, ratio * samples, samples]
}

/// Mean radiance of all pixels times `2^exposure`, linear RGB, interleaved.
pub fn exposed(film: &Film, exposure: f32) -> Vec<f32> {
    let gain = exposure.exp2();
    film.pixels.iter().flat_map(|p| p.mean().map(|v| v as f32 * gain)).collect()
}

/// How far a rendering came, as metadata entries.
pub fn progress_metadata(rendering: &Rendering) -> Vec<(String, String)> {
    let done = || rendering.film.pixels.iter().map(|p| p.count);
    let (min, max) = (done().min().unwrap_or(0), done().max().unwrap_or(0));
    let entries = [
        ("complete", rendering.complete.to_string()),
        ("samples_done", format!("{min} to {max} per pixel")),
        ("seconds", format!("{:.3}", rendering.elapsed.as_secs_f64())),
    ];
    entries.map(|(key, value)| (format!("lumiris:{key}"), value)).to_vec()
}

/// Everything that an image depends on, as metadata entries `lumiris:…`: its settings and the film.
pub fn metadata(film: &FilmSettings, settings: &Settings) -> Vec<(String, String)> {
    let b = &film.bounds;
    let film = [
        ("filter", format!("{:?}", film.filter)),
        ("resolution", format!("{}x{}", film.resolution[0], film.resolution[1])),
        ("crop", format!("{},{},{},{}", b.x0, b.x1, b.y0, b.y1)),
    ];
    let version = [("version", env!("CARGO_PKG_VERSION").to_owned())].into_iter();
    let recorded = settings.recorded().map(|(key, value)| (key, value.to_string()));
    let biases = settings.biases().into_iter().map(|bias| ("biased", bias.to_owned()));
    let entries = version.chain(film).chain(recorded).chain(biases);
    entries.map(|(key, value)| (format!("lumiris:{key}"), value)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{PixelBounds, PixelSums};

    #[test]
    fn channel_count_matches_names_for_every_aov() {
        let bounds = PixelBounds { x0: 0, x1: 2, y0: 0, y1: 1 };
        let mut film = Film::new([2, 1], bounds);
        film.pixels[0] = PixelSums { count: 1, radiance: [1.0, 2.0, 4.0], ..PixelSums::default() };
        let c = channels(&film, &Aov::ALL, None);
        assert_eq!(c.data.len(), c.names.len() * 2);
        let depth = c.names.iter().position(|n| n == "depth.Z").unwrap();
        assert_eq!(c.data[depth], f32::INFINITY);
        assert_eq!(&c.data[..3], &[1.0, 2.0, 4.0]);
    }

    #[test]
    fn layers_have_the_values_of_the_channels() {
        let mut film = Film::new([2, 1], PixelBounds { x0: 0, x1: 2, y0: 0, y1: 1 });
        for (i, pixel) in film.pixels.iter_mut().enumerate() {
            let x = i as f64 + 1.0;
            *pixel = PixelSums { count: 2, radiance: [x, 2.0 * x, 3.0], depth: x, hits: 1, ..PixelSums::default() };
        }
        let aovs = [Aov::Depth, Aov::Albedo, Aov::Samples];
        let all = channels(&film, &aovs, None);
        let mut names = Vec::new();
        for (name, image) in layers(&film, &aovs, None) {
            for (c, channel) in image.channels.iter().enumerate() {
                let position = all.names.iter().position(|n| n == channel).unwrap();
                (0..2).for_each(|x| assert_eq!(image.get(x, 0, c), all.data[x * all.names.len() + position]));
            }
            names.push(name);
        }
        assert_eq!(names, ["beauty", "depth", "albedo", "samples"]);
    }

    #[test]
    fn exposure_counts_in_stops() {
        let mut film = Film::new([1, 1], PixelBounds { x0: 0, x1: 1, y0: 0, y1: 1 });
        film.pixels[0] = PixelSums { count: 1, radiance: [0.25, 0.5, 4.0], ..PixelSums::default() };
        assert_eq!(exposed(&film, 1.0), [0.5, 1.0, 8.0]);
    }
}

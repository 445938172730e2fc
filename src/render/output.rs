//! Conversion of films to images: named channels and metadata.

use super::rendering::Rendering;
use crate::film::{BAND, Film, LayerPixel, PixelSums};
use crate::imaging::{IMAGE_LAYER, Image, TextEntries};
use crate::scene::{FilmSettings, SampleCountMap};
use crate::settings::Settings;
use rayon::prelude::*;
use std::ops::Range;
use strum::{EnumString, IntoStaticStr, VariantNames};

/// A group of channels in addition to the image itself.
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
    /// Material of the first sample's surface plus one, `material`; 0 if there is none.
    Material,
    /// Geometry of the first sample's surface plus one, `object`; 0 if there is none.
    Object,
    /// The best M/N of `ris`, as a colour and as numbers. `ratio.R/G/B` is green where more proposals are best and red
    /// where more samples are best [Talbot et al. 2005, Fig. 3]. `ratio.proposals` and `ratio.samples` are the counts.
    Ratio,
    /// Records of the irradiance cache that were computed for the pixel, `records`.
    Records,
    /// The light of each light group, `light_NAME.R/G/B`. Their sum is the image.
    LightGroups,
}

impl Aov {
    /// The AOVs that are available for every image, in the order of the file.
    pub const ALL: [Aov; 7] =
        [Aov::Variance, Aov::Samples, Aov::Albedo, Aov::Normal, Aov::Depth, Aov::Material, Aov::Object];

    /// True for features of the first surfaces.
    pub fn is_feature(self) -> bool {
        match self {
            Aov::Albedo | Aov::Normal | Aov::Depth | Aov::Material | Aov::Object => true,
            Aov::Variance | Aov::Samples | Aov::Ratio | Aov::Records | Aov::LightGroups => false,
        }
    }

    /// Names of the channels in the image of a film.
    fn channels(self, film: &Film) -> Vec<String> {
        let names: &[&str] = match self {
            Aov::Variance => &["variance.R", "variance.G", "variance.B"],
            Aov::Samples => &["samples"],
            Aov::Albedo => &["albedo.R", "albedo.G", "albedo.B"],
            Aov::Normal => &["normal.X", "normal.Y", "normal.Z"],
            Aov::Depth => &["depth.Z"],
            Aov::Material => &["material"],
            Aov::Object => &["object"],
            Aov::Ratio => &["ratio.R", "ratio.G", "ratio.B", "ratio.proposals", "ratio.samples"],
            Aov::Records => &["records"],
            Aov::LightGroups => {
                let of_layer = |name: &String| COLOUR.map(|channel| format!("{}.{channel}", light_layer_name(name)));
                return film.light_layers().iter().flat_map(of_layer).collect();
            }
        };
        names.iter().map(|&name| name.to_owned()).collect()
    }
}

/// Layer name of a light group.
fn light_layer_name(group: &str) -> String {
    format!("light_{group}")
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

/// Layers of a film, converted row by row.
#[derive(Clone, Debug)]
pub struct Layers<'a> {
    film: &'a Film,
    /// True if `R G B` come first.
    has_image: bool,
    aovs: &'a [Aov],
    /// The map shown by [`Aov::Ratio`], and its largest ratio. Without a map the layer is black.
    sample_count_map: Option<(&'a SampleCountMap, f32)>,
}

impl<'a> Layers<'a> {
    /// The given AOVs, after the image `R G B` if `has_image`. `sample_count_map` is the source of [`Aov::Ratio`].
    pub fn new(film: &'a Film, has_image: bool, aovs: &'a [Aov], sample_count_map: Option<&'a SampleCountMap>) -> Self {
        let greatest = |map: &SampleCountMap| map.ratios.iter().copied().fold(1.0, f32::max).max(1.0 + f32::EPSILON);
        Layers { film, has_image, aovs, sample_count_map: sample_count_map.map(|map| (map, greatest(map))) }
    }

    /// Names of the channels.
    pub fn names(&self) -> Vec<String> {
        let image = if self.has_image { &COLOUR[..] } else { &[] };
        let aovs = self.aovs.iter().flat_map(|a| a.channels(self.film));
        image.iter().map(|&name| name.to_owned()).chain(aovs).collect()
    }

    /// Like [`Self::rows`], computed by several threads.
    pub fn rows_in_parallel(&self, rows: Range<u32>) -> Vec<f32> {
        let bands = rows.len().div_ceil(BAND as usize) as u32;
        let band = |i: u32| rows.start + i * BAND..rows.end.min(rows.start + (i + 1) * BAND);
        let made: Vec<Vec<f32>> = (0..bands).into_par_iter().with_max_len(1).map(|i| self.rows(band(i))).collect();
        made.concat()
    }

    /// The values of some rows, given by their y coordinates, interleaved.
    pub fn rows(&self, rows: Range<u32>) -> Vec<f32> {
        // Read the sums of the rows; variances only if needed
        let stride = self.names().len();
        let (mut pixels, mut variances) = (Vec::new(), Vec::new());
        if self.aovs.contains(&Aov::Variance) {
            self.film.read_rows_with_variances(rows.clone(), &mut pixels, &mut variances);
        } else {
            self.film.read_rows(rows.clone(), &mut pixels);
        }

        // Append the channels of each pixel; those of light groups are black until all are there
        let mut first_of_groups = 0;
        let first = self.film.index(self.film.bounds.x0, rows.start);
        let mut data = Vec::with_capacity(stride * pixels.len());
        for (i, pixel) in pixels.iter().enumerate() {
            if self.has_image {
                data.extend(pixel.mean().map(|v| v as f32));
            }
            let count = pixel.count.max(1) as f64;
            for aov in self.aovs {
                match aov {
                    Aov::Variance => data.extend(variances[i].map(|v| v as f32)),
                    Aov::Samples => data.push(pixel.count as f32),
                    Aov::Albedo => data.extend(pixel.albedo.map(|v| (v / count) as f32)),
                    Aov::Normal => data.extend(pixel.normal.map(|v| (v / count) as f32)),
                    Aov::Depth if pixel.hits == 0 => data.push(f32::INFINITY),
                    Aov::Depth => data.push((pixel.depth / pixel.hits as f64) as f32),
                    Aov::Material => data.push(pixel.material as f32),
                    Aov::Object => data.push(pixel.object as f32),
                    Aov::Ratio => {
                        data.extend(
                            self.sample_count_map.map_or([0.0; 5], |(map, max)| ratio_values(map, max, first + i)),
                        );
                    }
                    Aov::Records => data.push(pixel.records as f32),
                    Aov::LightGroups => {
                        first_of_groups = if i == 0 { data.len() } else { first_of_groups };
                        data.resize(data.len() + 3 * self.film.light_layers().len(), 0.0);
                    }
                }
            }
        }
        if self.aovs.contains(&Aov::LightGroups) {
            self.film.read_light(0..self.film.light_layers().len(), rows, |light| {
                let at = stride * light.pixel + first_of_groups + 3 * light.layer;
                data[at..at + 3].copy_from_slice(&mean_light(&light, &pixels));
            });
        }
        data
    }
}

/// Mean radiance of a light-group layer in one of the given pixels.
fn mean_light(light: &LayerPixel, pixels: &[PixelSums]) -> [f32; 3] {
    light.radiance.map(|sum| (sum / pixels[light.pixel].count.max(1) as f64) as f32)
}

/// The image `R G B` and the given AOVs, linear, all rows at once. Use [`Layers`] for large images.
pub fn channels(film: &Film, aovs: &[Aov], sample_count_map: Option<&SampleCountMap>) -> Channels {
    let layers = Layers::new(film, true, aovs, sample_count_map);
    Channels { names: layers.names(), data: layers.rows(film.bounds.y0..film.bounds.y1) }
}

/// Images by the name of their layer.
pub type NamedImages = Vec<(String, Image)>;

/// The same values as one named image per AOV and light group, the image itself first.
pub fn layers(film: &Film, aovs: &[Aov], sample_count_map: Option<&SampleCountMap>) -> NamedImages {
    // Images of some channels, and of a light group
    let (width, height) = (film.bounds.width() as usize, film.bounds.height() as usize);
    let image = |has_image: bool, aovs: &[Aov]| {
        let layers = Layers::new(film, has_image, aovs, sample_count_map);
        let data = layers.rows_in_parallel(film.bounds.y0..film.bounds.y1);
        Image { width, height, channels: layers.names(), data }
    };
    let of_group = |(layer, name): (usize, &String)| {
        let band = |rows: Range<u32>| {
            let mut pixels = Vec::new();
            film.read_rows(rows.clone(), &mut pixels);
            let mut data = vec![0.0; 3 * pixels.len()];
            film.read_light(layer..layer + 1, rows, |light| {
                data[3 * light.pixel..][..3].copy_from_slice(&mean_light(&light, &pixels));
            });
            data
        };
        let data = film.bands().map(band).collect::<Vec<Vec<f32>>>().concat();
        (light_layer_name(name), Image { width, height, channels: COLOUR.map(str::to_owned).to_vec(), data })
    };

    // One image per AOV, or per light group; the image itself comes first
    let of_aov = |&aov: &Aov| match aov {
        Aov::LightGroups => film.light_layers().iter().enumerate().map(of_group).collect(),
        _ => vec![(<&str>::from(aov).to_owned(), image(false, &[aov]))],
    };
    let whole = (IMAGE_LAYER.to_owned(), image(true, &[]));
    std::iter::once(whole).chain(aovs.iter().flat_map(of_aov)).collect()
}

/// The AOVs of a preview.
pub fn live_aovs(has_features: bool) -> Vec<Aov> {
    let features = [Aov::Albedo, Aov::Normal, Aov::Depth].into_iter().filter(|_| has_features);
    features.chain([Aov::Samples]).collect()
}

/// The AOVs of an image if none are requested.
pub fn default_aovs(film: &Film, has_ratio: bool, has_records: bool) -> Vec<Aov> {
    let has_groups = !film.light_layers().is_empty();
    let more = [(has_ratio, Aov::Ratio), (has_records, Aov::Records), (has_groups, Aov::LightGroups)];
    Aov::ALL.into_iter().chain(more.into_iter().filter_map(|(has, aov)| has.then_some(aov))).collect()
}

/// Colour and counts of a pixel of the map. The colour scale is logarithmic, from red at ratio 1 to green at the
/// largest ratio of the map.
fn ratio_values(map: &SampleCountMap, max: f32, pixel: usize) -> [f32; 5] {
    let ratio = map.ratios[pixel];
    let green = (ratio.ln() / max.ln()).clamp(0.0, 1.0);
    let samples = (map.time / (f64::from(ratio) * map.t1 + map.t2)) as f32;
    [1.0 - green, green, 0.0, ratio * samples, samples]
}

/// Metadata entries on the progress of a rendering.
pub fn progress_metadata(rendering: &Rendering) -> TextEntries {
    let entries = [
        ("complete", rendering.complete.to_string()),
        ("samples_done", rendering.film.summary().samples_text("per pixel")),
        ("seconds", format!("{:.3}", rendering.elapsed.as_secs_f64())),
    ];
    entries.map(|(key, value)| (format!("lumiris:{key}"), value)).to_vec()
}

/// Metadata entries `lumiris:…` of everything that the image depends on: settings and film.
pub fn metadata(film: &FilmSettings, settings: &Settings) -> TextEntries {
    let b = &film.bounds;
    let film = [
        ("filter", format!("{:?}", film.filter)),
        ("resolution", format!("{}x{}", film.resolution[0], film.resolution[1])),
        ("crop", format!("{},{},{},{}", b.x0, b.x1, b.y0, b.y1)),
    ];
    let own = [("version", env!("CARGO_PKG_VERSION").to_owned()), ("summary", settings.summary())].into_iter();
    let recorded = settings.recorded().map(|(key, value)| (key, value.to_string()));
    let biases = settings.biases().into_iter().map(|bias| ("biased", bias.to_owned()));
    let entries = own.chain(film).chain(recorded).chain(biases);
    entries.map(|(key, value)| (format!("lumiris:{key}"), value)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::accumulator::PixelAccumulator;
    use crate::film::{PixelBounds, PixelSample};
    use lumiris_numbers::math::Rgb;

    /// Two rows of three pixels, two of which have a sample.
    fn film() -> Film {
        let bounds = PixelBounds { x0: 4, x1: 7, y0: 9, y1: 11 };
        let mut pixels = vec![PixelAccumulator::default(); 6];
        pixels[0].add(0, &PixelSample { radiance: Rgb::new(1.0, 2.0, 4.0), ..PixelSample::default() });
        pixels[4].add(0, &PixelSample { radiance: Rgb::new(0.5, 0.25, 8.0), ..PixelSample::default() });
        Film::of_pixels([20, 20], bounds, &pixels)
    }

    #[test]
    fn channel_count_matches_names_for_every_aov() {
        let c = channels(&film(), &Aov::ALL, None);
        assert_eq!(c.data.len(), c.names.len() * 6);
        let depth = c.names.iter().position(|n| n == "depth.Z").unwrap();
        assert_eq!(c.data[depth], f32::INFINITY);
        assert_eq!(&c.data[..3], &[1.0, 2.0, 4.0]);
    }

    #[test]
    fn layers_are_those_of_the_whole_image_row_by_row() {
        let film = film();
        let whole = channels(&film, &[Aov::Samples], None);
        let layers = Layers::new(&film, true, &[Aov::Samples], None);
        assert_eq!([layers.rows(9..10), layers.rows(10..11)].concat(), whole.data);
        assert_eq!(Layers::new(&film, false, &[Aov::Samples], None).rows(10..11), [0.0, 1.0, 0.0]);
    }

    #[test]
    fn layers_have_the_values_of_the_channels() {
        let film = film();
        let aovs = [Aov::Depth, Aov::Albedo, Aov::Samples, Aov::Variance];
        let all = channels(&film, &aovs, None);
        let (width, mut names) = (film.bounds.width() as usize, Vec::new());
        for (name, image) in layers(&film, &aovs, None) {
            for (c, channel) in image.channels.iter().enumerate() {
                let position = all.names.iter().position(|n| n == channel).unwrap();
                let value = |i: usize| all.data[i * all.names.len() + position].to_bits();
                (0..film.len()).for_each(|i| assert_eq!(image.get(i % width, i / width, c).to_bits(), value(i)));
            }
            names.push(name);
        }
        assert_eq!(names, ["beauty", "depth", "albedo", "samples", "variance"]);
    }
}

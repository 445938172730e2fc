//! The metrics of an image, as numbers and as maps.

use super::load::{ImageSet, Region, Shown};
use super::metric::Metric;
use crate::imaging::metrics::difference::DEFAULT_EPSILON;
use crate::imaging::metrics::perceptual::perceptual_error_at;
use crate::imaging::metrics::significance::{F32_ROUNDING, HALF_ROUNDING};
use crate::imaging::metrics::{
    Bias, DEFAULT_PIXELS_PER_DEGREE, Differences, Pixel, Significance, bias, differences, hdr_flip, ldr_flip,
    mean_of_map, perceptual_map, significance, z_map,
};
use std::collections::BTreeSet;
use strum::IntoStaticStr;

/// Parameters of a comparison.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Metrics to compute.
    pub metrics: BTreeSet<Metric>,
    /// Exposure (stops) of the display for LDR-ꟻLIP.
    pub exposure: f32,
    /// ε of relMSE.
    pub epsilon: f64,
    /// Peak value for PSNR.
    pub peak: f64,
    /// Luminance (cd/m²) of a pixel with luminance 1, for the perceptual error.
    pub candelas: f64,
    /// Pixels per degree of the visual field, for ꟻLIP.
    pub pixels_per_degree: f32,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            metrics: Metric::ALL.into_iter().collect(),
            exposure: 0.0,
            epsilon: DEFAULT_EPSILON,
            peak: 1.0,
            candelas: 1.0,
            pixels_per_degree: DEFAULT_PIXELS_PER_DEGREE,
        }
    }
}

/// The metrics of an image; `None` if not selected or not possible.
#[derive(Clone, Debug, PartialEq)]
pub struct Scores {
    /// Squared differences and counts.
    pub differences: Differences,
    /// PSNR (dB).
    pub psnr: f64,
    /// Mean of LDR-ꟻLIP.
    pub flip: Option<f64>,
    /// Mean of HDR-ꟻLIP.
    pub hdr_flip: Option<f64>,
    /// Exposures of HDR-ꟻLIP: minimum, maximum (stops), count.
    pub hdr_exposures: Option<(f64, f64, usize)>,
    /// Perceptual error.
    pub tvi: Option<f64>,
    /// Mean difference.
    pub bias: Option<Bias>,
    /// Tests against the variances; also `None` if the image has no variance.
    pub significance: Option<Significance>,
}

/// Values per pixel; NaN for excluded pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Maps {
    /// LDR-ꟻLIP.
    pub flip: Option<Vec<f32>>,
    /// HDR-ꟻLIP.
    pub hdr_flip: Option<Vec<f32>>,
    /// Difference of luminance in units of thresholds.
    pub tvi: Option<Vec<f32>>,
    /// Difference in standard deviations.
    pub z: Option<Vec<f32>>,
}

/// Result for an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Compared {
    /// Metrics.
    pub scores: Scores,
    /// Per-pixel metrics.
    pub maps: Maps,
    /// Variances that the tests used.
    pub noise: Noise,
}

/// Availability of variances.
#[derive(Clone, Copy, Debug, PartialEq, Eq, IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
pub enum Noise {
    /// The image and the reference have variances.
    Both,
    /// Only the image has variances; the reference is taken as exact.
    #[strum(serialize = "image")]
    ImageOnly,
    /// The image has no variances.
    #[strum(serialize = "none")]
    Unknown,
}

impl Noise {
    fn of(image: &Shown, reference: &Shown) -> Self {
        match (&image.variance, &reference.variance) {
            (Some(_), Some(_)) => Noise::Both,
            (Some(_), None) => Noise::ImageOnly,
            (None, _) => Noise::Unknown,
        }
    }
}

/// Compares each image with the reference.
pub fn compare(set: &ImageSet, settings: &Settings) -> Vec<Compared> {
    set.images.iter().map(|image| compare_one(image, &set.reference, set.region, settings)).collect()
}

fn compare_one(image: &Shown, reference: &Shown, region: Region, settings: &Settings) -> Compared {
    // Differences and variances
    let wants = |metric: Metric| settings.metrics.contains(&metric);
    let (x, r, size) = (&image.pixels, &reference.pixels, region.size());
    let noise = Noise::of(image, reference);
    let variance = variance_of_difference(image, reference);
    let differences = differences(x, r, settings.epsilon);
    let both = variance.as_deref().filter(|_| noise == Noise::Both);

    // Maps whose means are scores
    let flip = wants(Metric::Flip).then(|| ldr_flip(x, r, size, settings.exposure.exp2(), settings.pixels_per_degree));
    let hdr = wants(Metric::HdrFlip).then(|| hdr_flip(x, r, size, settings.pixels_per_degree));
    let tested = variance.as_deref().filter(|_| wants(Metric::Z));
    let rounding = if image.is_half || reference.is_half { HALF_ROUNDING } else { F32_ROUNDING };

    // Scores, and maps of the selected metrics
    let scores = Scores {
        psnr: differences.psnr(settings.peak),
        differences,
        flip: flip.as_deref().map(mean_of_map),
        hdr_flip: hdr.as_ref().map(|h| mean_of_map(&h.map)),
        hdr_exposures: hdr.as_ref().map(|h| (h.start, h.stop, h.count)),
        tvi: wants(Metric::Tvi).then(|| perceptual_error_at(x, r, settings.candelas)),
        bias: wants(Metric::Bias).then(|| bias(x, r, both)),
        significance: tested.map(|v| significance(x, r, v, rounding)),
    };
    let maps = Maps {
        flip,
        hdr_flip: hdr.map(|h| h.map),
        tvi: wants(Metric::Tvi).then(|| perceptual_map(x, r, settings.candelas)),
        z: tested.map(|v| z_map(x, r, v, rounding)),
    };
    Compared { scores, maps, noise }
}

/// Variance of x − r per pixel; `None` if the image has no variance.
fn variance_of_difference(image: &Shown, reference: &Shown) -> Option<Vec<Pixel>> {
    let variance = image.variance.as_ref()?;
    let Some(of_reference) = &reference.variance else { return Some(variance.clone()) };
    let sum = |(a, b): (&Pixel, &Pixel)| std::array::from_fn(|c| a[c] + b[c]);
    Some(variance.iter().zip(of_reference).map(sum).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(value: f32, variance: Option<f32>) -> Shown {
        Shown {
            path: "a.exr".into(),
            name: "a.exr".into(),
            layer: "R G B".into(),
            remarks: Vec::new(),
            pixels: vec![[value; 3]; 6],
            variance: variance.map(|v| vec![[v; 3]; 6]),
            is_half: false,
        }
    }

    fn set(image: Shown, reference: Shown) -> ImageSet {
        let region = Region { x: 0, y: 0, width: 3, height: 2 };
        ImageSet { images: vec![image], reference, region, display: [3, 2] }
    }

    #[test]
    fn variances_of_both_add_and_one_alone_takes_the_reference_as_exact() {
        let test = |a, b| compare(&set(shown(1.5, a), shown(1.0, b)), &Settings::default()).remove(0);
        let both = test(Some(0.09), Some(0.16));
        assert!((both.scores.significance.unwrap().max_z - 1.0).abs() < 1e-6 && both.noise == Noise::Both);
        assert_eq!(<&str>::from(both.scores.bias.unwrap().source), "variances");
        let image = test(Some(0.25), None);
        assert!((image.scores.significance.unwrap().max_z - 1.0).abs() < 1e-6 && image.noise == Noise::ImageOnly);
        assert_eq!(<&str>::from(image.scores.bias.unwrap().source), "spread");
        let none = test(None, Some(0.1));
        assert!(none.scores.significance.is_none() && none.maps.z.is_none() && none.noise == Noise::Unknown);
    }

    #[test]
    fn only_what_is_asked_for_is_computed() {
        let settings = Settings { metrics: [Metric::Tvi].into(), ..Settings::default() };
        let c = compare(&set(shown(0.5, Some(0.1)), shown(0.25, None)), &settings).remove(0);
        assert!(c.scores.tvi.unwrap() > 0.0 && c.maps.tvi.is_some());
        assert!(c.scores.flip.is_none() && c.scores.hdr_flip.is_none() && c.scores.significance.is_none());
        assert!(c.maps.flip.is_none() && c.maps.z.is_none() && c.scores.bias.is_none());
        let none = compare(&set(shown(0.5, None), shown(0.5, None)), &Settings::default()).remove(0);
        assert_eq!((none.scores.flip, none.scores.hdr_flip, none.scores.tvi), (Some(0.0), Some(0.0), Some(0.0)));
    }
}

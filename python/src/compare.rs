//! Comparison of two images, from files or arrays.

use crate::images::Place;
use lumiris::imaging::compare::load::read;
use lumiris::imaging::compare::{COLUMNS, Compared, ImageSet, Metric, Raw, Settings, compare as compare_all};
use lumiris::imaging::metrics::Pixel;
use lumiris::imaging::oiio::Window;
use numpy::{IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// An image to compare: a file, or colours with variances of their means and a position in the full image.
#[derive(FromPyObject)]
pub(crate) enum Input<'py> {
    #[pyo3(transparent)]
    Array((PyReadonlyArray3<'py, f32>, Option<PyReadonlyArray3<'py, f32>>, Option<Place>)),
    #[pyo3(transparent)]
    File(PathBuf),
}

/// Options of a comparison.
#[derive(Debug, FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Options {
    metrics: Option<Vec<String>>,
    layer: Option<String>,
    exposure: f32,
    epsilon: f64,
    peak: f64,
    luminance: f64,
    ppd: f32,
}

impl Options {
    fn checked(&self) -> PyResult<Settings> {
        // Metrics
        let wrong = |text: &str| Err(PyValueError::new_err(text.to_owned()));
        let all = || Metric::ALL.map(<&str>::from).join(", ");
        let metric = |name: &String| {
            let unknown = |_| PyValueError::new_err(format!("there is no metric `{name}`; there are {}", all()));
            name.parse::<Metric>().map_err(unknown)
        };
        let default = Settings::default();
        let asked = self.metrics.as_ref().map(|names| names.iter().map(metric).collect::<PyResult<BTreeSet<_>>>());

        // Numbers, each with its range
        match self {
            _ if !self.exposure.is_finite() => wrong("exposure: expected a number"),
            _ if !(self.epsilon >= 0.0) => wrong("epsilon: must not be negative"),
            _ if !(self.peak > 0.0) => wrong("peak: must be greater than 0"),
            _ if !(self.luminance > 0.0) => wrong("luminance: must be greater than 0"),
            _ if !(1.0..=1000.0).contains(&self.ppd) => wrong("ppd: must be in 1..1000"),
            _ => Ok(Settings {
                metrics: asked.transpose()?.unwrap_or(default.metrics),
                exposure: self.exposure,
                epsilon: self.epsilon,
                peak: self.peak,
                candelas: self.luminance,
                pixels_per_degree: self.ppd,
            }),
        }
    }
}

/// The pixels of an array.
fn pixels(array: &PyReadonlyArray3<'_, f32>) -> PyResult<Vec<Pixel>> {
    let (triples, rest) = array.as_slice()?.as_chunks::<3>();
    if array.shape()[2] != 3 || !rest.is_empty() {
        return Err(PyValueError::new_err(format!(
            "expected rows x columns x 3 values, but found {:?}",
            array.shape()
        )));
    }
    Ok(triples.to_vec())
}

/// Reads a file or copies an array.
fn load(py: Python<'_>, input: &Input<'_>, name: &str, layer: Option<&str>) -> PyResult<Raw> {
    match input {
        Input::File(path) => py.detach(|| read(path, layer)).map_err(PyOSError::new_err),
        Input::Array((array, variance, place)) => {
            // Position in the full image
            let [height, width] = [array.shape()[0], array.shape()[1]];
            let (origin, full) = place.unwrap_or(([0, 0], [width, height]));
            let origin = origin.map(i32::try_from);
            let [Ok(x), Ok(y)] = origin else { return Err(PyValueError::new_err("the origin is too far away")) };
            let window = Window { origin: [x, y], full_origin: [0, 0], full_size: full };
            if x as usize + width > full[0] || y as usize + height > full[1] {
                return Err(PyValueError::new_err("the image does not lie in the full image"));
            }

            // Pixels and variances
            if variance.as_ref().is_some_and(|v| v.shape() != array.shape()) {
                return Err(PyValueError::new_err("the variance has another shape than the image"));
            }
            let variance = variance.as_ref().map(pixels).transpose()?;
            Ok(Raw::of_pixels(name, &window, width, pixels(array)?, variance))
        }
    }
}

/// Metrics by name, maps by name with the image's size, and the kind of noise.
type Result<'py> = (Vec<(&'static str, Option<f64>)>, Vec<(&'static str, Bound<'py, PyArray2<f32>>)>, &'static str);

/// Compares an image with its reference.
#[pyfunction]
pub(crate) fn compare<'py>(
    py: Python<'py>,
    image: Input<'py>,
    reference: Input<'py>,
    options: Options,
) -> PyResult<Result<'py>> {
    // Compare
    let settings = options.checked()?;
    let layer = options.layer.as_deref();
    let (image, reference) = (load(py, &image, "image", layer)?, load(py, &reference, "reference", layer)?);
    let compared = py.detach(|| {
        let set = ImageSet::new(vec![image], reference)?;
        Ok((set.region.size(), compare_all(&set, &settings)))
    });
    let wrong = |error: lumiris::imaging::compare::LoadError| PyValueError::new_err(error.to_string());
    let ([width, height], mut compared) = compared.map_err(wrong)?;
    let Some(Compared { scores, maps, noise }) = compared.pop() else {
        return Err(PyValueError::new_err("there is nothing to compare"));
    };

    // Metrics and maps
    let asked = COLUMNS.iter().filter(|column| column.metric.is_none_or(|metric| settings.metrics.contains(&metric)));
    let numbers = asked.map(|column| (column.key, (column.value)(&scores))).collect();
    let maps = [("flip", maps.flip), ("hdrflip", maps.hdr_flip), ("tvi", maps.tvi), ("z", maps.z)];
    let array = |(name, map): (&'static str, Option<Vec<f32>>)| {
        Some(map?.into_pyarray(py).reshape([height, width]).map(|array| (name, array)))
    };
    Ok((numbers, maps.into_iter().filter_map(array).collect::<PyResult<_>>()?, noise.into()))
}

//! Images as arrays, and image files.

use lumiris::imaging::oiio::{self, ImageError, Part, ReadLimits, Window};
use lumiris::imaging::{Image, layers};
use numpy::{IntoPyArray, PyArray3, PyArrayMethods, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::{PyFileNotFoundError, PyOSError, PyValueError};
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A layer: its name, the names of its channels, and an array of rows × columns × channels.
pub(crate) type Layer<'py> = (String, Vec<String>, Bound<'py, PyArray3<f32>>);

/// Position of an image in the full image: column and row of its first pixel, and columns and rows of the full image.
pub(crate) type Place = ([usize; 2], [usize; 2]);

/// Moves the values of an image into an array.
pub(crate) fn array(py: Python<'_>, image: Image) -> PyResult<Bound<'_, PyArray3<f32>>> {
    image.data.into_pyarray(py).reshape([image.height, image.width, image.channels.len()])
}

/// Moves the values of layers into arrays.
pub(crate) fn arrays<'py>(py: Python<'py>, layers: Vec<(String, Image)>) -> PyResult<Vec<Layer<'py>>> {
    layers.into_iter().map(|(name, image)| Ok((name, image.channels.clone(), array(py, image)?))).collect()
}

/// Splits an image into layers, by the names of its channels.
pub(crate) fn split(image: &Image) -> Vec<(String, Image)> {
    let stride = image.channels.len();
    let image_of = |layer: lumiris::imaging::Layer| {
        let channels = image.channels[layer.channels.clone()].to_vec();
        let pixels = image.data.chunks_exact(stride).flat_map(|pixel| &pixel[layer.channels.clone()]);
        (layer.name, Image { width: image.width, height: image.height, channels, data: pixels.copied().collect() })
    };
    layers(&image.channels).into_iter().map(image_of).collect()
}

/// The exception for an image that cannot be read or written.
pub(crate) fn image_error(error: ImageError) -> PyErr {
    let text = error.to_string();
    match error {
        ImageError::NotFound { .. } => PyFileNotFoundError::new_err(text),
        ImageError::Color(_) => PyValueError::new_err(text),
        ImageError::Library(_)
        | ImageError::Unreadable { .. }
        | ImageError::TooLarge { .. }
        | ImageError::Write { .. } => PyOSError::new_err(text),
    }
}

/// Reads a part of a file: linear layers, metadata, and the position in the full image.
#[pyfunction]
pub(crate) fn read(
    py: Python<'_>,
    path: PathBuf,
    part: usize,
) -> PyResult<(Vec<Layer<'_>>, BTreeMap<String, String>, Place)> {
    let read = py.detach(|| oiio::read_part(&path, part, &ReadLimits::default())).map_err(image_error)?;
    let size = [read.image.width, read.image.height];
    let (mut image, encoding) = (read.image, read.encoding);
    let found = py.detach(|| {
        let Image { channels, data, .. } = &mut image;
        for pixel in data.chunks_exact_mut(channels.len()) {
            // Opacity is never encoded
            let encoded = pixel.iter_mut().zip(channels.iter()).filter(|(_, name)| *name != "A");
            encoded.for_each(|(v, _)| *v = encoding.to_linear(*v));
        }
        split(&image)
    });
    Ok((arrays(py, found)?, read.metadata, place(&read.window, size)))
}

/// Position of the pixels of a file in the full image, which is extended to contain data outside the display window.
fn place(window: &Window, size: [usize; 2]) -> Place {
    let offset = |a: usize| i64::from(window.origin[a]) - i64::from(window.full_origin[a]);
    let origin = [0, 1].map(|a| usize::try_from(offset(a)).unwrap_or(0));
    let full = [0, 1].map(|a| window.full_size[a].max(origin[a] + size[a]));
    (origin, full)
}

/// Writes layers, given the names of their channels, to an EXR file of 32-bit floats.
#[pyfunction]
pub(crate) fn write(
    py: Python<'_>,
    path: PathBuf,
    layers: Vec<(Vec<String>, PyReadonlyArray3<'_, f32>)>,
    metadata: Vec<(String, String)>,
    place: Option<Place>,
) -> PyResult<()> {
    // Check the shapes
    let [height, width] = layers.first().map_or([0, 0], |(_, layer)| [layer.shape()[0], layer.shape()[1]]);
    let mut slices = Vec::with_capacity(layers.len());
    for (names, layer) in &layers {
        let shape = layer.shape();
        if shape != [height, width, names.len()] {
            let name = names.join(", ");
            let wrong = format!("layer of {name}: shape {shape:?}, but expected [{height}, {width}, {}]", names.len());
            return Err(PyValueError::new_err(wrong));
        }
        slices.push((names.len(), layer.as_slice()?));
    }
    if width * height == 0 {
        return Err(PyValueError::new_err("there is nothing to write"));
    }

    // Interleave the layers and write
    let names: Vec<String> = layers.iter().flat_map(|(names, _)| names.clone()).collect();
    py.detach(|| {
        let pixel = |i: usize| slices.iter().flat_map(move |(count, data)| &data[i * count..(i + 1) * count]).copied();
        let data = (0..width * height).flat_map(pixel).collect();
        let mut part = Part::linear(width, height, names, data).with_metadata(metadata);
        if let Some((origin, full)) = place {
            part = part.with_window(origin, full);
        }
        oiio::write_image(&path, &[part])
    })
    .map_err(image_error)
}

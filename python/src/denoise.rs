//! Denoising with Open Image Denoise.

use crate::images::array;
use lumiris::imaging::Image;
use lumiris::imaging::oidn::{DenoiseError, Denoiser, NoisyImage};
use numpy::{PyArray3, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use std::path::PathBuf;

type Pixels<'py> = PyReadonlyArray3<'py, f32>;

/// Denoises rows × columns × 3, guided by arrays of the same shape. Returns the result and the version of the library.
/// By default, `library` is the system's and there is one thread per core.
#[pyfunction]
pub(crate) fn denoise<'py>(
    py: Python<'py>,
    color: Pixels<'py>,
    albedo: Option<Pixels<'py>>,
    normal: Option<Pixels<'py>>,
    library: Option<PathBuf>,
    threads: Option<usize>,
) -> PyResult<(Bound<'py, PyArray3<f32>>, String)> {
    // Copy the image and its guides
    let &[height, width, 3] = color.shape() else {
        return Err(PyValueError::new_err(format!("image: expected three channels, not shape {:?}", color.shape())));
    };
    let guide = |name: &str, guide: &Option<Pixels<'py>>| match guide {
        Some(guide) if guide.shape() != color.shape() => {
            let (found, wanted) = (guide.shape(), color.shape());
            Err(PyValueError::new_err(format!("{name}: shape {found:?}, but the image has {wanted:?}")))
        }
        Some(guide) => Ok(Some(guide.as_slice()?.to_vec())),
        None => Ok(None),
    };
    let (albedo, normal) = (guide("albedo", &albedo)?, guide("normal", &normal)?);
    let noisy = NoisyImage { width, height, color: color.as_slice()?.to_vec(), albedo, normal };

    // Denoise without the GIL
    let denoised = py.detach(|| {
        let denoiser = Denoiser::open(library.as_deref(), threads)?;
        let version = denoiser.version();
        Ok((denoiser.denoise(noisy)?, version))
    });
    let (data, version) = denoised.map_err(|error: DenoiseError| {
        let hint = match error {
            DenoiseError::Library(_) => " by library= or the environment variable LUMIRIS_OIDN",
            _ => "",
        };
        PyRuntimeError::new_err(format!("{error}{hint}"))
    })?;

    // The result as an array
    let channels = ["R", "G", "B"].map(str::to_owned).to_vec();
    Ok((array(py, Image { width, height, channels, data })?, version))
}

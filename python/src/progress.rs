//! Progress of a rendering for its callback.

use crate::images::array;
use lumiris::film::{Film, FilmTile, PixelBounds};
use lumiris::imaging::Image;
use lumiris::render::Progress;
use lumiris::render::output::{Aov, layers, live_aovs};
use numpy::PyArray3;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// The current pixels of an image.
pub(crate) struct Canvas {
    resolution: [u32; 2],
    bounds: PixelBounds,
    /// Keyed by left and top.
    tiles: Mutex<BTreeMap<[u32; 2], FilmTile>>,
    aovs: Vec<Aov>,
}

impl Canvas {
    pub(crate) fn new(resolution: [u32; 2], bounds: PixelBounds, has_features: bool) -> Self {
        Canvas { resolution, bounds, tiles: Mutex::default(), aovs: live_aovs(has_features) }
    }

    /// Stores the tiles of a film. Their sums are shared.
    pub(crate) fn set_tile(&self, film: &Film) {
        let mut tiles = self.tiles.lock().unwrap_or_else(PoisonError::into_inner);
        tiles.extend(film.tiles().iter().map(|tile| ([tile.bounds.x0, tile.bounds.y0], tile.clone())));
    }

    /// The film of all tiles stored so far.
    fn film(&self) -> Film {
        let tiles = self.tiles.lock().unwrap_or_else(PoisonError::into_inner).values().cloned().collect();
        Film::new(self.resolution, self.bounds, tiles, Vec::new())
    }
}

/// The progress of a rendering.
#[pyclass(frozen, name = "Progress", module = "lumiris")]
pub(crate) struct PassProgress {
    pub(crate) progress: Progress,
    /// True after a pass over the whole image, while the rendering waits.
    #[pyo3(get)]
    pub(crate) is_pass: bool,
    pub(crate) canvas: Arc<Canvas>,
}

#[pymethods]
impl PassProgress {
    /// Share of the camera samples done, 0 to 1.
    #[getter]
    fn fraction(&self) -> f64 {
        self.progress.samples_done as f64 / self.progress.samples_total.max(1) as f64
    }

    /// Passes over the whole image done.
    #[getter]
    fn passes(&self) -> u32 {
        self.progress.passes
    }

    /// Camera samples done, as if every pixel had the same number.
    #[getter]
    fn samples_done(&self) -> u64 {
        self.progress.samples_done
    }

    /// Camera samples requested.
    #[getter]
    fn samples_total(&self) -> u64 {
        self.progress.samples_total
    }

    /// Rays of all kinds traced so far.
    #[getter]
    fn rays(&self) -> u64 {
        self.progress.rays
    }

    /// Time since the first sample (s).
    #[getter]
    fn elapsed(&self) -> f64 {
        self.progress.elapsed.as_secs_f64()
    }

    /// Median of the relative standard errors of blocks of 16 × 16 pixels, at its last computation; `None` before the
    /// first.
    #[getter]
    fn noise(&self) -> Option<f64> {
        self.progress.noise
    }

    /// The current image.
    fn image<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let mut images = self.images(py, &[]);
        let (_, image) = images.remove(0);
        array(py, image)
    }

    /// The current image, features of the first surfaces, and sample counts.
    fn layers<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let layers = PyDict::new(py);
        for (name, image) in self.images(py, &self.canvas.aovs) {
            layers.set_item(name, array(py, image)?)?;
        }
        Ok(layers)
    }

    fn __repr__(&self) -> String {
        let Progress { passes, elapsed, .. } = self.progress;
        format!("<Progress {:.1} %, {passes} passes, {:.1} s>", 100.0 * self.fraction(), elapsed.as_secs_f64())
    }
}

impl PassProgress {
    fn images(&self, py: Python<'_>, aovs: &[Aov]) -> Vec<(String, Image)> {
        py.detach(|| layers(&self.canvas.film(), aovs, None))
    }
}

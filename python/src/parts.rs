//! Parts of images and checkpoints: options of a rendering, and merging.

use crate::images::{Layer, Place, arrays};
use lumiris::film::Film;
use lumiris::imaging::Image;
use lumiris::render::output::{Aov, layers};
use lumiris::render::parts::{Extent, Merged, PartError, Stored, merge as merge_parts};
use lumiris_formats::output::check_destination;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::io;
use std::path::PathBuf;
use std::time::Duration;

/// Options of a rendering that is divided, interrupted or continued.
#[derive(Debug, FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct PartOptions {
    part: Option<[u32; 2]>,
    part_by: String,
    samples_from: Option<u32>,
    samples_to: Option<u32>,
    part_file: Option<PathBuf>,
    checkpoint: Option<(PathBuf, f64)>,
    resume: Option<PathBuf>,
}

/// The options, checked.
#[derive(Debug)]
pub(crate) struct Parts {
    pub(crate) extent: Extent,
    /// File for the exact sums at the end.
    pub(crate) file: Option<PathBuf>,
    pub(crate) checkpoint: Option<(PathBuf, Duration)>,
    resume: Option<PathBuf>,
}

impl PartOptions {
    /// Checks the options. `is_limited` is true if the rendering has a time limit.
    pub(crate) fn checked(self, is_limited: bool) -> PyResult<Parts> {
        // Extent
        let is_by_tiles = match self.part_by.as_str() {
            "samples" => false,
            "tiles" => true,
            other => return Err(PyValueError::new_err(format!("part_by: expected samples or tiles, not `{other}`"))),
        };
        let PartOptions { part, samples_from, samples_to, .. } = self;
        let extent = Extent { part, is_by_tiles, samples_from, samples_to };
        extent.check(is_limited).map_err(|error| PyValueError::new_err(in_words_of_python(&error)))?;
        if part.is_some() && self.part_file.is_none() {
            return Err(PyValueError::new_err("part needs a part_file for lumiris.merge"));
        }

        // Checkpoint
        let interval = |(path, seconds): (PathBuf, f64)| {
            let duration = Duration::try_from_secs_f64(seconds).ok().filter(|duration| !duration.is_zero());
            duration.map(|duration| (path, duration))
        };
        let checkpoint = self.checkpoint.map(|given| {
            interval(given).ok_or_else(|| PyValueError::new_err("checkpoint: expected a positive number of seconds"))
        });
        let checkpoint = checkpoint.transpose()?;

        // Files
        let mut files = checkpoint.iter().map(|(path, _)| path).chain(&self.part_file);
        files.try_for_each(|path| check_destination(path).map(drop))?;
        Ok(Parts { extent, file: self.part_file, checkpoint, resume: self.resume })
    }
}

impl Parts {
    /// The stored state to resume from, if any.
    pub(crate) fn stored(&self) -> Result<Option<Stored>, PartError> {
        let checkpoint = self.checkpoint.as_ref().map(|(path, _)| path.as_path());
        let stored = self.resume.as_ref().map(|path| Stored::read(path, checkpoint)).transpose()?;
        Ok(stored.flatten())
    }
}

/// The text of an error, with keywords in place of command-line options.
pub(crate) fn in_words_of_python(error: &dyn std::error::Error) -> String {
    let text = error.to_string();
    let mut words = text.split("--");
    let first = words.next().unwrap_or_default().to_owned();
    words.fold(first, |text, word| {
        let end = word.find(|c: char| c != '-' && !c.is_ascii_lowercase()).unwrap_or(word.len());
        text + &word[..end].replace('-', "_") + &word[end..]
    })
}

/// The exception for files of parts and checkpoints.
pub(crate) fn part_error(error: PartError) -> PyErr {
    match &error {
        PartError::Io { cause, .. } => io::Error::new(cause.kind(), error.to_string()).into(),
        PartError::Parts(_) => PyValueError::new_err(in_words_of_python(&error)),
        PartError::Foreign { .. } | PartError::Damaged { .. } | PartError::Sums(_) => {
            PyValueError::new_err(error.to_string())
        }
    }
}

/// Position of a film's pixels in the full image.
pub(crate) fn place(film: &Film) -> Place {
    ([film.bounds.x0 as usize, film.bounds.y0 as usize], film.resolution.map(|n| n as usize))
}

/// Return value of `merge`: layers, metadata, position, missing parts, and time (s).
type MergedLayers<'py> = (Vec<Layer<'py>>, Vec<(String, String)>, Place, Vec<String>, f64);

/// Merges parts.
#[pyfunction]
pub(crate) fn merge(
    py: Python<'_>,
    parts: Vec<PathBuf>,
    allow_missing: bool,
    aov: Option<Vec<String>>,
) -> PyResult<MergedLayers<'_>> {
    let parse = |name: &String| name.parse().map_err(|_| PyValueError::new_err(format!("aov: there is no `{name}`")));
    let aovs = aov.as_ref().map(|list| list.iter().map(parse).collect::<PyResult<Vec<Aov>>>()).transpose()?;
    let merged = py.detach(|| {
        let merged = merge_parts(&parts, allow_missing)?;
        let images: Vec<(String, Image)> = layers(&merged.film, &aovs.unwrap_or_else(|| merged.aovs()), None);
        Ok((images, merged))
    });
    let (images, merged): (_, Merged) = merged.map_err(part_error)?;
    Ok((arrays(py, images)?, merged.metadata(), place(&merged.film), merged.missing, merged.seconds))
}

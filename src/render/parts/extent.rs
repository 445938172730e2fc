//! Selection of samples and pixels: the extent of a part.

use super::stored::Stored;
use crate::integrators::exclusions::{Feature, between};
use crate::render::render_settings::{RenderSettings, depends_on_earlier_samples};
use crate::render::tile_share::TileShare;
use crate::settings::{Allocation, EstimatorKind, IntegratorKind, Settings};

/// A part of an image; by default the whole image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Extent {
    /// The I-th of N parts, from 1.
    pub part: Option<[u32; 2]>,
    /// True if parts divide the pixels, false if they divide the samples of all pixels.
    pub is_by_tiles: bool,
    /// Index of the first sample of each pixel.
    pub samples_from: Option<u32>,
    /// Index after the last sample.
    pub samples_to: Option<u32>,
}

/// Reason why an image cannot be divided this way, in terms of command-line options.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ExtentError(String);

impl From<&str> for ExtentError {
    fn from(text: &str) -> Self {
        ExtentError(text.to_owned())
    }
}

/// True if pixels share paths with these settings, or if `auto` may decide so.
fn may_share_paths(settings: &Settings) -> bool {
    let Settings { integrator, sampling, .. } = settings;
    let is_open = integrator.estimator == EstimatorKind::Auto && sampling.allocation == Allocation::Auto;
    let is_shared = integrator.path_reuse.map_or(is_open, |edge| edge > 1);
    is_shared && integrator.kind == IntegratorKind::Path
}

impl Extent {
    /// True if this is not the whole image.
    pub fn is_partial(&self) -> bool {
        self.part.is_some() || self.has_range()
    }

    fn has_range(&self) -> bool {
        self.samples_from.is_some() || self.samples_to.is_some()
    }

    /// Rejects contradictions, and a time limit for a part.
    pub fn check(&self, is_limited: bool) -> Result<(), ExtentError> {
        if self.part.is_some_and(|[i, n]| i < 1 || i > n) {
            return Err("--part: expected I/N with 1 <= I <= N, such as 3/8".into());
        }
        if self.part.is_some() && !self.is_by_tiles && self.has_range() {
            let reason = "--part is a share of the samples: it cannot stand beside --samples-from and --samples-to";
            return Err(reason.into());
        }
        if self.is_partial() && is_limited {
            return Err("parts of an image cannot be limited by --time: their samples would not be known".into());
        }
        Ok(())
    }

    /// Rejects settings that prevent a division, if the extent is a part.
    pub fn check_settings(&self, settings: &Settings) -> Result<(), ExtentError> {
        if self.is_partial() { self.check_division(settings) } else { Ok(()) }
    }

    /// Rejects settings that prevent the division of an image.
    pub fn check_division(&self, settings: &Settings) -> Result<(), ExtentError> {
        if settings.sampling.noise.is_some() {
            return Err("parts of an image cannot be limited by --noise: give a number of samples, --spp".into());
        }
        let is_share = self.part.is_some() && self.is_by_tiles;
        let is_by_samples = !self.is_by_tiles || self.has_range();
        let shared = (is_share && may_share_paths(settings)).then(|| between(Feature::Sharing, Feature::TileShare));
        let fitted = (is_by_samples && depends_on_earlier_samples(settings))
            .then(|| between(Feature::Progressive, Feature::SampleShare));
        let conflict = shared.or(fitted).flatten();
        conflict.map_or(Ok(()), |conflict| Err(ExtentError(conflict.to_string())))
    }

    /// Applies the extent, and stored sums if there are any, to the settings. `more` is the new number of samples of an
    /// image that is resumed.
    pub fn apply(
        &self,
        settings: &mut RenderSettings,
        stored: Option<&Stored>,
        more: Option<u32>,
    ) -> Result<(), ExtentError> {
        // Range of samples, or part I of N
        let spp = settings.spp;
        (settings.skip, settings.spp) = (self.samples_from.unwrap_or(0), self.samples_to.unwrap_or(spp));
        if let Some([i, n]) = self.part {
            if self.is_by_tiles {
                settings.share = Some(TileShare { index: i - 1, count: n });
            } else {
                let until = |i: u32| (u64::from(spp) * u64::from(i) / u64::from(n)) as u32;
                (settings.skip, settings.spp) = (until(i - 1), until(i));
                if spp < n {
                    let reason = format!(
                        "{spp} samples per pixel cannot be {n} parts: divide with --part-by tiles, if pixels share no paths"
                    );
                    return Err(ExtentError(reason));
                }
            }
        }

        // Stored sums, and a check of the result
        if let Some(stored) = stored {
            self.go_on(settings, stored, more)?;
        }
        if settings.skip >= settings.spp {
            return Err(ExtentError(format!("there are no samples from {} to {}", settings.skip, settings.spp)));
        }
        Ok(())
    }

    /// Applies stored sums, which have to be of the same part.
    fn go_on(&self, settings: &mut RenderSettings, stored: &Stored, more: Option<u32>) -> Result<(), ExtentError> {
        let header = &stored.header;
        let before = (header.samples.start, header.samples.end, header.share);
        if self.is_partial() && before != (settings.skip, settings.spp, settings.share) {
            return Err(ExtentError(format!("{} is of another part of the image", stored.path.display())));
        }
        (settings.skip, settings.spp, settings.share) = before;
        // The sample range of a part follows from `--spp` of the whole image, so only whole images can be extended
        if let Some(more) = more.filter(|n| !self.is_partial() && *n != header.samples.end) {
            let done = stored.tiles.iter().map(|t| t.done).chain(stored.cells.end()).max().unwrap_or(0);
            if header.samples.start > 0 || more < done {
                let path = stored.path.display();
                return Err(ExtentError(format!(
                    "{path} cannot go on to {more} samples: it has {done}, of {} to {}",
                    before.0, before.1
                )));
            }
            settings.spp = more;
        }
        Ok(())
    }
}

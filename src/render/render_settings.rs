//! Parameters of a rendering.

use super::tile_share::TileShare;
use crate::direct::Estimator;
use crate::integrators::light_layers;
use crate::scene::RenderJob;
use crate::settings::Settings;
use std::time::Duration;

/// Parameters of a rendering. Only the sample range affects the image.
#[derive(Clone, Copy, Debug)]
pub struct RenderSettings {
    /// Threads; all cores if `None`.
    pub threads: Option<usize>,
    /// Edge of a tile in pixels.
    pub tile_size: u32,
    /// First sample index.
    pub first_sample: u32,
    /// Samples per pixel, from `first_sample` on.
    pub spp: u32,
    /// Number of samples at the beginning of the range that are skipped, because another part renders them. Must be 0
    /// for estimators that are fitted to earlier samples.
    pub skip: u32,
    /// Pixels to render; all if `None`.
    pub share: Option<TileShare>,
    /// No tile starts after this time. Tiles without any sample may start up to half a second later, or 3 % of the
    /// limit if that is longer.
    pub time_limit: Option<Duration>,
    /// True to estimate some pixels twice, which gives the variance of pixel means; see [`crate::film::replicas`].
    pub with_replicas: bool,
    /// True if the film stores features of the first surfaces: albedo, normal, depth, material and object.
    pub with_features: bool,
    /// True if the film stores the layers of light groups.
    pub with_light_layers: bool,
}

impl Default for RenderSettings {
    fn default() -> Self {
        RenderSettings {
            threads: None,
            tile_size: 16,
            first_sample: 0,
            spp: 1,
            skip: 0,
            share: None,
            time_limit: None,
            with_replicas: false,
            with_features: true,
            with_light_layers: true,
        }
    }
}

impl RenderSettings {
    /// Names of the light-group layers that the film stores.
    pub(in crate::render) fn light_layers<'a>(&self, job: &'a RenderJob) -> &'a [String] {
        if self.with_light_layers { light_layers::names(job) } else { &[] }
    }
}

/// True if the samples of a pixel depend on earlier ones. Such an image cannot be divided into ranges of samples.
pub fn depends_on_earlier_samples(settings: &Settings) -> bool {
    Estimator::at_vertex(&settings.integrator, 0).is_progressive()
}

//! The film: sums per pixel, for means, variances and AOVs.
//!
//! Pixel filters are importance-sampled: a sample belongs to one pixel, and its weight is the sign of the filter
//! ([`filter`]). Samples ([`pixel`]) are added to exact sums ([`fixed_sums`], [`accumulator`]), so that the film does
//! not depend on their order and division. In memory, [`packed`] compresses the sums of a tile, and [`light_layers`]
//! the sums of light groups; [`encoding`] compresses both in files. `tiled_film` holds the film. [`variance`] estimates
//! the variance of pixel means by [`replicas`], [`image_noise`] the noise of the image, and [`summary`] has both with
//! the numbers of samples.

pub mod accumulator;
pub mod encoding;
pub mod filter;
pub mod fixed_sums;
pub mod image_noise;
pub mod light_layers;
pub mod packed;
pub mod pixel;
pub mod pixel_bounds;
pub mod replicas;
pub mod summary;
mod tiled_film;
pub mod variance;
mod variance_scale;

pub use pixel::{FeatureSet, Features, PixelSample, PixelSums};
pub use pixel_bounds::PixelBounds;
pub use summary::Summary;
pub use tiled_film::{BAND, Film, FilmTile, LayerPixel};

//! Metrics of the difference between an image and its reference: numbers for the image, maps for the pixels.
//!
//! Images are linear Rec.709 radiance, row-major from the top left. **Pixels that are not finite in either image are
//! excluded from all means.** [`Differences`] counts them, maps are NaN there, and ꟻLIP treats them as black in both
//! images.
//!
//! Reading order: `pixels`, [`difference`] (MSE, relative MSE, PSNR), [`mod@bias`], [`mod@significance`] (z-tests),
//! [`perceptual`] (visual thresholds), [`flip`].

pub mod bias;
pub mod difference;
pub mod flip;
pub mod perceptual;
mod pixels;
pub mod significance;

pub use bias::{Bias, ErrorSource, bias};
pub use difference::{Differences, differences};
pub use flip::{DEFAULT_PIXELS_PER_DEGREE, HdrFlip, hdr_flip, ldr_flip};
pub use perceptual::{perceptual_error, perceptual_map, tvi};
pub use pixels::{Pixel, mean_of_map};
pub use significance::{Significance, significance, z_map};

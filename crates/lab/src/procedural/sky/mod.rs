//! An environment map of sun and sky by an own atmosphere model, with optional broken clouds.
//!
//! The map is the equal-area octahedral one of pbrt-v4 (z up). Below the horizon is a Lambertian ground. The sun is a
//! disc of the angular radius a = 0.2665° times [`SkyOptions::sun_size`]. Its radiance decreases towards the rim as (1
//! − (γ/a)²)^(α/2), α = −0.023 + 0.292 µm/λ [Hestroffer and Magnan 1998], and integrates to the sun's irradiance for
//! any size. Texels that the disc may overlap are means over 64² points. Finally everything is multiplied by a common
//! factor, so that an unoccluded horizontal surface has the requested irradiance (luminance).
//!
//! Reading order: [`spectrum`], [`atmosphere`], [`clouds`], `options`, `sun_disc`, `view_table`, `map`.

pub mod atmosphere;
pub mod clouds;
mod map;
mod options;
pub mod spectrum;
mod sun_disc;
mod view_table;

pub use map::sky;
pub use options::SkyOptions;

//! Cameras: generate a ray from a film position, a lens sample and a time.
//!
//! Camera space is as in pbrt: x right, y up, z forward. The camera transform may reflect and scale. Raster coordinates
//! have their origin at the upper left, one unit per pixel, y down. The screen window `[x0, x1, y0, y1]` is the part of
//! the screen covered by the film; by default it spans −1..1 on the shorter axis.
//!
//! `camera` has all kinds, `lens_system` the lenses of the realistic one, and `matrices` the attributes of OpenEXR.

mod camera;
mod lens_system;
mod matrices;

pub use camera::{Camera, CameraBase, CameraRay, Lens, Projection, SphericalMapping, default_screen_window};
pub use lens_system::{Aperture, LensElement, LensSystem};

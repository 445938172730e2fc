//! Light transport: from camera rays to radiance.

pub mod path;

pub use path::{PathIntegrator, PathStats};

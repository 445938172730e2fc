//! A scene owns everything that is rendered, in vectors. References are indices.
//!
//! [`Scene`] (`input`) is the data from an importer. [`World`] is a scene with its ray tracers. [`RenderJob`] is a
//! world with its render settings and the data derived from both.

mod input;
mod job;
mod pixel_samples;
mod sample_count_map;
mod surface_interaction;
mod surface_interactions;
mod world;

pub use input::{Choices, FilmSettings, Scene, Surface};
pub use job::RenderJob;
pub use pixel_samples::PixelSamples;
pub use sample_count_map::SampleCountMap;
pub use surface_interaction::{RayHit, SurfaceInteraction};
pub use surface_interactions::SurfaceInteractions;
pub use world::{AccelKind, EmitterHit, EmitterScratch, World};

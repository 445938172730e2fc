//! glTF 2.0: containers, checked JSON, buffers and accessors. What they mean is decided by the renderer.
//!
//! The crate `gltf` checks the form of the JSON and all indices; whether accessors lie inside their buffers is checked
//! here, before anything is read or allocated. Errors name the place in the JSON, or the byte of the container.
//!
//! Reading order: [`container`], [`place`], [`document`], [`accessor`].

pub mod accessor;
pub mod container;
pub mod document;
pub mod place;

pub use document::{Document, GltfError};
pub use place::Place;

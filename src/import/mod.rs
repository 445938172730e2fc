//! From scene files to scenes: the semantics of pbrt's directives ([`pbrt`]) and of glTF ([`gltf`]). They name images,
//! meshes, textures of faces, volumes and measured materials ([`resources`], [`images`], [`face_maps`], [`volumes`],
//! [`measured`]), which the scenes of an animation share ([`cache`]). Pyramids of images can be kept for later runs
//! ([`texture_cache`]). A [`fingerprint`] identifies a scene. [`load()`] takes files of both formats, with
//! [`LoadOptions`], and returns a [`Loaded`] scene.
//!
//! The files themselves are parsed by the crate `lumiris_formats`. User input never panics: problems are collected,
//! with their source locations, in [`lumiris_formats::diagnostic::Diagnostics`]. A scene that exceeds a limit of memory
//! is refused before its files are read ([`memory`]).

pub mod cache;
pub mod face_maps;
pub mod fingerprint;
pub mod gltf;
pub mod images;
mod light_units;
mod load;
mod load_options;
mod loaded;
pub mod measured;
pub mod memory;
pub mod pbrt;
pub mod resources;
pub mod texture_cache;
pub mod volumes;

pub use load::{is_gltf, load, load_text, load_with};
pub use load_options::LoadOptions;
pub use loaded::Loaded;

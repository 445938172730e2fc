//! The pbrt-v4 scene format.
//!
//! Reading order: [`descriptions`] (the scene's content), [`state`] (the scene during parsing), [`checks`]; a file for
//! each kind of directive: [`transform`], [`options`], [`settings`], [`film`], [`spectrum`], `texture_names`,
//! [`textures`], `ptex`, [`materials`], `hair`, `measured`, [`lights`], `image_lights`, [`media`] with `media_presets`
//! and `volumes`, `curves`, [`shapes`]; [`directives`] (the state machine over `lumiris_formats::pbrt`'s directives);
//! `resolve` (names that may be used before their definition); `files`, `make_shapes`, `layout`, `instances` and
//! `assembly` (geometry from descriptions and files); and [`finish`] (the steps from the read text to the scene).

mod assembly;
pub mod checks;
mod curves;
pub mod descriptions;
pub mod directives;
mod files;
pub mod film;
pub mod finish;
mod hair;
mod image_lights;
mod instances;
mod layout;
mod lenses;
pub mod lights;
mod make_shapes;
pub mod materials;
mod measured;
pub mod media;
mod media_presets;
mod memory;
pub mod options;
mod principled;
mod ptex;
mod resolve;
pub mod settings;
pub mod shapes;
pub mod spectrum;
pub mod state;
mod subsurface;
mod texture_names;
pub mod textures;
pub mod transform;
mod volumes;

#[cfg(test)]
mod scene_tests;
#[cfg(test)]
mod tests;

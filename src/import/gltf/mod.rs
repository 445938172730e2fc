//! glTF 2.0 scenes. For emissive surfaces, 1 cd/m² is a radiance of 1; [`LightUnits`] defines the units of punctual
//! lights. Single-sided surfaces are rendered from both sides.
//!
//! Reading order: [`choice`], [`textures`], [`materials`], [`animation`], [`nodes`], [`vertices`], [`pose`],
//! [`meshes`], [`extent`], [`view`], [`assemble`], [`mod@load`]; [`messages`].

mod animation;
mod assemble;
mod choice;
mod extent;
mod load;
mod materials;
mod meshes;
mod messages;
mod nodes;
mod pose;
mod textures;
mod vertices;
mod view;

pub use super::light_units::{LUMENS_PER_WATT, LightUnits};
pub use load::load;

//! Materials: evaluate textures at a hit and build the BSDF in its shading frame. The semantics are those of pbrt-v4.
//! [`SurfaceInteraction::scatter`](crate::scene::SurfaceInteraction::scatter) calls [`MaterialSet::bsdf`] at each hit.
//!
//! Reading order: [`parameters`], [`dispersion`], [`evaluated`], [`hair`], [`principled`], [`material`] (all kinds),
//! [`shading_frame`] (normal maps, bumps), [`surface_bsdf`], [`material_set`]; [`half_space`] computes the reflectance
//! of an interior.

pub mod dispersion;
pub mod evaluated;
pub mod hair;
pub mod half_space;
pub mod material;
pub mod material_set;
pub mod parameters;
pub mod principled;
pub mod shading_frame;
pub mod surface_bsdf;

pub use dispersion::Dispersion;
pub use evaluated::EvaluatedMaterial;
pub use hair::{HairColor, HairMaterial};
pub use half_space::HalfSpace;
pub use material::{Material, MaterialEntry, MaterialId, NormalMap};
pub use material_set::MaterialSet;
pub use parameters::{Coat, ConductorSpectrum, Roughness};
pub use principled::PrincipledMaterial;
pub use surface_bsdf::SurfaceBsdf;

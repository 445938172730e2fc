//! BSDFs, each written once for three uses: a single direction, one BSDF with many directions, and many vertices.
//!
//! Directions are in the shading frame, n = +z. A kernel is a [`BsdfKernel`]; [`rows`] evaluates it over columns.
//! Two-sided BSDFs behave the same on both sides.
//!
//! Reading order: `bsdf_kernel`, [`fresnel`], [`facets`], [`diffuse`], [`diffuse_transmission`], [`conductor`],
//! [`dielectric`], [`thin_dielectric`], [`coated`], [`albedo`], [`sheen`], [`principled`], `kernel`, [`rows`].

pub mod albedo;
mod bsdf_kernel;
pub mod coated;
pub mod conductor;
pub mod dielectric;
pub mod diffuse;
pub mod diffuse_transmission;
pub mod facets;
pub mod fresnel;
mod kernel;
pub mod principled;
pub mod rows;
pub mod sheen;
pub mod thin_dielectric;

pub use bsdf_kernel::{BsdfKernel, Drawn, GreyValue, Value, lobe};
pub use coated::{Coated, SmoothCoated};
pub use conductor::Conductor;
pub use dielectric::{Dielectric, Exit};
pub use diffuse::Diffuse;
pub use diffuse_transmission::DiffuseTransmission;
pub use kernel::{Kernel, MAX_PARAMS};
pub use principled::Principled;
pub use rows::{Directions, One, Rows, Values, evaluate, evaluate_one, sample};
pub use thin_dielectric::ThinDielectric;

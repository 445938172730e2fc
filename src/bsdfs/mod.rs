//! Scattering at surfaces. In the local frame n = +z, `wo` points to the viewer and `wi` to the light, both unit and
//! away from the surface. The models are those of pbrt-v4 [Pharr et al. 2023, ch. 9 and 14]. f of transmission is for
//! radiance, so it includes the factor 1/η².
//!
//! Reading order: [`lobe`], [`fresnel`], [`microfacet`], [`kernel`], [`diffuse`], [`diffuse_transmission`],
//! [`conductor`], [`dielectric`], [`thin_dielectric`], [`coat_table`], [`coated_diffuse`], [`layered`], [`sheen`],
//! [`principled`], [`hair`], [`measured`]; [`phase`] in media; BSDFs that can only be evaluated: [`models`],
//! [`default_lobes`], [`evaluated`], [`mod@resample`]; then `bsdf`, the type that stands for all of them.

mod bsdf;
pub mod coat_table;
pub mod coated_diffuse;
pub mod conductor;
pub mod default_lobes;
pub mod dielectric;
pub mod diffuse;
pub mod diffuse_transmission;
pub mod evaluated;
pub mod fresnel;
pub mod hair;
pub mod kernel;
pub mod layered;
pub mod lobe;
pub mod measured;
pub mod microfacet;
pub mod models;
pub mod phase;
pub mod principled;
pub mod resample;
pub mod sheen;
#[cfg(test)]
mod tests;
pub mod thin_dielectric;

pub use bsdf::{Bsdf, Lambertian, MAX_LOBES};
pub use coat_table::CoatTable;
pub use coated_diffuse::CoatedDiffuse;
pub use conductor::{ComplexIor, Conductor};
pub use default_lobes::ProposalDensity;
pub use dielectric::Dielectric;
pub use diffuse::Diffuse;
pub use diffuse_transmission::DiffuseTransmission;
pub use evaluated::Evaluated;
pub use hair::Hair;
pub use kernel::KernelBsdf;
pub use layered::{Base, Layered};
pub use lobe::{BsdfSample, BsdfValue, Lobe, LobeWidth};
pub use measured::{Measured, MeasuredTables};
pub use microfacet::TrowbridgeReitz;
pub use models::Model;
pub use phase::Phase;
pub use principled::Principled;
pub use resample::{Resampled, resample};
pub use thin_dielectric::ThinDielectric;

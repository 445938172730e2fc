//! The list of kernels.

use super::bsdf_kernel::BsdfKernel;
use super::coated::{Coated, SmoothCoated};
use super::conductor::Conductor;
use super::dielectric::{Dielectric, Exit};
use super::diffuse::Diffuse;
use super::diffuse_transmission::DiffuseTransmission;
use super::principled::{self, Principled};
use super::thin_dielectric::ThinDielectric;

/// Largest number of parameters of a kernel.
pub const MAX_PARAMS: usize = principled::PARAMS;

/// The kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kernel {
    /// Lambertian reflection.
    Diffuse,
    /// Lambertian reflection and transmission.
    DiffuseTransmission,
    /// Metal.
    Conductor,
    /// Glass.
    Dielectric,
    /// Refraction only.
    Exit,
    /// A sheet of glass.
    ThinDielectric,
    /// Lambertian base under a rough coat.
    Coated,
    /// Lambertian base under a smooth coat.
    SmoothCoated,
    /// Metal, glossy diffuse or glass, under a coat.
    Principled,
}

impl Kernel {
    /// Number of parameters.
    pub fn params(self) -> usize {
        match self {
            Kernel::Diffuse => Diffuse::PARAMS,
            Kernel::DiffuseTransmission => DiffuseTransmission::PARAMS,
            Kernel::Conductor => Conductor::PARAMS,
            Kernel::Dielectric => Dielectric::PARAMS,
            Kernel::Exit => Exit::PARAMS,
            Kernel::ThinDielectric => ThinDielectric::PARAMS,
            Kernel::Coated => Coated::PARAMS,
            Kernel::SmoothCoated => SmoothCoated::PARAMS,
            Kernel::Principled => Principled::PARAMS,
        }
    }
}

//! Lambertian reflection, see [`kernels::diffuse`].

use super::kernel::KernelBsdf;
use lumiris_lanes::kernels;
use lumiris_numbers::math::Rgb;

/// Lambertian reflection, on both sides of the surface.
#[derive(Clone, Copy, Debug)]
pub struct Diffuse {
    /// Hemispherical albedo ρ.
    pub reflectance: Rgb,
}

impl KernelBsdf for Diffuse {
    type Formulas = kernels::Diffuse;
    type Params = [f32; 3];

    fn params(&self) -> [f32; 3] {
        self.reflectance.to_array()
    }
}

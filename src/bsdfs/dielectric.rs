//! Reflection and refraction at a dielectric interface, see [`kernels::dielectric`].

use super::kernel::{KernelBsdf, of_drawn};
use super::lobe::BsdfSample;
use super::microfacet::TrowbridgeReitz;
use lumiris_lanes::kernels::dielectric::Interface;
pub use lumiris_lanes::kernels::dielectric::{Select, Transport};
use lumiris_lanes::kernels::{self, GreyValue};
use lumiris_numbers::math::Vec3;

/// Interface between the outside (+z) and a dielectric (−z).
#[derive(Clone, Copy, Debug)]
pub struct Dielectric {
    /// Index of refraction on the −z side relative to the +z side.
    pub eta: f32,
    /// Microfacets.
    pub distribution: TrowbridgeReitz,
}

impl Dielectric {
    /// True if all scattering is specular.
    #[inline]
    pub fn is_specular(&self) -> bool {
        self.interface().is_specular()
    }

    #[inline]
    fn interface(&self) -> Interface<f32> {
        Interface::new(&self.params())
    }

    /// Value without cosine (1/sr); 0 if specular.
    pub fn value(&self, wo: Vec3, wi: Vec3, transport: Transport) -> f32 {
        let GreyValue { f_cos, .. } = self.interface().evaluate(wo.into(), wi.into(), Select::All, transport);
        if wi.z == 0.0 { 0.0 } else { f_cos / wi.z.abs() }
    }

    /// Density of [`Self::sample_select`] per steradian; 0 if specular.
    pub fn pdf_select(&self, wo: Vec3, wi: Vec3, select: Select) -> f32 {
        self.interface().evaluate(wo.into(), wi.into(), select, Transport::Radiance).pdf
    }

    /// [`Self::sample`] restricted to the selected lobes.
    pub fn sample_select(
        &self,
        wo: Vec3,
        uc: f32,
        u: [f32; 2],
        transport: Transport,
        select: Select,
    ) -> Option<BsdfSample> {
        of_drawn(self.interface().sample(wo.into(), [uc, u[0], u[1]], select, transport))
    }
}

impl KernelBsdf for Dielectric {
    type Formulas = kernels::Dielectric;
    type Params = [f32; 3];

    fn params(&self) -> [f32; 3] {
        [self.eta, self.distribution.alpha_x, self.distribution.alpha_y]
    }
}

//! A thin dielectric sheet without refraction, see [`kernels::thin_dielectric`].

use super::kernel::KernelBsdf;
use lumiris_lanes::kernels;

/// Thin sheet: mirror reflection and straight transmission.
#[derive(Clone, Copy, Debug)]
pub struct ThinDielectric {
    /// Index of refraction of the sheet relative to both sides.
    pub eta: f32,
}

impl KernelBsdf for ThinDielectric {
    type Formulas = kernels::ThinDielectric;
    type Params = [f32; 1];

    fn params(&self) -> [f32; 1] {
        [self.eta]
    }
}

//! Coefficients of a medium at a point.

use lumiris_numbers::math::Rgb;

/// A medium at a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coefficients {
    /// Absorption (1/m).
    pub sigma_a: Rgb,
    /// Scattering (1/m).
    pub sigma_s: Rgb,
    /// Emitted radiance L_e; the emission per unit length is σ_a·L_e.
    pub le: Rgb,
}

//! Scene-independent numerics: vectors, frames, colour, warps, distributions, rays.
//!
//! Conventions of the whole program: `wo` points to the viewer and `wi` to the light, both unit and away from the
//! surface; the shading frame has n = +z; transforms are named `to_from`; colour is linear Rec.709; angles are in
//! radians; light is in f32.
//!
//! Reading order: [`rgb`], [`frame`], [`transform`], [`origin`], [`ray`], [`bounds`], [`warp`], [`sphere_map`], [`octahedral`],
//! [`cumulative`], [`distribution`], [`texel_distribution`], [`bilinear`], [`alias`], [`hash`], [`noise`],
//! [`number`], [`v3`], [`elementary`], [`light_bound`].

pub mod alias;
pub mod bilinear;
pub mod bounds;
pub mod cumulative;
pub mod distribution;
pub mod elementary;
pub mod frame;
pub mod hash;
pub mod light_bound;
pub mod noise;
pub mod number;
pub mod octahedral;
pub mod origin;
pub mod ray;
pub mod rgb;
pub mod sphere_map;
pub mod texel_distribution;
pub mod transform;
pub mod v3;
pub mod warp;

pub use alias::{AliasTable, DiscreteSample};
pub use bilinear::{BilinearTables, Blend, ParameterGrid, PiecewiseBilinear2D};
pub use bounds::Bounds3;
pub use distribution::{PiecewiseConstant1D, PiecewiseConstant2D, Sample1D, Sample2D};
pub use frame::Frame;
pub use glam::{
    Affine3A, DAffine3, DMat3, DMat4, DQuat, DVec2, DVec3, Mat3, Mat3A, Mat4, Quat, Vec2, Vec3, Vec3A, Vec4,
};
pub use ray::Ray;
pub use rgb::{Rgb, luminance};
pub use texel_distribution::TexelDistribution;

/// Largest f32 below one; random numbers are clamped to it so that `u < 1` holds after arithmetic.
pub const ONE_MINUS_EPSILON: f32 = 1.0 - f32::EPSILON / 2.0;

/// `x²`.
#[inline]
pub fn sqr(x: f32) -> f32 {
    x * x
}

/// `sqrt(max(x, 0))`: for expressions that are non-negative except for rounding.
#[inline]
pub fn safe_sqrt(x: f32) -> f32 {
    x.max(0.0).sqrt()
}

/// Bound of the relative rounding error of `n` chained f32 operations,
/// γₙ = nε/(1 − nε), ε = 2⁻²⁴ [Higham 2002; Pharr et al. 2023, §6.8.1].
#[inline]
pub const fn gamma(n: u32) -> f32 {
    let n_eps = n as f32 * (f32::EPSILON * 0.5);
    n_eps / (1.0 - n_eps)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn helpers_have_the_values_of_their_definitions() {
        assert_eq!((sqr(-3.0), safe_sqrt(9.0), safe_sqrt(-1e-9)), (9.0, 3.0, 0.0));
        assert!(ONE_MINUS_EPSILON < 1.0 && ONE_MINUS_EPSILON.next_up() == 1.0);
        // γ₃ = 3·2⁻²⁴/(1 − 3·2⁻²⁴), which rounds to the f32 above 3·2⁻²⁴ for many operations
        let exact = |n: f64| n * 0.5_f64.powi(24) / (1.0 - n * 0.5_f64.powi(24));
        for n in [1, 3, 7, 4_000_000] {
            assert!((f64::from(gamma(n)) / exact(f64::from(n)) - 1.0).abs() < 1e-6, "{n}");
        }
    }
}

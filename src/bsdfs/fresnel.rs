//! Reflection, refraction and the Fresnel reflectance of smooth interfaces for single directions, see
//! [`lumiris_lanes::kernels::fresnel`].
//!
//! η is the index of refraction on the side of `-n`, relative to the side of `+n`.

use lumiris_lanes::kernels::fresnel;
pub use lumiris_lanes::kernels::fresnel::{fr_complex, fr_dielectric};
use lumiris_numbers::math::{Rgb, Vec3};

/// Reflection of `w` about `n`; both point away from the surface.
#[inline]
pub fn reflect(w: Vec3, n: Vec3) -> Vec3 {
    fresnel::reflect(w.into(), n.into()).into()
}

/// A refracted direction.
#[derive(Clone, Copy, Debug)]
pub struct Refraction {
    /// The direction.
    pub w: Vec3,
    /// η along the path: the given one, or its inverse for a direction from the side of `-n`.
    pub eta: f32,
}

/// Refraction of `w` at a surface with normal `n`. `None` for total internal reflection.
#[inline]
pub fn refract(w: Vec3, n: Vec3, eta: f32) -> Option<Refraction> {
    let fresnel::Refracted { wi: refracted, inverse_eta: inverse, passes } = fresnel::refract(w.into(), n.into(), eta);
    passes.then(|| Refraction { w: refracted.into(), eta: 1.0 / inverse })
}

/// [`fr_complex`] of each channel.
#[inline]
pub fn fr_conductor(cos_i: f32, eta: Rgb, k: Rgb) -> Rgb {
    Rgb::new(fr_complex(cos_i, eta.r, k.r), fr_complex(cos_i, eta.g, k.g), fr_complex(cos_i, eta.b, k.b))
}

/// Both directions mirrored to the upper hemisphere, by the symmetry of the surface; `None` if they are on different
/// sides.
#[inline]
pub(super) fn to_upper(wo: Vec3, wi: Vec3) -> Option<[Vec3; 2]> {
    if wo.z * wi.z <= 0.0 {
        None
    } else if wo.z < 0.0 {
        Some([-wo, -wi])
    } else {
        Some([wo, wi])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_numbers::math::{safe_sqrt, sqr};

    #[test]
    fn normal_incidence_has_its_closed_form() {
        assert!((fr_dielectric(1.0, 1.5) - 0.04).abs() < 1e-6);
        assert!((fr_dielectric(-1.0, 1.5) - 0.04).abs() < 1e-6);
        let (eta, k) = (0.2_f32, 3.0_f32);
        let expected = (sqr(eta - 1.0) + sqr(k)) / (sqr(eta + 1.0) + sqr(k));
        assert!((fr_complex(1.0, eta, k) - expected).abs() < 1e-6);
    }

    #[test]
    fn complex_without_absorption_is_dielectric() {
        for i in 0..=1000 {
            let c = i as f32 / 1000.0;
            for eta in [1.0, 1.1, 1.5, 2.4] {
                let (a, b) = (fr_complex(c, eta, 0.0), fr_dielectric(c, eta));
                assert!((a - b).abs() < 3e-4, "{c} {eta} {a} {b}");
            }
        }
    }

    #[test]
    fn fresnel_is_symmetric_along_a_refracted_path_and_total_beyond_the_critical_angle() {
        for i in 1..100 {
            let cos_i = i as f32 / 100.0;
            let w = Vec3::new(safe_sqrt(1.0 - cos_i * cos_i), 0.0, cos_i);
            let Refraction { w: t, eta } = refract(w, Vec3::Z, 1.5).unwrap();
            assert!((t.length() - 1.0).abs() < 1e-5 && t.z < 0.0 && eta == 1.5);
            assert!((t.x + w.x / 1.5).abs() < 1e-6);
            assert!((fr_dielectric(cos_i, 1.5) - fr_dielectric(t.z, 1.5)).abs() < 1e-4);
            let Refraction { w: back, eta } = refract(t, Vec3::Z, 1.5).unwrap();
            assert!((back - w).length() < 1e-3 && (eta * 1.5 - 1.0).abs() < 1e-6);
        }
        assert_eq!(fr_dielectric(-0.5, 1.5), 1.0);
        assert!(refract(Vec3::new(0.866, 0.0, -0.5), Vec3::Z, 1.5).is_none());
    }
}

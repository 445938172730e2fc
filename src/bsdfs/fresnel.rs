//! Reflection, refraction and the Fresnel reflectance of smooth interfaces, unpolarised [Born and Wolf 1999, §1.5].
//!
//! η is the index of refraction of the side that `-n` points to, relative to the side that `+n` points to.

use lumiris_numbers::math::{Rgb, Vec3, safe_sqrt, sqr};

/// Mirror of `w` about `n`; both point away from the surface.
#[inline]
pub fn reflect(w: Vec3, n: Vec3) -> Vec3 {
    n * (2.0 * w.dot(n)) - w
}

/// Direction to which `w` refracts at a surface with normal `n`, and η along that path (`eta`, or its inverse if `w`
/// lies on the side of `-n`). `None` at total internal reflection.
#[inline]
pub fn refract(w: Vec3, n: Vec3, eta: f32) -> Option<(Vec3, f32)> {
    let cos_i = w.dot(n);
    let (cos_i, eta, n) = if cos_i < 0.0 { (-cos_i, 1.0 / eta, -n) } else { (cos_i, eta, n) };
    let sin2_t = (1.0 - sqr(cos_i)).max(0.0) / sqr(eta);
    if sin2_t >= 1.0 {
        return None;
    }
    let cos_t = safe_sqrt(1.0 - sin2_t);
    Some((w * (-1.0 / eta) + n * (cos_i / eta - cos_t), eta))
}

/// Reflectance of a dielectric interface for the cosine of incidence `cos_i`, which is negative for light that comes
/// from the side of `-n`. 1 at total internal reflection.
#[inline]
pub fn fr_dielectric(cos_i: f32, eta: f32) -> f32 {
    let (cos_i, eta) = if cos_i < 0.0 { (-cos_i, 1.0 / eta) } else { (cos_i, eta) };
    let cos_i = cos_i.min(1.0);
    let sin2_t = (1.0 - sqr(cos_i)) / sqr(eta);
    if sin2_t >= 1.0 {
        return 1.0;
    }
    let cos_t = safe_sqrt(1.0 - sin2_t);
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    0.5 * (sqr(parallel) + sqr(perpendicular))
}

/// Reflectance of an interface to an absorbing medium of complex index η + ik.
#[inline]
pub fn fr_complex(cos_i: f32, eta: f32, k: f32) -> f32 {
    let cos_i = cos_i.clamp(0.0, 1.0);
    let (cos2, eta2, k2) = (sqr(cos_i), sqr(eta), sqr(k));
    let sin2 = 1.0 - cos2;

    // a² + b² and a of the refracted wave vector a + ib.
    let t0 = eta2 - k2 - sin2;
    let a2_plus_b2 = safe_sqrt(sqr(t0) + 4.0 * eta2 * k2);
    let a = safe_sqrt(0.5 * (a2_plus_b2 + t0));
    let t1 = a2_plus_b2 + cos2;
    let t2 = 2.0 * a * cos_i;
    let t3 = cos2 * a2_plus_b2 + sqr(sin2);
    let t4 = t2 * sin2;
    // Only at grazing incidence on no interface at all (η = 1, k = 0) do the sums vanish; reflect all as the limit
    // does.
    if t1 + t2 <= 0.0 || t3 + t4 <= 0.0 {
        return 1.0;
    }
    let perpendicular = (t1 - t2) / (t1 + t2);
    let parallel = perpendicular * (t3 - t4) / (t3 + t4);
    (0.5 * (perpendicular + parallel)).clamp(0.0, 1.0)
}

/// [`fr_complex`] of each channel.
#[inline]
pub fn fr_conductor(cos_i: f32, eta: Rgb, k: Rgb) -> Rgb {
    Rgb::new(fr_complex(cos_i, eta.r, k.r), fr_complex(cos_i, eta.g, k.g), fr_complex(cos_i, eta.b, k.b))
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let (t, eta) = refract(w, Vec3::Z, 1.5).unwrap();
            assert!((t.length() - 1.0).abs() < 1e-5 && t.z < 0.0 && eta == 1.5);
            assert!((t.x + w.x / 1.5).abs() < 1e-6);
            assert!((fr_dielectric(cos_i, 1.5) - fr_dielectric(t.z, 1.5)).abs() < 1e-4);
            let (back, eta) = refract(t, Vec3::Z, 1.5).unwrap();
            assert!((back - w).length() < 1e-3 && (eta * 1.5 - 1.0).abs() < 1e-6);
        }
        assert_eq!(fr_dielectric(-0.5, 1.5), 1.0);
        assert!(refract(Vec3::new(0.866, 0.0, -0.5), Vec3::Z, 1.5).is_none());
    }
}

//! Sheen: fibres that stand on a surface, as of velvet, by facets whose normals lie near it [Estevez and Kulla 2017].
//!
//! D(m) = (2 + 1/α) sin^(1/α) θ / 2π, with the shadowing G = 1/(1 + Λ(wo) + Λ(wi)) that the authors fitted. The albedo
//! E(μ) of a white sheen is tabulated. A sheen of colour c is above what is below as in glTF's `KHR_materials_sheen`:
//! 1 − max(c) max(E(wo), E(wi)) of that is left, which is reciprocal and never more than what the sheen leaves.

use super::ggx_albedo::place;
use lumiris_numbers::math::{Rgb, Vec3, warp};
use std::f32::consts::{PI, TAU};
use std::sync::LazyLock;

/// The least α. Below, sheen is seen from the last tenth of a degree alone.
pub const LEAST_ALPHA: f32 = 0.005;
/// Cosines of the table, evenly spaced in √μ.
const COSINES: usize = 32;
/// Roughnesses of the table, evenly spaced in √α.
const ROUGHNESSES: usize = 24;
/// Polar and azimuth angles of each entry.
const ANGLES: [usize; 2] = [64, 32];

/// A layer of sheen.
#[derive(Clone, Copy, Debug)]
pub struct Sheen {
    /// Its colour; black is none.
    pub color: Rgb,
    /// Its roughness, from [`LEAST_ALPHA`] to 1.
    pub alpha: f32,
}

impl Sheen {
    /// True if there is any.
    pub fn exists(&self) -> bool {
        !self.color.is_black()
    }

    /// Value without cosine (1/sr) of two directions on the same side, both with z > 0.
    pub(super) fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        self.color * white(wo, wi, self.alpha)
    }

    /// What is left of what is below, for cosines of any sign.
    pub(super) fn passes(&self, cos_o: f32, cos_i: f32) -> f32 {
        let albedo = |cos: f32| albedo(cos.abs(), self.alpha);
        1.0 - self.color.max_component() * albedo(cos_o).max(albedo(cos_i))
    }

    /// Albedo, the mean of the colours.
    pub(super) fn albedo(&self, cos: f32) -> f32 {
        self.color.average() * albedo(cos.abs(), self.alpha)
    }
}

/// D G/(4 cos θo cos θi).
fn white(wo: Vec3, wi: Vec3, alpha: f32) -> f32 {
    let m = (wo + wi).normalize_or(Vec3::Z);
    let sin2 = (1.0 - m.z * m.z).max(0.0);
    let g = 1.0 / (1.0 + lambda(wo.z, alpha) + lambda(wi.z, alpha));
    density(sin2, alpha) * g / (4.0 * wo.z * wi.z)
}

/// D of a normal by the square of the sine of its polar angle.
fn density(sin2: f32, alpha: f32) -> f32 {
    (2.0 + 1.0 / alpha) * sin2.powf(0.5 / alpha) / TAU
}

/// Λ of a cosine > 0.
fn lambda(cos: f32, alpha: f32) -> f32 {
    // The fits for α = 1 and α → 0
    const FITS: [[f32; 2]; 5] =
        [[21.5473, 25.3245], [3.82987, 3.32435], [0.19823, 0.16801], [-1.97760, -1.27393], [-4.32054, -4.85967]];
    let t = (1.0 - alpha) * (1.0 - alpha);
    let [a, b, c, d, e] = FITS.map(|[rough, smooth]| rough + (smooth - rough) * t);
    let l = |x: f32| a / (1.0 + b * x.powf(c)) + d * x + e;
    if cos < 0.5 { l(cos).exp() } else { (2.0 * l(0.5) - l(1.0 - cos)).exp() }
}

static TABLE: LazyLock<Vec<[f32; COSINES]>> = LazyLock::new(|| {
    let alpha = |row: usize| (row as f32 / (ROUGHNESSES - 1) as f32).powi(2).max(LEAST_ALPHA);
    let entry = |row: usize, column: usize| integrate((column as f32 / (COSINES - 1) as f32).powi(2), alpha(row));
    (0..ROUGHNESSES).map(|row| std::array::from_fn(|column| entry(row, column))).collect()
});

/// E(μ), from the table.
fn albedo(mu: f32, alpha: f32) -> f32 {
    let ((row, t), (column, s)) = (place(alpha.sqrt(), ROUGHNESSES), place(mu.sqrt(), COSINES));
    let of_row = |row: usize| TABLE[row][column] + (TABLE[row][column + 1] - TABLE[row][column]) * s;
    of_row(row) + (of_row(row + 1) - of_row(row)) * t
}

/// ∫ f cos θi over the hemisphere, by the midpoint rule in √cos θi, in which what grazes has more points, and the azimuth.
fn integrate(mu: f32, alpha: f32) -> f32 {
    let wo = warp::direction(mu.max(1e-3), 0.0);
    let [polar, azimuth] = ANGLES.map(|n| n as f32);
    let mut sum = 0.0;
    for i in 0..ANGLES[0] {
        let x = (i as f32 + 0.5) / polar;
        for j in 0..ANGLES[1] {
            let phi = (j as f32 + 0.5) / azimuth * PI;
            sum += white(wo, warp::direction(x * x, phi), alpha) * x * x * 2.0 * x;
        }
    }
    (sum * TAU / (polar * azimuth)).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::random::{RngExt, pcg32};

    #[test]
    fn the_table_has_the_albedo_and_none_exceeds_one() {
        let mut s = pcg32([4, 5, 6]);
        for alpha in [0.04, 0.25, 0.5, 1.0] {
            for mu in [0.1, 0.3, 0.7, 1.0] {
                let wo = warp::direction(mu, 1.0);
                let n = 200_000;
                let mut sum = 0.0;
                for _ in 0..n {
                    let wi = warp::sample_cosine_hemisphere(s.random::<[f32; 2]>());
                    sum += if wi.z > 0.0 { f64::from(white(wo, wi, alpha) * PI) } else { 0.0 };
                }
                let (mean, tabulated) = (sum / f64::from(n), f64::from(albedo(mu, alpha)));
                assert!((mean - tabulated).abs() < 0.03 * mean + 0.002, "{alpha} {mu}: {mean} {tabulated}");
                assert!(mean < 1.0, "{alpha} {mu}: {mean}");
            }
        }
    }

    #[test]
    fn facets_cover_the_surface() {
        // ∫ D cos θ = 1, which D's factor is for
        for alpha in [0.1, 0.5, 1.0_f32] {
            let n = 20_000;
            let sum: f32 = (0..n)
                .map(|i| {
                    let theta = (i as f32 + 0.5) / n as f32 * 0.5 * PI;
                    density(theta.sin().powi(2), alpha) * theta.cos() * theta.sin() * TAU * 0.5 * PI / n as f32
                })
                .sum();
            assert!((sum - 1.0).abs() < 1e-3, "{alpha}: {sum}");
        }
    }
}

//! Sheen: fibres that stand on a surface, such as velvet, modelled by microfacets whose normals are near the horizon
//! [Estevez and Kulla 2017].
//!
//! D(m) = (2 + 1/α) sin^(1/α) θ / 2π, with the authors' fit of the shadowing G = 1/(1 + Λ(wo) + Λ(wi)). The albedo E(μ)
//! of a white sheen is tabulated. The layers below a sheen of colour c are scaled by 1 − max(c) max(E(wo), E(wi)), as
//! in glTF's `KHR_materials_sheen`. This is reciprocal, and never more than the energy left by the sheen.

use super::albedo::Place;
use lumiris_numbers::math::elementary::{exp, power_of_fraction};
use lumiris_numbers::math::number::Number;
use lumiris_numbers::math::v3::V3;
use lumiris_numbers::math::warp;
use std::f32::consts::{PI, TAU};
use std::sync::LazyLock;

/// Smallest α. Below it, sheen is visible only within a tenth of a degree of the horizon.
pub const LEAST_ALPHA: f32 = 0.005;
/// Cosines of the table, evenly spaced in √μ.
const COSINES: usize = 32;
/// Roughnesses of the table, evenly spaced in √α.
const ROUGHNESSES: usize = 24;
/// Polar and azimuth angles of each entry.
const ANGLES: [usize; 2] = [64, 32];
/// The fits of Λ for α = 1 and α → 0.
const FITS: [[f32; 2]; 5] =
    [[21.5473, 25.3245], [3.82987, 3.32435], [0.19823, 0.16801], [-1.97760, -1.27393], [-4.32054, -4.85967]];

/// D G/(4 cos θo), which is f·cos θi of a white sheen. Both directions are in the upper hemisphere.
#[inline(always)]
pub fn white<N: Number>(wo: V3<N>, wi: V3<N>, alpha: N) -> N {
    let (zero, one) = (alpha.constant(0.0), alpha.constant(1.0));
    let h = wo.plus(wi);
    let sin2 = (one - h.z * h.z / h.dot(h)).greater(zero);
    let g = one / (one + lambda(wo.z, alpha) + lambda(wi.z, alpha));
    density(sin2, alpha) * g * 0.25 / wo.z
}

/// D of a normal, given the squared sine of its polar angle.
#[inline(always)]
pub fn density<N: Number>(sin2: N, alpha: N) -> N {
    let inverse = alpha.constant(1.0) / alpha;
    (inverse + 2.0) * power_of_fraction(sin2, inverse * 0.5) * (1.0 / TAU)
}

/// Interpolates between the fits for α = 1 and α → 0.
#[inline(always)]
fn fitted<N: Number>(t: N, fit: [f32; 2]) -> N {
    t * (fit[1] - fit[0]) + fit[0]
}

/// ln Λ for cosines up to 1/2.
#[inline(always)]
fn log_lambda<N: Number>(x: N, t: N) -> N {
    let power = power_of_fraction(x, fitted(t, FITS[2]));
    fitted(t, FITS[0]) / (fitted(t, FITS[1]) * power + 1.0) + fitted(t, FITS[3]) * x + fitted(t, FITS[4])
}

/// Λ for a cosine > 0.
#[inline(always)]
fn lambda<N: Number>(cos: N, alpha: N) -> N {
    let (half, t) = (cos.constant(0.5), (-alpha + 1.0).squared());
    let is_low = half.above(cos);
    let of = log_lambda(N::choose(is_low, cos, -cos + 1.0), t);
    exp(N::choose(is_low, of, log_lambda(half, t) * 2.0 - of))
}

static TABLE: LazyLock<Vec<f32>> = LazyLock::new(|| {
    let entry = |i: usize| {
        let alpha = ((i / COSINES) as f32 / (ROUGHNESSES - 1) as f32).powi(2).max(LEAST_ALPHA);
        integrate(((i % COSINES) as f32 / (COSINES - 1) as f32).powi(2), alpha)
    };
    (0..ROUGHNESSES * COSINES).map(entry).collect()
});

/// E(μ), from the table.
#[inline(always)]
pub fn albedo<N: Number>(mu: N, alpha: N) -> N {
    Place::new(alpha.root(), ROUGHNESSES).between_rows(&TABLE, COSINES, Place::new(mu.root(), COSINES))
}

/// ∫ f cos θi over the hemisphere, by the midpoint rule in azimuth and in √cos θi, which has more points at grazing
/// angles.
fn integrate(mu: f32, alpha: f32) -> f32 {
    let wo = warp::direction(mu.max(1e-3), 0.0).into();
    let [polar, azimuth] = ANGLES.map(|n| n as f32);
    let mut sum = 0.0;
    for i in 0..ANGLES[0] {
        let x = (i as f32 + 0.5) / polar;
        for j in 0..ANGLES[1] {
            let phi = (j as f32 + 0.5) / azimuth * PI;
            sum += white(wo, warp::direction(x * x, phi).into(), alpha) * 2.0 * x;
        }
    }
    (sum * TAU / (polar * azimuth)).min(1.0)
}

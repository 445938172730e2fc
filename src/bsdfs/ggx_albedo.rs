//! Directional albedos of GGX reflection, tabulated, of which multiple scattering is made up.
//!
//! E(μ) is the albedo of a surface of facets that reflect everything, seen from the cosine μ; E₅(μ) that of facets whose
//! reflectance is (1 − wo·m)⁵. Facets of Schlick's reflectance F₀ + (F₉₀ − F₀)(1 − wo·m)⁵ then have F₀(E − E₅) + F₉₀E₅.
//! What E lacks of 1 is light that meets more than one facet. It comes back by [Kulla and Conty 2017]
//!
//! f_ms(wo, wi) = F_ms (1 − E(wo)) (1 − E(wi)) / (π (1 − Ē)),   F_ms = F̄² Ē/(1 − F̄ (1 − Ē)),   F̄ = F₀ + (F₉₀ − F₀)/21
//!
//! with Ē = 2∫E μ dμ. It is reciprocal, and with F = 1 no light is lost.

use super::TrowbridgeReitz;
use super::fresnel::reflect;
use lumiris_numbers::math::Vec3;
use std::sync::LazyLock;

/// Cosines of the table, evenly spaced in √μ.
const COSINES: usize = 32;
/// Roughnesses of the table, evenly spaced in √α.
const ROUGHNESSES: usize = 24;
/// Samples per axis of each entry.
const SAMPLES: usize = 24;

/// [E, E₅] by roughness and cosine, and their means over the hemisphere.
struct Table {
    directional: Vec<[[f32; 2]; COSINES]>,
    mean: Vec<[f32; 2]>,
}

static TABLE: LazyLock<Table> = LazyLock::new(Table::new);

/// [E, E₅] of a direction with the cosine `mu` > 0.
pub(super) fn directional(mu: f32, alpha: f32) -> [f32; 2] {
    TABLE.directional(mu, alpha)
}

/// [Ē, Ē₅].
pub(super) fn mean(alpha: f32) -> [f32; 2] {
    let (row, t) = place(alpha.sqrt(), ROUGHNESSES);
    lerp(TABLE.mean[row], TABLE.mean[row + 1], t)
}

/// Index of the entry below x in 0..1, and the place between it and the next.
pub(super) fn place(x: f32, count: usize) -> (usize, f32) {
    let x = x.clamp(0.0, 1.0) * (count - 1) as f32;
    let i = (x as usize).min(count - 2);
    (i, x - i as f32)
}

fn lerp(a: [f32; 2], b: [f32; 2], t: f32) -> [f32; 2] {
    std::array::from_fn(|k| a[k] + (b[k] - a[k]) * t)
}

impl Table {
    fn new() -> Self {
        let alpha = |row: usize| (row as f32 / (ROUGHNESSES - 1) as f32).powi(2).max(super::microfacet::SMOOTH_ALPHA);
        let entry = |alpha: f32, column: usize| integrate(alpha, (column as f32 / (COSINES - 1) as f32).powi(2));
        let row = |row: usize| std::array::from_fn(|column| entry(alpha(row), column));
        let mut table = Table { directional: (0..ROUGHNESSES).map(row).collect(), mean: Vec::new() };
        table.mean = (0..ROUGHNESSES).map(|row| table.mean_of(row)).collect();
        table
    }

    /// 2∫E μ dμ of what the table interpolates.
    fn mean_of(&self, row: usize) -> [f32; 2] {
        const N: usize = 512;
        let mut sum = [0.0; 2];
        for i in 0..N {
            let mu = (i as f32 + 0.5) / N as f32;
            let (column, t) = place(mu.sqrt(), COSINES);
            let e = lerp(self.directional[row][column], self.directional[row][column + 1], t);
            sum = std::array::from_fn(|k| sum[k] + 2.0 * mu / N as f32 * e[k]);
        }
        sum
    }

    fn directional(&self, mu: f32, alpha: f32) -> [f32; 2] {
        let (row, t) = place(alpha.sqrt(), ROUGHNESSES);
        let (column, s) = place(mu.sqrt(), COSINES);
        let of_row = |row: usize| lerp(self.directional[row][column], self.directional[row][column + 1], s);
        lerp(of_row(row), of_row(row + 1), t)
    }
}

/// [E, E₅] by stratified visible normals, whose weight is G/G1(wo).
fn integrate(alpha: f32, mu: f32) -> [f32; 2] {
    let mu = mu.max(1e-4);
    let distribution = TrowbridgeReitz::new(alpha, alpha);
    let wo = Vec3::new((1.0 - mu * mu).max(0.0).sqrt(), 0.0, mu);
    let mut sum = [0.0_f64; 2];
    for i in 0..SAMPLES * SAMPLES {
        let u = [(i % SAMPLES) as f32 + 0.5, (i / SAMPLES) as f32 + 0.5].map(|x| x / SAMPLES as f32);
        let m = distribution.sample_m(wo, u);
        let wi = reflect(wo, m);
        if wi.z > 0.0 {
            let weight = distribution.g(wo, wi) / distribution.g1(wo);
            let schlick = (1.0 - wo.dot(m)).clamp(0.0, 1.0).powi(5);
            sum = [sum[0] + f64::from(weight), sum[1] + f64::from(weight * schlick)];
        }
    }
    sum.map(|s| (s / (SAMPLES * SAMPLES) as f64).min(1.0) as f32)
}

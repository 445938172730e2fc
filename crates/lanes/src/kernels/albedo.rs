//! Tabulated directional albedos of GGX reflection, and the multiple scattering computed from them. The albedo of a
//! BSDF is `Bsdf::albedo_estimate`.
//!
//! E(μ) is the albedo, for a direction with cosine μ, of a surface whose microfacets reflect everything; E₅(μ) is the
//! albedo for the reflectance (1 − wo·m)⁵. Schlick's reflectance F₀ + (F₉₀ − F₀)(1 − wo·m)⁵ has the albedo
//! F₀(E − E₅) + F₉₀E₅. The missing energy 1 − E is light that hits more than one facet. It is restored by
//! [Kulla and Conty 2017]
//!
//! f_ms(wo, wi) = F_ms (1 − E(wo)) (1 − E(wi)) / (π (1 − Ē)),  F_ms = F̄² Ē/(1 − F̄ (1 − Ē)),  F̄ = F₀ + (F₉₀ − F₀)/21
//!
//! with Ē = 2∫E μ dμ. It is reciprocal, and with F = 1 no light is lost.

use super::facets::{Facets, SMOOTH_ALPHA};
use super::fresnel::reflect;
use lumiris_numbers::math::number::Number;
use lumiris_numbers::math::v3::V3;
use std::sync::LazyLock;

/// Cosines of the table, evenly spaced in √μ.
const COSINES: usize = 32;
/// Roughnesses of the table, evenly spaced in √α.
const ROUGHNESSES: usize = 24;
/// Samples per axis of each entry.
const SAMPLES: usize = 24;

/// E and E₅ by roughness and cosine, and their means over the hemisphere.
#[derive(Debug)]
pub struct Tables {
    directional: [Vec<f32>; 2],
    mean: [Vec<f32>; 2],
}

static TABLES: LazyLock<Tables> = LazyLock::new(Tables::new);

/// The tables, computed at their first use.
pub fn tables() -> &'static Tables {
    &TABLES
}

/// Index of a table entry, and the fraction between it and the next.
#[derive(Clone, Copy, Debug)]
pub struct Place<N> {
    first: N,
    t: N,
}

impl<N: Number> Place<N> {
    /// The position of `x` in 0..1 among `count` evenly spaced entries.
    #[inline(always)]
    pub fn new(x: N, count: usize) -> Self {
        let x = x.greater(x.constant(0.0)).lesser(x.constant(1.0)) * (count - 1) as f32;
        let first = x.lesser(x.constant((count - 2) as f32)).whole();
        Place { first, t: x - first }
    }

    /// Interpolates linearly between the entries of a table.
    #[inline(always)]
    pub fn between(self, table: &[f32]) -> N {
        let zero = self.t.constant(0.0);
        let a = N::entry(table, zero, 0, self.first);
        a + (N::entry(table, zero, 0, self.first + 1.0) - a) * self.t
    }

    /// Interpolates linearly between the rows of a table, at the position `column` in each row.
    #[inline(always)]
    pub fn between_rows(self, table: &[f32], columns: usize, column: Place<N>) -> N {
        let of_row = column.of_row(table, self.first, columns);
        of_row + (column.of_row(table, self.first + 1.0, columns) - of_row) * self.t
    }

    #[inline(always)]
    fn of_row(self, table: &[f32], row: N, columns: usize) -> N {
        let a = N::entry(table, row, columns, self.first);
        a + (N::entry(table, row, columns, self.first + 1.0) - a) * self.t
    }
}

/// The position of α in the tables.
#[inline(always)]
pub fn roughness<N: Number>(alpha: N) -> Place<N> {
    Place::new(alpha.root(), ROUGHNESSES)
}

impl Tables {
    /// [E, E₅] of a direction with the cosine `mu` > 0.
    #[inline(always)]
    pub fn directional<N: Number>(&self, mu: N, roughness: Place<N>) -> [N; 2] {
        let column = Place::new(mu.root(), COSINES);
        [
            roughness.between_rows(&self.directional[0], COSINES, column),
            roughness.between_rows(&self.directional[1], COSINES, column),
        ]
    }

    /// [Ē, Ē₅].
    #[inline(always)]
    pub fn mean<N: Number>(&self, roughness: Place<N>) -> [N; 2] {
        [roughness.between(&self.mean[0]), roughness.between(&self.mean[1])]
    }

    fn new() -> Self {
        let mut tables = Tables { directional: [Vec::new(), Vec::new()], mean: [Vec::new(), Vec::new()] };
        for row in 0..ROUGHNESSES {
            let alpha = (row as f32 / (ROUGHNESSES - 1) as f32).powi(2).max(SMOOTH_ALPHA);
            for column in 0..COSINES {
                let entry = integrate(alpha, (column as f32 / (COSINES - 1) as f32).powi(2));
                tables.directional.iter_mut().zip(entry).for_each(|(table, e)| table.push(e));
            }
        }
        for row in 0..ROUGHNESSES {
            let mean = tables.mean_of(Place { first: row as f32, t: 0.0 });
            tables.mean.iter_mut().zip(mean).for_each(|(table, e)| table.push(e));
        }
        tables
    }

    /// 2∫E μ dμ of the interpolated table.
    fn mean_of(&self, row: Place<f32>) -> [f32; 2] {
        const N: usize = 512;
        let mut sum = [0.0; 2];
        for i in 0..N {
            let mu = (i as f32 + 0.5) / N as f32;
            let e = self.directional(mu, row);
            sum = [0, 1].map(|k| sum[k] + 2.0 * mu / N as f32 * e[k]);
        }
        sum
    }
}

/// [E, E₅] from stratified visible normals, which have the weight G/G1(wo).
fn integrate(alpha: f32, mu: f32) -> [f32; 2] {
    let mu = mu.max(1e-4);
    let facets = Facets { alpha_x: alpha, alpha_y: alpha };
    let wo = V3 { x: (1.0 - mu * mu).max(0.0).sqrt(), y: 0.0, z: mu };
    let l_o = facets.l(wo);
    let mut sum = [0.0_f64; 2];
    for i in 0..SAMPLES * SAMPLES {
        let u = [(i % SAMPLES) as f32 + 0.5, (i / SAMPLES) as f32 + 0.5].map(|x| x / SAMPLES as f32);
        let m = facets.sample_m(wo, u);
        let wi = reflect(wo, m);
        if wi.z > 0.0 {
            let weight = Facets::g_cos(wo.z, wi.z, l_o, facets.l(wi)) / Facets::g1_over_cos(wo.z, l_o);
            let schlick = (1.0 - wo.dot(m)).clamp(0.0, 1.0).powi(5);
            sum = [sum[0] + f64::from(weight), sum[1] + f64::from(weight * schlick)];
        }
    }
    sum.map(|s| (s / (SAMPLES * SAMPLES) as f64).min(1.0) as f32)
}

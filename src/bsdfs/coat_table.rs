//! Directional integrals of a dielectric coat over a Lambertian base, tabulated for [`super::CoatedDiffuse`].
//!
//! For the interface of relative index η with a layer of thickness t and unit extinction below it:
//!
//! - T(w) = ∫ f_t(w, w') |cos θ'| exp(−t/|cos θ'|) dw', w outside and w' inside, f_t without the 1/η² of radiance;
//! - R(w) = ∫ f_r(w, w') cos θ' dw', both outside;
//! - R_in = (1/π) ∫∫ cos θ e(θ) f_r(w, w') cos θ' e(θ') dw dw', both inside, e(θ) = exp(−t/cos θ);
//! - T̄ = (1/π) ∫ T(w) cos θ dw.
//!
//! With visible-normal sampling f cos/pdf = (F or 1 − F) G/G1. Each integral is therefore a mean over the unit square
//! of a smooth function, computed by the midpoint rule. Tables are linear in √cos θ, in which T has bounded curvature
//! down to the horizon.

use super::dielectric::Dielectric;
use super::fresnel::{Refraction, fr_dielectric, reflect, refract};
use super::microfacet::{SMOOTH_ALPHA, TrowbridgeReitz};
use lumiris_lanes::kernels::coated;
use lumiris_lanes::kernels::coated::COSINES;
use lumiris_numbers::math::{Vec3, sqr, warp};
use rayon::prelude::*;
use std::f32::consts::FRAC_PI_2;
use std::sync::Arc;

/// Rows of a table over the roughness.
const ALPHAS: usize = 32;
/// Rows of a table over the azimuth, 0..π/2.
const AZIMUTHS: usize = 9;
/// Quadrature nodes of the unit square of visible normals.
const NORMALS: [usize; 2] = [32, 64];

/// The meaning of a table's rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Axis {
    /// One isotropic roughness.
    Fixed,
    /// One anisotropic roughness, rows over the azimuth of the outside direction.
    Azimuth,
    /// Rows over the fourth root of alpha of an isotropic roughness.
    Alpha,
}

/// Hemispherical integrals of an interface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hemispherical {
    /// R_in, the reflectance from below for diffuse light.
    pub internal: f32,
    /// T̄, the transmittance from above for diffuse light.
    pub transmittance: f32,
}

impl Hemispherical {
    fn lerp(self, other: Self, t: f32) -> Self {
        Hemispherical {
            internal: self.internal + (other.internal - self.internal) * t,
            transmittance: self.transmittance + (other.transmittance - self.transmittance) * t,
        }
    }
}

struct Row {
    /// (T, R) at √cos θ = i/(COSINES − 1).
    directional: Vec<f32>,
    hemispherical: Hemispherical,
}

/// Tables of one η and thickness; see the module.
#[derive(Clone, Debug)]
pub struct CoatTable {
    eta: f32,
    thickness: f32,
    axis: Axis,
    /// R_in and T̄ of the rows.
    hemispherical: Vec<Hemispherical>,
    /// Rows of (T, R), shared with other tables after [`Self::join`].
    directional: Arc<[f32]>,
    /// The first row of this table.
    first: usize,
    smooth: Hemispherical,
}

impl CoatTable {
    fn new(eta: f32, thickness: f32, axis: Axis, rows: &[Row]) -> Self {
        let hemispherical = rows.iter().map(|row| row.hemispherical).collect();
        let directional = rows.iter().flat_map(|row| &row.directional).copied().collect();
        let smooth = smooth_integrals(eta, thickness);
        CoatTable { eta, thickness, axis, hemispherical, directional, first: 0, smooth }
    }

    /// Stores the rows of all tables in one array, so that points of different coats are rows of one kernel.
    pub fn join(tables: &mut [CoatTable]) {
        let all: Arc<[f32]> = tables.iter().flat_map(|table| table.directional.iter().copied()).collect();
        let mut first = 0;
        for table in tables {
            (table.directional, table.first) = (Arc::clone(&all), first);
            first += table.hemispherical.len();
        }
    }

    /// The rows of (T, R) of this table and of all tables joined with it.
    pub fn directional_rows(&self) -> &[f32] {
        &self.directional
    }

    /// A table for one roughness, exact for anisotropic roughness too.
    pub fn for_roughness(eta: f32, thickness: f32, distribution: TrowbridgeReitz) -> Self {
        let thickness = thickness.max(0.0);
        let interface = Dielectric { eta, distribution };
        let (axis, rows) = if interface.is_specular() {
            (Axis::Fixed, Vec::new())
        } else if distribution.alpha_x == distribution.alpha_y {
            (Axis::Fixed, vec![Row::new(&interface, thickness, 0.0)])
        } else {
            let azimuth = |i| FRAC_PI_2 * i as f32 / (AZIMUTHS - 1) as f32;
            (Axis::Azimuth, (0..AZIMUTHS).map(|i| Row::new(&interface, thickness, azimuth(i))).collect())
        };
        CoatTable::new(eta, thickness, axis, &rows)
    }

    /// A table for all isotropic roughnesses up to alpha 1, for textured roughness.
    pub fn for_all_roughness(eta: f32, thickness: f32) -> Self {
        let thickness = thickness.max(0.0);
        let row = |i| {
            let alpha = sqr(sqr(alpha_axis(i as f32 / (ALPHAS - 1) as f32)));
            Row::new(&Dielectric { eta, distribution: TrowbridgeReitz::new(alpha, alpha) }, thickness, 0.0)
        };
        let rows = if eta == 1.0 { Vec::new() } else { (0..ALPHAS).into_par_iter().map(row).collect() };
        CoatTable::new(eta, thickness, Axis::Alpha, &rows)
    }

    /// Index of refraction of the layer relative to the outside.
    pub fn eta(&self) -> f32 {
        self.eta
    }

    /// Position of a roughness in the table, an argument of the other methods.
    pub fn row(&self, distribution: TrowbridgeReitz) -> f32 {
        match self.axis {
            Axis::Fixed | Axis::Azimuth => 0.0,
            Axis::Alpha => {
                let fourth_root = distribution.alpha_x.sqrt().sqrt();
                let x = (fourth_root - alpha_axis(0.0)) / (alpha_axis(1.0) - alpha_axis(0.0));
                x.clamp(0.0, 1.0) * (ALPHAS - 1) as f32
            }
        }
    }

    /// T and R of the direction `w`, in the upper hemisphere outside, for a rough interface.
    #[inline]
    pub fn directional(&self, w: Vec3, row: f32) -> [f32; 2] {
        let row = match self.axis {
            Axis::Fixed | Axis::Alpha => row,
            Axis::Azimuth => w.y.abs().atan2(w.x.abs()) * ((AZIMUTHS - 1) as f32 / FRAC_PI_2),
        };
        coated::rough_directional(&self.directional, self.place(row), w.z)
    }

    /// Index of the row below `row` in [`Self::directional_rows`], and the relative position between it and the next
    /// row.
    #[inline]
    pub(super) fn place(&self, row: f32) -> [f32; 2] {
        let i = (row as usize).min(self.hemispherical.len().saturating_sub(1));
        let t = if i + 1 < self.hemispherical.len() { row - i as f32 } else { 0.0 };
        [(self.first + i) as f32, t]
    }

    /// True if T and R depend on the azimuth.
    #[inline]
    pub(super) fn has_azimuths(&self) -> bool {
        self.axis == Axis::Azimuth
    }

    /// Thickness of the layer.
    pub(super) fn thickness(&self) -> f32 {
        self.thickness
    }

    /// R_in and T̄ of a rough interface.
    pub fn hemispherical(&self, row: f32) -> Hemispherical {
        match self.axis {
            Axis::Fixed => self.hemispherical[0],
            // Mean over the quarter turn by the trapezoidal rule.
            Axis::Azimuth => {
                let mut mean = Hemispherical::default();
                for pair in self.hemispherical.windows(2) {
                    let middle = pair[0].lerp(pair[1], 0.5);
                    mean.internal += middle.internal / (AZIMUTHS - 1) as f32;
                    mean.transmittance += middle.transmittance / (AZIMUTHS - 1) as f32;
                }
                mean
            }
            Axis::Alpha => {
                let i = (row as usize).min(self.hemispherical.len() - 2);
                self.hemispherical[i].lerp(self.hemispherical[i + 1], row - i as f32)
            }
        }
    }

    /// T and R of an outside direction of cosine `cos` for a smooth interface.
    #[inline]
    pub fn smooth_directional(&self, cos: f32) -> [f32; 2] {
        coated::smooth_directional(cos, self.eta, self.thickness)
    }

    /// R_in and T̄ of a smooth interface.
    #[inline]
    pub fn smooth_hemispherical(&self) -> Hemispherical {
        self.smooth
    }
}

impl Row {
    fn new(interface: &Dielectric, thickness: f32, phi: f32) -> Self {
        let outside = |cos: f32| scatter(interface, warp::direction(cos, phi), thickness);
        let directional = (0..COSINES)
            .flat_map(|i| {
                let s = outside(sqr(i as f32 / (COSINES - 1) as f32).max(1e-6));
                [s.transmitted, s.reflected]
            })
            .collect();

        // ∫ 2μ g(μ) dμ by the midpoint rule.
        let inside = Dielectric { eta: 1.0 / interface.eta, ..*interface };
        let mut sum = (0.0_f64, 0.0_f64);
        let n = COSINES;
        for i in 0..n {
            let cos = (i as f32 + 0.5) / n as f32;
            let below = scatter(&inside, warp::direction(cos, phi), thickness);
            let weight = 2.0 * f64::from(cos) / n as f64;
            sum.0 += weight * f64::from(below.reflected_attenuated * (-thickness / cos).exp());
            sum.1 += weight * f64::from(outside(cos).transmitted);
        }
        Row { directional, hemispherical: Hemispherical { internal: sum.0 as f32, transmittance: sum.1 as f32 } }
    }
}

/// Fourth root of alpha at position `t` in 0..1 of the roughness rows: at grazing angles T varies where alpha is as
/// small as the cosine.
fn alpha_axis(t: f32) -> f32 {
    let lo = SMOOTH_ALPHA.sqrt().sqrt();
    lo + (1.0 - lo) * t
}

struct Scatter {
    /// (1 − F) G/G1 exp(−t/cos θ'), mean over the visible normals.
    transmitted: f32,
    /// F G/G1.
    reflected: f32,
    /// F G/G1 exp(−t/cos θ').
    reflected_attenuated: f32,
}

/// The fractions of light from `w`, in the upper hemisphere, after one scattering event at `interface`.
fn scatter(interface: &Dielectric, w: Vec3, thickness: f32) -> Scatter {
    let distribution = &interface.distribution;
    let g1 = distribution.g1(w);
    let mut sum = [0.0_f64; 3];
    for i in 0..NORMALS[0] {
        for j in 0..NORMALS[1] {
            // Visible normals, stratified
            let u = [(i as f32 + 0.5) / NORMALS[0] as f32, (j as f32 + 0.5) / NORMALS[1] as f32];
            let m = distribution.sample_m(w, u);
            let cos_m = w.dot(m);
            if cos_m <= 0.0 {
                continue;
            }

            // Reflection
            let fresnel = fr_dielectric(cos_m, interface.eta);
            let r = reflect(w, m);
            if r.z > 0.0 {
                let value = f64::from(fresnel * distribution.g(w, r) / g1);
                sum[1] += value;
                sum[2] += value * f64::from((-thickness / r.z).exp());
            }

            // Transmission
            if let Some(Refraction { w: t, .. }) = refract(w, m, interface.eta)
                && t.z < 0.0
            {
                let value = (1.0 - fresnel) * distribution.g(w, t) / g1;
                sum[0] += f64::from(value * (thickness / t.z).exp());
            }
        }
    }
    let [transmitted, reflected, reflected_attenuated] = sum.map(|s| (s / (NORMALS[0] * NORMALS[1]) as f64) as f32);
    Scatter { transmitted, reflected, reflected_attenuated }
}

/// R_in and T̄ of a smooth interface by a fine midpoint rule.
fn smooth_integrals(eta: f32, thickness: f32) -> Hemispherical {
    let n = 20_000;
    let mut sum = (0.0_f64, 0.0_f64);
    for i in 0..n {
        let cos = (f64::from(i) + 0.5) / f64::from(n);
        let weight = 2.0 * cos / f64::from(n);
        let f_in = f64::from(fr_dielectric(-(cos as f32), eta));
        sum.0 += weight * f_in * (-2.0 * f64::from(thickness) / cos).exp();
        let sin2_t = (1.0 - cos * cos) / f64::from(eta * eta);
        if sin2_t < 1.0 {
            let f_out = f64::from(fr_dielectric(cos as f32, eta));
            sum.1 += weight * (1.0 - f_out) * (-f64::from(thickness) / (1.0 - sin2_t).sqrt()).exp();
        }
    }
    Hemispherical { internal: sum.0 as f32, transmittance: sum.1 as f32 }
}

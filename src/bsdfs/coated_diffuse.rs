//! A Lambertian base under a dielectric coat, in closed form.
//!
//! The base forgets directions, so the random walk between interface and base is a geometric series:
//!
//! f(wo, wi) = f_r(wo, wi) + T(wo) T(wi) / (π η²) · Σ_{k<N} ρ (ρ R_in)^k
//!
//! with the integrals T and R_in of [`super::coat_table`]; 1/η² is the reciprocity factor between the outside and
//! the layer. It is the expectation of the position-free walk [Guo et al. 2018] that pbrt-v4 runs, whose depth counts
//! the events at both interfaces after entry, alternating and beginning with the base: a walk of `max_depth` events
//! scatters at the base N = ⌈max_depth/2⌉ times. The layer absorbs with unit extinction, hence the thickness in T
//! and R_in. Both sides of the surface are coated.

use super::coat_table::{CoatTable, Hemispherical};
use super::dielectric::{Dielectric, Select};
use super::fresnel::reflect;
use super::{BsdfSample, Lobe, TrowbridgeReitz};
use lumiris_lanes::bsdf::Transmittance;
use lumiris_numbers::math::{Rgb, Vec3, sqr, warp};
use std::f32::consts::{FRAC_1_PI, PI};

/// Coated Lambertian reflection without scattering in the coat.
#[derive(Clone, Copy, Debug)]
pub struct CoatedDiffuse<'a> {
    interface: Dielectric,
    table: &'a CoatTable,
    /// Position of the roughness in the table.
    row: f32,
    /// Σ ρ (ρ R_in)^k / (π η²).
    base: Rgb,
    /// T̄ for the albedo of the base.
    mean_transmittance: f32,
}

impl<'a> CoatedDiffuse<'a> {
    /// A coat of the given roughness, tabulated in `table`, over a base of albedo `reflectance`.
    pub fn new(table: &'a CoatTable, distribution: TrowbridgeReitz, reflectance: Rgb, max_depth: u32) -> Self {
        let interface = Dielectric { eta: table.eta(), distribution };
        let row = table.row(distribution);
        let Hemispherical { internal, transmittance } =
            if interface.is_specular() { table.smooth_hemispherical() } else { table.hemispherical(row) };
        let bounces = max_depth.div_ceil(2);
        let base = reflectance.map(|rho| {
            let ratio = rho * internal;
            rho * (1.0 - ratio.powi(bounces.min(1 << 16) as i32)) / (1.0 - ratio)
        }) * (FRAC_1_PI / sqr(interface.eta));
        CoatedDiffuse { interface, table, row, base, mean_transmittance: transmittance }
    }

    /// T and R of `w`.
    #[inline]
    fn directional(&self, w: Vec3) -> [f32; 2] {
        if self.interface.is_specular() {
            self.table.smooth_directional(w.z)
        } else {
            self.table.directional(w, self.row)
        }
    }

    /// Microfacets of the interface.
    pub(super) fn distribution(&self) -> TrowbridgeReitz {
        self.interface.distribution
    }

    /// Albedo for light to `wo`: interface and base.
    pub fn albedo(&self, wo: Vec3) -> Rgb {
        let [t, r] = self.directional(if wo.z < 0.0 { -wo } else { wo });
        Rgb::splat(r) + self.base * (PI * self.mean_transmittance * t)
    }

    /// Albedo of the base seen from `wo`, under light that arrives evenly from all directions: what the base reflects
    /// is Lambertian but for the factor T(wi), of which this has the mean.
    pub(super) fn base_albedo(&self, wo: Vec3) -> Rgb {
        self.base * (PI * self.mean_transmittance * self.directional(if wo.z < 0.0 { -wo } else { wo })[0])
    }

    /// The interface alone.
    #[must_use]
    pub(super) fn without_base(self) -> Self {
        CoatedDiffuse { base: Rgb::BLACK, ..self }
    }

    /// Probability of sampling the interface; `wo` is in the upper hemisphere.
    #[inline]
    fn p_interface(&self, wo: Vec3) -> f32 {
        self.p_interface_of(self.directional(wo))
    }

    /// The same by T and R of `wo`.
    #[inline]
    fn p_interface_of(&self, [t, r]: [f32; 2]) -> f32 {
        let base = self.base.average() * (PI * self.mean_transmittance * t);
        if r + base > 0.0 { r / (r + base) } else { 0.0 }
    }

    /// True if the interface reflects like a mirror.
    #[inline]
    pub fn has_specular(&self) -> bool {
        self.interface.is_specular()
    }

    /// How many directions are evaluated at once; `None` if one by one, where the roughness is anisotropic.
    pub(super) fn lanes(&self, wo: Vec3) -> Option<lumiris_lanes::bsdf::Model<'_>> {
        let wo = if wo.z < 0.0 { -wo } else { wo };
        let (transmittance, interface) = if self.interface.is_specular() {
            (Transmittance::Smooth(self.table.eta(), self.table.thickness()), None)
        } else {
            let (rows, t) = self.table.directional_rows(self.row)?;
            (Transmittance::Table(rows, t), Some(self.interface.lanes()))
        };
        let base = (self.base * self.directional(wo)[0]).to_array();
        Some(lumiris_lanes::bsdf::Model::Coated { interface, base, p_interface: self.p_interface(wo), transmittance })
    }

    /// Value without cosine (1/sr), without the mirror of a smooth interface.
    pub fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        self.f_and_pdf(wo, wi).0
    }

    /// Density of the non-specular part of [`Self::sample`] per steradian.
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.f_and_pdf(wo, wi).1
    }

    /// [`Self::f`] and [`Self::pdf`].
    #[inline]
    pub(super) fn f_and_pdf(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        let upper = super::to_upper(wo, wi);
        upper.map_or((Rgb::BLACK, 0.0), |(wo, wi)| self.f_and_pdf_upper(wo, wi, self.directional(wo)))
    }

    /// The same in the upper hemisphere, by T and R of `wo`.
    #[inline]
    fn f_and_pdf_upper(&self, wo: Vec3, wi: Vec3, of_wo: [f32; 2]) -> (Rgb, f32) {
        let (value, pdf) = self.interface.value_and_pdf(wo, wi, Select::Reflection);
        let f = Rgb::splat(value) + self.base * (of_wo[0] * self.directional(wi)[0]);
        let p = self.p_interface_of(of_wo);
        (f, p * pdf + (1.0 - p) * warp::pdf_cosine_hemisphere(wi))
    }

    /// Probability of sampling the interface, see [`super::Bsdf::first_lobe`].
    pub(super) fn first_lobe(&self, wo: Vec3) -> f32 {
        self.p_interface(if wo.z < 0.0 { -wo } else { wo })
    }

    /// Density of the interface alone, times its probability, see [`super::Bsdf::pdf_first_lobe`].
    pub(super) fn pdf_first_lobe(&self, wo: Vec3, wi: Vec3) -> f32 {
        let Some((wo, wi)) = super::to_upper(wo, wi) else { return 0.0 };
        self.p_interface(wo) * self.interface.pdf_select(wo, wi, Select::Reflection)
    }

    /// The interface or the cosine, in proportion to the albedos.
    pub fn sample(&self, wo: Vec3, uc: f32, u: [f32; 2]) -> Option<BsdfSample> {
        let flip = if wo.z < 0.0 { -1.0 } else { 1.0 };
        let wo = wo * flip;
        let of_wo = self.directional(wo);
        let p = self.p_interface_of(of_wo);
        let (wi, lobe) = if uc >= p {
            (warp::sample_cosine_hemisphere(u), Lobe::DIFFUSE)
        } else if self.interface.is_specular() {
            let wi = Vec3::new(-wo.x, -wo.y, wo.z);
            let f = Rgb::splat(of_wo[1] / wi.z);
            let lobe = Lobe::SPECULAR | Lobe::REFLECTION;
            return Some(BsdfSample { f, wi: wi * flip, pdf: p, lobe, eta: 1.0 });
        } else {
            (reflect(wo, self.interface.distribution.sample_m(wo, u)), Lobe::GLOSSY)
        };
        if wi.z <= 0.0 {
            return None;
        }
        let (f, pdf) = self.f_and_pdf_upper(wo, wi, of_wo);
        Some(BsdfSample { f, wi: wi * flip, pdf, lobe: lobe | Lobe::REFLECTION, eta: 1.0 })
    }
}

//! A Lambertian base under a dielectric coat, in closed form.
//!
//! The base reflects independently of the incident direction, so the random walk between interface and base is a
//! geometric series:
//!
//! f(wo, wi) = f_r(wo, wi) + T(wo) T(wi) / (π η²) · Σ_{k<N} ρ (ρ R_in)^k
//!
//! with the integrals T and R_in of [`super::coat_table`]. 1/η² is the reciprocity factor between the outside and the
//! layer. This is the expectation of the position-free walk [Guo et al. 2018] of pbrt-v4. The depth of a walk counts
//! the events at both interfaces after entry, alternating and beginning with the base. A walk of `max_depth` events
//! scatters at the base N = ⌈max_depth/2⌉ times. The layer absorbs with unit extinction, hence the thickness in T and
//! R_in. Both sides of the surface are coated.

use super::coat_table::{CoatTable, Hemispherical};
use super::dielectric::Dielectric;
use super::fresnel::to_upper;
use super::kernel::{evaluate, of_drawn};
use super::lobe::{BsdfSample, BsdfValue};
use super::microfacet::TrowbridgeReitz;
use lumiris_lanes::kernels::BsdfKernel;
use lumiris_lanes::kernels::coated::{self, flip, rough_direction, rough_value};
use lumiris_lanes::kernels::{Coated, Drawn, Kernel, SmoothCoated, lobe};
use lumiris_numbers::math::v3::V3;
use lumiris_numbers::math::{Rgb, Vec3, sqr};
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
    /// T̄, for the albedo of the base.
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

    /// The albedo of the base over T(wo).
    #[inline]
    fn base_weight(&self) -> f32 {
        self.base.average() * (PI * self.mean_transmittance)
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

    /// Albedo towards `wo`: interface and base.
    pub fn albedo(&self, wo: Vec3) -> Rgb {
        let [t, r] = self.directional(if wo.z < 0.0 { -wo } else { wo });
        Rgb::splat(r) + self.base * (PI * self.mean_transmittance * t)
    }

    /// Albedo of the base as seen from `wo`, under uniform illumination. The reflection of the base is Lambertian
    /// except for the factor T(wi), which this replaces by its mean.
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
        coated::p_interface(self.base_weight(), self.directional(wo))
    }

    /// True if the interface is a perfect mirror.
    #[inline]
    pub fn has_specular(&self) -> bool {
        self.interface.is_specular()
    }

    /// The kernel; `None` if T and R depend on the azimuth.
    #[inline]
    pub(super) fn kernel(&self) -> Option<Kernel> {
        if self.interface.is_specular() {
            return Some(Kernel::SmoothCoated);
        }
        (!self.table.has_azimuths()).then_some(Kernel::Coated)
    }

    /// The parameters of its kernel.
    #[inline]
    pub(super) fn params(&self) -> [f32; 9] {
        let ([r, g, b], weight) = (self.base.to_array(), self.base_weight());
        let Dielectric { eta, distribution } = self.interface;
        if self.interface.is_specular() {
            return [r, g, b, weight, eta, self.table.thickness(), 0.0, 0.0, 0.0];
        }
        let [row, t] = self.table.place(self.row);
        [r, g, b, weight, eta, distribution.alpha_x, distribution.alpha_y, row, t]
    }

    /// Tables of the kernel.
    #[inline]
    pub(super) fn tables(&self) -> &'a [f32] {
        self.table.directional_rows()
    }

    /// f·|cos θi| and density (1/sr), without the mirror of a smooth interface.
    #[inline]
    pub(super) fn f_cos_and_pdf(&self, wo: Vec3, wi: Vec3) -> BsdfValue {
        let p = self.params();
        match self.kernel() {
            Some(Kernel::SmoothCoated) => evaluate::<SmoothCoated>(&p, &[], wo, wi),
            Some(_) => evaluate::<Coated>(&p, self.tables(), wo, wi),
            None => to_upper(wo, wi).map_or(BsdfValue::ZERO, |[wo, wi]| {
                let value = rough_value(&p, wo.into(), wi.into(), self.directional(wo), self.directional(wi)[0]);
                let value = value.kept(true);
                BsdfValue { f_cos: Rgb::from_array(value.f_cos), pdf: value.pdf }
            }),
        }
    }

    /// Probability of sampling the interface, see [`super::Bsdf::first_lobe`].
    pub(super) fn first_lobe(&self, wo: Vec3) -> f32 {
        self.p_interface(if wo.z < 0.0 { -wo } else { wo })
    }

    /// Density of sampling the interface, including its probability, see [`super::Bsdf::pdf_first_lobe`].
    pub(super) fn pdf_first_lobe(&self, wo: Vec3, wi: Vec3) -> f32 {
        let Some([wo, wi]) = to_upper(wo, wi) else { return 0.0 };
        if self.interface.is_specular() {
            return 0.0;
        }
        self.p_interface(wo) * coated::interface(&self.params(), wo.into(), wi.into()).pdf
    }

    /// Samples the interface or the cosine lobe, in proportion to the albedos.
    pub fn sample(&self, wo: Vec3, uc: f32, u: [f32; 2]) -> Option<BsdfSample> {
        let (p, u) = (self.params(), [uc, u[0], u[1]]);
        of_drawn(match self.kernel() {
            Some(Kernel::SmoothCoated) => SmoothCoated::sample(&p, &[], wo.into(), u),
            Some(_) => Coated::sample(&p, self.tables(), wo.into(), u),
            None => self.sample_by_azimuth(&p, wo.into(), u),
        })
    }

    fn sample_by_azimuth(&self, p: &[f32], wo: V3<f32>, u: [f32; 3]) -> Drawn<f32> {
        let flip = flip(wo);
        let wo = wo.times(flip);
        let of_wo = self.directional(wo.into());
        let (wi, is_interface) = rough_direction(p, wo, of_wo, u);
        let value = rough_value(p, wo, wi, of_wo, self.directional(wi.into())[0]);
        let kind = coated::kind(is_interface, lobe::GLOSSY, flip);
        Drawn::new(wi.times(flip), value, kind, 1.0).kept(wo.z > 0.0 && wi.z > 0.0)
    }
}

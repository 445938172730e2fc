//! A BSDF in the shading frame of a hit, for directions in world space.

use crate::bsdfs::{Bsdf, BsdfSample, BsdfValue, Lambertian, Phase, ProposalDensity, Resampled, resample};
use lumiris_lanes::kernels::{One, Values, evaluate_one};
use lumiris_numbers::math::{Frame, Rgb, Vec3};

/// The BSDF at a hit. Sides are determined by the shading normal alone, as in pbrt-v4. If it disagrees with the
/// geometric normal, light may leak through or be lost; the integrator treats leaks as occluded.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceBsdf<'a> {
    /// Scattering in the shading frame.
    pub bsdf: Bsdf<'a>,
    /// Shading frame.
    pub frame: Frame,
    /// Geometric normal, unit, not flipped to the viewer.
    pub n: Vec3,
    /// True if its material makes caustics, see [`super::MaterialSet::find_caustics`].
    pub makes_caustics: bool,
}

impl<'a> SurfaceBsdf<'a> {
    /// Scattering in a medium of asymmetry `g` by the phase function, for the direction `wo`. There is no surface, so
    /// the geometric normal is zero.
    #[inline]
    pub fn in_medium(g: f32, wo: Vec3) -> Self {
        let frame = Frame::from_z(wo);
        SurfaceBsdf { bsdf: Bsdf::Phase(Phase::new(g)), frame, n: Vec3::ZERO, makes_caustics: false }
    }

    /// The same, where `density` proposes directions for BSDFs that can only be evaluated.
    #[inline]
    #[must_use]
    pub fn proposed_by(mut self, density: ProposalDensity) -> Self {
        if let Bsdf::Evaluated(evaluated) = &mut self.bsdf {
            evaluated.density = density;
        }
        self
    }

    /// Value without cosine (1/sr), without deltas.
    #[inline]
    pub fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        self.bsdf.f(self.frame.to_local(wo), self.frame.to_local(wi))
    }

    /// f·|cos θi| about the shading normal (1/sr).
    #[inline]
    pub fn f_cos(&self, wo: Vec3, wi: Vec3) -> Rgb {
        self.f_cos_and_pdf(wo, wi).f_cos
    }

    /// [`Self::f_cos`] and [`Self::pdf`].
    #[inline]
    pub fn f_cos_and_pdf(&self, wo: Vec3, wi: Vec3) -> BsdfValue {
        self.bsdf.f_cos_and_pdf(self.frame.to_local(wo), self.frame.to_local(wi))
    }

    /// Density of the non-specular part of [`Self::sample`] per steradian.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.bsdf.pdf(self.frame.to_local(wo), self.frame.to_local(wi))
    }

    /// Probability of sampling the first lobe, see [`Bsdf::first_lobe`].
    #[inline]
    pub fn first_lobe(&self, wo: Vec3) -> f32 {
        self.bsdf.first_lobe(self.frame.to_local(wo))
    }

    /// The contribution of the first lobe to the density `pdf`, see [`Bsdf::pdf_first_lobe`].
    #[inline]
    pub fn pdf_first_lobe(&self, wo: Vec3, wi: Vec3, pdf: f32) -> f32 {
        self.bsdf.pdf_first_lobe(self.frame.to_local(wo), self.frame.to_local(wi), pdf)
    }

    /// [`f_cos`](Self::f_cos) and [`pdf`](Self::pdf) for many directions `wi` in world space, by component and channel;
    /// bit-identical to single calls. All slices have the same length.
    pub fn eval_lanes(&self, wo: Vec3, wi: [&[f32]; 3], f_cos: [&mut [f32]; 3], pdf: &mut [f32]) {
        let local = self.frame.to_local(wo);
        match self.bsdf.kernel() {
            Some(kernel) => {
                let params = self.bsdf.params();
                let one = One { params: &params, tables: self.bsdf.tables(), frame: self.frame, wo: local };
                evaluate_one(lumiris_lanes::level(), kernel, &one, wi, &mut Values { f_cos, pdf });
            }
            None => self.eval_each(wo, wi, f_cos, pdf),
        }
    }

    /// [`eval_lanes`](Self::eval_lanes) by single calls.
    pub fn eval_each(&self, wo: Vec3, wi: [&[f32]; 3], f_cos: [&mut [f32]; 3], pdf: &mut [f32]) {
        let wo = self.frame.to_local(wo);
        for i in 0..pdf.len() {
            let wi = self.frame.to_local(Vec3::new(wi[0][i], wi[1][i], wi[2][i]));
            let BsdfValue { f_cos: value, pdf: density } = self.bsdf.f_cos_and_pdf(wo, wi);
            for c in 0..3 {
                f_cos[c][i] = value[c];
            }
            pdf[i] = density;
        }
    }

    /// Samples a direction to the light, in world space.
    #[inline]
    pub fn sample(&self, wo: Vec3, uc: f32, u: [f32; 2]) -> Option<BsdfSample> {
        let mut sample = self.bsdf.sample(self.frame.to_local(wo), uc, u)?;
        sample.wi = self.frame.to_world(sample.wi);
        Some(sample)
    }

    /// Samples a direction by the same density, in world space, including directions that carry no light, see
    /// [`Bsdf::sample_direction`].
    #[inline]
    pub fn sample_direction(&self, wo: Vec3, uc: f32, u: [f32; 2]) -> Option<BsdfSample> {
        let mut sample = self.bsdf.sample_direction(self.frame.to_local(wo), uc, u)?;
        sample.wi = self.frame.to_world(sample.wi);
        Some(sample)
    }

    /// Probability of a wide lobe on the side of `wo`, see [`Bsdf::wide_lobe`].
    pub fn wide_lobe(&self, wo: Vec3) -> f32 {
        self.bsdf.wide_lobe(self.frame.to_local(wo))
    }

    /// Resamples one of `proposals` directions to the light, in world space, see [`resample()`].
    #[inline]
    pub fn resample(
        &self,
        wo: Vec3,
        proposals: u32,
        u_proposal: impl Fn(u32) -> [f32; 3],
        u_choice: f32,
    ) -> Option<Resampled> {
        let mut drawn = resample(&self.bsdf, self.frame.to_local(wo), proposals, u_proposal, u_choice)?;
        drawn.wi = self.frame.to_world(drawn.wi);
        Some(drawn)
    }

    /// The geometric normal on the side from which light can scatter to `wo`; zero if this is both sides.
    #[inline]
    pub fn lit_normal(&self, wo: Vec3) -> Vec3 {
        match (self.bsdf.transmits(), self.n.dot(wo) < 0.0) {
            (true, _) => Vec3::ZERO,
            (false, true) => -self.n,
            (false, false) => self.n,
        }
    }

    /// |cos θ| of a world-space direction about the shading normal; 1 in a medium.
    #[inline]
    pub fn cos(&self, w: Vec3) -> f32 {
        if self.bsdf.has_surface() { self.frame.z.dot(w).abs() } else { 1.0 }
    }

    /// The factor of f for transport of light from `wo` to `wi` instead of radiance, which refraction with the relative
    /// index `eta` scales [Veach 1997, §5.3.2].
    #[inline]
    pub fn adjoint_cos(&self, wo: Vec3, wi: Vec3, eta: f32) -> f32 {
        (wo.dot(self.frame.z) * wi.dot(self.n) / wo.dot(self.n)).abs() * eta * eta
    }

    /// The Lambertian part for the direction `wo`, see [`Bsdf::lambertian`].
    #[inline]
    pub fn lambertian(&self, wo: Vec3) -> Option<Lambertian<'a>> {
        self.bsdf.lambertian(self.frame.to_local(wo))
    }

    /// Fraction of uniform light that is scattered to `wo`, see [`Bsdf::albedo_estimate`].
    #[inline]
    pub fn albedo_estimate(&self, wo: Vec3, u: impl FnOnce() -> [f32; 3]) -> Rgb {
        self.bsdf.albedo_estimate(self.frame.to_local(wo), u)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdfs::{
        CoatTable, CoatedDiffuse, Conductor, Dielectric, Diffuse, DiffuseTransmission, ThinDielectric, TrowbridgeReitz,
    };
    use lumiris_numbers::math::warp::sample_uniform_sphere;
    use lumiris_test_support::random::{RngExt, pcg32};

    /// Asserts near equality, relative to the value or to 1e-3, whichever is greater.
    fn assert_near(a: f32, b: f32, what: &dyn std::fmt::Debug) {
        assert!((a - b).abs() <= 2e-4 * (b.abs() + 1e-3), "{a} {b} {what:?}");
    }

    #[test]
    fn lanes_are_single_calls() {
        let rgb = Rgb::new(0.2, 0.5, 0.8);
        let rough = TrowbridgeReitz::new(0.3, 0.15);
        let isotropic = TrowbridgeReitz::new(0.2, 0.2);
        let smooth = TrowbridgeReitz::new(0.0, 0.0);

        // BSDFs with lane kernels
        let tables = [
            (CoatTable::for_roughness(1.5, 0.01, isotropic), isotropic),
            (CoatTable::for_roughness(1.5, 0.01, smooth), smooth),
            (CoatTable::for_roughness(1.5, 0.0, smooth), smooth),
            (CoatTable::for_roughness(1.5, 0.01, rough), rough),
            (CoatTable::for_all_roughness(1.5, 0.01), isotropic),
        ];
        let conductor =
            |distribution| Conductor { distribution, eta: Rgb::new(0.2, 0.9, 1.1), k: Rgb::new(3.9, 2.4, 0.0) };
        let mut bsdfs = vec![
            Bsdf::Diffuse(Diffuse { reflectance: rgb }),
            Bsdf::DiffuseTransmission(DiffuseTransmission { reflectance: rgb, transmittance: Rgb::new(0.1, 0.3, 0.0) }),
            Bsdf::DiffuseTransmission(DiffuseTransmission { reflectance: Rgb::BLACK, transmittance: Rgb::BLACK }),
            Bsdf::Conductor(conductor(rough)),
            Bsdf::Conductor(conductor(smooth)),
            Bsdf::Dielectric(Dielectric { eta: 1.5, distribution: rough }),
            Bsdf::Dielectric(Dielectric { eta: 0.7, distribution: isotropic }),
            Bsdf::Dielectric(Dielectric { eta: 1.5, distribution: smooth }),
            Bsdf::ThinDielectric(ThinDielectric { eta: 1.5 }),
        ];
        bsdfs.extend(tables.iter().map(|(t, d)| Bsdf::CoatedDiffuse(CoatedDiffuse::new(t, *d, rgb, 10))));

        let mut stream = pcg32([5, 1, 5]);
        for bsdf in bsdfs {
            for n in [1, 8, 13, 32, 100] {
                for _ in 0..8 {
                    // Random directions
                    let frame = Frame::from_z(sample_uniform_sphere(stream.random::<[f32; 2]>()));
                    let surface = SurfaceBsdf { bsdf, frame, n: frame.z, makes_caustics: false };
                    let wo = sample_uniform_sphere(stream.random::<[f32; 2]>());
                    let w: Vec<Vec3> = (0..n).map(|_| sample_uniform_sphere(stream.random::<[f32; 2]>())).collect();
                    let wi: [Vec<f32>; 3] = std::array::from_fn(|c| w.iter().map(|w| w[c]).collect());
                    let run = |each: bool| {
                        let mut v: [Vec<f32>; 4] = std::array::from_fn(|_| vec![-1.0; n]);
                        let [r, g, b, pdf] = &mut v;
                        let wi = wi.each_ref().map(|v| &v[..]);
                        if each {
                            surface.eval_each(wo, wi, [r, g, b], pdf);
                        } else {
                            surface.eval_lanes(wo, wi, [r, g, b], pdf);
                        }
                        v
                    };

                    // Compare
                    let (lanes, single) = (run(false), run(true));
                    for (a, b) in lanes.iter().flatten().zip(single.iter().flatten()) {
                        assert_near(*a, *b, &(bsdf, wo));
                    }
                }
            }
        }
    }
}

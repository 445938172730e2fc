//! Reflection and refraction at a dielectric interface, smooth or with GGX microfacets [Walter et al. 2007].
//!
//! Reflection: f = D F G / (4 cos θo cos θi), half vector m = wo + wi. Transmission: m = wo + η'wi,
//! f = D (1 − F) G |wo·m wi·m| / (|cos θo cos θi| (wi·m + wo·m/η')²), times 1/η'² for radiance. η' is the index of
//! refraction on the side of `wi` relative to the side of `wo`. Single scattering only. Parameters: η on the side of −z
//! relative to the side of +z, alphas.

use super::bsdf_kernel::{BsdfKernel, Drawn, GreyValue, Value, flags, lobe, same_side};
use super::facets::Facets;
use super::fresnel::{Refracted, fr_inverse, inverse_eta, reflect, refract};
use lumiris_numbers::math::number::{Mask as _, Number};
use lumiris_numbers::math::v3::V3;

/// Transported quantity, which decides whether transmission scales by 1/η².
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// Paths from the camera.
    Radiance,
    /// Paths from the lights.
    Importance,
}

/// Selected lobes of a sample, value or density.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Select {
    /// Both.
    All,
    /// Reflection only.
    Reflection,
    /// Transmission only.
    Transmission,
}

/// Reflection and transmission.
#[derive(Debug)]
pub struct Dielectric;

/// Transmission only: out of an interior whose internal reflections are not path vertices.
#[derive(Debug)]
pub struct Exit;

/// Interface between the outside (+z) and a dielectric (−z).
#[derive(Clone, Copy, Debug)]
pub struct Interface<N> {
    /// Index of refraction on the side of −z relative to the side of +z.
    pub eta: N,
    /// Microfacets.
    pub facets: Facets<N>,
}

impl Select {
    /// Probability of reflection among the selected lobes.
    #[inline(always)]
    fn p_reflect<N: Number>(self, fresnel: N) -> N {
        match self {
            Select::All => fresnel,
            Select::Reflection => fresnel.constant(1.0),
            Select::Transmission => fresnel.constant(0.0),
        }
    }

    /// True where the selected lobes carry light.
    #[inline(always)]
    fn is_lit<N: Number>(self, fresnel: N) -> N::Mask {
        let (zero, one) = (fresnel.constant(0.0), fresnel.constant(1.0));
        match self {
            Select::All => one.above(zero),
            Select::Reflection => fresnel.above(zero),
            Select::Transmission => one.above(fresnel),
        }
    }
}

/// The value if its lobe is selected, else 0.
#[inline(always)]
fn selected<N: Number>(select: Select, value: N, is_reflection: N::Mask) -> N {
    match select {
        Select::All => value,
        Select::Reflection => value.or_zero(is_reflection),
        Select::Transmission => value.or_zero(!is_reflection),
    }
}

/// A half vector.
struct Microfacet<N> {
    /// Along the half vector.
    h: V3<N>,
    /// Its cosine with `wo`.
    o_m: N,
    /// Its cosine with `wi`.
    i_m: N,
}

impl<N: Number> Interface<N> {
    /// From the parameters.
    #[inline(always)]
    pub fn new(p: &[N]) -> Self {
        Interface { eta: p[0], facets: Facets { alpha_x: p[1], alpha_y: p[2] } }
    }

    /// True if all scattering is specular.
    #[inline(always)]
    pub fn is_specular(self) -> N::Mask {
        let from_one = (self.eta - 1.0).magnitude();
        self.facets.is_smooth() | !from_one.above(self.eta.constant(0.0))
    }

    /// f·|cos θi| and density (1/sr); 0 where specular.
    #[inline(always)]
    pub fn evaluate(self, wo: V3<N>, wi: V3<N>, select: Select, transport: Transport) -> GreyValue<N> {
        let (zero, one) = (wo.z.constant(0.0), wo.z.constant(1.0));
        let inverse = inverse_eta(wo.z, self.eta);
        let h = wo.times(N::choose(same_side(wo, wi), one, inverse)).plus(wi);
        // Oriented to the upper hemisphere
        let scale = one.signed_as(h.z) / h.dot(h).root();
        let (o_m, i_m) = (wo.dot(h) * scale, wi.dot(h) * scale);
        let faces = (i_m * wi.z).above(zero) & (o_m * wo.z).above(zero);
        let at = Microfacet { h, o_m, i_m };
        let Value { f_cos, pdf } =
            self.of_normal(wo, wi, at, inverse, select, transport).kept(faces & !self.is_specular());
        GreyValue { f_cos: f_cos[0], pdf }
    }

    /// f·|cos θi| and density (1/sr) for a half vector.
    #[inline(always)]
    fn of_normal(
        self,
        wo: V3<N>,
        wi: V3<N>,
        Microfacet { h, o_m, i_m }: Microfacet<N>,
        inverse: N,
        select: Select,
        transport: Transport,
    ) -> Value<N> {
        // Reflection or transmission
        let is_reflection = same_side(wo, wi);
        let fresnel = fr_inverse(o_m, inverse);
        let (p, exists) = (select.p_reflect(fresnel), select.is_lit(fresnel));
        let GreyValue { f_cos: d_g, pdf: density } = self.facets.reflection(wo, wi, h);
        let sum = i_m + o_m * inverse;
        let jacobian = i_m.magnitude() * o_m.magnitude() * 4.0 / (sum * sum);
        let scale = match transport {
            Transport::Radiance => inverse * inverse,
            Transport::Importance => inverse.constant(1.0),
        };
        // Values of the selected lobes
        let f_cos = d_g * N::choose(is_reflection, fresnel, (-fresnel + 1.0) * jacobian * scale);
        let pdf = density * N::choose(is_reflection, p, (-p + 1.0) * jacobian);
        Value::grey(selected(select, f_cos, is_reflection), pdf.or_zero(exists))
    }

    /// Samples reflection or refraction, chosen by the Fresnel reflectance of the sampled microfacet.
    #[inline(always)]
    pub fn sample(self, wo: V3<N>, u: [N; 3], select: Select, transport: Transport) -> Drawn<N> {
        // Sample a microfacet, then reflection or refraction
        let (zero, one) = (wo.z.constant(0.0), wo.z.constant(1.0));
        let is_specular = self.is_specular();
        let up = V3 { x: zero, y: zero, z: one };
        let m =
            if is_specular.all() { up } else { V3::choose(is_specular, up, self.facets.sample_m(wo, [u[1], u[2]])) };
        let o_m = wo.dot(m);
        let Refracted { wi: refracted, inverse_eta: inverse, passes } = refract(wo, m, self.eta);
        let fresnel = fr_inverse(o_m, inverse);
        let (p, exists) = (select.p_reflect(fresnel), select.is_lit(fresnel));
        let reflects = p.above(u[0]);
        let wi = V3::choose(reflects, reflect(wo, m), refracted);

        let scale = match transport {
            Transport::Radiance => inverse * inverse,
            Transport::Importance => one,
        };
        let (mut f_cos, mut pdf) =
            (N::choose(reflects, fresnel, (one - fresnel) * scale), N::choose(reflects, p, one - p));
        let mut is_sample = wo.z.magnitude().above(zero);
        if !is_specular.all() {
            let side = wo.z * wi.z;
            let is_side = (reflects & side.above(zero)) | (!reflects & zero.above(side));
            let at = Microfacet { h: m, o_m, i_m: wi.dot(m) };
            let rough = self.of_normal(wo, wi, at, inverse, select, transport);
            f_cos = N::choose(is_specular, f_cos, rough.f_cos[0]);
            pdf = N::choose(is_specular, pdf, rough.pdf);
            is_sample = is_sample & (is_specular | (is_side & (o_m * wo.z).above(zero)));
        }
        let kind = N::choose(is_specular, flags(one, lobe::SPECULAR), flags(one, lobe::GLOSSY))
            + N::choose(reflects, flags(one, lobe::REFLECTION), flags(one, lobe::TRANSMISSION));
        let eta = N::choose(reflects, one, one / inverse);
        Drawn::new(wi, Value::grey(f_cos, pdf), kind, eta).kept(is_sample & exists & (reflects | passes))
    }
}

impl BsdfKernel for Dielectric {
    const PARAMS: usize = 3;

    #[inline(always)]
    fn evaluate<N: Number>(p: &[N], _tables: &[f32], wo: V3<N>, wi: V3<N>) -> Value<N> {
        let GreyValue { f_cos, pdf } = Interface::new(p).evaluate(wo, wi, Select::All, Transport::Radiance);
        Value::grey(f_cos, pdf)
    }

    #[inline(always)]
    fn sample<N: Number>(p: &[N], _tables: &[f32], wo: V3<N>, u: [N; 3]) -> Drawn<N> {
        Interface::new(p).sample(wo, u, Select::All, Transport::Radiance)
    }
}

impl BsdfKernel for Exit {
    const PARAMS: usize = 3;

    #[inline(always)]
    fn evaluate<N: Number>(p: &[N], _tables: &[f32], wo: V3<N>, wi: V3<N>) -> Value<N> {
        let GreyValue { f_cos, pdf } = Interface::new(p).evaluate(wo, wi, Select::Transmission, Transport::Radiance);
        Value::grey(f_cos, pdf)
    }

    #[inline(always)]
    fn sample<N: Number>(p: &[N], _tables: &[f32], wo: V3<N>, u: [N; 3]) -> Drawn<N> {
        Interface::new(p).sample(wo, u, Select::Transmission, Transport::Radiance)
    }
}

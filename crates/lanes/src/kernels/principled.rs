//! Metal, glossy diffuse or glass, under a coat. The parameters are a subset of OpenPBR's, in the form of glTF's
//! metallic-roughness model: GGX microfacets with Schlick's reflectance.
//!
//! With the metalness m and the transmission t, the surface is a mixture of m metal, (1 − m)(1 − t) glossy diffuse and
//! (1 − m)t glass. All of them reflect by the same microfacets, with the multiple scattering of [`super::albedo`]. S(w)
//! is the albedo of the dielectric reflection. Light that is not reflected by the facets
//!
//! * is reflected by a diffuse base: ρ (1 − S(wo)) (1 − S(wi)) / (π (1 − S̄)), which conserves energy for ρ = 1;
//! * passes a thin sheet, as if reflected and mirrored at the sheet, times the base colour: roughness blurs the
//!   background, and nothing is refracted;
//! * or is refracted into a solid by [`Interface`], whose exact reflectance replaces Schlick's.
//!
//! A coat of weight c and albedo S_c transmits min(1 − c S_c(wo), 1 − c S_c(wi)) of the light below. This is
//! reciprocal, and never more than the energy left by the coat. [`super::sheen`], OpenPBR's fuzz, is between coat and
//! surface; OpenPBR has it above the coat.
//!
//! Smooth facets get the smallest roughness that counts as rough, so there are no deltas. Parameters: see [`Params`].

use super::albedo::{self, Place, roughness};
use super::bsdf_kernel::{BsdfKernel, Drawn, GreyValue, Value, flags, lobe};
use super::dielectric::{Interface, Select, Transport};
use super::facets::Facets;
use super::fresnel::{inverse_eta, reflect};
use super::sheen;
use lumiris_numbers::math::elementary::cosine_hemisphere;
use lumiris_numbers::math::number::{Mask as _, Number};
use lumiris_numbers::math::v3::V3;
use std::f32::consts::FRAC_1_PI;

/// Reflectance of a coat at normal incidence, for an index of refraction of 1.5.
const COAT_F0: f32 = 0.04;

/// The kernel.
#[derive(Debug)]
pub struct Principled;

/// The parameters, in array order.
#[derive(Clone, Copy, Debug)]
pub struct Params<N> {
    /// Reflectance of the metal, albedo of the diffuse base, and transmittance of the glass.
    pub base_color: V3<N>,
    /// Share of metal.
    pub metalness: N,
    /// Reflectance of the dielectric at normal incidence.
    pub f0: V3<N>,
    /// Reflectance of the dielectric at grazing angles.
    pub f90: N,
    /// Microfacets; never smooth.
    pub facets: Facets<N>,
    /// Share of glass in the dielectric.
    pub transmission: N,
    /// Index of refraction of the glass; 0 for a thin sheet.
    pub eta: N,
    /// Colour of the sheen; black for none.
    pub sheen: V3<N>,
    /// Roughness of the sheen.
    pub sheen_alpha: N,
    /// Weight of the coat.
    pub coat: N,
    /// Roughness of the coat; never smooth.
    pub coat_alpha: N,
}

/// Number of parameters.
pub const PARAMS: usize = 18;

/// Schlick's reflectance with its multiple scattering.
#[derive(Clone, Copy)]
struct Schlick<N> {
    f0: V3<N>,
    f90: V3<N>,
    fms: V3<N>,
}

/// Probabilities of the lobes for one `wo`; their sum is 1.
#[derive(Clone, Copy, Debug)]
pub struct Choice<N> {
    /// Reflection by the microfacets.
    pub facets: N,
    /// Reflection by the coat.
    pub coat: N,
    /// Transmission through a thin sheet.
    pub thin: N,
    /// Reflection or refraction by a solid's interface.
    pub solid: N,
    /// Cosine-weighted reflection.
    pub diffuse: N,
}

/// Values that do not depend on directions.
#[derive(Clone, Copy)]
struct Surface<N> {
    p: Params<N>,
    /// Shares of diffuse base, thin glass and solid glass.
    diffuse: N,
    thin: N,
    solid: N,
    /// Position of the roughness in the albedo tables.
    roughness: Place<N>,
    /// [Ē, Ē₅].
    mean: [N; 2],
    dielectric: Schlick<N>,
    /// Metal, diffuse base and thin glass together.
    facets: Schlick<N>,
}

/// Values that depend on one direction.
#[derive(Clone, Copy)]
struct Seen<N> {
    /// [E, E₅].
    e: [N; 2],
    /// Albedo of a white sheen.
    sheen: N,
    /// E of the coat; its albedo times its weight.
    coat_e: N,
    coat: N,
}

#[inline(always)]
fn splat<N: Number>(x: N) -> V3<N> {
    V3 { x, y: x, z: x }
}

#[inline(always)]
fn average<N: Number>(c: V3<N>) -> N {
    (c.x + c.y + c.z) * (1.0 / 3.0)
}

#[inline(always)]
fn largest<N: Number>(c: V3<N>) -> N {
    c.x.greater(c.y).greater(c.z)
}

/// 1 − c.
#[inline(always)]
fn rest<N: Number>(c: V3<N>) -> V3<N> {
    V3 { x: -c.x + 1.0, y: -c.y + 1.0, z: -c.z + 1.0 }
}

/// F_ms for one channel.
#[inline(always)]
fn multiple_fresnel<N: Number>(f0: N, f90: N, mean: N) -> N {
    let f = f0 + (f90 - f0) * (1.0 / 21.0);
    let least = f.constant(1e-6);
    f * f * mean / (-f * (-mean + 1.0) + 1.0).greater(least)
}

#[inline(always)]
fn unit<N: Number>(x: N) -> N {
    x.greater(x.constant(0.0)).lesser(x.constant(1.0))
}

impl<N: Number> Schlick<N> {
    #[inline(always)]
    fn new(f0: V3<N>, f90: V3<N>, mean: N) -> Self {
        let fms = V3 {
            x: multiple_fresnel(f0.x, f90.x, mean),
            y: multiple_fresnel(f0.y, f90.y, mean),
            z: multiple_fresnel(f0.z, f90.z, mean),
        };
        Schlick { f0, f90, fms }
    }

    #[inline(always)]
    fn fresnel(self, cos: N) -> V3<N> {
        let x = unit(-cos + 1.0);
        self.f0.plus(self.f90.minus(self.f0).times(x.squared().squared() * x))
    }

    /// Albedos of single scattering and of multiple scattering.
    #[inline(always)]
    fn albedos(self, [e, e5]: [N; 2]) -> [V3<N>; 2] {
        [self.f0.times(e - e5).plus(self.f90.times(e5)), self.fms.times(-e + 1.0)]
    }

    #[inline(always)]
    fn albedo(self, e: [N; 2]) -> V3<N> {
        let [single, multiple] = self.albedos(e);
        let sum = single.plus(multiple);
        V3 { x: unit(sum.x), y: unit(sum.y), z: unit(sum.z) }
    }

    #[inline(always)]
    fn weighted(self, weight: N, other: Self, other_weight: N) -> Self {
        Schlick {
            f0: self.f0.times(weight).plus(other.f0.times(other_weight)),
            f90: self.f90.times(weight).plus(other.f90.times(other_weight)),
            fms: self.fms.times(weight).plus(other.fms.times(other_weight)),
        }
    }
}

impl<N: Number> Params<N> {
    /// Reads the parameters from an array.
    #[inline(always)]
    pub fn new(p: &[N]) -> Self {
        Params {
            base_color: V3 { x: p[0], y: p[1], z: p[2] },
            metalness: p[3],
            f0: V3 { x: p[4], y: p[5], z: p[6] },
            f90: p[7],
            facets: Facets { alpha_x: p[8], alpha_y: p[9] },
            transmission: p[10],
            eta: p[11],
            sheen: V3 { x: p[12], y: p[13], z: p[14] },
            sheen_alpha: p[15],
            coat: p[16],
            coat_alpha: p[17],
        }
    }

    /// Probabilities of the lobes for `wo`.
    #[inline(always)]
    pub fn choice(self, wo: V3<N>) -> Choice<N> {
        let surface = Surface::new(self);
        surface.choice(surface.seen(wo.z.magnitude()))
    }

    #[inline(always)]
    fn coat_facets(self) -> Facets<N> {
        Facets { alpha_x: self.coat_alpha, alpha_y: self.coat_alpha }
    }

    /// True if there is a sheen.
    #[inline(always)]
    fn has_sheen(self) -> N::Mask {
        largest(self.sheen).above(self.coat.constant(0.0))
    }

    /// True if there is a coat.
    #[inline(always)]
    fn has_coat(self) -> N::Mask {
        self.coat.above(self.coat.constant(0.0))
    }
}

impl<N: Number> Surface<N> {
    #[inline(always)]
    fn new(p: Params<N>) -> Self {
        let one = p.coat.constant(1.0);
        let not_metal = one - p.metalness;
        let (glass, is_solid) = (not_metal * p.transmission, p.eta.above(p.coat.constant(0.0)));
        let (thin, solid) = (glass.or_zero(!is_solid), glass.or_zero(is_solid));
        let diffuse = not_metal * (one - p.transmission);
        let roughness = roughness((p.facets.alpha_x * p.facets.alpha_y).root());
        let mean = albedo::tables().mean(roughness);
        let dielectric = Schlick::new(p.f0, splat(p.f90), mean[0]);
        let metal = Schlick::new(p.base_color, splat(one), mean[0]);
        let facets = metal.weighted(p.metalness, dielectric, diffuse + thin);
        Surface { p, diffuse, thin, solid, roughness, mean, dielectric, facets }
    }

    /// Ē of the roughness of the coat.
    #[inline(always)]
    fn coat_mean(&self) -> N {
        let [mean, _] = albedo::tables().mean(roughness(self.p.coat_alpha));
        mean
    }

    /// Schlick's reflectance of a coat with this Ē.
    #[inline(always)]
    fn coat(mean: N) -> Schlick<N> {
        Schlick::new(splat(mean.constant(COAT_F0)), splat(mean.constant(1.0)), mean)
    }

    #[inline(always)]
    fn seen(&self, cos: N) -> Seen<N> {
        let zero = cos.constant(0.0);
        let e = albedo::tables().directional(cos, self.roughness);
        let mut seen = Seen { e, sheen: zero, coat_e: zero, coat: zero };
        if self.p.has_sheen().any() {
            seen.sheen = sheen::albedo(cos, self.p.sheen_alpha);
        }
        if self.p.has_coat().any() {
            let e = albedo::tables().directional(cos, roughness(self.p.coat_alpha));
            (seen.coat_e, seen.coat) = (e[0], self.p.coat * Self::coat(self.coat_mean()).albedo(e).y);
        }
        seen
    }

    /// Lobe probabilities proportional to albedos. Multiple scattering and sheen are sampled with the diffuse lobe.
    #[inline(always)]
    fn choice(&self, of_wo: Seen<N>) -> Choice<N> {
        // Albedos
        let (zero, one) = (self.p.coat.constant(0.0), self.p.coat.constant(1.0));
        let [single, multiple] = self.facets.albedos(of_wo.e);
        let (single, multiple) = (average(single), average(multiple));
        let passes = one - average(self.dielectric.albedo(of_wo.e));
        let base = average(self.p.base_color);
        let sheen = average(self.p.sheen) * of_wo.sheen;
        let uncoated = one - of_wo.coat;
        let below = uncoated * (one - largest(self.p.sheen) * of_wo.sheen);
        // Weights
        let weights = Choice {
            facets: single * below,
            coat: of_wo.coat,
            thin: self.thin * base * passes * below,
            solid: self.solid * below,
            diffuse: (self.diffuse * base * passes + multiple) * below + sheen * uncoated,
        };

        // Normalise
        let sum = weights.facets + weights.coat + weights.thin + weights.solid + weights.diffuse;
        let exists = sum.above(zero);
        Choice {
            facets: (weights.facets / sum).or_zero(exists),
            coat: (weights.coat / sum).or_zero(exists),
            thin: (weights.thin / sum).or_zero(exists),
            solid: (weights.solid / sum).or_zero(exists),
            diffuse: N::choose(exists, weights.diffuse / sum, one),
        }
    }

    /// Value and density, given the lobe probabilities for `wo`.
    #[inline(always)]
    fn value(&self, wo: V3<N>, wi: V3<N>, of_wo: Seen<N>, choice: Choice<N>) -> Value<N> {
        // Mirror both directions to the upper hemisphere
        let (zero, side) = (wo.z.constant(0.0), wo.z * wi.z);
        let (reflects, crosses) = (side.above(zero), zero.above(side));
        let (up_o, up_i) = (wo.with_z(wo.z.magnitude()), wi.with_z(wi.z.magnitude()));
        let h = up_o.plus(up_i);
        let cos_m = up_o.dot(h) / h.dot(h).root();
        let GreyValue { f_cos: single, pdf: density } = self.p.facets.reflection(up_o, up_i, h);
        let of_wi = self.seen(up_i.z);
        let cosine = up_i.z * FRAC_1_PI;
        let multiple = (-of_wo.e[0] + 1.0) * (-of_wi.e[0] + 1.0) * cosine / left(self.mean[0]);

        // Facets, diffuse base and thin sheet
        let mut f = self.reflected(cos_m, single, multiple).plus(self.diffused(of_wo, of_wi, cosine));
        let mut pdf =
            N::choose(reflects, choice.facets, choice.thin) * density + (choice.diffuse * cosine).or_zero(reflects);
        f = V3::choose(reflects, f, splat(zero));
        if crosses.any() {
            f = V3::choose(crosses, self.through(cos_m, single, multiple), f);
        }

        // Solid glass
        let is_solid = self.solid.above(zero);
        if is_solid.any() {
            let glass = Interface { eta: self.p.eta, facets: self.p.facets };
            let GreyValue { f_cos: of_glass, pdf: of_pdf } = glass.evaluate(wo, wi, Select::All, Transport::Radiance);
            let colored = V3::choose(reflects, splat(zero.constant(1.0)), self.p.base_color);
            f = f.plus(colored.times((of_glass * self.solid).or_zero(is_solid)));
            pdf = pdf + (choice.solid * of_pdf).or_zero(is_solid);
        }

        // Sheen
        if self.p.has_sheen().any() {
            let passes = -largest(self.p.sheen) * of_wo.sheen.greater(of_wi.sheen) + 1.0;
            let fibres = sheen::white(up_o, up_i, self.p.sheen_alpha);
            f = f.times(passes).plus(self.p.sheen.times(fibres.or_zero(reflects & self.p.has_sheen())));
        }

        // Coat
        if self.p.has_coat().any() {
            let GreyValue { f_cos: single, pdf: density } = self.p.coat_facets().reflection(up_o, up_i, h);
            let mean = self.coat_mean();
            let schlick = Self::coat(mean);
            let multiple = (-of_wo.coat_e + 1.0) * (-of_wi.coat_e + 1.0) * cosine / left(mean);
            let coat = schlick.fresnel(cos_m).times(single).plus(schlick.fms.times(multiple)).times(self.p.coat);
            let passes = -of_wo.coat.greater(of_wi.coat) + 1.0;
            let is_coat = reflects & self.p.has_coat();
            f = f.times(passes).plus(V3::choose(is_coat, coat, splat(zero)));
            pdf = pdf + (choice.coat * density).or_zero(is_coat);
        }
        Value { f_cos: [f.x, f.y, f.z], pdf }.kept(reflects | crosses)
    }

    /// f·cos θi of the facets.
    #[inline(always)]
    fn reflected(&self, cos_m: N, single: N, multiple: N) -> V3<N> {
        self.facets.fresnel(cos_m).times(single).plus(self.facets.fms.times(multiple))
    }

    /// f·cos θi of the diffuse base.
    #[inline(always)]
    fn diffused(&self, of_wo: Seen<N>, of_wi: Seen<N>, cosine: N) -> V3<N> {
        let all = rest(self.dielectric.albedo(self.mean));
        let (o, i) = (rest(self.dielectric.albedo(of_wo.e)), rest(self.dielectric.albedo(of_wi.e)));
        let (scale, color, least) = (self.diffuse * cosine, self.p.base_color, cosine.constant(1e-6));
        V3 {
            x: color.x * o.x * i.x / all.x.greater(least) * scale,
            y: color.y * o.y * i.y / all.y.greater(least) * scale,
            z: color.z * o.z * i.z / all.z.greater(least) * scale,
        }
    }

    /// f·|cos θi| of a thin sheet.
    #[inline(always)]
    fn through(&self, cos_m: N, single: N, multiple: N) -> V3<N> {
        let passes = rest(self.dielectric.fresnel(cos_m)).times(single);
        let sum = passes.plus(rest(self.dielectric.fms).times(multiple)).times(self.thin);
        V3 { x: sum.x * self.p.base_color.x, y: sum.y * self.p.base_color.y, z: sum.z * self.p.base_color.z }
    }
}

/// 1 − Ē, at least 10⁻⁶.
#[inline(always)]
fn left<N: Number>(mean: N) -> N {
    (-mean + 1.0).greater(mean.constant(1e-6))
}

impl BsdfKernel for Principled {
    const PARAMS: usize = PARAMS;

    #[inline(always)]
    fn evaluate<N: Number>(p: &[N], _tables: &[f32], wo: V3<N>, wi: V3<N>) -> Value<N> {
        let surface = Surface::new(Params::new(p));
        let of_wo = surface.seen(wo.z.magnitude());
        surface.value(wo, wi, of_wo, surface.choice(of_wo))
    }

    #[inline(always)]
    fn sample<N: Number>(p: &[N], _tables: &[f32], wo: V3<N>, u: [N; 3]) -> Drawn<N> {
        let (zero, one) = (wo.z.constant(0.0), wo.z.constant(1.0));
        let surface = Surface::new(Params::new(p));
        let p = surface.p;
        let of_wo = surface.seen(wo.z.magnitude());
        let choice = surface.choice(of_wo);
        let (coat_end, thin_end) = (choice.facets + choice.coat, choice.facets + choice.coat + choice.thin);
        let solid_end = thin_end + choice.solid;
        let is_facets = choice.facets.above(u[0]);
        let is_coat = coat_end.above(u[0]) & !is_facets;
        let is_thin = thin_end.above(u[0]) & !(is_facets | is_coat);
        let is_solid = solid_end.above(u[0]) & !(is_facets | is_coat | is_thin);
        let is_mirror = is_facets | is_coat | is_thin;

        // In the upper hemisphere, except for solids
        let up = wo.with_z(wo.z.magnitude());
        let mut wi = cosine_hemisphere([u[1], u[2]]);
        if is_mirror.any() {
            let facets = Facets {
                alpha_x: N::choose(is_coat, p.coat_alpha, p.facets.alpha_x),
                alpha_y: N::choose(is_coat, p.coat_alpha, p.facets.alpha_y),
            };
            wi = V3::choose(is_mirror, reflect(up, facets.sample_m(up, [u[1], u[2]])), wi);
        }
        let mut is_sample = wi.z.above(zero) & up.z.above(zero);
        let to_side = one.signed_as(N::choose(is_thin, -wo.z, wo.z));
        wi = wi.with_z(wi.z * to_side);
        let mut kind = N::choose(
            is_mirror,
            flags(one, lobe::GLOSSY) + N::choose(is_thin, flags(one, lobe::TRANSMISSION), flags(one, lobe::REFLECTION)),
            flags(one, lobe::DIFFUSE | lobe::REFLECTION),
        );
        let mut eta = one;
        if is_solid.any() {
            let glass = Interface { eta: p.eta, facets: p.facets };
            let last = one.constant(1.0 - f32::EPSILON);
            let u0 = ((u[0] - thin_end) / choice.solid).greater(zero).lesser(last);
            let drawn = glass.sample(wo, [u0, u[1], u[2]], Select::All, Transport::Radiance);
            wi = V3::choose(is_solid, drawn.wi, wi);
            kind = N::choose(is_solid, drawn.lobe, kind);
            let exists = drawn.pdf.above(zero);
            is_sample = (is_sample & !is_solid) | (is_solid & exists);
            let crosses = is_solid & !(wo.z * wi.z).above(zero);
            eta = N::choose(crosses, one / inverse_eta(wo.z, p.eta), eta);
        }
        let value = surface.value(wo, wi, of_wo, choice);
        Drawn::new(wi, value, kind, eta).kept(is_sample)
    }
}

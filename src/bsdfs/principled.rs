//! One material for most surfaces, with a part of the parameters of OpenPBR, which are those of glTF's metallic-roughness
//! model: a metal or a dielectric by GGX facets of Schlick's reflectance, under a clear coat.
//!
//! With the metalness m and the transmission t, the surface is m metal, (1 − m)(1 − t) glossy diffuse and (1 − m)t glass.
//! All reflect by the same facets, with the multiple scattering of [`super::ggx_albedo`]. S(w) being the albedo of the
//! dielectric reflection, what passes the facets
//!
//! * is reflected by a diffuse base: ρ (1 − S(wo)) (1 − S(wi)) / (π (1 − S̄)), which loses nothing where ρ = 1;
//! * goes through a thin sheet as if reflected and mirrored at the sheet, times the base colour: roughness blurs what is
//!   behind, and nothing is refracted;
//! * or is refracted into a solid by [`Dielectric`], whose exact reflectance replaces Schlick's.
//!
//! A coat of weight c and albedo S_c lets min(1 − c S_c(wo), 1 − c S_c(wi)) of what is below through: reciprocal, and
//! never more than is left. Between them is [`Sheen`], the fuzz of OpenPBR, which has it above the coat.
//!
//! Smooth facets are as rough as the smoothest that count as rough, so there are no deltas.

use super::dielectric::Dielectric;
use super::fresnel::reflect;
use super::microfacet::SMOOTH_ALPHA;
use super::sheen::Sheen;
use super::{BsdfSample, Lobe, TrowbridgeReitz, ggx_albedo};
use lumiris_numbers::math::{Rgb, Vec3, warp};
use std::f32::consts::FRAC_1_PI;

/// Reflectance of a coat at normal incidence, of an index of refraction of 1.5.
const COAT_F0: f32 = 0.04;

/// How light passes through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Interior {
    /// A sheet without thickness.
    Thin,
    /// A solid of this index of refraction, other than 1.
    Solid(f32),
}

/// Metal, glossy diffuse or glass, under a coat.
#[derive(Clone, Copy, Debug)]
pub struct Principled {
    /// Reflectance of the metal, albedo of the diffuse base, transmittance of the glass.
    pub base_color: Rgb,
    /// Part that is metal.
    pub metalness: f32,
    /// Reflectance of the dielectric at normal incidence.
    pub f0: Rgb,
    /// Reflectance of the dielectric at grazing angles.
    pub f90: f32,
    /// Facets; not smooth.
    pub distribution: TrowbridgeReitz,
    /// Part of the dielectric that is glass.
    pub transmission: f32,
    /// What the glass is.
    pub interior: Interior,
    /// Fibres on the base.
    pub sheen: Sheen,
    /// Weight of the coat.
    pub coat: f32,
    /// Facets of the coat; not smooth.
    pub coat_distribution: TrowbridgeReitz,
}

/// Facets that are smooth made as rough as what counts as rough.
pub fn rough(distribution: TrowbridgeReitz) -> TrowbridgeReitz {
    TrowbridgeReitz { alpha_x: distribution.alpha_x.max(SMOOTH_ALPHA), alpha_y: distribution.alpha_y.max(SMOOTH_ALPHA) }
}

/// Schlick's reflectance with its multiple scattering.
#[derive(Clone, Copy)]
struct Facets {
    f0: Rgb,
    f90: Rgb,
    fms: Rgb,
}

impl Facets {
    fn new(f0: Rgb, f90: Rgb, mean: f32) -> Self {
        let average = f0 + (f90 - f0) * (1.0 / 21.0);
        let fms = average.map(|f| f * f * mean / (1.0 - f * (1.0 - mean)).max(1e-6));
        Facets { f0, f90, fms }
    }

    fn fresnel(&self, cos: f32) -> Rgb {
        self.f0 + (self.f90 - self.f0) * (1.0 - cos).clamp(0.0, 1.0).powi(5)
    }

    /// Albedo by [E, E₅] of single scattering, and of multiple scattering.
    fn albedos(&self, [e, e5]: [f32; 2]) -> [Rgb; 2] {
        [self.f0 * (e - e5) + self.f90 * e5, self.fms * (1.0 - e)]
    }

    fn albedo(&self, e: [f32; 2]) -> Rgb {
        let [single, multiple] = self.albedos(e);
        (single + multiple).clamp(0.0, 1.0)
    }

    fn weighted(self, weight: f32, other: Facets, other_weight: f32) -> Facets {
        let sum = |a: Rgb, b: Rgb| a * weight + b * other_weight;
        Facets { f0: sum(self.f0, other.f0), f90: sum(self.f90, other.f90), fms: sum(self.fms, other.fms) }
    }
}

/// Probabilities of the lobes for one `wo`; their sum is 1.
#[derive(Clone, Copy, Default)]
struct Choice {
    facets: f32,
    coat: f32,
    thin: f32,
    solid: f32,
    diffuse: f32,
}

/// D G/(4 cos θo cos θi) and the half vector; both directions are in the upper hemisphere.
fn reflection(distribution: &TrowbridgeReitz, wo: Vec3, wi: Vec3) -> (f32, Vec3) {
    let m = (wo + wi).normalize_or(Vec3::Z);
    (distribution.d(m) * distribution.g(wo, wi) / (4.0 * wo.z * wi.z), m)
}

/// Density of reflection by the normals that `wo` sees (1/sr).
fn pdf_reflection(distribution: &TrowbridgeReitz, wo: Vec3, wi: Vec3) -> f32 {
    let m = (wo + wi).normalize_or(Vec3::Z);
    distribution.pdf_m(wo, m) / (4.0 * wo.dot(m).abs())
}

fn upper(w: Vec3) -> Vec3 {
    Vec3::new(w.x, w.y, w.z.abs())
}

impl Principled {
    /// The index of what is a solid that lets light in.
    pub(super) fn eta_mut(&mut self) -> Option<&mut f32> {
        match &mut self.interior {
            Interior::Solid(eta) if self.transmission > 0.0 && self.metalness < 1.0 => Some(eta),
            Interior::Solid(_) | Interior::Thin => None,
        }
    }

    /// The roughness that albedos are tabulated for.
    fn alpha(&self) -> f32 {
        (self.distribution.alpha_x * self.distribution.alpha_y).sqrt()
    }

    /// Parts that are metal, diffuse, thin glass, and solid glass.
    fn parts(&self) -> [f32; 4] {
        let dielectric = 1.0 - self.metalness;
        let glass = dielectric * self.transmission;
        let [thin, solid] = if self.interior == Interior::Thin { [glass, 0.0] } else { [0.0, glass] };
        [self.metalness, dielectric * (1.0 - self.transmission), thin, solid]
    }

    /// The part that is metal or glass.
    pub fn metal_or_glass(&self) -> f32 {
        let [metal, _, thin, solid] = self.parts();
        metal + thin + solid
    }

    fn dielectric_facets(&self, mean: f32) -> Facets {
        Facets::new(self.f0, Rgb::splat(self.f90), mean)
    }

    /// Facets of metal, diffuse and thin glass together.
    fn facets(&self, mean: f32) -> Facets {
        let [metal, diffuse, thin, _] = self.parts();
        let of_metal = Facets::new(self.base_color, Rgb::WHITE, mean);
        of_metal.weighted(metal, self.dielectric_facets(mean), diffuse + thin)
    }

    fn solid(&self) -> Option<Dielectric> {
        match self.interior {
            Interior::Solid(eta) if self.transmission > 0.0 => {
                Some(Dielectric { eta, distribution: self.distribution })
            }
            Interior::Solid(_) | Interior::Thin => None,
        }
    }

    fn coat_facets(&self) -> Facets {
        let [mean, _] = ggx_albedo::mean(self.coat_distribution.alpha_x);
        Facets::new(Rgb::splat(COAT_F0), Rgb::WHITE, mean)
    }

    /// Albedo of the coat, times its weight.
    fn coat_albedo(&self, facets: &Facets, cos: f32) -> f32 {
        self.coat * facets.albedo(ggx_albedo::directional(cos.abs(), self.coat_distribution.alpha_x)).g
    }

    /// Value without cosine (1/sr).
    pub fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let reflects = wo.z * wi.z > 0.0;
        let mut below = if reflects { self.f_reflection(wo, wi) } else { self.f_transmission(wo, wi) };
        if self.sheen.exists() {
            let sheen = if reflects { self.sheen.f(upper(wo), upper(wi)) } else { Rgb::BLACK };
            below = below * self.sheen.passes(wo.z, wi.z) + sheen;
        }
        if self.coat <= 0.0 {
            return below;
        }
        let facets = self.coat_facets();
        let passes = 1.0 - self.coat_albedo(&facets, wo.z).max(self.coat_albedo(&facets, wi.z));
        let coat = if reflects { self.f_coat(&facets, upper(wo), upper(wi)) } else { Rgb::BLACK };
        below * passes + coat
    }

    fn f_coat(&self, facets: &Facets, wo: Vec3, wi: Vec3) -> Rgb {
        let alpha = self.coat_distribution.alpha_x;
        let (single, m) = reflection(&self.coat_distribution, wo, wi);
        let multiple = self.multiple(wo, wi, alpha);
        (facets.fresnel(wo.dot(m)) * single + facets.fms * multiple) * self.coat
    }

    /// (1 − E(wo)) (1 − E(wi)) / (π (1 − Ē)).
    fn multiple(&self, wo: Vec3, wi: Vec3, alpha: f32) -> f32 {
        let missing = |w: Vec3| 1.0 - ggx_albedo::directional(w.z, alpha)[0];
        let [mean, _] = ggx_albedo::mean(alpha);
        missing(wo) * missing(wi) * FRAC_1_PI / (1.0 - mean).max(1e-6)
    }

    fn f_reflection(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let [_, diffuse, _, solid] = self.parts();
        let alpha = self.alpha();
        let mean = ggx_albedo::mean(alpha);
        let facets = self.facets(mean[0]);
        let glass = self.solid().map_or(Rgb::BLACK, |glass| glass.f(wo, wi) * solid);
        let (wo, wi) = (upper(wo), upper(wi));
        let (single, m) = reflection(&self.distribution, wo, wi);
        let mut f = facets.fresnel(wo.dot(m)) * single + facets.fms * self.multiple(wo, wi, alpha) + glass;
        if diffuse > 0.0 {
            let dielectric = self.dielectric_facets(mean[0]);
            let passes = |w: Vec3| Rgb::WHITE - dielectric.albedo(ggx_albedo::directional(w.z, alpha));
            let all = (Rgb::WHITE - dielectric.albedo(mean)).map(|x| x.max(1e-6));
            f += self.base_color * passes(wo) * passes(wi) / all * (diffuse * FRAC_1_PI);
        }
        f
    }

    fn f_transmission(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let [_, _, thin, solid] = self.parts();
        if let Some(glass) = self.solid() {
            return glass.f(wo, wi) * self.base_color * solid;
        }
        if thin <= 0.0 {
            return Rgb::BLACK;
        }
        let alpha = self.alpha();
        let facets = self.dielectric_facets(ggx_albedo::mean(alpha)[0]);
        let (wo, wi) = (upper(wo), upper(wi));
        let (single, m) = reflection(&self.distribution, wo, wi);
        let single = (Rgb::WHITE - facets.fresnel(wo.dot(m))) * single;
        let multiple = (Rgb::WHITE - facets.fms) * self.multiple(wo, wi, alpha);
        (single + multiple) * self.base_color * thin
    }

    /// Probabilities in proportion to albedos; multiple scattering and sheen are drawn with the diffuse lobe.
    fn choice(&self, wo: Vec3) -> Choice {
        let [_, diffuse, thin, solid] = self.parts();
        let alpha = self.alpha();
        let mean = ggx_albedo::mean(alpha)[0];
        let e = ggx_albedo::directional(wo.z.abs(), alpha);
        let [single, multiple] = self.facets(mean).albedos(e).map(Rgb::average);
        let passes = 1.0 - self.dielectric_facets(mean).albedo(e).average();
        let coat = if self.coat > 0.0 { self.coat_albedo(&self.coat_facets(), wo.z) } else { 0.0 };
        let base = self.base_color.average();
        let (sheen, left) =
            if self.sheen.exists() { (self.sheen.albedo(wo.z), self.sheen.passes(wo.z, wo.z)) } else { (0.0, 1.0) };
        let below = (1.0 - coat) * left;
        let weights = Choice {
            facets: single * below,
            coat,
            thin: thin * base * passes * below,
            solid: solid * below,
            diffuse: (diffuse * base * passes + multiple) * below + sheen * (1.0 - coat),
        };
        let sum = weights.facets + weights.coat + weights.thin + weights.solid + weights.diffuse;
        if !(sum > 0.0) {
            return Choice { diffuse: 1.0, ..Choice::default() };
        }
        let of = |weight: f32| weight / sum;
        let (facets, coat, thin, solid) = (of(weights.facets), of(weights.coat), of(weights.thin), of(weights.solid));
        Choice { facets, coat, thin, solid, diffuse: of(weights.diffuse) }
    }

    /// Probability of the facets, see [`super::Bsdf::first_lobe`].
    pub(super) fn first_lobe(&self, wo: Vec3) -> f32 {
        self.choice(wo).facets
    }

    /// The strongest lobe that is reflected, see [`super::Bsdf::glossy_lobe`].
    pub(super) fn glossy_lobe(&self, wo: Vec3) -> Option<(TrowbridgeReitz, f32)> {
        let choice = self.choice(wo);
        if self.transmission > 0.0 {
            None
        } else if choice.coat > choice.facets {
            Some((self.coat_distribution, choice.coat))
        } else {
            Some((self.distribution, choice.facets))
        }
    }

    /// Probability of the cosine, see [`super::Bsdf::wide_lobe`].
    pub(super) fn wide_lobe(&self, wo: Vec3) -> f32 {
        self.choice(wo).diffuse
    }

    /// Density of the facets alone, times their probability, see [`super::Bsdf::pdf_first_lobe`].
    pub(super) fn pdf_first_lobe(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wo.z * wi.z <= 0.0 {
            return 0.0;
        }
        self.choice(wo).facets * pdf_reflection(&self.distribution, upper(wo), upper(wi))
    }

    /// Density of [`Self::sample`] per steradian.
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.pdf_by(&self.choice(wo), wo, wi)
    }

    fn pdf_by(&self, choice: &Choice, wo: Vec3, wi: Vec3) -> f32 {
        let solid = self.solid().map_or(0.0, |glass| choice.solid * glass.pdf(wo, wi));
        let reflects = wo.z * wi.z > 0.0;
        let (wo, wi) = (upper(wo), upper(wi));
        let facets = if reflects { choice.facets } else { choice.thin };
        let mut pdf = solid + facets * pdf_reflection(&self.distribution, wo, wi);
        if reflects {
            pdf += choice.diffuse * warp::pdf_cosine_hemisphere(wi);
            if choice.coat > 0.0 {
                pdf += choice.coat * pdf_reflection(&self.coat_distribution, wo, wi);
            }
        }
        pdf
    }

    /// A direction of one of the lobes.
    pub fn sample(&self, wo: Vec3, uc: f32, u: [f32; 2]) -> Option<BsdfSample> {
        let choice = self.choice(wo);
        let ends = [choice.facets, choice.coat, choice.thin, choice.solid].into_iter().scan(0.0, |sum, p| {
            *sum += p;
            Some(*sum)
        });
        let flip = if wo.z < 0.0 { -1.0 } else { 1.0 };
        let seen = Vec3::new(wo.x, wo.y, wo.z.abs());
        let mirror = |distribution: &TrowbridgeReitz| reflect(seen, distribution.sample_m(seen, u));
        let place = |wi: Vec3, side: f32| (wi.z > 0.0).then(|| Vec3::new(wi.x, wi.y, wi.z * flip * side));
        let (wi, lobe) = match ends.take_while(|end| uc >= *end).count() {
            0 => (place(mirror(&self.distribution), 1.0)?, Lobe::GLOSSY | Lobe::REFLECTION),
            1 => (place(mirror(&self.coat_distribution), 1.0)?, Lobe::GLOSSY | Lobe::REFLECTION),
            2 => (place(mirror(&self.distribution), -1.0)?, Lobe::GLOSSY | Lobe::TRANSMISSION),
            3 => {
                let before = choice.facets + choice.coat + choice.thin;
                let s = self.solid()?.sample(wo, ((uc - before) / choice.solid).clamp(0.0, 1.0 - f32::EPSILON), u)?;
                (s.wi, s.lobe)
            }
            _ => (place(warp::sample_cosine_hemisphere(u), 1.0)?, Lobe::DIFFUSE | Lobe::REFLECTION),
        };
        let eta = match (lobe.is_transmission(), self.interior) {
            (true, Interior::Solid(eta)) => {
                if wo.z > 0.0 {
                    eta
                } else {
                    1.0 / eta
                }
            }
            (true, Interior::Thin) | (false, _) => 1.0,
        };
        Some(BsdfSample { f: self.f(wo, wi), wi, pdf: self.pdf_by(&choice, wo, wi), lobe, eta })
    }
}

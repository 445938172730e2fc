//! Reflectance models that are given only by their value, without sampler or density. Directions are in the upper
//! hemisphere, and f excludes the cosine. All models are reciprocal.
//!
//! | model | f(wo, wi) | source |
//! |---|---|---|
//! | Lambert | ρ/π | |
//! | Oren-Nayar | ρ/π (A + B max(0, cos(φi − φo)) sin α tan β), A = 1 − σ²/(2(σ² + 0.33)), B = 0.45 σ²/(σ² + 0.09) | [Oren and Nayar 1994, Eq. 30] |
//! | Cook-Torrance | d ρ/π + s D F G/(4 cos θo cos θi), D = exp(−tan²δ/m²)/(π m² cos⁴δ), G = min(1, 2 (n·h)(n·wo)/(wo·h), 2 (n·h)(n·wi)/(wo·h)), d + s = 1 | [Cook and Torrance 1982]; D normalised as in [Walter et al. 2007] |
//! | cosine lobe | ρd/π + ρs (n + 2)/(2π) max(0, wi·axis)ⁿ, axis = mirror direction of wo, or wo | [Lafortune and Willems 1994]; about wo [Lafortune et al. 1997] |
//! | Ashikhmin-Shirley | diffuse and anisotropic lobe, see [`AshikhminShirley`] | [Ashikhmin and Shirley 2000] |
//!
//! All models conserve energy except Oren-Nayar. Its albedo at grazing angles is ρ (A + B/2), up to 1.5 % above ρ near
//! σ = 11°, as in the source.

use super::fresnel::{fr_dielectric, to_upper};
use lumiris_numbers::math::{Rgb, Vec3, sqr};
use std::f32::consts::{FRAC_1_PI, PI};

/// Rough diffuse reflection.
#[derive(Clone, Copy, Debug)]
pub struct OrenNayar {
    /// ρ/π.
    base: Rgb,
    a: f32,
    b: f32,
}

impl OrenNayar {
    /// `sigma`: standard deviation of the facets' slope angle (radians), clamped to 0..π/2.
    pub fn new(reflectance: Rgb, sigma: f32) -> Self {
        let s2 = sqr(sigma.clamp(0.0, 0.5 * PI));
        let (a, b) = (1.0 - s2 / (2.0 * (s2 + 0.33)), 0.45 * s2 / (s2 + 0.09));
        OrenNayar { base: reflectance * FRAC_1_PI, a, b }
    }

    /// A, the ratio of the albedo for the normal direction to ρ.
    pub fn a(&self) -> f32 {
        self.a
    }

    /// B of the module's table.
    pub fn b(&self) -> f32 {
        self.b
    }

    #[inline]
    fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        // α is the greater polar angle and β the smaller one: sin α tan β cos Δφ = (wo_x wi_x + wo_y wi_y)/max(cos θ).
        let s = (wo.x * wi.x + wo.y * wi.y).max(0.0) / wo.z.max(wi.z);
        self.base * (self.a + self.b * s)
    }
}

/// Beckmann microfacets over a Lambertian.
#[derive(Clone, Copy, Debug)]
pub struct CookTorrance {
    /// d ρ/π.
    base: Rgb,
    /// s.
    amount: f32,
    /// Index of refraction, from the reflectance at normal incidence.
    eta: Rgb,
    /// m: root mean square slope of the facets.
    slope: f32,
}

impl CookTorrance {
    /// ρ of the base, reflectance of the facets at normal incidence, their root mean square slope m, and s, the facets'
    /// fraction of the surface (0..1).
    pub fn new(reflectance: Rgb, specular: Rgb, slope: f32, amount: f32) -> Self {
        let amount = amount.clamp(0.0, 1.0);
        let eta = specular.clamp(0.0, 0.9999).map(|f0| (1.0 + f0.sqrt()) / (1.0 - f0.sqrt()));
        CookTorrance { base: reflectance * ((1.0 - amount) * FRAC_1_PI), amount, eta, slope: slope.max(1e-3) }
    }

    #[inline]
    fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let Some(h) = (wo + wi).try_normalize() else { return self.base };
        let (cos2, oh) = (sqr(h.z), wo.dot(h));
        let d = (-(1.0 - cos2) / (cos2 * sqr(self.slope))).exp() / (PI * sqr(self.slope * cos2));
        if !(d > 0.0 && oh > 0.0) {
            return self.base;
        }
        let g = (2.0 * h.z * wo.z.min(wi.z) / oh).min(1.0);
        self.base + self.eta.map(|eta| fr_dielectric(oh, eta)) * (self.amount * d * g / (4.0 * wo.z * wi.z))
    }
}

/// The axis of a cosine lobe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LobeAxis {
    /// The mirror direction of `wo`: the modified Phong model.
    Mirror,
    /// `wo` itself: retroreflection.
    Retro,
}

/// A power of a cosine over a Lambertian.
#[derive(Clone, Copy, Debug)]
pub struct CosineLobe {
    /// ρd/π.
    base: Rgb,
    /// ρs (n + 2)/(2π).
    peak: Rgb,
    /// n.
    exponent: f32,
    axis: LobeAxis,
}

impl CosineLobe {
    /// ρd, ρs (at most 1 − ρd, so that energy is conserved), n ≥ 0, and the axis.
    pub fn new(reflectance: Rgb, specular: Rgb, exponent: f32, axis: LobeAxis) -> Self {
        let exponent = exponent.max(0.0);
        let part = |s: f32, d: f32| s.min(1.0 - d).max(0.0) * (exponent + 2.0) * (0.5 * FRAC_1_PI);
        let (s, d) = (specular, reflectance);
        let peak = Rgb::new(part(s.r, d.r), part(s.g, d.g), part(s.b, d.b));
        CosineLobe { base: reflectance * FRAC_1_PI, peak, exponent, axis }
    }

    #[inline]
    fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let across = wo.x * wi.x + wo.y * wi.y;
        let cos = match self.axis {
            LobeAxis::Mirror => wo.z * wi.z - across,
            LobeAxis::Retro => wo.z * wi.z + across,
        };
        self.base + self.peak * cos.clamp(0.0, 1.0).powf(self.exponent)
    }
}

/// Anisotropic lobe over a diffuse base, which loses energy to the lobe at grazing angles:
///
/// f = 28ρd/(23π) (1 − ρs)(1 − (1 − cos θi/2)⁵)(1 − (1 − cos θo/2)⁵)
///   + √((nu + 1)(nv + 1))/(8π) (n·h)^((nu hx² + nv hy²)/(1 − hz²)) F(wo·h)/((wo·h) max(cos θi, cos θo)),
///
/// F(c) = ρs + (1 − ρs)(1 − c)⁵ [Ashikhmin and Shirley 2000].
#[derive(Clone, Copy, Debug)]
pub struct AshikhminShirley {
    /// 28ρd/(23π) (1 − ρs).
    base: Rgb,
    specular: Rgb,
    exponents: [f32; 2],
    /// √((nu + 1)(nv + 1))/(8π).
    scale: f32,
}

impl AshikhminShirley {
    /// ρd, ρs and the exponents along x and y, clamped to at least 0.
    pub fn new(reflectance: Rgb, specular: Rgb, exponents: [f32; 2]) -> Self {
        let [nu, nv] = exponents.map(|n| n.max(0.0));
        let base = reflectance * (Rgb::WHITE - specular) * (28.0 / 23.0 * FRAC_1_PI);
        let scale = ((nu + 1.0) * (nv + 1.0)).sqrt() * (0.125 * FRAC_1_PI);
        AshikhminShirley { base, specular, exponents: [nu, nv], scale }
    }

    #[inline]
    fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let fifth = |x: f32| sqr(sqr(x)) * x;
        let base = self.base * ((1.0 - fifth(1.0 - 0.5 * wi.z)) * (1.0 - fifth(1.0 - 0.5 * wo.z)));
        let Some(h) = (wo + wi).try_normalize() else { return base };
        let [nu, nv] = self.exponents;
        let (across, oh) = (sqr(h.x) + sqr(h.y), wo.dot(h));
        let exponent = if across > 0.0 { (nu * sqr(h.x) + nv * sqr(h.y)) / across } else { nu };
        if !(oh > 0.0) {
            return base;
        }
        let lobe = self.scale * h.z.min(1.0).powf(exponent) / (oh * wo.z.max(wi.z));
        let fresnel = self.specular + (Rgb::WHITE - self.specular) * fifth((1.0 - oh).max(0.0));
        base + fresnel * lobe
    }
}

/// A reflectance model that can only be evaluated.
#[derive(Clone, Copy, Debug)]
pub enum Model {
    /// Lambertian of the given albedo.
    Diffuse(Rgb),
    /// Rough diffuse.
    OrenNayar(OrenNayar),
    /// Microfacets.
    CookTorrance(CookTorrance),
    /// Power of a cosine.
    CosineLobe(CosineLobe),
    /// Anisotropic power of a cosine.
    AshikhminShirley(AshikhminShirley),
}

impl Model {
    /// Value without cosine (1/sr) on the side of `wo`; both sides of the surface are equal.
    #[inline]
    pub fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let Some([wo, wi]) = to_upper(wo, wi) else { return Rgb::BLACK };
        match self {
            Model::Diffuse(reflectance) => *reflectance * FRAC_1_PI,
            Model::OrenNayar(m) => m.f(wo, wi),
            Model::CookTorrance(m) => m.f(wo, wi),
            Model::CosineLobe(m) => m.f(wo, wi),
            Model::AshikhminShirley(m) => m.f(wo, wi),
        }
    }
}

//! Fibres: hair and fur by [Chiang et al. 2016], after [Marschner et al. 2003] and [d'Eon et al. 2011], with the
//! conventions of pbrt-v4.
//!
//! The frame has x along the fibre. θ is the elevation above the plane perpendicular to it, sin θ = x, and φ is the
//! azimuth in this plane, from y to z. h in −1..1 is the offset of the light path across the fibre, along y. With γo =
//! asin h, the light of path p — R, TT, TRT, and all longer ones — scatters by
//!
//! Σ_p M_p(θo, θi) A_p(θo) N_p(φi − φo) / |cos θi|: M is the longitudinal lobe of variance v_p, and A is the
//! attenuation. N is the azimuthal lobe, a logistic distribution of scale s trimmed to a full turn about Φ(p) = 2pγt −
//! 2γo + pπ. Scales of the cuticle tilt the lobes by α. Each M·cos θ and N integrates to 1, and ΣA = 1 without
//! absorption, so energy is conserved. The BSDF is not reciprocal: A depends on θo only, and the lobes are tilted to
//! one side.

use super::fresnel::fr_dielectric;
use super::lobe::{BsdfSample, Lobe};
use lumiris_numbers::math::{Rgb, Vec3, safe_sqrt, sqr};
use std::f32::consts::{FRAC_1_PI, LN_2, PI, TAU};

/// Number of separate paths, besides all longer ones.
const P_MAX: usize = 3;

/// A fibre at one offset across it.
#[derive(Clone, Copy, Debug)]
pub struct Hair {
    /// Offset across the fibre, −1..1.
    h: f32,
    eta: f32,
    sigma_a: Rgb,
    /// Longitudinal variances.
    v: [f32; P_MAX + 1],
    /// Scale of the logistic distribution.
    s: f32,
    /// sin and cos of 2ᵏα.
    tilt: [[f32; 2]; 3],
}

/// Roughness and tilt of a fibre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HairLobes {
    /// Longitudinal roughness, 0..1.
    pub beta_m: f32,
    /// Azimuthal roughness, 0..1.
    pub beta_n: f32,
    /// Tilt of the scales (degrees).
    pub alpha: f32,
}

/// Sine and cosine of the elevation, and the azimuth.
#[derive(Clone, Copy)]
struct Angles {
    sin: f32,
    cos: f32,
    phi: f32,
}

/// Attenuation of light from one direction.
struct Attenuation {
    /// A of each path.
    a: [Rgb; P_MAX + 1],
    /// γt.
    gamma_t: f32,
}

impl Angles {
    fn of(w: Vec3) -> Self {
        Angles { sin: w.x.clamp(-1.0, 1.0), cos: safe_sqrt(1.0 - w.x * w.x), phi: w.z.atan2(w.y) }
    }
}

impl Hair {
    /// A fibre at the offset `h` in −1..1, with index of refraction `eta` above 0 other than 1, and absorption
    /// `sigma_a` per radius of the fibre.
    pub fn new(h: f32, eta: f32, sigma_a: Rgb, lobes: HairLobes) -> Self {
        let [m, n] = [lobes.beta_m, lobes.beta_n].map(|beta| beta.clamp(0.01, 1.0));
        let v0 = sqr(0.726 * m + 0.812 * m * m + 3.7 * m.powi(20));
        let s = (PI / 8.0).sqrt() * (0.265 * n + 1.194 * n * n + 5.372 * n.powi(22));
        let alpha = lobes.alpha.to_radians();
        let tilt = [1.0, 2.0, 4.0].map(|k: f32| [(k * alpha).sin(), (k * alpha).cos()]);
        let sigma_a = sigma_a.map(|x| x.max(0.0));
        Hair { h: h.clamp(-1.0, 1.0), eta, sigma_a, v: [v0, 0.25 * v0, 4.0 * v0, 4.0 * v0], s, tilt }
    }

    /// Absorption that gives fibres of azimuthal roughness `beta_n` the color `c` in bulk [Chiang et al. 2016, Eq. 9].
    pub fn sigma_a_of_reflectance(c: Rgb, beta_n: f32) -> Rgb {
        let b = beta_n;
        let fit = 5.969 - 0.215 * b + 2.532 * sqr(b) - 10.73 * b.powi(3) + 5.574 * b.powi(4) + 0.245 * b.powi(5);
        c.map(|c| sqr(c.clamp(1e-4, 1.0).ln() / fit))
    }

    /// Absorption by concentrations of the two melanins [d'Eon et al. 2011].
    pub fn sigma_a_of_melanin(eumelanin: f32, pheomelanin: f32) -> Rgb {
        Rgb::new(0.419, 0.697, 1.37) * eumelanin + Rgb::new(0.187, 0.4, 1.05) * pheomelanin
    }

    fn attenuation(&self, o: &Angles) -> Attenuation {
        let cos_o = o.cos.max(1e-4);
        let sin_t = o.sin / self.eta;
        let cos_t = safe_sqrt(1.0 - sqr(sin_t)).max(1e-4);
        let eta_p = safe_sqrt(sqr(self.eta) - sqr(o.sin)).max(1e-4) / cos_o;
        let sin_gamma = (self.h / eta_p).clamp(-1.0, 1.0);
        let cos_gamma = safe_sqrt(1.0 - sqr(sin_gamma));
        let pass = self.sigma_a.map(|sigma| (-sigma * 2.0 * cos_gamma / cos_t).exp());
        let f = fr_dielectric(o.cos * safe_sqrt(1.0 - sqr(self.h)), self.eta).min(1.0 - 1e-6);
        let tt = pass * sqr(1.0 - f);
        let trt = tt * pass * f;
        let rest = Rgb::new(
            trt.r * f * pass.r / (1.0 - pass.r * f),
            trt.g * f * pass.g / (1.0 - pass.g * f),
            trt.b * f * pass.b / (1.0 - pass.b * f),
        );
        Attenuation { a: [Rgb::splat(f), tt, trt, rest], gamma_t: sin_gamma.asin() }
    }

    /// Sine and |cosine| of θo, tilted for a path.
    fn tilted(&self, o: &Angles, p: usize) -> [f32; 2] {
        let [s, c] = match p {
            0 => [-self.tilt[1][0], self.tilt[1][1]],
            1 => self.tilt[0],
            2 => self.tilt[2],
            _ => [0.0, 1.0],
        };
        [o.sin * c + o.cos * s, (o.cos * c - o.sin * s).abs()]
    }

    /// Azimuth of the lobe of path p (below the last), relative to φo.
    fn center(&self, p: usize, gamma_t: f32) -> f32 {
        2.0 * p as f32 * gamma_t - 2.0 * self.h.asin() + p as f32 * PI
    }

    /// M_p·N_p of each path.
    fn lobes(&self, o: &Angles, i: &Angles, gamma_t: f32) -> [f32; P_MAX + 1] {
        std::array::from_fn(|p| {
            let m = longitudinal(self.tilted(o, p), [i.sin, i.cos], self.v[p]);
            let n = if p < P_MAX {
                trimmed_logistic(wrapped(i.phi - o.phi - self.center(p, gamma_t)), self.s)
            } else {
                1.0 / TAU
            };
            m * n
        })
    }

    /// Value without cosine (1/sr).
    pub fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let (o, i) = (Angles::of(wo), Angles::of(wi));
        let Attenuation { a, gamma_t } = self.attenuation(&o);
        let lobes = self.lobes(&o, &i, gamma_t);
        let sum = a.iter().zip(lobes).fold(Rgb::BLACK, |sum, (&a, lobe)| sum + a * lobe);
        sum * (1.0 / wi.z.abs())
    }

    /// Probabilities of the paths.
    fn choice(a: &[Rgb; P_MAX + 1]) -> [f32; P_MAX + 1] {
        let y = a.map(Rgb::luminance);
        let sum: f32 = y.iter().sum();
        if sum > 0.0 { y.map(|y| y / sum) } else { [1.0, 0.0, 0.0, 0.0] }
    }

    /// Density of [`Self::sample`] per steradian.
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let (o, i) = (Angles::of(wo), Angles::of(wi));
        let Attenuation { a, gamma_t } = self.attenuation(&o);
        Self::choice(&a).iter().zip(self.lobes(&o, &i, gamma_t)).map(|(p, lobe)| p * lobe).sum()
    }

    /// Samples a direction of one path, chosen by `uc`.
    pub fn sample(&self, wo: Vec3, uc: f32, u: [f32; 2]) -> Option<BsdfSample> {
        let o = Angles::of(wo);
        let Attenuation { a, gamma_t } = self.attenuation(&o);
        let choice = Self::choice(&a);
        let (mut p, mut before) = (0, 0.0);
        while p < P_MAX && uc >= before + choice[p] {
            before += choice[p];
            p += 1;
        }
        if choice[p] <= 0.0 {
            return None;
        }
        let uc = ((uc - before) / choice[p]).clamp(1e-5, 1.0 - f32::EPSILON);

        // Elevation [d'Eon et al. 2013]
        let [sin_o, cos_o] = self.tilted(&o, p);
        let v = self.v[p];
        let cos = (1.0 + v * (uc + (1.0 - uc) * (-2.0 / v).exp()).ln()).clamp(-1.0, 1.0);
        let sin_i = (safe_sqrt(1.0 - cos * cos) * (TAU * u[0]).cos() * cos_o - cos * sin_o).clamp(-1.0, 1.0);
        let cos_i = safe_sqrt(1.0 - sqr(sin_i));

        // Azimuth
        let offset =
            if p < P_MAX { self.center(p, gamma_t) + sample_trimmed_logistic(u[1], self.s) } else { TAU * u[1] };
        let phi = o.phi + offset;
        let wi = Vec3::new(sin_i, cos_i * phi.cos(), cos_i * phi.sin());
        let side = if wi.z * wo.z < 0.0 { Lobe::TRANSMISSION } else { Lobe::REFLECTION };
        Some(BsdfSample { f: self.f(wo, wi), wi, pdf: self.pdf(wo, wi), lobe: Lobe::GLOSSY | side, eta: 1.0 })
    }
}

/// M: density of the elevation per solid angle over a turn, ∫ M cos θi dθi = 1 [d'Eon et al. 2011, Eq. 7]. Computed by
/// logarithms if the variance is small [d'Eon et al. 2013].
fn longitudinal([sin_o, cos_o]: [f32; 2], [sin_i, cos_i]: [f32; 2], v: f32) -> f32 {
    let a = cos_i * cos_o / v;
    // With pbrt's sign of the tilt, the lobe is about −θo
    let b = sin_i * sin_o / v;
    if v <= 0.1 {
        return (log_bessel_i0(a) - b - 1.0 / v + LN_2 + (1.0 / (2.0 * v)).ln()).exp();
    }
    (-b).exp() * bessel_i0(a) / ((1.0 / v).sinh() * 2.0 * v)
}

/// Modified Bessel function I₀, for arguments up to 12.
fn bessel_i0(x: f32) -> f32 {
    let quarter = sqr(x) / 4.0;
    let (mut sum, mut term) = (1.0, 1.0);
    for k in 1..=24 {
        term *= quarter / sqr(k as f32);
        sum += term;
    }
    sum
}

fn log_bessel_i0(x: f32) -> f32 {
    if x > 12.0 {
        return x + 0.5 * (-TAU.ln() - x.ln()) + (1.0 + 1.0 / (8.0 * x) + 9.0 / (128.0 * x * x)).ln();
    }
    bessel_i0(x).ln()
}

/// The angle reduced to −π..π.
fn wrapped(angle: f32) -> f32 {
    let turns = (angle * (0.5 * FRAC_1_PI)).round();
    (angle - turns * TAU).clamp(-PI, PI)
}

/// Logistic distribution function.
fn logistic_cdf(x: f32, s: f32) -> f32 {
    1.0 / (1.0 + (-x / s).exp())
}

/// Density of the logistic distribution trimmed to −π..π.
fn trimmed_logistic(x: f32, s: f32) -> f32 {
    let e = (-x.abs() / s).exp();
    e / (s * sqr(1.0 + e)) / (logistic_cdf(PI, s) - logistic_cdf(-PI, s))
}

/// Samples [`trimmed_logistic`].
fn sample_trimmed_logistic(u: f32, s: f32) -> f32 {
    let (from, to) = (logistic_cdf(-PI, s), logistic_cdf(PI, s));
    let x = from + u * (to - from);
    (-s * (1.0 / x - 1.0).max(f32::MIN_POSITIVE).ln()).clamp(-PI, PI)
}

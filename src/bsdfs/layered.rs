//! A dielectric coat over a base, with a scattering medium between them: the position-free random walk of
//! [Guo, Hašan and Zhao 2018] in the form of pbrt-v4's layered BxDF.
//!
//! f is an expectation over walks that enter at `wo` and are connected to `wi` through the interface. Two techniques
//! connect them, combined by the power heuristic: sampling the interface from `wi`, and letting the walk leave. The
//! random numbers of the walk are a hash of (wo, wi). f is therefore a function, though a noisy one, and unbiased when
//! averaged over directions. Directions are sampled from fixed lobes of known density rather than by the walk, so that
//! `pdf` is exact.
//!
//! The heuristic weights both techniques by their densities of the direction inside the layer. pbrt-v4 weights one of
//! them by the density of `wi` instead, so that its weights do not sum to one if interface and base are both rough.
//! Light leaving a Lambertian base is then 2–11 % too bright for alphas 0.1–0.6 and steep directions, and more at
//! grazing ones, where f is evaluated but not where it is sampled (pbrt-v4 issue 187 is a consequence). pbrt-v4 also
//! omits the mirror reflections after the last scattering event if interface and base are both smooth.

use super::conductor::Conductor;
use super::dielectric::{Dielectric, Select, Transport};
use super::diffuse::Diffuse;
use super::fresnel::{fr_conductor, fr_dielectric, reflect, to_upper};
use super::kernel::KernelBsdf as _;
use super::lobe::{BsdfSample, BsdfValue, Lobe, MicrofacetLobe};
use super::microfacet::TrowbridgeReitz;
use lumiris_numbers::estimators::heuristics::{Heuristic, Technique};
use lumiris_numbers::math::hash::{HashStream, hash_floats};
use lumiris_numbers::math::{Frame, Rgb, Vec3, safe_sqrt, sqr, warp};
use std::f32::consts::{PI, TAU};

/// The lower boundary of the layer.
#[derive(Clone, Copy, Debug)]
pub enum Base {
    /// Lambertian.
    Diffuse(Diffuse),
    /// Metal; its index of refraction is relative to the coat.
    Conductor(Conductor),
}

impl Base {
    fn is_specular(&self) -> bool {
        match self {
            Base::Diffuse(_) => false,
            Base::Conductor(c) => c.distribution.is_smooth(),
        }
    }

    fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        match self {
            Base::Diffuse(d) => d.f(wo, wi),
            Base::Conductor(c) => c.f(wo, wi),
        }
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        match self {
            Base::Diffuse(d) => d.pdf(wo, wi),
            Base::Conductor(c) => c.pdf(wo, wi),
        }
    }

    fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<BsdfSample> {
        match self {
            Base::Diffuse(d) => d.sample(wo, 0.0, u),
            Base::Conductor(c) => c.sample(wo, 0.0, u),
        }
    }
}

/// Coat, medium and base. Both sides of the surface are coated.
#[derive(Clone, Copy, Debug)]
pub struct Layered {
    /// The coat's outer interface.
    pub top: Dielectric,
    /// The lower boundary.
    pub base: Base,
    /// Thickness of the layer in mean free paths; the extinction is 1.
    pub thickness: f32,
    /// Single-scattering albedo of the medium; black is a purely absorbing layer.
    pub albedo: Rgb,
    /// Henyey-Greenstein asymmetry.
    pub g: f32,
    /// Maximum number of events of a walk.
    pub max_depth: u32,
    /// Walks per evaluation of f.
    pub samples: u32,
}

/// Probabilities of the lobes of [`Layered::sample`].
struct Lobes {
    /// Reflection by the interface: a mirror if it is smooth.
    interface: f32,
    /// A GGX reflection about as wide as the light from the base.
    base: f32,
    /// Cosine.
    cosine: f32,
}

impl Layered {
    #[inline]
    fn has_medium(&self) -> bool {
        !self.albedo.is_black()
    }

    /// True if f is not 0 everywhere.
    pub fn has_non_specular(&self) -> bool {
        !self.top.is_specular() || !self.base.is_specular() || self.has_medium()
    }

    /// True if the BSDF includes a mirror reflection.
    pub fn has_specular(&self) -> bool {
        self.top.is_specular()
    }

    /// Transmittance over the depth `dz` in direction `w`.
    #[inline]
    fn transmittance(dz: f32, w: Vec3) -> f32 {
        if dz.abs() <= f32::MIN_POSITIVE { 1.0 } else { (-(dz / w.z).abs()).exp() }
    }

    /// Value without cosine (1/sr), without mirror reflection: the mean of `samples` walks.
    pub fn f(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let Some([wo, wi]) = to_upper(wo, wi) else { return Rgb::BLACK };
        let mut stream = HashStream::new([hash_floats(&wo.to_array()), hash_floats(&wi.to_array()), 0x6c61_7965]);
        let mut sum = Rgb::BLACK;
        if self.has_non_specular() {
            for _ in 0..self.samples {
                sum += self.walk(wo, wi, &mut stream);
            }
        }
        self.top.f(wo, wi) + sum / self.samples.max(1) as f32
    }

    /// One estimate of the light that enters the layer and leaves it again.
    fn walk(&self, wo: Vec3, wi: Vec3, s: &mut HashStream) -> Rgb {
        let inside = Select::Transmission;
        let entry = self.top.sample_select(wo, s.next_f32(), s.next_2d(), Transport::Radiance, inside);
        let exit = self.top.sample_select(wi, s.next_f32(), s.next_2d(), Transport::Importance, inside);
        let Some(entry) = entry.filter(|e| e.pdf > 0.0) else { return Rgb::BLACK };
        let exit = exit.filter(|e| e.pdf > 0.0);
        let beta = entry.f * (entry.wi.z.abs() / entry.pdf);
        let mut walk = Walk { layer: self, wi, exit, beta, f: Rgb::BLACK, remaining: self.max_depth };
        let (mut z, mut w) = (self.thickness, entry.wi);

        for depth in 0..self.max_depth {
            walk.remaining -= 1;
            // Russian roulette.
            let q = 1.0 - walk.beta.max_component();
            if depth > 3 && q > 0.75 {
                if s.next_f32() < q {
                    break;
                }
                walk.beta = walk.beta / (1.0 - q);
            }

            // Advance to the next boundary, or to a scattering event before it.
            if self.has_medium() {
                let free = -(1.0 - s.next_f32()).ln() * w.z.abs();
                let z_next = z + free.copysign(w.z);
                if z_next == z {
                    continue;
                }
                if z_next > 0.0 && z_next < self.thickness {
                    z = z_next;
                    match walk.scatter_in_medium(z, w, s.next_2d()) {
                        Some(next) => w = next,
                        None => break,
                    }
                    continue;
                }
                z = z_next.clamp(0.0, self.thickness);
            } else {
                walk.beta *= Self::transmittance(self.thickness, w);
                z = if z == self.thickness { 0.0 } else { self.thickness };
            }

            let next = if z == 0.0 {
                walk.scatter_at_base(w, s.next_2d())
            } else {
                walk.reflect_at_top(w, s.next_f32(), s.next_2d())
            };
            match next {
                Some(next) => w = next,
                None => break,
            }
        }
        walk.f
    }

    /// The GGX lobe that approximates the light from a metallic base. Refraction widens the base's reflection by η, and
    /// each passage through a rough interface adds (η − 1)α to half of its width.
    fn base_lobe(&self, base: &Conductor) -> TrowbridgeReitz {
        let eta = self.top.eta;
        let widen = |base: f32, top: f32| (sqr(eta * base) + 0.5 * sqr((eta - 1.0) * top)).sqrt().clamp(2e-3, 1.0);
        let (b, t) = (base.distribution, self.top.distribution);
        TrowbridgeReitz::new(widen(b.alpha_x, t.alpha_x), widen(b.alpha_y, t.alpha_y))
    }

    /// Probabilities of the lobes by approximate albedos; `wo` is in the upper hemisphere.
    fn lobes(&self, wo: Vec3) -> Lobes {
        let fresnel = fr_dielectric(wo.z, self.top.eta);
        let entering = 1.0 - fresnel;
        let medium =
            if self.has_medium() { self.albedo.average() * (1.0 - (-2.0 * self.thickness).exp()) } else { 0.0 };
        let (mut interface, base, cosine) = match &self.base {
            Base::Diffuse(d) => (fresnel, 0.0, entering * (d.reflectance.average() + medium)),
            Base::Conductor(c) => {
                let metal = entering * fr_conductor(wo.z, c.eta, c.k).average();
                if !self.has_non_specular() {
                    (fresnel + metal, 0.0, 0.0)
                } else if self.top.is_specular() && self.base.is_specular() {
                    (fresnel + metal, 0.0, entering * medium.max(0.05))
                } else {
                    // A tenth covers directions outside the lobe: light reflected several times.
                    (fresnel, 0.9 * metal, 0.1 * metal + entering * medium)
                }
            }
        };
        let sum = interface + base + cosine;
        if sum <= 0.0 {
            interface = 1.0;
        }
        let scale = if sum > 0.0 { 1.0 / sum } else { 1.0 };
        Lobes { interface: interface * scale, base: base * scale, cosine: cosine * scale }
    }

    /// Probability of sampling the interface or the lobe of the base, see [`super::Bsdf::first_lobe`].
    pub(super) fn first_lobe(&self, wo: Vec3) -> f32 {
        let lobes = self.lobes(if wo.z < 0.0 { -wo } else { wo });
        lobes.interface + lobes.base
    }

    /// The strongest lobe other than the cosine, see [`super::Bsdf::glossy_lobe`].
    pub(super) fn glossy_lobe(&self, wo: Vec3) -> MicrofacetLobe {
        let lobes = self.lobes(if wo.z < 0.0 { -wo } else { wo });
        match &self.base {
            Base::Conductor(metal) if lobes.base > lobes.interface => {
                MicrofacetLobe { distribution: metal.distribution, share: lobes.base }
            }
            _ => MicrofacetLobe { distribution: self.top.distribution, share: lobes.interface },
        }
    }

    /// Density of these lobes, including their probabilities, see [`super::Bsdf::pdf_first_lobe`].
    pub(super) fn pdf_first_lobe(&self, wo: Vec3, wi: Vec3) -> f32 {
        let Some([wo, wi]) = to_upper(wo, wi) else { return 0.0 };
        self.pdf_upper(wo, wi, &Lobes { cosine: 0.0, ..self.lobes(wo) })
    }

    /// Density of the non-specular part of [`Self::sample`] per steradian.
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let Some([wo, wi]) = to_upper(wo, wi) else { return 0.0 };
        self.pdf_upper(wo, wi, &self.lobes(wo))
    }

    fn pdf_upper(&self, wo: Vec3, wi: Vec3, lobes: &Lobes) -> f32 {
        let mut pdf = lobes.cosine * warp::pdf_cosine_hemisphere(wi);
        if !self.top.is_specular() {
            pdf += lobes.interface * self.top.pdf_select(wo, wi, Select::Reflection);
        }
        if let (Base::Conductor(c), true) = (&self.base, lobes.base > 0.0) {
            pdf += lobes.base * self.base_lobe(c).pdf_reflection(wo, wi);
        }
        pdf
    }

    /// Samples one of the lobes; f is evaluated by walks as in [`Self::f`].
    pub fn sample(&self, wo: Vec3, uc: f32, u: [f32; 2]) -> Option<BsdfSample> {
        let flip = if wo.z < 0.0 { -1.0 } else { 1.0 };
        let wo = wo * flip;

        // Choose a lobe
        let lobes = self.lobes(wo);
        let (wi, lobe) = if uc < lobes.interface {
            if self.top.is_specular() {
                let wi = Vec3::new(-wo.x, -wo.y, wo.z);
                let f = self.mirror_albedo(wo.z) / wi.z;
                let lobe = Lobe::SPECULAR | Lobe::REFLECTION;
                return Some(BsdfSample { f, wi: wi * flip, pdf: lobes.interface, lobe, eta: 1.0 });
            }
            (reflect(wo, self.top.distribution.sample_m(wo, u)), Lobe::GLOSSY)
        } else if uc < lobes.interface + lobes.base {
            let Base::Conductor(c) = &self.base else { return None };
            (reflect(wo, self.base_lobe(c).sample_m(wo, u)), Lobe::GLOSSY)
        } else {
            (warp::sample_cosine_hemisphere(u), Lobe::DIFFUSE)
        };

        // Density of all lobes
        let pdf = self.pdf_upper(wo, wi, &lobes);
        if wi.z <= 0.0 || pdf <= 0.0 {
            return None;
        }
        let f = self.f(wo * flip, wi * flip);
        Some(BsdfSample { f, wi: wi * flip, pdf, lobe: lobe | Lobe::REFLECTION, eta: 1.0 })
    }

    /// Mirror reflectance at a smooth interface: the reflectance of the interface, plus, for a smooth base, all paths
    /// without scattering in the medium: F + (1 − F)² τ Σ_{k<N} c (c F τ)^k. Here c is the base's reflectance, τ the
    /// transmittance down and up, and N = ⌊max_depth/2⌋ the maximum number of round trips of a walk that leaves.
    fn mirror_albedo(&self, cos: f32) -> Rgb {
        let fresnel = fr_dielectric(cos, self.top.eta);
        let Base::Conductor(c) = &self.base else { return Rgb::splat(fresnel) };
        let cos_t = safe_sqrt(1.0 - (1.0 - sqr(cos)) / sqr(self.top.eta));
        if !c.distribution.is_smooth() || fresnel >= 1.0 || cos_t == 0.0 {
            return Rgb::splat(fresnel);
        }
        let tau = (-2.0 * self.thickness / cos_t).exp();
        let round_trips = (self.max_depth / 2).min(1 << 16) as i32;
        fr_conductor(cos_t, c.eta, c.k).map(|c| {
            let ratio = c * fresnel * tau;
            fresnel + sqr(1.0 - fresnel) * tau * c * (1.0 - ratio.powi(round_trips)) / (1.0 - ratio)
        })
    }
}

/// A walk in progress: its weight and its accumulated contribution to `wi`.
struct Walk<'a> {
    layer: &'a Layered,
    wi: Vec3,
    /// A direction into the layer sampled from `wi`.
    exit: Option<BsdfSample>,
    beta: Rgb,
    f: Rgb,
    /// Number of events that may follow the current one.
    remaining: u32,
}

impl Walk<'_> {
    /// Connects the event at depth `z` to the presampled exit. `event` gives the scattering function times cosine
    /// towards the exit, and the density with which the walk itself would sample it.
    fn connect_exit(&mut self, z: f32, event: impl Fn(Vec3) -> BsdfValue) {
        let Some(exit) = &self.exit else { return };
        let BsdfValue { f_cos, pdf } = event(-exit.wi);
        let weight = if self.layer.top.is_specular() { 1.0 } else { power_weight(exit.pdf, pdf) };
        let transmittance = Layered::transmittance(self.layer.thickness - z, exit.wi);
        self.f += self.beta * f_cos * exit.f * (transmittance * weight / exit.pdf);
    }

    /// Connects a scattering event in the medium, at `z` between a smooth interface and a smooth base, by all chains of
    /// mirror reflections, which neither technique of the walk can sample. Upward chains have k ≥ 1 reflections at
    /// interface and base; downward chains begin with another reflection at the base.
    fn connect_mirrors(&mut self, z: f32, w: Vec3) {
        let (layer, Some(exit)) = (self.layer, &self.exit) else { return };
        let Base::Conductor(base) = &layer.base else { return };
        if !layer.top.is_specular() || !base.distribution.is_smooth() {
            return;
        }
        let (down, thickness) = (exit.wi, layer.thickness);
        let metal = fr_conductor(down.z.abs(), base.eta, base.k);
        let tau = Layered::transmittance(2.0 * thickness, down);
        let ratio = metal * (fr_dielectric(down.z, layer.top.eta) * tau);
        // Σ_{first ≤ k ≤ last} ratio^k.
        let series = |first: u32, last: u32| {
            ratio.map(|r| (r.powi(first as i32) - r.powi(last.min(1 << 16) as i32 + 1)) / (1.0 - r).max(1e-6))
        };
        let phase = |out: Vec3| henyey_greenstein(-w.dot(out), layer.g);
        let up = -down;
        let mirrored_down = Vec3::new(up.x, up.y, down.z);
        let mut sum = series(1, self.remaining / 2) * (phase(up) * Layered::transmittance(thickness - z, up));
        if self.remaining > 0 {
            let attenuation = Layered::transmittance(thickness + z, up);
            sum += series(0, (self.remaining - 1) / 2) * metal * (phase(mirrored_down) * attenuation);
        }
        self.f += self.beta * layer.albedo * sum * exit.f / exit.pdf;
    }

    /// Lets the walk leave through a rough interface, from depth `z` in direction `w`. `pdf` is the density with which
    /// the walk sampled `w` (`None`: a delta).
    fn leave(&mut self, z: f32, w: Vec3, pdf: Option<f32>) {
        if self.layer.top.is_specular() || w.z <= 0.0 {
            return;
        }
        let f = self.layer.top.value(-w, self.wi, Transport::Radiance);
        if f > 0.0 {
            let exit_pdf = self.layer.top.pdf_select(self.wi, -w, Select::Transmission);
            let weight = pdf.map_or(1.0, |pdf| power_weight(pdf, exit_pdf));
            self.f += self.beta * (f * weight * Layered::transmittance(self.layer.thickness - z, w));
        }
    }

    /// Scatters in the medium; returns the new direction.
    fn scatter_in_medium(&mut self, z: f32, w: Vec3, u: [f32; 2]) -> Option<Vec3> {
        let (albedo, g) = (self.layer.albedo, self.layer.g);
        self.connect_exit(z, |out| {
            let phase = henyey_greenstein(-w.dot(out), g);
            BsdfValue { f_cos: albedo * phase, pdf: phase }
        });
        self.connect_mirrors(z, w);
        let next = sample_henyey_greenstein(-w, g, u);
        let pdf = henyey_greenstein(-w.dot(next), g);
        self.beta *= albedo;
        self.leave(z, next, Some(pdf));
        (next.z != 0.0).then_some(next)
    }

    /// Scatters at the base; returns the new direction.
    fn scatter_at_base(&mut self, w: Vec3, u: [f32; 2]) -> Option<Vec3> {
        let base = self.layer.base;
        let specular = base.is_specular();
        if !specular {
            self.connect_exit(0.0, |out| BsdfValue { f_cos: base.f(-w, out) * out.z.abs(), pdf: base.pdf(-w, out) });
        }
        let sample = base.sample(-w, u).filter(|s| s.pdf > 0.0 && s.wi.z != 0.0)?;
        self.beta = self.beta * sample.f * (sample.wi.z.abs() / sample.pdf);
        self.leave(0.0, sample.wi, (!specular).then_some(sample.pdf));
        Some(sample.wi)
    }

    /// Reflects at the interface from below; returns the new direction.
    fn reflect_at_top(&mut self, w: Vec3, uc: f32, u: [f32; 2]) -> Option<Vec3> {
        let sample = self.layer.top.sample_select(-w, uc, u, Transport::Radiance, Select::Reflection);
        let sample = sample.filter(|s| s.pdf > 0.0 && s.wi.z != 0.0)?;
        self.beta = self.beta * sample.f * (sample.wi.z.abs() / sample.pdf);
        Some(sample.wi)
    }
}

/// MIS weight (power heuristic) of a sample of density `a` against a technique of density `b`, with one sample of each.
#[inline]
fn power_weight(a: f32, b: f32) -> f32 {
    let [a, b] = [a, b].map(|p| Technique { n: 1.0, p });
    Heuristic::Power.weight(a, b)
}

/// Phase function (1/sr) of the cosine between two directions that both point away from the event.
#[inline]
fn henyey_greenstein(cos: f32, g: f32) -> f32 {
    let denominator = 1.0 + sqr(g) + 2.0 * g * cos;
    (1.0 - sqr(g)) / (2.0 * TAU * denominator.max(1e-7).powf(1.5))
}

/// Samples [`henyey_greenstein`] about `wo`.
fn sample_henyey_greenstein(wo: Vec3, g: f32, u: [f32; 2]) -> Vec3 {
    let cos = if g.abs() < 1e-3 {
        1.0 - 2.0 * u[0]
    } else {
        -(1.0 + sqr(g) - sqr((1.0 - sqr(g)) / (1.0 + g - 2.0 * g * u[0]))) / (2.0 * g)
    };
    Frame::from_z(wo).to_world(warp::direction(cos.clamp(-1.0, 1.0), 2.0 * PI * u[1]))
}

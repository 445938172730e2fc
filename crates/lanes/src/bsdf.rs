//! Values and densities of one BSDF for many directions. The models are those of `bsdfs`; whatever depends on `wo`
//! alone is computed once.
//!
//! With h = wo + η'wi not normalised, D(m) = (h²/q)²/(π αx αy), q = hx²/αx² + hy²/αy² + hz²; and with
//! A = (αx wix)² + (αy wiy)², G(wo, wi) = |cos θi| / ((1/2 + Λ(wo)) |cos θi| + √(cos²θi + A)/2).

use super::lane::{F, I, LANES, M, Vec3s, begin, exp, or_zero, padded, safe_sqrt, store};
use fearless_simd::{Level, Simd, dispatch, prelude::*};
use lumiris_numbers::math::{Frame, Vec3, sqr};
use std::f32::consts::{FRAC_1_PI, PI};

/// Columns that [`Bsdf::eval`] writes.
#[derive(Debug)]
pub struct Values<'a> {
    /// f·|cos θi| (1/sr) by channel.
    pub f_cos: [&'a mut [f32]; 3],
    /// Density per steradian.
    pub pdf: &'a mut [f32],
}

/// A microfacet interface: GGX alphas and η of the side of −z relative to that of +z.
#[derive(Clone, Copy, Debug)]
pub struct Interface {
    /// Roughness along x and y.
    pub alpha: [f32; 2],
    /// Relative index of refraction.
    pub eta: f32,
}

/// Transmittance of a coat by the direction outside.
#[derive(Clone, Copy, Debug)]
pub enum Transmittance<'a> {
    /// Linear between two rows, in each linear over √cos θ between equal steps of 0..1; in the first components.
    Table([&'a [[f32; 2]]; 2], f32),
    /// Of a smooth interface of this η over a layer of this thickness.
    Smooth(f32, f32),
}

/// What kind of scattering.
#[derive(Clone, Copy, Debug)]
pub enum Model<'a> {
    /// Lambertian on both sides.
    Lambertian {
        /// f on the side of `wo`.
        reflection: [f32; 3],
        /// f on the other side.
        transmission: [f32; 3],
        /// Probabilities of both sides.
        p: [f32; 2],
    },
    /// Reflection by microfacets of complex index η + ik.
    Conductor {
        /// Roughness along x and y.
        alpha: [f32; 2],
        /// Real part.
        eta: [f32; 3],
        /// Imaginary part.
        k: [f32; 3],
    },
    /// Reflection and transmission by microfacets.
    Dielectric(Interface),
    /// A Lambertian base under a coat.
    Coated {
        /// The interface; `None` if it reflects like a mirror.
        interface: Option<Interface>,
        /// f of the base, without the transmittance along `wi`.
        base: [f32; 3],
        /// Probability of the interface.
        p_interface: f32,
        /// Transmittance along `wi`.
        transmittance: Transmittance<'a>,
    },
}

/// A BSDF in a frame, seen from a direction.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf<'a> {
    /// Shading frame.
    pub frame: Frame,
    /// Direction to the viewer in the frame.
    pub wo: Vec3,
    /// What it is.
    pub model: Model<'a>,
}

impl Bsdf<'_> {
    /// Evaluates for unit directions `wi` in world space. Values that are not finite are 0, as are those at the
    /// horizon.
    pub fn eval(&self, level: Level, wi: [&[f32]; 3], out: &mut Values<'_>) {
        if self.wo.z == 0.0 {
            out.f_cos.iter_mut().for_each(|f| f.fill(0.0));
            return out.pdf.fill(0.0);
        }
        let n = out.pdf.len();
        if n >= LANES {
            return self.eval_padded(level, wi, out);
        }
        let wi = wi.map(padded);
        let [mut r, mut g, mut b, mut pdf] = [[0.0; LANES]; 4];
        let mut few = Values { f_cos: [&mut r, &mut g, &mut b], pdf: &mut pdf };
        self.eval_padded(level, [&wi[0], &wi[1], &wi[2]], &mut few);
        for (to, from) in out.f_cos.iter_mut().zip([r, g, b]) {
            to.copy_from_slice(&from[..n]);
        }
        out.pdf.copy_from_slice(&pdf[..n]);
    }

    /// The same for at least [`LANES`] directions. Each model has a function of its own, for the time that compiling
    /// takes: it grows faster than a function without vector registers does.
    fn eval_padded(&self, level: Level, wi: [&[f32]; 3], out: &mut Values<'_>) {
        match &self.model {
            Model::Lambertian { reflection, transmission, p } => {
                self.eval_lambertian(level, ([*reflection, *transmission], *p), wi, out);
            }
            Model::Conductor { alpha, eta, k } => {
                let metal = [0, 1, 2].map(|c| Metal::new(eta[c], k[c]));
                self.eval_conductor(level, (&Facets::new(*alpha, self.wo), &metal), wi, out);
            }
            Model::Dielectric(interface) => {
                let eta_p = if self.wo.z > 0.0 { interface.eta } else { 1.0 / interface.eta };
                self.eval_dielectric(level, (&Facets::new(interface.alpha, self.wo), eta_p), wi, out);
            }
            Model::Coated { .. } => self.eval_coated(level, wi, out),
        }
    }

    #[inline(never)]
    fn eval_lambertian(&self, level: Level, model: ([[f32; 3]; 2], [f32; 2]), wi: [&[f32]; 3], out: &mut Values<'_>) {
        dispatch!(level, simd => self.lambertian_lanes(simd, model, wi, out));
    }

    #[inline(never)]
    fn eval_conductor(&self, level: Level, model: (&Facets, &[Metal; 3]), wi: [&[f32]; 3], out: &mut Values<'_>) {
        dispatch!(level, simd => self.conductor_lanes(simd, model, wi, out));
    }

    #[inline(never)]
    fn eval_dielectric(&self, level: Level, model: (&Facets, f32), wi: [&[f32]; 3], out: &mut Values<'_>) {
        dispatch!(level, simd => self.dielectric_lanes(simd, model, wi, out));
    }

    #[inline(never)]
    fn eval_coated(&self, level: Level, wi: [&[f32]; 3], out: &mut Values<'_>) {
        dispatch!(level, simd => self.coated_lanes(simd, wi, out));
    }

    #[inline(always)]
    fn lambertian_lanes<S: Simd>(
        &self,
        simd: S,
        (f, p): ([[f32; 3]; 2], [f32; 2]),
        wi: [&[f32]; 3],
        out: &mut Values<'_>,
    ) {
        for i in (0..out.pdf.len()).step_by(LANES) {
            let i = begin(i, out.pdf.len());
            self.lambertian(f, p, self.cosines(simd, wi, i), (i, out));
        }
    }

    #[inline(always)]
    fn conductor_lanes<S: Simd>(
        &self,
        simd: S,
        (facets, metal): (&Facets, &[Metal; 3]),
        wi: [&[f32]; 3],
        out: &mut Values<'_>,
    ) {
        for i in (0..out.pdf.len()).step_by(LANES) {
            let i = begin(i, out.pdf.len());
            self.conductor(facets, metal, self.local(simd, wi, i), (i, out));
        }
    }

    #[inline(always)]
    fn dielectric_lanes<S: Simd>(
        &self,
        simd: S,
        (facets, eta_p): (&Facets, f32),
        wi: [&[f32]; 3],
        out: &mut Values<'_>,
    ) {
        for i in (0..out.pdf.len()).step_by(LANES) {
            let i = begin(i, out.pdf.len());
            self.dielectric(facets, eta_p, self.local(simd, wi, i), (i, out));
        }
    }

    #[inline(always)]
    fn coated_lanes<S: Simd>(&self, simd: S, wi: [&[f32]; 3], out: &mut Values<'_>) {
        let Model::Coated { interface, base, p_interface, transmittance } = &self.model else { return };
        let coat = interface.map(|c| (Facets::new(c.alpha, self.wo), c.eta));
        for i in (0..out.pdf.len()).step_by(LANES) {
            let i = begin(i, out.pdf.len());
            let wi = self.local(simd, wi, i);
            let cos = wi.z.abs();
            let specular = match &coat {
                Some((facets, eta)) => self.coat(facets, *eta, wi),
                None => (F::splat(simd, 0.0), F::splat(simd, 0.0)),
            };
            let t = transmittance.along(cos) * cos;
            let is_same_side = (wi.z * self.wo.z).simd_gt(F::splat(simd, 0.0));
            let f = [specular.0 + t * base[0], specular.0 + t * base[1], specular.0 + t * base[2]];
            let pdf = specular.1 * *p_interface + cos * (FRAC_1_PI * (1.0 - *p_interface));
            write(is_same_side, f, pdf, (i, out));
        }
    }

    /// Directions in the frame.
    #[inline(always)]
    fn local<S: Simd>(&self, simd: S, wi: [&[f32]; 3], i: usize) -> Vec3s<S> {
        Vec3s::load(simd, wi, i).to_local(&self.frame)
    }

    /// cos θi.
    #[inline(always)]
    fn cosines<S: Simd>(&self, simd: S, wi: [&[f32]; 3], i: usize) -> F<S> {
        Vec3s::load(simd, wi, i).dot_splat(self.frame.z)
    }

    #[inline(always)]
    fn lambertian<S: Simd>(&self, f: [[f32; 3]; 2], p: [f32; 2], cos: F<S>, at: (usize, &mut Values<'_>)) {
        let simd = cos.token();
        let zero = F::splat(simd, 0.0);
        let is_same_side = (cos * self.wo.z).simd_gt(zero);
        let cos = cos.abs();
        let red = either(is_same_side, f[0][0], f[1][0]) * cos;
        let green = either(is_same_side, f[0][1], f[1][1]) * cos;
        let blue = either(is_same_side, f[0][2], f[1][2]) * cos;
        write(cos.simd_gt(zero), [red, green, blue], either(is_same_side, p[0], p[1]) * cos * FRAC_1_PI, at);
    }

    #[inline(always)]
    fn conductor<S: Simd>(&self, facets: &Facets, metal: &[Metal; 3], wi: Vec3s<S>, at: (usize, &mut Values<'_>)) {
        let simd = wi.x.token();
        let h = wi.plus(Vec3s::splat(simd, self.wo));
        let h2 = h.dot(h);
        let cos_m = (h.dot_splat(self.wo).abs() / h2.sqrt()).min(1.0);
        let d = facets.d(h, h2);
        let d_g = d * facets.g_cos(wi);
        let f = [metal[0].fresnel(cos_m) * d_g, metal[1].fresnel(cos_m) * d_g, metal[2].fresnel(cos_m) * d_g];
        let is_same_side = (wi.z * self.wo.z).simd_gt(F::splat(simd, 0.0));
        write(is_same_side, f, d * facets.pdf_per_d, at);
    }

    #[inline(always)]
    fn dielectric<S: Simd>(&self, facets: &Facets, eta_p: f32, wi: Vec3s<S>, at: (usize, &mut Values<'_>)) {
        let simd = wi.x.token();
        let (zero, one) = (F::splat(simd, 0.0), F::splat(simd, 1.0));
        let (wo, is_same_side) = (self.wo, (wi.z * self.wo.z).simd_gt(zero));
        let h = Vec3s::splat(simd, wo).plus(wi.times(is_same_side.select(one, F::splat(simd, eta_p))));
        let h2 = h.dot(h);
        // The microfacet normal is in the upper hemisphere.
        let scale = one.copysign(h.z) / h2.sqrt();
        let (o_m, i_m) = (h.dot_splat(wo) * scale, h.dot(wi) * scale);
        let faces = (i_m * wi.z).simd_gt(zero) & (o_m * wo.z).simd_gt(zero);

        let fresnel = fr_dielectric(o_m.abs(), eta_p);
        let d = facets.d(h, h2);
        let d_g = d * facets.g_cos(wi);
        let through = i_m + o_m * (1.0 / eta_p);
        let through = i_m.abs() / (through * through) * 4.0 * (one - fresnel);
        let f = d_g * is_same_side.select(fresnel, through * o_m.abs() * (1.0 / sqr(eta_p)));
        let pdf = d * facets.pdf_per_d * is_same_side.select(fresnel, through * o_m.abs());
        let is_seen = faces & wi.z.simd_ne(zero);
        write(is_seen, [f, f, f], pdf, at);
    }

    /// f·cos θi and density of the reflection by a rough interface, for directions of the same side, which counts as
    /// the outside.
    #[inline(always)]
    fn coat<S: Simd>(&self, facets: &Facets, eta: f32, wi: Vec3s<S>) -> (F<S>, F<S>) {
        let simd = wi.x.token();
        let zero = F::splat(simd, 0.0);
        let h = wi.plus(Vec3s::splat(simd, self.wo));
        let h2 = h.dot(h);
        let o_h = h.dot_splat(self.wo);
        let faces = o_h.simd_gt(zero) & h.dot(wi).simd_gt(zero);
        let fresnel = fr_dielectric(o_h / h2.sqrt(), eta);
        let d = facets.d(h, h2);
        (or_zero(faces, d * facets.g_cos(wi) * fresnel), or_zero(faces & fresnel.simd_gt(zero), d * facets.pdf_per_d))
    }
}

/// `a` where `first`, else `b`.
#[inline(always)]
fn either<S: Simd>(first: M<S>, a: f32, b: f32) -> F<S> {
    first.select(F::splat(first.token(), a), F::splat(first.token(), b))
}

/// Writes values where `keep`, and 0 elsewhere and where they are not finite.
#[inline(always)]
fn write<S: Simd>(keep: M<S>, f_cos: [F<S>; 3], pdf: F<S>, (i, out): (usize, &mut Values<'_>)) {
    let is_value = keep & f_cos[0].is_finite() & f_cos[1].is_finite() & f_cos[2].is_finite();
    let [red, green, blue] = &mut out.f_cos;
    store(or_zero(is_value, f_cos[0]), red, i);
    store(or_zero(is_value, f_cos[1]), green, i);
    store(or_zero(is_value, f_cos[2]), blue, i);
    store(or_zero(keep & pdf.is_finite(), pdf), out.pdf, i);
}

/// A GGX distribution seen from `wo`.
struct Facets {
    /// 1/α².
    inverse_alpha2: [f32; 2],
    alpha2: [f32; 2],
    /// 1/(π αx αy).
    d_scale: f32,
    /// 1/2 + Λ(wo).
    lambda: f32,
    /// 1/(4 |cos θo|).
    g_scale: f32,
    /// Density of a reflection per D: G1(wo)/(4 |cos θo|).
    pdf_per_d: f32,
}

impl Facets {
    fn new([ax, ay]: [f32; 2], wo: Vec3) -> Self {
        let (z2, g_scale) = (sqr(wo.z), 0.25 / wo.z.abs());
        let tan2 = (sqr(ax * wo.x) + sqr(ay * wo.y)) / z2;
        let lambda = if z2 > 0.0 { 0.5 * ((1.0 + tan2).sqrt() - 1.0) } else { f32::INFINITY };
        Facets {
            inverse_alpha2: [1.0 / sqr(ax), 1.0 / sqr(ay)],
            alpha2: [sqr(ax), sqr(ay)],
            d_scale: 1.0 / (PI * ax * ay),
            lambda: 0.5 + lambda,
            g_scale,
            pdf_per_d: g_scale / (1.0 + lambda),
        }
    }

    /// D of the normal along `h`, whose square is `h2`.
    #[inline(always)]
    fn d<S: Simd>(&self, h: Vec3s<S>, h2: F<S>) -> F<S> {
        let q = h.x * h.x * self.inverse_alpha2[0] + h.y * h.y * self.inverse_alpha2[1] + h.z * h.z;
        let ratio = h2 / q;
        ratio * ratio * self.d_scale
    }

    /// G(wo, wi)/(4 |cos θo|).
    #[inline(always)]
    fn g_cos<S: Simd>(&self, wi: Vec3s<S>) -> F<S> {
        let a = wi.x * wi.x * self.alpha2[0] + wi.y * wi.y * self.alpha2[1];
        let cos = wi.z.abs();
        cos * self.g_scale / (cos * self.lambda + (wi.z * wi.z + a).sqrt() * 0.5)
    }
}

/// A channel of a metal.
struct Metal {
    eta2_minus_k2: f32,
    /// 4η²k².
    product: f32,
}

impl Metal {
    fn new(eta: f32, k: f32) -> Self {
        Metal { eta2_minus_k2: sqr(eta) - sqr(k), product: 4.0 * sqr(eta) * sqr(k) }
    }

    /// Reflectance, as `bsdfs::fresnel::fr_complex`: with perpendicular p = (t1 − t2)/(t1 + t2) and parallel
    /// p (t3 − t4)/(t3 + t4), their mean is p t3/(t3 + t4).
    #[inline(always)]
    fn fresnel<S: Simd>(&self, cos: F<S>) -> F<S> {
        let simd = cos.token();
        let one = F::splat(simd, 1.0);
        let cos2 = cos * cos;
        let sin2 = one - cos2;
        let t0 = F::splat(simd, self.eta2_minus_k2) - sin2;
        let a2_plus_b2 = safe_sqrt(t0 * t0 + self.product);
        let a = safe_sqrt((a2_plus_b2 + t0) * 0.5);
        let t1 = a2_plus_b2 + cos2;
        let t2 = a * cos * 2.0;
        let t3 = cos2 * a2_plus_b2 + sin2 * sin2;
        let t4 = t2 * sin2;
        let divisor = (t1 + t2) * (t3 + t4);
        let r = ((t1 - t2) * t3 / divisor).max(0.0).min(1.0);
        divisor.simd_gt(F::splat(simd, 0.0)).select(r, one)
    }
}

/// Reflectance of a dielectric for cosines ≥ 0 on the side that η is relative to.
#[inline(always)]
fn fr_dielectric<S: Simd>(cos: F<S>, eta: f32) -> F<S> {
    let one = F::splat(cos.token(), 1.0);
    let cos = cos.min(1.0);
    let sin2_t = (one - cos * cos) * (1.0 / sqr(eta));
    let cos_t = safe_sqrt(one - sin2_t);
    let parallel = (cos * eta - cos_t) / (cos * eta + cos_t);
    let perpendicular = (cos - cos_t * eta) / (cos + cos_t * eta);
    let r = (parallel * parallel + perpendicular * perpendicular) * 0.5;
    sin2_t.simd_lt(one).select(r, one)
}

impl Transmittance<'_> {
    /// Along directions of cosine `cos` ≥ 0.
    #[inline(always)]
    fn along<S: Simd>(&self, cos: F<S>) -> F<S> {
        let simd = cos.token();
        match self {
            Transmittance::Table(rows, t) => {
                let steps = rows[0].len() - 1;
                let x = cos.max(0.0).min(1.0).sqrt() * steps as f32;
                let first: I<S> = x.min((steps - 1) as f32).to_int();
                let dx = x - first.to_float::<F<S>>();
                let below = table_row(simd, rows[0], first, dx);
                if *t == 0.0 {
                    return below;
                }
                below + (table_row(simd, rows[1], first, dx) - below) * *t
            }
            Transmittance::Smooth(eta, thickness) => {
                let (zero, one) = (F::splat(simd, 0.0), F::splat(simd, 1.0));
                let sin2_t = (one - cos * cos).max(0.0) * (1.0 / sqr(*eta));
                let cos_t = safe_sqrt(one - sin2_t);
                let fresnel = fr_dielectric(cos, *eta);
                let attenuation = if *thickness > 0.0 { exp(-F::splat(simd, *thickness) / cos_t) } else { one };
                or_zero(fresnel.simd_lt(one) & cos_t.simd_gt(zero), (one - fresnel) * attenuation)
            }
        }
    }
}

/// Linear between the entries `first` and the next ones.
#[inline(always)]
fn table_row<S: Simd>(simd: S, row: &[[f32; 2]], first: I<S>, dx: F<S>) -> F<S> {
    let mut ends = [[0.0; LANES]; 2];
    let first = first.to_array();
    for lane in 0..LANES {
        let i = first[lane] as usize;
        ends[0][lane] = row[i][0];
        ends[1][lane] = row[i + 1][0];
    }
    let (a, b) = (F::load_array(simd, ends[0]), F::load_array(simd, ends[1]));
    a + (b - a) * dx
}

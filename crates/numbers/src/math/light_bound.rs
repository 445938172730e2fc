//! Upper bounds of the contribution of lights with common bounds at a point [Conty Estévez and Kulla 2018; Pharr et al.
//! 2023, §12.6.3].
//!
//! The importance at p is I·cos θ′·cos θi′/max(d², r²). I is the total intensity, d the distance to the centre of the
//! bounding sphere, r its radius, θ′ the minimum angle between an emitter's normal and the direction to p, and θi′ the
//! minimum angle between the surface normal and a direction to the lights. Both arguments of the maximum are squared
//! lengths, so the result does not depend on the unit of length. On glossy surfaces, [`GlossyLobe::reflected`] replaces
//! cos θi′.
//!
//! The lobe is about the mirror direction of the viewer, as in BRDF-aware many-light sampling [Liu et al. 2019]. For
//! lights with the irradiance E on a plane facing them, the radiance reflected to the viewer is approximately
//! proportional to E·((1 − s) cos θi + s·π D(h) G₁(wo)/(4 cos θo)), where s is the lobe's fraction of the albedo and D
//! the density of isotropic GGX microfacets. The mean over lights within the angle b of wi is the value at wi with α² +
//! sin²b/4 instead of α², since half vectors rotate by half the angle of directions. It is at most of order 1/b², for
//! any α.

use super::number::Number;
use super::{Sphere, Vec3, safe_sqrt, sqr};

/// Slack of the cosines, for rounding: a light that can contribute never has importance 0.
const COSINE_SLACK: f32 = 1e-3;
/// Minimum probability of a child that can contribute; smaller ones are not resolved by f32 uniforms and 1 − p.
const MIN_PROBABILITY: f32 = 1.0 / (1 << 20) as f32;
/// Maximum fraction of the lobe: effects outside the model, such as anisotropy and multiple reflections, keep some
/// probability.
const MAX_SHARE: f32 = 0.95;

/// A vector, by component.
type Three<N> = [N; 3];

/// Number of the fields of a bound.
pub const BOUND_FIELDS: usize = 12;

/// Lights within a sphere and a cone of normals: centre of the sphere, its squared radius, axis of the cone (unit), cos
/// and sin of its half-angle θo, cos θe, the intensity I, and 1 if both sides emit, else 0.
#[derive(Clone, Copy, Debug)]
pub struct LightBound<N = f32>([N; BOUND_FIELDS]);

/// The data of a point for the choice of a light.
#[derive(Clone, Copy, Debug)]
pub struct Receiver<N> {
    /// Position.
    pub p: Three<N>,
    /// Shading normal, unit; zero if there is none.
    pub ns: Three<N>,
    /// The glossy lobe, if any.
    pub lobe: Option<GlossyLobe<N>>,
}

impl Receiver<f32> {
    /// The point in all lanes of a number like `number`.
    #[inline(always)]
    pub fn in_lanes<N: Number>(&self, number: N) -> Receiver<N> {
        let lobe = if let Some(GlossyLobe { wo, cos_o, alpha_squared, scale, diffuse }) = self.lobe {
            Some(GlossyLobe {
                wo: three(number, wo),
                cos_o: number.constant(cos_o),
                alpha_squared: number.constant(alpha_squared),
                scale: number.constant(scale),
                diffuse: number.constant(diffuse),
            })
        } else {
            None
        };
        Receiver { p: three(number, self.p), ns: three(number, self.ns), lobe }
    }
}

/// A lobe that reflects light to the viewer, beside a diffuse part.
#[derive(Clone, Copy, Debug)]
pub struct GlossyLobe<N = f32> {
    /// Direction to the viewer, unit.
    pub wo: Three<N>,
    /// Signed cosine of `wo` to the shading normal.
    pub cos_o: N,
    /// α² of the microfacets.
    pub alpha_squared: N,
    /// s G₁(wo)/(4 |cos θo|); 0 if there is no lobe.
    pub scale: N,
    /// 1 − s.
    pub diffuse: N,
}

// No closures: in kernels their code would be compiled without vector instructions

#[inline(always)]
fn three<N: Number>(number: N, [x, y, z]: Three<f32>) -> Three<N> {
    [number.constant(x), number.constant(y), number.constant(z)]
}

#[inline(always)]
fn dot<N: Number>(a: Three<N>, b: Three<N>) -> N {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The sine that belongs to the cosine x, or vice versa.
#[inline(always)]
fn other<N: Number>(x: N) -> N {
    (x.constant(1.0) - x * x).greater(x.constant(0.0)).root()
}

/// cos(max(0, a − b)), by [sin, cos] of both.
#[inline(always)]
fn cos_of_difference<N: Number>([sin_a, cos_a]: [N; 2], [sin_b, cos_b]: [N; 2]) -> N {
    cos_a.if_above(cos_b, cos_a.constant(1.0), cos_a * cos_b + sin_a * sin_b)
}

/// sin(max(0, a − b)).
#[inline(always)]
fn sin_of_difference<N: Number>([sin_a, cos_a]: [N; 2], [sin_b, cos_b]: [N; 2]) -> N {
    cos_a.if_above(cos_b, cos_a.constant(0.0), sin_a * cos_b - cos_a * sin_b)
}

impl LightBound {
    /// Lights within a sphere, with normals in the cone of half-angle θo about `axis`, and emission within the angle θe
    /// of the normals; on both sides if `two_sided`.
    pub fn new(
        Sphere { center, radius }: Sphere,
        axis: Vec3,
        [cos_theta_o, cos_theta_e]: [f32; 2],
        two_sided: bool,
        intensity: f32,
    ) -> Self {
        let (radius_squared, sin_theta_o) = (sqr(radius), safe_sqrt(1.0 - sqr(cos_theta_o)));
        let ([x, y, z], [ax, ay, az]) = (center.to_array(), axis.to_array());
        let sides = if two_sided { 1.0 } else { 0.0 };
        let cosines = [cos_theta_o, sin_theta_o, cos_theta_e];
        LightBound([x, y, z, radius_squared, ax, ay, az, cosines[0], cosines[1], cosines[2], intensity, sides])
    }

    /// The bound in all lanes of a number like `number`.
    #[inline(always)]
    pub fn in_lanes<N: Number>(&self, number: N) -> LightBound<N> {
        let [x, y, z, r2, ax, ay, az, cos_o, sin_o, cos_e, intensity, two_sided] = self.0;
        LightBound([
            number.constant(x),
            number.constant(y),
            number.constant(z),
            number.constant(r2),
            number.constant(ax),
            number.constant(ay),
            number.constant(az),
            number.constant(cos_o),
            number.constant(sin_o),
            number.constant(cos_e),
            number.constant(intensity),
            number.constant(two_sided),
        ])
    }

    /// Square of the sphere's radius.
    pub fn radius_squared(&self) -> f32 {
        self.0[3]
    }

    /// The fields, for [`Self::of_fields`].
    #[inline(always)]
    pub fn fields(&self) -> &[f32; BOUND_FIELDS] {
        &self.0
    }
}

impl<N: Number> LightBound<N> {
    /// The bound with these fields.
    #[inline(always)]
    pub fn of_fields(fields: [N; BOUND_FIELDS]) -> Self {
        LightBound(fields)
    }

    /// I, in the unit of intensities.
    #[inline(always)]
    pub fn intensity(&self) -> N {
        self.0[10]
    }

    /// Upper bound, up to a common factor, of the contribution of the lights; 0 if none can contribute.
    #[inline(always)]
    pub fn importance(&self, at: &Receiver<N>) -> N {
        let number = at.p[0];
        let (zero, one, slack) = (number.constant(0.0), number.constant(1.0), number.constant(COSINE_SLACK));
        let [x, y, z, radius_squared, ax, ay, az, cos_theta_o, sin_theta_o, cos_theta_e, intensity, two_sided] = self.0;
        let near = radius_squared.if_above(zero, intensity / radius_squared, zero);

        let d = [x - at.p[0], y - at.p[1], z - at.p[2]];
        let d2 = dot(d, d);
        if radius_squared.is_above(d2) {
            return near;
        }
        let length = d2.root();
        let wi = [d[0] / length, d[1] / length, d[2] / length];
        let sin2_b = radius_squared / d2;
        let b = [sin2_b.root(), (one - sin2_b).greater(zero).root()];

        // Angle between the axis and the direction to p, minus the cone of normals, minus the angular extent
        let cos_axis = zero - dot(wi, [ax, ay, az]);
        let cos_w = two_sided.if_above(zero, cos_axis.magnitude(), cos_axis);
        let w = [other(cos_w), cos_w];
        let o = [sin_theta_o, cos_theta_o];
        let x = [sin_of_difference(w, o), cos_of_difference(w, o)];
        let cos_light = cos_of_difference(x, b);
        let is_seen = cos_theta_e - slack;
        if is_seen.is_above(cos_light) {
            return radius_squared.if_at_least(d2, near, zero);
        }
        let importance = intensity * cos_light.greater(slack) / d2;

        // The surface may transmit, so light from behind counts too
        let cos = dot(wi, at.ns);
        let cos_i = cos.magnitude().lesser(one);
        let cos_max = cos_of_difference([other(cos_i), cos_i], b).greater(slack);
        let reflected = if let Some(lobe) = &at.lobe { lobe.reflected(wi, cos, sin2_b, cos_max) } else { cos_max };
        let far = dot(at.ns, at.ns).if_above(zero, importance * reflected, importance);
        radius_squared.if_at_least(d2, near, cos_light.if_at_least(is_seen, far, zero))
    }
}

/// Probability of the first of two bounds, by their importances. If neither can contribute, the intensities decide.
#[inline(always)]
pub fn first_probability<N: Number>([a, b]: [N; 2], intensities: [N; 2]) -> N {
    let (zero, least, most) = (a.constant(0.0), a.constant(MIN_PROBABILITY), a.constant(1.0 - MIN_PROBABILITY));
    let p = (a / (a + b)).finite_or(intensities[0] / (intensities[0] + intensities[1]));
    a.if_above(zero, b.if_above(zero, p.greater(least).lesser(most), p), p)
}

impl GlossyLobe {
    /// No lobe: purely diffuse.
    pub const NONE: GlossyLobe = GlossyLobe { wo: [0.0; 3], cos_o: 0.0, alpha_squared: 0.0, scale: 0.0, diffuse: 1.0 };

    /// The lobe of microfacets of roughness `alpha` about the shading normal `ns`, with the fraction `share` (0 to 1)
    /// of the albedo for the direction `wo`; all vectors unit.
    pub fn new(wo: Vec3, ns: Vec3, alpha: f32, share: f32) -> Self {
        let (cos_o, alpha_squared, share) = (wo.dot(ns), sqr(alpha), share.min(MAX_SHARE));
        // G₁/|cos θo| of GGX, finite at the horizon
        let visible = 2.0 / (cos_o.abs() + (alpha_squared + (1.0 - alpha_squared) * sqr(cos_o)).sqrt());
        if !(share > 0.0) || !visible.is_finite() {
            return Self::NONE;
        }
        GlossyLobe { wo: wo.to_array(), cos_o, alpha_squared, scale: 0.25 * share * visible, diffuse: 1.0 - share }
    }
}

impl<N: Number> GlossyLobe<N> {
    /// π·f·|cos θi| over the albedo, for lights within an angle of the sine √`sin2_b` of the direction `wi`. `cos_i` is
    /// its cosine to the shading normal; `cos_max` is the maximum absolute cosine among these lights.
    #[inline(always)]
    pub fn reflected(&self, wi: Three<N>, cos_i: N, sin2_b: N, cos_max: N) -> N {
        let (zero, one, quarter) = (cos_i.constant(0.0), cos_i.constant(1.0), cos_i.constant(0.25));
        let (two, least) = (cos_i.constant(2.0), cos_i.constant(1e-6));
        let diffuse = self.diffuse * cos_max;
        let sum = self.cos_o + cos_i;
        let cos2_h = (sum * sum / (two * (one + dot(self.wo, wi))).greater(least)).lesser(one);
        let alpha_squared = self.alpha_squared + quarter * sin2_b;
        let denominator = one - cos2_h * (one - alpha_squared);
        let lobe = diffuse + self.scale * alpha_squared / (denominator * denominator);
        // No lobe if all lights are on the other side
        let beyond = (cos_i * cos_i).if_at_least(sin2_b, diffuse, lobe);
        self.scale.if_above(zero, (cos_i * self.cos_o).if_above(zero, lobe, beyond), diffuse)
    }
}

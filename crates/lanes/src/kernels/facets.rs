//! The GGX (Trowbridge–Reitz) distribution of microfacet normals with Smith's height-correlated shadowing.
//!
//! D(m) = 1 / (π αx αy (x²/αx² + y²/αy² + z²)²), Λ(w) = (√(1 + α²tan²θ) − 1)/2, G1 = 1/(1 + Λ),
//! G = 1/(1 + Λ(wo) + Λ(wi)) [Walter et al. 2007; Heitz 2014]. Normals are sampled from the distribution of visible
//! normals, D_w(m) = G1(w) D(m) max(0, w·m)/cos θ, by spherical caps [Dupuy and Benyoub 2023].
//!
//! With L(w) = √(cos²θ + (αx x)² + (αy y)²), which avoids the tangent,
//! G/(4 |cos θo|) = |cos θi|/(2 (|cos θi| L(wo) + |cos θo| L(wi))) and G1(wo)/(4 |cos θo|) = 1/(2 (|cos θo| + L(wo))).

use super::bsdf_kernel::GreyValue;
use lumiris_numbers::math::elementary::{SinCos, sin_cos_turn};
use lumiris_numbers::math::number::Number;
use lumiris_numbers::math::v3::V3;
use std::f32::consts::PI;

/// Alpha below which an interface is perfectly smooth.
pub const SMOOTH_ALPHA: f32 = 1e-3;

/// GGX distribution of normals m with m.z > 0.
#[derive(Clone, Copy, Debug)]
pub struct Facets<N> {
    /// Roughness along x; 0 is smooth.
    pub alpha_x: N,
    /// Roughness along y; 0 is smooth.
    pub alpha_y: N,
}

impl<N: Number> Facets<N> {
    /// True for a perfect mirror.
    #[inline(always)]
    pub fn is_smooth(self) -> N::Mask {
        self.alpha_x.constant(SMOOTH_ALPHA).above(self.alpha_x.greater(self.alpha_y))
    }

    /// D(m) for a normal along `h`, which may have any length (1/sr).
    #[inline(always)]
    pub fn d(self, h: V3<N>) -> N {
        let (x, y) = (h.x / self.alpha_x, h.y / self.alpha_y);
        let ratio = h.dot(h) / (x * x + y * y + h.z * h.z);
        ratio * ratio / (self.alpha_x * self.alpha_y * PI)
    }

    /// L(w).
    #[inline(always)]
    pub fn l(self, w: V3<N>) -> N {
        let (x, y) = (self.alpha_x * w.x, self.alpha_y * w.y);
        (w.z * w.z + x * x + y * y).root()
    }

    /// G/(4 |cos θo|) from L of both directions.
    #[inline(always)]
    pub fn g_cos(cos_o: N, cos_i: N, l_o: N, l_i: N) -> N {
        let (o, i) = (cos_o.magnitude(), cos_i.magnitude());
        i * 0.5 / (i * l_o + o * l_i)
    }

    /// G1(wo)/(4 |cos θo|) from L(wo).
    #[inline(always)]
    pub fn g1_over_cos(cos_o: N, l_o: N) -> N {
        cos_o.constant(0.5) / (cos_o.magnitude() + l_o)
    }

    /// Reflection by normals visible from `wo`: D G/(4 |cos θo|), as of a surface that reflects all light, and its
    /// density. `h` is along the half vector.
    #[inline(always)]
    pub fn reflection(self, wo: V3<N>, wi: V3<N>, h: V3<N>) -> GreyValue<N> {
        let (d, l_o) = (self.d(h), self.l(wo));
        GreyValue { f_cos: d * Self::g_cos(wo.z, wi.z, l_o, self.l(wi)), pdf: d * Self::g1_over_cos(wo.z, l_o) }
    }

    /// Density (1/sr) of reflection by normals visible from `wo`.
    #[inline(always)]
    pub fn pdf_reflection(self, wo: V3<N>, wi: V3<N>) -> N {
        self.d(wo.plus(wi)) * Self::g1_over_cos(wo.z, self.l(wo))
    }

    /// Samples a normal visible from `w`, or from `-w` if `w` is below the horizon. The normal is in the upper
    /// hemisphere.
    #[inline(always)]
    pub fn sample_m(self, w: V3<N>, u: [N; 2]) -> V3<N> {
        let (zero, one) = (w.z.constant(0.0), w.z.constant(1.0));
        // Stretch so that the distribution becomes a hemisphere
        let stretched = V3 { x: w.x * self.alpha_x, y: w.y * self.alpha_y, z: w.z }.unit();
        let h =
            V3::choose(zero.above(stretched.z), V3 { x: -stretched.x, y: -stretched.y, z: -stretched.z }, stretched);
        // A uniform point of the cap of directions that reflect `h` to the upper hemisphere
        let z = (one - u[1]) * (h.z + 1.0) - h.z;
        let sin = (one - z * z).safe_root();
        let SinCos { sin: sin_phi, cos: cos_phi } = sin_cos_turn(u[0]);
        let m = V3 { x: sin * cos_phi, y: sin * sin_phi, z }.plus(h);
        V3 { x: m.x * self.alpha_x, y: m.y * self.alpha_y, z: m.z.greater(w.z.constant(1e-6)) }.unit()
    }
}

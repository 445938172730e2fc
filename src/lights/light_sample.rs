//! Arguments and results of lights: the illuminated point, sampled directions towards a light, hits, and emitted rays.

use lumiris_numbers::math::light_bound::{GlossyLobe, Receiver};
use lumiris_numbers::math::{Rgb, Vec2, Vec3};

/// Index into [`LightSet::lights`](crate::lights::LightSet::lights).
pub type LightId = u32;

/// The illuminated point.
#[derive(Clone, Copy, Debug)]
pub struct LightCtx {
    /// Position.
    pub p: Vec3,
    /// Geometric normal, unit, on the illuminated side; zero if there is none, or if both sides are illuminated.
    pub n: Vec3,
    /// Shading normal, unit; zero if there is none.
    pub ns: Vec3,
    /// Glossy lobe, which the choice of a light takes into account.
    pub lobe: GlossyLobe,
}

impl LightCtx {
    /// A point without a surface.
    #[inline]
    pub fn at(p: Vec3) -> Self {
        LightCtx { p, n: Vec3::ZERO, ns: Vec3::ZERO, lobe: GlossyLobe::NONE }
    }

    /// A point of a diffuse surface of this normal.
    #[inline]
    pub fn on(p: Vec3, n: Vec3) -> Self {
        LightCtx { p, n, ns: n, lobe: GlossyLobe::NONE }
    }

    /// Input of the light bounds for this point.
    #[inline]
    pub fn receiver(&self) -> Receiver<f32> {
        let lobe = Some(self.lobe).filter(|lobe| lobe.scale > 0.0);
        Receiver { p: self.p.to_array(), ns: self.ns.to_array(), lobe }
    }

    /// The point as if the surface were diffuse.
    #[inline]
    #[must_use]
    pub fn diffuse(&self) -> Self {
        LightCtx { lobe: GlossyLobe::NONE, ..*self }
    }
}

/// A direction sampled towards a light.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unoccluded incident radiance. It may be black where parts of a light do not emit.
    /// For delta lights it is the weight of the delta, with `pdf` 1.
    pub li: Rgb,
    /// Unit direction to the light.
    pub wi: Vec3,
    /// Density per steradian; 1 for delta lights; positive and finite.
    pub pdf: f32,
    /// Distance along `wi` to the light; infinite for infinite lights.
    pub t: f32,
    /// The point on the light; unused for infinite lights.
    pub p: Vec3,
    /// Normal of the light at `p` on its emitting side; zero for lights without a surface.
    pub n: Vec3,
    /// Bound of the rounding error of `p` per axis; zero for infinite lights.
    pub p_error: Vec3,
    /// True if no other technique can sample this direction.
    pub is_delta: bool,
}

/// A light and a direction sampled towards it.
#[derive(Clone, Copy, Debug)]
pub struct SampleOfLight {
    /// The light.
    pub light: LightId,
    /// The direction; its density includes the choice of the light.
    pub sample: LightSample,
}

/// Radiance from a direction, and the density of sampling that direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeAndPdf {
    /// Radiance.
    pub le: Rgb,
    /// Density (1/sr).
    pub pdf: f32,
}

impl LeAndPdf {
    /// No radiance, and no samples.
    pub const ZERO: LeAndPdf = LeAndPdf { le: Rgb::BLACK, pdf: 0.0 };
}

/// A point of a surface.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// Position.
    pub p: Vec3,
    /// Unit normal on the illuminated or visible side.
    pub n: Vec3,
}

/// The intersection of a ray in direction wi with a light.
#[derive(Clone, Copy, Debug)]
pub struct LightHit {
    /// Distance.
    pub t: f32,
    /// The point on the light.
    pub p: Vec3,
    /// Geometric normal there, unit, as oriented by the shape.
    pub n: Vec3,
    /// Texture coordinates there.
    pub uv: Vec2,
}

impl LightHit {
    /// The "hit" of an infinite light.
    pub const INFINITE: LightHit = LightHit { t: f32::INFINITY, p: Vec3::ZERO, n: Vec3::ZERO, uv: Vec2::ZERO };
}

/// A photon leaving a light.
#[derive(Clone, Copy, Debug)]
pub struct EmissionSample {
    /// Origin.
    pub p: Vec3,
    /// Bound of the rounding error of `p` per axis; zero without a surface.
    pub p_error: Vec3,
    /// Normal of the surface there, on the emitting side; zero without a surface.
    pub n: Vec3,
    /// Unit direction, away from the light.
    pub d: Vec3,
    /// Its power (W): Le·|cos θ| divided by the densities of position and direction. Its mean is the emitted flux.
    pub power: Rgb,
}

/// A point of a surface, and the radiance that leaves it in a direction.
#[derive(Clone, Copy, Debug)]
pub struct EmittingPoint {
    /// The point.
    pub p: Vec3,
    /// Bound of its rounding error per axis.
    pub p_error: Vec3,
    /// Normal on the side of the direction.
    pub n: Vec3,
    /// Density of the point (1/m²).
    pub pdf_area: f32,
    /// Radiance that leaves the point; black on a side that does not emit.
    pub radiance: Rgb,
}

impl EmissionSample {
    /// A photon of a light without a surface.
    pub(in crate::lights) fn in_space(p: Vec3, d: Vec3, power: Rgb) -> Option<Self> {
        EmissionSample { p, p_error: Vec3::ZERO, n: Vec3::ZERO, d, power }.if_lit()
    }

    /// `None` if it carries no power or is not finite.
    pub(super) fn if_lit(self) -> Option<Self> {
        (!self.power.is_black() && self.power.is_finite() && self.p.is_finite() && self.d.is_finite()).then_some(self)
    }
}

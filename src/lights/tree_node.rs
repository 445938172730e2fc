//! A node of a [`LightTree`](super::LightTree), and the importance of the lights below it.

use super::{LightBounds, LightCtx};
use lumiris_numbers::math::{Vec3, safe_sqrt, sqr};

/// Slack of the cosines, for rounding: a light that can contribute never has importance 0.
const COSINE_SLACK: f32 = 1e-3;

/// Lights with a common bound.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    center: Vec3,
    pub(super) radius_squared: f32,
    axis: Vec3,
    cos_theta_o: f32,
    sin_theta_o: f32,
    cos_theta_e: f32,
    pub(super) intensity: f32,
    two_sided: bool,
    pub(super) is_leaf: bool,
    /// The light of a leaf, or the right child; the left child follows its parent.
    pub(super) index: u32,
}

/// cos(max(0, a − b)).
#[inline]
fn cos_of_difference(sin_a: f32, cos_a: f32, sin_b: f32, cos_b: f32) -> f32 {
    if cos_a > cos_b { 1.0 } else { cos_a * cos_b + sin_a * sin_b }
}

/// sin(max(0, a − b)).
#[inline]
fn sin_of_difference(sin_a: f32, cos_a: f32, sin_b: f32, cos_b: f32) -> f32 {
    if cos_a > cos_b { 0.0 } else { sin_a * cos_b - cos_a * sin_b }
}

impl Node {
    pub(super) fn new(b: &LightBounds, is_leaf: bool, index: u32) -> Self {
        let center = b.bounds.center();
        let radius = (b.bounds.max - center).length() + 4.0 * f32::EPSILON * center.abs().max_element();
        Node {
            center,
            radius_squared: sqr(radius),
            axis: b.axis,
            cos_theta_o: b.cos_theta_o,
            sin_theta_o: safe_sqrt(1.0 - sqr(b.cos_theta_o)),
            cos_theta_e: b.cos_theta_e,
            intensity: b.intensity,
            two_sided: b.two_sided,
            is_leaf,
            index,
        }
    }

    #[inline]
    pub(super) fn importance(&self, ctx: &LightCtx) -> f32 {
        let d = self.center - ctx.p;
        let d2 = d.length_squared();
        if d2 <= self.radius_squared {
            return if self.radius_squared > 0.0 { self.intensity / self.radius_squared } else { 0.0 };
        }
        let wi = d / d2.sqrt();
        let sin2_b = self.radius_squared / d2;
        let (sin_b, cos_b) = (sin2_b.sqrt(), safe_sqrt(1.0 - sin2_b));

        // Angle between the axis and the direction to p, less the cone of normals, less the node's extent.
        let cos_axis = -wi.dot(self.axis);
        let cos_w = if self.two_sided { cos_axis.abs() } else { cos_axis };
        let sin_w = safe_sqrt(1.0 - sqr(cos_w));
        let cos_x = cos_of_difference(sin_w, cos_w, self.sin_theta_o, self.cos_theta_o);
        let sin_x = sin_of_difference(sin_w, cos_w, self.sin_theta_o, self.cos_theta_o);
        let cos_light = cos_of_difference(sin_x, cos_x, sin_b, cos_b);
        if cos_light < self.cos_theta_e - COSINE_SLACK {
            return 0.0;
        }
        let importance = self.intensity * cos_light.max(COSINE_SLACK) / d2;
        if ctx.ns == Vec3::ZERO {
            return importance;
        }

        // The surface may transmit, so light from its back counts too.
        let cos = wi.dot(ctx.ns);
        let cos_i = cos.abs().min(1.0);
        let sin_i = safe_sqrt(1.0 - sqr(cos_i));
        let cos_max = cos_of_difference(sin_i, cos_i, sin_b, cos_b).max(COSINE_SLACK);
        importance * ctx.lobe.reflected(wi, cos, sin2_b, cos_max)
    }
}

//! A node of a [`LightTree`](super::light_tree::LightTree).

use crate::lights::{LightBounds, LightCtx};
use lumiris_numbers::math::Sphere;
use lumiris_numbers::math::light_bound::LightBound;

/// Lights with a common bound.
#[derive(Clone, Copy, Debug)]
pub(in crate::lights) struct Node {
    pub(in crate::lights) bound: LightBound,
    pub(in crate::lights) is_leaf: bool,
    /// The light of a leaf, or the index of the right child; the left child follows its parent.
    pub(in crate::lights) light_or_right_child: u32,
}

impl Node {
    pub(in crate::lights) fn new(b: &LightBounds, is_leaf: bool, light_or_right_child: u32) -> Self {
        let center = b.bounds.center();
        let radius = (b.bounds.max - center).length() + 4.0 * f32::EPSILON * center.abs().max_element();
        let cosines = [b.cos_theta_o, b.cos_theta_e];
        let bound = LightBound::new(Sphere { center, radius }, b.axis, cosines, b.two_sided, b.intensity);
        Node { bound, is_leaf, light_or_right_child }
    }

    #[inline]
    pub(in crate::lights) fn importance(&self, ctx: &LightCtx) -> f32 {
        self.bound.importance(&ctx.receiver())
    }
}

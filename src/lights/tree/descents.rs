//! Choices of lights at several points at once: their descents of a [`LightTree`] go level by level in SIMD lanes.

use super::light_tree::LightTree;
use super::sampled_light::SampledLight;
use lumiris_lanes::level;
use lumiris_lanes::light_descent::{DESCENTS, Descents, Photons, descend};
use lumiris_lanes::light_tree::Receivers;
use lumiris_numbers::math::light_bound::Receiver;
use std::hint::select_unpredictable;
use std::ops::Range;

/// The choice of a light at a point by photons, to be made.
#[derive(Clone, Copy, Debug)]
pub(in crate::lights) struct Draw<'a> {
    /// The point.
    pub(in crate::lights) at: Receiver<f32>,
    /// A random number in [0, 1).
    pub(in crate::lights) u: f32,
    /// Indices of leaves, ascending, whose lights have photons. They are chosen only if no other light can contribute.
    pub(in crate::lights) leaves: &'a [u32],
}

/// A light chosen by photons.
#[derive(Clone, Copy, Debug)]
pub(in crate::lights) struct Drawn {
    pub(in crate::lights) light: SampledLight,
    /// Importance of the light.
    pub(in crate::lights) importance: f32,
    /// The same for a diffuse surface.
    pub(in crate::lights) diffuse_importance: f32,
}

/// The photons of lights in a tree.
#[derive(Clone, Copy)]
struct TreePhotons<'a> {
    /// Irradiance per photon of each node.
    of_one: &'a [f32],
    /// [`Draw::leaves`] of each descent.
    leaves: [&'a [u32]; DESCENTS],
}

impl LightTree {
    /// Chooses a light by each of `u` at the points `rows`, at most [`DESCENTS`], as [`Self::sample`]. `None` if there is
    /// none. `descents` is scratch memory.
    pub(in crate::lights) fn sample_rows(
        &self,
        at: &Receivers<'_>,
        rows: Range<usize>,
        u: &[f32],
        descents: &mut Descents,
    ) -> [Option<SampledLight>; DESCENTS] {
        if self.is_empty() {
            return [None; DESCENTS];
        }
        let count = rows.len();
        descents.begin_rows(at, rows, u);
        let leaves = self.descend_lanes(descents, count, None);
        std::array::from_fn(|lane| self.light_at(leaves[lane], descents, lane))
    }

    /// Chooses a light for each draw, in proportion to the importances times √V̂, where `of_one` has the irradiance per
    /// photon of each node. `take` gets the index of the draw, and `None` if there is no light.
    pub(in crate::lights) fn sample_by_photons(
        &self,
        draws: &[Draw<'_>],
        of_one: &[f32],
        mut take: impl FnMut(usize, Option<Drawn>),
    ) {
        if self.is_empty() {
            return (0..draws.len()).for_each(|i| take(i, None));
        }
        for (block, draws) in draws.chunks(DESCENTS).enumerate() {
            // Begin at the root, whose importance counts if it is the only node
            let (mut descents, mut leaves) = (Descents::default(), [&[][..]; DESCENTS]);
            for (lane, draw) in draws.iter().enumerate() {
                descents.begin(lane, &draw.at, draw.u);
                leaves[lane] = draw.leaves;
                if !self.has_choice() {
                    let diffuse = Receiver { lobe: None, ..draw.at };
                    descents.importance[lane] = self.nodes[0].bound.importance(&draw.at);
                    descents.diffuse_importance[lane] = self.nodes[0].bound.importance(&diffuse);
                }
            }

            // Descend
            let nodes = self.descend_lanes(&mut descents, draws.len(), Some(TreePhotons { of_one, leaves }));
            for (lane, &node) in nodes[..draws.len()].iter().enumerate() {
                let drawn = self.light_at(node, &descents, lane).map(|light| Drawn {
                    light,
                    importance: descents.importance[lane],
                    diffuse_importance: descents.diffuse_importance[lane],
                });
                take(block * DESCENTS + lane, drawn);
            }
        }
    }

    /// The light of the leaf that a descent has reached.
    #[inline]
    fn light_at(&self, leaf: u32, descents: &Descents, lane: usize) -> Option<SampledLight> {
        let (light, pmf) = (self.nodes[leaf as usize].light_or_right_child, descents.pmf[lane]);
        (pmf > 0.0).then_some(SampledLight { light, pmf, u: descents.u[lane] })
    }

    /// Follows the first `count` descents from the root to leaves. The others stay at a leaf.
    #[inline]
    fn descend_lanes(
        &self,
        descents: &mut Descents,
        count: usize,
        mut photons: Option<TreePhotons<'_>>,
    ) -> [u32; DESCENTS] {
        let mut nodes = [self.nodes.len() as u32 - 1; DESCENTS];
        nodes[..count].fill(0);
        let mut children = [[&self.nodes[0].bound; DESCENTS]; 2];
        let mut of_children = photons.map(|_| [Photons::default(); 2]);
        let mut is_any_inner = self.has_choice();
        while is_any_inner {
            // The children. Descents at a leaf stay there, without branches, which would be predicted wrongly
            let mut pairs = [[0; 2]; DESCENTS];
            for lane in 0..DESCENTS {
                let index = nodes[lane];
                let node = &self.nodes[index as usize];
                let pair = select_unpredictable(node.is_leaf, [index; 2], [index + 1, node.light_or_right_child]);
                children[0][lane] = &self.nodes[pair[0] as usize].bound;
                children[1][lane] = &self.nodes[pair[1] as usize].bound;
                descents.is_inner[lane] = f32::from(u8::from(!node.is_leaf));
                pairs[lane] = pair;
            }

            // The photons below them, as in `left_by`, and the choice
            let mut middles = [0; DESCENTS];
            if let (Some(TreePhotons { of_one, leaves }), Some(of_children)) = (&photons, &mut of_children) {
                for (lane, (pair, leaves)) in pairs.iter().zip(leaves).enumerate() {
                    middles[lane] = leaves.partition_point(|&leaf| leaf < pair[1]);
                    let counts = [middles[lane], leaves.len() - middles[lane]];
                    for (side, of_child) in of_children.iter_mut().enumerate() {
                        let is_closed = counts[side] > 0 && self.nodes[pair[side] as usize].is_leaf;
                        of_child.count[lane] = if is_closed { -1.0 } else { counts[side] as f32 };
                        of_child.of_one[lane] = of_one[pair[side] as usize];
                    }
                }
            }
            descend(level(), [&children[0], &children[1]], of_children.as_ref(), descents);

            // The chosen children
            is_any_inner = false;
            for (lane, pair) in pairs.iter().enumerate() {
                let is_left = descents.is_left[lane] > 0.0;
                nodes[lane] = select_unpredictable(is_left, pair[0], pair[1]);
                is_any_inner |= !self.nodes[nodes[lane] as usize].is_leaf;
                if let Some(TreePhotons { leaves, .. }) = &mut photons {
                    let (left, right) = leaves[lane].split_at(middles[lane]);
                    leaves[lane] = if is_left { left } else { right };
                }
            }
        }
        nodes
    }
}

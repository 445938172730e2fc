//! Building a [`LightTree`](super::light_tree::LightTree), from the root down.

use super::node::Node;
use crate::lights::{LightBounds, LightId};
use lumiris_numbers::math::{Bounds3, Vec3};

/// Maximum depth of heuristic splits. Below it, lights are split in halves, so that the trail of any leaf fits 64 bits.
const MAX_HEURISTIC_DEPTH: u32 = 30;
/// Number of split candidates per axis, plus one.
const BUCKETS: usize = 12;
/// Number of lights above which subtrees, and the axes of a split, are processed in parallel.
const MANY: usize = 4096;

/// A light to be inserted.
pub(super) struct Item {
    pub(super) id: LightId,
    pub(super) bounds: LightBounds,
    pub(super) center: Vec3,
}

#[inline]
fn bucket(center: f32, min: f32, extent: f32) -> usize {
    (((center - min) / extent * BUCKETS as f32) as usize).min(BUCKETS - 1)
}

/// Builds the subtree over n `items` into the 2n − 1 `nodes`; `first` is the index of the first node.
pub(super) fn build(nodes: &mut [Node], first: u32, items: &mut [Item], depth: u32) -> LightBounds {
    if let [item] = items {
        nodes[0] = Node::new(&item.bounds, true, item.id);
        return item.bounds;
    }
    let is_large = items.len() > MANY;
    let middle = if depth < MAX_HEURISTIC_DEPTH { split(items) } else { items.len() / 2 };
    let (left_items, right_items) = items.split_at_mut(middle);
    let (left_nodes, right_nodes) = nodes[1..].split_at_mut(2 * middle - 1);
    let right_index = first + 2 * middle as u32;
    let mut left = || build(left_nodes, first + 1, left_items, depth + 1);
    let mut right = || build(right_nodes, right_index, right_items, depth + 1);
    let (left, right) = if is_large { rayon::join(left, right) } else { (left(), right()) };
    let bounds = left.union(&right);
    nodes[0] = Node::new(&bounds, false, right_index);
    bounds
}

/// Reorders at least two items and returns the split index; neither part is empty.
fn split(items: &mut [Item]) -> usize {
    let centers = Bounds3::from_points(items.iter().map(|i| i.center));
    let all = items.iter().fold(Bounds3::EMPTY, |b, i| b.union(i.bounds.bounds));
    let (diagonal, longest) = (all.diagonal(), all.diagonal().max_element());
    let cut = |axis: usize| {
        let (min, extent) = (centers.min[axis], centers.max[axis] - centers.min[axis]);
        if extent <= 0.0 || !extent.is_finite() {
            return None;
        }
        // Long thin parts are worse: regularise by the aspect ratio.
        let stretch = longest / diagonal[axis];
        best_cut(items, axis, min, extent).map(|cut| Cut { cost: cut.cost * stretch, ..cut })
    };
    let cuts = if items.len() > MANY {
        let (x, (y, z)) = rayon::join(|| cut(0), || rayon::join(|| cut(1), || cut(2)));
        [x, y, z]
    } else {
        [cut(0), cut(1), cut(2)]
    };
    let cheaper = |best: Cut, other: Cut| if other.cost < best.cost { other } else { best };
    let best = cuts.into_iter().flatten().reduce(cheaper);
    let Some(Cut { axis, bucket: cut, .. }) = best else { return items.len() / 2 };

    let (min, extent) = (centers.min[axis], centers.max[axis] - centers.min[axis]);
    let mut middle = 0;
    for i in 0..items.len() {
        if bucket(items[i].center[axis], min, extent) < cut {
            items.swap(i, middle);
            middle += 1;
        }
    }
    middle
}

/// A split along an axis.
struct Cut {
    cost: f32,
    axis: usize,
    /// The first bucket right of the split.
    bucket: usize,
}

/// The split of minimum cost along an axis.
fn best_cut(items: &[Item], axis: usize, min: f32, extent: f32) -> Option<Cut> {
    let mut buckets = [LightBounds::EMPTY; BUCKETS];
    for item in items {
        let b = &mut buckets[bucket(item.center[axis], min, extent)];
        *b = b.union(&item.bounds);
    }
    // Costs right of each split, from the end; then left costs from the start.
    let mut right_costs = [0.0; BUCKETS];
    let mut right = LightBounds::EMPTY;
    for i in (1..BUCKETS).rev() {
        right = right.union(&buckets[i]);
        right_costs[i] = if right.intensity > 0.0 { right.cost() } else { f32::INFINITY };
    }
    let mut left = LightBounds::EMPTY;
    let mut best: Option<Cut> = None;
    for bucket in 1..BUCKETS {
        left = left.union(&buckets[bucket - 1]);
        let cost = left.cost() + right_costs[bucket];
        if left.intensity > 0.0
            && right_costs[bucket] < f32::INFINITY
            && best.as_ref().is_none_or(|best| cost < best.cost)
        {
            best = Some(Cut { cost, axis, bucket });
        }
    }
    best
}

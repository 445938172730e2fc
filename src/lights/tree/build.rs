//! Building a [`LightTree`](super::light_tree::LightTree), from the root down.

use super::node::Node;
use crate::lights::{LightBounds, LightId};
use lumiris_numbers::math::{Bounds3, Vec3, Vec3A};

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
}

impl Item {
    #[inline]
    fn center(&self) -> Vec3 {
        self.bounds.bounds.center()
    }
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
    let (mut centers, mut all) = (Bounds3::EMPTY, Bounds3::EMPTY);
    for item in &*items {
        centers = centers.union_point(item.center());
        all = all.union(item.bounds.bounds);
    }
    let axes = [0, 1, 2].map(|axis| Axis::new(axis, &centers, &all));
    let cuts = match &*items {
        // Only the axis is to be chosen
        [a, b] => {
            let cost = a.bounds.cost() + b.bounds.cost();
            axes.map(|axis| axis.map(|axis| Cut { cost: cost * axis.stretch, axis, bucket: 1 }))
        }
        many if many.len() > MANY => {
            let [x, y, z] = axes.map(|axis| move || axis?.cut(&axis?.buckets(many)));
            let (x, (y, z)) = rayon::join(x, || rayon::join(y, z));
            [x, y, z]
        }
        few => all_cuts(few, axes),
    };
    let cheaper = |best: Cut, other: Cut| if other.cost < best.cost { other } else { best };
    let Some(Cut { axis, bucket, .. }) = cuts.into_iter().flatten().reduce(cheaper) else { return items.len() / 2 };

    let mut middle = 0;
    for i in 0..items.len() {
        if axis.bucket(items[i].center()) < bucket {
            items.swap(i, middle);
            middle += 1;
        }
    }
    middle
}

/// The cuts of minimum cost along each axis, by one pass over the items.
fn all_cuts(items: &[Item], axes: [Option<Axis>; 3]) -> [Option<Cut>; 3] {
    let mut buckets = [[Bucket::EMPTY; BUCKETS]; 3];
    for item in items {
        let center = item.center();
        for (buckets, axis) in buckets.iter_mut().zip(axes) {
            if let Some(axis) = axis {
                axis.add(buckets, item, center);
            }
        }
    }
    let mut buckets = buckets.iter();
    axes.map(|axis| axis.zip(buckets.next()).and_then(|(axis, buckets)| axis.cut(buckets)))
}

/// The lights of a bucket.
#[derive(Clone, Copy)]
struct Bucket {
    /// Ends of their bounding box, in registers: whole vectors are stored and loaded.
    min: Vec3A,
    max: Vec3A,
    /// Their other bounds.
    lights: LightBounds,
}

impl Bucket {
    const EMPTY: Bucket = Bucket { min: Vec3A::INFINITY, max: Vec3A::NEG_INFINITY, lights: LightBounds::EMPTY };

    #[inline]
    fn add(&mut self, light: &LightBounds) {
        (self.min, self.max) = (self.min.min(light.bounds.min.into()), self.max.max(light.bounds.max.into()));
        self.lights.add_emission(light);
    }

    fn bounds(&self) -> LightBounds {
        LightBounds { bounds: Bounds3 { min: self.min.into(), max: self.max.into() }, ..self.lights }
    }
}

/// The buckets of one axis: equal parts of the extent of the centres.
#[derive(Clone, Copy)]
struct Axis {
    axis: usize,
    min: f32,
    extent: f32,
    /// Factor of all costs: long thin parts are worse, so the aspect ratio of the items regularises.
    stretch: f32,
}

/// A split along an axis.
struct Cut {
    cost: f32,
    axis: Axis,
    /// The first bucket right of the split.
    bucket: usize,
}

impl Axis {
    /// `None` if the centres have no extent along the axis.
    fn new(axis: usize, centers: &Bounds3, all: &Bounds3) -> Option<Axis> {
        let (min, extent) = (centers.min[axis], centers.max[axis] - centers.min[axis]);
        let diagonal = all.diagonal();
        let stretch = diagonal.max_element() / diagonal[axis];
        (extent > 0.0 && extent.is_finite()).then_some(Axis { axis, min, extent, stretch })
    }

    #[inline]
    fn bucket(&self, center: Vec3) -> usize {
        (((center[self.axis] - self.min) / self.extent * BUCKETS as f32) as usize).min(BUCKETS - 1)
    }

    #[inline]
    fn add(&self, buckets: &mut [Bucket; BUCKETS], item: &Item, center: Vec3) {
        buckets[self.bucket(center)].add(&item.bounds);
    }

    fn buckets(&self, items: &[Item]) -> [Bucket; BUCKETS] {
        let mut buckets = [Bucket::EMPTY; BUCKETS];
        items.iter().for_each(|item| self.add(&mut buckets, item, item.center()));
        buckets
    }

    /// The split of minimum cost, the first of equal ones; `None` if all lights are in one bucket.
    fn cut(self, buckets: &[Bucket; BUCKETS]) -> Option<Cut> {
        // Only splits behind a bucket with lights can have another cost than the split before
        let mut filled = [(0, LightBounds::EMPTY); BUCKETS];
        let mut count = 0;
        for (i, bucket) in buckets.iter().enumerate().filter(|(_, bucket)| bucket.lights.intensity > 0.0) {
            filled[count] = (i, bucket.bounds());
            count += 1;
        }

        // Costs right of each split, from the end; then left costs from the start
        let mut right_costs = [0.0; BUCKETS];
        let mut right = LightBounds::EMPTY;
        for i in (1..count).rev() {
            right.add(&filled[i].1);
            right_costs[i] = right.cost();
        }
        let mut left = LightBounds::EMPTY;
        let mut best: Option<Cut> = None;
        for i in 1..count {
            let (last, bounds) = &filled[i - 1];
            left.add(bounds);
            let cost = left.cost() + right_costs[i];
            if right_costs[i] < f32::INFINITY && best.as_ref().is_none_or(|best| cost < best.cost) {
                best = Some(Cut { cost, axis: self, bucket: last + 1 });
            }
        }
        best.map(|best| Cut { cost: best.cost * self.stretch, ..best })
    }
}

//! Builds the binary tree by the binned surface-area heuristic [Wald 2007].
//!
//! Every decision depends only on the set of primitives in a range. Minima, maxima and counts are exact in any
//! grouping, so the tree does not depend on the number of threads.

use lumiris_numbers::math::{Bounds3, Vec3, Vec3A};
use rayon::prelude::*;

/// Maximum number of triangles in a leaf: the width of a block.
pub(super) const LEAF_TRIANGLES: usize = 4;
/// Maximum number of spans of curves in a leaf: the width of a block.
pub(super) const LEAF_SPANS: usize = 8;
const MAX_BINS: usize = 32;
/// From this depth on, ranges are halved, which bounds the depth of the tree.
const MAX_SAH_DEPTH: u32 = 64;
/// Ranges longer than this are split by parallel tasks.
const PARALLEL_RANGE: usize = 4096;
/// Ranges longer than this are binned in parallel.
const PARALLEL_BINNING: usize = 1 << 16;

/// The primitives of a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LeafKind {
    /// Up to [`LEAF_TRIANGLES`] triangles.
    Triangles,
    /// Up to [`LEAF_SPANS`] spans of curves.
    Curves,
    /// Another primitive or an instance.
    Single,
}

impl LeafKind {
    /// The kind of leaf for a primitive; `kinds` are those of the geometries.
    #[inline]
    pub(super) fn of(prim: &PrimRef, kinds: &[LeafKind]) -> LeafKind {
        kinds.get(prim.geometry as usize).copied().unwrap_or(LeafKind::Single)
    }

    /// Maximum number of primitives.
    fn capacity(self) -> usize {
        match self {
            LeafKind::Triangles => LEAF_TRIANGLES,
            LeafKind::Curves => LEAF_SPANS,
            LeafKind::Single => 1,
        }
    }
}

/// A primitive and its bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PrimRef {
    lo: Vec3,
    /// Geometry, or [`PrimRef::INSTANCE`].
    pub geometry: u32,
    hi: Vec3,
    /// Triangle, patch or first piece of a span of a curve, or index of an instance.
    pub primitive: u32,
}

impl PrimRef {
    /// `geometry` of an instance.
    pub(super) const INSTANCE: u32 = u32::MAX;

    /// The reference to a primitive; `None` if a point is not finite.
    pub(super) fn of_points(geometry: u32, primitive: usize, points: &[Vec3]) -> Option<Self> {
        // Minima and maxima may ignore NaN
        let finite = points.iter().all(|p| p.is_finite());
        finite.then(|| Self::of_bounds(geometry, primitive, Bounds3::from_points(points.iter().copied()))).flatten()
    }

    /// The reference to a primitive; `None` if the bounds are not finite.
    pub(super) fn of_bounds(geometry: u32, primitive: usize, bounds: Bounds3) -> Option<Self> {
        let finite = bounds.min.is_finite() && bounds.max.is_finite();
        finite.then_some(PrimRef { lo: bounds.min, geometry, hi: bounds.max, primitive: primitive as u32 })
    }

    #[inline]
    fn range(&self) -> Range3 {
        Range3 { lo: self.lo.into(), hi: self.hi.into() }
    }

    #[inline]
    fn center(&self) -> Vec3A {
        Vec3A::from(self.lo) * 0.5 + Vec3A::from(self.hi) * 0.5
    }
}

/// A box in vector registers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Range3 {
    pub lo: Vec3A,
    pub hi: Vec3A,
}

impl Range3 {
    const EMPTY: Range3 = Range3 { lo: Vec3A::INFINITY, hi: Vec3A::NEG_INFINITY };

    #[inline]
    fn union(self, o: Range3) -> Range3 {
        Range3 { lo: self.lo.min(o.lo), hi: self.hi.max(o.hi) }
    }

    #[inline]
    fn union_point(self, p: Vec3A) -> Range3 {
        Range3 { lo: self.lo.min(p), hi: self.hi.max(p) }
    }

    /// Half the surface area.
    #[inline]
    pub(super) fn half_area(&self) -> f32 {
        let d = self.hi - self.lo;
        d.x * d.y + d.y * d.z + d.z * d.x
    }
}

/// A node of the binary tree.
#[derive(Debug, PartialEq)]
pub(super) struct Binary {
    pub bounds: Range3,
    pub kind: BinaryKind,
}

#[derive(Debug, PartialEq)]
pub(super) enum BinaryKind {
    /// Primitives start..start + count of the reordered list.
    Leaf {
        start: usize,
        count: usize,
    },
    Inner(Box<[Binary; 2]>),
}

impl Binary {
    /// Bytes of the subtree, including the node itself.
    pub(super) fn bytes(&self) -> u64 {
        let below = match &self.kind {
            BinaryKind::Leaf { .. } => 0,
            BinaryKind::Inner(children) => children[0].bytes() + children[1].bytes(),
        };
        size_of::<Binary>() as u64 + below
    }
}

/// Builds the tree and reorders the primitives; `None` if there are none. `leaf_kinds` are those of the geometries.
pub(super) fn build_binary(prims: &mut [PrimRef], leaf_kinds: &[LeafKind]) -> Option<Binary> {
    let has_triangles = prims.iter().any(|prim| LeafKind::of(prim, leaf_kinds) == LeafKind::Triangles);
    let block = if has_triangles { LEAF_TRIANGLES } else { LEAF_SPANS } as u32;
    (!prims.is_empty()).then(|| Builder { leaf_kinds, block }.node(prims, 0, 0))
}

struct Builder<'a> {
    leaf_kinds: &'a [LeafKind],
    /// Number of primitives of a block, for the cost of a split.
    block: u32,
}

impl Builder<'_> {
    fn node(&self, prims: &mut [PrimRef], start: usize, depth: u32) -> Binary {
        let extent = Extent::of(prims);
        if self.fits_a_leaf(prims) {
            return Binary { bounds: extent.bounds, kind: BinaryKind::Leaf { start, count: prims.len() } };
        }
        let middle = if depth < MAX_SAH_DEPTH { split(prims, &extent, self.block) } else { prims.len() / 2 };
        let parallel = prims.len() > PARALLEL_RANGE;
        let (left, right) = prims.split_at_mut(middle);
        let mut build_left = || self.node(left, start, depth + 1);
        let mut build_right = || self.node(right, start + middle, depth + 1);
        let (left, right) = if parallel { rayon::join(build_left, build_right) } else { (build_left(), build_right()) };
        Binary { bounds: extent.bounds, kind: BinaryKind::Inner(Box::new([left, right])) }
    }

    fn fits_a_leaf(&self, prims: &[PrimRef]) -> bool {
        let kind = LeafKind::of(&prims[0], self.leaf_kinds);
        prims.len() <= kind.capacity() && prims.iter().all(|prim| LeafKind::of(prim, self.leaf_kinds) == kind)
    }
}

/// Bounds of primitives and of their centres.
#[derive(Clone, Copy)]
struct Extent {
    bounds: Range3,
    centers: Range3,
}

impl Extent {
    const EMPTY: Extent = Extent { bounds: Range3::EMPTY, centers: Range3::EMPTY };

    fn of(prims: &[PrimRef]) -> Extent {
        let serial = |prims: &[PrimRef]| {
            prims.iter().fold(Extent::EMPTY, |e, p| Extent {
                bounds: e.bounds.union(p.range()),
                centers: e.centers.union_point(p.center()),
            })
        };
        if prims.len() <= PARALLEL_BINNING {
            return serial(prims);
        }
        let union =
            |a: Extent, b: Extent| Extent { bounds: a.bounds.union(b.bounds), centers: a.centers.union(b.centers) };
        prims.par_chunks(PARALLEL_BINNING / 4).map(serial).reduce(|| Extent::EMPTY, union)
    }
}

/// Equal bins over the centres' range along each axis.
struct Binning {
    lo: Vec3A,
    scale: Vec3A,
    count: usize,
}

impl Binning {
    fn new(extent: &Extent, prim_count: usize) -> Self {
        let count = (8 + prim_count / 8).min(MAX_BINS);
        let size = extent.centers.hi - extent.centers.lo;
        // A flat axis has the scale 0, hence one bin
        let scale = Vec3A::select(size.cmpgt(Vec3A::ZERO), (count as f32 * 0.999) / size, Vec3A::ZERO);
        Binning { lo: extent.centers.lo, scale, count }
    }

    #[inline]
    fn bins_of(&self, prim: &PrimRef) -> [usize; 3] {
        let x = ((prim.center() - self.lo) * self.scale).to_array();
        // The cast saturates, and maps NaN to 0
        x.map(|x| (x as i32).clamp(0, self.count as i32 - 1) as usize)
    }
}

/// Bounds and counts of the bins along the three axes.
struct Bins {
    bounds: [[Range3; MAX_BINS]; 3],
    counts: [[u32; MAX_BINS]; 3],
}

impl Bins {
    fn of(prims: &[PrimRef], binning: &Binning) -> Bins {
        let mut bins = Bins { bounds: [[Range3::EMPTY; MAX_BINS]; 3], counts: [[0; MAX_BINS]; 3] };
        for prim in prims {
            let range = prim.range();
            for (axis, bin) in binning.bins_of(prim).into_iter().enumerate() {
                bins.bounds[axis][bin] = bins.bounds[axis][bin].union(range);
                bins.counts[axis][bin] += 1;
            }
        }
        bins
    }

    fn union(mut self, other: Bins) -> Bins {
        for axis in 0..3 {
            for i in 0..MAX_BINS {
                self.bounds[axis][i] = self.bounds[axis][i].union(other.bounds[axis][i]);
                self.counts[axis][i] += other.counts[axis][i];
            }
        }
        self
    }

    /// The cheapest split between bins. The cost is area times number of blocks, summed over both sides.
    fn best_split(&self, bin_count: usize, block: u32) -> Option<Split> {
        let mut best: Option<Split> = None;
        for axis in 0..3 {
            let (bounds, counts) = (&self.bounds[axis], &self.counts[axis]);
            // Costs of all right sides
            let mut right_cost = [0.0_f32; MAX_BINS];
            let (mut range, mut n) = (Range3::EMPTY, 0);
            for i in (1..bin_count).rev() {
                range = range.union(bounds[i]);
                n += counts[i];
                right_cost[i - 1] = side_cost(&range, n.div_ceil(block));
            }

            // The cheapest sum of left and right side
            (range, n) = (Range3::EMPTY, 0);
            let total: u32 = counts.iter().sum();
            for i in 0..bin_count - 1 {
                range = range.union(bounds[i]);
                n += counts[i];
                let cost = side_cost(&range, n.div_ceil(block)) + right_cost[i];
                if n > 0 && n < total && best.is_none_or(|best| cost < best.cost) {
                    best = Some(Split { axis, last_bin: i, cost });
                }
            }
        }
        best
    }
}

/// A split between bins.
#[derive(Clone, Copy)]
struct Split {
    axis: usize,
    /// Last bin of the left side.
    last_bin: usize,
    cost: f32,
}

#[inline]
fn side_cost(range: &Range3, blocks: u32) -> f32 {
    if blocks == 0 { 0.0 } else { range.half_area() * blocks as f32 }
}

/// Partitions the primitives into a left and a right side, neither empty. Returns the length of the left side.
fn split(prims: &mut [PrimRef], extent: &Extent, block: u32) -> usize {
    // Choose the split
    let binning = Binning::new(extent, prims.len());
    let bins = if prims.len() <= PARALLEL_BINNING {
        Bins::of(prims, &binning)
    } else {
        let parts: Vec<Bins> = prims.par_chunks(PARALLEL_BINNING / 4).map(|chunk| Bins::of(chunk, &binning)).collect();
        parts.into_iter().reduce(Bins::union).expect("the range is not empty")
    };
    let Some(Split { axis, last_bin, .. }) = bins.best_split(binning.count, block) else {
        return prims.len() / 2;
    };

    // Partition
    let (mut i, mut j) = (0, prims.len());
    while i < j {
        if binning.bins_of(&prims[i])[axis] <= last_bin {
            i += 1;
        } else {
            j -= 1;
            prims.swap(i, j);
        }
    }
    i
}

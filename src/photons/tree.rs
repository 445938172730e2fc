//! A kd-tree that holds photons in its leaves and no pointers: the photons lie in the order of the leaves, a node has its
//! plane, and all else follows from counts.
//!
//! Every node halves its photons by number across the longest side of their box, so that photons on a plane, of which all
//! have one equal coordinate, are cut along the others. The nodes of a tree of L levels, 2^L − 1 of them, lie in preorder:
//! those of the first half follow their parent, 2^(L − 1) − 1 of them, and then come those of the second half.

use super::photon::Photon;
use crate::math::Vec3;

/// Most photons of a leaf.
const LEAF: usize = 12;
/// Halves of at least this many photons are built in parallel.
const PARALLEL: usize = 1 << 14;

/// A plane across which photons are halved.
#[derive(Clone, Copy, Debug, Default)]
struct Node {
    split: f32,
    axis: u32,
}

/// Photons in a tree.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    pub(super) photons: Vec<Photon>,
    nodes: Vec<Node>,
    levels: u32,
}

/// Part of the tree.
#[derive(Clone, Copy)]
struct Part {
    node: usize,
    levels: u32,
    begin: usize,
    end: usize,
}

/// A visitor of photons by distance. Positions differ from the query's by a vector whose length is at most the bound when visited.
pub(super) trait Visit {
    /// Squared distance from which on photons do not matter (m²).
    fn bound(&self) -> f32;
    /// A photon within the bound.
    fn photon(&mut self, index: usize, photon: &Photon, d: Vec3, d2: f32);
}

impl Tree {
    pub(super) fn new(mut photons: Vec<Photon>) -> Self {
        let mut levels = 0;
        while photons.len().div_ceil(1 << levels) > LEAF {
            levels += 1;
        }
        let mut nodes = vec![Node::default(); (1 << levels) - 1];
        build(&mut photons, &mut nodes);
        Tree { photons, nodes, levels }
    }

    /// Memory (bytes).
    pub(super) fn bytes(&self) -> u64 {
        (size_of_val(&self.photons[..]) + size_of_val(&self.nodes[..])) as u64
    }

    /// Visits the photons around `p`, the nearer halves first.
    pub(super) fn visit(&self, p: Vec3, visitor: &mut impl Visit) {
        let all = Part { node: 0, levels: self.levels, begin: 0, end: self.photons.len() };
        self.visit_part(all, p, Vec3::ZERO, visitor);
    }

    /// `offset`: from `p` to the nearest point of the part's cell, by axis.
    fn visit_part(&self, part: Part, p: Vec3, offset: Vec3, visitor: &mut impl Visit) {
        if part.levels == 0 {
            for (i, photon) in (part.begin..).zip(&self.photons[part.begin..part.end]) {
                let d = photon.p() - p;
                let d2 = d.length_squared();
                if d2 <= visitor.bound() {
                    visitor.photon(i, photon, d, d2);
                }
            }
            return;
        }
        let Node { split, axis } = self.nodes[part.node];
        let axis = axis as usize;
        let (middle, levels) = (half(part.begin, part.end), part.levels - 1);
        let first = Part { node: part.node + 1, levels, begin: part.begin, end: middle };
        let second = Part { node: part.node + (1 << levels), levels, begin: middle, end: part.end };
        let across = split - p[axis];
        let (near, far) = if across > 0.0 { (first, second) } else { (second, first) };
        self.visit_part(near, p, offset, visitor);
        let mut offset = offset;
        offset[axis] = across;
        if offset.length_squared() <= visitor.bound() {
            self.visit_part(far, p, offset, visitor);
        }
    }
}

/// Where the second half begins.
#[inline]
fn half(begin: usize, end: usize) -> usize {
    begin + (end - begin) / 2
}

fn build(photons: &mut [Photon], nodes: &mut [Node]) {
    let Some((node, below)) = nodes.split_first_mut() else { return };
    // The longest side
    let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for photon in photons.iter() {
        min = min.min(photon.p());
        max = max.max(photon.p());
    }
    let axis = (max - min).max_position();

    // Half of the photons on each side of it
    let middle = half(0, photons.len());
    let (_, median, _) = photons.select_nth_unstable_by(middle, |a, b| a.p()[axis].total_cmp(&b.p()[axis]));
    *node = Node { split: median.p()[axis], axis: axis as u32 };

    let is_large = photons.len() >= PARALLEL;
    let (first, second) = photons.split_at_mut(middle);
    let (first_nodes, second_nodes) = below.split_at_mut(below.len() / 2);
    if is_large {
        rayon::join(|| build(first, first_nodes), || build(second, second_nodes));
    } else {
        build(first, first_nodes);
        build(second, second_nodes);
    }
}

//! A kd-tree over photons, which are stored in the order of its leaves: 8 bytes per node, in preorder.
//!
//! A node splits its photons in halves across the longest side of their box. Photons lie on walls, and many have equal
//! coordinates. Photons with equal coordinates stay together, so that the two cells do not touch. The halves are then
//! unequal, but such photons are never split along that axis again, which adds at most three levels.

use super::photon::Photon;
use lumiris_numbers::math::Vec3;

/// Maximum number of photons in a leaf, unless they are all at one point.
const LEAF: usize = 10;
/// Minimum number of photons for which halves are built in parallel.
const PARALLEL: usize = 1 << 14;
/// The kind of leaves, beside the axes 0, 1, 2.
const IS_LEAF: u32 = 3;

/// A splitting plane, or a leaf.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// The plane's coordinate, as bits, or the index of the first photon.
    value: u32,
    /// Two bits: axis or `IS_LEAF`. Other bits: the offset of the second child, or the number of photons.
    kind: u32,
}

/// Photons in a kd-tree.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    pub(super) photons: Vec<Photon>,
    nodes: Vec<Node>,
}

/// A visitor of photons.
pub(super) trait Visit {
    /// Maximum squared distance (m²).
    fn bound(&self) -> f32;
    /// Called for a photon within the bound, with its offset and squared distance.
    fn photon(&mut self, index: usize, photon: &Photon, d: Vec3, d2: f32);
}

impl Tree {
    pub(super) fn new(mut photons: Vec<Photon>) -> Self {
        // A NaN position is on no side of a plane
        photons.retain(|photon| photon.p().is_finite());
        let mut nodes = Vec::with_capacity(photons.len() / (LEAF / 3) + 1);
        if !photons.is_empty() {
            build(&mut photons, 0, &mut nodes);
        }
        nodes.shrink_to_fit();
        Tree { photons, nodes }
    }

    /// Memory (bytes).
    pub(super) fn bytes(&self) -> u64 {
        (size_of_val(&self.photons[..]) + size_of_val(&self.nodes[..])) as u64
    }

    /// Visits the photons around `p`, nearer halves first.
    pub(super) fn visit(&self, p: Vec3, visitor: &mut impl Visit) {
        if !self.nodes.is_empty() {
            self.visit_node(0, p, Vec3::ZERO, visitor);
        }
    }

    /// `offset`: vector from `p` to the nearest point of the node's cell.
    fn visit_node(&self, node: usize, p: Vec3, offset: Vec3, visitor: &mut impl Visit) {
        let Node { value, kind } = self.nodes[node];
        // Photons of a leaf
        if kind & 3 == IS_LEAF {
            let begin = value as usize;
            for (i, photon) in (begin..).zip(&self.photons[begin..begin + (kind >> 2) as usize]) {
                let d = photon.p() - p;
                let d2 = d.length_squared();
                if d2 <= visitor.bound() {
                    visitor.photon(i, photon, d, d2);
                }
            }
            return;
        }

        // The child on the side of `p`, then the other if it is near enough
        let axis = (kind & 3) as usize;
        let across = f32::from_bits(value) - p[axis];
        let (first, second) = (node + 1, node + (kind >> 2) as usize);
        let (near, far) = if across > 0.0 { (first, second) } else { (second, first) };
        self.visit_node(near, p, offset, visitor);
        let mut offset = offset;
        offset[axis] = across;
        if offset.length_squared() <= visitor.bound() {
            self.visit_node(far, p, offset, visitor);
        }
    }
}

/// Appends the tree over `photons`, the first of which has the index `begin`.
fn build(photons: &mut [Photon], begin: u32, nodes: &mut Vec<Node>) {
    let bounds = |photons: &[Photon]| {
        let extremes = |(min, max): (Vec3, Vec3), photon: &Photon| (min.min(photon.p()), max.max(photon.p()));
        photons.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), extremes)
    };
    let (min, max) = bounds(photons);
    let axis = (max - min).max_position();
    if photons.len() <= LEAF || !(max[axis] > min[axis]) {
        nodes.push(Node { value: begin, kind: IS_LEAF | (photons.len() as u32) << 2 });
        return;
    }

    // Split
    let middle = cut(photons, axis);
    let (first, second) = photons.split_at_mut(middle);
    let (low, high) = (bounds(first).1[axis], bounds(second).0[axis]);
    let node = nodes.len();
    nodes.push(Node { value: (0.5 * low + 0.5 * high).clamp(low, high).to_bits(), kind: axis as u32 });

    // Children
    let second_begin = begin + middle as u32;
    if first.len() + second.len() >= PARALLEL {
        let mut second_nodes = Vec::new();
        rayon::join(|| build(first, begin, nodes), || build(second, second_begin, &mut second_nodes));
        nodes[node].kind |= ((nodes.len() - node) as u32) << 2;
        nodes.append(&mut second_nodes);
    } else {
        build(first, begin, nodes);
        nodes[node].kind |= ((nodes.len() - node) as u32) << 2;
        build(second, second_begin, nodes);
    }
}

/// Partitions photons into two non-empty sets of nearly equal size, smaller coordinates first. Equal coordinates are in
/// the same set. Returns the size of the first. The coordinates must not all be equal.
fn cut(photons: &mut [Photon], axis: usize) -> usize {
    let half = photons.len() / 2;
    let (below, median, above) = photons.select_nth_unstable_by(half, |a, b| a.p()[axis].total_cmp(&b.p()[axis]));
    let median = median.p()[axis];
    if below.iter().all(|photon| photon.p()[axis] < median) {
        return half;
    }
    let less = partition(below, |photon| photon.p()[axis] < median);
    let equal_above = partition(above, |photon| photon.p()[axis] <= median);
    let not_more = half + 1 + equal_above;
    let is_nearer = half - less <= not_more - half;
    if less > 0 && (is_nearer || not_more == photons.len()) { less } else { not_more }
}

/// Moves the items that satisfy `belongs` to the front; returns their number.
fn partition(photons: &mut [Photon], belongs: impl Fn(&Photon) -> bool) -> usize {
    let mut count = 0;
    for i in 0..photons.len() {
        if belongs(&photons[i]) {
            photons.swap(i, count);
            count += 1;
        }
    }
    count
}

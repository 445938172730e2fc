//! What paths reflect beyond a vertex, by place: moments of the estimates that pilot paths gave, over a tree of positions
//! and normals.
//!
//! A node divides its estimates into halves along the axis in which their places vary most. All leaves have the same depth,
//! so that a lookup has no branch to be predicted.

use lumiris_numbers::math::{Rgb, Vec3};

/// Fewest estimates of a cell: with less, moments mean nothing.
const MIN_ESTIMATES: usize = 32;
/// Axes in which places differ.
const AXES: usize = 6;
/// Length of a normal among places, by the radius of the scene.
const NORMAL_LENGTH: f32 = 0.35;

/// Where a path arrives: its position, and the normal on its side, scaled to a length; padded.
type Place = [f32; 8];

/// What lies beyond the vertex of a pilot path.
#[derive(Clone, Copy, Debug)]
pub(in crate::integrators) struct Tail {
    /// Position, world space.
    pub(in crate::integrators) p: Vec3,
    /// Unit normal on the side of the path.
    pub(in crate::integrators) n: Vec3,
    /// The one-sample estimate ⟨L_r⟩ of the radiance that is reflected along the path.
    pub(in crate::integrators) l: Rgb,
    /// What it cost.
    pub(in crate::integrators) cost: f32,
}

/// Moments of the estimates at a place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Cell {
    /// E ⟨L_r⟩.
    pub(super) mean: Rgb,
    /// E ⟨L_r⟩² / E C, C being the cost of an estimate.
    pub(super) second_moment_per_cost: Rgb,
    /// V ⟨L_r⟩ / E C.
    pub(super) variance_per_cost: Rgb,
}

/// A node of the tree, which divides places at a coordinate.
#[derive(Clone, Copy, Debug)]
struct Node {
    axis: u32,
    at: f32,
}

/// Cells by place: a balanced tree, whose nodes stand by level.
#[derive(Debug, Default)]
pub(super) struct Tree {
    levels: u32,
    nodes: Vec<Node>,
    cells: Vec<Cell>,
    /// Length of a normal among the places.
    normal_length: f32,
}

impl Tree {
    /// Divides the estimates of places in a scene of the given radius.
    pub(super) fn new(tails: &mut [Tail], scene_radius: f32) -> Self {
        if tails.is_empty() {
            return Tree::default();
        }
        let mut tree = Tree { normal_length: scene_radius * NORMAL_LENGTH, ..Tree::default() };
        let mut parts = vec![tails];
        while parts[0].len() >= 2 * MIN_ESTIMATES {
            let mut halves = Vec::with_capacity(2 * parts.len());
            for part in parts {
                let axis = tree.longest_axis(part);
                let middle = part.len() / 2;
                let order = |a: &Tail, b: &Tail| tree.place(a.p, a.n)[axis].total_cmp(&tree.place(b.p, b.n)[axis]);
                let (_, at, _) = part.select_nth_unstable_by(middle, order);
                let at = tree.place(at.p, at.n)[axis];
                tree.nodes.push(Node { axis: axis as u32, at });
                halves.extend(<[_; 2]>::from(part.split_at_mut(middle)));
            }
            parts = halves;
            tree.levels += 1;
        }
        tree.cells = parts.iter().map(|part| Cell::new(part)).collect();
        tree
    }

    /// The cell of a place; `None` without any estimates.
    #[inline]
    pub(super) fn find(&self, p: Vec3, n: Vec3) -> Option<&Cell> {
        let place = self.place(p, n);
        let mut k = 0;
        for _ in 0..self.levels {
            let Node { axis, at } = self.nodes[k];
            k = 2 * k + 1 + usize::from(place[axis as usize & 7] >= at);
        }
        self.cells.get(k - self.nodes.len())
    }

    #[inline]
    fn place(&self, p: Vec3, n: Vec3) -> Place {
        let n = n * self.normal_length;
        [p.x, p.y, p.z, n.x, n.y, n.z, 0.0, 0.0]
    }

    /// The axis in which places vary most.
    fn longest_axis(&self, tails: &[Tail]) -> usize {
        let count = tails.len() as f64;
        let (mut sums, mut squares) = ([0.0_f64; AXES], [0.0_f64; AXES]);
        for place in tails.iter().map(|t| self.place(t.p, t.n)) {
            for (axis, x) in place[..AXES].iter().map(|&x| f64::from(x)).enumerate() {
                sums[axis] += x;
                squares[axis] += x * x;
            }
        }
        let variance = |axis: &usize| squares[*axis] / count - (sums[*axis] / count).powi(2);
        (0..AXES).max_by(|a, b| variance(a).total_cmp(&variance(b))).unwrap_or_default()
    }
}

impl Cell {
    fn new(tails: &[Tail]) -> Self {
        let count = tails.len().max(1) as f64;
        let (mut sum, mut squares, mut cost) = ([0.0_f64; 3], [0.0_f64; 3], 0.0_f64);
        for tail in tails {
            for (c, l) in tail.l.to_array().into_iter().map(f64::from).enumerate() {
                sum[c] += l;
                squares[c] += l * l;
            }
            cost += f64::from(tail.cost);
        }
        let cost = (cost / count).max(f64::MIN_POSITIVE);
        let rgb = |f: &dyn Fn(usize) -> f64| Rgb::from_array([0, 1, 2].map(|c| f(c) as f32));
        let variance = |c: usize| (squares[c] / count - (sum[c] / count).powi(2)).max(0.0);
        Cell {
            mean: rgb(&|c| sum[c] / count),
            second_moment_per_cost: rgb(&|c| squares[c] / count / cost),
            variance_per_cost: rgb(&|c| variance(c) / cost),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_those_of_the_estimates_near_a_place() {
        // A wall at x = 0 that is bright above y = 0.5, and dark on its back
        let mut tails = Vec::new();
        for i in 0..4096_u32 {
            let (y, z) = ((i % 64) as f32 / 64.0, (i / 64) as f32 / 64.0);
            let n = if (i % 64 + i / 64) % 2 == 0 { Vec3::X } else { -Vec3::X };
            let l = if n.x > 0.0 && y >= 0.5 { [2.0, 4.0][(i / 64 / 2 % 2) as usize] } else { 0.0 };
            tails.push(Tail { p: Vec3::new(0.0, y, z), n, l: Rgb::splat(l), cost: 2.0 });
        }
        let tree = Tree::new(&mut tails, 1.0);
        let cell = |y, n| tree.find(Vec3::new(0.0, y, 0.4), n).unwrap();
        let bright = cell(0.9, Vec3::X);
        assert!((bright.mean.g - 3.0).abs() < 0.3, "{bright:?}");
        assert!((bright.second_moment_per_cost.g - 5.0).abs() < 1.0 && (bright.variance_per_cost.g - 0.5).abs() < 0.1);
        assert_eq!(*cell(0.1, Vec3::X), Cell::default());
        assert_eq!(*cell(0.9, -Vec3::X), Cell::default());
        assert!(Tree::new(&mut [], 1.0).find(Vec3::ZERO, Vec3::X).is_none());
    }
}

//! An octree of spheres, for queries by point and by sphere.
//!
//! A sphere is stored in all nodes of one level that it intersects, at most eight. Nodes of this level are two to four
//! times as wide as its radius. A point is in one node of each level, so a query descends once. Space is divided at the
//! centres of nodes only: the outermost nodes extend to infinity, and spheres may lie outside of the box of the tree.

use lumiris_numbers::math::{Bounds3, Vec3};

/// Levels below the root.
const MAX_DEPTH: u32 = 24;
/// No child.
const NONE: u32 = u32::MAX;

/// Octree of sphere ids.
#[derive(Clone, Debug)]
pub struct Octree {
    center: Vec3,
    half: f32,
    nodes: Vec<Node>,
}

#[derive(Clone, Debug)]
struct Node {
    children: [u32; 8],
    ids: Vec<u32>,
}

impl Node {
    fn new() -> Self {
        Node { children: [NONE; 8], ids: Vec::new() }
    }
}

/// A node with its position and size.
#[derive(Clone, Copy)]
struct NodeCube {
    node: u32,
    center: Vec3,
    half: f32,
    depth: u32,
}

impl NodeCube {
    /// Child `i` with the node index `node`. Bit k of `i` selects the upper half of axis k.
    fn child(&self, i: usize, node: u32) -> NodeCube {
        let half = 0.5 * self.half;
        let side = |bit: usize| if i >> bit & 1 == 1 { half } else { -half };
        NodeCube { node, center: self.center + Vec3::new(side(0), side(1), side(2)), half, depth: self.depth + 1 }
    }

    /// True if child `i` intersects the sphere's box.
    fn meets(&self, i: usize, p: Vec3, radius: f32) -> bool {
        (0..3).all(|axis| {
            let (x, c) = (p[axis], self.center[axis]);
            if i >> axis & 1 == 1 { x + radius >= c } else { x - radius <= c }
        })
    }
}

impl Octree {
    /// An empty tree for spheres that lie mostly inside `bounds`.
    pub fn new(bounds: &Bounds3) -> Self {
        let (center, half) = if bounds.is_empty() {
            (Vec3::ZERO, 1.0)
        } else {
            (bounds.center(), (0.5 * bounds.diagonal().max_element()).max(f32::MIN_POSITIVE))
        };
        Octree { center, half, nodes: vec![Node::new()] }
    }

    /// Bytes of the nodes.
    pub fn bytes(&self) -> usize {
        self.nodes.iter().map(|n| size_of::<Node>() + n.ids.capacity() * size_of::<u32>()).sum()
    }

    fn root(&self) -> NodeCube {
        NodeCube { node: 0, center: self.center, half: self.half, depth: 0 }
    }

    /// Adds a sphere.
    pub fn insert(&mut self, id: u32, p: Vec3, radius: f32) {
        let mut pending = vec![self.root()];
        while let Some(cube) = pending.pop() {
            if cube.half <= 2.0 * radius || cube.depth == MAX_DEPTH {
                self.nodes[cube.node as usize].ids.push(id);
                continue;
            }
            for i in (0..8).filter(|&i| cube.meets(i, p, radius)) {
                let mut child = self.nodes[cube.node as usize].children[i];
                if child == NONE {
                    child = self.nodes.len() as u32;
                    self.nodes.push(Node::new());
                    self.nodes[cube.node as usize].children[i] = child;
                }
                pending.push(cube.child(i, child));
            }
        }
    }

    /// Calls `f` once for the id of each sphere that contains `p`, and of some others nearby. The order depends on the
    /// insertions only.
    #[inline]
    pub fn at_point(&self, p: Vec3, mut f: impl FnMut(u32)) {
        let mut cube = self.root();
        loop {
            let node = &self.nodes[cube.node as usize];
            node.ids.iter().for_each(|&id| f(id));
            let upper = p.cmpge(cube.center);
            let i = upper.bitmask() as usize;
            if node.children[i] == NONE {
                return;
            }
            cube.node = node.children[i];
            cube.half *= 0.5;
            cube.center += Vec3::select(upper, Vec3::splat(cube.half), Vec3::splat(-cube.half));
        }
    }

    /// Calls `f` with the ids of all spheres that intersect the sphere about `p`, and of some others nearby, possibly
    /// more than once.
    pub fn near(&self, p: Vec3, radius: f32, mut f: impl FnMut(u32)) {
        let mut pending = vec![self.root()];
        while let Some(cube) = pending.pop() {
            let node = &self.nodes[cube.node as usize];
            node.ids.iter().for_each(|&id| f(id));
            for (i, &child) in node.children.iter().enumerate() {
                if child != NONE && cube.meets(i, p, radius) {
                    pending.push(cube.child(i, child));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::random::{Pcg32, RngExt, pcg32};

    fn random_point(s: &mut Pcg32) -> Vec3 {
        // Some points lie outside of the box
        Vec3::new(s.random::<f32>(), s.random::<f32>(), s.random::<f32>()) * 3.0 - 1.5
    }

    #[test]
    fn queries_find_every_ball() {
        let mut s = pcg32([3, 1, 4]);
        let mut tree = Octree::new(&Bounds3 { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) });
        let balls: Vec<(Vec3, f32)> =
            (0..500).map(|_| (random_point(&mut s), 0.5 * s.random::<f32>().powi(4) + 1e-9)).collect();
        for (i, &(p, r)) in balls.iter().enumerate() {
            tree.insert(i as u32, p, r);
        }

        // Compare both queries with a search of all spheres
        for _ in 0..500 {
            let (p, radius) = (random_point(&mut s), 0.3 * s.random::<f32>());
            let mut at = Vec::new();
            tree.at_point(p, |id| at.push(id));
            let mut near = Vec::new();
            tree.near(p, radius, |id| near.push(id));
            for (i, &(center, r)) in balls.iter().enumerate() {
                let count = at.iter().filter(|&&id| id == i as u32).count();
                assert!(count <= 1 && (count == 1 || center.distance(p) > r), "ball {i} at {p}");
                assert!(near.contains(&(i as u32)) || center.distance(p) > r + radius, "ball {i} near {p}");
            }
        }
    }

    #[test]
    fn an_empty_box_and_balls_of_no_size_are_fine() {
        let mut tree = Octree::new(&Bounds3::EMPTY);
        tree.insert(7, Vec3::ZERO, 0.0);
        let mut found = Vec::new();
        tree.at_point(Vec3::ZERO, |id| found.push(id));
        assert_eq!(found, [7]);
    }
}

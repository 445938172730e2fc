//! The tree for traversal: nodes of eight boxes, blocks of four triangles and blocks of eight spans of curves, as
//! structures of arrays.

use super::build::{Binary, BinaryKind, LEAF_TRIANGLES, LeafKind, PrimRef};
use super::curve_block::CurveBlock;
use crate::geometry::triangle::RayPrecomputed;
use crate::geometry::{GeometrySet, Shape};
use lumiris_numbers::math::{Bounds3, Vec3, Vec4};
use rayon::prelude::*;
use std::ops::Range;

/// Growth of every box, relative to its largest coordinate. Together with the same growth of the ray's origin it covers
/// the rounding error of the triangle test, which moves corners by up to 5·2⁻²⁴ of their distance from the origin.
pub(super) const BOX_GROWTH: f32 = 1.0 / (1 << 20) as f32;

/// Reference to a child of a node: two bits of kind, thirty of index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ChildRef(u32);

/// A decoded [`ChildRef`].
pub(super) enum Child {
    Node(usize),
    Block(usize),
    Other(usize),
    Curves(usize),
}

impl ChildRef {
    const KIND_SHIFT: u32 = 30;
    /// An unused slot. Its box is empty, so it is never visited.
    pub(super) const EMPTY: ChildRef = ChildRef(u32::MAX);

    fn new(kind: u32, index: usize) -> Self {
        debug_assert!(index < 1 << Self::KIND_SHIFT);
        ChildRef(kind << Self::KIND_SHIFT | index as u32)
    }

    #[inline]
    pub(super) fn decode(self) -> Child {
        let index = (self.0 & ((1 << Self::KIND_SHIFT) - 1)) as usize;
        match self.0 >> Self::KIND_SHIFT {
            0 => Child::Node(index),
            1 => Child::Block(index),
            2 => Child::Other(index),
            _ => Child::Curves(index),
        }
    }
}

/// Eight boxes and their children.
#[derive(Clone, Debug, PartialEq)]
#[repr(C, align(64))]
pub(super) struct Node {
    /// Rows of minimum x, y, z, then maximum x, y, z.
    pub bounds: [[Vec4; 2]; 6],
    pub children: [ChildRef; 8],
}

/// Four triangles. Unused lanes have NaN corners, which no ray hits.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(super) struct Block {
    /// Indexed by corner, then axis.
    corners: [[Vec4; 3]; 3],
    pub(super) geometry: [u32; LEAF_TRIANGLES],
    pub(super) primitive: [u32; LEAF_TRIANGLES],
}

impl Block {
    fn new(geometry: &GeometrySet, prims: &[PrimRef]) -> Self {
        let mut lanes = [[[f32::NAN; LEAF_TRIANGLES]; 3]; 3];
        let mut block = Block { corners: [[Vec4::NAN; 3]; 3], geometry: [0; 4], primitive: [0; 4] };
        for (lane, prim) in prims.iter().enumerate() {
            let Shape::Mesh(mesh) = &geometry.geometries[prim.geometry as usize].shape else { continue };
            for (corner, p) in mesh.triangle(prim.primitive as usize).into_iter().enumerate() {
                for axis in 0..3 {
                    lanes[corner][axis][lane] = p[axis];
                }
            }
            (block.geometry[lane], block.primitive[lane]) = (prim.geometry, prim.primitive);
        }
        block.corners = lanes.map(|corner| corner.map(Vec4::from));
        block
    }

    /// Corners of a lane.
    #[inline]
    pub(super) fn triangle(&self, lane: usize) -> [Vec3; 3] {
        self.corners.map(|axes| Vec3::from(axes.map(|x| x[lane])))
    }

    /// Bit mask of lanes whose f32 edge functions do not exclude a hit: the functions of
    /// [`crate::geometry::triangle::intersect_triangle`], four triangles at a time.
    #[inline]
    pub(super) fn candidates(&self, ray: &RayPrecomputed) -> u32 {
        let [kx, ky, kz] = ray.axes;
        let o = ray.ray.o;
        let (ox, oy, oz) = (Vec4::splat(o[kx]), Vec4::splat(o[ky]), Vec4::splat(o[kz]));
        let (sx, sy) = (Vec4::splat(ray.shear[0]), Vec4::splat(ray.shear[1]));
        let sheared = |corner: &[Vec4; 3]| {
            let z = corner[kz] - oz;
            (corner[kx] - ox - sx * z, corner[ky] - oy - sy * z)
        };
        let [(ax, ay), (bx, by), (cx, cy)] =
            [sheared(&self.corners[0]), sheared(&self.corners[1]), sheared(&self.corners[2])];
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        let front = u.min(v).min(w).cmpge(Vec4::ZERO);
        let back = u.max(v).max(w).cmple(Vec4::ZERO);
        (front | back).bitmask()
    }
}

/// A quadric, a bilinear patch or an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Other {
    /// Quadric or bilinear patch.
    Exact {
        geometry: u32,
        primitive: u32,
    },
    Instance(u32),
}

/// One level of the hierarchy.
#[derive(Debug)]
pub(super) struct Tree {
    pub bounds: Bounds3,
    /// The root; `None` if the tree is empty.
    pub root: Option<ChildRef>,
    pub nodes: Vec<Node>,
    pub blocks: Vec<Block>,
    pub curves: Vec<CurveBlock>,
    pub others: Vec<Other>,
}

impl Tree {
    /// Collapses a binary tree over the reordered primitives.
    pub(super) fn new(
        geometry: &GeometrySet,
        prims: &[PrimRef],
        binary: Option<&Binary>,
        leaf_kinds: &[LeafKind],
    ) -> Self {
        // Nodes, and ranges of primitives
        let mut collapse = Collapse {
            prims,
            leaf_kinds,
            nodes: Vec::new(),
            triangles: Vec::new(),
            curves: Vec::new(),
            others: Vec::new(),
        };
        let root = binary.map(|binary| {
            let root = collapse.place(binary);
            collapse.fill(root, binary);
            root
        });
        let Collapse { mut nodes, triangles, curves, mut others, .. } = collapse;
        nodes.shrink_to_fit();
        others.shrink_to_fit();

        // Blocks, in parallel
        let blocks = triangles.into_par_iter().map(|leaf| Block::new(geometry, &prims[leaf])).collect();
        let curves = curves.into_par_iter().map(|leaf| CurveBlock::new(geometry, &prims[leaf])).collect();
        let bounds = binary.map_or(Bounds3::EMPTY, |b| Bounds3 { min: b.bounds.lo.into(), max: b.bounds.hi.into() });
        Tree { bounds, root, nodes, blocks, curves, others }
    }

    /// Memory (bytes).
    pub(super) fn bytes(&self) -> u64 {
        let leaves = size_of_val(&self.blocks[..]) + size_of_val(&self.curves[..]) + size_of_val(&self.others[..]);
        (size_of_val(&self.nodes[..]) + leaves) as u64
    }
}

struct Collapse<'a> {
    prims: &'a [PrimRef],
    leaf_kinds: &'a [LeafKind],
    nodes: Vec<Node>,
    /// Range of primitives of each block of triangles.
    triangles: Vec<Range<usize>>,
    /// Range of primitives of each block of curves.
    curves: Vec<Range<usize>>,
    others: Vec<Other>,
}

impl Collapse<'_> {
    fn leaf(&mut self, start: usize, count: usize) -> ChildRef {
        let PrimRef { geometry, primitive, .. } = self.prims[start];
        match LeafKind::of(&self.prims[start], self.leaf_kinds) {
            LeafKind::Triangles => {
                self.triangles.push(start..start + count);
                ChildRef::new(1, self.triangles.len() - 1)
            }
            LeafKind::Curves => {
                self.curves.push(start..start + count);
                ChildRef::new(3, self.curves.len() - 1)
            }
            LeafKind::Single => {
                let is_instance = geometry == PrimRef::INSTANCE;
                let exact = Other::Exact { geometry, primitive };
                self.others.push(if is_instance { Other::Instance(primitive) } else { exact });
                ChildRef::new(2, self.others.len() - 1)
            }
        }
    }

    /// The reference to a binary subtree: a leaf, or a new node that is filled later.
    fn place(&mut self, binary: &Binary) -> ChildRef {
        match binary.kind {
            BinaryKind::Leaf { start, count } => self.leaf(start, count),
            BinaryKind::Inner(_) => {
                self.nodes.push(Node { bounds: [[Vec4::ZERO; 2]; 6], children: [ChildRef::EMPTY; 8] });
                ChildRef::new(0, self.nodes.len() - 1)
            }
        }
    }

    /// Fills the node of a subtree and all nodes below. Siblings are adjacent in memory, because a ray that visits one
    /// often visits another.
    fn fill(&mut self, place: ChildRef, binary: &Binary) {
        let (Child::Node(index), BinaryKind::Inner(children)) = (place.decode(), &binary.kind) else { return };
        let slots = opened(children);
        self.nodes[index].bounds = grown_bounds(&slots);
        for (lane, slot) in slots.iter().enumerate() {
            let child = self.place(slot);
            self.nodes[index].children[lane] = child;
        }
        for (lane, slot) in slots.iter().enumerate() {
            self.fill(self.nodes[index].children[lane], slot);
        }
    }
}

/// The subtrees that become the children of a node. The largest inner subtree is replaced by its children until there
/// are eight.
fn opened(children: &[Binary; 2]) -> Vec<&Binary> {
    let mut slots: Vec<&Binary> = children.iter().collect();
    while slots.len() < 8 {
        let mut largest: Option<(f32, usize, &[Binary; 2])> = None;
        for (i, slot) in slots.iter().enumerate() {
            if let BinaryKind::Inner(below) = &slot.kind {
                let area = slot.bounds.half_area();
                if largest.is_none_or(|(max, ..)| area > max) {
                    largest = Some((area, i, below));
                }
            }
        }
        let Some((_, i, below)) = largest else { break };
        slots[i] = &below[0];
        slots.push(&below[1]);
    }
    slots
}

/// Rows of the boxes of a node. Boxes of unused lanes are empty.
fn grown_bounds(slots: &[&Binary]) -> [[Vec4; 2]; 6] {
    let mut lanes = [[f32::INFINITY; 8], [f32::NEG_INFINITY; 8]].map(|row| [row; 3]);
    for (lane, slot) in slots.iter().enumerate() {
        let (lo, hi) = (Vec3::from(slot.bounds.lo), Vec3::from(slot.bounds.hi));
        let growth = lo.abs().max(hi.abs()).max_element() * BOX_GROWTH;
        for axis in 0..3 {
            lanes[0][axis][lane] = (lo[axis] - growth).next_down();
            lanes[1][axis][lane] = (hi[axis] + growth).next_up();
        }
    }
    std::array::from_fn(|r| {
        let lanes = &lanes[r / 3][r % 3];
        [Vec4::from_slice(&lanes[..4]), Vec4::from_slice(&lanes[4..])]
    })
}

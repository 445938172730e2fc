//! Meshes of implicit surfaces: surface nets [Gibson 1998] with one vertex per sheet and cell [Nielson 2004], so that
//! the mesh is closed and every edge has exactly two triangles.
//!
//! The field f is sampled at the corners of a grid of cubes. A cell in which f changes sign gets a vertex for each of
//! its sheets ([`cases`]): the mean of the crossings of the sheet's edges. In cells with a single sheet it is moved
//! onto f = 0 by one Newton step of the trilinear interpolant. Every crossed grid edge gives the polygon of the four
//! vertices around it. If the surface crosses a face of two cells twice, both polygons of each crossing get an
//! additional vertex between the two cells; otherwise the two crossings might share an edge.
//!
//! Cubes of 16³ cells are processed in parallel and merged in order, so the mesh does not depend on the number of
//! threads. Leaves of 4³ cells are skipped if the field's bounds exclude a sign change.
//!
//! Reading order: `cases`, this file, `piece`.

mod cases;
mod piece;

use cases::{Case, edge_between, edge_corners, face_corners, is_ambiguous};
use lumiris::geometry::TriangleMesh;
use lumiris_numbers::math::Vec3;
pub use piece::largest_piece;
use rayon::prelude::*;

/// Cells of a block along an axis.
const BLOCK: usize = 16;
/// Cells of a leaf along an axis.
const LEAF: usize = 4;
/// Samples of a block along an axis.
const SAMPLES: usize = BLOCK + 1;
/// Minimum distance of crossings from the ends of an edge, relative to its length, so that vertices of different cells
/// differ.
const MARGIN: f32 = 0.04;

/// A sphere in which a field is queried.
#[derive(Clone, Copy, Debug)]
pub struct Ball {
    /// Centre.
    pub center: Vec3,
    /// Radius.
    pub radius: f32,
}

/// A function of space that is negative inside a solid.
pub trait Field: Sync {
    /// The part of the field that affects a ball.
    type Near;
    /// Restricts the field to a ball within the ball of `wider`.
    fn near(&self, wider: Option<&Self::Near>, ball: Ball) -> Self::Near;
    /// True or false if all of the ball is certainly inside or outside.
    fn is_inside(&self, near: &Self::Near) -> Option<bool>;
    /// The value at a point of the ball of `near`; a function of the point alone.
    fn value(&self, near: &Self::Near, p: Vec3) -> f32;
}

/// A grid of cubic cells.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    origin: Vec3,
    cell: f32,
    blocks: [usize; 3],
}

impl Grid {
    /// Cells of edge `cell` that cover the box from `low` to `high`.
    pub fn new(low: Vec3, high: Vec3, cell: f32) -> Self {
        let count = |extent: f32| ((extent / cell).ceil() as usize).div_ceil(BLOCK).max(1);
        let extent = high - low;
        Grid { origin: low, cell, blocks: [count(extent.x), count(extent.y), count(extent.z)] }
    }

    fn block_count(&self) -> usize {
        self.blocks.iter().product()
    }

    /// The first cell of a block.
    fn first_cell(&self, block: usize) -> [usize; 3] {
        let [nx, ny, _] = self.blocks;
        [block % nx * BLOCK, block / nx % ny * BLOCK, block / (nx * ny) * BLOCK]
    }

    fn block_of(&self, cell: [usize; 3]) -> usize {
        let [x, y, z] = cell.map(|c| c / BLOCK);
        (z * self.blocks[1] + y) * self.blocks[0] + x
    }

    fn corner(&self, [x, y, z]: [usize; 3]) -> Vec3 {
        self.origin + self.cell * Vec3::new(x as f32, y as f32, z as f32)
    }

    fn ball(&self, first: [usize; 3], cells: usize) -> Ball {
        let half = 0.5 * cells as f32 * self.cell;
        Ball { center: self.corner(first) + half, radius: half * 1.7321 }
    }
}

/// A cell that intersects the surface.
#[derive(Clone, Copy)]
struct Cell {
    /// Index in the block.
    local: u16,
    /// Bit i: corner i is inside.
    config: u8,
    /// Index of its first vertex in the block: one per sheet, then two per ambiguous face on its lower side.
    first: u32,
}

/// The surface in a block.
struct Block {
    index: usize,
    cells: Vec<Cell>,
    /// One more than the index in `cells`; 0 for none.
    lookup: Vec<u16>,
    vertices: Vec<Vec3>,
    normals: Vec<Vec3>,
}

fn local_index([x, y, z]: [usize; 3]) -> usize {
    (z % BLOCK * BLOCK + y % BLOCK) * BLOCK + x % BLOCK
}

fn offset(cell: [usize; 3], corner: usize) -> [usize; 3] {
    [cell[0] + (corner & 1), cell[1] + (corner >> 1 & 1), cell[2] + (corner >> 2 & 1)]
}

/// The surface f = 0 in the grid, with normals (the direction of ∇f) at its vertices. The field must be positive on the
/// border of the grid.
pub fn mesh_field<F: Field>(field: &F, grid: &Grid) -> Result<TriangleMesh, String> {
    let cases = cases::all();
    let blocks: Vec<Block> =
        (0..grid.block_count()).into_par_iter().filter_map(|index| mesh_block(field, grid, &cases, index)).collect();

    // Number the vertices
    let mut slots = vec![usize::MAX; grid.block_count()];
    let mut bases = Vec::with_capacity(blocks.len());
    let mut count = 0;
    for (slot, block) in blocks.iter().enumerate() {
        slots[block.index] = slot;
        bases.push(count);
        count += block.vertices.len();
    }
    if u32::try_from(count).is_err() {
        return Err(format!("the mesh would have {count} vertices, more than 32 bits can number"));
    }

    // Merge the blocks
    let net = Net { grid, cases: &cases, blocks: &blocks, slots, bases };
    let faces: Vec<Vec<[u32; 3]>> =
        (0..blocks.len()).into_par_iter().map(|slot| net.faces_of(slot)).collect::<Result<_, _>>()?;
    let positions = blocks.iter().flat_map(|b| b.vertices.iter().copied()).collect();
    let mut mesh = TriangleMesh::new(positions, faces.concat())?;
    mesh.normals = blocks.iter().flat_map(|b| b.normals.iter().copied()).collect();
    Ok(mesh)
}

fn mesh_block<F: Field>(field: &F, grid: &Grid, cases: &[Case; 256], index: usize) -> Option<Block> {
    let first = grid.first_cell(index);
    let wider = field.near(None, grid.ball(first, BLOCK));
    if field.is_inside(&wider).is_some() {
        return None;
    }

    // Sample the leaves that may intersect the surface
    let mut samples = vec![f32::NAN; SAMPLES * SAMPLES * SAMPLES];
    let at = |[x, y, z]: [usize; 3]| (z * SAMPLES + y) * SAMPLES + x;
    let mut open = Vec::new();
    let per_axis = BLOCK / LEAF;
    for leaf in 0..per_axis * per_axis * per_axis {
        let low = [leaf % per_axis, leaf / per_axis % per_axis, leaf / per_axis / per_axis].map(|l| l * LEAF);
        let origin = std::array::from_fn(|a| first[a] + low[a]);
        let near = field.near(Some(&wider), grid.ball(origin, LEAF));
        if field.is_inside(&near).is_some() {
            continue;
        }
        open.push(low);
        for i in 0..(LEAF + 1) * (LEAF + 1) * (LEAF + 1) {
            let p =
                [low[0] + i % (LEAF + 1), low[1] + i / (LEAF + 1) % (LEAF + 1), low[2] + i / (LEAF + 1) / (LEAF + 1)];
            let sample = &mut samples[at(p)];
            if sample.is_nan() {
                *sample = field.value(&near, grid.corner(std::array::from_fn(|a| first[a] + p[a])));
            }
        }
    }

    // Make the vertices
    let (cells, lookup) = (Vec::new(), vec![0; BLOCK * BLOCK * BLOCK]);
    let mut block = Block { index, cells, lookup, vertices: Vec::new(), normals: Vec::new() };
    for low in open {
        for i in 0..LEAF * LEAF * LEAF {
            let cell = [low[0] + i % LEAF, low[1] + i / LEAF % LEAF, low[2] + i / LEAF / LEAF];
            let values = std::array::from_fn(|c| samples[at(offset(cell, c))]);
            let corner = grid.corner(std::array::from_fn(|a| first[a] + cell[a]));
            block.add_cell(cell, CellField { values, corner, cell: grid.cell }, cases);
        }
    }
    (!block.cells.is_empty()).then_some(block)
}

/// The field in a cell: the trilinear interpolant of its corners.
struct CellField {
    values: [f32; 8],
    corner: Vec3,
    cell: f32,
}

impl CellField {
    fn config(&self) -> u8 {
        (0..8).fold(0, |bits, i| bits | u8::from(self.values[i] < 0.0) << i)
    }

    /// Position of the sign change on an edge, in units of the cell.
    fn crossing(&self, edge: usize) -> Vec3 {
        let [a, b] = edge_corners(edge);
        let (fa, fb) = (self.values[a], self.values[b]);
        let t = (fa / (fa - fb)).clamp(MARGIN, 1.0 - MARGIN);
        let [x, y, z] = offset([0; 3], a).map(|v| v as f32);
        let mut p = Vec3::new(x, y, z);
        p[edge / 4] = t;
        p
    }

    /// Value and gradient (per cell) of the interpolant at `p`, in units of the cell.
    fn interpolate(&self, p: Vec3) -> (f32, Vec3) {
        let (mut value, mut gradient) = (0.0, Vec3::ZERO);
        for (i, &f) in self.values.iter().enumerate() {
            let side = |a: usize| i >> a & 1 == 1;
            let w: [f32; 3] = std::array::from_fn(|a| if side(a) { p[a] } else { 1.0 - p[a] });
            let slope = |a: usize| if side(a) { f } else { -f };
            value += f * w[0] * w[1] * w[2];
            gradient += Vec3::new(slope(0) * w[1] * w[2], slope(1) * w[0] * w[2], slope(2) * w[0] * w[1]);
        }
        (value, gradient)
    }
}

impl Block {
    fn add_cell(&mut self, cell: [usize; 3], field: CellField, cases: &[Case; 256]) {
        let config = field.config();
        let case = &cases[config as usize];
        if case.sheets == 0 {
            return;
        }
        let local = local_index(cell);
        self.cells.push(Cell { local: local as u16, config, first: self.vertices.len() as u32 });
        self.lookup[local] = self.cells.len() as u16;

        // A vertex for each sheet
        for sheet in 0..case.sheets {
            let (mut sum, mut count) = (Vec3::ZERO, 0.0);
            for edge in (0..12).filter(|&e| is_crossed(config, e) && case.sheet[e] == sheet) {
                sum += field.crossing(edge);
                count += 1.0;
            }
            let mut p = sum / count;
            if case.sheets == 1 {
                let (value, gradient) = field.interpolate(p);
                let step = gradient * (value / gradient.length_squared().max(f32::MIN_POSITIVE));
                p = (p - step.clamp_length_max(0.5)).clamp(Vec3::splat(MARGIN), Vec3::splat(1.0 - MARGIN));
            }
            self.add_vertex(&field, p);
        }

        // Two for each face that the surface crosses twice
        for axis in 0..3 {
            let corners = face_corners(axis, 0);
            if is_ambiguous(config, corners) {
                for j in (0..4).filter(|&j| config >> corners[j] & 1 == 1) {
                    let crossing = |k: usize| field.crossing(edge_between(corners[j], corners[k]));
                    self.add_vertex(&field, 0.5 * (crossing(j ^ 1) + crossing(j ^ 2)));
                }
            }
        }
    }

    fn add_vertex(&mut self, field: &CellField, p: Vec3) {
        self.vertices.push(field.corner + field.cell * p);
        self.normals.push(field.interpolate(p).1.normalize_or(Vec3::Z));
    }
}

fn is_crossed(config: u8, edge: usize) -> bool {
    let [a, b] = edge_corners(edge);
    (config >> a ^ config >> b) & 1 == 1
}

/// All blocks, merged.
struct Net<'a> {
    grid: &'a Grid,
    cases: &'a [Case; 256],
    blocks: &'a [Block],
    /// Position in `blocks` by block index.
    slots: Vec<usize>,
    /// First vertex of each block.
    bases: Vec<usize>,
}

impl Net<'_> {
    /// A cell and the index of its first vertex.
    fn find(&self, cell: [usize; 3]) -> Option<(Cell, u32)> {
        let slot = *self.slots.get(self.grid.block_of(cell))?;
        let block = self.blocks.get(slot)?;
        let found = block.cells[(block.lookup[local_index(cell)] as usize).checked_sub(1)?];
        Some((found, self.bases[slot] as u32 + found.first))
    }

    fn faces_of(&self, slot: usize) -> Result<Vec<[u32; 3]>, String> {
        let block = &self.blocks[slot];
        let first = self.grid.first_cell(block.index);
        let mut faces = Vec::new();
        let mut polygon = Vec::with_capacity(8);
        for cell in &block.cells {
            let l = cell.local as usize;
            let at = [first[0] + l % BLOCK, first[1] + l / BLOCK % BLOCK, first[2] + l / BLOCK / BLOCK];
            for axis in 0..3 {
                // The edge from the lower corner of the cell
                let starts_inside = cell.config & 1 == 1;
                if starts_inside == (cell.config >> (1 << axis) & 1 == 1) {
                    continue;
                }
                polygon.clear();
                self.polygon_around(at, axis, &mut polygon).ok_or_else(|| {
                    format!("the field leaves the grid, or its bounds are wrong, near {}", self.grid.corner(at))
                })?;
                if !starts_inside {
                    polygon.reverse();
                }
                self.triangulate(&polygon, &mut faces);
            }
        }
        Ok(faces)
    }

    /// The vertices around the edge along `axis` from the lower corner of a cell, counter-clockwise about the axis.
    fn polygon_around(&self, at: [usize; 3], axis: usize, polygon: &mut Vec<u32>) -> Option<()> {
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        for step in 0..4 {
            // The side of the edge on which the cell is, and the face between it and the next one
            let (high_b, high_c) = [(false, false), (true, false), (true, true), (false, true)][step];
            let mut cell = at;
            cell[b] = cell[b].checked_sub(usize::from(!high_b))?;
            cell[c] = cell[c].checked_sub(usize::from(!high_c))?;
            let (found, first) = self.find(cell)?;
            // A cell on the higher side has the edge on its lower side.
            let edge = 4 * axis + (usize::from(!high_b) | usize::from(!high_c) << 1);
            if !is_crossed(found.config, edge) {
                return None;
            }
            polygon.push(first + u32::from(self.cases[found.config as usize].sheet[edge]));

            let (across, owner) = if step % 2 == 0 { (b, (true, high_c)) } else { (c, (high_b, true)) };
            let mut cell = at;
            cell[b] = cell[b].checked_sub(usize::from(!owner.0))?;
            cell[c] = cell[c].checked_sub(usize::from(!owner.1))?;
            let (found, first) = self.find(cell)?;
            if is_ambiguous(found.config, face_corners(across, 0)) {
                let edge = 4 * axis + (usize::from(!owner.0) | usize::from(!owner.1) << 1);
                polygon.push(first + self.passage(found.config, across, edge));
            }
        }
        Some(())
    }

    /// Index among a cell's vertices for the crossing of its lower face across `axis` that contains `edge`.
    fn passage(&self, config: u8, axis: usize, edge: usize) -> u32 {
        let before = (0..axis).filter(|&a| is_ambiguous(config, face_corners(a, 0))).count() as u32;
        let corners = face_corners(axis, 0);
        let [low, high] = edge_corners(edge);
        let inside = if config >> low & 1 == 1 { low } else { high };
        // Of two diagonal corners one is among the first two.
        let second = u32::from(inside == corners[2] || inside == corners[3]);
        u32::from(self.cases[config as usize].sheets) + 2 * before + second
    }

    fn position(&self, vertex: u32) -> Vec3 {
        let slot = self.bases.partition_point(|&base| base <= vertex as usize) - 1;
        self.blocks[slot].vertices[vertex as usize - self.bases[slot]]
    }

    /// Splits quads along the diagonal that maximises the smaller triangle; other polygons become a fan.
    fn triangulate(&self, polygon: &[u32], faces: &mut Vec<[u32; 3]>) {
        let start = if let &[a, b, c, d] = polygon {
            let [pa, pb, pc, pd] = [a, b, c, d].map(|v| self.position(v));
            let area = |p: Vec3, q: Vec3, r: Vec3| (q - p).cross(r - p).length_squared();
            usize::from(area(pa, pb, pc).min(area(pa, pc, pd)) < area(pb, pc, pd).min(area(pb, pd, pa)))
        } else {
            // Start at a vertex between cells: no other polygon has such a diagonal.
            polygon.iter().position(|&v| self.is_between_cells(v)).unwrap_or(0)
        };
        let at = |i: usize| polygon[(start + i) % polygon.len()];
        faces.extend((1..polygon.len() - 1).map(|i| [at(0), at(i), at(i + 1)]));
    }

    fn is_between_cells(&self, vertex: u32) -> bool {
        let slot = self.bases.partition_point(|&base| base <= vertex as usize) - 1;
        let (block, local) = (&self.blocks[slot], vertex - self.bases[slot] as u32);
        let cell = block.cells[block.cells.partition_point(|c| c.first <= local) - 1];
        local - cell.first >= u32::from(self.cases[cell.config as usize].sheets)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::procedural::gradient_noise::noise;
    use std::collections::BTreeMap;

    /// A torus, or noise inside a ball: all cases occur.
    enum Solid {
        Torus,
        Noise,
    }

    impl Field for Solid {
        type Near = Option<bool>;
        fn near(&self, _: Option<&Option<bool>>, ball: Ball) -> Option<bool> {
            let d = self.value(&None, ball.center);
            (matches!(self, Solid::Torus) && d.abs() > ball.radius).then_some(d < 0.0)
        }
        fn is_inside(&self, near: &Option<bool>) -> Option<bool> {
            *near
        }
        fn value(&self, _: &Option<bool>, p: Vec3) -> f32 {
            match self {
                Solid::Torus => (p.truncate().length() - 0.7).hypot(p.z) - 0.25,
                Solid::Noise => (p.length() - 0.9).max(noise(p * 11.3, 1)),
            }
        }
    }

    /// Panics unless the mesh is closed, oriented and without degenerate triangles.
    pub(crate) fn assert_closed(mesh: &TriangleMesh) {
        let mut edges: BTreeMap<[u32; 2], (u32, u32)> = BTreeMap::new();
        for (i, &[a, b, c]) in mesh.indices.iter().enumerate() {
            assert!(mesh.area(i) > 0.0, "triangle {i} has no area");
            for [from, to] in [[a, b], [b, c], [c, a]] {
                let uses = edges.entry([from.min(to), from.max(to)]).or_default();
                if from < to { uses.0 += 1 } else { uses.1 += 1 }
            }
        }
        assert!(edges.values().all(|&uses| uses == (1, 1)), "an edge is not used once in each direction");
    }

    fn make(solid: &Solid, cell: f32) -> TriangleMesh {
        mesh_field(solid, &Grid::new(Vec3::splat(-1.1), Vec3::splat(1.1), cell)).unwrap()
    }

    fn volume(mesh: &TriangleMesh) -> f64 {
        let sixth = |i| {
            let [a, b, c] = mesh.triangle(i);
            f64::from(a.dot(b.cross(c))) / 6.0
        };
        (0..mesh.triangle_count()).map(sixth).sum()
    }

    #[test]
    fn a_torus_has_its_volume_its_genus_and_outward_normals() {
        let mesh = make(&Solid::Torus, 0.04);
        assert_closed(&mesh);
        let exact = 2.0 * std::f64::consts::PI.powi(2) * 0.7 * 0.25 * 0.25;
        assert!((volume(&mesh) / exact - 1.0).abs() < 0.01, "{}", volume(&mesh) / exact);
        // Vertices − edges + faces = 0 for a torus.
        assert_eq!(mesh.positions().len() as i64 - mesh.triangle_count() as i64 / 2, 0);
        for (i, t) in mesh.indices.iter().enumerate() {
            let [a, b, c] = mesh.triangle(i);
            let n = (b - a).cross(c - a).normalize();
            assert!(t.iter().all(|&v| mesh.normals[v as usize].dot(n) > 0.5));
        }
        let off = mesh.positions().iter().map(|&p| Solid::Torus.value(&None, p).abs()).fold(0.0, f32::max);
        assert!(off < 0.005, "{off}");
    }

    #[test]
    fn the_most_tangled_surface_is_closed() {
        for cell in [0.11, 0.06, 0.05] {
            let mesh = make(&Solid::Noise, cell);
            assert!(mesh.triangle_count() > 2000);
            assert_closed(&mesh);
        }
    }

    #[test]
    fn a_surface_that_leaves_the_grid_is_an_error() {
        let grid = Grid::new(Vec3::splat(-0.5), Vec3::splat(0.5), 0.05);
        assert!(mesh_field(&Solid::Torus, &grid).is_err());
    }
}

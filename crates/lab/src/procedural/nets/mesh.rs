//! Merges the blocks of a grid to a mesh.

use super::block::{Block, Cell, is_crossed, local_index, mesh_block};
use super::cases::{self, Case, edge_corners, face_corners, is_ambiguous};
use super::field::Field;
use super::grid::{BLOCK, Grid};
use lumiris::geometry::TriangleMesh;
use lumiris_numbers::math::Vec3;
use rayon::prelude::*;

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
    use crate::procedural::nets::Ball;
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

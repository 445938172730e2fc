//! The surface in a block of cells: its vertices and normals.

use super::cases::{Case, edge_between, edge_corners, face_corners, is_ambiguous};
use super::field::Field;
use super::grid::{BLOCK, Grid};
use lumiris_numbers::math::Vec3;

/// Cells of a leaf along an axis.
const LEAF: usize = 4;
/// Samples of a block along an axis.
const SAMPLES: usize = BLOCK + 1;
/// Minimum distance of crossings from the ends of an edge, relative to its length, so that vertices of different cells
/// differ.
const MARGIN: f32 = 0.04;

/// A cell that intersects the surface.
#[derive(Clone, Copy)]
pub(super) struct Cell {
    /// Index in the block.
    pub(super) local: u16,
    /// Bit i: corner i is inside.
    pub(super) config: u8,
    /// Index of its first vertex in the block: one per sheet, then two per ambiguous face on its lower side.
    pub(super) first: u32,
}

/// The surface in a block.
pub(super) struct Block {
    pub(super) index: usize,
    pub(super) cells: Vec<Cell>,
    /// One more than the index in `cells`; 0 for none.
    pub(super) lookup: Vec<u16>,
    pub(super) vertices: Vec<Vec3>,
    pub(super) normals: Vec<Vec3>,
}

pub(super) fn local_index([x, y, z]: [usize; 3]) -> usize {
    (z % BLOCK * BLOCK + y % BLOCK) * BLOCK + x % BLOCK
}

fn offset(cell: [usize; 3], corner: usize) -> [usize; 3] {
    [cell[0] + (corner & 1), cell[1] + (corner >> 1 & 1), cell[2] + (corner >> 2 & 1)]
}

pub(super) fn mesh_block<F: Field>(field: &F, grid: &Grid, cases: &[Case; 256], index: usize) -> Option<Block> {
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

/// Value and gradient (per cell) of the field.
struct Interpolated {
    value: f32,
    gradient: Vec3,
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

    /// The interpolant at `p`, in units of the cell.
    fn interpolate(&self, p: Vec3) -> Interpolated {
        let (mut value, mut gradient) = (0.0, Vec3::ZERO);
        for (i, &f) in self.values.iter().enumerate() {
            let side = |a: usize| i >> a & 1 == 1;
            let w: [f32; 3] = std::array::from_fn(|a| if side(a) { p[a] } else { 1.0 - p[a] });
            let slope = |a: usize| if side(a) { f } else { -f };
            value += f * w[0] * w[1] * w[2];
            gradient += Vec3::new(slope(0) * w[1] * w[2], slope(1) * w[0] * w[2], slope(2) * w[0] * w[1]);
        }
        Interpolated { value, gradient }
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
                let Interpolated { value, gradient } = field.interpolate(p);
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
        self.normals.push(field.interpolate(p).gradient.normalize_or(Vec3::Z));
    }
}

pub(super) fn is_crossed(config: u8, edge: usize) -> bool {
    let [a, b] = edge_corners(edge);
    (config >> a ^ config >> b) & 1 == 1
}

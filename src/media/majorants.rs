//! A coarse grid of upper bounds of σ_t over the unit cube, and its intersection with rays.

use lumiris_numbers::math::Vec3;

/// Upper bounds of σ_t in cells of equal size.
#[derive(Clone, Debug)]
pub struct MajorantGrid {
    resolution: [usize; 3],
    /// (1/m), x fastest.
    values: Vec<f32>,
}

/// A part of a ray in one cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MajorantSegment {
    /// Ray parameter of its begin.
    pub begin: f32,
    /// Ray parameter of its end.
    pub end: f32,
    /// The bound (1/m).
    pub majorant: f32,
}

impl MajorantGrid {
    /// A grid with the bound `bound(lower corner, upper corner)` for each cell.
    pub fn new(resolution: [usize; 3], bound: impl Fn(Vec3, Vec3) -> f32 + Sync) -> Self {
        use rayon::prelude::*;
        let [nx, ny, nz] = resolution;
        let corner =
            |x: usize, y: usize, z: usize| Vec3::new(x as f32 / nx as f32, y as f32 / ny as f32, z as f32 / nz as f32);
        let of = |i: usize| {
            let (x, y, z) = (i % nx, i / nx % ny, i / (nx * ny));
            bound(corner(x, y, z), corner(x + 1, y + 1, z + 1))
        };
        MajorantGrid { resolution, values: (0..nx * ny * nz).into_par_iter().map(of).collect() }
    }

    /// The grid with the values `f(m)`, where m is the maximum bound of a cell and its 26 neighbours.
    #[must_use]
    pub fn with_neighbors(&self, f: impl Fn(f32) -> f32) -> Self {
        let [nx, ny, nz] = self.resolution;
        let around = |i: usize, n: usize| i.saturating_sub(1)..(i + 2).min(n);
        let of = |i: usize| {
            let mut greatest = 0.0_f32;
            for z in around(i / (nx * ny), nz) {
                for y in around(i / nx % ny, ny) {
                    let row = nx * (y + ny * z);
                    greatest = around(i % nx, nx).fold(greatest, |max, x| max.max(self.values[row + x]));
                }
            }
            f(greatest)
        };
        MajorantGrid { resolution: self.resolution, values: (0..self.values.len()).map(of).collect() }
    }

    /// Bytes of the bounds.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.values[..])
    }

    /// Numbers of cells along the axes.
    pub fn resolution(&self) -> [usize; 3] {
        self.resolution
    }

    /// The bound at a point of the unit cube.
    #[inline]
    pub fn at(&self, p: Vec3) -> f32 {
        let [nx, ny, _] = self.resolution;
        let [x, y, z] = [0, 1, 2].map(|axis| self.cell(p, axis));
        self.values[x + nx * (y + ny * z)]
    }

    /// Index of the cell of a point along an axis.
    #[inline]
    fn cell(&self, p: Vec3, axis: usize) -> usize {
        let n = self.resolution[axis];
        (p[axis] * n as f32).clamp(0.0, (n - 1) as f32) as usize
    }

    /// The parts of the ray `o + t·d`, 0 < t < `t_max`, in the unit cube, cell by cell [Amanatides and Woo 1987].
    pub fn segments(&self, o: Vec3, d: Vec3, t_max: f32) -> MajorantIterator<'_> {
        // The part inside the cube
        let (mut begin, mut end) = (0.0_f32, t_max);
        for axis in 0..3 {
            if d[axis] == 0.0 {
                if !(0.0..=1.0).contains(&o[axis]) {
                    end = -1.0;
                }
                continue;
            }
            let [a, b] = [-o[axis] / d[axis], (1.0 - o[axis]) / d[axis]];
            (begin, end) = (begin.max(a.min(b)), end.min(a.max(b)));
        }
        let mut iterator = MajorantIterator {
            grid: self,
            t: begin,
            end,
            cell: [0; 3],
            next: [f32::INFINITY; 3],
            step: [0.0; 3],
            up: [true; 3],
        };
        if !(begin < end) {
            iterator.t = f32::INFINITY;
            return iterator;
        }
        // The first cell, and the ray parameters of its exits
        let p = o + d * begin;
        for axis in 0..3 {
            let (n, cell) = (self.resolution[axis], self.cell(p, axis));
            iterator.cell[axis] = cell;
            iterator.up[axis] = d[axis] > 0.0;
            if d[axis] != 0.0 {
                let wall = (cell + usize::from(iterator.up[axis])) as f32 / n as f32;
                iterator.next[axis] = (wall - o[axis]) / d[axis];
                iterator.step[axis] = 1.0 / (n as f32 * d[axis].abs());
            }
        }
        iterator
    }
}

/// The iterator of [`MajorantGrid::segments`].
#[derive(Clone, Debug)]
pub struct MajorantIterator<'a> {
    grid: &'a MajorantGrid,
    /// Begin of the next segment; infinite after the last.
    t: f32,
    end: f32,
    cell: [usize; 3],
    /// Ray parameters of the next wall of each axis, and the spacing of the walls.
    next: [f32; 3],
    step: [f32; 3],
    up: [bool; 3],
}

impl Iterator for MajorantIterator<'_> {
    type Item = MajorantSegment;

    #[inline]
    fn next(&mut self) -> Option<MajorantSegment> {
        if !(self.t < self.end) {
            return None;
        }
        let [nx, ny, _] = self.grid.resolution;
        let majorant = self.grid.values[self.cell[0] + nx * (self.cell[1] + ny * self.cell[2])];
        let axis = (0..3).fold(0, |best, axis| if self.next[axis] < self.next[best] { axis } else { best });
        // Rounding may put a wall slightly before the begin
        let end = self.next[axis].max(self.t).min(self.end);
        let segment = MajorantSegment { begin: self.t, end, majorant };
        self.t = end;
        self.next[axis] += self.step[axis];
        let is_last =
            if self.up[axis] { self.cell[axis] + 1 == self.grid.resolution[axis] } else { self.cell[axis] == 0 };
        if is_last {
            self.t = f32::INFINITY;
        } else if self.up[axis] {
            self.cell[axis] += 1;
        } else {
            self.cell[axis] -= 1;
        }
        Some(segment)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_numbers::math::warp::sample_uniform_sphere;
    use lumiris_test_support::random::{RngExt, pcg32};

    #[test]
    fn pieces_cover_the_ray_inside_the_cube_with_the_bounds_of_their_cells() {
        let resolution = [3, 1, 5];
        let key = |p: Vec3| {
            let cell =
                |axis: usize| (p[axis] * resolution[axis] as f32).clamp(0.0, resolution[axis] as f32 - 1.0).floor();
            1.0 + cell(0) + 10.0 * cell(1) + 100.0 * cell(2)
        };
        let grid = MajorantGrid::new(resolution, |a, b| key((a + b) * 0.5));
        let mut stream = pcg32([3, 1, 4]);
        let mut covered = 0;
        for i in 0..20_000 {
            let o = Vec3::from(std::array::from_fn::<f32, 3, _>(|_| stream.random::<f32>() * 3.0 - 1.0));
            let axis_aligned = [Vec3::X, -Vec3::Z, Vec3::Y][i % 3];
            let d = if i % 5 == 0 { axis_aligned } else { sample_uniform_sphere(stream.random::<[f32; 2]>()) };
            let d = d * (0.1 + stream.random::<f32>());
            let t_max = if i % 2 == 0 { f32::INFINITY } else { 3.0 * stream.random::<f32>() };
            let segments: Vec<MajorantSegment> = grid.segments(o, d, t_max).collect();
            let is_inside = |t: f32| (0..3).all(|axis| (1e-4..1.0 - 1e-4).contains(&o.lerp(o + d, t)[axis]));
            for pair in segments.windows(2) {
                assert_eq!(pair[0].end, pair[1].begin);
            }
            for segment in segments.iter().filter(|p| p.end - p.begin > 1e-3) {
                let p = o + d * (0.5 * (segment.begin + segment.end));
                assert_eq!(segment.majorant, key(p), "{p}");
            }
            let end = if t_max.is_finite() { t_max } else { 60.0 };
            for k in 0..50 {
                let t = end * (k as f32 + 0.5) / 50.0;
                let is_covered = segments.iter().any(|p| (p.begin..=p.end).contains(&t));
                covered += usize::from(is_covered);
                assert!(is_covered || !is_inside(t), "{o} {d} {t} {segments:?}");
            }
        }
        assert!(covered > 10_000, "{covered}");
    }
}

//! The ground of the island and of the sea around it: a height field on a square.

use super::meshes::grid;
use crate::procedural::gradient_noise::{fractal, ridged, smoothstep};
use lumiris::geometry::TriangleMesh;
use lumiris_numbers::math::{Vec2, Vec3};
use rayon::prelude::*;

/// Linear Rec.709 albedos of the ground, and of the water over the shore and over depths.
const SAND: Vec3 = Vec3::new(0.62, 0.50, 0.34);
const WET_SAND: Vec3 = Vec3::new(0.36, 0.28, 0.18);
const SOIL: Vec3 = Vec3::new(0.10, 0.12, 0.035);
const ROCK: Vec3 = Vec3::new(0.16, 0.14, 0.12);
const SHALLOW: Vec3 = Vec3::new(0.10, 0.36, 0.34);
const DEEP: Vec3 = Vec3::new(0.004, 0.04, 0.085);

/// The ground.
#[derive(Clone, Copy, Debug)]
pub(super) struct Terrain {
    /// Side of the square about the origin (m).
    pub(super) side: f32,
    pub(super) seed: u32,
}

/// The ground at a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ground {
    /// Above the sea (m).
    pub(super) height: f32,
    /// Its derivatives.
    pub(super) gradient: Vec2,
}

impl Terrain {
    /// Approximate distance from the coast, positive on land, as a fraction of the side.
    pub(super) fn inland(&self, p: Vec2) -> f32 {
        let q = p / self.side;
        let coast = 0.30 + 0.16 * fractal((q * 3.1).extend(0.3), 5, self.seed);
        coast - q.length()
    }

    /// Height above the sea (m).
    pub(super) fn height(&self, p: Vec2) -> f32 {
        let (q, inland) = (p / self.side, self.inland(p));
        if inland < 0.0 {
            return (0.10 * inland).max(-0.02) * self.side;
        }
        // A beach, then hills with a peak in the middle
        let hills = 0.5 + 0.5 * ridged((q * 4.0).extend(1.7), 6, self.seed ^ 0x51);
        let rise = smoothstep(0.015, 0.28, inland);
        (0.05 * inland + rise * (0.03 + 0.13 * rise * hills * hills)) * self.side
    }

    /// The ground at `p`; derivatives are differences over `step` (m).
    pub(super) fn ground(&self, p: Vec2, step: f32) -> Ground {
        let along = |axis: Vec2| (self.height(p + axis * step) - self.height(p - axis * step)) / (2.0 * step);
        Ground { height: self.height(p), gradient: Vec2::new(along(Vec2::X), along(Vec2::Y)) }
    }

    /// The point with fractions `s` and `t` of the square.
    pub(super) fn at(&self, s: f32, t: f32) -> Vec2 {
        (Vec2::new(s, t) - 0.5) * self.side
    }

    /// The height field with `cells` × `cells` squares of two triangles, and normals.
    ///
    /// Returns `Err` with a message if there are too many vertices.
    pub(super) fn mesh(&self, cells: u32) -> Result<TriangleMesh, String> {
        // Vertices, row by row
        let step = self.side / cells as f32;
        let vertex = |i: u32| {
            let (column, row) = (i % (cells + 1), i / (cells + 1));
            let p = self.at(column as f32 / cells as f32, row as f32 / cells as f32);
            let Ground { height, gradient } = self.ground(p, step);
            (p.extend(height), (-gradient).extend(1.0).normalize())
        };
        let (positions, normals) = (0..(cells + 1) * (cells + 1)).into_par_iter().map(vertex).unzip();

        let mut mesh = TriangleMesh::new(positions, grid(0, cells, cells).collect())?;
        mesh.normals = normals;
        Ok(mesh)
    }

    /// Albedo of the ground.
    pub(super) fn ground_color(&self, p: Vec2) -> Vec3 {
        let Ground { height, gradient } = self.ground(p, self.side / 1024.0);
        let beach = self.beach_height();
        let sand = WET_SAND.lerp(SAND, smoothstep(0.05 * beach, 0.3 * beach, height));
        let soil = SOIL.lerp(ROCK, smoothstep(0.9, 1.4, gradient.length()));
        sand.lerp(soil, smoothstep(0.9 * beach, 1.6 * beach, height))
    }

    /// Albedo of the water, which depends on the depth.
    pub(super) fn water_color(&self, p: Vec2) -> Vec3 {
        let depth = -self.inland(p);
        let shore = WET_SAND.lerp(SHALLOW, smoothstep(0.0, 0.006, depth));
        shore.lerp(DEEP, smoothstep(0.005, 0.10, depth).sqrt())
    }

    /// Height above which plants grow (m).
    pub(super) fn beach_height(&self) -> f32 {
        0.001 * self.side
    }
}

//! Meshes of stems, blades and pebbles.

use super::random::Stream;
use crate::procedural::gradient_noise::fractal;
use lumiris::geometry::TriangleMesh;
use lumiris_numbers::math::{Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// A mesh in the making. Texture coordinates are of blades only.
#[derive(Default)]
pub(super) struct MeshBuilder {
    positions: Vec<Vec3>,
    uvs: Vec<Vec2>,
    triangles: Vec<[u32; 3]>,
}

/// A leaf: a strip that is folded along its middle and bent down.
pub(super) struct Blade {
    /// The root.
    pub(super) root: Vec3,
    /// Horizontal direction, and elevation at the root (radians).
    pub(super) azimuth: f32,
    pub(super) elevation: f32,
    /// Length and width (m).
    pub(super) length: f32,
    pub(super) width: f32,
    /// Decrease of the elevation towards the tip (radians).
    pub(super) droop: f32,
    /// Number of segments along it.
    pub(super) segments: u32,
}

/// A tapered tube along a parabola.
pub(super) struct Tube {
    /// Its ends, and the point that its start heads for.
    pub(super) ends: [Vec3; 2],
    pub(super) control: Vec3,
    /// Radii at its ends (m).
    pub(super) radii: [f32; 2],
    /// Number of sides, and of segments along it.
    pub(super) sides: u32,
    pub(super) segments: u32,
}

/// Two triangles of each cell between rows of `columns` + 1 vertices, the first of which is `first`.
pub(super) fn grid(first: u32, columns: u32, rows: u32) -> impl Iterator<Item = [u32; 3]> {
    (0..columns * rows).flat_map(move |i| {
        let a = first + i / columns * (columns + 1) + i % columns;
        let b = a + columns + 1;
        [[a, a + 1, b + 1], [a, b + 1, b]]
    })
}

impl MeshBuilder {
    /// Adds a leaf, with texture coordinates across and along it.
    pub(super) fn add_blade(&mut self, blade: &Blade) {
        // Directions at the root
        let first = self.positions.len() as u32;
        let outwards = Vec3::new(blade.azimuth.cos(), blade.azimuth.sin(), 0.0);
        let across = Vec3::new(-outwards.y, outwards.x, 0.0);
        let step = blade.length / blade.segments as f32;
        let mut middle = blade.root;

        // Three vertices at each step along the middle
        for i in 0..=blade.segments {
            // The middle is lower than the edges
            let t = i as f32 / blade.segments as f32;
            let (sin, cos) = (blade.elevation - blade.droop * t).sin_cos();
            let up = Vec3::Z * cos - outwards * sin;
            for (side, u) in [-0.5, 0.0, 0.5].into_iter().zip([0.0, 0.5, 1.0]) {
                self.positions.push(middle + (across * side + up * (0.3 * f32::abs(side))) * blade.width);
                self.uvs.push(Vec2::new(u, t));
            }
            middle += (outwards * cos + Vec3::Z * sin) * step;
        }
        self.triangles.extend(grid(first, 2, blade.segments));
    }

    /// Adds a tube without ends.
    pub(super) fn add_tube(&mut self, tube: &Tube) {
        let first = self.positions.len() as u32;
        let [start, end] = tube.ends;
        let axis = (end - start).normalize_or(Vec3::Z);
        let (x, y) = axis.any_orthonormal_pair();
        for i in 0..=tube.segments {
            let t = i as f32 / tube.segments as f32;
            let center = start.lerp(tube.control, t).lerp(tube.control.lerp(end, t), t);
            let radius = tube.radii[0] + (tube.radii[1] - tube.radii[0]) * t;
            self.positions.extend((0..=tube.sides).map(|side| {
                let (sin, cos) = (TAU * (side % tube.sides) as f32 / tube.sides as f32).sin_cos();
                center + (x * cos + y * sin) * radius
            }));
        }
        self.triangles.extend(grid(first, tube.sides, tube.segments));
    }

    /// The mesh. `Err` with a message if it is too large.
    pub(super) fn build(self) -> Result<TriangleMesh, String> {
        let mut mesh = TriangleMesh::new(self.positions, self.triangles)?;
        mesh.uvs = self.uvs;
        Ok(mesh)
    }
}

/// A pebble of radius 1, flattened, with some noise.
pub(super) fn pebble(seed: u32) -> Result<TriangleMesh, String> {
    const SIDES: u32 = 16;
    const RINGS: u32 = 8;
    // An ellipsoid with noise
    let mut stream = Stream::new([seed, 0, 0]);
    let axes = Vec3::new(1.0, stream.within(0.65, 0.95), stream.within(0.4, 0.65));
    let mut mesh = MeshBuilder::default();
    for i in 0..(SIDES + 1) * (RINGS + 1) {
        let (ring, side) = (i / (SIDES + 1), i % (SIDES + 1) % SIDES);
        let (sin, cos) = (PI * ring as f32 / RINGS as f32).sin_cos();
        let (y, x) = (TAU * side as f32 / SIDES as f32).sin_cos();
        let direction = Vec3::new(x * sin, y * sin, -cos);
        mesh.positions.push(direction * axes * (1.0 + 0.35 * fractal(direction * 1.3, 2, seed)));
    }
    mesh.triangles.extend(grid(0, SIDES, RINGS));

    // Normals of the ellipsoid
    let mut mesh = mesh.build()?;
    mesh.normals = mesh.positions().iter().map(|p| (*p / (axes * axes)).normalize_or(Vec3::Z)).collect();
    Ok(mesh)
}

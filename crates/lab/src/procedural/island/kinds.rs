//! The 20 kinds of plants.

use super::leaves::Leaf;
use super::meshes::{Blade, MeshBuilder, Tube};
use super::random::Stream;
use lumiris::geometry::TriangleMesh;
use lumiris_numbers::math::Vec3;

/// The angle between leaves or branches that follow each other (radians): π (3 − √5).
const GOLDEN_ANGLE: f32 = 2.399_963_2;

/// The parameters of a plant. Lengths are in metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kind {
    pub(super) name: &'static str,
    /// Height and radius of the stem; 0 if leaves start at the ground.
    stem: [f32; 2],
    /// Horizontal offset of the top of the stem, as a fraction of its height.
    lean: f32,
    /// Number of branches; without any, the top of the stem has all leaves.
    branches: u32,
    /// Horizontal and vertical radii of the ends of the branches.
    crown: [f32; 2],
    /// Number of leaves at the top, or at each end of a branch.
    blades: u32,
    /// Length and width of a leaf.
    size: [f32; 2],
    /// Elevations of the outermost and innermost leaf (degrees).
    elevations: [f32; 2],
    /// Bend of a leaf (degrees).
    droop: f32,
    /// Segments of a leaf.
    segments: u32,
    pub(super) leaf: Leaf,
    /// Linear Rec.709 albedo of the leaves; as much light passes through them, but yellower.
    pub(super) color: [f32; 3],
}

const PALM: Kind = Kind {
    name: "coconut",
    stem: [9.0, 0.17],
    lean: 0.28,
    branches: 0,
    crown: [0.0, 0.0],
    blades: 26,
    size: [4.2, 1.3],
    elevations: [-25.0, 80.0],
    droop: 85.0,
    segments: 10,
    leaf: Leaf::Frond,
    color: [0.10, 0.17, 0.025],
};
const TREE: Kind = Kind {
    name: "almond",
    stem: [5.0, 0.22],
    lean: 0.1,
    branches: 48,
    crown: [3.2, 2.2],
    blades: 9,
    size: [1.1, 0.75],
    elevations: [-30.0, 60.0],
    droop: 30.0,
    segments: 1,
    leaf: Leaf::Twig,
    color: [0.055, 0.12, 0.02],
};
const SHRUB: Kind = Kind {
    name: "naupaka",
    stem: [0.3, 0.05],
    branches: 22,
    crown: [0.9, 0.8],
    size: [0.42, 0.26],
    color: [0.09, 0.18, 0.03],
    ..TREE
};
const FERN: Kind = Kind {
    name: "swordfern",
    stem: [0.0, 0.0],
    lean: 0.0,
    blades: 18,
    size: [0.9, 0.22],
    elevations: [20.0, 80.0],
    droop: 90.0,
    segments: 7,
    color: [0.08, 0.17, 0.02],
    ..PALM
};
const GRASS: Kind = Kind {
    name: "grass",
    blades: 60,
    size: [0.55, 0.022],
    elevations: [35.0, 88.0],
    droop: 70.0,
    segments: 5,
    leaf: Leaf::Blade,
    color: [0.13, 0.20, 0.035],
    ..FERN
};

/// All kinds.
pub(super) const KINDS: [Kind; 20] = [
    PALM,
    Kind { name: "youngpalm", stem: [3.2, 0.14], lean: 0.2, blades: 18, size: [3.2, 1.1], ..PALM },
    Kind { name: "royalpalm", stem: [13.0, 0.22], lean: 0.04, droop: 70.0, color: [0.07, 0.15, 0.025], ..PALM },
    Kind {
        name: "fanpalm",
        stem: [6.0, 0.16],
        lean: 0.08,
        blades: 34,
        size: [1.9, 1.5],
        droop: 45.0,
        segments: 5,
        leaf: Leaf::Fan,
        color: [0.10, 0.16, 0.05],
        ..PALM
    },
    Kind { name: "treefern", stem: [3.5, 0.12], lean: 0.1, size: [2.3, 0.75], droop: 75.0, ..PALM },
    Kind {
        name: "banana",
        stem: [2.4, 0.13],
        lean: 0.06,
        blades: 10,
        size: [2.6, 0.75],
        elevations: [15.0, 80.0],
        droop: 95.0,
        leaf: Leaf::Broad,
        color: [0.13, 0.24, 0.03],
        ..PALM
    },
    TREE,
    Kind { name: "breadfruit", stem: [8.0, 0.3], crown: [3.6, 3.6], leaf: Leaf::Broad, size: [0.9, 0.5], ..TREE },
    Kind {
        name: "acacia",
        stem: [7.0, 0.25],
        lean: 0.2,
        branches: 60,
        crown: [4.5, 1.0],
        color: [0.09, 0.14, 0.03],
        ..TREE
    },
    Kind { name: "fig", stem: [9.0, 0.45], branches: 80, crown: [5.0, 3.8], color: [0.04, 0.10, 0.02], ..TREE },
    SHRUB,
    Kind { name: "hibiscus", crown: [0.8, 1.1], size: [0.35, 0.3], color: [0.06, 0.14, 0.025], ..SHRUB },
    Kind { name: "bougainvillea", crown: [1.1, 0.8], color: [0.42, 0.03, 0.16], ..SHRUB },
    Kind { name: "croton", crown: [0.5, 0.7], leaf: Leaf::Broad, color: [0.32, 0.15, 0.02], ..SHRUB },
    FERN,
    Kind { name: "birdnestfern", leaf: Leaf::Broad, blades: 22, size: [0.8, 0.14], color: [0.14, 0.25, 0.03], ..FERN },
    Kind {
        name: "agave",
        leaf: Leaf::Blade,
        blades: 30,
        size: [0.8, 0.12],
        droop: 25.0,
        color: [0.12, 0.19, 0.10],
        ..FERN
    },
    GRASS,
    Kind { name: "reed", size: [1.3, 0.03], blades: 45, elevations: [55.0, 89.0], color: [0.20, 0.21, 0.06], ..GRASS },
    Kind { name: "dunegrass", size: [0.8, 0.018], blades: 50, color: [0.26, 0.26, 0.11], ..GRASS },
];

/// The two meshes of a plant.
pub(super) struct Plant {
    /// `None` without a stem.
    pub(super) wood: Option<TriangleMesh>,
    pub(super) leaves: TriangleMesh,
}

/// The start and the direction of the leaves of a crown.
struct Crown {
    point: Vec3,
    /// Azimuth of the first leaf.
    azimuth: f32,
}

impl Kind {
    /// True if the plant has a stem.
    pub(super) fn has_wood(&self) -> bool {
        self.stem[0] > 0.0
    }

    /// Makes the plant. `Err` with a message if a mesh is too large.
    pub(super) fn grow(&self, seed: u32) -> Result<Plant, String> {
        let mut stream = Stream::new([seed, 1, self.stem[0].to_bits()]);
        let mut wood = MeshBuilder::default();
        let crowns = self.add_wood(&mut wood, &mut stream);
        let mut leaves = MeshBuilder::default();
        crowns.iter().for_each(|crown| self.add_crown(crown, &mut leaves, &mut stream));
        let wood = if self.has_wood() { Some(wood.build()?) } else { None };
        Ok(Plant { wood, leaves: leaves.build()? })
    }

    /// Adds the stem and the branches; returns where leaves grow.
    fn add_wood(&self, wood: &mut MeshBuilder, stream: &mut Stream) -> Vec<Crown> {
        let [height, radius] = self.stem;
        let top = Vec3::new(self.lean * height, 0.0, height);
        if !self.has_wood() {
            return vec![Crown { point: top, azimuth: 0.0 }];
        }

        // The stem starts in the ground
        let (start, control) = (Vec3::new(0.0, 0.0, -0.5), Vec3::new(0.2 * top.x, 0.0, 0.5 * height));
        let radii = [radius, 0.65 * radius];
        wood.add_tube(&Tube { ends: [start, top], control, radii, sides: 10, segments: 12 });
        if self.branches == 0 {
            return vec![Crown { point: top, azimuth: 0.0 }];
        }

        // Branches to points in the upper part of an ellipsoid, evenly spaced by the golden angle
        let branch = |i: u32| {
            let azimuth = i as f32 * GOLDEN_ANGLE + stream.within(-0.3, 0.3);
            let z = 1.0 - 1.4 * (i as f32 + 0.5) / self.branches as f32;
            let r = (1.0 - z * z).sqrt();
            let direction = Vec3::new(azimuth.cos() * r, azimuth.sin() * r, z);
            let axes = Vec3::new(self.crown[0], self.crown[0], self.crown[1]) * stream.within(0.5, 1.05);
            let point = top + Vec3::Z * (0.5 * self.crown[1]) + direction * axes;
            let start = top * stream.within(0.7, 0.98);
            let control = start.lerp(point, 0.5) + Vec3::Z * (0.15 * self.crown[1]);
            let radii = [0.25 * radius, 0.05 * radius];
            wood.add_tube(&Tube { ends: [start, point], control, radii, sides: 4, segments: 3 });
            Crown { point, azimuth }
        };
        (0..self.branches).map(branch).collect()
    }

    /// Adds the leaves of a crown.
    fn add_crown(&self, crown: &Crown, leaves: &mut MeshBuilder, stream: &mut Stream) {
        for i in 0..self.blades {
            let age = (i as f32 + stream.within(0.0, 1.0)) / self.blades as f32;
            let size = stream.within(0.75, 1.15) * if self.branches == 0 { 1.0 - 0.3 * age } else { 1.0 };
            let [outer, inner] = self.elevations;
            leaves.add_blade(&Blade {
                root: crown.point,
                azimuth: crown.azimuth + i as f32 * GOLDEN_ANGLE + stream.within(-0.2, 0.2),
                elevation: (outer + (inner - outer) * age).to_radians(),
                length: self.size[0] * size,
                width: self.size[1] * size,
                droop: self.droop.to_radians() * stream.within(0.7, 1.2),
                segments: self.segments,
            });
        }
    }
}

//! Grids and the types of their values.

use std::fmt;

/// Voxels of a leaf along each axis.
pub const LEAF: i32 = 8;
/// Voxels of a leaf.
pub const LEAF_VOXELS: usize = 512;

/// A sparse grid of numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct NanoGrid {
    /// Its name in the file.
    pub name: String,
    /// The class of its values.
    pub class: GridClass,
    /// The storage type of its values.
    pub values: ValueType,
    /// The value of voxels that are in no leaf and no tile.
    pub background: f32,
    /// Tiles with other values than the background.
    pub tiles: Vec<Tile>,
    /// First voxel of each leaf, a multiple of 8.
    pub leaves: Vec<[i32; 3]>,
    /// The 512 values of each leaf, z fastest.
    pub leaf_values: Vec<f32>,
    /// First and last active voxel along each axis, if the file has them.
    pub index_bounds: Option<[[i32; 3]; 2]>,
    /// Bounding box of the active voxels in the space of the file, where a voxel extends from its index to the next; if
    /// the file has it.
    pub bounds: Option<[[f64; 3]; 2]>,
    /// Columns of the matrix from indices to the space of the file, and the translation. All are finite.
    pub space_from_index: [[f64; 3]; 4],
}

impl NanoGrid {
    /// The bounding box of the active voxels in the space of the file: as in the file, or by the leaves and tiles;
    /// `None` without any.
    pub fn space_bounds(&self) -> Option<[[f64; 3]; 2]> {
        if self.bounds.is_some() {
            return self.bounds;
        }
        let leaves = self.leaves.iter().map(|origin| (*origin, LEAF));
        let cubes = leaves.chain(self.tiles.iter().map(|tile| (tile.origin, tile.size)));
        let content = cubes.map(|(origin, size)| [origin, origin.map(|i| i.saturating_add(size - 1))]);
        let [low, high] = self.index_bounds.or_else(|| content.reduce(joined))?;
        let [x, y, z, translation] = self.space_from_index;
        let corner = |i: usize| {
            let index =
                |axis: usize| if i >> axis & 1 == 0 { f64::from(low[axis]) } else { f64::from(high[axis]) + 1.0 };
            let row = |r: usize| x[r] * index(0) + y[r] * index(1) + z[r] * index(2) + translation[r];
            [[row(0), row(1), row(2)]; 2]
        };
        (0..8).map(corner).reduce(joined)
    }

    /// Replaces every value for which `f` returns one; returns the number of replaced values.
    pub fn replace(&mut self, f: impl Fn(f32) -> Option<f32>) -> usize {
        let tiles = self.tiles.iter_mut().map(|tile| &mut tile.value);
        let all = self.leaf_values.iter_mut().chain(tiles).chain([&mut self.background]);
        let mut count = 0;
        for value in all {
            if let Some(better) = f(*value) {
                *value = better;
                count += 1;
            }
        }
        count
    }
}

/// The bounding box of two boxes.
fn joined<T: Copy + PartialOrd>([a, b]: [[T; 3]; 2], [c, d]: [[T; 3]; 2]) -> [[T; 3]; 2] {
    let least = |x: T, y: T| if y < x { y } else { x };
    let greatest = |x: T, y: T| if y > x { y } else { x };
    [[0, 1, 2].map(|i| least(a[i], c[i])), [0, 1, 2].map(|i| greatest(b[i], d[i]))]
}

/// The size of a grid, as in its header.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NanoSize {
    /// Bytes as stored, decompressed.
    pub bytes: u64,
    /// Number of leaves.
    pub leaves: u64,
    /// Numbers of nodes of 16³ and of 32³ entries.
    pub nodes: [u64; 2],
}

/// A cube of voxels of one value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tile {
    /// Its first voxel, a multiple of its size.
    pub origin: [i32; 3],
    /// Voxels along each axis: 8, 128 or 4096.
    pub size: i32,
    /// Their value.
    pub value: f32,
}

/// Storage type of values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValueType {
    /// 32 bits.
    Float,
    /// 64 bits.
    Double,
    /// Quantised between two values of a leaf, with 4, 8 or 16 bits.
    Fixed(u8),
    /// Quantised with 1 to 16 bits, as specified per leaf.
    FixedByLeaf,
}

/// Names of the types of the format, in their order.
pub(super) const TYPES: [&str; 27] = [
    "unknown",
    "float",
    "double",
    "int16",
    "int32",
    "int64",
    "vec3f",
    "vec3d",
    "mask",
    "half",
    "uint32",
    "bool",
    "rgba8",
    "fp4",
    "fp8",
    "fp16",
    "fpn",
    "vec4f",
    "vec4d",
    "index",
    "onindex",
    "indexmask",
    "onindexmask",
    "pointindex",
    "vec3u8",
    "vec3u16",
    "uint8",
];

impl ValueType {
    pub(super) fn from_code(code: u32) -> Option<Self> {
        Some(match *TYPES.get(code as usize)? {
            "float" => ValueType::Float,
            "double" => ValueType::Double,
            "fp4" => ValueType::Fixed(4),
            "fp8" => ValueType::Fixed(8),
            "fp16" => ValueType::Fixed(16),
            "fpn" => ValueType::FixedByLeaf,
            _ => return None,
        })
    }
}

/// The class of a grid's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GridClass(pub u32);

impl GridClass {
    /// Unspecified.
    pub const UNKNOWN: GridClass = GridClass(0);
    /// A density, or another volumetric quantity.
    pub const FOG_VOLUME: GridClass = GridClass(2);
}

impl fmt::Display for GridClass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = [
            "a grid of unknown class",
            "a level set",
            "a fog volume",
            "a staggered grid",
            "an index of points",
            "a set of points",
            "a topology",
            "a volume of voxels",
            "an index",
            "an index of tensors",
        ];
        f.write_str(names.get(self.0 as usize).unwrap_or(&names[0]))
    }
}

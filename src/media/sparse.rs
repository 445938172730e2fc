//! A sparse grid of values at integer indices, in the tree of [Museth 2013]: sorted blocks of 4096³ voxels, nodes of
//! 32³ and of 16³ entries, and leaves of 8³ voxels. An entry is a child, or the common value of all of its voxels.
//! Values are interpolated linearly between indices. Leaves take most of the memory.

use lumiris_numbers::math::{Affine3A, DAffine3, DVec3, Vec3};
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// Voxels of a leaf.
const LEAF: usize = 512;
/// log₂ of the number of voxels along an axis: of blocks, of both kinds of nodes' entries, and of voxels.
const LOG2: [u32; 4] = [12, 7, 3, 0];

/// A child, or a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Entry(u32);

impl Entry {
    const CHILD: u32 = 1 << 31;

    /// The entry of a child on the level below.
    fn child(index: usize) -> Self {
        Entry(Self::CHILD | index as u32)
    }

    /// Index of the child, or of the constant.
    #[inline]
    fn index(self) -> Result<usize, usize> {
        let index = (self.0 & !Self::CHILD) as usize;
        if self.0 & Self::CHILD != 0 { Ok(index) } else { Err(index) }
    }
}

/// A cube of voxels of one value.
#[derive(Clone, Copy, Debug)]
pub struct Cube {
    /// Its first voxel.
    pub origin: [i32; 3],
    /// Voxels along each axis: 8, 128 or 4096.
    pub size: i32,
    /// The value.
    pub value: f32,
}

/// A tree of values.
#[derive(Debug)]
pub struct SparseGrid {
    /// Values of constant entries; the first is the background.
    constants: Vec<f32>,
    /// Sorted keys of the blocks: their indices in units of 4096.
    keys: Vec<[i32; 3]>,
    blocks: Vec<Entry>,
    /// Entries of nodes of 32³, and of 16³; z fastest.
    nodes: [Vec<Entry>; 2],
    /// Values of leaves, z fastest.
    leaves: Vec<f32>,
    /// The maximum value of each leaf.
    greatest: Vec<f32>,
}

/// Index of a voxel among the entries of a node on a level, or among the voxels of a leaf.
#[inline]
fn offset(p: [i32; 3], level: usize) -> usize {
    let (bits, shift) = (LOG2[level] - LOG2[level + 1], LOG2[level + 1]);
    let along = |axis: usize| (p[axis] as u32 >> shift & ((1 << bits) - 1)) as usize;
    (along(0) << (2 * bits)) | (along(1) << bits) | along(2)
}

/// Trilinear interpolation at `t` between eight samples, whose indices have one bit per axis, x highest.
#[inline]
fn between(t: Vec3, sample: impl Fn(usize) -> f32) -> f32 {
    let lerp = |t: f32, a: f32, b: f32| a * (1.0 - t) + b * t;
    let row = |i: usize| lerp(t.x, sample(i), sample(i | 4));
    let plane = |i: usize| lerp(t.y, row(i), row(i | 2));
    lerp(t.z, plane(0), plane(1))
}

/// A tree under construction.
struct Growth {
    grid: SparseGrid,
    blocks: BTreeMap<[i32; 3], Entry>,
    /// Indices of constants, by their bits.
    constants: HashMap<u32, u32>,
}

impl Growth {
    fn constant(&mut self, value: f32) -> Entry {
        let constants = &mut self.grid.constants;
        Entry(*self.constants.entry(value.to_bits()).or_insert_with(|| {
            constants.push(value);
            (constants.len() - 1) as u32
        }))
    }

    /// Sets the entry at a position: a leaf, or a value for all voxels of an entry of the level.
    fn put(&mut self, p: [i32; 3], level: usize, entry: Entry) {
        let block = self.blocks.entry(p.map(|i| i >> LOG2[0])).or_insert(Entry(0));
        if level == 0 {
            *block = entry;
            return;
        }
        let first = divided(block, &mut self.grid.nodes[0], 1 << 15);
        let place = &mut self.grid.nodes[0][first + offset(p, 0)];
        if level == 1 {
            *place = entry;
            return;
        }
        let mut below = *place;
        let second = divided(&mut below, &mut self.grid.nodes[1], 1 << 12);
        self.grid.nodes[0][first + offset(p, 0)] = below;
        self.grid.nodes[1][second + offset(p, 1)] = entry;
    }
}

/// Index of the first entry of the child node of `entry`. If the entry is a value, it is replaced by a node of this
/// value.
fn divided(entry: &mut Entry, nodes: &mut Vec<Entry>, size: usize) -> usize {
    let index = entry.index().unwrap_or_else(|_| {
        let index = nodes.len() / size;
        nodes.resize(nodes.len() + size, *entry);
        *entry = Entry::child(index);
        index
    });
    index * size
}

impl SparseGrid {
    /// A tree of cubes and of leaves. `origins` are the first voxels of the leaves, with 512 values each, z fastest.
    /// All other voxels have the value `background`.
    pub fn new(background: f32, cubes: &[Cube], origins: &[[i32; 3]], mut values: Vec<f32>) -> Self {
        let nodes = [Vec::new(), Vec::new()];
        let (keys, blocks, constants, greatest) = (Vec::new(), Vec::new(), vec![background], Vec::new());
        let grid = SparseGrid { constants, keys, blocks, nodes, leaves: Vec::new(), greatest };
        let constants = HashMap::from([(background.to_bits(), 0)]);
        let mut growth = Growth { grid, blocks: BTreeMap::new(), constants };
        for cube in cubes {
            let entry = growth.constant(cube.value);
            let level = match cube.size {
                8 => 2,
                128 => 1,
                _ => 0,
            };
            growth.put(cube.origin, level, entry);
        }
        // Leaves of one value become constants
        let mut kept = 0;
        for (i, &origin) in origins.iter().enumerate() {
            let Some(leaf) = values.get(i * LEAF..(i + 1) * LEAF) else { break };
            let entry = if leaf.iter().all(|v| v.to_bits() == leaf[0].to_bits()) {
                growth.constant(leaf[0])
            } else {
                growth.grid.greatest.push(leaf.iter().copied().fold(f32::NEG_INFINITY, f32::max));
                values.copy_within(i * LEAF..(i + 1) * LEAF, kept * LEAF);
                kept += 1;
                Entry::child(kept - 1)
            };
            growth.put(origin, 2, entry);
        }
        values.truncate(kept * LEAF);
        values.shrink_to_fit();
        let Growth { mut grid, blocks, .. } = growth;
        (grid.keys, grid.blocks) = blocks.into_iter().unzip();
        grid.leaves = values;
        grid
    }

    /// Bytes of the tree.
    pub fn bytes(&self) -> usize {
        let nodes = self.nodes.iter().map(|nodes| size_of_val(&nodes[..])).sum::<usize>();
        let values = size_of_val(&self.leaves[..]) + size_of_val(&self.greatest[..]);
        nodes + values + size_of_val(&self.constants[..]) + self.keys.len() * (size_of::<[i32; 3]>() + 4)
    }

    /// The minimum and maximum value.
    pub fn extremes(&self) -> [f32; 2] {
        let all = self.leaves.iter().chain(&self.constants);
        all.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], &v| [low.min(v), high.max(v)])
    }

    /// The values of the leaf that contains a voxel, or the constant value of its entry.
    #[inline]
    fn leaf(&self, p: [i32; 3]) -> Result<&[f32], f32> {
        let Ok(block) = self.keys.binary_search(&p.map(|i| i >> LOG2[0])) else { return Err(self.constants[0]) };
        let mut entry = self.blocks[block];
        for level in 0..2 {
            let first = entry.index().map_err(|constant| self.constants[constant])? << (15 - 3 * level);
            entry = self.nodes[level][first + offset(p, level)];
        }
        let leaf = entry.index().map_err(|constant| self.constants[constant])?;
        Ok(&self.leaves[leaf * LEAF..(leaf + 1) * LEAF])
    }

    /// The value of a voxel.
    #[inline]
    pub fn value(&self, p: [i32; 3]) -> f32 {
        self.leaf(p).map_or_else(|constant| constant, |leaf| leaf[offset(p, 2)])
    }

    /// Trilinear interpolation between the voxel `p` and its next neighbours, at `t` in 0..1 along each axis.
    pub fn interpolated(&self, p: [i32; 3], t: Vec3) -> f32 {
        // Most cubes of eight voxels are in one leaf
        if p.iter().all(|i| i & 7 < 7) {
            return match self.leaf(p) {
                Ok(leaf) => {
                    let first = offset(p, 2);
                    between(t, |i| leaf[first + (i >> 2) * 64 + (i >> 1 & 1) * 8 + (i & 1)])
                }
                Err(constant) => constant,
            };
        }
        between(t, |i| self.value([0, 1, 2].map(|axis| p[axis].wrapping_add((i >> (2 - axis) & 1) as i32))))
    }

    /// The maximum value of the voxels from `low` to `high`, both included; at least zero.
    pub fn greatest(&self, low: [i32; 3], high: [i32; 3]) -> f32 {
        let [first, last] = [low, high].map(|p| p.map(|i| i >> LOG2[0]));
        let count = (0..3).map(|a| (i64::from(last[a]) - i64::from(first[a]) + 1) as u64).fold(1, u64::saturating_mul);
        let (mut greatest, mut found) = (0.0_f32, 0_u64);
        let from = self.keys.partition_point(|key| key[0] < first[0]);
        let near = self.keys[from..].iter().zip(&self.blocks[from..]).take_while(|(key, _)| key[0] <= last[0]);
        for (key, &entry) in near.filter(|(key, _)| (0..3).all(|a| (first[a]..=last[a]).contains(&key[a]))) {
            found += 1;
            self.add_greatest(entry, 0, key.map(|i| i << LOG2[0]), [low, high], &mut greatest);
        }
        if found < count { greatest.max(self.constants[0]) } else { greatest }
    }

    fn add_greatest(&self, entry: Entry, level: usize, origin: [i32; 3], range: [[i32; 3]; 2], greatest: &mut f32) {
        let index = match entry.index() {
            Ok(index) => index,
            Err(constant) => return *greatest = greatest.max(self.constants[constant]),
        };
        if level == 2 && self.greatest[index] <= *greatest {
            return;
        }
        // The entries of this node that overlap the range
        let (below, size) = (LOG2[level + 1], (1_i32 << LOG2[level]) - 1);
        let along = |axis: usize| {
            let first = range[0][axis].max(origin[axis]) - origin[axis];
            let last = range[1][axis].min(origin[axis] + size) - origin[axis];
            first >> below..=last >> below
        };
        for x in along(0) {
            for y in along(1) {
                for z in along(2) {
                    let p = [origin[0] + (x << below), origin[1] + (y << below), origin[2] + (z << below)];
                    let n = offset(p, level);
                    if level == 2 {
                        *greatest = greatest.max(self.leaves[index * LEAF + n]);
                    } else {
                        let child = self.nodes[level][(index << (15 - 3 * level)) + n];
                        self.add_greatest(child, level + 1, p, range, greatest);
                    }
                }
            }
        }
    }
}

/// A tree within a box that is mapped to the unit cube.
#[derive(Clone, Debug)]
pub struct SparseSamples {
    grid: Arc<SparseGrid>,
    /// Maps to indices minus `origin`, which keeps them small.
    index_from_unit: Affine3A,
    origin: [i32; 3],
}

impl SparseSamples {
    /// A tree within a box given by two corners; the map takes indices to the space of the box. `None` if the map has
    /// no inverse.
    pub fn new(grid: Arc<SparseGrid>, space_from_index: &DAffine3, &[min, max]: &[DVec3; 2]) -> Option<Self> {
        let space_from_unit = DAffine3::from_translation(min) * DAffine3::from_scale(max - min);
        let mut index_from_unit = space_from_index.inverse() * space_from_unit;
        let origin = index_from_unit.translation.floor().to_array().map(|i| i as i32);
        index_from_unit.translation -= DVec3::from_array(origin.map(f64::from));
        let single = |v: DVec3| Vec3::from_array(v.to_array().map(|x| x as f32));
        let index_from_unit = Affine3A::from_cols(
            single(index_from_unit.matrix3.x_axis).into(),
            single(index_from_unit.matrix3.y_axis).into(),
            single(index_from_unit.matrix3.z_axis).into(),
            single(index_from_unit.translation).into(),
        );
        index_from_unit.is_finite().then_some(SparseSamples { grid, index_from_unit, origin })
    }

    /// Number of voxels along each axis of the box.
    pub fn resolution(&self) -> [usize; 3] {
        let m = self.index_from_unit.matrix3;
        [m.x_axis, m.y_axis, m.z_axis].map(|axis| (axis.length().ceil() as usize).max(1))
    }

    /// Bytes of the tree.
    pub fn bytes(&self) -> usize {
        self.grid.bytes()
    }

    /// The minimum and maximum value.
    pub fn extremes(&self) -> [f32; 2] {
        self.grid.extremes()
    }

    /// The voxel at `place`, whose coordinates are relative to `origin`.
    #[inline]
    fn voxel(&self, place: Vec3) -> [i32; 3] {
        [0, 1, 2].map(|axis| self.origin[axis].wrapping_add(place[axis] as i32))
    }

    /// The value at a point of the unit cube.
    pub fn at(&self, p: Vec3) -> f32 {
        let place = self.index_from_unit.transform_point3(p);
        let base = place.floor();
        self.grid.interpolated(self.voxel(base), place - base)
    }

    /// The maximum of the voxels that contribute to values in a box of the unit cube; at least zero.
    pub fn bound(&self, low: Vec3, high: Vec3) -> f32 {
        let corners = (0..8).map(|i| {
            let corner = [0, 1, 2].map(|axis| if i >> axis & 1 == 0 { low[axis] } else { high[axis] });
            self.index_from_unit.transform_point3(Vec3::from_array(corner))
        });
        let (first, last) = corners
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(first, last), corner| (first.min(corner), last.max(corner)));
        // Include voxels that rounding may add for points on the wall
        let slop = 1e-4 + 1e-6 * first.abs().max(last.abs()).max_element();
        let (first, last) = ((first - slop).floor(), (last + slop).floor());
        let high = self.voxel(last).map(|i| i.saturating_add(1));
        self.grid.greatest(self.voxel(first), high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::random::{RngExt, pcg32};

    /// A tree, and a function with the same values.
    fn tree() -> (SparseGrid, impl Fn([i32; 3]) -> f32) {
        let origins = [[-8, 0, 8], [0, 0, 8], [-4104, 4096, 0], [40, -8, -8], [128, 0, 0]];
        let known = move |p: [i32; 3]| {
            let leaf = p.map(|i| i & !7);
            if leaf == [40, -8, -8] {
                return 0.25;
            }
            if origins.contains(&leaf) {
                return ((p[0] * 31 + p[1] * 17 + p[2] * 7) as f32).sin().abs();
            }
            let block = |size: i32| p.map(|i| i & -size);
            match (block(8), block(128), block(4096)) {
                ([16, 8, 8], ..) => 0.75,
                (_, [0, 128, 0], _) => 0.5,
                (.., [8192, -4096, 0]) => 2.0,
                _ => 0.125,
            }
        };
        let voxel = |o: [i32; 3], i: usize| [o[0] + (i >> 6) as i32, o[1] + (i >> 3 & 7) as i32, o[2] + (i & 7) as i32];
        let values = origins.iter().flat_map(|&o| (0..512).map(move |i| known(voxel(o, i)))).collect();
        let cubes = [([16, 8, 8], 8, 0.75), ([0, 128, 0], 128, 0.5), ([8192, -4096, 0], 4096, 2.0)];
        let cubes = cubes.map(|(origin, size, value)| Cube { origin, size, value });
        (SparseGrid::new(0.125, &cubes, &origins, values), known)
    }

    #[test]
    fn voxels_have_the_values_of_leaves_cubes_or_the_background() {
        let (tree, known) = tree();
        for x in -12..45 {
            for y in -12..20 {
                for z in -12..20 {
                    assert_eq!(tree.value([x, y, z]), known([x, y, z]), "{x} {y} {z}");
                }
            }
        }
        for p in [[-4100, 4100, 3], [127, 255, 127], [0, 256, 0], [8192, -1, 4095], [12_288, -1, 0], [i32::MAX; 3]] {
            assert_eq!(tree.value(p), known(p), "{p:?}");
        }
        // Four leaves keep voxels, and four blocks have nodes
        assert_eq!(tree.leaves.len(), 4 * 512);
        assert_eq!(tree.extremes()[1], 2.0);
        assert!(tree.bytes() < 4 * 2048 + 4 * (4 << 15) + 4 * (5 << 12) + 1000, "{}", tree.bytes());
    }

    #[test]
    fn values_are_interpolated_and_bounded_in_any_placement() {
        let (tree, known) = tree();
        let tree = Arc::new(tree);
        let mut stream = pcg32([5, 8, 2]);
        let space_from_index = DAffine3::from_translation(DVec3::new(3.0, -1.0, 2.0))
            * DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7)
            * DAffine3::from_scale(DVec3::new(0.1, -0.2, 0.3));
        let corners = [[-15.0, -14.0, -2.0], [50.0, 20.0, 25.0]].map(|p| space_from_index.transform_point3(p.into()));
        let [a, b] = corners;
        let [min, max] = [a.min(b), a.max(b)];
        let samples = SparseSamples::new(Arc::clone(&tree), &space_from_index, &[min, max]).unwrap();
        let index_from_space = space_from_index.inverse();
        let mut random = || Vec3::from(std::array::from_fn::<f32, 3, _>(|_| stream.random::<f32>()));
        for _ in 0..20_000 {
            // At a point
            let p = random();
            let place = index_from_space.transform_point3(min + (max - min) * p.as_dvec3());
            let base = place.floor();
            let expected: f64 = (0..8)
                .map(|i| {
                    let step = [0, 1, 2].map(|axis| f64::from(i >> axis & 1));
                    let weight = |a: usize| 1.0 - (place[a] - base[a] - step[a]).abs();
                    let voxel = [0, 1, 2].map(|a| (base[a] + step[a]) as i32);
                    weight(0) * weight(1) * weight(2) * f64::from(known(voxel))
                })
                .sum();
            let found = samples.at(p);
            assert!((f64::from(found) - expected).abs() < 1e-4, "{place}: {found}, not {expected}");

            // In a box around it
            let low = (p - 0.1 * random()).max(Vec3::ZERO);
            let high = (p + 0.1 * random()).min(Vec3::ONE);
            assert!(found <= samples.bound(low, high) + 1e-6);
        }
        // The bound is tight
        let greatest = |low: [i32; 3], high: [i32; 3]| {
            let mut greatest = 0.0_f32;
            for x in low[0]..=high[0] {
                for y in low[1]..=high[1] {
                    greatest = (low[2]..=high[2]).fold(greatest, |max, z| max.max(known([x, y, z])));
                }
            }
            greatest
        };
        for _ in 0..300 {
            let low = [0, 1, 2].map(|a| (random()[a] * 60.0) as i32 - 20);
            let high = low.map(|i| i + (random().x * 20.0) as i32);
            assert_eq!(tree.greatest(low, high), greatest(low, high), "{low:?} {high:?}");
        }
        assert_eq!(tree.greatest([i32::MIN; 3], [i32::MAX; 3]), 2.0);
        assert!(SparseSamples::new(tree, &DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0)), &[min, max]).is_none());
    }
}

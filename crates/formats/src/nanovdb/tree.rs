//! Converts the bytes of a grid to leaves and tiles.
//!
//! | | bytes |
//! |---|---|
//! | grid | magic number 0..8, version 16, size 32, name 40, matrix 384 (64 bits each), translation 528, box 560, class 632, type 636 |
//! | tree, at 672 | offsets from here: leaves 0, nodes of 16³ 8, of 32³ 16, root 24 |
//! | root | active voxels: first 0, last 12; number of entries 24, background; then entries of 32 bytes |
//! | entry of it | key 0, child 8 (from the root; 0 for a tile), value |
//! | node | masks of n³ bits: active 32, children behind it; statistics; then n³ entries of 8 bytes: child (from the node) or value |
//! | leaf | bit width 15 (highest three bits), then values; or least value 80, step 84, and numbers of steps 96 |
//!
//! A key has 21 bits for each axis, z lowest: the index in units of 4096. In nodes and leaves, z is fastest.

use super::bytes::Bytes;
use super::error::NanoError;
use super::file::GRID;
use super::grid::{GridClass, LEAF, LEAF_VOXELS, NanoGrid, Tile, ValueType};

/// Size of a root entry.
const ROOT_ENTRY: u64 = 32;
/// Offset of the masks of a node.
const MASKS: u64 = 32;
/// Offset of the values of a leaf, for types of up to 32 bits.
const LEAF_VALUES: u64 = 96;
/// Bits of a key per axis, and bits of an index below it.
const KEY_BITS: u32 = 21;
const BLOCK_BITS: u32 = 12;

/// A level of inner nodes.
struct Level {
    /// log₂ of the number of entries along an axis.
    log2: u32,
    /// log₂ of the number of voxels of an entry along an axis.
    child_log2: u32,
    /// Offset of the entries.
    table: u64,
}

/// Nodes of 32³ entries, and of 16³.
const LEVELS: [Level; 2] =
    [Level { log2: 5, child_log2: 7, table: 8256 }, Level { log2: 4, child_log2: 3, table: 1088 }];

impl Level {
    fn entries(&self) -> usize {
        1 << (3 * self.log2)
    }

    fn size(&self) -> u64 {
        self.table + 8 * self.entries() as u64
    }
}

/// Parses the bytes of a grid.
pub(super) fn grid(name: String, bytes: &[u8]) -> Result<NanoGrid, NanoError> {
    let head = Bytes(bytes);
    if !head.slice(0, 7)?.starts_with(b"NanoVDB") {
        return Err(NanoError::damaged(format!("its grid `{name}` does not begin with `NanoVDB`")));
    }
    let values = ValueType::from_code(head.u32(636)?)
        .ok_or_else(|| NanoError::damaged(format!("its grid `{name}` has another type than its list says")))?;
    let rows = [head.triple(384)?, head.triple(408)?, head.triple(432)?];
    let column = |i: usize| [rows[0][i], rows[1][i], rows[2][i]];
    let space_from_index = [column(0), column(1), column(2), head.triple(528)?];
    if !space_from_index.as_flattened().iter().all(|x| x.is_finite()) {
        return Err(NanoError::damaged(format!("the map of its grid `{name}` is not finite")));
    }
    let tree = GRID as u64;
    let root = tree.checked_add(head.u64(tree + 24)?).ok_or_else(|| NanoError::damaged("the place of a root"))?;
    let wide = u64::from(values == ValueType::Double);
    let background_at = root.saturating_add(28 + 4 * wide);
    let mut walk = Walk {
        bytes: head,
        visits: [LEVELS[0].size(), LEVELS[1].size(), smallest_leaf(values)].map(|size| bytes.len() as u64 / size),
        grid: NanoGrid {
            name,
            class: GridClass(head.u32(632)?),
            values,
            background: value(head, values, background_at)?,
            tiles: Vec::new(),
            leaves: Vec::new(),
            leaf_values: Vec::new(),
            index_bounds: ordered([head.index(root)?, head.index(root + 12)?], |a, b| a <= b),
            bounds: ordered([head.triple(560)?, head.triple(584)?], |a, b| a < b && (b - a).is_finite()),
            space_from_index,
        },
    };
    walk.root(root, root + 64 + 32 * wide)?;
    Ok(walk.grid)
}

/// Two corners; `None` unless the first is below the second along each axis.
fn ordered<T: Copy>(corners: [[T; 3]; 2], is_below: impl Fn(T, T) -> bool) -> Option<[[T; 3]; 2]> {
    (0..3).all(|axis| is_below(corners[0][axis], corners[1][axis])).then_some(corners)
}

/// A value outside of leaves.
fn value(bytes: Bytes<'_>, values: ValueType, at: u64) -> Result<f32, NanoError> {
    if values == ValueType::Double { bytes.f64(at).map(|v| v as f32) } else { bytes.f32(at) }
}

/// Minimum size of a leaf (bytes).
fn smallest_leaf(values: ValueType) -> u64 {
    let voxels = LEAF_VOXELS as u64;
    match values {
        ValueType::Float => LEAF_VALUES + 4 * voxels,
        ValueType::Double => LEAF_VALUES + 32 + 8 * voxels,
        ValueType::Fixed(bits) => LEAF_VALUES + voxels * u64::from(bits) / 8,
        ValueType::FixedByLeaf => LEAF_VALUES + voxels / 8,
    }
}

/// State of the traversal.
struct Walk<'a> {
    bytes: Bytes<'a>,
    /// Remaining number of nodes per level that fit into the grid; it is only exhausted if nodes overlap.
    visits: [u64; 3],
    grid: NanoGrid,
}

impl Walk<'_> {
    fn visit(&mut self, depth: usize) -> Result<(), NanoError> {
        let left = self.visits[depth].checked_sub(1);
        self.visits[depth] = left.ok_or_else(|| NanoError::damaged("two of its nodes have the same place"))?;
        Ok(())
    }

    fn root(&mut self, root: u64, table: u64) -> Result<(), NanoError> {
        for i in 0..u64::from(self.bytes.u32(root + 24)?) {
            let entry = table + ROOT_ENTRY * i;
            let key = self.bytes.u64(entry)?;
            let part = |axis: u32| ((key >> (KEY_BITS * (2 - axis))) as u32) << BLOCK_BITS;
            let origin = [0, 1, 2].map(|axis| part(axis) as i32);
            match self.bytes.i64(entry + 8)? {
                0 => {
                    let wide = u64::from(self.grid.values == ValueType::Double);
                    self.tile(entry + 20 + 4 * wide, origin, 1 << BLOCK_BITS)?;
                }
                child => self.node(place(root, child)?, origin, 0)?,
            }
        }
        Ok(())
    }

    fn tile(&mut self, at: u64, origin: [i32; 3], size: i32) -> Result<(), NanoError> {
        let value = value(self.bytes, self.grid.values, at)?;
        if value.to_bits() != self.grid.background.to_bits() {
            self.grid.tiles.push(Tile { origin, size, value });
        }
        Ok(())
    }

    /// A node of the first or the second level below the root.
    fn node(&mut self, at: u64, origin: [i32; 3], depth: usize) -> Result<(), NanoError> {
        self.visit(depth)?;
        let Level { log2, child_log2, table } = LEVELS[depth];
        let entries = LEVELS[depth].entries();
        self.bytes.slice(at, LEVELS[depth].size() as usize)?;
        let children = self.bytes.slice(at + MASKS + entries as u64 / 8, entries / 8)?;
        for n in 0..entries {
            let along = |shift: u32| ((n >> shift & ((1 << log2) - 1)) << child_log2) as i32;
            let first = [origin[0] + along(2 * log2), origin[1] + along(log2), origin[2] + along(0)];
            let entry = at + table + 8 * n as u64;
            if children[n / 8] >> (n % 8) & 1 == 0 {
                self.tile(entry, first, 1 << child_log2)?;
                continue;
            }
            let child = place(at, self.bytes.i64(entry)?)?;
            if depth == 0 { self.node(child, first, 1)? } else { self.leaf(child, first)? }
        }
        Ok(())
    }

    fn leaf(&mut self, at: u64, origin: [i32; 3]) -> Result<(), NanoError> {
        self.visit(2)?;
        let bytes = self.bytes;
        bytes.slice(at, LEAF_VALUES as usize)?;
        let out = &mut self.grid.leaf_values;
        match self.grid.values {
            ValueType::Float => {
                let values = bytes.slice(at + LEAF_VALUES, 4 * LEAF_VOXELS)?.as_chunks().0;
                out.extend(values.iter().map(|v| f32::from_le_bytes(*v)));
            }
            ValueType::Double => {
                let values = bytes.slice(at + LEAF_VALUES + 32, 8 * LEAF_VOXELS)?.as_chunks().0;
                out.extend(values.iter().map(|v| f64::from_le_bytes(*v) as f32));
            }
            ValueType::Fixed(bits) => fixed(bytes, at, u32::from(bits), out)?,
            ValueType::FixedByLeaf => {
                let log2 = bytes.slice(at + 15, 1)?[0] >> 5;
                if log2 > 4 {
                    return Err(NanoError::damaged(format!("a leaf with values of 2^{log2} bits")));
                }
                fixed(bytes, at, 1 << log2, out)?;
            }
        }
        self.grid.leaves.push(origin);
        Ok(())
    }
}

/// Values quantised with `bits` bits: 1, 2, 4, 8 or 16.
fn fixed(bytes: Bytes<'_>, at: u64, bits: u32, out: &mut Vec<f32>) -> Result<(), NanoError> {
    let (least, step) = (bytes.f32(at + 80)?, bytes.f32(at + 84)?);
    let codes = bytes.slice(at + LEAF_VALUES, LEAF_VOXELS / 8 * bits as usize)?;
    let code = |i: usize| {
        if bits == 16 {
            return f32::from(u16::from_le_bytes([codes[2 * i], codes[2 * i + 1]]));
        }
        let bit = i * bits as usize;
        f32::from(codes[bit / 8] >> (bit % 8) & (u8::MAX >> (8 - bits)))
    };
    out.extend((0..LEAF_VOXELS).map(|i| code(i) * step + least));
    Ok(())
}

/// Offset of a child, from its parent.
fn place(parent: u64, offset: i64) -> Result<u64, NanoError> {
    parent.checked_add_signed(offset).ok_or_else(|| NanoError::damaged("the place of a node"))
}

/// The leaf size of the format.
const _: () = assert!(LEAF_VOXELS == (LEAF * LEAF * LEAF) as usize);

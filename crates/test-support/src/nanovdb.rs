//! Writes NanoVDB files for tests, from the description of the format and not from its reader.

use std::collections::BTreeMap;

/// Version 32.4.2, as heads have it.
pub const VERSION: u32 = 32 << 21 | 4 << 10 | 2;

/// A grid to write. All its voxels are active.
#[derive(Clone, Debug)]
pub struct NanoSpec {
    /// Its name.
    pub name: String,
    /// Code of its class: 2 for a fog volume.
    pub class: u32,
    /// Code of the type of its values: 1 float, 2 double, 13 to 15 steps of 4, 8 and 16 bits, 16 steps of `bits` bits.
    pub ty: u32,
    /// Bits of the values of the type 16: 1, 2, 4, 8 or 16.
    pub bits: u32,
    /// The value of everything else.
    pub background: f32,
    /// First voxels of leaves of 8³ voxels, and their values, z first.
    pub leaves: Vec<([i32; 3], Vec<f32>)>,
    /// First voxels of tiles, their sizes (8, 128 or 4096) and values.
    pub tiles: Vec<([i32; 3], i32, f32)>,
    /// Columns of the matrix from indices to space, and what is added.
    pub space_from_index: [[f64; 3]; 4],
}

impl NanoSpec {
    /// An empty fog volume of floats, whose indices are its space.
    pub fn new(name: &str) -> Self {
        NanoSpec {
            name: name.to_owned(),
            class: 2,
            ty: 1,
            bits: 8,
            background: 0.0,
            leaves: Vec::new(),
            tiles: Vec::new(),
            space_from_index: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]],
        }
    }

    /// Adds the leaves that hold a box of voxels, from `first` up to but without `end`.
    pub fn fill(&mut self, first: [i32; 3], end: [i32; 3], value: impl Fn([i32; 3]) -> f32) {
        let begin = first.map(|i| i & !7);
        for x in (begin[0]..end[0]).step_by(8) {
            for y in (begin[1]..end[1]).step_by(8) {
                for z in (begin[2]..end[2]).step_by(8) {
                    let voxel = |i: usize| {
                        let at = [x + (i >> 6) as i32, y + (i >> 3 & 7) as i32, z + (i & 7) as i32];
                        let is_inside = (0..3).all(|a| (first[a]..end[a]).contains(&at[a]));
                        if is_inside { value(at) } else { self.background }
                    };
                    let values = (0..512).map(voxel).collect();
                    self.leaves.push(([x, y, z], values));
                }
            }
        }
    }

    /// First and last voxel of leaves and tiles.
    fn bounds(&self) -> [[i32; 3]; 2] {
        let tiles = self.tiles.iter().map(|(origin, size, _)| (*origin, *size));
        let all = self.leaves.iter().map(|(origin, _)| (*origin, 8)).chain(tiles);
        all.fold([[i32::MAX; 3], [i32::MIN; 3]], |[low, high], (origin, size)| {
            let join = |a: usize| (low[a].min(origin[a]), high[a].max(origin[a] + size - 1));
            [[0, 1, 2].map(|a| join(a).0), [0, 1, 2].map(|a| join(a).1)]
        })
    }

    /// The box of the voxels in space, each from its index to the next.
    pub fn space_bounds(&self) -> [[f64; 3]; 2] {
        let [low, high] = self.bounds();
        let corners = (0..8).map(|corner| {
            let index = [0, 1, 2].map(|a| f64::from(if corner >> a & 1 == 0 { low[a] } else { high[a] + 1 }));
            [0, 1, 2].map(|row| {
                (0..3).map(|a| self.space_from_index[a][row] * index[a]).sum::<f64>() + self.space_from_index[3][row]
            })
        });
        corners.fold([[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]], |[low, high], p| {
            [[0, 1, 2].map(|a| low[a].min(p[a])), [0, 1, 2].map(|a| high[a].max(p[a]))]
        })
    }

    /// Nodes of 16³ entries.
    fn lowers(&self) -> Nodes<Child<'_>> {
        let mut lowers: Nodes<Child<'_>> = BTreeMap::new();
        for (origin, values) in &self.leaves {
            lowers.entry(key(origin, 7)).or_default().push((*origin, Err(values)));
        }
        for (origin, _, value) in self.tiles.iter().filter(|t| t.1 == 8) {
            lowers.entry(key(origin, 7)).or_default().push((*origin, Ok(*value)));
        }
        lowers
    }

    /// Nodes of 32³ entries, in which those of 16³ have no value.
    fn uppers(&self, lowers: &Nodes<Child<'_>>) -> Nodes<Tile> {
        let mut uppers: Nodes<Tile> = BTreeMap::new();
        for lower in lowers.keys() {
            uppers.entry(lower.map(|i| i >> 5)).or_default().push((lower.map(|i| i << 7), None));
        }
        for (origin, _, value) in self.tiles.iter().filter(|t| t.1 == 128) {
            uppers.entry(key(origin, 12)).or_default().push((*origin, Some(*value)));
        }
        uppers
    }

    /// The grid as it is in memory.
    pub fn bytes(&self) -> Vec<u8> {
        let wide = self.ty == 2;
        let lowers = self.lowers();
        let uppers = self.uppers(&lowers);
        let roots: Vec<_> = self.tiles.iter().filter(|t| t.1 == 4096).collect();

        // Where everything goes
        let (root_at, root_size) = (736_u64, if wide { 96 } else { 64 });
        let uppers_at = root_at + root_size + 32 * (uppers.len() + roots.len()) as u64;
        let lowers_at = uppers_at + 270_400 * uppers.len() as u64;
        let leaves_at = lowers_at + 33_856 * lowers.len() as u64;
        let mut out = Out { bytes: vec![0; leaves_at as usize], wide };
        self.head(&mut out, [leaves_at, lowers_at, uppers_at, root_at].map(|at| at - 672));
        out.put(root_at + 24, &((uppers.len() + roots.len()) as u32).to_le_bytes());
        out.value(root_at + if wide { 32 } else { 28 }, self.background);
        let root_key = |p: [i32; 3]| p.iter().fold(0_u64, |key, &i| key << 21 | u64::from(i as u32 & 0xf_ffff));
        let mut entry = root_at + root_size;
        for (origin, _, value) in roots {
            out.put(entry, &root_key(key(origin, 12)).to_le_bytes());
            out.value(entry + if wide { 24 } else { 20 }, *value);
            entry += 32;
        }
        for (i, (upper, children)) in uppers.iter().enumerate() {
            let at = uppers_at + 270_400 * i as u64;
            out.put(entry, &root_key(*upper).to_le_bytes());
            out.put(entry + 8, &((at - root_at) as i64).to_le_bytes());
            entry += 32;
            out.node(at, 5, self.background);
            for (origin, value) in children {
                let n = offset(*origin, 7, 5);
                match value {
                    Some(value) => out.value(at + 8256 + 8 * n, *value),
                    None => {
                        let index = lowers.keys().position(|lower| *lower == key(origin, 7)).unwrap_or_default();
                        let place = lowers_at + 33_856 * index as u64;
                        out.child(at, 32 + 4096, 8256, n, place);
                    }
                }
            }
        }
        for (i, children) in lowers.values().enumerate() {
            let at = lowers_at + 33_856 * i as u64;
            out.node(at, 4, self.background);
            for (origin, child) in children {
                let n = offset(*origin, 3, 4);
                match child {
                    Ok(value) => out.value(at + 1088 + 8 * n, *value),
                    Err(values) => {
                        let place = out.bytes.len() as u64;
                        out.child(at, 32 + 512, 1088, n, place);
                        self.leaf(&mut out.bytes, values);
                    }
                }
            }
        }
        let size = out.bytes.len() as u64;
        out.put(32, &size.to_le_bytes());
        out.bytes
    }

    fn head(&self, out: &mut Out, offsets: [u64; 4]) {
        out.put(0, b"NanoVDB0");
        out.put(16, &VERSION.to_le_bytes());
        out.put(40, &self.name.as_bytes()[..self.name.len().min(255)]);
        for row in 0..3 {
            for column in 0..3 {
                let at = 384 + 8 * (3 * row + column) as u64;
                out.put(at, &self.space_from_index[column][row].to_le_bytes());
            }
            out.put(528 + 8 * row as u64, &self.space_from_index[3][row].to_le_bytes());
        }
        for (i, x) in self.space_bounds().as_flattened().iter().enumerate() {
            out.put(560 + 8 * i as u64, &x.to_le_bytes());
        }
        out.put(632, &self.class.to_le_bytes());
        out.put(636, &self.ty.to_le_bytes());
        for (i, offset) in offsets.iter().enumerate() {
            out.put(672 + 8 * i as u64, &offset.to_le_bytes());
        }
        for (i, index) in self.bounds().as_flattened().iter().enumerate() {
            out.put(736 + 4 * i as u64, &index.to_le_bytes());
        }
    }

    fn leaf(&self, out: &mut Vec<u8>, values: &[f32]) {
        let begin = out.len();
        let bits = match self.ty {
            13 => 4,
            14 => 8,
            15 => 16,
            16 => self.bits,
            _ => 0,
        };
        out.resize(begin + if self.ty == 2 { 128 } else { 96 }, 0);
        match self.ty {
            2 => out.extend(values.iter().flat_map(|v| f64::from(*v).to_le_bytes())),
            0..13 => out.extend(values.iter().flat_map(|v| v.to_le_bytes())),
            _ => {
                let (least, most) =
                    values.iter().fold((f32::MAX, f32::MIN), |(low, high), &v| (low.min(v), high.max(v)));
                let step = (most - least) / ((1_u32 << bits) - 1) as f32;
                out[begin + 15] = (bits.ilog2() as u8) << 5;
                out[begin + 80..begin + 84].copy_from_slice(&least.to_le_bytes());
                out[begin + 84..begin + 88].copy_from_slice(&step.to_le_bytes());
                let mut codes = vec![0_u8; 64 * bits as usize];
                for (i, v) in values.iter().enumerate() {
                    let code = if step > 0.0 { ((v - least) / step).round() as u32 } else { 0 };
                    for bit in 0..bits as usize {
                        let at = i * bits as usize + bit;
                        codes[at / 8] |= ((code >> bit & 1) as u8) << (at % 8);
                    }
                }
                out.extend(codes);
            }
        }
    }
}

fn key(p: &[i32; 3], bits: u32) -> [i32; 3] {
    p.map(|i| i >> bits)
}

/// Entries of nodes, which are known by their indices in units of their size.
type Nodes<T> = BTreeMap<[i32; 3], Vec<T>>;

/// A tile, or a node if it has no value.
type Tile = ([i32; 3], Option<f32>);

/// A tile or a leaf.
type Child<'a> = ([i32; 3], Result<f32, &'a Vec<f32>>);

/// The place of a voxel among the entries of a node.
fn offset(p: [i32; 3], child_bits: u32, bits: u32) -> u64 {
    p.iter().fold(0, |n, &i| n << bits | (i as u32 >> child_bits & ((1 << bits) - 1)) as u64)
}

struct Out {
    bytes: Vec<u8>,
    wide: bool,
}

impl Out {
    fn put(&mut self, at: u64, bytes: &[u8]) {
        self.bytes[at as usize..at as usize + bytes.len()].copy_from_slice(bytes);
    }

    fn value(&mut self, at: u64, value: f32) {
        if self.wide { self.put(at, &f64::from(value).to_le_bytes()) } else { self.put(at, &value.to_le_bytes()) }
    }

    /// A node of background alone.
    fn node(&mut self, at: u64, bits: u32, background: f32) {
        let table = if bits == 5 { 8256 } else { 1088 };
        (0..1 << (3 * bits)).for_each(|n| self.value(at + table + 8 * n, background));
    }

    fn child(&mut self, parent: u64, mask: u64, table: u64, n: u64, place: u64) {
        self.bytes[(parent + mask + n / 8) as usize] |= 1 << (n % 8);
        self.put(parent + table + 8 * n, &((place - parent) as i64).to_le_bytes());
    }
}

/// A file of one segment; `codec` 0 is none, 1 zip, 2 Blosc, and `stored` makes of a grid what is stored of it.
pub fn nano_file(grids: &[NanoSpec], codec: u16, stored: impl Fn(&[u8]) -> Vec<u8>) -> Vec<u8> {
    let mut file = b"NanoVDB0".to_vec();
    file.extend(VERSION.to_le_bytes());
    file.extend((grids.len() as u16).to_le_bytes());
    file.extend(codec.to_le_bytes());
    let mut all = Vec::new();
    for grid in grids {
        let bytes = grid.bytes();
        let stored = stored(&bytes);
        let mut entry = [0; 176];
        entry[..8].copy_from_slice(&(bytes.len() as u64).to_le_bytes());
        entry[8..16].copy_from_slice(&(stored.len() as u64).to_le_bytes());
        entry[32..36].copy_from_slice(&grid.ty.to_le_bytes());
        entry[36..40].copy_from_slice(&grid.class.to_le_bytes());
        entry[136..140].copy_from_slice(&(grid.name.len() as u32 + 1).to_le_bytes());
        file.extend(entry);
        file.extend(grid.name.as_bytes());
        file.push(0);
        all.extend(stored);
    }
    file.extend(all);
    file
}

/// A file of grids as they are.
pub fn plain_nano_file(grids: &[NanoSpec]) -> Vec<u8> {
    nano_file(grids, 0, <[u8]>::to_vec)
}

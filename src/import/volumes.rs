//! Grids of NanoVDB files as sparse trees.

use super::memory::FileSize;
use crate::media::{Cube, SparseGrid};
use lumiris_formats::nanovdb::{GridClass, NanoError, NanoSize, nanovdb_size, read_nanovdb};
use lumiris_numbers::math::{DAffine3, DVec3};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The use of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum VolumeUse {
    /// Densities, which must not be negative.
    Density,
    /// Temperatures.
    Temperature,
}

/// A request for a grid.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct VolumeRequest {
    /// The file.
    pub path: PathBuf,
    /// Name of the grid.
    pub grid: String,
    /// Its use.
    pub usage: VolumeUse,
}

/// A grid.
#[derive(Debug)]
pub struct Volume {
    /// Its values.
    pub grid: Arc<SparseGrid>,
    /// Their class.
    pub class: GridClass,
    /// From indices to the space of the file.
    pub space_from_index: DAffine3,
    /// The box of its active voxels in the space of the file; `None` if there are none.
    pub bounds: Option<[[f64; 3]; 2]>,
    /// Number of invalid values that were replaced by 0.
    pub replaced: usize,
}

/// Bytes of a grid: as a tree, and as stored; none if it is unreadable, which reading it reports.
pub fn volume_size(request: &VolumeRequest) -> FileSize {
    let Ok(NanoSize { bytes, leaves, nodes }) = nanovdb_size(&request.path, &request.grid) else {
        return FileSize::default();
    };
    // Values and maximum of a leaf; entries of nodes; first voxels of leaves while it is read
    let kept = leaves * (512 * 4 + 4) + nodes[0] * (16 << 10) + nodes[1] * (128 << 10);
    FileSize { kept, loading: bytes + leaves * 12 }
}

/// Reads a grid.
pub fn load_volume(path: &Path, grid: &str, usage: VolumeUse) -> Result<Volume, NanoError> {
    let mut grid = read_nanovdb(path, grid)?;
    let is_possible = |v: f32| v.is_finite() && (usage == VolumeUse::Temperature || v >= 0.0);
    let replaced = grid.replace(|v| (!is_possible(v)).then_some(0.0));
    let [x, y, z, translation] = grid.space_from_index.map(DVec3::from_array);
    let cubes: Vec<Cube> =
        grid.tiles.iter().map(|tile| Cube { origin: tile.origin, size: tile.size, value: tile.value }).collect();
    Ok(Volume {
        class: grid.class,
        space_from_index: DAffine3::from_cols(x, y, z, translation),
        bounds: grid.space_bounds(),
        replaced,
        grid: Arc::new(SparseGrid::new(grid.background, &cubes, &grid.leaves, grid.leaf_values)),
    })
}

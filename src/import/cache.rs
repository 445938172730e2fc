//! Meshes, images, textures of faces, volumes and measured materials shared by successive scenes, such as the frames of
//! an animation.
//!
//! A file is unchanged if its name, size and modification time are unchanged. Content that a scene did not use is
//! dropped when the next one has been loaded ([`FileCache::end_scene`]), so memory holds the content of two scenes at
//! most. Text of scene files is not cached, since it changes between scenes.
//!
//! If the textures of a scene exceed their memory limit, or the memory that a limit of the process leaves, the largest
//! of them are stored in tiles of a temporary file ([`crate::imaging::tiles`]), and all others in memory. At least half
//! of the limit remains for the tiles in use. With a folder for textures ([`super::texture_cache`]), all are read by
//! tiles of its files.

use super::face_maps::{FaceMapRequest, load_face_map};
use super::images::{
    ImageChannels, ImageEncoding, ImageRequest, RgbImage, load_map, load_rgb, load_tiled_map, map_size,
};
use super::measured::{MeasuredError, load_tables};
use super::memory::{FileSize, MemoryAccount, MemoryLimit};
use super::texture_cache::TextureCache;
use super::volumes::{Volume, VolumeRequest, VolumeUse, load_volume};
use crate::bsdfs::MeasuredTables;
use crate::imaging::oiio::ImageError;
use crate::imaging::tiles::TileStore;
use crate::imaging::{ColorEncoding, FaceMap, Filter, MipMap, Wrap};
use lumiris_formats::nanovdb::NanoError;
use lumiris_formats::ply::{PlyError, PlyMesh, read_ply};
use lumiris_formats::ptex::PtexError;
use rayon::prelude::*;
use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::SystemTime;

/// Minimum memory of tiles of textures for which a scene is rendered (bytes).
const MIN_TILES: u64 = 8 << 20;

/// Identifies the state of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Stamp {
    bytes: u64,
    modified: SystemTime,
}

impl Stamp {
    /// `None` if the file or its modification time does not exist.
    fn of(path: &Path) -> Option<Self> {
        let metadata = path.metadata().ok()?;
        Some(Stamp { bytes: metadata.len(), modified: metadata.modified().ok()? })
    }
}

/// The content of a file, decoded as `how` says.
#[derive(Debug)]
struct Entry<H, T> {
    stamp: Stamp,
    how: H,
    content: Arc<T>,
    is_used: bool,
}

/// Contents of one kind, by file.
#[derive(Debug)]
struct Shelf<H, T>(Mutex<HashMap<PathBuf, Vec<Entry<H, T>>>>);

impl<H, T> Default for Shelf<H, T> {
    fn default() -> Self {
        Shelf(Mutex::default())
    }
}

impl<H: PartialEq, T> Shelf<H, T> {
    /// The cached content of this file in its current state.
    fn find(&self, path: &Path, stamp: Stamp, how: &H) -> Option<Arc<T>> {
        let mut shelf = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let entry = shelf.get_mut(path)?.iter_mut().find(|entry| entry.stamp == stamp && entry.how == *how)?;
        entry.is_used = true;
        Some(Arc::clone(&entry.content))
    }

    fn put(&self, path: &Path, stamp: Stamp, how: H, content: &Arc<T>) {
        let mut shelf = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let entries = shelf.entry(path.to_owned()).or_default();
        // Replaces entries of an older state, or of another thread that read it at the same time
        entries.retain(|entry| entry.stamp == stamp && entry.how != how);
        entries.push(Entry { stamp, how, content: Arc::clone(content), is_used: true });
    }

    fn has(&self, path: &Path, stamp: Stamp) -> bool {
        let shelf = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        shelf.get(path).is_some_and(|entries| entries.iter().any(|entry| entry.stamp == stamp))
    }

    /// Drops content that was not used since the last call.
    fn drop_unused(&self) {
        let mut shelf = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        shelf.retain(|_, entries| {
            entries.retain_mut(|entry| std::mem::take(&mut entry.is_used));
            !entries.is_empty()
        });
    }
}

/// Numbers of files that were read, or shared with the scene before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FileCounts {
    /// Read from disk.
    pub read: u64,
    /// Shared with the previous scene.
    pub shared: u64,
}

/// Contents of meshes, images, textures of faces, volumes and measured materials by file.
#[derive(Debug, Default)]
pub struct FileCache {
    /// False if content is not cached.
    keeps: bool,
    meshes: Shelf<(), PlyMesh>,
    maps: Shelf<(ImageChannels, ImageEncoding, Wrap, Filter), MipMap>,
    images: Shelf<(), RgbImage>,
    face_maps: Shelf<ColorEncoding, FaceMap>,
    volumes: Shelf<(String, VolumeUse), Volume>,
    measured: Shelf<(), MeasuredTables>,
    read: AtomicU64,
    shared: AtomicU64,
    /// Maximum memory of the textures of a scene (bytes).
    texture_memory: OnceLock<u64>,
    /// Limit of the process.
    memory: OnceLock<MemoryLimit>,
    /// Folder of textures for later runs.
    texture_cache: OnceLock<Arc<TextureCache>>,
    /// Held while a texture is read into tiles: one at a time, since the whole texture is in memory meanwhile.
    tiling: Mutex<()>,
}

/// Storage of the textures of a scene.
#[derive(Debug, Default)]
pub struct TexturePlan {
    /// Storage of tiles; `None` if everything fits into memory.
    store: Option<Arc<TileStore>>,
    /// True for each image that is stored in tiles. Empty if a folder of textures has all.
    is_tiled: Vec<bool>,
}

fn sum(sizes: &[u64]) -> u64 {
    sizes.iter().fold(0, |sum, &bytes| sum.saturating_add(bytes))
}

/// A limit of the memory of textures, if those of these `sizes` exceed the `left` memory, but fit by tiles.
fn texture_room(sizes: &[u64], left: u64) -> Option<u64> {
    // A texture is in memory as a whole while it is divided into tiles
    let largest = sizes.iter().copied().max().unwrap_or(0);
    let room = left.saturating_sub(largest);
    (sum(sizes) > left && room >= MIN_TILES).then_some(room)
}

/// Textures to be stored in tiles: if all exceed the limit, the largest ones, until the others take half of it.
fn in_tiles(sizes: &[u64], limit: u64) -> Vec<bool> {
    let mut is_tiled = vec![false; sizes.len()];
    let mut in_memory = sum(sizes);
    if in_memory <= limit {
        return is_tiled;
    }
    let mut by_size: Vec<usize> = (0..sizes.len()).collect();
    by_size.sort_by_key(|&i| (std::cmp::Reverse(sizes[i]), i));
    for i in by_size {
        if in_memory <= limit / 2 {
            break;
        }
        is_tiled[i] = true;
        in_memory -= sizes[i];
    }
    is_tiled
}

impl FileCache {
    /// A cache for several scenes.
    pub fn keeping() -> Self {
        FileCache { keeps: true, ..FileCache::default() }
    }

    /// Limits the memory of the textures of each scene (bytes). The first call is effective, later ones are ignored.
    pub fn limit_textures(&self, bytes: u64) {
        self.texture_memory.get_or_init(|| bytes);
    }

    /// Refuses scenes that exceed the limit, and stores textures in tiles where a scene fits only so, unless their memory
    /// is limited already. Later scenes have the same limit of textures. The first call is effective, later ones are
    /// ignored.
    pub fn limit_memory(&self, limit: MemoryLimit) {
        self.memory.get_or_init(|| limit);
    }

    /// The limit of the process, if there is one.
    pub fn memory_limit(&self) -> Option<&MemoryLimit> {
        self.memory.get()
    }

    /// True if content of this file in its current state is in memory.
    pub fn holds(&self, path: &Path) -> bool {
        let is_held = |stamp| {
            self.meshes.has(path, stamp)
                || self.maps.has(path, stamp)
                || self.images.has(path, stamp)
                || self.face_maps.has(path, stamp)
                || self.volumes.has(path, stamp)
                || self.measured.has(path, stamp)
        };
        self.keeps && Stamp::of(path).is_some_and(is_held)
    }

    /// The memory that a file will take, which is `size`, unless its content is in memory.
    pub fn missing(&self, path: &Path, size: impl FnOnce() -> FileSize) -> FileSize {
        if self.holds(path) { FileSize::default() } else { size() }
    }

    /// An error message if the scene exceeds the limit of the process.
    pub fn refusal(&self, account: &MemoryAccount) -> Option<String> {
        account.refusal(self.memory_limit()?)
    }

    /// Keeps textures in a folder for later runs. The first call is effective, later ones are ignored. Returns `Err` if
    /// the folder cannot be created.
    pub fn cache_textures(&self, folder: &Path) -> io::Result<()> {
        let cache = Arc::new(TextureCache::new(folder)?);
        self.texture_cache.get_or_init(|| cache);
        Ok(())
    }

    /// Takes the warnings of the folder of textures since the last call.
    pub fn take_texture_warnings(&self) -> Vec<String> {
        self.texture_cache.get().map_or_else(Vec::new, |cache| cache.take_warnings())
    }

    /// Plans the storage of the images of `requests`, by the sizes in their headers, and adds it to the account.
    ///
    /// Returns `Err` if the temporary file cannot be created.
    pub fn plan_textures(&self, requests: &[&ImageRequest], account: &mut MemoryAccount) -> io::Result<TexturePlan> {
        let (given, memory) = (self.texture_memory.get().copied(), self.memory_limit());
        if self.texture_cache.get().is_some() {
            // Its files are not opened
            let capacity = given.or_else(|| Some(account.left(memory?))).unwrap_or(u64::MAX);
            let store = Some(Arc::new(TileStore::new(capacity)?));
            return Ok(TexturePlan { store, is_tiled: Vec::new() });
        }
        if given.is_none() && memory.is_none() {
            return Ok(TexturePlan::default());
        }

        let size = |request: &&ImageRequest| self.missing(&request.path, || map_size(request));
        let sizes: Vec<FileSize> = requests.par_iter().map(size).collect();
        sizes.iter().for_each(|size| account.add_file("", FileSize { kept: 0, ..*size }));
        let sizes: Vec<u64> = sizes.iter().map(|size| size.kept).collect();
        let room = || texture_room(&sizes, account.left(memory?));
        let limit = given.or_else(|| room().map(|room| *self.texture_memory.get_or_init(|| room))).unwrap_or(u64::MAX);
        let is_tiled = in_tiles(&sizes, limit);

        // Account
        let mut in_memory = 0_u64;
        for ((request, &bytes), _) in requests.iter().zip(&sizes).zip(&is_tiled).filter(|(_, is_tiled)| !**is_tiled) {
            account.add(request.path.display().to_string(), bytes);
            in_memory = in_memory.saturating_add(bytes);
        }
        if !is_tiled.contains(&true) {
            return Ok(TexturePlan::default());
        }
        account.add("tiles of textures", (limit - in_memory).min(sum(&sizes) - in_memory));
        Ok(TexturePlan { store: Some(Arc::new(TileStore::new(limit - in_memory)?)), is_tiled })
    }

    /// The pyramid of image `index` of a plan.
    pub fn planned_map(
        &self,
        plan: &TexturePlan,
        index: usize,
        request: &ImageRequest,
    ) -> Result<Arc<MipMap>, ImageError> {
        let map = match (&plan.store, self.texture_cache.get()) {
            // Without a limit, several images may be in memory at once
            (Some(store), Some(cache)) => cache.map(request, store, self.texture_memory.get().map(|_| &self.tiling))?,
            (Some(store), None) if plan.is_tiled.get(index) == Some(&true) => {
                let _alone = self.tiling.lock().unwrap_or_else(PoisonError::into_inner);
                load_tiled_map(request, store)?
            }
            _ => return self.map(request),
        };
        self.read.fetch_add(1, Ordering::Relaxed);
        Ok(Arc::new(map))
    }

    /// True if content is cached: a scene then gets copies of meshes.
    pub fn keeps(&self) -> bool {
        self.keeps
    }

    /// The mesh of a PLY file.
    pub fn mesh(&self, path: &Path) -> Result<Arc<PlyMesh>, PlyError> {
        self.get(&self.meshes, path, (), || read_ply(path))
    }

    /// The pyramid of an image for textures.
    pub fn map(&self, request: &ImageRequest) -> Result<Arc<MipMap>, ImageError> {
        let how = (request.channels, request.encoding, request.wrap, request.filter);
        self.get(&self.maps, &request.path, how, || load_map(request))
    }

    /// An image as linear RGB.
    pub fn rgb(&self, path: &Path) -> Result<Arc<RgbImage>, ImageError> {
        self.get(&self.images, path, (), || load_rgb(path))
    }

    /// Textures of faces.
    pub fn face_map(&self, request: &FaceMapRequest) -> Result<Arc<FaceMap>, PtexError> {
        let FaceMapRequest { path, encoding } = request;
        self.get(&self.face_maps, path, *encoding, || load_face_map(path, *encoding))
    }

    /// A grid of a volume.
    pub fn volume(&self, request: &VolumeRequest) -> Result<Arc<Volume>, NanoError> {
        let how = (request.grid.clone(), request.usage);
        self.get(&self.volumes, &request.path, how, || load_volume(&request.path, &request.grid, request.usage))
    }

    /// The tables of a measured material.
    pub fn measured(&self, path: &Path) -> Result<Arc<MeasuredTables>, MeasuredError> {
        self.get(&self.measured, path, (), || load_tables(path))
    }

    /// Ends a scene: drops content that it did not use, and returns the numbers of files that it read and shared.
    pub fn end_scene(&self) -> FileCounts {
        self.meshes.drop_unused();
        self.maps.drop_unused();
        self.images.drop_unused();
        self.face_maps.drop_unused();
        self.volumes.drop_unused();
        self.measured.drop_unused();
        FileCounts { read: self.read.swap(0, Ordering::Relaxed), shared: self.shared.swap(0, Ordering::Relaxed) }
    }

    fn get<H: PartialEq, T, E>(
        &self,
        shelf: &Shelf<H, T>,
        path: &Path,
        how: H,
        read: impl FnOnce() -> Result<T, E>,
    ) -> Result<Arc<T>, E> {
        // The state before reading: a change meanwhile makes it another file
        let stamp = if self.keeps { Stamp::of(path) } else { None };
        if let Some(found) = stamp.and_then(|stamp| shelf.find(path, stamp, &how)) {
            self.shared.fetch_add(1, Ordering::Relaxed);
            return Ok(found);
        }
        // Not under the lock, as reading uses all threads
        let content = Arc::new(read()?);
        self.read.fetch_add(1, Ordering::Relaxed);
        if let Some(stamp) = stamp {
            shelf.put(path, stamp, how, &content);
        }
        Ok(content)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                            element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

    #[test]
    fn a_file_is_read_again_when_it_changed_and_forgotten_when_a_scene_did_without_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        std::fs::write(&path, TRIANGLE).unwrap();
        let cache = FileCache::keeping();
        let first = cache.mesh(&path).unwrap();
        assert_eq!(cache.end_scene(), FileCounts { read: 1, shared: 0 });
        assert!(Arc::ptr_eq(&first, &cache.mesh(&path).unwrap()));
        assert_eq!(cache.end_scene(), FileCounts { read: 0, shared: 1 });

        // A different size, and the same size at another time
        std::fs::write(&path, TRIANGLE.replace("1 0 0", "2.5 0 0")).unwrap();
        assert_eq!(cache.mesh(&path).unwrap().positions[1].x, 2.5);
        std::fs::write(&path, TRIANGLE.replace("1 0 0", "4.5 0 0")).unwrap();
        let later = SystemTime::now() + std::time::Duration::from_secs(7);
        std::fs::File::options().write(true).open(&path).unwrap().set_modified(later).unwrap();
        assert_eq!(cache.mesh(&path).unwrap().positions[1].x, 4.5);
        assert_eq!(cache.end_scene(), FileCounts { read: 2, shared: 0 });
        assert_eq!(cache.meshes.0.lock().unwrap()[&path].len(), 1, "the older states are gone");

        assert_eq!(cache.end_scene(), FileCounts::default());
        assert!(cache.meshes.0.lock().unwrap().is_empty());
        cache.mesh(&path).unwrap();
        assert_eq!(cache.end_scene(), FileCounts { read: 1, shared: 0 });
    }

    #[test]
    fn a_file_that_cannot_be_read_is_tried_anew_and_without_keeping_nothing_is_shared() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        let cache = FileCache::keeping();
        assert!(cache.mesh(&path).is_err());
        std::fs::write(&path, TRIANGLE).unwrap();
        assert!(cache.mesh(&path).is_ok());

        let cache = FileCache::default();
        let mesh = cache.mesh(&path).unwrap();
        assert!(!Arc::ptr_eq(&mesh, &cache.mesh(&path).unwrap()));
        assert_eq!(Arc::strong_count(&mesh), 1);
        assert_eq!(cache.end_scene(), FileCounts { read: 2, shared: 0 });
    }
}

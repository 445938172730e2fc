//! A folder of texture files that later runs use ([`crate::imaging::texture_file`]).
//!
//! An entry is named by a hash of the bytes of the image file and of everything else that its pyramid depends on. So it
//! never becomes wrong, and several processes may share the folder: entries are written under temporary names and
//! renamed. `sources` has the hashes of image files, so that an unchanged file is not read: one that has the same path,
//! size, and times of modification and change as when it was hashed.
//!
//! A damaged entry is made anew, also in the middle of a rendering.

use super::images::{ImageRequest, gives_levels, image_map, into_tiles, map_of_levels};
use crate::imaging::MipMap;
use crate::imaging::oiio::{ImageError, ImageFile};
use crate::imaging::texture_file::{TextureFile, write_texture};
use crate::imaging::tiles::TileStore;
use lumiris_formats::output::{write_text, write_whole};
use std::fs::{self, File};
use std::io::{self, BufReader, BufWriter, Cursor, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

/// Changes whenever the pyramid of the same file changes.
const VERSION: u32 = 1;
/// Folder of the hashes of image files.
const SOURCES: &str = "sources";
/// A file that changed less than this time (ns) before it was hashed may change again within the resolution of its
/// times.
const RESOLUTION: i128 = 2_000_000_000;

/// Hash of the content of a file.
type ContentHash = u128;

/// A folder of texture files.
#[derive(Debug)]
pub struct TextureCache {
    folder: PathBuf,
    warnings: Mutex<Vec<String>>,
}

impl TextureCache {
    /// The cache in a folder, which is created if it does not exist.
    pub fn new(folder: &Path) -> io::Result<Self> {
        fs::create_dir_all(folder.join(SOURCES))?;
        // The working folder may change
        Ok(TextureCache { folder: std::path::absolute(folder)?, warnings: Mutex::default() })
    }

    /// Takes the warnings since the last call.
    pub fn take_warnings(&self) -> Vec<String> {
        std::mem::take(&mut self.warnings.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Adds a warning, unless it is known.
    fn warn(&self, warning: String) {
        let mut warnings = self.warnings.lock().unwrap_or_else(PoisonError::into_inner);
        if !warnings.contains(&warning) {
            warnings.push(warning);
        }
    }

    /// The pyramid of an image, by tiles: of its entry, which is made if it is missing, or of the file itself if that
    /// has all levels. `making` is locked while an image is in memory as a whole.
    pub fn map(
        self: &Arc<Self>,
        request: &ImageRequest,
        store: &Arc<TileStore>,
        making: Option<&Mutex<()>>,
    ) -> Result<MipMap, ImageError> {
        // An unchanged file is not even opened
        let known = self.known_hash(&request.path);
        if let Some(map) = known.and_then(|hash| self.find(&Entry::new(self, request, hash), store)) {
            return Ok(map);
        }
        let file = ImageFile::open(&request.path)?;
        if gives_levels(&file, request) {
            return map_of_levels(file, request, Some(store));
        }
        let hash = known.map_or_else(|| self.hash(&request.path), Ok);
        let hash = hash.map_err(|error| unreadable(request, error.to_string()))?;
        let entry = Entry::new(self, request, hash);
        if let Some(map) = self.find(&entry, store) {
            return Ok(map);
        }

        // Make the entry. Without it, the texture goes into the temporary file
        let _making = making.map(|mutex| mutex.lock().unwrap_or_else(PoisonError::into_inner));
        let map = image_map(&file, request)?;
        match entry.write(&map) {
            Ok(()) => self.find(&entry, store).map_or_else(|| into_tiles(map, request, store), Ok),
            Err(error) => {
                self.warn(format!("{}: textures cannot be stored: {error}", self.folder.display()));
                into_tiles(map, request, store)
            }
        }
    }

    /// The pyramid of an entry, if it exists and its header and coarse levels are intact.
    fn find(self: &Arc<Self>, entry: &Entry, store: &Arc<TileStore>) -> Option<MipMap> {
        let opened = TextureFile::open(&entry.path).transpose()?;
        let (cache, for_repair) = (Arc::clone(self), entry.clone());
        let repair = Box::new(move |reason: &str| for_repair.repair(&cache, reason));
        let ImageRequest { wrap, filter, .. } = entry.request;
        let map = opened.and_then(|file| file.with_repair(repair).map(wrap, filter, store));
        map.map_err(|reason| self.warn(entry.is_damaged(&reason))).ok()
    }

    /// The file that has the hash of an image file.
    fn source(&self, path: &Path) -> io::Result<PathBuf> {
        let path = std::path::absolute(path)?;
        Ok(self.folder.join(SOURCES).join(name(path.as_os_str().as_encoded_bytes())))
    }

    /// The hash of an image file that did not change since it was hashed.
    fn known_hash(&self, path: &Path) -> Option<ContentHash> {
        let line = fs::read_to_string(self.source(path).ok()?).ok()?;
        let (state, hash) = line.trim_end().rsplit_once(' ')?;
        let is_same = state == State::of(path).ok()?.text();
        is_same.then(|| ContentHash::from_str_radix(hash, 16).ok())?
    }

    /// Hashes the content of an image file, and remembers the hash.
    fn hash(&self, path: &Path) -> io::Result<ContentHash> {
        let (state, now) = (State::of(path)?, SystemTime::now());
        let hash = murmur3::murmur3_x64_128(&mut BufReader::with_capacity(1 << 20, File::open(path)?), 0)?;
        if state.is_old(now) {
            let line = format!("{} {hash:032x}\n", state.text());
            // Without it, the file is hashed again
            let _ = self.source(path).and_then(|source| write_text(&source, &line));
        }
        Ok(hash)
    }
}

/// An entry of a cache.
#[derive(Clone)]
struct Entry {
    path: PathBuf,
    request: ImageRequest,
    hash: ContentHash,
}

impl Entry {
    fn new(cache: &TextureCache, request: &ImageRequest, hash: ContentHash) -> Self {
        let ImageRequest { path, channels, encoding, .. } = request;
        // Decoders are chosen by the extension, and may differ between versions
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        let decoder = env!("LUMIRIS_OIIO_VERSION");
        let key = format!("{VERSION} {decoder} {hash:032x} {extension:?} {channels:?} {encoding:?}");
        Entry { path: cache.folder.join(format!("{}.tif", name(key.as_bytes()))), request: request.clone(), hash }
    }

    fn write(&self, map: &MipMap) -> io::Result<()> {
        write_whole(&self.path, |file| {
            let mut out = BufWriter::with_capacity(1 << 20, file);
            write_texture(&mut out, &[map])?;
            out.flush()
        })
    }

    fn is_damaged(&self, reason: &str) -> String {
        let [entry, image] = [&self.path, &self.request.path].map(|path| path.display());
        format!("{entry}: the stored texture is damaged ({reason}), so it is made anew from {image}")
    }

    /// Makes the damaged entry anew.
    fn repair(&self, cache: &TextureCache, reason: &str) -> Result<(), String> {
        cache.warn(self.is_damaged(reason));
        let image = self.request.path.display();
        let hash = cache.hash(&self.request.path).map_err(|error| format!("{image}: {error}"))?;
        if hash != self.hash {
            return Err(format!("{reason}, and {image} has changed meanwhile"));
        }
        let map = ImageFile::open(&self.request.path).and_then(|file| image_map(&file, &self.request));
        let map = map.map_err(|error| error.to_string())?;
        self.write(&map).map_err(|error| format!("{}: {error}", self.path.display()))
    }
}

/// The state of a file: size, and times of modification and change (ns).
struct State {
    bytes: u64,
    times: [i128; 2],
}

impl State {
    fn of(path: &Path) -> io::Result<Self> {
        let metadata = fs::metadata(path)?;
        let time = |seconds: i64, ns: i64| i128::from(seconds) * 1_000_000_000 + i128::from(ns);
        let modified = time(metadata.mtime(), metadata.mtime_nsec());
        Ok(State { bytes: metadata.len(), times: [modified, time(metadata.ctime(), metadata.ctime_nsec())] })
    }

    fn text(&self) -> String {
        let [modified, changed] = self.times;
        format!("{} {modified} {changed}", self.bytes)
    }

    /// True if any later change gives another state.
    fn is_old(&self, now: SystemTime) -> bool {
        let now = now.duration_since(UNIX_EPOCH).map_or(0, |time| time.as_nanos() as i128);
        self.times.iter().all(|time| time + RESOLUTION < now)
    }
}

/// The name of a file for these bytes.
fn name(bytes: &[u8]) -> String {
    format!("{:032x}", murmur3::murmur3_x64_128(&mut Cursor::new(bytes), 0).unwrap_or_default())
}

fn unreadable(request: &ImageRequest, reason: String) -> ImageError {
    ImageError::Unreadable { path: request.path.clone(), reason }
}

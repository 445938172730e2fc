//! Reading of texture files by tiles.

use super::layout::{CHECKSUM, DIRECTORIES, Layout};
use super::write::write_texture;
use crate::imaging::mipmap::{Filter, MipMap, Wrap};
use crate::imaging::texels::{Level, Texels, Tiled};
use crate::imaging::tiles::{TILE, TileStore};
use std::fs::File;
use std::io::{self, ErrorKind};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Makes a damaged file anew; the argument is the reason.
pub type Repair = dyn Fn(&str) -> Result<(), String> + Send + Sync;

/// Where a texture is.
#[derive(Debug)]
enum Place {
    /// A file that is open only while it is read: a scene may have more textures than a process may open files.
    Named(PathBuf),
    /// From a position of a temporary file on.
    Temporary(Arc<File>, u64),
}

impl Place {
    fn read(&self, bytes: &mut [u8], at: u64) -> io::Result<()> {
        match self {
            Place::Named(path) => File::open(path)?.read_exact_at(bytes, at),
            Place::Temporary(file, begin) => file.read_exact_at(bytes, begin + at),
        }
    }
}

/// A pyramid of one or three channels in a file.
pub struct TextureFile {
    place: Place,
    layout: Layout,
    table: Box<[f32; 256]>,
    /// Locked while a damaged file is made anew.
    repair: Option<Mutex<Box<Repair>>>,
}

impl TextureFile {
    /// Opens a file. Returns `None` if there is no such file, and the reason if it is damaged.
    pub fn open(path: &Path) -> Result<Option<Self>, String> {
        let len = match path.metadata() {
            Ok(metadata) => metadata.len(),
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => return Ok(None),
            Err(error) => return Err(error.to_string()),
        };
        let file = Self::at(Place::Named(path.to_owned()))?;
        if len != file.layout.len() {
            return Err(format!("it has {len} bytes instead of {}", file.layout.len()));
        }
        Ok(Some(file))
    }

    fn at(place: Place) -> Result<Self, String> {
        let mut header = [0; DIRECTORIES as usize];
        place.read(&mut header, 0).map_err(|error| error.to_string())?;
        let (layout, table) = Layout::parse(&header).ok_or("its header is wrong")?;
        if !matches!(layout.channels, 1 | 3) {
            return Err(format!("it has {} channels instead of 1 or 3", layout.channels));
        }
        Ok(TextureFile { place, layout, table, repair: None })
    }

    /// The same file, which `repair` makes anew if a tile turns out to be damaged.
    pub fn with_repair(self, repair: Box<Repair>) -> Self {
        TextureFile { repair: Some(Mutex::new(repair)), ..self }
    }

    /// The pyramid, whose levels of more than a tile are read on demand through `store`.
    pub fn map(self, wrap: Wrap, filter: Filter, store: &Arc<TileStore>) -> Result<MipMap, String> {
        let (table, file) = (self.table.clone(), Arc::new(self));
        let levels = (0..file.layout.sizes.len()).map(|level| Self::level(&file, level, store));
        let levels = levels.collect::<Result<_, String>>()?;
        Ok(MipMap { levels, channels: file.layout.channels, wrap, filter, table })
    }

    fn level(file: &Arc<Self>, level: usize, store: &Arc<TileStore>) -> Result<Level, String> {
        let Layout { channels, channel_bytes, .. } = file.layout;
        let ([width, height], first) = (file.layout.sizes[level], file.layout.tiles_before(level));
        let [columns, rows] = file.layout.grid(level);
        if width * height > TILE * TILE {
            let file = Arc::clone(file);
            let tile_bytes = file.layout.tile_bytes();
            let read = Arc::new(move |index| file.tile(first + index));
            let first = store.add_level(columns * rows, tile_bytes, read);
            let tiled = Tiled { store: Arc::clone(store), first, columns, channel_bytes };
            return Ok(Level::new([width, height], Texels::Tiled(tiled)));
        }

        // A level of few pixels can be longer than a tile
        let mut bytes = vec![0; width * height * channels * channel_bytes];
        let [row, tile_row] = [width, TILE].map(|n| n * channels * channel_bytes);
        for index in 0..columns * rows {
            let tile = file.tile(first + index)?;
            let [x, y] = [index % columns * TILE, index / columns * TILE];
            let len = (width - x).min(TILE) * channels * channel_bytes;
            let targets = bytes.chunks_exact_mut(row).skip(y);
            for (target, source) in targets.zip(tile.chunks_exact(tile_row)) {
                target[x * channels * channel_bytes..][..len].copy_from_slice(&source[..len]);
            }
        }
        let texels = match channel_bytes {
            1 => Texels::Bytes(bytes),
            _ => Texels::Floats(bytes.as_chunks().0.iter().map(|word| f32::from_le_bytes(*word)).collect()),
        };
        Ok(Level::new([width, height], texels))
    }

    /// A tile. A damaged file is repaired, if there is a way to do so.
    fn tile(&self, index: usize) -> Result<Vec<u8>, String> {
        let read = self.stored_tile(index);
        match (&self.repair, read) {
            (Some(repair), Err(_)) => {
                let repair = repair.lock().unwrap_or_else(PoisonError::into_inner);
                // Another thread may have repaired it
                self.stored_tile(index).or_else(|reason| {
                    repair(&reason)?;
                    self.stored_tile(index)
                })
            }
            (_, read) => read,
        }
    }

    fn stored_tile(&self, index: usize) -> Result<Vec<u8>, String> {
        let mut bytes = vec![0; self.layout.tile_bytes() + CHECKSUM];
        let failed = |reason: String| match &self.place {
            Place::Named(path) => format!("{}: {reason}", path.display()),
            Place::Temporary(..) => format!("temporary file: {reason}"),
        };
        self.place.read(&mut bytes, self.layout.tile_at(index)).map_err(|error| failed(error.to_string()))?;
        let checksum = bytes.split_off(self.layout.tile_bytes());
        let is_intact = crc32fast::hash(&bytes).to_le_bytes() == checksum[..];
        if is_intact { Ok(bytes) } else { Err(failed("a tile is damaged".to_owned())) }
    }
}

impl std::fmt::Debug for TextureFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("TextureFile").field("place", &self.place).field("layout", &self.layout).finish_non_exhaustive()
    }
}

impl MipMap {
    /// Moves levels of more than a tile into the temporary file of `store`. `Err` if it cannot be written.
    pub fn tiled(self, store: &Arc<TileStore>) -> io::Result<Self> {
        let begin = store.append(|out| write_texture(out, &[&self]))?;
        let place = Place::Temporary(store.temporary(), begin);
        TextureFile::at(place).and_then(|file| file.map(self.wrap, self.filter, store)).map_err(io::Error::other)
    }
}

//! Texels that do not fit into memory, or need not be there: tiles of files, and a bounded cache of recently used
//! tiles.
//!
//! Images without a file of tiles go into a temporary file, which has no name and vanishes with the program. Tiles have
//! the same content as the levels of a pyramid in memory, so lookups give the same values.

use std::cell::RefCell;
use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::FileExt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError, RwLock};

/// Texels along a side of a tile.
pub const TILE: usize = 64;
/// Maximum number of shards of the cache, each with its own lock, and the minimum bytes of a shard: four of the largest
/// tiles.
const SHARDS: u64 = 32;
const SHARD_BYTES: u64 = 4 * (TILE * TILE * 12) as u64;
/// Tiles that each thread can access without a lock, in addition to the cache.
const RECENT: usize = 32;

/// Position of a tile among the bytes of all levels.
type Key = u64;

/// A shard of the cache.
#[derive(Debug, Default)]
struct Shard {
    places: HashMap<Key, usize>,
    tiles: Vec<Slot>,
    /// Clock hand: the next tile to examine when the shard is full.
    hand: usize,
    bytes: u64,
}

#[derive(Debug)]
struct Slot {
    key: Key,
    tile: Arc<[u8]>,
    /// True if the tile was used since the hand passed.
    is_used: bool,
}

impl Shard {
    fn find(&mut self, key: Key) -> Option<Arc<[u8]>> {
        let slot = &mut self.tiles[*self.places.get(&key)?];
        slot.is_used = true;
        Some(Arc::clone(&slot.tile))
    }

    /// Adds a tile, and evicts tiles that were not used recently [the clock algorithm: Corbató 1968]. A tile larger
    /// than the capacity is not kept.
    fn put(&mut self, key: Key, tile: &Arc<[u8]>, capacity: u64) {
        // Tiles that are too large or there already
        let bytes = tile.len() as u64;
        if bytes > capacity || self.places.contains_key(&key) {
            return;
        }

        // Evict others
        while self.bytes + bytes > capacity {
            self.hand %= self.tiles.len();
            if std::mem::take(&mut self.tiles[self.hand].is_used) {
                self.hand += 1;
                continue;
            }
            let out = self.tiles.swap_remove(self.hand);
            self.places.remove(&out.key);
            if let Some(moved) = self.tiles.get(self.hand) {
                self.places.insert(moved.key, self.hand);
            }
            self.bytes -= out.tile.len() as u64;
        }

        // Insert
        self.places.insert(key, self.tiles.len());
        self.tiles.push(Slot { key, tile: Arc::clone(tile), is_used: true });
        self.bytes += bytes;
    }
}

/// Statistics of a store.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TileCounts {
    /// Bytes in the temporary file.
    pub stored: u64,
    /// Tiles read from files.
    pub read: u64,
    /// Bytes of the tiles in the cache.
    pub held: u64,
}

/// Reads a tile of a level by its index.
pub(super) type ReadTile = dyn Fn(usize) -> Result<Vec<u8>, String> + Send + Sync;

/// All levels, by their first keys, and the next unused key.
#[derive(Default)]
struct Levels {
    list: Vec<TileLevel>,
    end: Key,
}

/// The tiles of a level.
#[derive(Clone)]
struct TileLevel {
    begin: Key,
    tile_bytes: usize,
    read: Arc<ReadTile>,
}

impl std::fmt::Debug for Levels {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Levels").field("levels", &self.list.len()).field("end", &self.end).finish()
    }
}

/// Writes to a file from a position on.
struct WriteAt<'a> {
    file: &'a File,
    position: u64,
}

impl Write for WriteAt<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.file.write_at(bytes, self.position)?;
        self.position += count as u64;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Tiles in files, with a cache.
#[derive(Debug)]
pub struct TileStore {
    temporary: Arc<File>,
    /// Bytes in the temporary file.
    end: Mutex<u64>,
    levels: RwLock<Levels>,
    /// Maximum bytes of the cache.
    capacity: u64,
    shards: Vec<Mutex<Shard>>,
    read: AtomicU64,
    failure: OnceLock<String>,
    /// Distinguishes stores.
    id: u64,
}

/// A tile that a thread used recently.
struct Recent {
    of: (u64, Key),
    tile: Arc<[u8]>,
}

thread_local! {
    static RECENTLY: RefCell<Vec<Option<Recent>>> = const { RefCell::new(Vec::new()) };
}

impl TileStore {
    /// A store with a cache of at most `capacity` bytes, in the folder for temporary files (`TMPDIR`).
    pub fn new(capacity: u64) -> io::Result<Self> {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        Ok(TileStore {
            temporary: Arc::new(tempfile::tempfile()?),
            end: Mutex::default(),
            levels: RwLock::default(),
            capacity,
            shards: (0..(capacity / SHARD_BYTES).clamp(1, SHARDS)).map(|_| Mutex::default()).collect(),
            read: AtomicU64::new(0),
            failure: OnceLock::new(),
            id: NEXT.fetch_add(1, Ordering::Relaxed),
        })
    }

    /// Maximum bytes that the cache can take: its limit, or all tiles if they are fewer.
    pub fn capacity(&self) -> u64 {
        self.capacity.min(self.levels.read().unwrap_or_else(PoisonError::into_inner).end)
    }

    /// The temporary file.
    pub(super) fn temporary(&self) -> Arc<File> {
        Arc::clone(&self.temporary)
    }

    /// Appends to the temporary file by `write`. Returns the position where the new bytes begin.
    pub(super) fn append(&self, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<u64> {
        let mut end = self.end.lock().unwrap_or_else(PoisonError::into_inner);
        let mut out = BufWriter::new(WriteAt { file: &self.temporary, position: *end });
        write(&mut out)?;
        out.flush()?;
        Ok(std::mem::replace(&mut *end, out.get_ref().position))
    }

    /// Adds a level with `tiles` tiles of `tile_bytes` each, which `read` reads on demand. Returns the key of the first
    /// tile.
    pub(super) fn add_level(&self, tiles: usize, tile_bytes: usize, read: Arc<ReadTile>) -> Key {
        let mut levels = self.levels.write().unwrap_or_else(PoisonError::into_inner);
        let begin = levels.end;
        levels.end += (tiles * tile_bytes) as u64;
        levels.list.push(TileLevel { begin, tile_bytes, read });
        begin
    }

    /// Calls `read` with the `len` bytes of the tile `key`. If a file cannot be read, they are zeros, and
    /// [`failure`](Self::failure) returns the reason.
    #[inline]
    pub fn with_tile<T>(&self, key: u64, len: usize, read: impl FnOnce(&[u8]) -> T) -> T {
        RECENTLY.with_borrow_mut(|recently| {
            if recently.is_empty() {
                recently.resize_with(RECENT, || None);
            }
            let place = (key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32) as usize % RECENT;
            if let Some(recent) = &recently[place]
                && recent.of == (self.id, key)
            {
                return read(&recent.tile);
            }
            let recent = recently[place].insert(Recent { of: (self.id, key), tile: self.fetch(key, len) });
            read(&recent.tile)
        })
    }

    /// A tile from the cache, or else from its file.
    fn fetch(&self, key: u64, len: usize) -> Arc<[u8]> {
        let shard = (key.wrapping_mul(0xd134_2543_de82_ef95) >> 40) as usize % self.shards.len();
        let shard = || self.shards[shard].lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(tile) = shard().find(key) {
            return tile;
        }
        // Without the lock, so that others need not wait for the disk
        let bytes = self.read(key).unwrap_or_else(|reason| {
            self.failure.get_or_init(|| reason);
            vec![0; len]
        });
        self.read.fetch_add(1, Ordering::Relaxed);
        let tile: Arc<[u8]> = bytes.into();
        shard().put(key, &tile, self.capacity / self.shards.len() as u64);
        tile
    }

    /// A tile from its file.
    fn read(&self, key: Key) -> Result<Vec<u8>, String> {
        let level = {
            let levels = self.levels.read().unwrap_or_else(PoisonError::into_inner);
            let after = levels.list.partition_point(|level| level.begin <= key);
            levels.list[after - 1].clone()
        };
        (level.read)((key - level.begin) as usize / level.tile_bytes)
            .map_err(|reason| format!("texels could not be read: {reason}"))
    }

    /// Truncates the temporary file, to simulate a failing disk.
    #[cfg(test)]
    pub(crate) fn lose(&self, len: u64) {
        self.temporary.set_len(len).unwrap();
    }

    /// Reason why lookups returned zeros instead of texels, if they did.
    pub fn failure(&self) -> Option<&str> {
        self.failure.get().map(String::as_str)
    }

    /// Statistics.
    pub fn counts(&self) -> TileCounts {
        let held = |shard: &Mutex<Shard>| shard.lock().unwrap_or_else(PoisonError::into_inner).bytes;
        TileCounts {
            stored: *self.end.lock().unwrap_or_else(PoisonError::into_inner),
            read: self.read.load(Ordering::Relaxed),
            held: self.shards.iter().map(held).sum(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEN: usize = 1000;

    fn store(tiles: u64, capacity: u64) -> TileStore {
        let store = TileStore::new(capacity).unwrap();
        assert_eq!(store.add_level(tiles as usize, LEN, Arc::new(|i| Ok(vec![(i % 251) as u8; LEN]))), 0);
        store
    }

    #[test]
    fn every_tile_is_found_by_all_threads_and_the_cache_stays_within_its_bounds() {
        // Several shards, each with tiles to evict
        let capacity = 3 * SHARD_BYTES;
        let store = store(1000, capacity);
        assert_eq!(store.shards.len(), 3);
        std::thread::scope(|scope| {
            for thread in 0..4 {
                let store = &store;
                scope.spawn(move || {
                    for k in 0..20_000_u64 {
                        let i = (((k + thread) * 0x9e37_79b9) >> 13) % 1000;
                        store.with_tile(i * LEN as u64, LEN, |tile| {
                            assert!(tile.len() == LEN && tile.iter().all(|&b| b == (i % 251) as u8));
                        });
                        if k % 1000 == 0 {
                            assert!(store.counts().held <= capacity);
                        }
                    }
                });
            }
        });
        let counts = store.counts();
        assert!(counts.held > capacity / 2 && counts.held <= capacity, "{counts:?}");
        assert!(counts.read > 1000 && store.failure().is_none());
    }

    #[test]
    fn a_small_cache_holds_the_largest_tiles_as_well() {
        let len = TILE * TILE * 12;
        let store = TileStore::new(2 * len as u64).unwrap();
        let keys = [1, 2].map(|value| store.add_level(1, len, Arc::new(move |_| Ok(vec![value; len]))));
        keys.iter().for_each(|&key| drop(store.fetch(key, len)));
        assert_eq!(store.counts(), TileCounts { stored: 0, read: 2, held: 2 * len as u64 });
        keys.iter().for_each(|&key| drop(store.fetch(key, len)));
        assert_eq!(store.counts().read, 2);
    }

    #[test]
    fn what_fits_is_read_once() {
        let store = store(100, 1 << 20);
        for k in 0..10_000_u64 {
            store.with_tile(k % 100 * LEN as u64, LEN, |tile| assert_eq!(tile[0], (k % 100) as u8));
        }
        assert_eq!(store.counts(), TileCounts { stored: 0, read: 100, held: 100_000 });
    }

    #[test]
    fn what_cannot_be_read_is_zero_and_reported() {
        let store = TileStore::new(1 << 20).unwrap();
        let read = |i| if i < 2 { Ok(vec![7; LEN]) } else { Err("disk lost".to_owned()) };
        store.add_level(3, LEN, Arc::new(read));
        assert!(store.with_tile(1000, LEN, |tile| tile.iter().all(|&b| b == 7)) && store.failure().is_none());
        assert!(store.with_tile(2000, LEN, |tile| tile.iter().all(|&b| b == 0)));
        assert!(store.failure().unwrap().contains("disk lost"));
    }

    #[test]
    fn what_is_appended_begins_where_the_last_complete_append_ended() {
        let store = TileStore::new(1 << 20).unwrap();
        let begins = [3, 5].map(|len| store.append(|out| out.write_all(&vec![len; usize::from(len)])).unwrap());
        assert_eq!(begins, [0, 3]);
        let failed = store.append(|out| out.write_all(&[9; 100_000]).and(Err(io::Error::other("no"))));
        assert!(failed.is_err());
        let begin = store.append(|out| out.write_all(b"x")).unwrap();
        let mut byte = [0];
        store.temporary().read_exact_at(&mut byte, begin).unwrap();
        assert_eq!((begin, byte), (8, *b"x"));
    }
}

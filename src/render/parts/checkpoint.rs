//! Stores the sums of a rendering at intervals.
//!
//! The rendering pauses while all threads encode and write. Another thread then waits for the disk and renames the
//! file. From the first checkpoint on there is always a complete one. If writing takes more than 1 % of the interval,
//! checkpoints become less frequent.

use super::file::write_tiles;
use super::header::FilmHeader;
use super::partial::Partial;
use crate::render::tiles::Tiles;
use std::io;
use std::path::PathBuf;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Minimum interval between checkpoints, as a multiple of the time that writing one takes.
const REST: u32 = 100;

/// Minimum interval before the first tile is done.
const SHORTEST: Duration = Duration::from_millis(50);
/// Maximum interval (ten years): adding the interval to an `Instant` must not overflow.
const LONGEST: Duration = Duration::from_secs(315_360_000);

/// Stores checkpoints of one rendering.
pub struct Checkpoints {
    path: PathBuf,
    interval: Duration,
    header: FilmHeader,
    warn: Box<dyn Fn(&str) + Send + Sync>,
    due: Instant,
    /// The checkpoint that is being written to the disk.
    under_way: Option<JoinHandle<io::Result<()>>>,
    /// Time that the rendering spent waiting for checkpoints.
    pub waited: Duration,
    /// Number of checkpoints on the disk.
    pub stored: u32,
    has_warned: bool,
}

impl Checkpoints {
    /// Writes checkpoints to a path, every `interval` from now on. `warn` receives the first error.
    pub fn new(
        path: PathBuf,
        interval: Duration,
        header: FilmHeader,
        warn: impl Fn(&str) + Send + Sync + 'static,
    ) -> Self {
        let interval = interval.min(LONGEST);
        let due = Instant::now() + interval;
        Checkpoints {
            path,
            interval,
            header,
            warn: Box::new(warn),
            due,
            // Nothing is written yet
            under_way: None,
            waited: Duration::ZERO,
            stored: 0,
            has_warned: false,
        }
    }

    /// Time of the next checkpoint.
    pub(in crate::render) fn due(&self) -> Instant {
        self.due
    }

    /// Stores the sums so far. Does nothing if there are none yet or the previous checkpoint is still being written.
    pub(in crate::render) fn store(&mut self, tiles: &Tiles) {
        let start = Instant::now();
        if tiles.cells.is_empty() && tiles.tiles.iter().all(|t| t.done <= self.header.samples.start) {
            self.due = start + self.interval.max(SHORTEST);
            return;
        }
        let is_busy = self.under_way.as_ref().is_some_and(|thread| !thread.is_finished());
        if !is_busy {
            self.await_disk();
            self.write(tiles);
        }
        let waited = start.elapsed();
        self.waited += waited;
        self.due = Instant::now() + self.interval.max(waited * REST);
    }

    /// Stores the sums at the end of the rendering, and waits for the disk.
    pub(in crate::render) fn finish(&mut self, tiles: &Tiles) {
        self.await_disk();
        self.write(tiles);
        self.await_disk();
    }

    fn write(&mut self, tiles: &Tiles) {
        self.header.is_finished = tiles.tiles.iter().all(|t| t.done >= self.header.samples.end);
        match Partial::write(&self.path, |file| write_tiles(file, &self.header, tiles)) {
            Ok(partial) => {
                let to_disk = move || partial.end();
                match std::thread::Builder::new().name("checkpoint".to_owned()).spawn(to_disk) {
                    Ok(thread) => self.under_way = Some(thread),
                    Err(error) => self.report(Err(error)),
                }
            }
            Err(error) => self.report(Err(error)),
        }
    }

    /// Waits until the checkpoint in progress is on the disk.
    fn await_disk(&mut self) {
        if let Some(thread) = self.under_way.take() {
            let written = thread.join().unwrap_or_else(|_| Err(io::Error::other("its thread ended early")));
            self.report(written);
        }
    }

    fn report(&mut self, written: io::Result<()>) {
        match written {
            Ok(()) => self.stored += 1,
            Err(error) => {
                if !std::mem::replace(&mut self.has_warned, true) {
                    let stays = if self.stored > 0 { "; the last one stays" } else { "" };
                    let path = self.path.display();
                    (self.warn)(&format!("warning: the checkpoint {path} cannot be written: {error}{stays}"));
                }
            }
        }
    }
}

impl Drop for Checkpoints {
    fn drop(&mut self) {
        self.await_disk();
    }
}

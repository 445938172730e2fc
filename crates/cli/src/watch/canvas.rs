//! The pixels of an image as they are by now.
//!
//! Threads that render leave the packed sums of their tiles, which they share and do not copy. Pixels are made of them when
//! somebody asks, by the thread that asks: of what has changed since, and rarely enough to take at most a hundredth of the
//! machine.

use lumiris::film::{Film, FilmTile, PixelBounds};
use lumiris::imaging::{Layer, layers};
use lumiris::render::Progress;
use lumiris::render::output::{Aov, Layers, channels, live_aovs};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Time of all processors for each second that one of them makes pixels.
const REST: u32 = 100;

/// The pixels of a tile.
#[derive(Clone, Debug)]
pub(crate) struct Tile {
    /// Left, top, width and height inside the crop window (pixels).
    pub place: [u32; 4],
    /// All channels, interleaved.
    pub data: Vec<f32>,
}

/// What there is of a tile.
#[derive(Clone, Debug)]
enum Content {
    Sums(FilmTile),
    Pixels(PixelBounds, Vec<f32>),
}

#[derive(Debug)]
struct State {
    version: u64,
    /// With the state of the canvas from which on they are like this; by left and top.
    tiles: BTreeMap<[u32; 2], (u64, Content)>,
    progress: Option<Progress>,
    /// When pixels may be made again.
    rests_until: Instant,
}

/// See the module.
#[derive(Debug)]
pub(crate) struct Canvas {
    /// Name of the image.
    pub name: String,
    /// Width and height of the crop window (pixels).
    pub size: [u32; 2],
    /// Names of the channels.
    pub channels: Vec<String>,
    /// Layers in the order of the channels.
    pub layers: Vec<Layer>,
    bounds: PixelBounds,
    aovs: Vec<Aov>,
    /// Time of one processor for each second that it makes pixels.
    rest: u32,
    state: Mutex<State>,
    is_finished: AtomicBool,
}

impl Canvas {
    pub(super) fn new(name: &str, bounds: PixelBounds, has_features: bool) -> Self {
        let aovs = live_aovs(has_features);
        let empty = Film::new([0, 0], PixelBounds { x0: 0, x1: 0, y0: 0, y1: 0 }, Vec::new(), Vec::new());
        let channels = Layers::new(&empty, true, &aovs, None).names();
        let layers = layers(&channels);
        let processors = std::thread::available_parallelism().map_or(1, |n| u32::try_from(n.get()).unwrap_or(REST));
        let state = State { version: 0, tiles: BTreeMap::new(), progress: None, rests_until: Instant::now() };
        Canvas {
            name: name.to_owned(),
            size: [bounds.width(), bounds.height()],
            channels,
            layers,
            bounds,
            aovs,
            rest: REST / processors.min(REST),
            state: Mutex::new(state),
            is_finished: AtomicBool::new(false),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes the film of a tile, whose sums it shares.
    pub(crate) fn set_tile(&self, film: &Film) {
        film.tiles().iter().for_each(|tile| self.set(&tile.bounds, Content::Sums(tile.clone())));
    }

    fn set(&self, b: &PixelBounds, content: Content) {
        let mut state = self.state();
        state.version += 1;
        let version = state.version;
        state.tiles.insert([b.x0, b.y0], (version, content));
    }

    pub(super) fn set_progress(&self, progress: &Progress) {
        self.state().progress = Some(*progress);
    }

    pub(super) fn progress(&self) -> Option<Progress> {
        self.state().progress
    }

    /// Takes the whole film, which the end of a rendering may have corrected: no tile will change any more.
    pub(crate) fn finish(&self, film: &Film) {
        if film.is_corrected() {
            self.set_pixels(film);
        } else {
            let is_known = |tile: &FilmTile| match self.state().tiles.get(&[tile.bounds.x0, tile.bounds.y0]) {
                Some((_, Content::Sums(known))) => Arc::ptr_eq(&known.sums, &tile.sums),
                Some((_, Content::Pixels(..))) | None => false,
            };
            let new = film.tiles().iter().filter(|tile| !is_known(tile));
            new.for_each(|tile| self.set(&tile.bounds, Content::Sums(tile.clone())));
        }
        self.is_finished.store(true, Ordering::Release);
    }

    /// Takes the pixels of a film, which are not those of its sums.
    fn set_pixels(&self, film: &Film) {
        let layers = Layers::new(film, true, &self.aovs, None);
        let row = film.bounds.width() as usize * self.channels.len();
        for tiles in film.tiles().chunk_by(|a, b| (a.bounds.y0, a.bounds.y1) == (b.bounds.y0, b.bounds.y1)) {
            let rows = layers.rows_in_parallel(tiles[0].bounds.y0..tiles[0].bounds.y1);
            for b in tiles.iter().map(|tile| tile.bounds) {
                let columns = [b.x0, b.x1].map(|x| (x - film.bounds.x0) as usize * self.channels.len());
                let pixels = rows.chunks(row).flat_map(|row| &row[columns[0]..columns[1]]).copied().collect();
                self.set(&b, Content::Pixels(b, pixels));
            }
        }
    }

    pub(super) fn is_finished(&self) -> bool {
        self.is_finished.load(Ordering::Acquire)
    }

    /// The tiles that have changed since a state, and the state that they are of. None, and the former state, if it is too soon
    /// to ask again.
    pub(super) fn changed_since(&self, version: u64) -> (u64, Vec<Tile>) {
        let is_finished = self.is_finished();
        let (present, changed) = {
            let state = self.state();
            if !is_finished && Instant::now() < state.rests_until {
                return (version, Vec::new());
            }
            let changed = state.tiles.values().filter(|(of, _)| *of > version).map(|(_, content)| content.clone());
            (state.version, changed.collect::<Vec<_>>())
        };
        let start = Instant::now();
        let tiles = changed.into_iter().map(|content| self.tile(content)).collect();
        self.state().rests_until = Instant::now() + start.elapsed().min(Duration::from_secs(60)) * self.rest;
        (present, tiles)
    }

    /// The pixels of a tile.
    fn tile(&self, content: Content) -> Tile {
        let (b, data) = match content {
            Content::Pixels(bounds, pixels) => (bounds, pixels),
            Content::Sums(tile) => {
                let bounds = tile.bounds;
                let film = Film::new([bounds.x1, bounds.y1], bounds, vec![tile], Vec::new());
                (bounds, channels(&film, &self.aovs, None).data)
            }
        };
        Tile { place: [b.x0 - self.bounds.x0, b.y0 - self.bounds.y0, b.width(), b.height()], data }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris::film::accumulator::PixelAccumulator;

    #[test]
    fn only_what_changed_is_handed_out() {
        let bounds = PixelBounds { x0: 10, x1: 30, y0: 5, y1: 15 };
        let canvas = Canvas::new("a", bounds, true);
        let names: Vec<_> = canvas.layers.iter().map(|l| (l.name.as_str(), l.channels.len())).collect();
        assert_eq!(names, [("beauty", 3), ("albedo", 3), ("normal", 3), ("depth", 1), ("samples", 1)]);
        assert_eq!(Canvas::new("a", bounds, false).layers.len(), 2);

        let tiles = bounds.tiles(16);
        // Numbers of samples of some pixels; 0 of all others
        let film = |tile: PixelBounds, counts: &[(usize, u32)]| {
            let mut pixels = vec![PixelAccumulator::default(); tile.area()];
            counts.iter().for_each(|&(i, count)| pixels[i].radiance.count = count);
            Film::of_pixels([100, 100], tile, &pixels)
        };
        let soon = |canvas: &Canvas| canvas.state().rests_until = Instant::now();
        assert_eq!(canvas.changed_since(0).1.len(), 0);
        let films: Vec<Film> = tiles.iter().map(|&tile| film(tile, &[])).collect();
        films.iter().for_each(|film| canvas.set_tile(film));
        soon(&canvas);
        let (state, changed) = canvas.changed_since(0);
        assert_eq!(changed.iter().map(|t| t.place).collect::<Vec<_>>(), [[0, 0, 16, 10], [16, 0, 4, 10]]);
        assert_eq!(changed[1].data.len(), 40 * canvas.channels.len());
        assert_eq!(canvas.changed_since(state).1.len(), 0);
        let second = film(tiles[1], &[(3, 5)]);
        canvas.set_tile(&second);
        // Too soon after what took long
        canvas.state().rests_until = Instant::now() + Duration::from_secs(600);
        assert_eq!((canvas.changed_since(state).0, canvas.changed_since(state).1.len()), (state, 0));
        soon(&canvas);
        let places = |changed: Vec<Tile>| changed.iter().map(|t| t.place).collect::<Vec<_>>();
        let (now, changed) = canvas.changed_since(state);
        assert_eq!(places(changed), [[16, 0, 4, 10]]);

        // The end changes the first tile only, and is told at once
        let whole = [film(tiles[0], &[(0, 1)]), second].map(|film| film.tiles()[0].clone());
        canvas.state().rests_until = Instant::now() + Duration::from_secs(600);
        let mut whole = Film::new([100, 100], bounds, whole.to_vec(), Vec::new());
        canvas.finish(&whole);
        assert!(canvas.is_finished());
        let (state, changed) = canvas.changed_since(now);
        assert_eq!(places(changed), [[0, 0, 16, 10]]);

        // Pixels that are corrected are not those of the sums
        whole.correct(vec![[-2.0, 0.0, 0.0]; bounds.area()], Vec::new());
        canvas.finish(&whole);
        let (_, changed) = canvas.changed_since(state);
        assert_eq!(changed.len(), 2);
        assert!(changed.iter().any(|tile| tile.data.contains(&2.0)));
    }
}

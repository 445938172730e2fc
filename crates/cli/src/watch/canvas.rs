//! The pixels of an image as they are by now.

use lumiris::film::{Film, PixelBounds};
use lumiris::imaging::{Layer, layers};
use lumiris::render::Progress;
use lumiris::render::output::{Aov, Layers, channels, live_aovs};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The pixels of a tile.
#[derive(Clone, Debug)]
pub(crate) struct Tile {
    /// Left, top, width and height inside the crop window (pixels).
    pub place: [u32; 4],
    /// All channels, interleaved.
    pub data: Vec<f32>,
    /// The state of the canvas from which on it is like this.
    version: u64,
}

#[derive(Debug, Default)]
struct State {
    version: u64,
    /// By left and top.
    tiles: BTreeMap<[u32; 2], Tile>,
    progress: Option<Progress>,
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
    state: Mutex<State>,
    is_finished: AtomicBool,
}

impl Canvas {
    pub(super) fn new(name: &str, bounds: PixelBounds, has_features: bool) -> Self {
        let aovs = live_aovs(has_features);
        let empty = Film::new([0, 0], PixelBounds { x0: 0, x1: 0, y0: 0, y1: 0 }, Vec::new(), Vec::new());
        let channels = Layers::new(&empty, true, &aovs, None).names();
        let layers = layers(&channels);
        Canvas {
            name: name.to_owned(),
            size: [bounds.width(), bounds.height()],
            channels,
            layers,
            bounds,
            aovs,
            state: Mutex::default(),
            is_finished: AtomicBool::new(false),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes the film of a tile.
    pub(crate) fn set_tile(&self, film: &Film) {
        let data = channels(film, &self.aovs, None).data;
        self.set(&film.bounds, data);
    }

    fn set(&self, b: &PixelBounds, data: Vec<f32>) {
        let place = [b.x0 - self.bounds.x0, b.y0 - self.bounds.y0, b.width(), b.height()];
        let mut state = self.state();
        if state.tiles.get(&[place[0], place[1]]).is_some_and(|tile| tile.data == data) {
            return;
        }
        state.version += 1;
        let version = state.version;
        state.tiles.insert([place[0], place[1]], Tile { place, data, version });
    }

    pub(super) fn set_progress(&self, progress: &Progress) {
        self.state().progress = Some(*progress);
    }

    pub(super) fn progress(&self) -> Option<Progress> {
        self.state().progress
    }

    /// Takes the whole film, which the end of a rendering may have corrected: no tile will change any more.
    pub(crate) fn finish(&self, film: &Film, tile_size: u32) {
        let layers = Layers::new(film, true, &self.aovs, None);
        let tiles = film.bounds.tiles(tile_size);
        for tiles in tiles.chunk_by(|a, b| a.y0 == b.y0) {
            let rows = layers.rows_in_parallel(tiles[0].y0..tiles[0].y1);
            for tile in tiles {
                let columns = [tile.x0, tile.x1].map(|x| (x - film.bounds.x0) as usize * self.channels.len());
                let rows = rows.chunks(film.bounds.width() as usize * self.channels.len());
                self.set(tile, rows.flat_map(|row| &row[columns[0]..columns[1]]).copied().collect());
            }
        }
        self.is_finished.store(true, Ordering::Release);
    }

    pub(super) fn is_finished(&self) -> bool {
        self.is_finished.load(Ordering::Acquire)
    }

    /// The tiles that have changed since a state, and the state that they are of.
    pub(super) fn changed_since(&self, version: u64) -> (u64, Vec<Tile>) {
        let state = self.state();
        (state.version, state.tiles.values().filter(|tile| tile.version > version).cloned().collect())
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
        assert_eq!(canvas.changed_since(0).1.len(), 0);
        tiles.iter().for_each(|&tile| canvas.set_tile(&film(tile, &[])));
        let (state, changed) = canvas.changed_since(0);
        assert_eq!(changed.iter().map(|t| t.place).collect::<Vec<_>>(), [[0, 0, 16, 10], [16, 0, 4, 10]]);
        assert_eq!(changed[1].data.len(), 40 * canvas.channels.len());
        assert_eq!(canvas.changed_since(state).1.len(), 0);
        canvas.set_tile(&film(tiles[1], &[(3, 5)]));
        let places = |changed: Vec<Tile>| changed.iter().map(|t| t.place).collect::<Vec<_>>();
        assert_eq!(places(canvas.changed_since(state).1), [[16, 0, 4, 10]]);

        // The end changes the first tile only
        let (state, _) = canvas.changed_since(0);
        canvas.finish(&film(bounds, &[(0, 1), (19, 5)]), 16);
        assert_eq!(places(canvas.changed_since(state).1), [[0, 0, 16, 10]]);
        assert!(canvas.is_finished());
    }
}

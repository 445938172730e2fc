//! The current pixels of an image.
//!
//! Render threads store the packed sums of their tiles, which are shared, not copied. A thread that requests pixels
//! computes them itself: only of changed tiles, and of a few tiles at once.

use lumiris::film::{Film, FilmTile, PixelBounds};
use lumiris::imaging::{Layer, layers};
use lumiris::render::Progress;
use lumiris::render::output::{Aov, Layers, live_aovs};
use std::collections::{BTreeMap, HashMap};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

/// Maximum number of pixels returned at once: less than a megabyte, for tiles of any size. At least one row of a tile
/// is returned.
const AT_ONCE: usize = 1 << 14;

/// Pixels of a tile or of some of its rows.
#[derive(Clone, Debug)]
pub(crate) struct Tile {
    /// Left, top, width and height in the crop window (pixels).
    pub place: [u32; 4],
    /// All channels, interleaved.
    pub data: Vec<f32>,
}

/// Content of some rows of a tile.
#[derive(Clone, Debug)]
enum Content {
    /// Sums of the tile.
    Sums(FilmTile),
    /// All channels of the rows, interleaved.
    Pixels(Arc<[f32]>),
}

/// Some rows of a tile.
#[derive(Clone, Debug)]
struct Band {
    bounds: PixelBounds,
    content: Content,
}

#[derive(Debug, Default)]
struct State {
    /// Number of changes so far.
    version: u64,
    /// Bands by the version of their last change.
    bands: BTreeMap<u64, Band>,
    /// Keys of `bands`, by left and top of the band.
    versions: HashMap<[u32; 2], u64>,
    progress: Option<Progress>,
}

/// The current pixels of an image; see the module.
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
    /// Description of the render settings, once they are chosen.
    pub summary: OnceLock<String>,
}

/// Changes since a state.
pub(super) struct Changes<T> {
    /// The state that they lead to.
    pub reached: u64,
    /// The tiles.
    pub changed: Vec<T>,
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
            summary: OnceLock::new(),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Stores the tiles of a film. Their sums are shared.
    pub(crate) fn set_tile(&self, film: &Film) {
        film.tiles().iter().for_each(|tile| self.set(tile));
    }

    fn set(&self, tile: &FilmTile) {
        for band in bands(&tile.bounds) {
            self.state().set(band, Content::Sums(tile.clone()));
        }
    }

    pub(super) fn set_progress(&self, progress: &Progress) {
        self.state().progress = Some(*progress);
    }

    pub(super) fn progress(&self) -> Option<Progress> {
        self.state().progress
    }

    /// Stores the final film, which may have been corrected at the end. No tile changes afterwards.
    pub(crate) fn finish(&self, film: &Film) {
        if film.is_corrected() {
            self.set_pixels(film);
        } else {
            let is_known = |tile: &FilmTile| match self.state().content([tile.bounds.x0, tile.bounds.y0]) {
                Some(Content::Sums(known)) => Arc::ptr_eq(&known.sums, &tile.sums),
                Some(Content::Pixels(_)) | None => false,
            };
            film.tiles().iter().filter(|tile| !is_known(tile)).for_each(|tile| self.set(tile));
        }
        self.is_finished.store(true, Ordering::Release);
    }

    /// Stores the pixels of a corrected film, which differ from its sums.
    fn set_pixels(&self, film: &Film) {
        let layers = Layers::new(film, true, &self.aovs, None);
        let row = film.bounds.width() as usize * self.channels.len();
        for tiles in film.tiles().chunk_by(|a, b| (a.bounds.y0, a.bounds.y1) == (b.bounds.y0, b.bounds.y1)) {
            let top = tiles[0].bounds.y0;
            let rows = layers.rows_in_parallel(top..tiles[0].bounds.y1);
            for b in tiles.iter().flat_map(|tile| bands(&tile.bounds)) {
                let columns = [b.x0, b.x1].map(|x| (x - film.bounds.x0) as usize * self.channels.len());
                let rows = rows.chunks(row).skip((b.y0 - top) as usize).take(b.height() as usize);
                let pixels = rows.flat_map(|row| &row[columns[0]..columns[1]]).copied().collect();
                self.state().set(b, Content::Pixels(pixels));
            }
        }
    }

    pub(super) fn is_finished(&self) -> bool {
        self.is_finished.load(Ordering::Acquire)
    }

    /// Number of changes so far. It identifies the state of the canvas.
    pub(super) fn version(&self) -> u64 {
        self.state().version
    }

    /// Tiles that have changed since the state `version`, in the order of their changes. There may be more changes
    /// unless the list is empty.
    pub(super) fn changed_since(&self, version: u64) -> Changes<Tile> {
        let Changes { reached, changed } = self.state().changed_since(version);
        let tiles = changed.into_iter().map(|band| self.tile(band.bounds, band.content));
        Changes { reached, changed: tiles.collect() }
    }

    /// The pixels of a band.
    fn tile(&self, b: PixelBounds, content: Content) -> Tile {
        let data = match content {
            Content::Pixels(pixels) => pixels.to_vec(),
            Content::Sums(tile) => {
                let bounds = tile.bounds;
                let film = Film::new([bounds.x1, bounds.y1], bounds, vec![tile], Vec::new());
                Layers::new(&film, true, &self.aovs, None).rows(b.y0..b.y1)
            }
        };
        Tile { place: [b.x0 - self.bounds.x0, b.y0 - self.bounds.y0, b.width(), b.height()], data }
    }
}

impl State {
    fn set(&mut self, bounds: PixelBounds, content: Content) {
        self.version += 1;
        if let Some(former) = self.versions.insert([bounds.x0, bounds.y0], self.version) {
            self.bands.remove(&former);
        }
        self.bands.insert(self.version, Band { bounds, content });
    }

    /// The content of the band with this top left corner.
    fn content(&self, corner: [u32; 2]) -> Option<&Content> {
        self.bands.get(self.versions.get(&corner)?).map(|band| &band.content)
    }

    /// Bands that have changed; see [`Canvas::changed_since`].
    fn changed_since(&self, version: u64) -> Changes<Band> {
        let (mut reached, mut changed, mut pixels) = (self.version, Vec::new(), 0);
        for (&version, band) in self.bands.range(version.saturating_add(1)..) {
            pixels += band.bounds.area();
            if pixels > AT_ONCE && !changed.is_empty() {
                break;
            }
            changed.push(band.clone());
            reached = version;
        }
        Changes { reached, changed }
    }
}

/// Splits a tile into bands of at most [`AT_ONCE`] pixels, or of one row.
fn bands(tile: &PixelBounds) -> impl Iterator<Item = PixelBounds> {
    let (tile, height) = (*tile, (AT_ONCE as u32 / tile.width().max(1)).max(1));
    let tops = (tile.y0..tile.y1).step_by(height as usize);
    tops.map(move |y0| PixelBounds { y0, y1: tile.y1.min(y0 + height), ..tile })
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
        // Sample counts of some pixels; 0 elsewhere
        let film = |tile: PixelBounds, counts: &[(usize, u32)]| {
            let mut pixels = vec![PixelAccumulator::default(); tile.area()];
            counts.iter().for_each(|&(i, count)| pixels[i].radiance.count = count);
            Film::of_pixels([100, 100], tile, &pixels)
        };
        assert_eq!(canvas.changed_since(0).changed.len(), 0);
        let films: Vec<Film> = tiles.iter().map(|&tile| film(tile, &[])).collect();
        films.iter().for_each(|film| canvas.set_tile(film));
        let Changes { reached: state, changed } = canvas.changed_since(0);
        assert_eq!(changed.iter().map(|t| t.place).collect::<Vec<_>>(), [[0, 0, 16, 10], [16, 0, 4, 10]]);
        assert_eq!(changed[1].data.len(), 40 * canvas.channels.len());
        assert_eq!(canvas.changed_since(state).changed.len(), 0);
        let second = film(tiles[1], &[(3, 5)]);
        canvas.set_tile(&second);
        let places = |changed: Vec<Tile>| changed.iter().map(|t| t.place).collect::<Vec<_>>();
        let Changes { reached: now, changed } = canvas.changed_since(state);
        assert_eq!(places(changed), [[16, 0, 4, 10]]);

        // The end of the rendering changes only the first tile
        let whole = [film(tiles[0], &[(0, 1)]), second].map(|film| film.tiles()[0].clone());
        let mut whole = Film::new([100, 100], bounds, whole.to_vec(), Vec::new());
        canvas.finish(&whole);
        assert!(canvas.is_finished());
        let Changes { reached: state, changed } = canvas.changed_since(now);
        assert_eq!(places(changed), [[0, 0, 16, 10]]);

        // Corrected pixels differ from the sums
        whole.correct(vec![[-2.0, 0.0, 0.0]; bounds.area()], Vec::new());
        canvas.finish(&whole);
        let Changes { changed, .. } = canvas.changed_since(state);
        assert_eq!(changed.len(), 2);
        assert!(changed.iter().any(|tile| tile.data.contains(&2.0)));
    }

    #[test]
    fn however_large_tiles_are_few_pixels_are_handed_out_at_once() {
        // Sample counts identify the pixels
        let (width, height) = (1000_u32, 70_u32);
        let bounds = PixelBounds { x0: 3, x1: 3 + width, y0: 5, y1: 5 + height };
        let canvas = Canvas::new("a", bounds, false);
        let mut pixels = vec![PixelAccumulator::default(); bounds.area()];
        pixels.iter_mut().zip(0..).for_each(|(pixel, i)| pixel.radiance.count = i);
        let mut film = Film::of_pixels([2000, 100], bounds, &pixels);

        // One canvas of sums, and one of corrected pixels
        canvas.set_tile(&film);
        film.correct(vec![[0.0; 3]; bounds.area()], Vec::new());
        let corrected = Canvas::new("a", bounds, false);
        corrected.finish(&film);

        // Fetch everything in steps
        for canvas in [canvas, corrected] {
            let (mut counts, mut state) = (vec![f32::NAN; bounds.area()], 0);
            while state < canvas.version() {
                let Changes { reached, changed: tiles } = canvas.changed_since(state);
                let handed_out: u32 = tiles.iter().map(|tile| tile.place[2] * tile.place[3]).sum();
                assert!((1..=AT_ONCE as u32).contains(&handed_out) && reached > state, "{handed_out}");
                for Tile { place: [left, top, columns, rows], data } in tiles {
                    assert_eq!((left, columns), (0, width));
                    let first = (top * width) as usize;
                    for (count, pixel) in counts[first..][..(columns * rows) as usize].iter_mut().zip(data.chunks(4)) {
                        *count = pixel[3];
                    }
                }
                state = reached;
            }
            assert!(counts.iter().zip(0..).all(|(&count, i)| count == i as f32));
        }
    }
}

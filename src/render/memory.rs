//! Memory that an image takes, predicted before it is rendered.
//!
//! A packed pixel takes the bits in which it differs from its neighbours, which only its samples tell. The figures here
//! are those of one scene at 1 sample (docs/measurements/memory.md). How they grow with samples is
//! an estimate: a sum needs one more binary digit for twice as many.

use super::control_variates::ROWS;
use super::cryptomatte::Cryptomatte;
use super::tiles::replica_choice;
use super::{RenderSettings, thread_pool};
use crate::direct::Estimator;
use crate::film::BAND;
use crate::imaging::oiio::{ROWS_AT_ONCE, is_loaded};
use crate::integrators::light_layers;
use crate::scene::RenderJob;
use lumiris_numbers::estimators::ocv::pixels::MARGIN;

/// Bytes of a pixel with one sample: radiance and its squares, counts.
const IMAGE: f64 = 38.0;
/// Bytes of albedo, normal, depth and indices.
const FEATURES: f64 = 17.0;
/// Binary digits that twice as many samples add to both.
const DIGITS: [f64; 2] = [9.0, 9.0];
/// Bytes of the replicas of a pixel, of which there are few: exact sums, and numbers.
const REPLICAS: f64 = 4.0;
/// Bytes of a tile besides its sums, by pixel.
const TILE: f64 = 2.0;
/// Bytes of a Cryptomatte where a pixel shows two ids.
const IDS: f64 = 18.0;
/// Bytes of an image to denoise: colour, albedo, normal, what comes out, and the library's own.
const DENOISED: f64 = 4.0 * (3.0 * 4.0) + 64.0;
/// Bytes of a sum of control variates with one sample, and binary digits that twice as many samples add.
const CONTROL: f64 = 3.5;
const CONTROL_DIGITS: f64 = 3.0;
/// Bytes of what a pixel is corrected by where control variates are fitted over pixels; and of a pixel of the rows that are
/// corrected together, and by control variate.
const CORRECTION: f64 = 12.0;
const FITTED: [usize; 2] = [240, 13];
/// Bytes of a pixel that is read from the film, and of the channels of an image with all layers.
const READ: usize = 144 + 24;
const CHANNELS: usize = 16 * 4;
/// Bytes of OpenImageIO and the libraries it depends on, of threads with their batches.
const LIBRARIES: u64 = 118 << 20;
const THREAD: u64 = 8 << 20;

/// What is to be made of a job.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'a> {
    /// Samples and layers.
    pub render: &'a RenderSettings,
    /// Cryptomattes.
    pub cryptomattes: &'a [Cryptomatte],
    /// Whether the image is denoised.
    pub is_denoised: bool,
}

/// Bytes that an image takes, beyond its scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// All that grows with the number of pixels.
    pub film: u64,
    /// The rows that are being written.
    pub output: u64,
    /// What any image takes: libraries, unless they are loaded, and the batches of threads; and tiles of textures that are not
    /// in memory yet.
    pub fixed: u64,
}

impl Prediction {
    /// All together.
    pub fn bytes(&self) -> u64 {
        self.film + self.output + self.fixed
    }
}

/// Bytes that an image will take.
pub fn predict(job: &RenderJob, wanted: &Wanted<'_>) -> Prediction {
    let bounds = job.world.scene.film.bounds;
    let render = wanted.render;
    let threads = render.threads.unwrap_or_else(|| thread_pool(None).map_or(1, |pool| pool.current_num_threads()));
    let share = render.share.map_or(1.0, |share| 1.0 / f64::from(share.count.max(1)));
    let pixels = bounds.area() as f64;
    let whole = if wanted.is_denoised { DENOISED } else { 0.0 } + wanted.cryptomattes.len() as f64 * IDS;
    let width = bounds.width() as usize;
    let libraries = if is_loaded() { 0 } else { LIBRARIES };
    let band = (BAND as usize + 2) * READ * threads + 2 * ROWS_AT_ONCE * CHANNELS;
    Prediction {
        film: (pixels * (share * of_sums(job, render) + whole)) as u64,
        output: (width * (band + of_corrected_rows(job))) as u64,
        fixed: libraries + THREAD * threads as u64 + job.world.scene.textures.store().map_or(0, |s| s.capacity()),
    }
}

/// Bytes of a column of the rows that are corrected together, where control variates are fitted over pixels.
fn of_corrected_rows(job: &RenderJob) -> usize {
    let estimator = Estimator::at_vertex(&job.settings().integrator, 0);
    if !estimator.is_over_pixels() {
        return 0;
    }
    (ROWS as usize + 2 * MARGIN) * (FITTED[0] + FITTED[1] * job.controls())
}

/// Bytes of the sums of a pixel.
fn of_sums(job: &RenderJob, render: &RenderSettings) -> f64 {
    let doublings = f64::from(render.spp.max(1)).log2();
    let grown = |bytes: f64, digits: f64| bytes + digits * doublings / 8.0;
    let mut bytes = TILE + grown(IMAGE, DIGITS[0]);
    if render.with_features {
        bytes += grown(FEATURES, DIGITS[1]);
    }
    if replica_choice(job, render).is_some() {
        bytes += REPLICAS;
    }
    bytes += light_layers::count(job) as f64 * grown(IMAGE, DIGITS[0]);
    let estimator = Estimator::at_vertex(&job.settings().integrator, 0);
    let fits = estimator.fits(job, 1);
    bytes += fits.memory().map(size_of_val).iter().sum::<usize>() as f64;
    bytes += fits.sum_count() as f64 * grown(CONTROL, CONTROL_DIGITS);
    if estimator.is_over_pixels() {
        bytes += CORRECTION;
    }
    bytes
}

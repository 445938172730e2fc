//! Prediction of the memory that an image takes, for `lumiris info` and the limit of `lumiris render`.
//!
//! A packed pixel takes the bits in which it differs from its neighbours, which depend on its samples. The figures here
//! were measured with one scene at 1 sample (docs/measurements/memory.md). Their growth is estimated: a sum needs one
//! more binary digit when the number of samples doubles.

use super::control_variates::ROWS;
use super::cryptomatte::Cryptomatte;
use super::render_settings::RenderSettings;
use super::tiles::replica_choice;
use crate::direct::Estimator;
use crate::film::BAND;
use crate::imaging::oiio::{ROWS_AT_ONCE, library_bytes};
use crate::import::memory::{FEATURES, IMAGE, REPLICAS, THREAD, TILE};
use crate::planning::preparation::thread_pool;
use crate::scene::RenderJob;
use lumiris_numbers::estimators::ocv::pixels::MARGIN;

/// Binary digits per pixel that doubling the samples adds to the image and to the features.
const DIGITS: [f64; 2] = [9.0, 9.0];
/// Bytes of a pixel of a light-group layer with light in one sample, and bytes that doubling these samples adds; bytes
/// of a pixel without light; and the number of path vertices that are assumed to find light at most.
const LIGHT: f64 = 15.0;
const LIGHT_DOUBLED: f64 = 5.0;
const DARK: f64 = 0.125;
const VERTICES: u32 = 5;
/// Bytes per pixel of a Cryptomatte, for two ids per pixel.
const IDS: f64 = 18.0;
/// Bytes per pixel of denoising: colour, albedo, normal, output, and the buffers of the library.
const DENOISED: f64 = 4.0 * (3.0 * 4.0) + 64.0;
/// Bytes of a sum of control variates with one sample, and binary digits that doubling the samples adds.
const CONTROL: f64 = 3.5;
const CONTROL_DIGITS: f64 = 3.0;
/// Control variates fitted over pixels: bytes of the correction of a pixel; then bytes per pixel of the rows that are
/// corrected together, fixed and per control variate.
const CORRECTION: f64 = 12.0;
const FITTED: [usize; 2] = [240, 13];
/// Bytes of a pixel read from the film, of the channels of an image with all layers, and of the channels of a light
/// group.
const READ: usize = 144 + 24;
const CHANNELS: usize = 16 * 4;
const CHANNELS_OF_LAYER: usize = 3 * 4;
/// Rows of each thread that compresses an EXR file: two blocks of 16, before and after.
const COMPRESSED_ROWS: usize = 64;

/// The outputs of a job that affect its memory.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'a> {
    /// Samples and layers.
    pub render: &'a RenderSettings,
    /// Cryptomattes.
    pub cryptomattes: &'a [Cryptomatte],
    /// True if the image is denoised.
    pub is_denoised: bool,
}

/// Bytes that an image takes in addition to the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// Memory proportional to the number of pixels.
    pub film: u64,
    /// Rows that are being written.
    pub output: u64,
    /// Memory of any image: libraries, unless they are loaded; batches of threads; texture tiles that are not in memory
    /// yet.
    pub fixed: u64,
}

impl Prediction {
    /// Total.
    pub fn bytes(&self) -> u64 {
        self.film + self.output + self.fixed
    }
}

/// Predicts the memory of an image.
pub fn predict(job: &RenderJob, wanted: &Wanted<'_>) -> Prediction {
    let bounds = job.world.scene.film.bounds;
    let render = wanted.render;
    let threads = render.threads.unwrap_or_else(|| thread_pool(None).map_or(1, |pool| pool.current_num_threads()));
    let share = render.share.map_or(1.0, |share| 1.0 / f64::from(share.count.max(1)));

    // Outputs of whole images, and rows that are written
    let pixels = bounds.area() as f64;
    let whole = if wanted.is_denoised { DENOISED } else { 0.0 } + wanted.cryptomattes.len() as f64 * IDS;
    let width = bounds.width() as usize;
    let channels = CHANNELS + render.light_layers(job).len() * CHANNELS_OF_LAYER;
    let band = (BAND as usize + 2) * READ * threads + (2 * ROWS_AT_ONCE + COMPRESSED_ROWS * threads) * channels;
    Prediction {
        film: (pixels * (share * of_sums(job, render) + whole)) as u64,
        output: (width * (band + of_corrected_rows(job))) as u64,
        fixed: library_bytes() + THREAD * threads as u64 + job.world.scene.textures.store().map_or(0, |s| s.capacity()),
    }
}

/// Bytes per column of the rows that are corrected together, where control variates are fitted over pixels.
fn of_corrected_rows(job: &RenderJob) -> usize {
    let estimator = Estimator::at_vertex(&job.settings().integrator, 0);
    if !estimator.is_over_pixels() {
        return 0;
    }
    (ROWS as usize + 2 * MARGIN) * (FITTED[0] + FITTED[1] * job.controls())
}

/// Bytes per pixel of the layers of light groups: a sample finds as many groups as its path takes light samples.
fn of_light_layers(job: &RenderJob, render: &RenderSettings) -> f64 {
    let layers = render.light_layers(job).len() as f64;
    let integrator = &job.settings().integrator;
    let found = integrator.sample_counts_at(0).samples * integrator.max_depth.clamp(1, VERTICES);
    let chance = (f64::from(found) / layers.max(1.0)).min(1.0);
    let spp = f64::from(render.spp.max(1));
    let lit = 1.0 - (1.0 - chance).powf(spp);
    let doublings = (chance * spp / lit).log2();
    layers * (DARK + lit * (LIGHT + LIGHT_DOUBLED * doublings))
}

/// Bytes per pixel of the sums.
fn of_sums(job: &RenderJob, render: &RenderSettings) -> f64 {
    let doublings = f64::from(render.spp.max(1)).log2();
    let grown = |bytes: f64, digits: f64| bytes + digits * doublings / 8.0;

    // Image, features and replicas
    let mut bytes = TILE + grown(IMAGE, DIGITS[0]);
    if render.with_features {
        bytes += grown(FEATURES, DIGITS[1]);
    }
    if replica_choice(job, render).is_some() {
        bytes += REPLICAS;
    }

    bytes += of_light_layers(job, render);

    // Control variates
    let estimator = Estimator::at_vertex(&job.settings().integrator, 0);
    let fits = estimator.fits(job, 1);
    bytes += fits.memory().map(size_of_val).iter().sum::<usize>() as f64;
    bytes += fits.sum_count() as f64 * grown(CONTROL, CONTROL_DIGITS);
    if estimator.is_over_pixels() {
        bytes += CORRECTION;
    }
    bytes
}

//! The numbers that the rule and the pilots go by, each with the measurement that it comes from.

/// Numbers of samples of paths, and who shares them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Numbers {
    /// Samples of direct light at first vertices.
    pub(super) first: u32,
    /// The same at later vertices.
    pub(super) later: u32,
    /// Edge of the blocks of pixels that share paths (pixels).
    pub(super) edge: u32,
}

// The rule: docs/measurements/efficiency/README.md#the-rule

/// Camera rays that show the facts of a scene: shares are known to 2 %.
pub(super) const FACT_RAYS: u32 = 2048;
/// Light samples where each of them arrives.
pub(super) const LIGHT_SAMPLES: u32 = 4;

/// Samples of direct light.
pub(super) const DIRECT_SAMPLES: u32 = 8;
/// Numbers in paths of few bounces that are shared, indoors and under the sky.
pub(super) const INDOORS: Numbers = Numbers { first: 4, later: 3, edge: 6 };
pub(super) const OUTDOORS: Numbers = Numbers { first: 6, later: 3, edge: 4 };
/// The same in longer paths, and where there is nothing to be shared.
pub(super) const LONG: Numbers = Numbers { first: 3, later: 2, edge: 4 };
pub(super) const UNSHARED: Numbers = Numbers { first: 8, later: 2, edge: 1 };
/// Fraction of BSDF samples at first vertices that are not diffuse, where paths are not shared.
pub(super) const GLOSSY_BSDF: f32 = 0.375;
/// Most bounces of paths without roulette.
pub(super) const FEW_BOUNCES: u32 = 8;
/// Fractions of the light samples for lights at infinity.
pub(super) const SKY_FRACTIONS: [f32; 5] = [0.125, 0.25, 0.5, 0.75, 0.875];
/// Share of camera rays at a diffuse surface beside another from which on paths are shared.
pub(super) const MIN_PAIRS: f64 = 0.1;
/// Share of rays from diffuse surfaces that leave the scene from which on it is outdoors.
pub(super) const OPEN: f64 = 0.5;
/// Lights from which on photons tell which of them contribute, and the share of them that must be hidden.
pub(super) const MANY_LIGHTS: usize = 16;
pub(super) const MOST_HIDDEN: f64 = 0.5;
/// Samples on lights that photons do not find, in direct light and in paths.
pub(super) const OTHERS: [u32; 2] = [2, 1];
/// Light paths per camera sample.
pub(super) const LIGHT_PATHS: f32 = 0.25;

// Costs, and light paths: docs/measurements/light-paths.md

/// Part of a pilot of light paths whose whole is traced before the image.
pub(super) const LIGHT_PILOT: u64 = 4;
/// Cost of a tentative collision in a medium, a lookup, where that of a ray is 1: as measured in a sparse volume.
pub(super) const COLLISION_COST: f64 = 1.5;
/// Cost of a ray that only sees visible lights: measured as 0.9 to 2.5 in four scenes, beside samples of a camera ray and 8 proposals.
pub(super) const LOOK_COST: f64 = 2.0;

// Trials: docs/measurements/efficiency/README.md#trials

/// Edge of the cells of trials (pixels).
pub(super) const CELL: u32 = 16;
/// Cells of a trial, and samples of a pixel and seed.
pub(super) const TUNE_CELLS: usize = 32;
pub(super) const TUNE_SPP: u32 = 16;
/// How many trials there are, about.
pub(super) const TUNE_TRIALS: f64 = 20.0;
/// By how much a trial must be more efficient to be followed, and what is found at last to be taken.
pub(super) const MIN_GAIN: f64 = 1.03;
/// Standard errors by which both must be better: a single cell may be a standard error.
pub(super) const MIN_ERRORS: f64 = 1.5;
pub(super) const TUNE_GAIN: f64 = 1.1;

// The pilot of adaptive sampling: docs/measurements/efficiency/README.md#looks

/// Fewest and most samples of a pixel in the pilot; with less than the fewest, the pilot has fewer pixels.
pub(super) const PILOT_SPP: [u32; 2] = [2, 8];
/// Samples of two sets each that see visible lights alone: as a part of those of the image, and fewest and most of them.
pub(super) const SIGHT_PART: u32 = 16;
pub(super) const SIGHT_SPP: [u32; 2] = [1, 4];
/// Factor by which visible lights differ among neighbours for a pixel to have more of these samples, and how many.
pub(super) const EDGE_RATIO: f64 = 4.0;
pub(super) const SIGHT_OF_EDGES: u32 = 8;
/// Pixels to each side that are taken to have what a pixel sees of the variance of visible lights.
pub(super) const SIGHT_RADIUS: usize = 1;
/// Pixels of a material that count as much as the mean of all pixels.
pub(super) const FEW_PIXELS: f64 = 16.0;
/// Edge of the tiles whose samples have one cost (pixels): part of the result, unlike that of rendering.
pub(super) const COST_TILE: u32 = 16;
/// Tiles whose samples are in memory before they are reduced to what the pilot holds.
pub(super) const TILES_AT_ONCE: usize = 1024;
/// Maximum number of samples per pixel for a standard error that is asked for, if none is given.
pub(super) const MAX_SPP_FOR_NOISE: u32 = 4096;

// Numbers of samples from what the pilot knows

/// Steps by which the rate converges at which error is exchanged for cost, where it changes the cost of the image; and by
/// which it is found for a given cost.
pub(super) const ITERATIONS: usize = 8;
pub(super) const BISECTIONS: usize = 26;
/// Fewest and most samples of a pixel, relative to the mean.
pub(super) const RANGE: [f64; 2] = [0.5, 8.0];
/// Fewest samples of a pixel whose samples are split: beside lights there is more noise than few samples know of.
pub(super) const MIN_SPLIT: f64 = 1.0;
/// Most looks of a sample, its own included.
pub(super) const MAX_LOOKS: u8 = 64;
/// Pixels whose sums are added up by one thread.
pub(super) const CHUNK: usize = 1 << 14;

// The pilot of --noise: docs/measurements/variance/README.md

/// Samples of a pixel and seed of the pilot in the beginning.
pub(super) const FIRST: u32 = 2;
/// Samples that a block may need for each sample of the pilot.
pub(super) const REACH: u32 = 16;
/// Most looks for each sample of the pilot.
pub(super) const LOOKS_KNOWN: u32 = 4;

// M/N of each pixel: docs/measurements/resampling

/// Camera samples per pixel of the pilot, and its proposals per estimate, all of which are traced.
pub(super) const RIS_PILOT_SPP: u32 = 2;
pub(super) const PILOT_PROPOSALS: u32 = 32;
/// Variances are averaged over this many pixels to each side.
pub(super) const PILOT_RADIUS: u32 = 2;

// Photons of the visibility cache: docs/measurements/photons

/// Photon paths, unless a number is given.
pub(super) const PHOTON_PATHS: u64 = 1 << 18;
/// Fraction of the photon paths distributed evenly over the lights: a weak light next to a surface matters as much as a
/// strong one far away.
pub(super) const UNIFORM_FRACTION: f32 = 0.25;
/// Paths of importons, their maximum number of scattering events, and the seed of the lights that they choose.
pub(super) const IMPORTON_PATHS: u64 = 1 << 14;
pub(super) const IMPORTON_DEPTH: u32 = 4;

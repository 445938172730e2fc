//! Constants of the rule and the pilots, with references to the measurements.

/// Sample counts of paths, and the size of the blocks that share them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PathSamples {
    /// Samples of direct light at the first vertex.
    pub(super) first: u32,
    /// Samples of direct light at later vertices.
    pub(super) later: u32,
    /// Edge of the blocks of pixels that share paths (pixels).
    pub(super) edge: u32,
}

// The rule: docs/measurements/efficiency/README.md#the-rule

/// Camera rays that measure the facts of a scene. Fractions are accurate to 2 %.
pub(super) const FACT_RAYS: u32 = 2048;
/// Light samples at each hit of these rays.
pub(super) const LIGHT_SAMPLES: u32 = 4;

/// Samples per estimate if only direct light is rendered.
pub(super) const DIRECT_SAMPLES: u32 = 8;
/// The same of `contributing`.
pub(super) const CONTRIBUTING_SAMPLES: u32 = 4;
/// Sample counts of shared paths with few bounces, indoors and outdoors.
pub(super) const INDOORS: PathSamples = PathSamples { first: 4, later: 3, edge: 6 };
pub(super) const OUTDOORS: PathSamples = PathSamples { first: 6, later: 3, edge: 4 };
/// Sample counts of longer shared paths, and of paths that are not shared.
pub(super) const LONG: PathSamples = PathSamples { first: 3, later: 2, edge: 4 };
pub(super) const UNSHARED: PathSamples = PathSamples { first: 8, later: 2, edge: 1 };
/// Fraction of BSDF samples at first vertices where paths are not shared, mostly on surfaces that are not diffuse.
pub(super) const GLOSSY_BSDF: f32 = 0.375;
/// Maximum bounces of paths without Russian roulette.
pub(super) const FEW_BOUNCES: u32 = 8;
/// Candidates for the fraction of light samples that go to lights at infinity.
pub(super) const SKY_FRACTIONS: [f32; 5] = [0.125, 0.25, 0.5, 0.75, 0.875];
/// Minimum fraction of camera rays that hit a diffuse surface next to another, for paths to be shared.
pub(super) const MIN_PAIRS: f64 = 0.1;
/// Minimum fraction of rays from diffuse surfaces that leave the scene, for a scene to be outdoors.
pub(super) const OPEN: f64 = 0.5;
/// Minimum number of lights, and minimum fraction of their samples that are occluded, for `contributing`.
pub(super) const MANY_LIGHTS: usize = 16;
pub(super) const MOST_HIDDEN: f64 = 0.75;
/// Samples of noncontributing lights, in direct light and in paths.
pub(super) const OTHERS: [u32; 2] = [2, 1];
/// Light paths per camera sample.
pub(super) const LIGHT_PATHS: f32 = 0.25;

// Costs, and light paths: docs/measurements/light-paths.md

/// A pilot traces 1/`LIGHT_PILOT` of the light paths that are traced before the image.
pub(super) const LIGHT_PILOT: u64 = 4;
/// Cost of a tentative collision in a medium, which is a lookup, relative to a ray. Measured in a sparse volume.
pub(super) const COLLISION_COST: f64 = 1.5;
/// Factor on the counted cost of an emission ray. Measured: 0.9 to 2.5 in four scenes, relative to samples with one
/// camera ray and 8 proposals.
pub(super) const EMISSION_RAY_COST: f64 = 2.0;

// The pilot of adaptive sampling: docs/measurements/efficiency/README.md#emission_rays

/// Minimum and maximum samples per pixel of the pilot. If the budget is below the minimum, the pilot samples a fraction
/// of the pixels.
pub(super) const PILOT_SPP: [u32; 2] = [2, 8];
/// Emission rays per pixel in each of two sets: 1/[`EMISSION_DIVISOR`] of the samples of the image, within a minimum
/// and a maximum.
pub(super) const EMISSION_DIVISOR: u32 = 16;
pub(super) const EMISSION_SPP: [u32; 2] = [1, 4];
/// Ratio of visible emission between neighbours from which on a pixel gets more emission rays, and the factor for their
/// number.
pub(super) const EDGE_RATIO: f64 = 4.0;
pub(super) const EDGE_FACTOR: u32 = 8;
/// Radius of the neighbourhood over which the variance of visible emission is averaged (pixels).
pub(super) const EMISSION_RADIUS: usize = 1;
/// Weight of the mean of all pixels in the mean of a material (pixels).
pub(super) const FEW_PIXELS: f64 = 16.0;
/// Edge of the tiles whose samples have a common cost (pixels). The result depends on it, unlike on the tile size of
/// rendering.
pub(super) const COST_TILE: u32 = 16;
/// Tiles whose samples are in memory at once, before they are reduced to the statistics of the pilot.
pub(super) const TILES_AT_ONCE: usize = 1024;
/// Maximum samples per pixel for a target noise, if none is given.
pub(super) const MAX_SPP_FOR_NOISE: u32 = 4096;

// Sample counts from the estimates of the pilot

/// Iterations for the rate between error and cost: if the cost of the image varies, and by bisection if the cost is
/// given.
pub(super) const ITERATIONS: usize = 8;
pub(super) const BISECTIONS: usize = 26;
/// Minimum and maximum samples of a pixel, relative to the mean.
pub(super) const RANGE: [f64; 2] = [0.5, 8.0];
/// Minimum samples, relative to the mean, of a pixel with additional emission rays. Next to lights there is more noise
/// than few samples reveal.
pub(super) const MIN_SPLIT: f64 = 1.0;
/// Maximum emission rays per sample, including its own.
pub(super) const MAX_EMISSION_RAYS: u8 = 64;
/// Pixels that one thread sums.
pub(super) const CHUNK: usize = 1 << 14;

// The pilot of --noise: docs/measurements/variance/README.md

/// Initial samples per pixel and seed of the pilot.
pub(super) const FIRST: u32 = 2;
/// Maximum samples that a block may need, per sample of the pilot.
pub(super) const REACH: u32 = 16;
/// Maximum emission rays per sample, for each sample of the pilot.
pub(super) const MAX_RAYS_PER_PILOT_SAMPLE: u32 = 4;

// M/N of each pixel: docs/measurements/resampling

/// Camera samples per pixel of the pilot, and proposals per estimate. All proposals are traced.
pub(super) const RIS_PILOT_SPP: u32 = 2;
pub(super) const PILOT_PROPOSALS: u32 = 32;
/// Radius of the neighbourhood over which variances are averaged (pixels).
pub(super) const PILOT_RADIUS: u32 = 2;

// Photons of the visibility cache: docs/measurements/photons

/// Photon paths, if no number is given.
pub(super) const PHOTON_PATHS: u64 = 1 << 18;
/// Fraction of the photon paths distributed evenly over the lights: a weak light next to a surface matters as much as a
/// strong one far away.
pub(super) const UNIFORM_FRACTION: f32 = 0.25;
/// Importon paths, and their maximum number of scattering events.
pub(super) const IMPORTON_PATHS: u64 = 1 << 14;
pub(super) const IMPORTON_DEPTH: u32 = 4;

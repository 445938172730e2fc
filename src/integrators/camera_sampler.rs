//! Camera samples: film positions with their rays and random numbers.

use super::camera_sample::{CameraSample, CameraSamples};
use super::{light_paths, reuse};
use crate::direct::Estimator;
use crate::film::filter::FilterSampler;
use crate::scene::{PixelSamples, RenderJob, SampleCountMap};
use crate::settings::{Proposals, SampleCounts};
use lumiris_lanes::camera::{Pinhole, PinholeRays};
use lumiris_lanes::columns::{Column, Columns3, padded, reserve};
use lumiris_lanes::level;
use lumiris_lanes::sampler::{self, Below};
use lumiris_numbers::estimators::ocv::block_of;
use lumiris_numbers::math::Vec2;
use lumiris_numbers::math::hash::pcg4d;
use lumiris_numbers::samplers::{SampleStream, SamplerKind};
use std::ops::Range;

/// Random-number domains of a camera sample.
mod domain {
    pub(super) const FILM_AND_LENS: u32 = 0;
    pub(super) const TIME: u32 = 1;
    pub(super) const SAMPLE_COUNTS: u32 = 2;
}

/// Seed of the sample blocks of progressive estimators.
const BLOCK_SEED: u32 = 0x62_6c_6f_63;

/// Makes camera samples.
pub struct CameraSampler<'a> {
    job: &'a RenderJob,
    /// Index of the first sample of the image.
    first_sample: u32,
    filter: FilterSampler,
    /// Sample counts per pixel, if they vary and pixels share camera paths or light paths.
    shared: Option<&'a PixelSamples>,
    /// True if the scene or the camera moves.
    has_motion: bool,
    /// Pinhole camera that makes many rays at once.
    pinhole: Option<Pinhole>,
    direct: DirectNumbers,
    /// Sample counts, unless chosen per pixel.
    sample_counts: SampleCounts,
    /// Map of sample counts per pixel.
    count_map: Option<&'a SampleCountMap>,
    /// True if direct light uses the stream of the sample, no paths are shared, and there is no count map.
    are_plain: bool,
}

/// Source of the random numbers of direct light.
#[derive(Clone, Copy, Debug)]
enum DirectNumbers {
    /// The stream of the camera sample.
    Same,
    /// A sampler of this kind. Estimators over pixels need random numbers that are independent between neighbouring
    /// pixels.
    Kind(SamplerKind),
    /// A stream per block of samples.
    Blocks,
}

/// Some samples of a pixel.
#[derive(Clone, Debug)]
pub struct PixelSampleRange {
    /// The pixel among those whose control variates are summed; counted row by row in a tile.
    pub fit: u32,
    /// Coordinates of the pixel.
    pub pixel: [u32; 2],
    /// Indices of the samples.
    pub samples: Range<u32>,
}

/// Buffers for many samples.
#[derive(Debug, Default)]
pub struct Scratch {
    pixels: Vec<PixelSampleRange>,
    u: [Column; 2],
    d: Columns3,
    spread: Column,
}

impl<'a> CameraSampler<'a> {
    /// The job of the image.
    pub(crate) fn job(&self) -> &'a RenderJob {
        self.job
    }

    /// A sampler for an image whose first sample has the index `first_sample`.
    pub fn new(job: &'a RenderJob, first_sample: u32) -> Self {
        let scene = &job.world.scene;
        let has_motion = scene.geometry.has_motion() || scene.camera.is_moving();
        let pinhole = if has_motion { None } else { scene.camera.pinhole() };
        let settings = job.settings();

        // Random numbers of direct light
        let estimator = Estimator::at_vertex(&settings.integrator, 0);
        let direct = if estimator.is_over_pixels() && settings.sampling.sampler == SamplerKind::SobolBlueNoise {
            DirectNumbers::Kind(SamplerKind::Sobol)
        } else if estimator.is_progressive() {
            DirectNumbers::Blocks
        } else {
            DirectNumbers::Same
        };

        // Sample counts that vary between pixels
        let filter = scene.film.filter.sampler();
        let sample_counts = settings.integrator.sample_counts();
        let shared = job.pixel_samples.as_ref().filter(|_| reuse::edge(job) > 1 || light_paths::per_sample(job) > 0.0);
        let is_chosen = settings.integrator.ris.proposals == Proposals::Optimal;
        let count_map = job.sample_count_map.as_ref().filter(|_| is_chosen);
        let are_plain = matches!(direct, DirectNumbers::Same) && shared.is_none() && count_map.is_none();
        CameraSampler {
            job,
            first_sample,
            filter,
            shared,
            has_motion,
            pinhole,
            direct,
            sample_counts,
            count_map,
            are_plain,
        }
    }

    /// Replaces `out` by the samples of some pixels.
    pub fn samples(
        &self,
        pixels: impl Iterator<Item = PixelSampleRange>,
        seed: u32,
        scratch: &mut Scratch,
        out: &mut CameraSamples,
    ) {
        out.clear();
        // Other cameras make their rays one by one
        let Some(pinhole) = &self.pinhole else {
            for PixelSampleRange { fit, pixel, samples } in pixels {
                out.extend(samples.map(|sample| CameraSample { fit, ..self.sample(pixel, sample, seed) }));
            }
            return;
        };

        // Film positions, rays, and the other columns
        self.draw_numbers(pixels, seed, scratch, out);
        self.find_film_positions(scratch, out);
        let (n, len) = (out.streams.len(), padded(out.streams.len()));
        let Scratch { u: [x, y], d, spread, .. } = &mut *scratch;
        let mut rays = PinholeRays { d: d.get_mut(len), spread: &mut spread[..len] };
        pinhole.rays(level(), [&x[..len], &y[..len]], &mut rays);
        out.spread.extend_from_slice(&spread[..n]);
        out.width0.resize(n, 0.0);
        out.rays.extend_from(pinhole.origin, d.get(n));
        self.set_pixels(seed, scratch, out);
    }

    /// Draws the random numbers of the film positions.
    fn draw_numbers(
        &self,
        pixels: impl Iterator<Item = PixelSampleRange>,
        seed: u32,
        scratch: &mut Scratch,
        out: &mut CameraSamples,
    ) {
        let Scratch { pixels: of_pixels, u: [x, y], d, spread } = scratch;
        let (kind, streams) = (self.job.settings().sampling.sampler, &mut out.streams);
        // Streams, and the net points of samplers that are made of nets
        of_pixels.clear();
        for range in pixels {
            streams.push_samples(kind, range.pixel, range.samples.clone(), seed);
            of_pixels.push(range);
        }

        // Two numbers of each
        let (n, len) = (streams.len(), padded(streams.len()));
        reserve(&mut [x, y, spread], len);
        d.reserve(len);
        let numbers = [&mut x[..n], &mut y[..n]];
        sampler::draw(level(), streams, 0..n, Below::Domain(domain::FILM_AND_LENS), numbers);
    }

    /// Turns random numbers into film positions and weights.
    fn find_film_positions(&self, scratch: &mut Scratch, out: &mut CameraSamples) {
        let Scratch { pixels, u: [x, y], .. } = scratch;
        let scale = self.job.world.scene.film.scale;
        out.weight.resize(out.streams.len(), 0.0);
        let mut first = 0;
        for PixelSampleRange { pixel, samples, .. } in pixels {
            let (of_pixel, center) = (first..first + samples.len(), center(*pixel));
            first = of_pixel.end;
            let positions = x[of_pixel.clone()].iter_mut().zip(&mut y[of_pixel.clone()]);
            for ((x, y), weight) in positions.zip(&mut out.weight[of_pixel]) {
                let filter = self.filter.sample([*x, *y]);
                let film = center + filter.offset;
                (*x, *y, *weight) = (film.x, film.y, filter.weight * scale);
            }
        }
    }

    /// Sets the columns that belong to pixels, and those that few images need.
    fn set_pixels(&self, seed: u32, scratch: &Scratch, out: &mut CameraSamples) {
        for &PixelSampleRange { fit, pixel, ref samples } in &scratch.pixels {
            let end = out.fit.len() + samples.len();
            out.fit.resize(end, fit);
            out.pixel.resize(end, pixel);
            out.sample_counts.resize(end, self.sample_counts);
            out.share_group.extend(samples.clone());
        }
        if self.are_plain {
            return;
        }

        // Streams of direct light, sample counts and share groups of their own
        let indices = scratch.pixels.iter().flat_map(|range| range.samples.clone());
        for (i, sample) in indices.enumerate() {
            let (pixel, stream) = (out.pixel[i], out.streams.get(i));
            if let Some(direct) = self.direct_stream(pixel, sample, seed) {
                out.direct.extend([direct].iter());
            }
            out.sample_counts[i] = self.counts(pixel, &stream);
            out.share_group[i] = self.share_group(pixel, sample);
        }
    }

    /// One sample. A progressive estimator draws direct light block by block, each block with its own seed.
    pub fn sample(&self, pixel: [u32; 2], sample: u32, seed: u32) -> CameraSample {
        let of_seed = self.sample_of_seed(pixel, sample, seed);
        CameraSample { direct: self.direct_stream(pixel, sample, seed).unwrap_or(of_seed.stream), ..of_seed }
    }

    /// One sample, with direct light outside of all blocks.
    pub fn sample_of_seed(&self, pixel: [u32; 2], sample: u32, seed: u32) -> CameraSample {
        let (scene, settings) = (&self.job.world.scene, self.job.settings());
        let stream = SampleStream::new(settings.sampling.sampler, pixel, sample, seed);
        let [fx, fy, lx, ly] = stream.domain(domain::FILM_AND_LENS).draw::<4>();
        let [u_time] = if self.has_motion { stream.domain(domain::TIME).draw::<1>() } else { [0.0] };
        let filter = self.filter.sample([fx, fy]);
        let ray = scene.camera.ray(center(pixel) + filter.offset, [lx, ly], u_time);
        let weight = filter.weight * ray.weight * scene.film.scale;
        let of_ray = CameraSample::of_ray(ray, weight, stream, self.counts(pixel, &stream));
        CameraSample { share_group: self.share_group(pixel, sample), pixel, ..of_ray }
    }

    /// See [`PixelSamples::share_group`].
    #[inline]
    fn share_group(&self, pixel: [u32; 2], sample: u32) -> u32 {
        self.shared.map_or(sample, |of_pixels| {
            self.first_sample.wrapping_add(of_pixels.share_group(pixel, sample.wrapping_sub(self.first_sample)))
        })
    }

    /// Random numbers of direct light, if they differ from the stream of the sample.
    #[inline]
    fn direct_stream(&self, pixel: [u32; 2], sample: u32, seed: u32) -> Option<SampleStream> {
        match self.direct {
            DirectNumbers::Same => None,
            DirectNumbers::Kind(kind) => Some(SampleStream::new(kind, pixel, sample, seed)),
            DirectNumbers::Blocks => {
                let block = block_of(sample - self.first_sample);
                let block_seed = pcg4d([seed, self.first_sample, block.index, BLOCK_SEED])[0];
                let index = sample - self.first_sample - block.first;
                Some(SampleStream::new(self.job.settings().sampling.sampler, pixel, index, block_seed))
            }
        }
    }

    /// Sample counts at the first vertex.
    #[inline]
    fn counts(&self, pixel: [u32; 2], stream: &SampleStream) -> SampleCounts {
        let of_map = |map: &SampleCountMap| map.sample_counts(pixel, stream.domain(domain::SAMPLE_COUNTS).draw::<2>());
        self.count_map.map_or(self.sample_counts, of_map)
    }
}

/// The centre of a pixel.
fn center(pixel: [u32; 2]) -> Vec2 {
    Vec2::new(pixel[0] as f32 + 0.5, pixel[1] as f32 + 0.5)
}

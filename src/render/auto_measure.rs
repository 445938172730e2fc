//! The pixels where the pilot of `--estimator auto` measures, and what it measures there.

use super::allocation::may_split;
use super::auto_reuse;
use super::auto_round::{Candidate, Difference};
use super::worker::Worker;
use super::{Run, processor_time};
use crate::film::{FeatureSet, PixelBounds, PixelSample};
use crate::imaging::metrics::difference::DEFAULT_EPSILON;
use crate::integrators::PathTracer;
use crate::integrators::light_paths::{self, LightPilot};
use crate::integrators::path::CameraSample;
use crate::integrators::reuse::{self, Groups};
use crate::settings::IntegratorSettings;
use lumiris_numbers::math::hash::{pcg4d, unit_f32};

/// Combined with the number of the round, and for its samples with the seed of the image.
pub(super) const SEED: u32 = 0x61_75_74_6f;

/// Pixels, one in each cell of a grid, at a place that depends on the round.
pub(super) fn pixels(bounds: &PixelBounds, count: usize, round: u32) -> Vec<[u32; 2]> {
    let (width, height) = (bounds.width(), bounds.height());
    let aspect = f64::from(width) / f64::from(height);
    let columns = ((count as f64 * aspect).sqrt().round() as u32).clamp(1, width);
    let rows = (count as u32 / columns).clamp(1, height);
    let place = |k: u32, cells: u32, size: u32, u: f32| {
        let [start, end] = [k, k + 1].map(|k| u64::from(k) * u64::from(size) / u64::from(cells)).map(|x| x as u32);
        (start + ((end - start) as f32 * u) as u32).min(end - 1)
    };
    let pixel = |row: u32, column: u32| {
        let h = pcg4d([row, column, SEED, round]);
        let (x, y) = (place(column, columns, width, unit_f32(h[0])), place(row, rows, height, unit_f32(h[1])));
        [bounds.x0 + x, bounds.y0 + y]
    };
    (0..rows).flat_map(|row| (0..columns).map(move |column| pixel(row, column))).collect()
}

/// As many pixels in blocks, or somewhat less; none where there is no room for any.
pub(super) fn blocks(bounds: &PixelBounds, count: usize) -> Vec<[u32; 2]> {
    const EDGE: u32 = auto_reuse::EDGE;
    let [width, height] = [bounds.width() / EDGE, bounds.height() / EDGE];
    if width == 0 || height == 0 {
        return Vec::new();
    }
    let corners = pixels(&PixelBounds { x0: 0, x1: width, y0: 0, y1: height }, count / (EDGE * EDGE) as usize, 2);
    let block = |[x, y]: [u32; 2]| {
        (0..EDGE * EDGE).map(move |i| [bounds.x0 + x * EDGE + i % EDGE, bounds.y0 + y * EDGE + i / EDGE])
    };
    corners.into_iter().flat_map(block).collect()
}

/// Light paths per camera sample to which all candidates that know them leave what they find, if no number is asked for.
const LIGHT_PATHS: f64 = 0.25;

/// What [`measure`] found.
pub(super) struct Chunk {
    /// Of each candidate, processor time (ns), and the difference of the two means of each pixel.
    pub(super) of_candidates: Vec<(f64, Vec<Difference>)>,
    /// Σ of 1/(m² + ε) of the pixels, averaged over channels, m being their means.
    pub(super) relative: f64,
}

/// Renders some pixels with each candidate and seed. The `turn` decides which candidate is first. What `light` paths find, if
/// they are of use, is left to them, and where samples are split the noise of visible lights is left to their looks.
pub(super) fn measure(
    run: &Run<'_>,
    (pixels, spp): (&[[u32; 2]], u32),
    candidates: &[Candidate],
    light: Option<&LightPilot>,
    (seeds, turn): ([u32; 2], usize),
) -> Chunk {
    let groups = if reuse::obstacle(run.job).is_none() { Groups::Grid } else { Groups::None };
    let mut worker = Worker::new(PathTracer::sharing(groups, FeatureSet::None));
    let is_split = |k: usize| may_split(run.job.settings(), &candidates[k].settings);
    let seeing = (0..candidates.len()).find(|&k| is_split(k));
    let seeing = seeing.map(|k| IntegratorSettings { max_depth: 0, ..candidates[k].settings });
    let seen = seeing.map(|settings| seeds.map(|seed| image(run, &mut worker, &settings, (pixels, spp), seed)));
    let mut times = vec![0.0; candidates.len()];
    let mut images = vec![[(); 2].map(|()| Vec::<[f64; 3]>::new()); candidates.len()];
    for k in 0..candidates.len() {
        let k = (k + turn) % candidates.len();
        let settings = &candidates[k].settings;
        let per_sample = settings.light_paths.map_or(LIGHT_PATHS, f64::from);
        let knows = light_paths::obstacle_of(run.job, settings).is_none() && per_sample > 0.0;
        worker.tracer.leave(run.job, light.filter(|_| knows).map(|light| (light, per_sample)));
        let start = processor_time::of_thread();
        images[k] = seeds.map(|seed| image(run, &mut worker, settings, (pixels, spp), seed));
        times[k] = (processor_time::of_thread() - start).as_secs_f64() * 1e9;
    }
    let all = || images.iter().flatten();
    let count = all().count() as f64;
    let relative_to = |i: usize, c: usize| {
        let mean = all().map(|image| image[i][c]).sum::<f64>() / count;
        1.0 / (mean * mean + DEFAULT_EPSILON)
    };
    let difference = |[a, b]: &[Vec<[f64; 3]>; 2], is_split: bool, i: usize| {
        let of_channel = |c: usize| {
            let of_seen = seen.as_ref().filter(|_| is_split).map_or(0.0, |[a, b]| a[i][c] - b[i][c]);
            let d = (a[i][c] - b[i][c] - of_seen).abs() * relative_to(i, c).sqrt();
            if d.is_finite() { d } else { 0.0 }
        };
        let channels = [0, 1, 2].map(of_channel);
        [channels.iter().sum::<f64>() / 3.0, channels.iter().map(|d| d * d).sum::<f64>() / 3.0]
    };
    let of_candidate = |k| (0..pixels.len()).map(|i| difference(&images[k], is_split(k), i)).collect();
    let of_candidates = times.into_iter().enumerate().map(|(k, time)| (time, of_candidate(k))).collect();
    let of_channels = |i: usize| (0..3).map(|c| relative_to(i, c)).sum::<f64>() / 3.0;
    Chunk { of_candidates, relative: (0..pixels.len()).map(of_channels).filter(|r| r.is_finite()).sum() }
}

/// The means of the samples of some pixels, with random numbers of a seed.
fn image(
    run: &Run<'_>,
    worker: &mut Worker<PathTracer>,
    settings: &IntegratorSettings,
    (pixels, spp): (&[[u32; 2]], u32),
    seed: u32,
) -> Vec<[f64; 3]> {
    worker.samples.clear();
    let samples = pixels.iter().map(|&pixel| (0, pixel, 0..spp));
    run.camera.samples(samples, seed, &mut worker.scratch, &mut worker.samples);
    let sample_counts = settings.sample_counts();
    worker.samples.iter_mut().for_each(|s| *s = CameraSample { sample_counts, direct: s.stream, ..*s });
    let out = &mut worker.results;
    worker.tracer.trace(run.job, settings, &worker.samples, &mut Default::default(), out);
    let of_pixel = |samples: &[PixelSample]| {
        let sum = |c: usize| samples.iter().map(|s| f64::from(s.radiance.to_array()[c])).sum::<f64>();
        [0, 1, 2].map(|c| sum(c) / f64::from(spp))
    };
    out.chunks(spp as usize).map(of_pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_lie_inside_the_image_and_apart() {
        let bounds = PixelBounds { x0: 10, x1: 210, y0: 5, y1: 105 };
        for round in 0..2 {
            let pixels = pixels(&bounds, 300, round);
            assert!((270..=330).contains(&pixels.len()), "{}", pixels.len());
            assert!(pixels.iter().all(|[x, y]| (10..210).contains(x) && (5..105).contains(y)));
            let different: std::collections::HashSet<_> = pixels.iter().collect();
            assert_eq!(different.len(), pixels.len());
        }
        assert_ne!(pixels(&bounds, 300, 0), pixels(&bounds, 300, 1));
        assert_eq!(pixels(&PixelBounds { x0: 0, x1: 2, y0: 0, y1: 1 }, 100, 0), [[0, 0], [1, 0]]);
    }
}

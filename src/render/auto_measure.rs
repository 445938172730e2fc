//! What the pilot of `--estimator auto` measures at the pixels of a round.

use super::allocation::may_split;
use super::auto_pixels::Place;
use super::auto_round::{Candidate, Difference};
use super::worker::Worker;
use super::{Run, processor_time};
use crate::film::{FeatureSet, PixelSample};
use crate::imaging::metrics::difference::DEFAULT_EPSILON;
use crate::integrators::PathTracer;
use crate::integrators::light_paths::{self, LightPilot};
use crate::integrators::path::CameraSample;
use crate::integrators::reuse::{self, Groups};
use crate::settings::IntegratorSettings;

/// Light paths per camera sample to which all candidates that know them leave what they find, if no number is asked for.
const LIGHT_PATHS: f64 = 0.25;

/// What [`measure`] found.
pub(super) struct Chunk {
    /// Of each candidate, processor time (ns), and the difference of the two means of each pixel, times weights.
    pub(super) of_candidates: Vec<(f64, Vec<Difference>)>,
    /// Σ of 1/(m² + ε) of the pixels times their weights, averaged over channels, m being their means.
    pub(super) relative: f64,
    /// Processor time of all that (ns).
    pub(super) spent: f64,
}

/// Renders some pixels with each candidate and seed. The `turn` decides which candidate is first. What `light` paths find, if
/// they are of use, is left to them, and where samples are split the noise of visible lights is left to their looks.
pub(super) fn measure(
    run: &Run<'_>,
    (pixels, spp): (&[Place], u32),
    candidates: &[Candidate],
    light: Option<&LightPilot>,
    (seeds, turn): ([u32; 2], usize),
) -> Chunk {
    let begin = processor_time::of_thread();
    let groups = if reuse::obstacle(run.job).is_none() { Groups::Grid } else { Groups::None };
    let mut worker = Worker::new(PathTracer::sharing(groups, FeatureSet::None));
    let is_split = |k: usize| may_split(run.job.settings(), &candidates[k].settings);
    let seeing = (0..candidates.len()).find(|&k| is_split(k));
    let seeing = seeing.map(|k| IntegratorSettings { max_depth: 0, ..candidates[k].settings });
    let seen = seeing.map(|settings| seeds.map(|seed| image(run, &mut worker, &settings, (pixels, spp), seed)));
    let weight = pixels.iter().map(|place| place.weight).sum::<f64>() / pixels.len() as f64;
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
        times[k] = (processor_time::of_thread() - start).as_secs_f64() * 1e9 * weight;
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
        [channels.iter().sum::<f64>(), channels.iter().map(|d| d * d).sum::<f64>()]
            .map(|sum| pixels[i].weight * sum / 3.0)
    };
    let of_candidate = |k| (0..pixels.len()).map(|i| difference(&images[k], is_split(k), i)).collect();
    let of_candidates = times.into_iter().enumerate().map(|(k, time)| (time, of_candidate(k))).collect();
    let of_channels = |i: usize| (0..3).map(|c| relative_to(i, c)).sum::<f64>() / 3.0 * pixels[i].weight;
    let relative = (0..pixels.len()).map(of_channels).filter(|r| r.is_finite()).sum();
    Chunk { of_candidates, relative, spent: (processor_time::of_thread() - begin).as_secs_f64() * 1e9 }
}

/// The means of the samples of some pixels, with random numbers of a seed.
fn image(
    run: &Run<'_>,
    worker: &mut Worker<PathTracer>,
    settings: &IntegratorSettings,
    (pixels, spp): (&[Place], u32),
    seed: u32,
) -> Vec<[f64; 3]> {
    worker.samples.clear();
    let samples = pixels.iter().map(|place| (0, place.pixel, 0..spp));
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

//! The estimator `auto`: what is the most efficient for this image, by a pilot.
//!
//! Pixels, more of them where there is more noise ([`super::auto_pixels`]), are rendered with several settings, each with two independent seeds. The difference of
//! the two tells the standard deviation σ, relative to the mean, and the time of the thread is the cost. In paths, whose
//! pixels mostly have as many samples each, the error is the mean of σ². Where light is direct and samples are allocated in
//! proportion to σ, it is the square of the mean of σ, since edges of visible lights are left to looks; and the geometric mean of
//! both if numbers are uniform, so that these few edges do not choose for all other pixels.
//!
//! From few and from many light samples at first and at later vertices and BSDF samples at first ones follows a model of both
//! ([`lumiris_numbers::estimators::efficiency::Model`]), and from that the best numbers. What is best by the model then takes part in a second round on other pixels, together with what differs
//! in more than numbers. There a candidate takes the place of the one before it only if it is more efficient by more than
//! the pilot's noise, which the jackknife tells: all candidates have the same pixels, so that the difference of two of
//! them is known better than either.
//!
//! Where there are many lights and time for photons, `contributing` has a model of its own from the first round
//! ([`super::auto_contributing`]), and its best numbers take part in the second.
//!
//! Where lights at infinity are beside others, a round before these finds how many light samples are for them
//! ([`super::auto_lights`]).
//!
//! In paths, a few of them and numbers between them are compared once more on more pixels ([`super::auto_check`]), since few pixels
//! know an efficiency to a quarter. There, time is that of all that an image takes, with its part of loading and pilots.
//!
//! Then a further round finds by blocks of pixels whether they share paths, and with how many samples
//! ([`super::auto_reuse`]); a third of the blocks tells where there is nothing to be shared. What light paths find ([`crate::integrators::light_paths`]) is left to them in all rounds; how many
//! there are follows from a pilot of theirs, which knows the variance that camera paths would have of the same light: few
//! pixels of a round do not see it.
//!
//! Times differ from run to run, so the choice is made once, becomes part of the settings, and is recorded with them:
//! rendering with these settings gives the same image to the bit. All candidates are unbiased, and the pilot has random
//! numbers of its own; so the choice adds no bias.

use super::allocation::may_split;
use super::auto_candidates::{
    Numbers, contributing, different, goes_on_by_one, numbers_of, numbers_of_contributing, second_round,
    that_find_glows, usual, with_numbers, without_pilot,
};
use super::auto_check;
use super::auto_contributing::{self, Contributing};
use super::auto_lights;
use super::auto_measure::{Chunk, measure};
use super::auto_pixels::{Place, SEED, Scouted, grid, some_blocks};
use super::auto_reuse;
pub use super::auto_round::Trial;
use super::auto_round::{Candidate, Caution, Mean, Predicted, Round};
use super::preparation::Preparation;
use super::{RenderError, RenderSettings, Run, processor_time};
use crate::film::PixelBounds;
use crate::integrators::light_paths::{self, LightPilot};
use crate::integrators::reuse;
use crate::integrators::through_media;
use crate::scene::RenderJob;
use crate::settings::{
    Allocation, EstimatorKind, IntegratorKind, IntegratorSettings, Proposals, RisSettings, Settings, StageTimes,
};
use lumiris_numbers::estimators::efficiency::{KINDS, Model};
use lumiris_numbers::math::hash::pcg4d;
use lumiris_numbers::samplers::SamplerKind;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Fewest samples of a pixel and seed, in direct light and in paths, and most: with the fewest there are most pixels in the same
/// time, with fewer than the image has, what their net gains is not seen, which is more where light is direct.
const MIN_SPP: [u32; 2] = [16, 8];
const MAX_SPP: u32 = 32;
/// Pixels that a thread renders at a time.
const CHUNK: usize = 64;
/// Most pixels of a round: deviations are then known to a percent or two.
const MAX_PIXELS: usize = 4096;
/// Fewest pixels of a round for which a choice is more than chance.
const MIN_PIXELS: usize = 96;
/// Pixels of a round with which numbers of samples are known well enough in most images; and in direct light and in paths, from
/// which on more samples of a pixel tell more than more pixels.
const ENOUGH_PIXELS: usize = 384;
const MANY_PIXELS: [usize; 2] = [256, 128];
/// Time of all rounds but the check, as a fraction of that of the image: what is wanted, and the most where that is not enough.
const FRACTIONS: [f64; 2] = [0.03, 0.08];
/// Time of these rounds over that of rendering the pixels of one once, with the same number of samples and seeds: in direct
/// light, and in paths. Candidates with photons are beside that.
const TRIALS: [f64; 2] = [13.0, 28.0];
/// The same of the round that compares light choices.
const LIGHT_TRIALS: f64 = 3.0;
/// Pixels that are looked at before the rounds, for each pixel of one, and samples of each and seed.
const SCOUTED: usize = 8;
const SCOUT_SPP: u32 = 2;
/// Time of all rounds after the first one over that of the first, about.
const FOLLOWING: f64 = 7.0;
/// Standard error of what the model says of paths with more samples of two kinds, beside that of what was measured.
const ERROR_OF_BOTH: f64 = 0.3;
/// Share of the greatest efficiency, by the model, with which fewer samples will do; and fewer proposals.
const NEARLY: f64 = 0.99;
const RATIO_NEARLY: f64 = 0.95;

/// Numbers of light samples that are compared where light is direct, and of BSDF samples beside them.
const DIRECT: [u32; 9] = [1, 2, 4, 8, 12, 16, 24, 32, 48];
const DIRECT_BSDF: [u32; 5] = [1, 2, 4, 8, 16];
/// In paths, one is the BSDF sample by which the path goes on: numbers of light samples at first vertices and at later ones, and
/// of BSDF samples. Points of nets are best spread where they are as many as a power of two.
const FIRST: [u32; 6] = [1, 2, 4, 8, 16, 32];
const LATER: [u32; 5] = [1, 2, 4, 8, 16];
const BSDF: [u32; 4] = [1, 2, 4, 8];
/// Light paths per camera sample among which is chosen.
const LIGHT_PATHS: [f32; 8] = [0.0, 0.03125, 0.0625, 0.125, 0.25, 0.5, 1.0, 2.0];
/// Part of a pilot of light paths whose whole is traced before the image.
const LIGHT_PILOT: u64 = 4;
/// Numbers of samples in paths, and the edge of blocks of pixels that share them, where nothing is known of the image.
const USUAL_PATH: Numbers = [2, 1, 1];
const USUAL_EDGE: u32 = 3;
/// Numbers from which the model is fitted, in direct light and in paths: the first, and with more of each kind.
const FIT_DIRECT: [Numbers; 3] = [[4, 1, 1], [16, 1, 1], [4, 1, 4]];
const FIT_PATH: [Numbers; 4] = [[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]];
/// What numbers of samples leave of the variance, as a power of these: of independent ones, and of those of nets in paths.
const INDEPENDENT: [f64; KINDS] = [1.0; KINDS];
const OF_NETS: [f64; KINDS] = [1.25, 1.0, 1.0];
/// M/N from which the model of resampling is fitted, and among which it chooses.
const FIT_RATIOS: [u32; 2] = [2, 16];
const RATIOS: [u32; 8] = [1, 2, 3, 4, 6, 8, 12, 16];

/// What the pilot measured and chose.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct AutoChoice {
    /// Pixels of a round.
    pub pixels: usize,
    /// Samples of each and seed.
    pub spp: u32,
    /// The model of `mis`: time a of a camera sample (ns), in paths with its part of what the image takes before, and of each light
    /// sample at first and at later vertices, and BSDF sample.
    pub cost: Vec<f64>,
    /// The model: relative variance A, and of one sample of each of these kinds.
    pub variance: Vec<f64>,
    /// The model: powers of the numbers of samples, of which the inverse leaves so much of these variances.
    #[serde(default = "independent")]
    pub powers: Vec<f64>,
    /// Those with other fractions of light samples for lights at infinity.
    #[serde(default)]
    pub lights: Vec<Trial>,
    /// The trials of both rounds.
    pub trials: [Vec<Trial>; 2],
    /// Those of some of the second round and of numbers between them, on more pixels.
    #[serde(default)]
    pub checked: Vec<Trial>,
    /// Those with and without shared paths, in blocks of pixels.
    #[serde(default)]
    pub sharing: Vec<Trial>,
    /// The chosen one of all.
    pub chosen: String,
    /// Processor time of the pilot (s).
    pub seconds: f64,
}

fn independent() -> Vec<f64> {
    INDEPENDENT.to_vec()
}

/// Chooses, where the settings of `job` ask for it, and changes them; `None` if they do not, or if the image is too small
/// for a pilot. On the threads of the current pool.
pub(super) fn choose(job: &mut RenderJob, how: &Preparation<'_>) -> Result<Option<AutoChoice>, RenderError> {
    if job.settings().integrator.estimator != EstimatorKind::Auto {
        return Ok(None);
    }
    // Media that glow are lights only where the path is the one BSDF sample
    if job.lights.find_glows() && job.settings().integrator.bsdf_fraction.is_none() {
        job.change(|s| s.integrator.bsdf_fraction = Some(0.0));
    }
    let chooses_lights = auto_lights::is_open(&job.lights, &job.settings().integrator);
    let pilot = Pilot::new(job.settings(), &job.world.scene.film.bounds, chooses_lights);
    let choice = pilot.map(|mut pilot| pilot.choose(job, how)).transpose()?;
    let settings = choice.as_ref().map_or_else(|| unmeasured(job), |(_, settings)| *settings);
    job.change(|s| s.integrator = settings);
    Ok(choice.map(|(choice, _)| choice))
}

/// The settings of an image that is too small for a pilot: those that are good in most scenes.
fn unmeasured(job: &RenderJob) -> IntegratorSettings {
    let Settings { integrator: base, sampling } = *job.settings();
    if !has_vertices(&base) {
        return without_pilot(&base);
    }
    if base.depth() <= 1 {
        return usual(&base);
    }
    let is_open = sampling.allocation == Allocation::Auto && reuse::obstacle(job).is_none();
    let path_reuse = base.path_reuse.or(is_open.then_some(USUAL_EDGE));
    IntegratorSettings { path_reuse, ..with_numbers(&base, USUAL_PATH) }
}

/// True if its integrator has estimates at path vertices alone.
fn has_vertices(settings: &IntegratorSettings) -> bool {
    matches!(settings.kind, IntegratorKind::Direct | IntegratorKind::Path)
}

/// M/N of `ris`, and the times from which it follows: of a proposal, and of everything else for each sample. It is the most
/// efficient ratio by a model of what few and many proposals take and leave of the variance, where T2/T1 leaves out what
/// each camera sample costs anyway [Talbot 2005, §4.3]. `None` if the image is too small for a pilot. On the threads of the
/// current pool.
pub(super) fn proposals(job: &RenderJob, how: &Preparation<'_>) -> Result<Option<(u32, StageTimes)>, RenderError> {
    let Some(mut pilot) = Pilot::new(job.settings(), &job.world.scene.film.bounds, false) else { return Ok(None) };
    let base = job.settings().integrator;
    let samples = base.sample_counts().samples;
    let with_ratio = |ratio: u32| {
        let proposals = Proposals::Fixed(samples * ratio);
        let ris = RisSettings { proposals, ..base.ris };
        Candidate::named(IntegratorSettings { samples: Some(samples), ris, ..base })
    };
    let candidates = FIT_RATIOS.map(with_ratio);
    pilot.scout(job, &candidates[0], how)?;
    let round = pilot.round(job, &candidates, FIRST_ROUND, how)?;
    let ratios = FIT_RATIOS.map(|ratio| [f64::from(ratio), 1.0, 1.0]);
    let model = round.models(&ratios, INDEPENDENT).remove(0);
    let [ratio, ..] = model.best([&RATIOS, &[1], &[1]], RATIO_NEARLY, |_| true);
    let of_sample = |nanoseconds: f64| (nanoseconds / f64::from(samples) * 10.0).round().max(1.0) / 10.0;
    let times = StageTimes { t1: of_sample(model.cost[1]), t2: of_sample(model.cost[0]) };
    Ok(Some((samples * ratio, times)))
}

/// True if the estimator is `auto` and its choice follows from a pilot's times. Numbers of the image and of the settings
/// alone decide that, so it is the same on all machines.
pub(super) fn is_measured(settings: &Settings, bounds: &PixelBounds) -> bool {
    settings.integrator.estimator == EstimatorKind::Auto && Pilot::new(settings, bounds, false).is_some()
}

/// Numbers of the rounds, on which their pixels and random numbers depend.
const FIRST_ROUND: usize = 0;
const SECOND_ROUND: usize = 1;
const SHARING: usize = 2;
const LIGHTS: usize = 3;
const SCOUTING: usize = 4;
const CHECK: usize = 5;

/// What was measured of the chosen settings: the variance of a camera sample, its time (ns), and [`Round::relative`].
struct Measured {
    variance: f64,
    nanoseconds: f64,
    relative: f64,
}

/// Candidates, the index of the chosen one, and what was measured to check it, if it was.
type Checked = (Vec<Candidate>, usize, Option<(f64, Vec<Trial>)>);

/// Where a round measures.
struct Pilot {
    /// Pixels of a round.
    count: usize,
    has_lights: bool,
    /// Those of the rounds [`FIRST_ROUND`], [`SECOND_ROUND`], [`SHARING`], by blocks, and [`LIGHTS`], which may have none.
    places: [Vec<Place>; 4],
    /// What the pixels of a further round are drawn from.
    scouted: Option<Scouted>,
    /// Samples of each and seed.
    spp: u32,
    seed: u32,
    /// What the image takes before it is rendered, per camera sample (ns).
    fixed: f64,
    /// What light paths find, if they may be of use.
    light: Option<LightPilot>,
}

impl Pilot {
    /// `None` if the image is too small, or its integrator has no estimates at path vertices alone.
    /// Where `chooses_lights`, it has a round for that, if there is time.
    fn new(settings: &Settings, bounds: &PixelBounds, chooses_lights: bool) -> Option<Self> {
        let Settings { integrator, sampling } = settings;
        let samples = bounds.area() as f64 * f64::from(sampling.pilot_spp());
        let kind = usize::from(integrator.depth() > 1);
        let (trials, fewest, many) = (TRIALS[kind], MIN_SPP[kind], MANY_PIXELS[kind]);
        let pixels_in = |trials: f64, spp: u32| {
            let [wanted, most] =
                FRACTIONS.map(|fraction| (samples * fraction / (f64::from(2 * spp) * trials)) as usize);
            wanted.max(most.min(ENOUGH_PIXELS)).min(MAX_PIXELS)
        };
        let mut spp = 1 << sampling.pilot_spp().clamp(1, MAX_SPP).ilog2();
        while spp > fewest && pixels_in(trials, spp) < many {
            spp /= 2;
        }
        let with_lights = pixels_in(trials + LIGHT_TRIALS, spp);
        let has_lights = chooses_lights && with_lights >= MIN_PIXELS;
        let count = if has_lights { with_lights } else { pixels_in(trials, spp) };
        (has_vertices(integrator) && count >= MIN_PIXELS).then(|| Pilot {
            count,
            has_lights,
            places: Default::default(),
            scouted: None,
            spp,
            seed: sampling.seed,
            fixed: 0.0,
            light: None,
        })
    }

    fn choose(
        &mut self,
        job: &mut RenderJob,
        how: &Preparation<'_>,
    ) -> Result<(AutoChoice, IntegratorSettings), RenderError> {
        let start = processor_time::of_process();
        if job.settings().integrator.light_paths.is_none_or(|paths| paths > 0.0) {
            self.light = LightPilot::new(job, LIGHT_PILOT);
        }
        let has_later = job.settings().integrator.depth() > 1;
        let fit: &[Numbers] = if has_later { &FIT_PATH } else { &FIT_DIRECT };
        let few = fit[0];
        let nanoseconds = self.scout(job, &Candidate::named(with_numbers(&job.settings().integrator, few)), how)?;
        self.add_time(job, how, how.loading + (processor_time::of_process() - start));
        let of_lights = processor_time::of_process();
        let lights = self.choose_lights(job, few, how)?;
        self.add_time(job, how, processor_time::of_process() - of_lights);
        let photons = Contributing::new(job, nanoseconds);
        let base = job.settings().integrator;
        let base = &base;
        // First round: the model
        let is_open = base.bsdf_fraction.is_none() && base.samples.is_none();
        let fitted = fit.iter().filter(|n| n[2] == few[2] || is_open && goes_on_by_one(base, n));
        let mut candidates = different(fitted.map(|&n| with_numbers(base, n)));
        // Where the share of BSDF samples is given, one stands for all of them
        let numbers = |settings: &IntegratorSettings| {
            let all = [0, 1].map(|vertex| settings.sample_counts_at(vertex).samples.max(2) - 1);
            let of_one = [all[0], if has_later { all[1] } else { 1 }, 1];
            (if is_open { numbers_of(settings) } else { of_one }).map(f64::from)
        };
        let fitted: Vec<_> = candidates.iter().map(|c| numbers(&c.settings)).collect();
        candidates.extend(photons.iter().flat_map(Contributing::fit));
        let of_round = processor_time::of_process();
        let mut first = self.round(job, &candidates, FIRST_ROUND, how)?;
        let before = self.fixed;
        self.add_time(job, how, (processor_time::of_process() - of_round).mul_f64(1.0 + FOLLOWING));
        first.measured.iter_mut().for_each(|(time, _)| *time += self.fixed - before);
        let is_net = has_later && job.settings().sampling.sampler != SamplerKind::Independent;
        let powers = if is_net { OF_NETS } else { INDEPENDENT };
        let models = first.models(&fitted, powers);
        let of_contributing = photons.as_ref().map(|_| Contributing::models(&first, fitted.len(), &candidates, powers));
        let model = models[0];
        // A power that was fitted is known as far as twice the most that was measured
        let is_known = |n: &u32| model.powers[0] <= 1.0 || *n <= 2 * fit[1][0];
        let known: Vec<u32> = DIRECT.into_iter().filter(is_known).collect();
        let mut choices: [&[u32]; KINDS] =
            if has_later { [&FIRST, &LATER, &BSDF] } else { [&known, &few[1..2], &DIRECT_BSDF] };
        if !is_open {
            choices[2] = &few[2..];
        }
        let best = model.best(choices, NEARLY, |n| !is_open || goes_on_by_one(base, n));
        let trials = first.trials(&candidates);

        // Second round: the best by the model, and what else there is
        let mut candidates = second_round(base, best);
        // Few pixels have most of the noise of glossy surfaces, so that a model may know little of BSDF samples
        let gain = |n: [f64; KINDS]| Round::predicted(&models[..1], n)[0];
        let of_best = gain(best.map(f64::from)) - gain(fitted[0]);
        let with_more = fitted.iter().position(|n| n[2] > f64::from(best[2]));
        if let Some(k) = with_more.filter(|&k| has_later && first.may_have(k, of_best)) {
            let more = (1..=best[1]).rev().map(|later| [best[0], later, fitted[k][2] as u32]);
            let more = more.filter(|n| goes_on_by_one(base, n)).map(|n| with_numbers(base, n)).next();
            let is_new = |more: &IntegratorSettings| candidates.iter().all(|c| c.settings != *more);
            candidates.extend(more.filter(is_new).map(Candidate::named));
        }
        if let (Some(photons), Some(of_photons)) = (&photons, &of_contributing) {
            let with_photons = photons.best(&of_photons[0], NEARLY);
            // Others would take most of the time of the round
            if auto_contributing::is_far_better(&with_photons[0], of_photons, (best, &models)) {
                candidates.truncate(1);
            }
            candidates.extend(with_photons);
        }
        if !job.world.scene.media.is_empty() {
            candidates.retain(|c| through_media::obstacle_of(&c.settings).is_none());
        }
        // All candidates choose from the same lights, and others would not find what glows
        if job.lights.find_glows() {
            candidates = that_find_glows(base, candidates);
        }
        let second = self.round(job, &candidates, SECOND_ROUND, how)?;
        let predicted = |candidate: &Candidate| {
            if candidate.settings.estimator == EstimatorKind::Contributing {
                let models = of_contributing.as_ref()?;
                let numbers = numbers_of_contributing(&candidate.settings).map(f64::from);
                return Some(Predicted { gains: Round::predicted(models, numbers), error: 0.0 });
            }
            let IntegratorSettings { samples, later_samples, bsdf_fraction, .. } = candidate.settings;
            let with_its = IntegratorSettings { samples, later_samples, bsdf_fraction, ..without_pilot(base) };
            let [light, _, bsdf] = numbers(&with_its);
            // What BSDF samples leave beside many light samples is not in the model
            let error = if has_later && light > 1.0 && bsdf > 1.0 { ERROR_OF_BOTH } else { 0.0 };
            let gains = || Round::predicted(&models, numbers(&with_its));
            (candidate.settings == with_its).then(|| Predicted { gains: gains(), error })
        };
        let predicted: Vec<_> = candidates.iter().map(predicted).collect();
        let chosen = second.choose(&candidates, &predicted, Caution::OF_FEW);
        let trials = [trials, second.trials(&candidates)];
        let gains: Vec<_> = (0..candidates.len()).map(|k| second.united_gain(k, chosen, &predicted)).collect();
        let (candidates, chosen, checked) = self.check(job, candidates, (&second, &gains, chosen), how)?;
        let (relative, chosen_trial) = match &checked {
            Some((relative, checked)) => (*relative, &checked[chosen]),
            None => (second.relative, &trials[1][chosen]),
        };
        let chosen = &candidates[chosen];
        let of_chosen = match &of_contributing {
            Some(models) if chosen.settings.estimator == EstimatorKind::Contributing => &models[0],
            _ => &model,
        };
        let (sharing, mut settings) = self.share(job, chosen, of_chosen, how)?;
        // Where sharing is given, it has no trials
        let of_sharing = sharing.get(1).filter(|_| settings.path_reuse.is_some());
        let &Trial { variance, nanoseconds, .. } = of_sharing.unwrap_or(chosen_trial);
        settings.light_paths = self.choose_light_paths(job, &settings, &Measured { variance, nanoseconds, relative });
        // Other settings that use a cache have one of their own number of photons
        if chosen.settings.estimator != EstimatorKind::Contributing {
            job.lights.set_visibility_cache(None);
        }
        let choice = AutoChoice {
            pixels: self.places[FIRST_ROUND].len(),
            spp: self.spp,
            cost: model.cost.to_vec(),
            variance: model.variance.to_vec(),
            powers: model.powers.to_vec(),
            chosen: Candidate::named(settings).name,
            seconds: (processor_time::of_process() - start).as_secs_f64(),
            lights,
            trials,
            checked: checked.map_or(Vec::new(), |(_, trials)| trials),
            sharing,
        };
        Ok((choice, settings))
    }

    /// Adds what was done before the image to the time of each of its samples, where there are paths, and the number of samples
    /// follows neither from their noise nor from their time.
    fn add_time(&mut self, job: &RenderJob, how: &Preparation<'_>, time: Duration) {
        let Settings { integrator, sampling } = job.settings();
        if sampling.noise.is_none() && how.time_limit.is_none() && integrator.depth() > 1 {
            let samples = job.world.scene.film.bounds.area() as f64 * f64::from(sampling.spp);
            self.fixed += time.as_secs_f64() * 1e9 / samples;
        }
    }

    /// Before all other rounds: the fraction of light samples for lights at infinity, with few samples.
    fn choose_lights(
        &self,
        job: &mut RenderJob,
        few: Numbers,
        how: &Preparation<'_>,
    ) -> Result<Vec<Trial>, RenderError> {
        let base = job.settings().integrator;
        if self.places[LIGHTS].is_empty() {
            return Ok(Vec::new());
        }
        let usual = job.lights.tree_choice().infinite_fraction();
        let candidate = [Candidate::named(with_numbers(&base, few))];
        let (trials, fraction) = auto_lights::best(usual, |fraction| {
            job.change(|s| s.integrator.infinite_fraction = fraction);
            self.round(job, &candidate, LIGHTS, how)
        })?;
        job.change(|s| s.integrator.infinite_fraction = fraction);
        Ok(trials)
    }

    /// After the second `round`, by which candidates have these gains over the chosen one: some of them once more, and numbers
    /// between them, on more pixels. Returns what is left to choose from, what is chosen, and [`Round::relative`] with the trials.
    fn check(
        &self,
        job: &RenderJob,
        candidates: Vec<Candidate>,
        (round, gains, chosen): (&Round, &[(f64, f64)], usize),
        how: &Preparation<'_>,
    ) -> Result<Checked, RenderError> {
        let Settings { integrator: base, sampling } = *job.settings();
        let samples = job.world.scene.film.bounds.area() as f64 * f64::from(sampling.pilot_spp());
        let of_both =
            |(c, (time, _)): (&Candidate, &(f64, _))| [*time, round.effort * (*time - c.preparation - self.fixed)];
        let times: Vec<[f64; 2]> = candidates.iter().zip(&round.measured).map(of_both).collect();
        let most = self.scouted.as_ref().map_or(0, Scouted::len).min(MAX_PIXELS);
        let sizes = (self.places[SECOND_ROUND].len()..=most, self.spp, samples);
        // Where light is direct, more pixels led to choices that were no better
        let has_later = base.depth() > 1;
        let some = has_later.then(|| auto_check::choose(&base, &candidates, &times, (gains, chosen), sizes)).flatten();
        let (Some(scouted), Some((some, count))) = (&self.scouted, some) else {
            return Ok((candidates, chosen, None));
        };
        let places = scouted.draw(count, CHECK as u32);
        let mut round = self.measured(job, &some, (&places, self.spp, CHECK), how)?;
        let some = round.by_times(some);
        let chosen = round.choose(&some, &[], Caution::OF_MANY);
        let trials = round.trials(&some);
        Ok((some, chosen, Some((round.relative, trials))))
    }

    /// Last round: whether pixels share paths, and the numbers of samples if they do.
    fn share(
        &self,
        job: &RenderJob,
        &Candidate { settings: ref chosen, preparation, .. }: &Candidate,
        model: &Model,
        how: &Preparation<'_>,
    ) -> Result<(Vec<Trial>, IntegratorSettings), RenderError> {
        let Settings { integrator: base, sampling } = *job.settings();
        let is_open = base.path_reuse.is_none() && sampling.allocation == Allocation::Auto;
        if !is_open || reuse::obstacle(job).is_some() || self.places[SHARING].is_empty() {
            return Ok((Vec::new(), *chosen));
        }
        // Twice the light samples at first and at later vertices, where they are open and there is one BSDF sample
        let is_contributing = chosen.estimator == EstimatorKind::Contributing;
        let numbers = if is_contributing { numbers_of_contributing(chosen) } else { numbers_of(chosen) };
        let [first, later, rest] = numbers;
        let more = [[2 * first, later, rest], [first, 2 * later, rest]];
        let of = |n: Numbers| {
            let of_base = if is_contributing { contributing(&base, n) } else { with_numbers(&base, n) };
            let IntegratorSettings { samples, later_samples, bsdf_fraction, .. } = of_base;
            IntegratorSettings { samples, later_samples, bsdf_fraction, ..*chosen }
        };
        let settings = more.map(of);
        let is_open = (is_contributing || chosen.estimator == EstimatorKind::Mis && rest == 1)
            && settings.iter().all(|s| [s.samples, s.later_samples] != [chosen.samples, chosen.later_samples]);
        let mut candidates = auto_reuse::candidates(chosen, if is_open { &settings } else { &[] });
        candidates.iter_mut().for_each(|c| c.preparation = preparation);
        let measured = |candidates: &[Candidate], places: &[Place]| {
            let round = self.measured(job, candidates, (places, self.spp, SHARING), how)?.by_blocks(auto_reuse::BLOCK);
            let trials = round.trials(candidates);
            // Few pixels at edges, whose camera samples differ, have most of the mean variance, and all others most of what is shared
            Ok::<_, RenderError>((Round { mean: Mean::Both, ..round }, trials))
        };
        // Some of the blocks tell where there is nothing to be shared, though fewer samples at later vertices may do then
        let all = &self.places[SHARING];
        let some = some_blocks(all);
        let fewer = if is_open {
            model.cost(numbers.map(f64::from)) / model.cost([first, 1, rest].map(f64::from))
        } else {
            1.0
        };
        if !some.is_empty() {
            let (round, trials) = measured(&candidates[..2], &some)?;
            if !auto_reuse::is_possible(&round, fewer) {
                return Ok((trials, *chosen));
            }
        }
        let (round, trials) = measured(&candidates, all)?;
        let shared = if is_open {
            let of_pilot = round.models_from(1, &[numbers, more[0], more[1]].map(|n| n.map(f64::from)), model.powers);
            let choices = auto_reuse::choices(&FIRST, numbers);
            auto_reuse::best_numbers(&round, numbers, (model, &of_pilot), choices.each_ref().map(Vec::as_slice))
        } else {
            auto_reuse::best(&round).map(|edge| (edge, numbers))
        };
        let Some((edge, numbers)) = shared else { return Ok((trials, *chosen)) };
        let with_its = if is_open { of(numbers) } else { *chosen };
        Ok((trials, IntegratorSettings { path_reuse: Some(edge), ..with_its }))
    }

    /// Last: how many light paths there are for each camera sample, where a camera sample by the settings has the variance and
    /// the time (ns) given.
    fn choose_light_paths(&self, job: &RenderJob, settings: &IntegratorSettings, at: &Measured) -> Option<f32> {
        let given = settings.light_paths;
        let Some(light) = self.light.as_ref().filter(|_| given.is_none()) else { return given };
        if light_paths::obstacle_of(job, settings).is_some() {
            return None;
        }
        let samples = job.world.scene.film.bounds.area() as f64 * f64::from(job.settings().sampling.pilot_spp());
        let error = |per_sample: f32| {
            let n = f64::from(per_sample);
            (at.variance + at.relative * light.variance(n)) * (at.nanoseconds + light.time(n, samples))
        };
        LIGHT_PATHS.into_iter().min_by(|a, b| error(*a).total_cmp(&error(*b)))
    }

    /// Finds by a few samples of a candidate where the noise is, and draws the pixels of all rounds. Returns the time of a camera
    /// sample (ns).
    fn scout(&mut self, job: &RenderJob, candidate: &Candidate, how: &Preparation<'_>) -> Result<f64, RenderError> {
        let bounds = job.world.scene.film.bounds;
        let (pixels, columns) = grid(&bounds, SCOUTED * self.count);
        let places: Vec<Place> = pixels.iter().map(|&pixel| Place { pixel, weight: 1.0 }).collect();
        let candidates = std::slice::from_ref(candidate);
        self.warm_up(job, &places, candidates);
        let round = self.measured(job, candidates, (&places, SCOUT_SPP, SCOUTING), how)?;
        let variances: Vec<f64> = round.measured[0].1.iter().map(|[_, squared]| *squared).collect();
        let scouted = Scouted::new(pixels, columns, &variances);
        let count = self.count;
        let drawn = |round: usize| scouted.draw(count, round as u32);
        self.places = [
            drawn(FIRST_ROUND),
            drawn(SECOND_ROUND),
            scouted.draw_blocks(&bounds, 3 * count, SHARING as u32),
            if self.has_lights { drawn(LIGHTS) } else { Vec::new() },
        ];
        self.scouted = Some(scouted);
        Ok(round.measured[0].0)
    }

    /// Renders some pixels on each thread, so that what is measured first is not what finds all caches cold.
    fn warm_up(&self, job: &RenderJob, places: &[Place], candidates: &[Candidate]) {
        let (render, stop) = (RenderSettings::default(), AtomicBool::new(false));
        let run = Run::new(job, &render, &stop, &|_| ());
        let some = &places[..places.len().min(CHUNK)];
        rayon::broadcast(|_| measure(&run, (some, self.spp), candidates, None, ([0; 2], 0)));
    }

    /// Measures all candidates on the pixels of a round.
    fn round(
        &self,
        job: &RenderJob,
        candidates: &[Candidate],
        round: usize,
        how: &Preparation<'_>,
    ) -> Result<Round, RenderError> {
        self.measured(job, candidates, (&self.places[round], self.spp, round), how)
    }

    /// The same on other pixels, with so many samples of each and seed.
    fn measured(
        &self,
        job: &RenderJob,
        candidates: &[Candidate],
        (places, spp, round): (&[Place], u32, usize),
        how: &Preparation<'_>,
    ) -> Result<Round, RenderError> {
        let (render, stop) = (RenderSettings::default(), AtomicBool::new(false));
        let run = Run::new(job, &render, &stop, &|_| ());
        let seeds = [0, 1].map(|k| pcg4d([self.seed, SEED, round as u32, k])[0]);
        let chunks: Vec<_> = places.chunks(CHUNK).enumerate().collect();
        let of_chunk = |(i, places): (usize, &[Place])| {
            how.goes_on()?;
            Ok(measure(&run, (places, spp), candidates, self.light.as_ref(), (seeds, i)))
        };
        let measured: Vec<Chunk> = chunks.into_par_iter().map(of_chunk).collect::<Result<_, RenderError>>()?;
        let samples = places.len() as f64 * f64::from(2 * spp);
        let of_sample = |k: usize| measured.iter().map(|chunk| chunk.of_candidates[k].0).sum::<f64>() / samples;
        let of_samples = (0..candidates.len()).map(of_sample).sum::<f64>() * samples;
        let spent = measured.iter().map(|chunk| chunk.spent).sum::<f64>();
        let effort = if of_samples > 0.0 { spent / of_samples } else { 1.0 };
        let of = |k: usize| {
            let differences = measured.iter().flat_map(|chunk| &chunk.of_candidates[k].1).copied().collect();
            (of_sample(k) + candidates[k].preparation + self.fixed, differences)
        };
        let (settings, sampling) = (&candidates[0].settings, &job.settings().sampling);
        let mean = match settings.depth() {
            0 | 1 if sampling.noise.is_none() && may_split(job.settings(), settings) => Mean::Deviations,
            0 | 1 => Mean::Both,
            _ => Mean::Squares,
        };
        let relative = measured.iter().map(|chunk| chunk.relative).sum::<f64>() / places.len() as f64;
        Ok(Round { measured: (0..candidates.len()).map(of).collect(), spp, mean, relative, effort })
    }
}

//! Trials that search for settings more efficient than the [rule](super::rule)'s choice: for long renderings, farms and
//! sequences, where half a minute of trials pays off.
//!
//! Starting from the rule's choice, one setting after the other is changed as long as the gain is significant. The
//! result is compared with the rule on other cells, and is adopted if it gains 10 %.

use super::constants::{MANY_LIGHTS, MIN_ERRORS, OTHERS, TUNE_CELLS, TUNE_GAIN, TUNE_SPP, TUNE_TRIALS};
use super::facts::Facts;
use super::preparation::{PlanError, Preparation};
use super::processor_time;
use super::trials::{LogGain, TrialResult, Trials};
use super::visibility_cache::build_visibility_cache;
use crate::integrators::exclusions::{self, Feature};
use crate::scene::RenderJob;
use crate::settings::{Allocation, ContributingSettings, EstimatorKind, IntegratorSettings, Settings, bsdf_samples};
use serde::{Deserialize, Serialize};

/// One trial.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct Trial {
    /// Name: the difference from the best settings so far.
    pub name: String,
    /// CPU time per camera sample (ns).
    pub nanoseconds: f64,
    /// 1/(error × time), relative to the rule.
    pub efficiency: f64,
    /// Standard error of the logarithm of the efficiency.
    pub error: f64,
}

/// Result of all trials.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct Tuning {
    /// All trials. The first one is the rule.
    pub trials: Vec<Trial>,
    /// Efficiency of the best settings relative to the rule, on cells that the search did not use.
    pub gain: f64,
    /// Standard error of the logarithm of `gain`.
    pub error: f64,
    /// True if the gain suffices to adopt the settings; otherwise the rule's settings are kept.
    pub is_taken: bool,
    /// CPU time of all trials (s).
    pub seconds: f64,
}

/// Tunes the settings of a job. They are the choice of the rule, made from the settings `open` and from `facts`.
pub(super) fn tune(
    job: &mut RenderJob,
    open: &Settings,
    facts: &Facts,
    how: &Preparation<'_>,
) -> Result<Tuning, PlanError> {
    // Search
    let start = processor_time::of_process();
    let rule = job.settings().integrator;
    let mut search = Search::new(job, how)?;
    for changes in steps(open, facts, job) {
        search.climb(job, &changes, how)?;
    }

    // Compare the result with the rule on other cells
    let found = search.best;
    let mut trials = Trials::new(job, how, 2 * TUNE_CELLS, 1, TUNE_SPP);
    let [rule_measured, found_measured] = [rule, found].map(|settings| {
        job.change(|s| s.integrator = settings);
        trials.measure(job)
    });
    let LogGain { value: gain, error } = found_measured.gain_over(&rule_measured);
    let is_taken = gain > TUNE_GAIN.ln().max(MIN_ERRORS * error);

    // Keep the better settings
    job.change(|s| s.integrator = if is_taken { found } else { rule });
    if job.settings().integrator.estimator != EstimatorKind::Contributing {
        job.lights.set_visibility_cache(None);
    }
    let seconds = (processor_time::of_process() - start).as_secs_f64();
    Ok(Tuning { trials: search.trials, gain: gain.exp(), error, is_taken, seconds })
}

/// Changes to try, in steps, for settings that are open. A step applies its first change that gains, as often as it
/// gains.
fn steps(open: &Settings, facts: &Facts, job: &RenderJob) -> Vec<Vec<Change>> {
    // Lights
    let i = open.integrator;
    let mut steps: Vec<Vec<Change>> = Vec::new();
    let is_possible = |estimator| exclusions::refusal(job, &IntegratorSettings { estimator, ..i }).is_none();
    if facts.lights >= MANY_LIGHTS && is_possible(EstimatorKind::Contributing) && !job.lights.samples_volumes() {
        steps.push(vec![Change::Contributing]);
    }
    if i.infinite_fraction.is_none() && facts.sky > 0.0 && facts.lights > 1 {
        steps.push(vec![Change::Sky(0.75), Change::Sky(0.875), Change::Sky(0.25)]);
    }

    // Sample counts
    let numbers = [
        (i.samples.is_none(), vec![Change::Double, Change::Halve]),
        (i.bsdf_fraction.is_none() && !job.lights.samples_volumes(), vec![Change::Bsdf(0.5), Change::Bsdf(0.0)]),
        (i.later_samples.is_none() && i.depth() > 1, vec![Change::MoreLater, Change::FewerLater]),
    ];

    // Shared paths
    let may_share = open.sampling.allocation == Allocation::Auto && exclusions::allows(job, Feature::Sharing);
    let is_of = |(is_open, changes): &(bool, Vec<Change>)| is_open.then(|| changes.clone());
    steps.extend(numbers.iter().filter_map(is_of));
    if i.path_reuse.is_none() && may_share {
        steps.push(vec![Change::LargerBlocks, Change::SmallerBlocks]);
    }

    // Sample counts again, then resampling
    if i.samples.is_none() {
        steps.push(vec![Change::Double, Change::Halve]);
    }
    if is_possible(EstimatorKind::Ris) && !job.lights.samples_volumes() {
        steps.push(vec![Change::Resampling]);
    }
    steps
}

/// A change of settings.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Change {
    Double,
    Halve,
    Bsdf(f32),
    MoreLater,
    FewerLater,
    LargerBlocks,
    SmallerBlocks,
    Sky(f32),
    Resampling,
    Contributing,
}

impl Change {
    /// The changed settings; `None` if nothing changes.
    fn of(self, settings: &IntegratorSettings) -> Option<IntegratorSettings> {
        let [first, later] = [0, 1].map(|vertex| settings.sample_counts_at(vertex).samples);
        let edge = settings.path_reuse.unwrap_or(1);
        let mut s = *settings;
        match self {
            Change::Double => s.samples = Some(2 * first),
            Change::Halve => s.samples = Some((first / 2).max(2)),
            Change::Bsdf(fraction) => s.bsdf_fraction = Some(fraction),
            Change::MoreLater => s.later_samples = Some(later + later.div_ceil(2)),
            Change::FewerLater => s.later_samples = Some((later - later / 3).max(2)),
            Change::LargerBlocks => s.path_reuse = Some((edge + edge.div_ceil(2)).min(8)),
            Change::SmallerBlocks => s.path_reuse = Some((edge - edge.div_ceil(3)).max(1)),
            Change::Sky(fraction) => s.infinite_fraction = Some(fraction),
            Change::Resampling => {
                (s.estimator, s.samples, s.later_samples) = (EstimatorKind::Ris, None, settings.later_samples);
            }
            Change::Contributing => {
                let others = s.contributing.noncontributing_samples.or(Some(OTHERS[usize::from(s.depth() > 1)]));
                s.estimator = EstimatorKind::Contributing;
                s.contributing = ContributingSettings { noncontributing_samples: others, ..s.contributing };
            }
        }
        // Paths continue by the one BSDF sample of later vertices
        let goes_on = s.depth() <= 1 || bsdf_samples(s.sample_counts_at(1).samples.max(2), s.bsdf_fraction()) == 1;
        (s != *settings && goes_on).then_some(s)
    }

    /// Name of the changed settings.
    fn name(self, s: &IntegratorSettings) -> String {
        let [first, later] = [0, 1].map(|vertex| s.sample_counts_at(vertex).samples);
        match self {
            Change::Double | Change::Halve => format!("{first} samples"),
            Change::Bsdf(_) => {
                format!("{} of {first} samples by the BSDF", bsdf_samples(first.max(2), s.bsdf_fraction()))
            }
            Change::MoreLater | Change::FewerLater => format!("{later} samples at later vertices"),
            Change::LargerBlocks | Change::SmallerBlocks => {
                format!("paths shared by {0} × {0} pixels", s.path_reuse.unwrap_or(1))
            }
            Change::Sky(fraction) => format!("{fraction} of the light samples for the sky"),
            Change::Resampling => "resampling (RIS)".to_owned(),
            Change::Contributing => "samples of contributing lights".to_owned(),
        }
    }
}

/// State of the search.
struct Search {
    best: IntegratorSettings,
    measured: TrialResult,
    rule: TrialResult,
    pilot: Trials,
    /// Settings that were tried.
    tried: Vec<IntegratorSettings>,
    trials: Vec<Trial>,
}

impl Search {
    fn new(job: &mut RenderJob, how: &Preparation<'_>) -> Result<Self, PlanError> {
        how.goes_on()?;
        let mut pilot = Trials::new(job, how, TUNE_CELLS, 0, TUNE_SPP);
        // The first run only fills caches
        pilot.measure(job);
        let start = processor_time::of_process();
        let measured = pilot.measure(job);
        (how.expect)((processor_time::of_process() - start).mul_f64(TUNE_TRIALS));
        let best = job.settings().integrator;
        let trials = vec![trial("the rule".to_owned(), &measured, &measured)];
        Ok(Search { best, rule: measured.clone(), measured, pilot, tried: vec![best], trials })
    }

    /// Applies the first of the changes that gains, as often as it gains.
    fn climb(&mut self, job: &mut RenderJob, changes: &[Change], how: &Preparation<'_>) -> Result<(), PlanError> {
        for change in changes {
            let mut gains = false;
            while let Some(settings) = change.of(&self.best).filter(|settings| !self.tried.contains(settings)) {
                // Apply the change
                how.goes_on()?;
                self.tried.push(settings);
                if settings.uses_visibility_cache() && job.lights.visibility_cache().is_none() {
                    job.lights.set_visibility_cache(build_visibility_cache(job));
                }
                job.change(|s| s.integrator = settings);

                // Measure it
                let measured = self.pilot.measure(job);
                self.trials.push(trial(change.name(&settings), &measured, &self.rule));
                if !measured.is_better_than(&self.measured) {
                    break;
                }
                (self.best, self.measured, gains) = (settings, measured, true);
            }
            if gains {
                break;
            }
        }
        job.change(|s| s.integrator = self.best);
        Ok(())
    }
}

fn trial(name: String, measured: &TrialResult, rule: &TrialResult) -> Trial {
    let LogGain { value: gain, error } = measured.gain_over(rule);
    Trial { name, nanoseconds: measured.nanoseconds, efficiency: gain.exp(), error }
}

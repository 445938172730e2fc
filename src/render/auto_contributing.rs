//! What `--estimator auto` finds of `contributing`, where there are many lights: its numbers of samples, by a model of cost and
//! variance as that of `mis`, in which samples on the lights without photons take the place of BSDF samples.

use super::auto_candidates::{Numbers, contributing, different, numbers_of_contributing};
use super::auto_round::{Candidate, Round, jackknife};
use super::processor_time;
use super::visibility_cache::{PHOTON_PATHS, build_visibility_cache};
use crate::integrators::through_media;
use crate::scene::RenderJob;
use crate::settings::{EstimatorKind, IntegratorSettings, Settings};
use lumiris_numbers::estimators::efficiency::{KINDS, Model};

/// Lights from which on photons may tell which of them contribute.
const MANY_LIGHTS: usize = 16;
/// Time of a photon path (ns), about, and the share of an image's time that photons may take.
const PHOTON_TIME: f64 = 2000.0;
const PHOTON_SHARE: f64 = 0.1;
/// Fewest photon paths that tell enough.
const MIN_PHOTONS: f64 = 65_536.0;

/// How many times as efficient it must be by the models for the others to be left out, and by how many standard errors more.
const FAR_BETTER: f64 = 2.0;
const MIN_ERRORS: f64 = 2.0;

/// Numbers from which the model is fitted, in direct light and in paths.
const FIT_DIRECT: [Numbers; 3] = [[2, 1, 2], [8, 1, 2], [2, 1, 8]];
const FIT_PATH: [Numbers; 4] = [[2, 1, 1], [8, 1, 1], [2, 4, 1], [2, 1, 4]];
/// Numbers among which it chooses: hardly beyond what was measured.
const FIRST: [u32; 4] = [2, 4, 8, 16];
const LATER: [u32; 3] = [1, 2, 4];
const OTHERS: [u32; 5] = [1, 2, 4, 6, 8];
/// Numbers of samples on contributing lights above which fewer are tried too.
const MANY: u32 = 4;

/// True if a candidate with photons is so much more efficient by its models than the best numbers without photons are by theirs
/// that these need not be compared. Models are by all pixels, and without each of the groups.
pub(super) fn is_far_better(candidate: &Candidate, models: &[Model], others: (Numbers, &[Model])) -> bool {
    let with = Round::predicted(models, numbers_of_contributing(&candidate.settings).map(f64::from));
    let without = Round::predicted(others.1, others.0.map(f64::from));
    let (gain, error) = jackknife(&with.iter().zip(&without).map(|(a, b)| a - b).collect::<Vec<_>>());
    gain - MIN_ERRORS * error > FAR_BETTER.ln()
}

/// Candidates that know by photons which lights contribute.
pub(super) struct Contributing {
    base: IntegratorSettings,
    /// Time of the photons per camera sample of the image (ns).
    preparation: f64,
}

impl Contributing {
    /// Traces the photons for an image whose camera samples take about so long, and gives the lights of the job the cache of them;
    /// `None` unless there are many lights, and the image takes so long that photons enough take little of its time; where
    /// media hinder it; and where no light is to be left out, but the settings say so.
    pub(super) fn new(job: &mut RenderJob, nanoseconds: f64) -> Option<Self> {
        let Settings { integrator: mut base, sampling } = *job.settings();
        let samples = job.world.scene.film.bounds.area() as f64 * f64::from(sampling.pilot_spp());
        let affordable = samples * nanoseconds * PHOTON_SHARE / PHOTON_TIME;
        let given = base.photons.visibility_photons;
        base.estimator = EstimatorKind::Contributing;
        // All candidates choose from the same lights, and others would not find what glows
        if job.lights.find_glows()
            || job.lights.lit.len() < MANY_LIGHTS
            || base.leaves_lights_out()
            || affordable < given.map_or(MIN_PHOTONS, f64::from)
            || !job.world.scene.media.is_empty() && through_media::obstacle_of(&base).is_some()
        {
            return None;
        }
        if affordable < PHOTON_PATHS as f64 {
            base.photons.visibility_photons = given.or(Some(affordable as u32));
        }
        let start = processor_time::of_process();
        job.change(|s| s.integrator.photons.visibility_photons = base.photons.visibility_photons);
        let cache = build_visibility_cache(job);
        job.change(|s| s.integrator.photons.visibility_photons = given);
        let preparation = (processor_time::of_process() - start).as_secs_f64() * 1e9 / samples;
        job.lights.set_visibility_cache(cache.map(|(cache, _)| cache));
        Some(Contributing { base, preparation })
    }

    /// Those from which the model is fitted.
    pub(super) fn fit(&self) -> Vec<Candidate> {
        let numbers: &[Numbers] = if self.base.depth() > 1 { &FIT_PATH } else { &FIT_DIRECT };
        self.candidates(numbers)
    }

    fn candidates(&self, numbers: &[Numbers]) -> Vec<Candidate> {
        let mut candidates = different(numbers.iter().map(|&n| contributing(&self.base, n)));
        candidates.iter_mut().for_each(|c| c.preparation = self.preparation);
        candidates
    }

    /// The models by those, which stand in the round from `begin` on.
    pub(super) fn models(round: &Round, begin: usize, candidates: &[Candidate], powers: [f64; KINDS]) -> Vec<Model> {
        let numbers: Vec<_> =
            candidates[begin..].iter().map(|c| numbers_of_contributing(&c.settings).map(f64::from)).collect();
        round.models_from(begin, &numbers, powers)
    }

    /// The best by the model, and beside it half as many if these are many, or else twice as many on contributing lights, since
    /// nets gain more or less than the model says. The cheaper one comes first.
    pub(super) fn best(&self, model: &Model, nearly: f64) -> Vec<Candidate> {
        let later: &[u32] = if self.base.depth() > 1 { &LATER } else { &[1] };
        let best = model.best([&FIRST, later, &OTHERS], nearly, |_| true);
        let [first, later, others] = best;
        let both = if first > MANY {
            [[first / 2, later, (others / 2).max(1)], best]
        } else {
            [best, [2 * first, later, others]]
        };
        self.candidates(&both)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::IntegratorKind;

    #[test]
    fn others_are_left_out_where_photons_are_far_better() {
        let base = IntegratorSettings { kind: IntegratorKind::Direct, ..IntegratorSettings::default() };
        let candidate = Candidate::named(contributing(&base, [8, 1, 2]));
        // Of these variances with one sample of a kind, by 32 groups that differ by a part
        let models = |light: f64, spread: f64| -> Vec<Model> {
            let model = |i: u32| Model {
                cost: [1.0, 0.1, 0.0, 0.0],
                variance: [0.0, light * (1.0 + spread * f64::from(i % 2)), 0.0, 0.0],
                powers: [1.0; KINDS],
            };
            (0..33).map(model).collect()
        };
        let others = models(8.0, 0.0);
        let is_far = |light: f64, spread: f64| is_far_better(&candidate, &models(light, spread), ([8, 1, 1], &others));
        assert!(is_far(1.0, 0.0) && !is_far(4.0, 0.0) && !is_far(16.0, 0.0));
        assert!(!is_far(1.0, 1.0), "it may be chance");
    }
}

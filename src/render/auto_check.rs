//! What `--estimator auto` compares once more, on more pixels, before it takes it: the pixels of a round know an efficiency to a
//! quarter where the image is small, and a model goes beyond what was measured.
//!
//! Here are few candidates: what is usual, what was chosen, numbers of samples between both, and what may still be better. The
//! time for them is a part of that of the image with the usual or the chosen settings, whichever is more.

use super::auto_candidates::{Numbers, different, goes_on_by_one, numbers_of, with_numbers};
use super::auto_round::Candidate;
use crate::settings::{EstimatorKind, IntegratorSettings};
use std::ops::RangeInclusive;

/// Time of the round, as a fraction of that of the image.
const FRACTION: f64 = 0.04;
/// Standard error of the logarithm of an efficiency that is wanted.
const ERROR: f64 = 0.06;
/// Fewest pixels, relative to those of the round before.
const MIN_PIXELS: f64 = 1.5;
/// Standard errors by which another candidate may be better.
const POSSIBLE: f64 = 1.0;
/// Less than this is not looked for.
const MIN_GAIN: f64 = 1.05;

/// Which of the candidates of the round before take part beside the first and the `chosen` one, by their gains over this one
/// and the errors of those.
fn are_possible(gains: &[(f64, f64)], chosen: usize) -> Vec<usize> {
    let is_possible = |k: &usize| {
        let (gain, error) = gains[*k];
        *k == 0 || *k == chosen || error.is_finite() && gain + POSSIBLE * error > MIN_GAIN.ln()
    };
    (0..gains.len()).filter(is_possible).collect()
}

/// Those that take part, the first of the round before first, by their `times` of a camera sample (ns): in the image, with its part
/// of all that this takes, and in a round. And how many pixels of `spp` samples and two seeds there are, of `samples` of the image, where the
/// round before had the first number of `counts`, and there are no more than the last. `None` if that tells nothing more.
pub(super) fn choose(
    base: &IntegratorSettings,
    candidates: &[Candidate],
    times: &[[f64; 2]],
    (gains, chosen): (&[(f64, f64)], usize),
    (counts, spp, samples): (RangeInclusive<usize>, u32, f64),
) -> Option<(Vec<Candidate>, usize)> {
    let possible = are_possible(gains, chosen);
    let error = possible.iter().map(|&k| gains[k].1).filter(|e| e.is_finite()).fold(0.0, f64::max);
    let mut taken: Vec<(f64, Candidate)> = possible.iter().map(|&k| (times[k][1], candidates[k].clone())).collect();
    let time = (times[0][1] * times[chosen][1]).sqrt();
    let between = different(between(base, &candidates[0].settings, &candidates[chosen].settings));
    taken.extend(between.into_iter().filter(|c| !is_among(candidates, c)).map(|c| (time, c)));
    let of_pixel = f64::from(2 * spp) * taken.iter().map(|(time, _)| time).sum::<f64>();
    let of_image = samples * times[chosen][0].max(times[0][0]);
    let count = *counts.start() as f64;
    let pixels = (FRACTION * of_image / of_pixel).min(count * (error / ERROR).powi(2)).min(*counts.end() as f64);
    let enough = taken.len() > 1 && pixels >= MIN_PIXELS * count;
    enough.then(|| (taken.into_iter().map(|(_, c)| c).collect(), pixels as usize))
}

fn is_among(candidates: &[Candidate], candidate: &Candidate) -> bool {
    candidates.iter().any(|c| c.settings == candidate.settings)
}

/// Numbers between those of `mis` in both settings, powers of two: of all kinds, and with one BSDF sample where that is open.
fn between(
    base: &IntegratorSettings,
    usual: &IntegratorSettings,
    best: &IntegratorSettings,
) -> Vec<IntegratorSettings> {
    if [usual, best].iter().any(|s| s.estimator != EstimatorKind::Mis) {
        return Vec::new();
    }
    let [few, many] = [usual, best].map(numbers_of);
    let half = |a: u32, b: u32| 1 << (f64::from(a) * f64::from(b)).sqrt().log2().round() as u32;
    let [light, later, bsdf]: Numbers = std::array::from_fn(|k| half(few[k], many[k]));
    let all = [[light, later, bsdf], [many[0], many[1], 1], [light, later, 1]];
    let is_new = |n: &Numbers| *n != few && *n != many && (n[2] == 1 || goes_on_by_one(base, n));
    let settings = |n| {
        let IntegratorSettings { samples, later_samples, bsdf_fraction, .. } = with_numbers(base, n);
        IntegratorSettings { samples, later_samples, bsdf_fraction, ..*best }
    };
    all.into_iter().filter(is_new).map(settings).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::IntegratorKind;

    fn path() -> IntegratorSettings {
        IntegratorSettings { kind: IntegratorKind::Path, ..IntegratorSettings::default() }
    }

    fn candidates<const N: usize>(numbers: [Numbers; N]) -> [Candidate; N] {
        numbers.map(|n| Candidate::named(with_numbers(&path(), n)))
    }

    #[test]
    fn what_may_be_better_is_compared_and_what_is_between() {
        let candidates = candidates([[1, 1, 1], [16, 2, 1], [32, 2, 1], [2, 4, 1]]);
        let gains = [(-0.9, 0.3), (0.0, 0.0), (-0.1, 0.3), (-0.9, 0.3)];
        // Loading takes as long as two such samples
        let times = [1.0, 4.0, 8.0, 2.0].map(|time| [time + 2.0, time]);
        let of = |most: usize| choose(&path(), &candidates, &times, (&gains, 1), (128..=most, 16, 1e6));
        let (taken, pixels) = of(4096).unwrap();
        let numbers: Vec<_> = taken.iter().map(|c| numbers_of(&c.settings)).collect();
        assert_eq!(numbers, [[1, 1, 1], [16, 2, 1], [32, 2, 1], [4, 2, 1]]);
        // 0.04 · 6e6/(32 · (1 + 2 + 4 + 8))
        assert_eq!(pixels, 500);
        assert_eq!(of(200).unwrap().1, 200);
        assert!(of(150).is_none(), "as many as before tell nothing more");
    }

    #[test]
    fn numbers_between_keep_what_is_given() {
        let base = IntegratorSettings { samples: Some(9), path_reuse: Some(3), roulette_depth: None, ..path() };
        let [usual, best] = [[1, 1, 1], [1, 8, 1]].map(|n| with_numbers(&base, n));
        let between = between(&base, &usual, &best);
        let of = |s: &IntegratorSettings| (s.samples, s.later_samples, s.path_reuse, s.roulette_depth);
        assert!(between.iter().any(|s| of(s) == (Some(9), Some(5), Some(3), None)), "{between:?}");
        assert!(between.iter().all(|s| s.samples == Some(9) && s.path_reuse == Some(3)), "{between:?}");
    }

    #[test]
    fn nothing_is_compared_that_is_known_or_would_be_known_no_better() {
        let candidates = candidates([[1, 1, 1], [2, 1, 1]]);
        let is_known = |gains: [(f64, f64); 2], chosen: usize, samples: f64| {
            choose(&path(), &candidates, &[[1.0; 2], [1.5; 2]], (&gains, chosen), (128..=4096, 16, samples)).is_none()
        };
        let of_error = |error: f64, samples: f64| is_known([(-0.2, error), (0.0, 0.0)], 1, samples);
        assert!(of_error(0.05, 1e7) && !of_error(0.2, 1e7) && of_error(0.2, 1e4));
        assert!(is_known([(0.0, 0.0), (0.0, f64::INFINITY)], 0, 1e7), "there is no noise to be compared");
        assert!(is_known([(0.0, 0.0), (-0.5, 0.1)], 0, 1e7) && !is_known([(0.0, 0.0), (-0.05, 0.2)], 0, 1e7));
    }
}

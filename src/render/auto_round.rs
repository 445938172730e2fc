//! What a round of the pilot of `--estimator auto` measured of its candidates, and what follows from that.

use crate::settings::{EstimatorKind, IntegratorSettings};
use lumiris_numbers::estimators::efficiency::{KINDS, Measured, Model};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// By how much a choice must be more efficient than the one before it if it has fewer samples than usual, whose error may be
/// that of few pixels which the pilot does not see.
const MIN_GAIN_OF_FEW: f64 = 1.5;

/// By how much a choice must be more efficient than the one before it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Caution {
    gain: f64,
    /// Standard errors: with other numbers of samples, and with another estimator, whose error may be that of few pixels.
    errors: [f64; 2],
}

impl Caution {
    /// Where many candidates are compared on few pixels, with those first that need no luck.
    pub(super) const OF_FEW: Caution = Caution { gain: 1.03, errors: [0.5, 1.5] };
    /// Where few are compared on more pixels.
    pub(super) const OF_MANY: Caution = Caution { gain: 1.0, errors: [0.0, 1.5] };
}

/// Standard errors by which a candidate may be better than it was.
const POSSIBLE: f64 = 1.5;
/// Relative standard error of a measured time.
const TIME_ERROR: f64 = 0.02;
/// Groups of pixels that the jackknife leaves out.
const GROUPS: usize = 32;

/// Settings that took part, and what was measured of them.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct Trial {
    /// What they are.
    pub name: String,
    /// Processor time of a camera sample (ns), in paths with its part of what the image takes before.
    pub nanoseconds: f64,
    /// Relative variance of a camera sample, from as many samples per pixel as the pilot had: its mean over pixels, or the squared
    /// mean of the standard deviation, or the geometric mean of both.
    pub variance: f64,
    /// 1/(variance × time), relative to the first trial of the round.
    pub efficiency: f64,
    /// Standard error of the logarithm of that.
    #[serde(default)]
    pub error: f64,
}

/// A candidate.
#[derive(Clone)]
pub(super) struct Candidate {
    pub(super) name: String,
    pub(super) settings: IntegratorSettings,
    /// Time of its preparations per camera sample of the image (ns).
    pub(super) preparation: f64,
}

impl Candidate {
    pub(super) fn named(settings: IntegratorSettings) -> Self {
        let kind = <&str>::from(settings.estimator);
        let numbers = [0, 1].map(|vertex| settings.sample_counts_at(vertex).samples);
        let mut name = format!("{kind} {}", numbers[0]);
        if settings.depth() > 1 {
            name += &format!(", {} later", numbers[1]);
            let roulette = settings.roulette_depth.map_or("off".to_owned(), |n| n.to_string());
            name += &format!(", roulette {roulette}");
        }
        if settings.estimator == EstimatorKind::Ris {
            name += &format!(" of {}", settings.sample_counts().proposals);
        }
        if settings.estimator == EstimatorKind::Contributing {
            name += &format!(" and {} on others", settings.contributing.noncontributing_samples());
        }
        if settings.estimator == EstimatorKind::Mis {
            name += &format!(", BSDF fraction {}", settings.bsdf_fraction());
        }
        if let Some(paths) = settings.light_paths.filter(|paths| *paths > 0.0) {
            name += &format!(", {paths} light paths");
        }
        if let Some(edge) = settings.path_reuse {
            name += &format!(", paths of {edge} × {edge} pixels");
        }
        Candidate { name, settings, preparation: 0.0 }
    }
}

/// What the noise σ of all pixels together is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Mean {
    /// The mean of σ², where pixels have as many samples as each other.
    Squares,
    /// The square of the mean of σ, where samples are allocated in proportion to it.
    Deviations,
    /// The geometric mean of these.
    Both,
}

/// Relative difference of the two means of a pixel, absolute and squared, averaged over channels.
pub(super) type Difference = [f64; 2];

/// What a model by the pixels of another round says of a candidate.
pub(super) struct Predicted {
    /// The logarithm of its efficiency, by all pixels and without each of the groups.
    pub(super) gains: Vec<f64>,
    /// Standard error of the model itself.
    pub(super) error: f64,
}

/// What was measured of each candidate: the time of a camera sample (ns), and the differences of all pixels.
pub(super) struct Round {
    pub(super) measured: Vec<(f64, Vec<Difference>)>,
    /// Samples of a pixel and seed.
    pub(super) spp: u32,
    pub(super) mean: Mean,
    /// 1/(m² + ε), averaged over channels and pixels, m being their means.
    pub(super) relative: f64,
    /// Processor time of the round over that of as many samples of all pixels of the image by each candidate.
    pub(super) effort: f64,
}

impl Round {
    /// One whose means are 1.
    #[cfg(test)]
    pub(super) fn of(measured: Vec<(f64, Vec<Difference>)>, spp: u32, mean: Mean) -> Round {
        Round { measured, spp, mean, relative: 1.0, effort: 1.0 }
    }

    /// The round whose pixels are blocks of so many that stand one after the other: they are not independent.
    pub(super) fn by_blocks(mut self, size: usize) -> Round {
        for (_, differences) in &mut self.measured {
            let mean =
                |block: &[Difference]| [0, 1].map(|j| block.iter().map(|d| d[j]).sum::<f64>() / block.len() as f64);
            *differences = differences.chunks(size).map(mean).collect();
        }
        self
    }

    /// The first candidate, those of its estimator by their times, and so the others, which so is the order of what was measured
    /// of them.
    pub(super) fn by_times(&mut self, candidates: Vec<Candidate>) -> Vec<Candidate> {
        let measured = std::mem::take(&mut self.measured);
        let mut both: Vec<_> = measured.into_iter().zip(candidates).collect();
        let estimator = both[0].1.settings.estimator;
        both[1..].sort_by(|((a, _), of_a), ((b, _), of_b)| {
            let are_other = [of_a, of_b].map(|c| c.settings.estimator != estimator);
            are_other[0].cmp(&are_other[1]).then(a.total_cmp(b))
        });
        let (measured, candidates) = both.into_iter().unzip();
        self.measured = measured;
        candidates
    }

    /// Variances of a camera sample by a candidate: with all pixels, and without each of the groups.
    pub(super) fn variances(&self, k: usize) -> Vec<f64> {
        let differences = &self.measured[k].1;
        let groups = GROUPS.min(differences.len());
        let mut sums = vec![[0.0; 3]; groups];
        for (i, d) in differences.iter().enumerate() {
            let sum = &mut sums[i % groups];
            *sum = [sum[0] + d[0], sum[1] + d[1], sum[2] + 1.0];
        }
        let total = sums.iter().fold([0.0; 3], |a, b| [0, 1, 2].map(|j| a[j] + b[j]));
        let of = |sum: [f64; 3]| variance([sum[0] / sum[2], sum[1] / sum[2]], self.mean) * f64::from(self.spp);
        let without = |group: &[f64; 3]| of([0, 1, 2].map(|j| total[j] - group[j]));
        std::iter::once(of(total)).chain(sums.iter().map(without)).collect()
    }

    /// The logarithm of the efficiency of candidate `k` relative to `base`, and its standard error; no gain where either
    /// has no noise to be compared.
    fn gain(&self, k: usize, base: usize) -> (f64, f64) {
        if k == base { (0.0, 0.0) } else { gain((self, k), (self, base)) }
    }

    /// The same of the first candidates of two rounds on the same pixels.
    pub(super) fn gain_over(&self, base: &Round) -> (f64, f64) {
        gain((self, 0), (base, 0))
    }

    /// True if candidate `k` may be as efficient as one of this gain over the first.
    pub(super) fn may_have(&self, k: usize, gain: f64) -> bool {
        let (measured, error) = self.gain(k, 0);
        error.is_finite() && measured + POSSIBLE * error >= gain
    }

    /// The models by candidates of which the others each have more of one of the `numbers` of the first: by all pixels, and
    /// without each of the groups. `powers` are those of what the numbers leave of the variance.
    pub(super) fn models(&self, numbers: &[[f64; KINDS]], powers: [f64; KINDS]) -> Vec<Model> {
        self.models_from(0, numbers, powers)
    }

    /// The same by candidates from `begin` on.
    pub(super) fn models_from(&self, begin: usize, numbers: &[[f64; KINDS]], powers: [f64; KINDS]) -> Vec<Model> {
        let variances: Vec<Vec<f64>> = (0..numbers.len()).map(|k| self.variances(begin + k)).collect();
        let of = |i: usize| {
            let measured = |k: usize| Measured {
                samples: numbers[k],
                cost: self.measured[begin + k].0,
                variance: variances[k][i],
            };
            let has_more = |kind: usize| numbers.iter().position(|n| n[kind] > numbers[0][kind]);
            let more = std::array::from_fn(|kind| has_more(kind).map(measured));
            Model::fit(&measured(0), more, powers)
        };
        (0..variances[0].len()).map(of).collect()
    }

    /// The logarithm of the efficiency with other numbers by the models of the pixels of this round: all, and without each
    /// of the groups.
    pub(super) fn predicted(models: &[Model], numbers: [f64; KINDS]) -> Vec<f64> {
        models.iter().map(|model| model.efficiency(numbers).ln()).collect()
    }

    /// The index of the candidate to be taken. The first one stands for no choice at all. `predicted` is what a model says of
    /// candidates, where it has them: the gain of one of these over another is known from both.
    pub(super) fn choose(&self, candidates: &[Candidate], predicted: &[Option<Predicted>], caution: Caution) -> usize {
        (1..candidates.len()).fold(0, |chosen, k| {
            let is_other = candidates[k].settings.estimator != candidates[chosen].settings.estimator;
            let [samples, usual] = [k, 0].map(|k| candidates[k].settings.sample_counts_at(0).samples);
            let least = if !is_other && samples < usual { MIN_GAIN_OF_FEW } else { caution.gain };
            let (gain, error) = self.united_gain(k, chosen, predicted);
            if error.is_finite() && gain > least.ln().max(caution.errors[usize::from(is_other)] * error) {
                k
            } else {
                chosen
            }
        })
    }

    /// The gain of a candidate over another by this round and by what is `predicted` of both, and its standard error.
    pub(super) fn united_gain(&self, k: usize, base: usize, predicted: &[Option<Predicted>]) -> (f64, f64) {
        let measured = self.gain(k, base);
        let of = |k: usize| predicted.get(k).and_then(Option::as_ref);
        match (of(k), of(base)) {
            (Some(a), Some(b)) if k != base => {
                let differences: Vec<f64> = a.gains.iter().zip(&b.gains).map(|(a, b)| a - b).collect();
                let (gain, error) = jackknife(&differences);
                united(measured, (gain, error.hypot(a.error).hypot(b.error)))
            }
            _ => measured,
        }
    }

    pub(super) fn trials(&self, candidates: &[Candidate]) -> Vec<Trial> {
        let trial = |(k, candidate): (usize, &Candidate)| {
            let (gain, error) = self.gain(k, 0);
            let (nanoseconds, variance) = (self.measured[k].0, self.variances(k)[0]);
            Trial { name: candidate.name.clone(), nanoseconds, variance, efficiency: gain.exp(), error }
        };
        candidates.iter().enumerate().map(trial).collect()
    }
}

fn gain((round, k): (&Round, usize), (of_base, base): (&Round, usize)) -> (f64, f64) {
    let variances = round.variances(k).into_iter().zip(of_base.variances(base));
    let (gain, error) = jackknife(&variances.map(|(v, v_base)| (v_base / v).ln()).collect::<Vec<_>>());
    let times = (of_base.measured[base].0 / round.measured[k].0).ln();
    if gain.is_finite() && times.is_finite() { (gain + times, error) } else { (0.0, 0.0) }
}

/// A value, and its standard error, which includes that of two times, from what it is with all pixels and without each of
/// the groups.
pub(super) fn jackknife(values: &[f64]) -> (f64, f64) {
    let groups = &values[1..];
    let n = groups.len() as f64;
    let mean = groups.iter().sum::<f64>() / n;
    let squares = groups.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
    let error = ((n - 1.0) / n * squares + 2.0 * TIME_ERROR * TIME_ERROR).sqrt();
    if values.iter().all(|x| x.is_finite()) { (values[0], error) } else { (0.0, f64::INFINITY) }
}

/// Two independent values with their standard errors, weighted by these.
fn united((a, a_error): (f64, f64), (b, b_error): (f64, f64)) -> (f64, f64) {
    let [w_a, w_b] = [a_error, b_error].map(|e| 1.0 / (e * e));
    let united = ((a * w_a + b * w_b) / (w_a + w_b), 1.0 / (w_a + w_b).sqrt());
    if united.0.is_finite() { united } else { (a, a_error) }
}

/// The variance of a mean, from the mean absolute and the mean squared difference of two of them: for normal numbers of
/// standard deviation σ these are 2σ/√π and 2σ².
fn variance([absolute, squared]: [f64; 2], mean: Mean) -> f64 {
    let of_squares = 0.5 * squared;
    let of_deviations = 0.25 * PI * absolute * absolute;
    match mean {
        Mean::Squares => of_squares,
        Mean::Deviations => of_deviations,
        Mean::Both => (of_deviations * of_squares).sqrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_difference_of_two_means_tells_the_variance_of_a_sample() {
        use lumiris_test_support::random::{RngExt, pcg32};
        let mut s = pcg32([1, 7, 2]);
        // Means of uniform numbers, of variance 1/12
        let mut mean = || (0..8).map(|_| f64::from(s.random::<f32>())).sum::<f64>() / 8.0;
        let mut sums = [0.0; 2];
        for d in (0..20_000).map(|_| (mean() - mean()).abs() / 20_000.0) {
            sums[0] += d;
            sums[1] += d * d * 20_000.0;
        }
        for mean in [Mean::Squares, Mean::Deviations, Mean::Both] {
            let variance = 8.0 * variance(sums, mean);
            assert!((variance * 12.0 - 1.0).abs() < 0.03, "{variance}");
        }
    }

    /// Rounds of two candidates, where the second has the variance 1/`gain` in all pixels but a share of `rare`, in which it
    /// has 100 times the first one's.
    fn rounds(kinds: [EstimatorKind; 2], pixels: usize, (gain, rare): (f64, f64)) -> f64 {
        use lumiris_test_support::random::{RngExt, pcg32};
        let mut s = pcg32([1, 7, 4]);
        let candidate = |estimator| Candidate::named(IntegratorSettings { estimator, ..IntegratorSettings::default() });
        let candidates = kinds.map(candidate);
        let mut chosen = 0;
        for _ in 0..1000 {
            let mut measured = vec![(1.0, Vec::new()), (1.0, Vec::new())];
            for _ in 0..pixels {
                let is_rare = f64::from(s.random::<f32>()) < rare;
                for (variance, (_, differences)) in
                    [1.0, if is_rare { 100.0 } else { 1.0 / gain }].into_iter().zip(&mut measured)
                {
                    // Normal by the sum of uniform numbers
                    let normal = (0..12).map(|_| f64::from(s.random::<f32>())).sum::<f64>() - 6.0;
                    let d = (2.0 * variance).sqrt() * normal.abs();
                    differences.push([d, d * d]);
                }
            }
            chosen += Round::of(measured, 1, Mean::Squares).choose(&candidates, &[], Caution::OF_FEW);
        }
        f64::from(chosen as u32) / 1000.0
    }

    #[test]
    fn what_a_model_says_of_both_counts_with_what_was_measured() {
        let candidate = |n| {
            let estimator = EstimatorKind::Mis;
            Candidate::named(IntegratorSettings { estimator, samples: Some(n), ..IntegratorSettings::default() })
        };
        let candidates = [candidate(4), candidate(8)];
        let measured = (1.0, vec![[1.0, 1.0]; 256]);
        let round = Round::of(vec![measured.clone(), measured], 4, Mean::Squares);
        let model = |gain: f64| Some(Predicted { gains: vec![gain; 1 + GROUPS], error: 0.0 });
        assert_eq!(round.choose(&candidates, &[model(0.0), model(0.5)], Caution::OF_FEW), 1);
        assert_eq!(round.choose(&candidates, &[model(0.5), model(0.0)], Caution::OF_FEW), 0);
        assert_eq!(round.choose(&candidates, &[model(0.0), None], Caution::OF_FEW), 0);
        let unsure = Some(Predicted { error: 3.0, ..model(0.5).unwrap() });
        assert_eq!(round.choose(&candidates, &[model(0.0), unsure], Caution::OF_FEW), 0, "a model that knows little");
    }

    #[test]
    fn where_there_is_no_noise_nothing_is_chosen() {
        let candidates =
            [4, 8].map(|n| Candidate::named(IntegratorSettings { samples: Some(n), ..IntegratorSettings::default() }));
        let measured = vec![(2.0, vec![[0.0; 2]; 256]), (1.0, vec![[0.0; 2]; 256])];
        let round = Round::of(measured, 4, Mean::Squares);
        for caution in [Caution::OF_FEW, Caution::OF_MANY] {
            assert_eq!(round.choose(&candidates, &[], caution), 0);
        }
    }

    #[test]
    fn what_is_known_poorly_may_be_better() {
        let may_have = |deviations: &dyn Fn(usize) -> f64, gain: f64| {
            let differences = (0..256).map(deviations).map(|d| [d, d * d]).collect();
            let round = Round::of(vec![(1.0, vec![[1.0, 1.0]; 256]), (1.0, differences)], 4, Mean::Squares);
            round.may_have(1, gain.ln())
        };
        assert!(may_have(&|_| 1.0, 1.0) && !may_have(&|_| 1.0, 1.2));
        // A few pixels have half of the variance
        let of_few = |i: usize| if i.is_multiple_of(64) { 8.0 } else { 1.0 };
        assert!(may_have(&of_few, 1.0) && !may_have(&of_few, 2.0));
        assert!(!may_have(&|_| 1.4, 1.0), "known, and worse");
    }

    #[test]
    fn fewer_samples_than_usual_need_a_great_gain() {
        let candidate = |n| {
            let estimator = EstimatorKind::Mis;
            Candidate::named(IntegratorSettings { estimator, samples: Some(n), ..IntegratorSettings::default() })
        };
        // Without noise but that of times
        let chosen = |numbers: [u32; 2], gain: f64| {
            let measured = vec![(gain, vec![[1.0, 1.0]; 256]), (1.0, vec![[1.0, 1.0]; 256])];
            let round = Round::of(measured, 4, Mean::Deviations);
            round.choose(&numbers.map(candidate), &[], Caution::OF_FEW)
        };
        assert_eq!([1.4, 1.6].map(|gain| chosen([8, 4], gain)), [0, 1]);
        assert_eq!([1.01, 1.2].map(|gain| chosen([8, 16], gain)), [0, 1]);
    }

    #[test]
    fn candidates_and_what_was_measured_are_sorted_by_time() {
        let candidate = |n| {
            let estimator = if n == 3 { EstimatorKind::Ris } else { EstimatorKind::Mis };
            Candidate::named(IntegratorSettings { estimator, samples: Some(n), ..IntegratorSettings::default() })
        };
        let measured = [5.0, 3.0, 9.0, 2.0, 7.0].map(|time| (time, vec![[1.0, time]; 4])).to_vec();
        let mut round = Round::of(measured, 4, Mean::Squares);
        let sorted = round.by_times([5, 3, 9, 2, 7].map(candidate).to_vec());
        let numbers: Vec<_> = sorted.iter().map(|c| c.settings.samples.unwrap()).collect();
        assert_eq!(numbers, [5, 2, 7, 9, 3], "but the first one, and the other estimator");
        for (n, (time, differences)) in numbers.iter().zip(&round.measured) {
            assert_eq!([f64::from(*n); 2], [*time, differences[0][1]]);
        }
    }

    #[test]
    fn a_gain_within_the_noise_changes_nothing() {
        use EstimatorKind::{Mis, Ris};
        // As good: chosen as often as a normal number exceeds half its standard error, and 1.5 of it
        let [numbers, estimator] = [[Mis, Mis], [Mis, Ris]].map(|kinds| rounds(kinds, 256, (1.0, 0.0)));
        assert!((0.22..0.40).contains(&numbers), "{numbers}");
        assert!((0.02..0.1).contains(&estimator), "{estimator}");
        // Half the variance is found, and worse in few pixels is seen
        assert!(rounds([Mis, Ris], 256, (2.0, 0.0)) > 0.95);
        assert!(rounds([Mis, Ris], 256, (2.0, 0.03)) < 0.02);
    }
}

//! What takes part in the rounds of the pilot of `--estimator auto`: numbers of samples as settings, and the candidates among which it chooses.

use super::auto_round::Candidate;
use crate::settings::{ContributingSettings, EstimatorKind, IntegratorSettings, Proposals, bsdf_samples};
use lumiris_numbers::estimators::efficiency::KINDS;

/// Numbers of samples, relative to usual ones, from which on fewer are tried too, and not more.
const MANY: u32 = 3;

/// Numbers of light samples, at first and at later vertices, and of BSDF samples at the first ones.
pub(super) type Numbers = [u32; KINDS];

/// As many as are best or nearly so in most scenes, in direct light: the pilot of a small image may not see it.
const USUAL_DIRECT: u32 = 8;

/// `mis`, with its numbers of samples as they are.
pub(super) fn without_pilot(settings: &IntegratorSettings) -> IntegratorSettings {
    IntegratorSettings { estimator: EstimatorKind::Mis, ..*settings }
}

/// What is taken where the pilot finds nothing better, before sharing.
pub(super) fn usual(settings: &IntegratorSettings) -> IntegratorSettings {
    let base = without_pilot(settings);
    let samples = if base.depth() > 1 { base.samples } else { base.samples.or(Some(USUAL_DIRECT)) };
    IntegratorSettings { samples, ..base }
}

/// `mis` with these numbers of samples, where they are open.
pub(super) fn with_numbers(settings: &IntegratorSettings, [light, later, bsdf]: Numbers) -> IntegratorSettings {
    let base = without_pilot(settings);
    let samples = base.samples.unwrap_or(light + bsdf);
    let bsdf = bsdf.min(samples.saturating_sub(1));
    IntegratorSettings {
        samples: Some(samples),
        later_samples: if base.depth() > 1 { base.later_samples.or(Some(later + 1)) } else { base.later_samples },
        bsdf_fraction: base.bsdf_fraction.or(Some(fraction(bsdf, samples))),
        ..base
    }
}

/// The fraction that BSDF samples are, which gives that number of them; 0 gives one of any number of samples.
fn fraction(bsdf: u32, samples: u32) -> f32 {
    let fraction = bsdf as f32 / samples as f32;
    if bsdf <= 1 {
        0.0
    } else if bsdf_samples(samples, fraction) < bsdf {
        fraction.next_up()
    } else {
        fraction
    }
}

/// True if paths with these numbers go on by the only BSDF sample of later vertices, whatever the first one has: it finds lights
/// without a ray of its own, and what light paths bring needs it. All vertices have one fraction.
pub(super) fn goes_on_by_one(base: &IntegratorSettings, numbers: &Numbers) -> bool {
    let settings = with_numbers(base, *numbers);
    let samples = settings.sample_counts_at(1).samples.max(2);
    base.depth() <= 1 || bsdf_samples(samples, settings.bsdf_fraction()) == 1
}

/// The numbers of samples that settings of `mis` have.
pub(super) fn numbers_of(settings: &IntegratorSettings) -> Numbers {
    let at = |vertex: u32| {
        let samples = settings.sample_counts_at(vertex).samples.max(2);
        let bsdf = bsdf_samples(samples, settings.bsdf_fraction());
        [samples - bsdf, bsdf]
    };
    let ([light, bsdf], [later, _]) = (at(0), at(1));
    [light, if settings.depth() > 1 { later } else { 1 }, bsdf]
}

/// `contributing` with these numbers of samples, where they are open: on contributing lights, at first and at later vertices, and
/// on all other lights.
pub(super) fn contributing(settings: &IntegratorSettings, [first, later, others]: Numbers) -> IntegratorSettings {
    let given = settings.contributing.noncontributing_samples;
    IntegratorSettings {
        estimator: EstimatorKind::Contributing,
        samples: settings.samples.or(Some(first)),
        later_samples: settings.later_samples.or((settings.depth() > 1).then_some(later)),
        contributing: ContributingSettings { noncontributing_samples: given.or(Some(others)), ..settings.contributing },
        ..*settings
    }
}

/// The numbers of samples that settings of `contributing` have.
pub(super) fn numbers_of_contributing(settings: &IntegratorSettings) -> Numbers {
    let [first, later] = [0, 1].map(|vertex| settings.sample_counts_at(vertex).samples);
    let later = if settings.depth() > 1 { later } else { 1 };
    [first, later, settings.contributing.noncontributing_samples()]
}

/// `ris` with its default numbers, where they are open.
fn resampled(settings: &IntegratorSettings) -> IntegratorSettings {
    let mut ris = IntegratorSettings { estimator: EstimatorKind::Ris, ..*settings };
    let counts = ris.sample_counts();
    ris.samples = Some(counts.samples);
    ris.ris.proposals = Proposals::Fixed(counts.proposals);
    ris
}

/// Other numbers to be tried, since nets gain more or less than the model says: halfway to the best by the model, if there are many
/// more light samples than usual, or else twice as many.
fn other_numbers(base: &IntegratorSettings, best: Numbers) -> Numbers {
    let usual = numbers_of(&usual(base));
    let totals = |[light, later, bsdf]: Numbers| [light + bsdf, later + 1];
    let is_far = totals(best).into_iter().zip(totals(usual)).any(|(best, usual)| best >= MANY * usual);
    // Powers of two, of which points of nets are best spread
    let other = |k: usize| {
        if is_far { 1 << (f64::from(usual[k]) * f64::from(best[k])).sqrt().log2().round() as u32 } else { 2 * best[k] }
    };
    [other(0), if base.depth() > 1 { other(1) } else { best[1] }, best[2]]
}

/// What is usual, the best numbers of `mis`, and these with another setting each. None twice.
pub(super) fn second_round(base: &IntegratorSettings, best: Numbers) -> Vec<Candidate> {
    let chosen = with_numbers(base, best);
    let mut all = vec![usual(base)];
    // What BSDF samples leave depends on how many light samples there are beside them, unlike in the model
    let [light, later, bsdf] = best;
    if base.depth() > 1 && bsdf > 1 {
        all.push(with_numbers(base, [light, later, 1]));
    }
    all.push(chosen);
    let more = [light, later, (light / 4).max(2)];
    if bsdf == 1 && light >= 4 && goes_on_by_one(base, &more) {
        all.push(with_numbers(base, more));
    }
    if base.depth() > 1 && base.roulette_depth.is_some_and(|first| first < base.depth()) {
        all.push(IntegratorSettings { roulette_depth: None, ..chosen });
    }
    all.push(resampled(base));
    let other = other_numbers(base, best);
    if other[2] == 1 || goes_on_by_one(base, &other) {
        all.push(with_numbers(base, other));
    }
    different(all)
}

/// Those that find what media send out, as `base` does, by whose numbers of samples the first is replaced if it does not.
pub(super) fn that_find_glows(base: &IntegratorSettings, mut candidates: Vec<Candidate>) -> Vec<Candidate> {
    let finds = |c: &Candidate| c.settings.light_choice().glows;
    if !candidates.first().is_some_and(finds) {
        candidates.insert(0, Candidate::named(without_pilot(base)));
    }
    candidates.retain(finds);
    candidates
}

/// Candidates with these settings, none twice.
pub(super) fn different(all: impl IntoIterator<Item = IntegratorSettings>) -> Vec<Candidate> {
    let mut candidates: Vec<Candidate> = Vec::new();
    for settings in all {
        if candidates.iter().all(|c| c.settings != settings) {
            candidates.push(Candidate::named(settings));
        }
    }
    candidates
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::IntegratorKind;

    #[test]
    fn settings_have_the_numbers_of_samples_that_are_asked_for() {
        let path = IntegratorSettings { kind: IntegratorKind::Path, ..IntegratorSettings::default() };
        let direct = path.of_kind(IntegratorKind::Direct);
        for light in [1, 2, 3, 4, 6, 8, 16, 32] {
            for bsdf in [1, 2, 4, 8, 16] {
                assert_eq!(numbers_of(&with_numbers(&direct, [light, 1, bsdf])), [light, 1, bsdf]);
                for later in
                    [1, 2, 3, 4, 6, 8, 16].into_iter().filter(|&later| goes_on_by_one(&path, &[light, later, bsdf]))
                {
                    let settings = with_numbers(&path, [light, later, bsdf]);
                    assert_eq!(numbers_of(&settings), [light, later, bsdf]);
                    let samples = settings.sample_counts_at(1).samples;
                    assert_eq!(bsdf_samples(samples, settings.bsdf_fraction()), 1);
                }
            }
        }
        assert!(goes_on_by_one(&path, &[1, 1, 4]) && !goes_on_by_one(&path, &[1, 2, 2]));
        let later = IntegratorSettings { later_samples: Some(5), ..path };
        assert!(goes_on_by_one(&later, &[7, 1, 1]) && !goes_on_by_one(&later, &[1, 1, 4]));
        let two = IntegratorSettings { samples: Some(2), ..path };
        assert_eq!(numbers_of(&with_numbers(&two, [1, 1, 4])), [1, 1, 1], "no more than there are");
    }

    #[test]
    fn what_finds_glows_is_never_nothing() {
        // A quarter of eight and more samples are more BSDF samples than one
        let base = IntegratorSettings { bsdf_fraction: Some(0.25), ..IntegratorSettings::default() };
        let base = base.of_kind(IntegratorKind::Direct);
        let all = second_round(&base, [16, 1, 1]);
        assert!(all.iter().all(|c| !c.settings.light_choice().glows));
        let left = that_find_glows(&base, all);
        assert!(left.len() == 1 && left[0].settings == without_pilot(&base) && left[0].settings.light_choice().glows);
        // What finds them stays as it is
        let open = IntegratorSettings { bsdf_fraction: Some(0.0), ..base };
        let usual_first = that_find_glows(&open, second_round(&open, [16, 1, 1]));
        assert!(usual_first.len() > 1 && usual_first[0].settings == usual(&open));
    }

    #[test]
    fn contributing_has_the_numbers_asked_for_or_given() {
        let path = IntegratorSettings { kind: IntegratorKind::Path, ..IntegratorSettings::default() };
        let direct = path.of_kind(IntegratorKind::Direct);
        assert_eq!(numbers_of_contributing(&contributing(&path, [4, 2, 6])), [4, 2, 6]);
        assert_eq!(numbers_of_contributing(&contributing(&direct, [4, 2, 6])), [4, 1, 6]);
        let given = IntegratorSettings {
            later_samples: Some(3),
            contributing: ContributingSettings { noncontributing_samples: Some(5), bsdf_samples: None },
            ..path
        };
        assert_eq!(numbers_of_contributing(&contributing(&given, [4, 2, 6])), [4, 3, 5]);
        let samples = IntegratorSettings { samples: Some(7), ..path };
        assert_eq!(numbers_of_contributing(&contributing(&samples, [4, 2, 6])), [7, 2, 6]);
    }

    #[test]
    fn other_numbers_are_powers_of_two_halfway_to_many() {
        let direct = IntegratorSettings::default().of_kind(IntegratorKind::Direct);
        let usual = numbers_of(&usual(&direct))[0];
        for many in [24, 32, 48] {
            let [light, ..] = other_numbers(&direct, [many, 1, 1]);
            assert!(light.is_power_of_two() && light > usual && light < many, "{usual} {light} {many}");
        }
        assert_eq!(other_numbers(&direct, [8, 1, 4]), [16, 1, 4]);
    }

    #[test]
    fn what_the_user_has_set_stays() {
        let base = IntegratorSettings { samples: Some(5), bsdf_fraction: Some(0.3), ..IntegratorSettings::default() };
        for candidate in second_round(&base, [12, 1, 4]) {
            let s = candidate.settings;
            assert_eq!((s.samples, s.bsdf_fraction), (Some(5), Some(0.3)), "{}", candidate.name);
        }
        let open = IntegratorSettings::default();
        let candidates = second_round(&open, [12, 1, 4]);
        let samples = |k: usize| [0, 1].map(|vertex| candidates[k].settings.sample_counts_at(vertex).samples);
        assert_eq!([samples(1), samples(2)], [[13, 2], [16, 2]], "light samples alone, and the best");
        let names: std::collections::HashSet<&str> = candidates.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names.len(), candidates.len(), "{names:?}");
    }
}

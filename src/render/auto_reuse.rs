//! How many pixels share paths, and with how many samples, as `--estimator auto` finds it by a pilot.
//!
//! Blocks of 4 × 4 pixels are rendered with and without sharing, and with other numbers of samples. A part S of the variance is divided by E² if blocks of
//! E × E pixels share paths, and each of the E² − 1 other pixels costs the same time, beside what sharing takes in blocks of any
//! size; so both follow for all E.

use super::auto_candidates::Numbers;
use super::auto_round::{Candidate, Round, jackknife};
use crate::settings::IntegratorSettings;
use lumiris_numbers::estimators::efficiency::Model;

/// Edge of the blocks of the pilot.
pub(super) const EDGE: u32 = 4;
/// Pixels of these blocks.
pub(super) const BLOCK: usize = (EDGE * EDGE) as usize;
/// Edges among which is chosen, of which the first shares nothing: the larger blocks are, the coarser is the grain, and plain MSE gains nothing more.
const EDGES: [u32; 6] = [1, 2, 3, 4, 5, 6];
/// Light samples at later vertices among which is chosen.
const LATER: [u32; 7] = [1, 2, 3, 4, 6, 8, 16];
/// Light samples at first vertices, without sharing, from which on there are not more with it.
const MANY_LIGHT_SAMPLES: u32 = 4;
/// Least time of sharing in blocks of the pilot, relative to that of a camera sample: what was measured may be less by chance.
const MIN_COST: f64 = 0.075;
/// The part of that time which blocks of any size take: in a box and in the open, blocks of 2 × 2 pixels took half the time
/// of blocks of 4 × 4.
const FIXED: f64 = 1.0 / 3.0;
/// Standard errors by which the gain may be more than it was where few blocks were looked at.
const POSSIBLE: f64 = 1.0;
/// Standard errors by which the gain must exceed nothing.
const MIN_ERRORS: f64 = 1.0;
const MIN_GAIN: f64 = 1.03;
/// Share of the greatest efficiency with which smaller blocks will do.
const NEARLY: f64 = 0.98;
/// The same with which fewer light samples will do: the noise of few pixels, which the pilot does not see, is rarely theirs.
const NUMBERS_NEARLY: f64 = 0.95;
/// Part of the time that more light samples at later vertices may take, whatever the pilot says: few of its pixels have most of
/// what these lower.
const LITTLE: f64 = 0.06;

/// Without and with sharing, and with sharing by `more` settings of other numbers of samples.
pub(super) fn candidates(chosen: &IntegratorSettings, more: &[IntegratorSettings]) -> Vec<Candidate> {
    let shared = |settings: &IntegratorSettings| IntegratorSettings { path_reuse: Some(EDGE), ..*settings };
    let alone = IntegratorSettings { path_reuse: Some(1), ..*chosen };
    [alone, shared(chosen)].into_iter().chain(more.iter().map(shared)).map(Candidate::named).collect()
}

/// Time and variance relative to those without sharing, by what both candidates have.
fn shared(edge: u32, [cost, more]: [f64; 2], [variance, less]: [f64; 2]) -> [f64; 2] {
    let (of_pilot, of_edge) = (f64::from(EDGE * EDGE), f64::from(edge * edge));
    let of_sharing = if edge > 1 { (more / cost - 1.0).max(MIN_COST) } else { 0.0 };
    let of_blocks = FIXED + (1.0 - FIXED) * (of_edge - 1.0) / (of_pilot - 1.0);
    let part = ((1.0 - less / variance) / (1.0 - 1.0 / of_pilot)).clamp(0.0, 0.99);
    [1.0 + of_sharing * of_blocks, 1.0 - part * (1.0 - 1.0 / of_edge)]
}

/// What blocks of an edge gain by a round of both candidates, as a logarithm: by all pixels, and without each of the groups.
fn gains(round: &Round) -> impl Fn(u32) -> Vec<f64> {
    let costs = [round.measured[0].0, round.measured[1].0];
    let variances = [round.variances(0), round.variances(1)];
    move |edge| {
        let both = variances[0].iter().zip(&variances[1]);
        both.map(|(&all, &less)| -shared(edge, costs, [all, less]).iter().map(|x| x.ln()).sum::<f64>()).collect()
    }
}

/// False if blocks of no edge may gain enough, by a round of both candidates, where paths with `fewer` samples at later vertices take
/// less time by this factor.
pub(super) fn is_possible(round: &Round, fewer: f64) -> bool {
    let gains = gains(round);
    EDGES.into_iter().filter(|&edge| edge > 1).any(|edge| {
        let (gain, error) = jackknife(&gains(edge));
        gain + fewer.ln() + POSSIBLE * error > MIN_GAIN.ln()
    })
}

/// The edge that is most efficient by a round of both candidates, if that is more than chance.
pub(super) fn best(round: &Round) -> Option<u32> {
    let gains = gains(round);
    let greatest = EDGES.iter().map(|&edge| gains(edge)[0]).fold(0.0, f64::max);
    let edge = EDGES.into_iter().find(|&edge| gains(edge)[0] >= greatest + NEARLY.ln())?;
    let (gain, error) = jackknife(&gains(edge));
    (edge > 1 && gain > MIN_GAIN.ln().max(MIN_ERRORS * error)).then_some(edge)
}

/// The numbers of light samples at first vertices, of those given, and at later ones among which is chosen where pixels share
/// paths: no more than were measured. First vertices are not shared, so that fewer of their samples are not better than before;
/// and where there are many, twice as many tell the model, and are too many.
pub(super) fn choices(of_first: &[u32], [first, later, _]: Numbers) -> [Vec<u32>; 2] {
    let most = if first > MANY_LIGHT_SAMPLES { first } else { 2 * first };
    let more = of_first.iter().copied().filter(|n| (first + 1..=most).contains(n));
    let of_later = LATER.into_iter().filter(|n| *n <= 2 * later);
    [std::iter::once(first).chain(more).collect(), of_later.collect()]
}

/// The edge and the numbers that are most efficient by a round of [`candidates`], if they share paths and that is more than
/// chance. `numbers` are those of the candidates that share, `of_one` is the model of paths that are not shared, and `shared`
/// that of blocks of the pilot: with all pixels, and without each of the groups. `choices` are those of light samples.
pub(super) fn best_numbers(
    round: &Round,
    numbers: Numbers,
    (of_one, of_pilot): (&Model, &[Model]),
    choices: [&[u32]; 2],
) -> Option<(u32, Numbers)> {
    let light = |n: Numbers| n.map(f64::from);
    let alone = round.variances(0);
    // Time and variance, by the pixels of group `i`
    let at = |i: usize, edge: u32, n: Numbers| {
        let cost = round.measured[0].0 * of_one.cost(light(n)) / of_one.cost(light(numbers));
        let variance = alone[i] * of_one.variance(light(n)) / of_one.variance(light(numbers));
        let model = &of_pilot[i];
        let part = shared(edge, [cost, model.cost(light(n))], [variance, model.variance(light(n))]);
        [cost * part[0], variance * part[1]]
    };
    let efficiency = |i: usize, edge: u32, n: Numbers| -at(i, edge, n).iter().map(|x| x.ln()).sum::<f64>();
    let pairs = || choices[0].iter().flat_map(|&first| choices[1].iter().map(move |&later| [first, later, numbers[2]]));
    let with_edge = |n: Numbers| {
        let edges = || EDGES.into_iter().skip(1);
        let greatest = edges().map(|edge| efficiency(0, edge, n)).fold(f64::NEG_INFINITY, f64::max);
        edges().find(|&edge| efficiency(0, edge, n) >= greatest + NEARLY.ln()).map(|edge| (edge, n))
    };
    let all: Vec<(u32, Numbers)> = pairs().filter_map(with_edge).collect();
    let greatest = all.iter().map(|&(edge, n)| efficiency(0, edge, n)).fold(f64::NEG_INFINITY, f64::max);
    let good = all.into_iter().filter(|&(edge, n)| efficiency(0, edge, n) >= greatest + NUMBERS_NEARLY.ln());
    let (edge, best) = good.min_by(|a, b| at(0, a.0, a.1)[0].total_cmp(&at(0, b.0, b.1)[0]))?;
    let affordable = (1.0 + LITTLE) * at(0, edge, best)[0];
    let later =
        choices[1].iter().filter(|&&n| n > best[1] && at(0, edge, [best[0], n, best[2]])[0] <= affordable).max();
    let best = [best[0], later.copied().unwrap_or(best[1]), best[2]];
    let gains: Vec<f64> = (0..alone.len()).map(|i| efficiency(i, edge, best) - efficiency(i, 1, numbers)).collect();
    let (gain, error) = jackknife(&gains);
    (gain > MIN_GAIN.ln().max(MIN_ERRORS * error)).then_some((edge, best))
}

#[cfg(test)]
mod tests {
    use super::super::auto_round::Mean;
    use super::*;
    use lumiris_numbers::estimators::efficiency::KINDS;

    #[test]
    fn a_part_of_the_variance_goes_away_with_the_number_of_pixels() {
        // Of a time of 10 and a variance of 8, 7.5 more and 1 more for each pixel, and 6 that are shared
        let of_pilot = f64::from(EDGE * EDGE);
        let at = |edge: u32| shared(edge, [10.0, 10.0 + 1.5 * (of_pilot - 1.0)], [8.0, 2.0 + 6.0 / of_pilot]);
        for edge in EDGES {
            let n = f64::from(edge * edge);
            let [cost, variance] = at(edge);
            let more = if edge > 1 { FIXED * 1.5 * (of_pilot - 1.0) + (n - 1.0) } else { 0.0 };
            assert!((cost * 10.0 - (10.0 + more)).abs() < 1e-9 && (variance * 8.0 - (2.0 + 6.0 / n)).abs() < 1e-9);
        }
    }

    #[test]
    fn first_vertices_have_as_many_samples_as_before_and_none_more_than_were_measured() {
        let of_first = [1, 2, 4, 8, 16, 32];
        assert_eq!(choices(&of_first, [2, 2, 1]), [vec![2, 4], vec![1, 2, 3, 4]]);
        assert_eq!(choices(&of_first, [8, 1, 1]), [vec![8], vec![1, 2]]);
        assert_eq!(choices(&of_first, [3, 1, 1])[0], [3, 4], "any number that is given");
    }

    #[test]
    fn numbers_and_edge_are_those_of_the_least_error_in_a_time() {
        // Variance a + b/first + (c + d/later), of which the latter is shared
        let truth = |edge: u32, [first, later, _]: [f64; KINDS]| {
            let pixels = f64::from(edge * edge);
            let cost = 10.0 + first + 2.0 * later;
            let of_blocks = FIXED + (1.0 - FIXED) * (pixels - 1.0) / f64::from(EDGE * EDGE - 1);
            let sharing = if edge > 1 { 1.0 + 0.8 * of_blocks } else { 1.0 };
            [cost * sharing, 0.5 + 2.0 / first + (4.0 + 6.0 / later) / pixels]
        };
        let measured = |edge, n: [f64; KINDS]| {
            let [cost, variance] = truth(edge, n);
            let d = (2.0 * variance / 4.0).sqrt();
            (cost, vec![[d, d * d]; 64])
        };
        let numbers = [[2.0, 1.0, 1.0], [4.0, 1.0, 1.0], [2.0, 2.0, 1.0]];
        let mut all = vec![measured(1, numbers[0])];
        all.extend(numbers.iter().map(|&n| measured(EDGE, n)));
        let round = Round::of(all, 4, Mean::Squares);
        let of_one = Model { cost: [10.0, 1.0, 2.0, 0.0], variance: [4.5, 2.0, 6.0, 0.0], powers: [1.0; KINDS] };
        let of_pilot = round.models_from(1, &numbers, [1.0; KINDS]);
        let choices: [&[u32]; 2] = [&[1, 2, 4, 8], &[1, 2, 4]];
        let (edge, n) = best_numbers(&round, [2, 1, 1], (&of_one, &of_pilot), choices).unwrap();
        let efficiency = |edge, n: Numbers| 1.0 / truth(edge, n.map(f64::from)).iter().product::<f64>();
        let pairs = choices[0].iter().flat_map(|&first| choices[1].iter().map(move |&later| [first, later, 1]));
        let greatest = pairs.flat_map(|n| EDGES.map(|edge| efficiency(edge, n))).fold(0.0, f64::max);
        assert!(efficiency(edge, n) >= 0.87 * greatest, "{edge} {n:?}");
        // Of nothing that is shared, nothing is
        let nothing = Round::of(vec![measured(1, numbers[0]); 4], 4, Mean::Squares);
        let of_pilot = nothing.models_from(1, &numbers, [1.0; KINDS]);
        assert!(best_numbers(&nothing, [2, 1, 1], (&of_one, &of_pilot), [&[2], &[1]]).is_none());
    }

    #[test]
    fn nothing_is_shared_where_nothing_is_gained() {
        let differences =
            |scale: f64| (0..64).map(|i| 1.0 + 0.1 * f64::from(i % 7)).map(|d| [d, scale * d * d]).collect();
        let round =
            |gain: f64| Round::of(vec![(100.0, differences(1.0)), (110.0, differences(gain))], 4, Mean::Squares);
        assert!(best(&round(1.0)).is_none() && best(&round(1.2)).is_none());
        let found = best(&round(0.3)).unwrap();
        assert!(found >= 3, "{found}");
        assert!(!is_possible(&round(1.0), 1.0) && !is_possible(&round(1.2), 1.0) && is_possible(&round(0.3), 1.0));
        assert!(is_possible(&round(1.0), 1.2), "with fewer samples at later vertices");
        let mut few = round(0.5);
        few.measured[1].1[5][1] = 60.0;
        assert!(best(&few).is_none() && is_possible(&few, 1.0), "one pixel, which may be chance");
    }
}

//! How many pixels share paths, as `--estimator auto` finds it by a pilot.
//!
//! Blocks of 4 × 4 pixels are rendered with and without sharing. A part S of the variance is divided by E² if blocks of
//! E × E pixels share paths, and each of the E² − 1 other pixels costs the same time, beside what sharing takes in blocks of any
//! size; so both follow for all E.

use super::auto_round::{Candidate, Round, jackknife};
use crate::settings::IntegratorSettings;
use lumiris_numbers::estimators::efficiency::Model;

/// Edge of the blocks of the pilot.
pub(super) const EDGE: u32 = 4;
/// Edges among which is chosen: the larger blocks are, the coarser is the grain, and plain MSE gains nothing more.
const EDGES: [u32; 6] = [1, 2, 3, 4, 5, 6];
/// Least time of sharing in blocks of the pilot, relative to that of a camera sample: what was measured may be less by chance.
const MIN_COST: f64 = 0.075;
/// The part of that time which blocks of any size take: in a box and in the open, blocks of 2 × 2 pixels took half the time
/// of blocks of 4 × 4.
const FIXED: f64 = 1.0 / 3.0;
/// Standard errors by which the gain must exceed nothing.
const MIN_ERRORS: f64 = 1.0;
const MIN_GAIN: f64 = 1.03;
/// Share of the greatest efficiency with which smaller blocks will do.
const NEARLY: f64 = 0.98;

/// What sharing costs and gains.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gain {
    /// Edge of the blocks.
    pub(super) edge: u32,
    /// Time of a camera sample that is added (ns).
    pub(super) cost: f64,
    /// Variance of a camera sample that goes away.
    pub(super) variance: f64,
}

/// Without and with sharing.
pub(super) fn candidates(chosen: &IntegratorSettings) -> [Candidate; 2] {
    [1, EDGE].map(|edge| Candidate::named(IntegratorSettings { path_reuse: Some(edge), ..*chosen }))
}

/// Time and variance relative to those without sharing, by what both candidates have.
fn shared(edge: u32, [cost, more]: [f64; 2], [variance, less]: [f64; 2]) -> [f64; 2] {
    let (of_pilot, of_edge) = (f64::from(EDGE * EDGE), f64::from(edge * edge));
    let of_sharing = if edge > 1 { (more / cost - 1.0).max(MIN_COST) } else { 0.0 };
    let of_blocks = FIXED + (1.0 - FIXED) * (of_edge - 1.0) / (of_pilot - 1.0);
    let part = ((1.0 - less / variance) / (1.0 - 1.0 / of_pilot)).clamp(0.0, 0.99);
    [1.0 + of_sharing * of_blocks, 1.0 - part * (1.0 - 1.0 / of_edge)]
}

/// The edge that is most efficient by a round of both candidates, if that is more than chance.
pub(super) fn best(round: &Round) -> Option<Gain> {
    let costs = [round.measured[0].0, round.measured[1].0];
    let variances = [round.variances(0), round.variances(1)];
    let gains = |edge: u32| -> Vec<f64> {
        let both = variances[0].iter().zip(&variances[1]);
        both.map(|(&all, &less)| -shared(edge, costs, [all, less]).iter().map(|x| x.ln()).sum::<f64>()).collect()
    };
    let greatest = EDGES.iter().map(|&edge| gains(edge)[0]).fold(0.0, f64::max);
    let edge = EDGES.into_iter().find(|&edge| gains(edge)[0] >= greatest + NEARLY.ln())?;
    let (gain, error) = jackknife(&gains(edge));
    let [cost, variance] = shared(edge, costs, [variances[0][0], variances[1][0]]);
    (edge > 1 && gain > MIN_GAIN.ln().max(MIN_ERRORS * error)).then_some(Gain {
        edge,
        cost: (cost - 1.0) * costs[0],
        variance: (1.0 - variance) * variances[0][0],
    })
}

/// The model where pixels share paths: light samples at later vertices are shared as well.
pub(super) fn model(of_one: &Model, gain: &Gain) -> Model {
    let [a, b_first, b_later] = of_one.cost;
    let [v, v_first, v_later] = of_one.variance;
    let pixels = f64::from(gain.edge * gain.edge);
    let of_light = v_later * (1.0 - 1.0 / pixels);
    let rest = (v - (gain.variance - of_light).max(0.0)).max(v / pixels);
    Model { cost: [a + gain.cost, b_first, b_later], variance: [rest, v_first, v_later / pixels], ..*of_one }
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn the_model_of_shared_paths_has_what_is_left_of_the_variance() {
        // 6 of 8 are shared, 2 of these are of light at later vertices, and 1 is of light at the first
        let of_one = Model { cost: [9.0, 1.0, 1.0], variance: [5.0, 1.0, 2.0], powers: [1.0; 2] };
        let gain = Gain { edge: 2, cost: 3.0, variance: 6.0 * 0.75 };
        let shared = model(&of_one, &gain);
        assert!((shared.variance([1.0, 1.0]) - (8.0 - 4.5)).abs() < 1e-12, "{shared:?}");
        assert!((shared.cost([1.0, 1.0]) - (11.0 + 3.0)).abs() < 1e-12);
        // Light samples at later vertices count for four pixels
        assert_eq!(shared.variance[2], 0.5);
    }

    #[test]
    fn nothing_is_shared_where_nothing_is_gained() {
        let differences =
            |scale: f64| (0..64).map(|i| 1.0 + 0.1 * f64::from(i % 7)).map(|d| [d, scale * d * d]).collect();
        let round = |gain: f64| Round {
            measured: vec![(100.0, differences(1.0)), (110.0, differences(gain))],
            spp: 4,
            is_direct: false,
        };
        assert!(best(&round(1.0)).is_none() && best(&round(1.2)).is_none());
        let found = best(&round(0.3)).unwrap();
        assert!(found.edge >= 3 && found.cost > 0.0 && found.variance > 0.0, "{found:?}");
    }
}

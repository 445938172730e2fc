//! Numbers of samples and proposals for equal time.
//!
//! A rendering costs c + P·(M·T1 + N·T2), where P counts shading points. T1 is what a proposal costs with its share of
//! the draw, T2 a sample: the time to trace it. Both are measured on the renderings themselves, with the baseline in
//! turns. The split is N = B/(2·T2), M = B/(2·T1) for a time of B per point: M/N = T2/T1 [Talbot 2005, Eq. 4.4].

use super::measure::{Measured, Method, Stage, View, median, turns};
use super::{Observer, ReproduceError};
use crate::scene::{Split, StageTimes};

/// Turns of a measurement of times.
const TURNS: u32 = 3;
/// Most corrections of the number of proposals.
const CORRECTIONS: usize = 3;
/// Good enough a match of times.
const MATCH: f64 = 0.01;
/// Most proposals: the buffers of a batch grow with them.
const MAX_PROPOSALS: u32 = 1024;

/// Times of the stages, and a split that costs as much as the baseline.
#[derive(Clone, Copy, Debug)]
pub struct Calibration {
    /// T1 and T2 (ns).
    pub times: StageTimes,
    /// Direct lighting of one point by the baseline (ns).
    pub budget: f64,
    /// M and N.
    pub split: Split,
    /// Thread seconds of one camera ray per pixel by the baseline.
    pub seconds: f64,
}

/// Times of one proposal and of one sample (ns) of what was rendered by `ris`.
pub fn stage_times(m: &Measured) -> StageTimes {
    let points = (m.proposals as f64 / f64::from(m.method.proposals)).max(1.0);
    let seconds = |f: fn(&super::measure::StageSeconds) -> f64| median(m.seconds.iter().map(f).collect());
    let per_turn = points / m.turns().max(1) as f64;
    let t1 = seconds(|s| s.t1 + s.select) * 1e9 / (per_turn * f64::from(m.method.proposals));
    let t2 = seconds(|s| s.t2) * 1e9 / (per_turn * f64::from(m.method.samples));
    StageTimes { t1: t1.max(1e-3), t2: t2.max(1e-3) }
}

/// N and M for a time per point, of which half goes to samples; at least one sample, and no fewer proposals than samples.
pub fn equal_halves(budget: f64, times: StageTimes) -> Split {
    let samples = (0.5 * budget / times.t2).round().max(1.0);
    let samples = samples.min((budget / (times.t1 + times.t2)).floor().max(1.0));
    spend_rest(budget, times, samples as u32)
}

/// The proposals that fit beside a number of samples.
pub fn spend_rest(budget: f64, times: StageTimes, samples: u32) -> Split {
    let proposals = ((budget - f64::from(samples) * times.t2) / times.t1).round().clamp(1.0, f64::from(MAX_PROPOSALS));
    Split { samples, proposals: (proposals as u32).max(samples) }
}

/// Measures times, and finds a split that costs what the baseline costs, within about a percent.
pub fn calibrate(stage: &mut Stage, base: &Method, observer: Observer<'_>) -> Result<Calibration, ReproduceError> {
    // Times, with a first guess
    let guess = Method::ris(4 * base.samples, base.samples.div_ceil(2)).stratified();
    let pilot = turns(stage, &[*base, guess], View::Centres, 1, 0..TURNS, observer)?;
    let times = stage_times(&pilot[1]);
    let points = (pilot[1].proposals as f64 / f64::from(guess.proposals) / f64::from(TURNS)).max(1.0);
    let direct = |m: &Measured| median(m.seconds.iter().map(|s| s.t1 + s.select + s.t2).collect());
    let budget = direct(&pilot[0]) * 1e9 / points;
    let split = equal_halves(budget, times);
    let found = Calibration { times, budget, split, seconds: pilot[0].mean_seconds() };
    correct(stage, base, found, observer)
}

/// Renders the split in turns with the baseline, and changes the number of proposals until times match.
fn correct(
    stage: &mut Stage,
    base: &Method,
    mut found: Calibration,
    observer: Observer<'_>,
) -> Result<Calibration, ReproduceError> {
    for step in 0..CORRECTIONS as u32 {
        let Split { samples, proposals } = found.split;
        let method = Method::ris(proposals, samples).stratified();
        let range = (step + 1) * TURNS..(step + 2) * TURNS;
        let pair = turns(stage, &[*base, method], View::Centres, 1, range, observer)?;
        let excess = pair[1].time_ratio(&pair[0]) - 1.0;
        found.times = stage_times(&pair[1]);
        if excess.abs() < MATCH {
            break;
        }
        // The excess is a part of the whole time of the baseline; a proposal takes T1 of it at every point.
        let points = pair[1].proposals as f64 / f64::from(proposals) / f64::from(TURNS);
        let surplus = excess * pair[0].mean_seconds() * 1e9 / (points.max(1.0) * found.times.t1);
        let corrected = (f64::from(proposals) - surplus).round().clamp(f64::from(samples), f64::from(MAX_PROPOSALS));
        found.split.proposals = corrected as u32;
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_of_the_time_go_to_proposals_and_to_samples() {
        let times = StageTimes { t1: 10.0, t2: 160.0 };
        // The paper's case: 20 samples of one proposal each.
        let split = equal_halves(20.0 * 170.0, times);
        assert_eq!(split.samples, 11);
        assert_eq!(split.proposals, 164);
        let spent = |s: Split| f64::from(s.proposals) * times.t1 + f64::from(s.samples) * times.t2;
        assert!((spent(split) - 3400.0).abs() < times.t1);
        // One sample at least; proposals as dear as samples leave M = N.
        assert_eq!(equal_halves(100.0, times).samples, 1);
        assert_eq!(equal_halves(2000.0, StageTimes { t1: 100.0, t2: 100.0 }), Split { samples: 10, proposals: 10 });
        assert_eq!(equal_halves(2000.0, StageTimes { t1: 100.0, t2: 10.0 }), Split { samples: 18, proposals: 18 });
    }
}

//! Sample counts for equal time.
//!
//! A rendering costs c + P·(M·T1 + N·T2), where P is the number of shading points. T1 is the cost of a proposal and its
//! weight, and T2 is the cost of drawing, evaluating and tracing a sample; both are measured by renderings with small
//! and large counts. The counts are N = B/(2·T2), M = B/(2·T1) for a time of B per point: M/N = T2/T1 [Talbot 2005, Eq.
//! 4.4]. Then M is corrected until renderings take as long as the baseline.

use super::measure::{Measured, Seconds, Stage, View, turns};
use super::method::Method;
use super::{Observer, ReproduceError};
use lumiris::lights::LightSamplerKind;
use lumiris::settings::{SampleCounts, Strata};
use lumiris_numbers::estimators::ris::sample_counts::Costs;

/// Turns of a time measurement.
const TURNS: u32 = 3;
/// Maximum number of corrections of the number of proposals.
const CORRECTIONS: u32 = 4;
/// Minimum time of a proposal or a sample (ns).
const LEAST_TIME: f64 = 0.1;
/// Relative tolerance of equal times.
const MATCH: f64 = 0.01;
/// Maximum number of proposals and of samples, which determine the size of batch buffers. On a busy machine the
/// measured time of one may be next to nothing.
const MAX_PROPOSALS: u32 = 1024;

/// M and N of the timed estimates: small and large.
const TIMED: [[u32; 2]; 2] = [[8, 1], [40, 5]];

/// Times of the stages, and sample counts with the cost of the baseline.
#[derive(Clone, Copy, Debug)]
pub struct Calibration {
    /// T1 and T2 (ns).
    pub times: Costs,
    /// Time of direct lighting of one point by the baseline (ns).
    pub budget: f64,
    /// M and N.
    pub sample_counts: SampleCounts,
    /// Wall-clock seconds of one camera ray per pixel by the baseline.
    pub seconds: f64,
}

/// Shading points of a turn of `ris`.
fn points(m: &Measured) -> f64 {
    (m.proposals as f64 / f64::from(m.method.proposals) / m.turns().max(1) as f64).max(1.0)
}

/// T1 and T2 (ns), with this light sampler; `None` if nothing in the image is illuminated.
fn stage_times(
    stage: &mut Stage,
    lights: LightSamplerKind,
    observer: Observer<'_>,
) -> Result<Option<Costs>, ReproduceError> {
    let method = |[m, n]: [u32; 2]| Method::ris(m, n).lights_by(lights).stratified().strata(Strata::Systematic);
    let timed = turns(stage, &TIMED.map(method), View::Centres, 1, 0..TURNS, observer)?;
    if timed.iter().any(|m| m.segments == 0) {
        return Ok(None);
    }
    let difference = |of: fn(&Seconds) -> f64| {
        let [few, many] = [0, 1].map(|i| timed[i].median_seconds(of) * 1e9 / points(&timed[i]));
        many - few
    };
    let [m, n] = [0, 1].map(|i| f64::from(TIMED[1][i] - TIMED[0][i]));
    let t1 = (difference(|s| s.t1) / m).max(LEAST_TIME);
    Ok(Some(Costs { t1, t2: (difference(|s| s.select + s.t2) / n).max(LEAST_TIME) }))
}

/// N and M for a time per point, half of which is for samples; at least one sample, and at least as many proposals as
/// samples.
pub fn equal_halves(budget: f64, times: Costs) -> SampleCounts {
    let samples = (0.5 * budget / times.t2).round().max(1.0);
    let samples = samples.min((budget / (times.t1 + times.t2)).floor().max(1.0)).min(f64::from(MAX_PROPOSALS));
    counts_for_budget(budget, times, samples as u32)
}

/// The number of proposals for the time that remains beside a number of samples.
pub fn counts_for_budget(budget: f64, times: Costs, samples: u32) -> SampleCounts {
    let proposals = ((budget - f64::from(samples) * times.t2) / times.t1).round().clamp(1.0, f64::from(MAX_PROPOSALS));
    SampleCounts { samples, proposals: (proposals as u32).max(samples) }
}

/// Measures times, and determines sample counts with the cost of the baseline, within about a percent.
pub fn calibrate(stage: &mut Stage, base: &Method, observer: Observer<'_>) -> Result<Calibration, ReproduceError> {
    // Times, including the baseline's
    let default = Costs { t1: 100.0, t2: 100.0 };
    let times = stage_times(stage, base.light_sampler, observer)?.unwrap_or(default);
    let ris = |proposals, samples| Method::ris(proposals, samples).lights_by(base.light_sampler).stratified();
    let guess = ris(4 * base.samples, base.samples.div_ceil(2));
    let pilot = turns(stage, &[*base, guess], View::Centres, 1, 0..TURNS, observer)?;
    let busy = pilot[0].median_seconds(|s| s.processor / s.stages().max(1e-12)).min(1.0);
    let budget = pilot[0].median_seconds(Seconds::direct) * busy * 1e9 / points(&pilot[1]);
    let seconds = pilot[0].median_seconds(|s| s.wall);
    let mut found = Calibration { times, budget, sample_counts: equal_halves(budget, times), seconds };

    // Alternate with the baseline; adjust the number of proposals until times agree
    for step in 0..CORRECTIONS {
        let SampleCounts { samples, proposals } = found.sample_counts;
        let method = ris(proposals, samples);
        let range = (step + 1) * TURNS..(step + 2) * TURNS;
        let pair = turns(stage, &[*base, method], View::Centres, 1, range, observer)?;
        let excess = pair[1].time_ratio(&pair[0]) - 1.0;
        if excess.abs() < MATCH {
            break;
        }
        // The excess is a fraction of the total time of the baseline; a proposal takes T1 at every point.
        let surplus = excess * pair[0].median_seconds(|s| s.processor) * 1e9 / (points(&pair[1]) * found.times.t1);
        let corrected = (f64::from(proposals) - surplus).round().clamp(f64::from(samples), f64::from(MAX_PROPOSALS));
        found.sample_counts.proposals = corrected as u32;
    }
    Ok(found)
}

/// The number of samples of `method` for which a rendering of `spp` camera rays takes as long as the baseline.
pub fn match_samples(
    stage: &mut Stage,
    base: &Method,
    method: &Method,
    spp: u32,
    observer: Observer<'_>,
) -> Result<u32, ReproduceError> {
    let mut samples = method.samples;
    for step in 0..2 {
        let tried = Method { samples, proposals: samples, ..*method };
        let range = (step + 8) * TURNS..(step + 9) * TURNS;
        let pair = turns(stage, &[*base, tried], View::Centres, spp, range, observer)?;
        // The time of an estimate grows with its samples; the time of camera rays and materials does not
        let direct = pair[1].median_seconds(|s| s.direct() / s.stages().max(1e-12)).clamp(0.1, 1.0);
        let ratio = pair[1].time_ratio(&pair[0]);
        if (ratio - 1.0).abs() < MATCH {
            break;
        }
        let factor = 1.0 - (1.0 - 1.0 / ratio.max(1e-3)) / direct;
        samples = (f64::from(samples) * factor.clamp(0.25, 2.0)).round().max(2.0) as u32;
    }
    Ok(samples)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_of_the_time_go_to_proposals_and_to_samples() {
        let times = Costs { t1: 10.0, t2: 160.0 };
        // The paper's case: 20 samples of one proposal each.
        let sample_counts = equal_halves(20.0 * 170.0, times);
        assert_eq!(sample_counts.samples, 11);
        assert_eq!(sample_counts.proposals, 164);
        let spent = |s: SampleCounts| f64::from(s.proposals) * times.t1 + f64::from(s.samples) * times.t2;
        assert!((spent(sample_counts) - 3400.0).abs() < times.t1);
        // At least one sample; proposals as expensive as samples give M = N.
        assert_eq!(equal_halves(100.0, times).samples, 1);
        assert_eq!(equal_halves(2000.0, Costs { t1: 100.0, t2: 100.0 }), SampleCounts { samples: 10, proposals: 10 });
        assert_eq!(equal_halves(2000.0, Costs { t1: 100.0, t2: 10.0 }), SampleCounts { samples: 18, proposals: 18 });
        // Buffers are bounded where times are next to nothing
        let most = SampleCounts { samples: MAX_PROPOSALS, proposals: MAX_PROPOSALS };
        assert_eq!(equal_halves(20_000.0, Costs { t1: LEAST_TIME, t2: LEAST_TIME }), most);
    }
}

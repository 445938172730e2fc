//! Comparison of methods at equal time: variances, and a pair of images.

use super::super::calibrate::{Calibration, calibrate};
use super::super::figure::Figure;
use super::super::measure::{Stage, View, reference, turns};
use super::super::method::Method;
use super::super::{Observer, ReproduceError};
use super::cases::Case;
use super::classes::Classes;
use super::outcome::Outcome;
use super::report;
use super::roster::{Roster, roster};
use super::setup::{Setup, portrait};
use lumiris::settings::SampleCounts;
use std::time::{Duration, Instant};

/// Turns of the antialiased images, for their variance.
const PAIR_TURNS: u32 = 4;
/// Edge of the image for time measurements, and the minimum edge.
const PILOT_SIZE: u32 = 96;
const MIN_SIZE: u32 = 32;
/// Minimum and maximum number of turns.
const TURNS: [u32; 2] = [4, 48];
const QUICK_TURNS: u32 = 8;
/// Number of turns for which the size of the image is chosen.
const WANTED_TURNS: f64 = 8.0;

/// Measures a case within about `time`.
pub(super) fn run(setup: &Setup<'_>, case: &Case, time: Duration) -> Result<Figure, ReproduceError> {
    let start = Instant::now();
    let Observer { say, .. } = setup.observer;
    say(&format!("{} …", case.title));
    let base = Method::mc(case.samples);
    let path = setup.scenes.path(case.scene);

    // Image size that fits the time
    let pilot_size = setup.size.min(PILOT_SIZE);
    let mut stage = Stage::load(&path, portrait(pilot_size), setup.options.threads)?;
    let mut calibration = calibrate(&mut stage, &base, setup.observer)?;
    let count = roster(case, calibration.sample_counts).methods.len() as f64;
    let cost = |c: &Calibration| c.seconds * f64::from(case.primary) * 1.1;
    let antialiased = 3.0 * f64::from(PAIR_TURNS);
    let wanted = cost(&calibration) * (WANTED_TURNS * count + antialiased);
    let fits = (time.saturating_sub(start.elapsed()).as_secs_f64() / wanted).sqrt();
    let size = ((f64::from(pilot_size) * fits) as u32 / 8 * 8).max(MIN_SIZE).min(setup.size);
    if size != pilot_size {
        stage = Stage::load(&path, portrait(size), setup.options.threads)?;
        calibration = calibrate(&mut stage, &base, setup.observer)?;
    }

    // Number of turns that fits the time
    let Roster { methods: named, roles } = roster(case, calibration.sample_counts);
    let list: Vec<Method> = named.iter().map(|n| n.method).collect();
    let left = time.saturating_sub(start.elapsed()).as_secs_f64() / cost(&calibration) - antialiased;
    let count_turns = ((left / count) as u32).clamp(TURNS[0], if setup.options.quick { QUICK_TURNS } else { TURNS[1] });
    let SampleCounts { samples, proposals } = calibration.sample_counts;
    let [width, height] = stage.size();
    say(&format!(
        "  {width} × {height} pixels, {count_turns} turns of {count} methods, M = {proposals}, N = {samples}"
    ));
    let measured = turns(&mut stage, &list, View::Centres, case.primary, 0..count_turns, setup.observer)?;

    let reference = reference(&measured);
    let classes = Classes::new(&mut stage, &reference, setup.observer)?;
    let chosen: Vec<Method> =
        [roles.base, roles.judged].into_iter().chain(roles.base_stratified).map(|i| list[i]).collect();
    let range = TURNS[1]..TURNS[1] + PAIR_TURNS;
    let antialiased = turns(&mut stage, &chosen, View::Antialiased, case.primary, range, setup.observer)?;
    let outcome = Outcome {
        case,
        stage_facts: stage.facts(),
        size: stage.size(),
        calibration,
        methods: named,
        roles,
        measured,
        reference,
        classes,
        antialiased,
    };
    report::comparison(setup, &outcome)
}

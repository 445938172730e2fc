//! Direct light: all methods compared with `mis` at the same samples per estimate, and two of them at the same time.

use super::super::calibrate::{calibrate, match_samples};
use super::super::figure::Figure;
use super::super::measure::{Stage, View, scaled, turns};
use super::super::method::Method;
use super::super::{Observer, ReproduceError};
use super::cases::{Case, LONG, LONG_TURNS, SHOWN, SHOWN_WAYS};
use super::growth::{cost as growth_cost, measure as measure_growth};
use super::outcome::Outcome;
use super::report;
use super::roster::{Numbers, Role, methods};
use super::setup::Setup;
use super::truth::Truth;
use lumiris::settings::SampleCounts;
use std::time::{Duration, Instant};

/// First turn of antialiased images, whose index determines their seed.
const ANTIALIASED_TURNS: u32 = 2_000_000;
/// Edge of the image for time measurements, and the minimum edge: normal and quick.
const PILOT_SIZE: [u32; 2] = [96, 48];
const MIN_SIZE: [u32; 2] = [64, 32];
/// Minimum and maximum number of turns, and the number for which the size of the image is chosen; quick runs use that
/// number.
const TURNS: [u32; 2] = [4, 32];
const WANTED_TURNS: [f64; 2] = [8.0, 4.0];
/// Turns of the antialiased images.
const PAIR_TURNS: u32 = 4;

/// The long renderings of a stage.
fn truth(stage: &mut Stage, method: Method, view: View, observer: Observer<'_>) -> Result<Truth, ReproduceError> {
    let range = LONG_TURNS..LONG_TURNS + LONG.1;
    Ok(Truth::new(&turns(stage, &[method], view, LONG.0, range, observer)?[0]))
}

/// Times of a stage.
struct Pilot {
    /// Numbers of samples for equal time.
    numbers: Numbers,
    /// Time of a camera ray per pixel.
    seconds: f64,
}

fn pilot(stage: &mut Stage, case: &Case, observer: Observer<'_>) -> Result<Pilot, ReproduceError> {
    let unknown = Numbers {
        samples: case.samples,
        equal_time: case.samples,
        ris: SampleCounts { samples: case.samples, proposals: case.samples },
    };
    let base = Role::Balance.method(unknown);
    let calibration = calibrate(stage, &base, observer)?;
    let equal_time = match_samples(stage, &base, &Role::Progressive.method(unknown), case.spp, observer)?;
    let numbers = Numbers { equal_time, ris: calibration.sample_counts, ..unknown };
    Ok(Pilot { numbers, seconds: calibration.seconds })
}

/// Camera rays per pixel for everything except the turns.
fn fixed_cost(case: &Case, quick: bool) -> f64 {
    let shown = (SHOWN.len() * SHOWN_WAYS.len()) as f64;
    2.0 * f64::from(LONG.0 * LONG.1) + f64::from(PAIR_TURNS * case.spp) * shown + growth_cost(quick)
}

/// Measures a case within about `time`.
pub(super) fn run(setup: &Setup<'_>, case: &Case, time: Duration) -> Result<Figure, ReproduceError> {
    let start = Instant::now();
    let (observer, quick) = (setup.observer, setup.options.quick);
    (observer.say)(&format!("{} …", case.title));
    let path = setup.scenes.join(case.file);

    // Image size that fits the time
    let pilot_size = setup.size.min(PILOT_SIZE[usize::from(quick)]);
    let mut stage = Stage::load(&path, scaled(case.shape, pilot_size), setup.options.threads)?;
    let Pilot { mut numbers, mut seconds } = pilot(&mut stage, case, observer)?;
    let count = methods(numbers).len() as f64;
    let fixed = fixed_cost(case, quick);
    let turn = count * f64::from(case.spp);
    let wanted = seconds * 1.15 * (WANTED_TURNS[usize::from(quick)] * turn + fixed);
    let fits = (time.saturating_sub(start.elapsed()).as_secs_f64() / wanted).sqrt();
    let size = ((f64::from(pilot_size) * fits) as u32 / 8 * 8).max(MIN_SIZE[usize::from(quick)]).min(setup.size);
    if size != pilot_size {
        stage = Stage::load(&path, scaled(case.shape, size), setup.options.threads)?;
        Pilot { numbers, seconds } = pilot(&mut stage, case, observer)?;
    }

    // Number of turns that fits the time
    let left = time.saturating_sub(start.elapsed()).as_secs_f64() / (seconds * 1.15) - fixed;
    let max = if quick { WANTED_TURNS[1] as u32 } else { TURNS[1] };
    let count_turns = ((left / turn) as u32).clamp(TURNS[0], max);
    let [width, height] = stage.size();
    (observer.say)(&format!("  {width} × {height} pixels, {count_turns} turns of {count} methods"));
    let list = methods(numbers);
    let reference = list[Role::Balance.place(1)];
    let true_image = truth(&mut stage, reference, View::Centres, observer)?;
    let measured = turns(&mut stage, &list, View::Centres, case.spp, 0..count_turns, observer)?;

    // With antialiasing
    let antialiased_truth = truth(&mut stage, reference, View::Antialiased, observer)?;
    let shown = SHOWN_WAYS.iter().flat_map(|&way| SHOWN.map(|r| list[r.place(way)]));
    let shown: Vec<Method> = shown.collect();
    let range = ANTIALIASED_TURNS..ANTIALIASED_TURNS + PAIR_TURNS;
    let antialiased = turns(&mut stage, &shown, View::Antialiased, case.spp, range, observer)?;
    let antialiased = antialiased.chunks(SHOWN.len()).map(<[_]>::to_vec).collect();
    let (facts, size) = (stage.facts(), stage.size());

    let growth = measure_growth(setup, case, numbers, size)?;
    let errors = measured.iter().map(|m| true_image.errors(m)).collect();
    let outcome = Outcome {
        case,
        facts,
        size,
        numbers,
        measured,
        truth: true_image,
        errors,
        antialiased,
        antialiased_truth,
        growth,
    };
    report::direct(setup, &outcome)
}

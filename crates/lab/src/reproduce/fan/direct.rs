//! Direct light: all methods against `mis` with the same samples per estimate, and two of them with the same time.

use super::super::calibrate::{calibrate, match_samples};
use super::super::figure::Figure;
use super::super::measure::{Measured, Stage, View, turns};
use super::super::method::Method;
use super::super::{Observer, ReproduceError, scaled};
use super::growth::{Growth, cost as growth_cost, measure as measure_growth};
use super::roster::{Numbers, Role, methods};
use super::truth::{Errors, Truth};
use super::{Setup, report};
use lumiris::settings::SampleCounts;
use std::time::{Duration, Instant};

/// A row of the paper's table.
pub(super) struct Case {
    pub id: &'static str,
    pub title: &'static str,
    pub intro: &'static str,
    pub file: &'static str,
    /// Width and height of the paper's image.
    pub shape: [u32; 2],
    /// Camera rays per pixel, and samples at each.
    pub spp: u32,
    pub samples: u32,
    /// Errors of mis and of ocv in the paper, and the time of ocv over that of mis.
    pub paper: [f64; 2],
    pub paper_time: f64,
    /// Reduction of the error that is to be reached (percent).
    pub target: f64,
    /// True if the efficiency must not be below that of mis either.
    pub efficient: bool,
    /// The part of the image that is shown larger: left, top, right, bottom, in fractions.
    pub crop: [f64; 4],
}

impl Case {
    pub(super) const CHECKERS: Case = Case {
        id: "checkers",
        title: "Checkers",
        intro: "A glossy board with a few things on it, under a large yellow light that it reflects at the left and a small blue one at the \
                right, after figure 2 of the paper: light samples are poor where the board mirrors the large light, BSDF samples everywhere else.",
        file: "checkers.pbrt",
        shape: [500, 500],
        spp: 4,
        samples: 64,
        paper: [0.60, 0.48],
        paper_time: 1.05,
        target: 20.0,
        efficient: false,
        crop: [0.0, 0.3, 0.4, 0.7],
    };
    pub(super) const STATUE: Case = Case {
        id: "statue",
        title: "Statue",
        intro: "A lacquered dragon among large lights, in the place of the Buddha of figure 1: tight highlights, folds that see a part of each light, \
                soft shadows.",
        file: "statue.pbrt",
        shape: [256, 512],
        spp: 4,
        samples: 64,
        paper: [0.72, 0.46],
        paper_time: 1.07,
        target: 36.0,
        efficient: false,
        crop: [0.2, 0.12, 0.9, 0.47],
    };
    pub(super) const ROOM: Case = Case {
        id: "room",
        title: "Room",
        intro: "A room with three small lights and little that hides them, after figure 3: few samples do, and there is little to win.",
        file: "room.pbrt",
        shape: [480, 360],
        spp: 2,
        samples: 18,
        paper: [0.75, 0.68],
        paper_time: 1.16,
        target: 9.0,
        efficient: true,
        crop: [0.3, 0.35, 0.75, 0.85],
    };
}

/// Camera rays of each of the long renderings, and their number.
pub(super) const LONG: (u32, u32) = (16, 4);
/// Seeds of long renderings, of antialiased images and of curves are those of turns from here on.
pub(super) const LONG_TURNS: u32 = 1_000_000;
const ANTIALIASED_TURNS: u32 = 2_000_000;
/// Edge of the image on which times are found out, and the least edge: usual and quick.
const PILOT_SIZE: [u32; 2] = [96, 48];
const MIN_SIZE: [u32; 2] = [64, 32];
/// Fewest and most turns, and those that the size of the image is chosen for; quick ones are as few as that.
const TURNS: [u32; 2] = [4, 32];
const WANTED_TURNS: [f64; 2] = [8.0, 4.0];
/// Turns of the antialiased images.
const PAIR_TURNS: u32 = 4;

/// Who is shown with antialiasing, and with samples drawn in which ways.
pub(super) const SHOWN: [Role; 4] = [Role::Balance, Role::Progressive, Role::Correlated, Role::Ris];
pub(super) const SHOWN_WAYS: [usize; 2] = [0, 1];

/// Everything that was measured for a case.
pub(super) struct Outcome<'a> {
    pub case: &'a Case,
    pub facts: (usize, usize),
    pub size: [u32; 2],
    pub numbers: Numbers,
    pub measured: Vec<Measured>,
    pub truth: Truth,
    pub errors: Vec<Errors>,
    /// Those of [`SHOWN`] with rays all over the pixels, for each of [`SHOWN_WAYS`].
    pub antialiased: Vec<Vec<Measured>>,
    pub antialiased_truth: Truth,
    pub growth: Growth,
}

/// The long renderings of a stage.
fn truth(stage: &mut Stage, method: Method, view: View, observer: Observer<'_>) -> Result<Truth, ReproduceError> {
    let range = LONG_TURNS..LONG_TURNS + LONG.1;
    Ok(Truth::new(&turns(stage, &[method], view, LONG.0, range, observer)?[0]))
}

/// Times of a stage: the numbers of samples of equal time, and seconds of a camera ray per pixel.
fn pilot(stage: &mut Stage, case: &Case, observer: Observer<'_>) -> Result<(Numbers, f64), ReproduceError> {
    let unknown = Numbers {
        samples: case.samples,
        equal_time: case.samples,
        ris: SampleCounts { samples: case.samples, proposals: case.samples },
    };
    let base = Role::Balance.method(unknown);
    let calibration = calibrate(stage, &base, observer)?;
    let equal_time = match_samples(stage, &base, &Role::Progressive.method(unknown), case.spp, observer)?;
    Ok((Numbers { equal_time, ris: calibration.sample_counts, ..unknown }, calibration.seconds))
}

/// Camera rays per pixel for everything but the turns.
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

    // As many pixels as fit
    let pilot_size = setup.size.min(PILOT_SIZE[usize::from(quick)]);
    let mut stage = Stage::load(&path, scaled(case.shape, pilot_size), setup.options.threads)?;
    let (mut numbers, mut seconds) = pilot(&mut stage, case, observer)?;
    let count = methods(numbers).len() as f64;
    let fixed = fixed_cost(case, quick);
    let turn = count * f64::from(case.spp);
    let wanted = seconds * 1.15 * (WANTED_TURNS[usize::from(quick)] * turn + fixed);
    let fits = (time.saturating_sub(start.elapsed()).as_secs_f64() / wanted).sqrt();
    let size = ((f64::from(pilot_size) * fits) as u32 / 8 * 8).max(MIN_SIZE[usize::from(quick)]).min(setup.size);
    if size != pilot_size {
        stage = Stage::load(&path, scaled(case.shape, size), setup.options.threads)?;
        (numbers, seconds) = pilot(&mut stage, case, observer)?;
    }

    // As many turns as fit
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

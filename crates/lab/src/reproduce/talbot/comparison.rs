//! Methods of equal time against each other: variances at equal time, and a pair of images of equal time.

use super::super::calibrate::{Calibration, calibrate};
use super::super::figure::Figure;
use super::super::measure::{Measured, Stage, View, reference, turns};
use super::super::method::Method;
use super::super::{Observer, ReproduceError};
use super::classes::Classes;
use super::report;
use super::scenes::Which;
use super::{Setup, portrait};
use lumiris::settings::{SampleCounts, Strata};
use std::time::{Duration, Instant};

/// A figure that compares methods.
pub(super) struct Case {
    pub id: &'static str,
    pub title: &'static str,
    pub intro: &'static str,
    pub scene: Which,
    /// Camera rays per pixel.
    pub primary: u32,
    /// Shadow rays of the baseline at each.
    pub samples: u32,
    /// M and N of the paper.
    pub printed: Option<SampleCounts>,
    pub kind: Kind,
}

/// What is compared, and with what outcome.
#[derive(Clone, Copy)]
pub(super) enum Kind {
    /// Resampling against light sampling: reduction of variance in the paper, and to be reached here (percent), by the
    /// resampling that is judged.
    Reduction { paper: f64, target: f64, judged: Judged },
    /// Ways to stratify resampling against none.
    Stratification,
}

/// Which M and N a verdict is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Judged {
    /// Equal halves of the time for proposals and for samples, stratified.
    EqualHalves,
    /// Those of the paper, without stratification: where a proposal costs what a sample does, equal halves of the time are
    /// M = N, which resamples nothing.
    Printed,
}

impl Case {
    pub(super) const PAPER_4: Case = Case {
        id: "paper-figure-4",
        title: "Paper, figure 4: an environment and two area lights",
        intro: "Direct light with 20 camera rays per pixel: light sampling with 20 shadow rays at each, against resampling with M/N = T2/T1.",
        scene: Which::Both,
        primary: 20,
        samples: 20,
        printed: Some(SampleCounts { samples: 11, proposals: 168 }),
        kind: Kind::Reduction { paper: 70.0, target: 80.0, judged: Judged::EqualHalves },
    };
    pub(super) const PAPER_4_LIGHTS: Case = Case {
        id: "paper-figure-4-lights",
        title: "Paper, figure 4 without the environment: two area lights",
        intro: "The same with the two area lights alone, where most of the variance is that of visibility.",
        scene: Which::Lights,
        printed: Some(SampleCounts { samples: 11, proposals: 168 }),
        kind: Kind::Reduction { paper: 10.0, target: 30.0, judged: Judged::EqualHalves },
        ..Case::PAPER_4
    };
    pub(super) const THESIS_53: Case = Case {
        id: "thesis-figure-5.3",
        title: "Thesis, figure 5.3: an environment alone",
        intro: "Direct light with 10 camera rays per pixel: light sampling with 100 shadow rays at each, against resampling.",
        scene: Which::Environment,
        primary: 10,
        samples: 100,
        printed: Some(SampleCounts { samples: 64, proposals: 229 }),
        kind: Kind::Reduction { paper: 33.0, target: 45.0, judged: Judged::Printed },
    };
    pub(super) const THESIS_54: Case = Case {
        id: "thesis-figure-5.4",
        title: "Thesis, figure 5.4: stratification",
        intro: "Resampling without any stratification, with stratified proposals, and with strata of samples on top of these. \
                The thesis stratifies proposals by Latin hypercubes; here they are well distributed along a curve through all lights.",
        scene: Which::Both,
        primary: 1,
        samples: 32,
        printed: None,
        kind: Kind::Stratification,
    };
}

/// A method with its name on the page.
#[derive(Clone, Debug)]
pub(super) struct Named {
    pub name: String,
    pub method: Method,
}

/// Proposals of the rendering that shows the variance of visibility alone.
const MANY: u32 = 96;

/// Positions among the methods that [`methods`] gives.
pub(super) struct Roles {
    /// What all are compared with.
    pub base: usize,
    /// What the target is about.
    pub judged: usize,
    /// Resampling that is stratified in every way, with M and N for equal halves of the time.
    pub equal_halves: usize,
    /// Resampling without stratification.
    pub plain: usize,
    /// Light sampling with well distributed points, where it is there.
    pub base_stratified: Option<usize>,
    /// One sample of many proposals.
    pub visibility: usize,
}

fn methods(case: &Case, sample_counts: SampleCounts) -> (Vec<Named>, Roles) {
    let SampleCounts { samples: n, proposals: m } = sample_counts;
    let named = |name: &str, method: Method| Named { name: name.to_owned(), method };
    let ris = Method::ris(m, n);
    let plain = named("ris, no stratification", ris);
    let points = named("ris + stratified proposals", ris.stratified());
    let systematic =
        named("ris + stratified proposals + systematic samples", ris.stratified().strata(Strata::Systematic));
    let visibility = named("ris, one sample of many proposals", Method::ris(MANY, 1));
    match case.kind {
        Kind::Reduction { judged, .. } => {
            let mut list = vec![
                named("mc", Method::mc(case.samples)),
                named("mc + stratified samples", Method::mc(case.samples).stratified()),
                named("mis", Method::mis(case.samples)),
                named("mis + stratified samples", Method::mis(case.samples).stratified()),
                plain,
                points,
                systematic,
                visibility,
            ];
            if let Some(s) = case.printed {
                list.push(named(
                    "ris with the paper's M and N, no stratification",
                    Method::ris(s.proposals, s.samples),
                ));
            }
            let judged = match judged {
                Judged::EqualHalves => 6,
                Judged::Printed => list.len() - 1,
            };
            (list, Roles { base: 0, judged, equal_halves: 6, plain: 4, base_stratified: Some(1), visibility: 7 })
        }
        Kind::Stratification => {
            let strata = |s: Strata| ris.stratified().strata(s);
            let list = vec![
                plain,
                points,
                named("ris + stratified proposals + equal-proposals strata", strata(Strata::Proposals)),
                named("ris + stratified proposals + equal-weights strata", strata(Strata::Weights)),
                systematic,
                visibility,
            ];
            (list, Roles { base: 0, judged: 4, equal_halves: 4, plain: 0, base_stratified: None, visibility: 5 })
        }
    }
}

/// Everything that was measured for a case.
pub(super) struct Outcome<'a> {
    pub case: &'a Case,
    pub stage_facts: (usize, usize),
    pub size: [u32; 2],
    pub calibration: Calibration,
    pub methods: Vec<Named>,
    pub roles: Roles,
    pub measured: Vec<Measured>,
    pub reference: Vec<[f64; 3]>,
    pub classes: Classes,
    /// The baseline, the method that is judged, and the baseline with stratified samples where there is one, with rays all
    /// over the pixels.
    pub antialiased: Vec<Measured>,
}

/// Turns of the antialiased images, for their variance.
const PAIR_TURNS: u32 = 4;
/// Edge of the image on which times are found out, and the least edge.
const PILOT_SIZE: u32 = 96;
const MIN_SIZE: u32 = 32;
/// Fewest and most turns.
const TURNS: [u32; 2] = [4, 48];
const QUICK_TURNS: u32 = 8;
/// Turns that the size of the image is chosen for.
const WANTED_TURNS: f64 = 8.0;

/// Measures a case within about `time`.
pub(super) fn run(setup: &Setup<'_>, case: &Case, time: Duration) -> Result<Figure, ReproduceError> {
    let start = Instant::now();
    let Observer { say, .. } = setup.observer;
    say(&format!("{} …", case.title));
    let base = Method::mc(case.samples);
    let path = setup.scenes.path(case.scene);

    // As many pixels as fit
    let pilot_size = setup.size.min(PILOT_SIZE);
    let mut stage = Stage::load(&path, portrait(pilot_size), setup.options.threads)?;
    let mut calibration = calibrate(&mut stage, &base, setup.observer)?;
    let count = methods(case, calibration.sample_counts).0.len() as f64;
    let cost = |c: &Calibration| c.seconds * f64::from(case.primary) * 1.1;
    let antialiased = 3.0 * f64::from(PAIR_TURNS);
    let wanted = cost(&calibration) * (WANTED_TURNS * count + antialiased);
    let fits = (time.saturating_sub(start.elapsed()).as_secs_f64() / wanted).sqrt();
    let size = ((f64::from(pilot_size) * fits) as u32 / 8 * 8).max(MIN_SIZE).min(setup.size);
    if size != pilot_size {
        stage = Stage::load(&path, portrait(size), setup.options.threads)?;
        calibration = calibrate(&mut stage, &base, setup.observer)?;
    }

    // As many turns as fit
    let (named, roles) = methods(case, calibration.sample_counts);
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

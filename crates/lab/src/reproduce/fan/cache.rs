//! Irradiance caching: records with direct light estimated by `mis` or by `ocv` [Fan et al. 2006, Fig. 4].

use super::super::ReproduceError;
use super::super::figure::Figure;
use super::super::images::{Image, gain, significant};
use super::super::measure::{Measured, Stage, View, scaled, turns};
use super::super::method::{Method, Transport};
use super::super::page::{Block, Shown, Table};
use super::cases::LONG_TURNS;
use super::report::{Asked, HEADER, method_json, method_row, summary, variances};
use super::setup::Setup;
use super::truth::{Errors, Truth};
use lumiris::settings::OcvForm;
use lumiris_numbers::estimators::heuristics::Heuristic;
use serde_json::{Value, json};
use std::time::{Duration, Instant};

const FILE: &str = "box.pbrt";
/// Width and height of the image.
const SHAPE: [u32; 2] = [400, 400];
/// Camera rays per pixel, and samples of an estimate.
const SPP: u32 = 9;
const SAMPLES: u32 = 18;
/// The row of the paper's table.
const ASKED: Asked = Asked { paper: [4.9, 4.0], time: 1.05, target: 18.0, efficient: false };
/// Camera rays of each of the long path-traced renderings, and their number.
const LONG: (u32, u32) = (64, 4);
/// Minimum and maximum number of turns.
const TURNS: [u32; 2] = [4, 16];
/// Edge of the image for time measurements, and the minimum edge, normal and quick.
const PILOT_SIZE: u32 = 64;
const MIN_SIZE: [u32; 2] = [64, 32];
/// Index of `ocv`, progressive.
const BEST: usize = 2;

/// Names and methods; the first is the baseline.
fn methods() -> Vec<(&'static str, Method)> {
    // The box has one light, so the light sampler has no effect
    let of = |m: Method| m.stratified().of(Transport::Cached);
    vec![
        ("mis, balance heuristic", of(Method::mis(SAMPLES).weighted(Heuristic::Balance))),
        ("mis, power heuristic", of(Method::mis(SAMPLES).weighted(Heuristic::Power))),
        ("ocv, progressive", of(Method::ocv(OcvForm::Progressive, SAMPLES))),
        ("ocv, paper", of(Method::ocv(OcvForm::Paper, SAMPLES))),
    ]
}

/// All measurements.
struct Outcome {
    size: [u32; 2],
    names: Vec<&'static str>,
    measured: Vec<Measured>,
    truth: Truth,
    errors: Vec<Errors>,
}

/// Measures within about `time`.
pub(super) fn run(setup: &Setup<'_>, time: Duration) -> Result<Figure, ReproduceError> {
    let start = Instant::now();
    let observer = setup.observer;
    (observer.say)("Box …");
    let path = setup.scenes.join(FILE);
    let (names, list): (Vec<_>, Vec<_>) = methods().into_iter().unzip();
    let long = Method::mis(1).stratified().of(Transport::Path);

    // Image size that fits the time
    let pilot_size = setup.size.min(PILOT_SIZE);
    let mut stage = Stage::load(&path, scaled(SHAPE, pilot_size), setup.options.threads)?;
    let pilot = turns(&mut stage, &[list[BEST], long], View::Centres, SPP, 0..2, observer)?;
    let [turn, ray] =
        [0, 1].map(|i| pilot[i].median_seconds(|s| s.wall) * [list.len() as f64, 1.0 / f64::from(SPP)][i]);
    let reference = ray * f64::from(LONG.0 * LONG.1);
    let wanted = 1.2 * (turn * f64::from(2 * TURNS[0]) + reference);
    let fits = (time.saturating_sub(start.elapsed()).as_secs_f64() / wanted).sqrt();
    let size =
        ((f64::from(pilot_size) * fits) as u32 / 8 * 8).max(MIN_SIZE[usize::from(setup.options.quick)]).min(setup.size);
    let grown = (f64::from(size) / f64::from(pilot_size)).powi(2);
    stage = Stage::load(&path, scaled(SHAPE, size), setup.options.threads)?;

    // Number of turns that fits the time
    let left = time.saturating_sub(start.elapsed()).as_secs_f64() / (1.2 * grown) - reference;
    let count = ((left / turn) as u32).clamp(TURNS[0], if setup.options.quick { TURNS[0] } else { TURNS[1] });
    let size = stage.size();
    (observer.say)(&format!("  {} × {} pixels, {count} turns of {} methods", size[0], size[1], list.len()));
    let range = LONG_TURNS..LONG_TURNS + LONG.1;
    let truth = Truth::new(&turns(&mut stage, &[long], View::Centres, LONG.0, range, observer)?[0]);
    let measured = turns(&mut stage, &list, View::Centres, SPP, 0..count, observer)?;
    let errors = measured.iter().map(|m| truth.errors(m)).collect();
    figure(setup, &Outcome { size, names, measured, truth, errors })
}

fn figure(setup: &Setup<'_>, o: &Outcome) -> Result<Figure, ReproduceError> {
    // The table of errors relative to mis
    let pair = |i: usize| [&o.measured[i], &o.measured[0]];
    let errors = |i: usize| [&o.errors[i], &o.errors[0]];
    let systematic = o.errors[0].systematic.max(0.0).sqrt();
    let mut table = Table::new(&HEADER);
    (0..o.names.len()).for_each(|i| table.row(method_row(o.names[i], pair(i), errors(i))));

    // Text, facts and images
    let mut blocks = description(o, systematic);
    blocks.push(Block::Images(shown(setup, o)?));
    let list = [0, BEST].map(|i| (o.names[i], &o.measured[i]));
    blocks.extend(variances(setup, &o.truth, o.size, &list, "box-variance", "stratified over all rays")?);
    blocks.push(Block::Table(table));

    // The summary and the numbers
    let rows: Vec<Value> = (0..o.names.len()).map(|i| method_json(o.names[i], pair(i), errors(i))).collect();
    let reason = format!(
        "the bias of the interpolation alone is {}; without it {} → {}",
        significant(systematic),
        significant(noise(&o.errors[0])),
        significant(noise(&o.errors[BEST]))
    );
    Ok(Figure {
        id: "box",
        title: "Box, irradiance cache",
        summary: summary(&ASKED, pair(BEST), errors(BEST), reason),
        also: Vec::new(),
        blocks,
        numbers: json!({
            "size": o.size, "camera_rays": SPP, "samples": SAMPLES, "turns": o.measured[0].turns(), "methods": rows,
            "interpolation_error": systematic, "reference": { "noise": o.truth.noise() },
        }),
    })
}

/// Text and facts. `systematic` is the bias of the interpolation.
fn description(o: &Outcome, systematic: f64) -> Vec<Block> {
    vec![
        Block::Text(
            "A box by irradiance caching, as in figure 4: everything that its diffuse walls reflect is interpolated between records, \
             and the light of sources at a record is estimated by mis or by ocv."
                .to_owned(),
        ),
        Block::Facts(vec![
            (
                "image".to_owned(),
                format!("{} × {} pixels, {SPP} camera rays per pixel, {SAMPLES} samples of the source", o.size[0], o.size[1]),
            ),
            ("turns".to_owned(), format!("{} of {} methods", o.measured[0].turns(), o.names.len())),
            (
                "reference".to_owned(),
                format!(
                    "path tracing, {} renderings of {} camera rays; its noise would add an error of {}, and is subtracted",
                    LONG.1,
                    LONG.0,
                    significant(o.truth.noise())
                ),
            ),
            (
                "bias of the interpolation".to_owned(),
                format!("{}, which is in the error of every method", significant(systematic)),
            ),
        ]),
    ]
}

/// The images of `mis`, of the best form, and of the reference.
fn shown(setup: &Setup<'_>, o: &Outcome) -> Result<Vec<Shown>, ReproduceError> {
    let exposure = gain(&o.truth.radiance);
    let mut shown = Vec::new();
    for i in [0, BEST] {
        let image = Image::tone_mapped(o.size, &o.measured[i].first, exposure);
        let file = image.write(&setup.options.out, &format!("box-{i}"))?;
        shown.push(Shown { file, title: o.names[i].to_owned(), caption: String::new() });
    }
    let image = Image::tone_mapped(o.size, &o.truth.radiance, exposure);
    let file = image.write(&setup.options.out, "box-reference")?;
    shown.push(Shown { file, title: "reference, path tracing".to_owned(), caption: String::new() });
    Ok(shown)
}

/// The part of the error that varies between renderings.
fn noise(e: &Errors) -> f64 {
    (e.error().value.powi(2) - e.systematic).max(0.0).sqrt()
}

//! A room lit through a slit: the distribution of photons stored by importance, and the loss by the cut-off [Keller and
//! Wald 2000, Fig. 4].

use super::super::ReproduceError;
use super::super::figure::{Figure, Summary};
use super::super::images::{gain, significant};
use super::super::measure::{Estimate, Stage, scaled};
use super::super::page::{Block, Cell, Table};
use super::super::verdicts::hardly_perceivable;
use super::above::Area;
use super::maps::{Cloud, Maps, Print, clouds, plan, positions, prints, speed, trace};
use super::seen::{Seen, seen};
use super::setup::{SHAPE, Setup};
use lumiris::photons::{Importance, ImportanceSettings, LowImportance, PhotonBudget, Tracing, trace_importons};
use lumiris::scene::RenderJob;
use lumiris_numbers::estimators::stats::Welford;
use lumiris_numbers::math::Vec3;
use lumiris_numbers::math::luminance;
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// ε of the floor and of the cut-off.
const MIN_PROBABILITY: f32 = 0.05;
/// Number of maps of each kind, with different seeds.
const SEEDS: u32 = 4;
/// Minimum and maximum number of photons of a map: normal and quick.
const MIN_COUNT: f64 = 500.0;
const MAX_COUNT: [f64; 2] = [200_000.0, 10_000.0];
/// Photons per estimate.
const COUNT: u32 = 60;
/// Maximum number of pixels along an edge: normal and quick.
const SIZE: [u32; 2] = [240, 96];
/// Fraction of the time for photons.
const PHOTON_FRACTION: f64 = 0.7;
const IMPORTONS: u64 = 100_000;
/// Fraction of the camera rays whose importance may be below that at p = 1: a few hit the other room, or corners.
const QUANTILE: f32 = 0.1;
/// The room with the camera.
const ROOM: Area = Area { low: [-4.1, -2.1], high: [-0.11, 2.1] };

/// A storage rule of photons, and its results.
struct Row {
    name: &'static str,
    id: &'static str,
    /// The map of the first seed, and its image.
    maps: Maps,
    image: Vec<[f32; 3]>,
    in_room: u64,
    /// Mean luminance of the image over seeds.
    mean: Estimate,
}

/// Measures within about `time`.
pub(super) fn run(setup: &Setup<'_>, time: Duration) -> Result<Figure, ReproduceError> {
    let start = Instant::now();
    (setup.observer.say)("Slit …");
    let size = setup.size.min(SIZE[usize::from(setup.options.quick)]);
    let stage = Stage::load(&setup.scenes.join("slit.pbrt"), scaled(SHAPE, size), setup.options.threads)?;
    let (job, size) = (stage.job(), stage.size());
    // Exclude the part of the other room that is visible through the slit
    let in_this_room = |s: Seen| Some(s).filter(|s| ROOM.holds(s.p));
    let seen: Vec<Option<Seen>> = seen(&job.world).into_iter().map(|s| s.and_then(in_this_room)).collect();
    let settings =
        ImportanceSettings { paths: IMPORTONS, seed: 1, quantile: QUANTILE, ..ImportanceSettings::default() };
    let floor = ImportanceSettings { low_importance: LowImportance::Floor(MIN_PROBABILITY), ..settings };
    let cut = ImportanceSettings { low_importance: LowImportance::CutOff(MIN_PROBABILITY), ..settings };
    let importance = |s: &ImportanceSettings| setup.pool.install(|| trace_importons(job, s));
    let (floor, cut) = (importance(&floor)?, importance(&cut)?);

    // Number of photons that fits the time
    let [by_floor, _] = speed(setup, job, &Tracing::default(), Some(&floor))?;
    let [by_cut, _] = speed(setup, job, &Tracing::default(), Some(&cut))?;
    let each = f64::from(SEEDS) * (1.0 / by_floor.max(1.0) + 2.0 / by_cut.max(1.0));
    let left = time.saturating_sub(start.elapsed()).as_secs_f64() * PHOTON_FRACTION;
    let photons = (left / each).clamp(MIN_COUNT, MAX_COUNT[usize::from(setup.options.quick)]) as u64;
    (setup.observer.say)(&format!("  {} × {} pixels, {photons} photons, {SEEDS} maps of each kind", size[0], size[1]));
    let of = |name, id, importance| row(setup, job, &seen, [name, id], importance, photons);
    let rows = [
        of("standard map", "standard", None)?,
        of("by importance, p ≥ ε: unbiased", "floor", Some(&floor))?,
        of("by importance, cut off at p < ε: biased", "cut-off", Some(&cut))?,
    ];
    figure(setup, job, size, &floor, &rows)
}

fn row(
    setup: &Setup<'_>,
    job: &RenderJob,
    seen: &[Option<Seen>],
    [name, id]: [&'static str; 2],
    importance: Option<&Importance>,
    photons: u64,
) -> Result<Row, ReproduceError> {
    // Mean luminance over seeds; the maps of the first seed are kept
    let budget = PhotonBudget::Stored { global: photons, max_paths: photons.saturating_mul(2000) };
    let pixels = seen.iter().flatten().count().max(1) as f64;
    let mut means = Welford::new();
    let mut first = None;
    for seed in 1..=SEEDS {
        let maps = trace(setup, job, &Tracing { seed, ..Tracing::default() }, importance, budget)?;
        let image = maps.image(setup, seen, COUNT);
        means.add(image.iter().map(|p| luminance(p.map(f64::from))).sum::<f64>() / pixels);
        first.get_or_insert((maps, image));
    }
    let (maps, image) = first.expect("there is a first seed");
    let mean = Estimate { value: means.mean(), error: means.standard_error() };
    let in_room = ROOM.count(&maps.positions());
    Ok(Row { name, id, maps, image, in_room, mean })
}

/// Ratio of the mean of a row to another, minus 1.
fn bias(row: &Row, base: &Row) -> Estimate {
    let value = row.mean.value / base.mean.value.max(1e-300);
    let relative = |e: Estimate| e.error / e.value.max(1e-300);
    Estimate { value: value - 1.0, error: value * relative(row.mean).hypot(relative(base.mean)) }
}

fn percent(e: Estimate) -> String {
    format!("{:+.1} ± {:.1} %", e.value * 100.0, e.error * 100.0)
}

fn figure(
    setup: &Setup<'_>,
    job: &RenderJob,
    size: [u32; 2],
    importance: &Importance,
    rows: &[Row; 3],
) -> Result<Figure, ReproduceError> {
    // Point clouds from above
    let mut blocks = vec![Block::Text(format!(
        "The room on the left has the camera and no light; the one on the right has a light. From above: importons, and about the same number \
         of photons in three maps: all that arrive, by importance with probabilities of at least ε = {MIN_PROBABILITY}, and without those whose \
         probability is below ε."
    ))];
    let cloud = |name: &str, title: &str, points: Vec<Vec3>| {
        let caption = format!("{} points, {} in the room with the camera", points.len(), ROOM.count(&points));
        Cloud { name: format!("slit-above-{name}"), title: title.to_owned(), caption, points }
    };
    let mut list = vec![cloud("importons", "importons", positions(importance.map()).collect())];
    list.extend(rows.iter().map(|r| cloud(r.id, r.name, r.maps.positions())));
    blocks.extend(clouds(setup, &plan(setup, job), &list)?);

    // The maps shown directly
    let list: Vec<Print<'_>> = (rows.iter())
        .map(|r| Print {
            name: format!("slit-{}", r.id),
            title: r.name.to_owned(),
            caption: format!("{} photons in the room", r.in_room),
            size,
            radiance: &r.image,
        })
        .collect();
    blocks.push(prints(setup, gain(&rows[1].image), &list)?);
    blocks.push(Block::Table(table(rows)));

    // The summary and the numbers
    Ok(Figure {
        id: "slit",
        title: "Figure 4: a room that is lit through a slit",
        summary: summary(rows),
        also: vec![("the form without bias", unbiased_summary(rows))],
        blocks,
        numbers: json!({
            "size": size, "epsilon": MIN_PROBABILITY, "seeds": SEEDS, "nearest": COUNT,
            "maps": rows.iter().map(|r| row_json(r, &rows[1])).collect::<Vec<Value>>(),
        }),
    })
}

/// Fraction of a map's photons in the visible room, for the standard map, with ε, and with the cut-off.
fn fractions(rows: &[Row; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| rows[i].in_room as f64 / rows[i].maps.stored().max(1) as f64)
}

fn summary(rows: &[Row; 3]) -> Summary {
    let loss = bias(&rows[2], &rows[1]);
    let [standard, floor, cut] = fractions(rows);
    Summary {
        paper: "photons “only where they are important”, “hardly perceivable” bias".to_owned(),
        target: "more photons in the visible room with each form; bias of the cut-off form below 2 %".to_owned(),
        measured: format!(
            "in the visible room {:.1} % → {:.1} % (ε) and {:.1} % (cut-off) of the photons; mean of the cut-off form {}",
            standard * 100.0,
            floor * 100.0,
            cut * 100.0,
            percent(loss)
        ),
        reached: floor > standard && cut > floor && hardly_perceivable(loss),
        reason: format!("{} photon paths for as many photons as {}", rows[2].maps.paths, rows[0].maps.paths),
    }
}

fn unbiased_summary(rows: &[Row; 3]) -> Summary {
    let [standard, floor, _] = fractions(rows);
    Summary {
        paper: "photons “only where they are important”".to_owned(),
        target: "more photons in the visible room".to_owned(),
        measured: format!("{:.1} % → {:.1} % of the photons", standard * 100.0, floor * 100.0),
        reached: floor > standard,
        reason: format!("mean of the standard map against it {}", percent(bias(&rows[0], &rows[1]))),
    }
}

fn table(rows: &[Row; 3]) -> Table {
    let header =
        ["map", "photons", "in the visible room", "photon_paths", "s", "mean luminance", "against the unbiased map"];
    let mut table = Table::new(&header);
    for r in rows {
        let cells = [
            r.maps.stored().to_string(),
            r.in_room.to_string(),
            r.maps.paths.to_string(),
            significant(r.maps.seconds),
            format!("{} ± {}", significant(r.mean.value), significant(r.mean.error)),
            percent(bias(r, &rows[1])),
        ];
        table.row(std::iter::once(Cell::text(r.name)).chain(cells.map(Cell::number)));
    }
    table
}

fn row_json(r: &Row, unbiased: &Row) -> Value {
    let b = bias(r, unbiased);
    json!({
        "name": r.id, "photons": r.maps.stored(), "photons_in_room": r.in_room, "photon_paths": r.maps.paths,
        "seconds": r.maps.seconds, "mean": r.mean, "bias": { "value": b.value, "standard_error": b.error },
    })
}

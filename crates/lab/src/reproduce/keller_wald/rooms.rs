//! The visible room among a hundred, with and without importance [Keller and Wald 2000, Figs. 1 and 2].

use super::super::ReproduceError;
use super::super::chart::Chart;
use super::super::figure::{Figure, Summary};
use super::super::images::{gain, significant};
use super::super::measure::{Stage, scaled};
use super::super::page::{Block, Cell, Table};
use super::above::Area;
use super::maps::{Cloud, Maps, Print, clouds, path_traced, plan, positions, prints, speed, trace};
use super::seen::{Reference, Seen, seen};
use super::setup::{SHAPE, Setup};
use crate::procedural::keller_wald::rooms::{Building, PITCH};
use lumiris::photons::{Importance, ImportanceSettings, PhotonBudget, Tracing, trace_importons};
use lumiris::scene::RenderJob;
use lumiris_numbers::math::Vec3;
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// Ratio of the photons of the larger maps to the smaller ones.
const LARGER: u64 = 8;
/// Minimum and maximum number of photons of the smaller maps: normal and quick. The report has 6·10⁵.
const MIN_COUNT: f64 = 2_000.0;
const MAX_COUNT: [f64; 2] = [600_000.0, 20_000.0];
/// Photons per estimate: each map is visualised with the number of least error.
const COUNTS: [u32; 4] = [20, 60, 200, 600];
/// Maximum number of pixels along an edge: normal and quick.
const SIZE: [u32; 2] = [240, 96];
/// Fractions of the time for the reference, and for the photons of the maps.
const REFERENCE_FRACTION: f64 = 0.4;
const PHOTON_FRACTION: f64 = 0.35;
/// Importon paths.
const IMPORTONS: u64 = 100_000;

/// A map, and its errors.
struct Row {
    name: &'static str,
    importance: bool,
    maps: Maps,
    /// Error for each of [`COUNTS`].
    errors: Vec<f64>,
    best: usize,
    bias: f64,
    image: Vec<[f32; 3]>,
    in_room: u64,
}

/// Reference data for the maps.
struct Judge<'a> {
    setup: &'a Setup<'a>,
    job: &'a RenderJob,
    seen: &'a [Option<Seen>],
    mask: &'a [bool],
    reference: &'a Reference,
    room: Area,
}

/// The room with the camera.
fn room() -> Area {
    let low = Building::default().seen().map(|r| PITCH * r as f32);
    Area { low, high: low.map(|v| v + PITCH) }
}

impl Judge<'_> {
    fn row(&self, name: &'static str, importance: Option<&Importance>, photons: u64) -> Result<Row, ReproduceError> {
        let tracing = Tracing { seed: 1, ..Tracing::default() };
        let budget = PhotonBudget::Stored { global: photons, max_paths: photons.saturating_mul(2000) };
        let maps = trace(self.setup, self.job, &tracing, importance, budget)?;
        let images = COUNTS.map(|count| maps.image(self.setup, self.seen, count));
        let errors: Vec<f64> = images.iter().map(|p| self.reference.rmse(p, self.mask)).collect();
        let best = (0..errors.len()).min_by(|&a, &b| errors[a].total_cmp(&errors[b])).unwrap_or(0);
        let image = images.into_iter().nth(best).unwrap_or_default();
        let in_room = self.room.count(&maps.positions());
        let bias = self.reference.bias(&image, self.mask);
        Ok(Row { name, importance: importance.is_some(), maps, errors, best, bias, image, in_room })
    }
}

impl Row {
    fn error(&self) -> f64 {
        self.errors[self.best]
    }
}

/// Measures within about `time`.
pub(super) fn run(setup: &Setup<'_>, time: Duration) -> Result<Figure, ReproduceError> {
    let start = Instant::now();
    (setup.observer.say)("Rooms …");
    let size = setup.size.min(SIZE[usize::from(setup.options.quick)]);
    let mut stage = Stage::load(&setup.scenes.join("rooms.pbrt"), scaled(SHAPE, size), setup.options.threads)?;
    let reference = path_traced(setup, &mut stage, time.mul_f64(REFERENCE_FRACTION))?;
    let (job, size) = (stage.job(), stage.size());
    let seen = seen(&job.world);
    let mask: Vec<bool> = seen.iter().map(Option::is_some).collect();
    let settings = ImportanceSettings { paths: IMPORTONS, seed: 1, ..ImportanceSettings::default() };
    let importance = setup.pool.install(|| trace_importons(job, &settings))?;

    // Number of photons that fits the time
    let tracing = Tracing { seed: 2, ..Tracing::default() };
    let [stored, _] = speed(setup, job, &tracing, Some(&importance))?;
    let left = time.saturating_sub(start.elapsed()).as_secs_f64() * PHOTON_FRACTION / (1.0 - REFERENCE_FRACTION);
    let photons =
        (left * stored / (1 + LARGER) as f64).clamp(MIN_COUNT, MAX_COUNT[usize::from(setup.options.quick)]) as u64;
    (setup.observer.say)(&format!("  {} × {} pixels, {photons} photons and {LARGER} times as many", size[0], size[1]));
    let judge = Judge { setup, job, seen: &seen, mask: &mask, reference: &reference, room: room() };
    let rows = [
        judge.row("standard", None, photons)?,
        judge.row("by importance", Some(&importance), photons)?,
        judge.row("standard, 8 times the photons", None, photons * LARGER)?,
        judge.row("by importance, 8 times the photons", Some(&importance), photons * LARGER)?,
    ];
    figure(&judge, size, &importance, &rows)
}

fn figure(
    judge: &Judge<'_>,
    size: [u32; 2],
    importance: &Importance,
    rows: &[Row; 4],
) -> Result<Figure, ReproduceError> {
    let setup = judge.setup;
    // Figure 1: point clouds from above
    let mut blocks = vec![Block::Text(
        "Figure 1: photons of a building of 10 × 10 rooms with one light each, from above. The standard map, importons, and about as many \
         photons as in the standard map, deposited by importance; the camera stands in one room and sees a part of the next."
            .to_owned(),
    )];
    let cloud = |name: &str, title: &str, points: Vec<Vec3>| {
        let caption = format!("{} points, {} in the room with the camera", points.len(), judge.room.count(&points));
        Cloud { name: format!("rooms-above-{name}"), title: title.to_owned(), caption, points }
    };
    let list = [
        cloud("standard", "standard map", rows[0].maps.positions()),
        cloud("importons", "importons", positions(importance.map()).collect()),
        cloud("importance", "map by importance", rows[1].maps.positions()),
    ];
    blocks.extend(clouds(setup, &plan(setup, judge.job), &list)?);

    // Figure 2: the maps shown directly
    blocks.push(Block::Text(
        "Figure 2: the maps shown directly, each with the number of nearest photons k that serves it best. Rows have the same number of photons."
            .to_owned(),
    ));
    blocks.push(maps_shown(judge, size, rows)?);
    blocks.push(Block::Table(table(rows)));

    // The error by the number of nearest photons
    let mut chart = Chart::new("photons of an estimate, k", "relative error");
    for r in rows {
        chart = chart.with(r.name, COUNTS.iter().zip(&r.errors).map(|(&k, &e)| [f64::from(k), e]).collect());
    }
    blocks.push(Block::Chart(chart));

    // The summary and the numbers
    let json: Vec<Value> = rows.iter().map(row_json).collect();
    Ok(Figure {
        id: "rooms",
        title: "Figures 1 and 2: a room among a hundred",
        summary: summary(rows),
        also: Vec::new(),
        blocks,
        numbers: json!({
            "size": size, "importons": importance.map().len(), "maps": json,
            "least_probability_scale": importance.scale(), "pixels": judge.mask.iter().filter(|m| **m).count(),
        }),
    })
}

/// The images of all maps, and the reference.
fn maps_shown(judge: &Judge<'_>, size: [u32; 2], rows: &[Row; 4]) -> Result<Block, ReproduceError> {
    // A print for each map
    let exposure = gain(&judge.reference.radiance);
    let mut list: Vec<Print<'_>> = (rows.iter().enumerate())
        .map(|(i, r)| Print {
            name: format!("rooms-{i}"),
            title: r.name.to_owned(),
            caption: format!(
                "{} photons; error {} with k = {}",
                r.maps.stored(),
                significant(r.error()),
                COUNTS[r.best]
            ),
            size,
            radiance: &r.image,
        })
        .collect();

    // The reference
    list.push(Print {
        name: "rooms-reference".to_owned(),
        title: "path tracing".to_owned(),
        caption: "the reference".to_owned(),
        size,
        radiance: &judge.reference.radiance,
    });
    prints(judge.setup, exposure, &list)
}

fn summary(rows: &[Row; 4]) -> Summary {
    // Error ratios at equal numbers of photons
    let factor = |i: usize| rows[i].error() / rows[i + 1].error().max(1e-300);
    let same_with_an_eighth = rows[1].error() <= rows[2].error();
    Summary {
        paper: "“much better photon distribution … at the same memory cost”".to_owned(),
        target: "error ≥ 3× lower at equal memory, or the same in ≤ 1/8 of the memory".to_owned(),
        measured: format!(
            "{}× and {}× lower with the same number of photons; {} with 1/{LARGER} of the photons, against {}",
            significant(factor(0)),
            significant(factor(2)),
            significant(rows[1].error()),
            significant(rows[2].error())
        ),
        reached: factor(0) >= 3.0 || same_with_an_eighth,
        reason: format!(
            "{} against {} photons in the room, for {}× the photon paths",
            rows[1].in_room,
            rows[0].in_room,
            significant(rows[1].maps.paths as f64 / rows[0].maps.paths.max(1) as f64)
        ),
    }
}

fn table(rows: &[Row; 4]) -> Table {
    let header = ["map", "photons", "MB", "in the room", "photon_paths", "10⁶ photons/s", "s", "k", "error", "mean"];
    let mut table = Table::new(&header);
    for r in rows {
        let cells = [
            r.maps.stored().to_string(),
            format!("{:.1}", r.maps.bytes() as f64 / 1e6),
            r.in_room.to_string(),
            r.maps.paths.to_string(),
            significant(r.maps.rate / 1e6),
            significant(r.maps.seconds),
            COUNTS[r.best].to_string(),
            significant(r.error()),
            format!("{:+.1} %", r.bias * 100.0),
        ];
        table.row(std::iter::once(Cell::text(r.name)).chain(cells.map(Cell::number)));
    }
    table
}

fn row_json(r: &Row) -> Value {
    json!({
        "name": r.name, "importance": r.importance, "photons": r.maps.stored(), "bytes": r.maps.bytes(),
        "photons_in_room": r.in_room, "photon_paths": r.maps.paths, "arrivals_per_second": r.maps.rate,
        "seconds": r.maps.seconds, "nearest": COUNTS, "errors": r.errors, "error": r.error(), "bias": r.bias,
    })
}

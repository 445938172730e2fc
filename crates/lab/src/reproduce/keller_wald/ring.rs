//! The caustic of a ring for three ratios q of global to caustic paths [Keller and Wald 2000, Fig. 3].

use super::super::ReproduceError;
use super::super::figure::{Figure, Summary};
use super::super::images::{crop, gain, significant};
use super::super::measure::{Stage, scaled};
use super::super::page::{Block, Cell, Table};
use super::maps::{Maps, Print, prints, show, speed, trace};
use super::seen::{Seen, relative_rmse, seen};
use super::setup::{SHAPE, Setup};
use lumiris::photons::{PhotonBudget, Tracing};
use lumiris::scene::RenderJob;
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// The ratios, as their reciprocals.
const RATIOS: [u64; 3] = [1, 5, 20];
/// Ratio of the reference's photon paths to the finest map's, and of the photons of its estimates.
const LONGER: u64 = 8;
const REFERENCE_COUNT: u32 = 120;
/// Photons of an estimate.
const COUNT: u32 = 50;
/// Minimum and maximum number of photon paths of the global map: normal and quick.
const MIN_COUNT: f64 = 1_000.0;
const MAX_COUNT: [f64; 2] = [400_000.0, 10_000.0];
/// Maximum number of pixels along an edge: normal and quick.
const SIZE: [u32; 2] = [320, 96];
/// The part of the image for the enlarged view.
const PART: [f64; 4] = [0.24, 0.3, 0.66, 0.72];
/// Fraction of the time for photons.
const PHOTON_FRACTION: f64 = 0.7;

/// A ratio with its maps.
struct Row {
    q: u64,
    maps: Maps,
    /// Radiance of caustics, and total radiance.
    caustic: Vec<[f32; 3]>,
    all: Vec<[f32; 3]>,
    error: f64,
}

/// One of the two scenes.
struct Scene {
    file: &'static str,
    name: &'static str,
    id: &'static str,
}

const SCENES: [Scene; 2] = [
    Scene { file: "ring.pbrt", name: "lit by a lamp", id: "ring" },
    Scene { file: "ring-indirect.pbrt", name: "lit by a bright patch of a wall", id: "ring-indirect" },
];

/// Measurements of one scene.
struct Outcome {
    scene: &'static Scene,
    size: [u32; 2],
    rows: Vec<Row>,
    reference: Vec<[f32; 3]>,
}

/// Measures both scenes within about `time`.
pub(super) fn run(setup: &Setup<'_>, time: Duration) -> Result<Figure, ReproduceError> {
    (setup.observer.say)("Ring …");
    let outcomes = [measure(setup, &SCENES[0], time.mul_f64(0.5))?, measure(setup, &SCENES[1], time.mul_f64(0.5))?];
    figure(setup, &outcomes)
}

fn measure(setup: &Setup<'_>, scene: &'static Scene, time: Duration) -> Result<Outcome, ReproduceError> {
    let start = Instant::now();
    let size = setup.size.min(SIZE[usize::from(setup.options.quick)]);
    let stage = Stage::load(&setup.scenes.join(scene.file), scaled(SHAPE, size), setup.options.threads)?;
    let (job, size) = (stage.job(), stage.size());
    let seen = seen(&job.world);
    let [_, paths] = speed(setup, job, &Tracing::default(), None)?;
    let finest = RATIOS[RATIOS.len() - 1];
    let all = finest * LONGER + RATIOS.iter().sum::<u64>();
    let left = time.saturating_sub(start.elapsed()).as_secs_f64() * PHOTON_FRACTION;
    let count = (left * paths / all as f64).clamp(MIN_COUNT, MAX_COUNT[usize::from(setup.options.quick)]) as u64;
    (setup.observer.say)(&format!("  {}, {} × {} pixels, {count} photon paths", scene.name, size[0], size[1]));

    // The global map of the reference is negligible
    let long = trace_ratio(setup, job, 2, finest * LONGER, count)?;
    let reference = show(setup, &seen, &[&long.caustic], REFERENCE_COUNT);
    let mask: Vec<bool> = seen.iter().map(Option::is_some).collect();
    let mut rows = Vec::new();
    for q in RATIOS {
        rows.push(row(setup, &seen, q, trace_ratio(setup, job, 1, q, count)?, |caustic| {
            relative_rmse(caustic, &reference, &mask)
        }));
    }
    Ok(Outcome { scene, size, rows, reference })
}

/// Maps for q = 1/`finer`, whose global map has `count` photon paths.
fn trace_ratio(setup: &Setup<'_>, job: &RenderJob, seed: u32, finer: u64, count: u64) -> Result<Maps, ReproduceError> {
    let tracing = Tracing { seed, q: (1.0 / finer as f64) as f32, ..Tracing::default() };
    trace(setup, job, &tracing, None, PhotonBudget::Paths(count * finer))
}

fn row(setup: &Setup<'_>, seen: &[Option<Seen>], q: u64, maps: Maps, error: impl Fn(&[[f32; 3]]) -> f64) -> Row {
    let caustic = show(setup, seen, &[&maps.caustic], COUNT);
    let all = maps.image(setup, seen, COUNT);
    Row { q, error: error(&caustic), maps, caustic, all }
}

fn figure(setup: &Setup<'_>, outcomes: &[Outcome; 2]) -> Result<Figure, ReproduceError> {
    // A text, then images and a table for each scene
    let mut blocks = vec![Block::Text(format!(
        "A polished ring on a table: both maps shown directly, and below them the caustic map alone, a part of the image, beside that of \
         {LONGER} times the photon paths of the finest. Only the first ⌊qN⌋ of N photon paths fill the global map, so that the caustic map \
         becomes finer while the global map stays as it is. In the second scene nothing but a bright patch of the wall lights the ring; nobody \
         has to say that it does."
    ))];
    for o in outcomes {
        // Both maps shown directly
        let exposure = gain(&o.rows[o.rows.len() - 1].all);
        let caption = |r: &Row| {
            format!("{} photons in the global map, {} in the caustic map", r.maps.global.len(), r.maps.caustic.len())
        };
        let whole: Vec<Print<'_>> = (o.rows.iter())
            .map(|r| Print {
                name: format!("{}-{}", o.scene.id, r.q),
                title: format!("q = 1/{}, {}", r.q, o.scene.name),
                caption: caption(r),
                size: o.size,
                radiance: &r.all,
            })
            .collect();
        blocks.push(prints(setup, exposure, &whole)?);

        // The caustic map, enlarged, and its reference
        let parts: Vec<_> = (o.rows.iter())
            .map(|r| (format!("{}", r.q), format!("caustic, q = 1/{}", r.q), &r.caustic))
            .chain([("reference".to_owned(), "caustic, reference".to_owned(), &o.reference)])
            .map(|(name, title, image)| {
                let (size, part) = crop(o.size, image, PART);
                (name, title, size, part)
            })
            .collect();
        let close: Vec<Print<'_>> = (parts.iter())
            .map(|(name, title, size, part)| Print {
                name: format!("{}-part-{name}", o.scene.id),
                title: title.clone(),
                caption: String::new(),
                size: *size,
                radiance: part,
            })
            .collect();
        blocks.push(prints(setup, gain(&parts[parts.len() - 1].3), &close)?);
        blocks.push(Block::Table(table(o)));
    }
    let numbers: Vec<Value> = outcomes.iter().map(outcome_json).collect();
    Ok(Figure {
        id: "ring",
        title: "Figure 3: caustics of a ring",
        summary: summary(&outcomes[0]),
        also: vec![("lit indirectly", summary(&outcomes[1]))],
        blocks,
        numbers: json!({ "nearest": COUNT, "scenes": numbers }),
    })
}

/// The maximum change of the number of global photons, relative to the first row.
fn global_change(o: &Outcome) -> f64 {
    let first = o.rows[0].maps.global.len().max(1) as f64;
    o.rows.iter().map(|r| (r.maps.global.len() as f64 / first - 1.0).abs()).fold(0.0, f64::max)
}

fn summary(o: &Outcome) -> Summary {
    let errors: Vec<String> = o.rows.iter().map(|r| significant(r.error)).collect();
    let falls = o.rows.windows(2).all(|pair| pair[1].error < pair[0].error);
    Summary {
        paper: "finer caustics; “the amount of photons in the global photon map remains about unchanged”".to_owned(),
        target: "the error of caustics falls, global photons change by less than 2 %".to_owned(),
        measured: format!("error {}; global photons ±{:.2} %", errors.join(" → "), global_change(o) * 100.0),
        reached: falls && global_change(o) < 0.02,
        reason: format!(
            "{} → {} photons in the caustic map",
            o.rows[0].maps.caustic.len(),
            o.rows[o.rows.len() - 1].maps.caustic.len()
        ),
    }
}

fn table(o: &Outcome) -> Table {
    let mut table =
        Table::new(&["q", "photon_paths", "global photons", "caustic photons", "MB", "s", "error of the caustic"]);
    for r in &o.rows {
        let cells = [
            r.maps.paths.to_string(),
            r.maps.global.len().to_string(),
            r.maps.caustic.len().to_string(),
            format!("{:.1}", r.maps.bytes() as f64 / 1e6),
            significant(r.maps.seconds),
            significant(r.error),
        ];
        table.row(std::iter::once(Cell::text(format!("1/{}", r.q))).chain(cells.map(Cell::number)));
    }
    table
}

fn outcome_json(o: &Outcome) -> Value {
    let row = |r: &Row| {
        json!({
            "q": 1.0 / r.q as f64, "photon_paths": r.maps.paths, "global_photons": r.maps.global.len(),
            "caustic_photons": r.maps.caustic.len(), "bytes": r.maps.bytes(), "seconds": r.maps.seconds,
            "arrivals_per_second": r.maps.rate, "error": r.error,
        })
    };
    json!({ "scene": o.scene.id, "size": o.size, "maps": o.rows.iter().map(row).collect::<Vec<_>>() })
}

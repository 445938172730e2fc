//! Converts measurements to sections of the page and to JSON.

use super::super::ReproduceError;
use super::super::chart::Chart;
use super::super::figure::{Figure, Summary, estimate_json, percent, plus_minus};
use super::super::images::{HEAT, Image, Scale, crop, gain, significant};
use super::super::measure::{Estimate, Measured};
use super::super::page::{Block, Cell, Shown, Table};
use super::super::verdicts::reduced_by;
use super::cases::{Case, LONG, SHOWN, SHOWN_WAYS};
use super::outcome::Outcome;
use super::roster::{FULL_WAYS, Role, WAYS};
use super::setup::Setup;
use super::truth::{CANDELAS, Errors, Interval, Truth};
use serde_json::{Value, json};

/// A relative bias in percent with its confidence interval.
pub(super) fn bias_text(b: Interval) -> String {
    format!("{:+.3} ± {:.3} %", b.value * 100.0, b.half * 100.0)
}

/// Time relative to a baseline, as a percentage more or less.
pub(super) fn more_time(ratio: f64) -> String {
    format!("{:+.1} %", (ratio - 1.0) * 100.0)
}

/// All numbers of a method, relative to a baseline.
pub(super) fn method_json(name: &str, [m, base]: [&Measured; 2], [e, base_errors]: [&Errors; 2]) -> Value {
    let time = m.time_ratio(base);
    json!({
        "name": name, "estimator": <&str>::from(m.method.estimator), "samples": m.method.samples,
        "proposals": m.method.proposals, "points": m.method.points.name(), "light_sampler": <&str>::from(m.method.light_sampler),
        "turns": m.turns(),
        "error": estimate_json(e.error()), "relative_error": estimate_json(e.relative(base_errors)),
        "time_ratio": time, "efficiency": estimate_json(e.efficiency(base_errors, time)),
        "bias": { "value": e.bias.value, "half_width_95": e.bias.half }, "systematic_square": e.systematic,
        "seconds": m.seconds, "segments": m.segments, "invalid_samples": m.invalid,
    })
}

/// The row of a method in a table whose header is [`HEADER`].
pub(super) fn method_row(name: &str, [m, base]: [&Measured; 2], [e, base_errors]: [&Errors; 2]) -> Vec<Cell> {
    let time = m.time_ratio(base);
    vec![
        Cell::text(name),
        Cell::number(m.method.samples.to_string()),
        Cell::number(plus_minus(e.error())),
        Cell::number(percent(e.relative(base_errors))),
        Cell::number(more_time(time)),
        Cell::number(plus_minus(e.efficiency(base_errors, time))),
        Cell::number(bias_text(e.bias)),
    ]
}

/// Columns of the tables of methods.
pub(super) const HEADER: [&str; 7] = ["method", "N", "error", "against mis", "time", "efficiency", "bias of the mean"];

/// A target.
pub(super) struct Asked {
    /// Errors of mis and of ocv in the paper.
    pub paper: [f64; 2],
    /// Ratio of the time of ocv to mis in the paper.
    pub time: f64,
    /// Target reduction of the error (percent).
    pub target: f64,
    /// True if the efficiency counts as well.
    pub efficient: bool,
}

/// The row of the table at the top.
pub(super) fn summary(
    asked: &Asked,
    [m, base]: [&Measured; 2],
    [e, base_errors]: [&Errors; 2],
    reason: String,
) -> Summary {
    // The measured result against the target
    let [mis, ocv] = asked.paper;
    let (left, time) = (e.relative(base_errors), m.time_ratio(base));
    let efficiency = e.efficiency(base_errors, time);
    let mut target = format!("−{} %", asked.target);
    let mut measured = format!(
        "{} → {}: {}, {} time",
        significant(base_errors.error().value),
        significant(e.error().value),
        percent(left),
        more_time(time)
    );
    if asked.efficient {
        target += ", efficiency ≥ 1";
        measured += &format!(", efficiency {}", plus_minus(efficiency));
    }
    Summary {
        paper: format!(
            "{mis:.2} → {ocv:.2} (−{:.0} %), {:+.0} % time",
            (1.0 - ocv / mis) * 100.0,
            (asked.time - 1.0) * 100.0
        ),
        target,
        measured,
        reached: reduced_by(left, asked.target) && (!asked.efficient || efficiency.value >= 1.0),
        reason,
    }
}

/// The section of a case.
pub(super) fn direct(setup: &Setup<'_>, o: &Outcome<'_>) -> Result<Figure, ReproduceError> {
    // Facts
    let [triangles, lights] = o.facts;
    let n = o.numbers;
    let base = &o.measured[0];
    let mut blocks = vec![
        Block::Text(o.case.intro.to_owned()),
        Block::Facts(vec![
            ("scene".to_owned(), format!("{triangles} triangles, {lights} lights")),
            (
                "image".to_owned(),
                format!(
                    "{} × {} pixels, {} camera rays per pixel, {} samples at each",
                    o.size[0], o.size[1], o.case.spp, n.samples
                ),
            ),
            ("turns".to_owned(), format!("{} of {} methods", base.turns(), o.measured.len())),
            (
                "in the time of mis".to_owned(),
                format!("ocv N = {}; ris M = {}, N = {}", n.equal_time, n.ris.proposals, n.ris.samples),
            ),
            (
                "reference".to_owned(),
                format!(
                    "{} renderings of {} camera rays; its noise would add an error of {}, and is subtracted",
                    LONG.1,
                    LONG.0,
                    significant(o.truth.noise())
                ),
            ),
        ]),
    ];

    // Images, tables and the growth with camera rays
    blocks.extend(images(setup, o)?);
    blocks.extend(tables(o));
    blocks.push(growth(o));

    // A summary for each kind of sampling
    let asked =
        Asked { paper: o.case.paper, time: o.case.paper_time, target: o.case.target, efficient: o.case.efficient };
    let row =
        |way: usize| summary(&asked, o.pair(Role::Progressive, way), o.errors(Role::Progressive, way), reason(o, way));
    Ok(Figure {
        id: o.case.id,
        title: o.case.title,
        summary: row(0),
        also: (1..WAYS.len()).map(|way| (WAYS[way].name, row(way))).collect(),
        blocks,
        numbers: numbers(o),
    })
}

/// The remark beside the result of a row of the table.
fn reason(o: &Outcome<'_>, way: usize) -> String {
    // The light tree compared with uniform light selection
    if let Some(alike) = way.checked_sub(FULL_WAYS) {
        let [mis, ocv] = [Role::Balance, Role::Progressive]
            .map(|r| percent(o.errors[r.place(way)].relative(&o.errors[r.place(alike)])));
        return format!("against lights chosen alike: mis {mis}, ocv {ocv}");
    }

    // The other estimators
    let others: Vec<String> = [Role::Paper, Role::Optimal, Role::Correlated]
        .iter()
        .map(|&r| format!("{} {}", r.name(), percent(o.relative(r, way))))
        .collect();
    let mut text = others.join("; ");
    let equal = |role: Role| percent(o.relative(role, way));
    text += &format!("; in the time of mis: ocv {}, ris {}", equal(Role::EqualTime), equal(Role::Ris));

    // With antialiasing
    if let Some(shown) = SHOWN_WAYS.iter().position(|&shown| shown == way) {
        let errors = o.antialiased_errors(shown);
        text += &format!(
            "; with antialiasing {} → {} ({})",
            significant(errors[0].error().value),
            significant(errors[1].error().value),
            percent(errors[1].relative(&errors[0]))
        );
    }

    // The contribution of stratification
    if way == 1 {
        let gain = o.errors[Role::Balance.place(1)].relative(&o.errors[Role::Balance.place(2)]);
        text += &format!("; stratification alone changes the error of mis by {}", percent(gain));
    }
    text
}

fn tables(o: &Outcome<'_>) -> Vec<Block> {
    // Methods by kind of sampling
    let mut blocks = Vec::new();
    for (way, of_way) in WAYS.iter().enumerate() {
        let mut table = Table::new(&HEADER);
        for &role in of_way.roles {
            let name = if role.is_unbiased() { role.name().to_owned() } else { format!("{} (biased)", role.name()) };
            table.row(method_row(&name, o.pair(role, way), o.errors(role, way)));
        }
        let lights = if way < FULL_WAYS { ", every light as often as any other" } else { "" };
        blocks.push(Block::Note(format!("Samples {}{lights}:", of_way.name)));
        blocks.push(Block::Table(table));
    }

    // The same with antialiasing
    for (shown, &way) in SHOWN_WAYS.iter().enumerate() {
        let mut table = Table::new(&HEADER);
        let (all, errors) = (&o.antialiased[shown], o.antialiased_errors(shown));
        for (i, role) in SHOWN.iter().enumerate() {
            table.row(method_row(role.name(), [&all[i], &all[0]], [&errors[i], &errors[0]]));
        }
        blocks.push(Block::Note(format!(
            "With antialiasing, {}: camera rays all over each pixel, against an antialiased reference. The noise of edges is in \
             every row.",
            WAYS[way].name
        )));
        blocks.push(Block::Table(table));
    }
    blocks
}

fn growth(o: &Outcome<'_>) -> Block {
    let mut chart = Chart::new("camera rays per pixel", "error of ocv, progressive, over that of mis");
    for (way, curve) in WAYS.iter().zip(&o.growth.0) {
        chart = chart.with(way.name, curve.iter().map(|(rays, left)| [f64::from(*rays), left.value]).collect());
    }
    Block::Chart(chart)
}

fn images(setup: &Setup<'_>, o: &Outcome<'_>) -> Result<Vec<Block>, ReproduceError> {
    // Antialiased images and their crops, then the reference
    let (out, id) = (&setup.options.out, o.case.id);
    let exposure = gain(&o.truth.radiance);
    let (antialiased, errors) = (&o.antialiased[0], o.antialiased_errors(0));
    let (mut whole, mut crops) = (Vec::new(), Vec::new());
    for (k, role) in SHOWN.iter().enumerate() {
        let image = &antialiased[k].first;
        let file = Image::tone_mapped(o.size, image, exposure).write(out, &format!("{id}-{k}"))?;
        let caption =
            format!("N = {}; error with antialiasing {}", antialiased[k].method.samples, plus_minus(errors[k].error()));
        whole.push(Shown { file, title: role.name().to_owned(), caption });
        let (size, part) = crop(o.size, image, o.case.crop);
        let file = Image::tone_mapped(size, &part, exposure).write(out, &format!("{id}-crop-{k}"))?;
        crops.push(Shown { file, title: format!("{}, a part", role.name()), caption: String::new() });
    }
    let file =
        Image::tone_mapped(o.size, &o.antialiased_truth.radiance, exposure).write(out, &format!("{id}-reference"))?;
    whole.push(Shown { file, title: "reference".to_owned(), caption: String::new() });

    let mut blocks = vec![Block::Images(whole), Block::Images(crops)];
    // Variance images
    for (way, of_way) in WAYS.iter().enumerate().take(FULL_WAYS) {
        let chosen = [Role::Balance, Role::Progressive, Role::Correlated, Role::Ris];
        let list: Vec<(&str, &Measured)> = chosen.iter().map(|r| (r.name(), &o.measured[r.place(way)])).collect();
        blocks.extend(variances(setup, &o.truth, o.size, &list, &format!("{id}-variance-{way}"), of_way.name)?);
    }
    Ok(blocks)
}

/// Variance images of methods, weighted as in eq. (12), on one scale.
pub(super) fn variances(
    setup: &Setup<'_>,
    truth: &Truth,
    size: [u32; 2],
    list: &[(&str, &Measured)],
    file: &str,
    way: &str,
) -> Result<Vec<Block>, ReproduceError> {
    // All maps have the same scale
    let maps: Vec<Vec<f64>> = list.iter().map(|(_, m)| truth.weighted(&m.variance_map())).collect();
    let scale = Scale::of_values(HEAT, maps.iter().flatten());
    let mut shown = Vec::new();
    for (k, ((name, _), map)) in list.iter().zip(&maps).enumerate() {
        let file = Image::colored(size, map, &scale).write(&setup.options.out, &format!("{file}-{k}"))?;
        let mean = map.iter().sum::<f64>() / map.len().max(1) as f64;
        let caption = format!("samples {way}; mean {}", significant(mean));
        shown.push(Shown { file, title: format!("variance: {name}"), caption });
    }
    let title = "variance of the pixel over tvi², in the unit of eq. (12)".to_owned();
    Ok(vec![Block::Images(shown), Block::Legend { title, scale }])
}

fn numbers(o: &Outcome<'_>) -> Value {
    // Methods, with pixel centres and with antialiasing
    let all: Vec<Value> = (WAYS.iter().enumerate())
        .flat_map(|(way, of_way)| of_way.roles.iter().map(move |&role| (way, role)))
        .map(|(way, role)| method_json(role.name(), o.pair(role, way), o.errors(role, way)))
        .collect();
    let antialiased: Vec<Value> = (0..SHOWN_WAYS.len())
        .flat_map(|shown| {
            let (all, errors) = (&o.antialiased[shown], o.antialiased_errors(shown));
            let row =
                |(i, role): (usize, &Role)| method_json(role.name(), [&all[i], &all[0]], [&errors[i], &errors[0]]);
            SHOWN.iter().enumerate().map(row).collect::<Vec<Value>>()
        })
        .collect();

    // Curves of the relative error over the number of camera rays
    let curve = |way: usize| -> Vec<Value> {
        let point =
            |(rays, left): &(u32, Estimate)| json!({ "camera_rays": rays, "relative_error": estimate_json(*left) });
        o.growth.0[way].iter().map(point).collect()
    };
    let Case { spp, samples, paper, paper_time, target, .. } = o.case;
    json!({
        "size": o.size, "camera_rays": spp, "samples": samples, "turns": o.measured[0].turns(), "candelas": CANDELAS,
        "paper": { "mis": paper[0], "ocv": paper[1], "time_ratio": paper_time }, "target_percent": target,
        "equal_time": { "ocv_samples": o.numbers.equal_time, "ris_samples": o.numbers.ris.samples,
            "ris_proposals": o.numbers.ris.proposals },
        "reference": { "mean": estimate_json(o.truth.mean), "noise": o.truth.noise() },
        "methods": all, "antialiased": antialiased,
        "growth": { WAYS[0].name: curve(0), WAYS[1].name: curve(1), WAYS[2].name: curve(2) },
    })
}

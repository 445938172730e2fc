//! `lumiris compare`

use super::progress;
use crate::compare::{check_page, write_page};
use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use lumiris::imaging::TextEntries;
use lumiris::imaging::compare::columns::{column, shown_columns};
use lumiris::imaging::compare::{COLUMNS, Column, Compared, ImageSet, Metric, Scores, Settings, Shown, compare, load};
use lumiris::imaging::metrics::bias::Z_95;
use lumiris_formats::output::{check_writable, write_text};
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// `lumiris compare`
#[derive(Args, Clone, Debug)]
pub(super) struct CompareArgs {
    /// Images: EXR, HDR, PFM, PNG, or anything that OpenImageIO reads
    #[arg(required = true, value_name = "IMAGE")]
    images: Vec<PathBuf>,
    /// Reference image
    #[arg(short, long, value_name = "IMAGE")]
    reference: PathBuf,
    /// Metrics to compute [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    metrics: Vec<MetricArg>,
    /// Channels to compare instead of the colour: a layer (`albedo`), a part, or a channel (`depth.Z`)
    #[arg(long, value_name = "NAME")]
    layer: Option<String>,
    /// Exposure of the display, for `flip` and initially in the page
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_hyphen_values = true)]
    exposure: f32,
    /// ε of `relmse`: mean of (x − r)² / (r² + ε)
    #[arg(long, value_name = "E", default_value_t = 0.01, value_parser = not_negative)]
    epsilon: f64,
    /// Peak value, for `psnr`
    #[arg(long, value_name = "V", default_value_t = 1.0, value_parser = positive)]
    peak: f64,
    /// Luminance (cd/m²) of a pixel of value 1, for `tvi`
    #[arg(long, value_name = "CD/M2", default_value_t = 1.0, value_parser = positive)]
    luminance: f64,
    /// Pixels per degree of the visual field, for `flip` and `hdrflip`
    #[arg(long, value_name = "N", default_value_t = 67.0, value_parser = pixels_per_degree)]
    ppd: f64,
    /// Write an HTML page with the images and difference maps into this folder (index.html)
    #[arg(long, value_name = "DIR")]
    html: Option<PathBuf>,
    /// Write all numbers as JSON; `-` prints them instead of the table
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Exit with code 1 if a metric of any image is above this (in magnitude), such as `relmse=0.02`
    #[arg(long, value_name = "NUMBER=LIMIT", value_parser = limit)]
    fail_above: Vec<Limit>,
    /// Exit with code 1 if a metric of any image is below this (in magnitude), such as `psnr=30`
    #[arg(long, value_name = "NUMBER=LIMIT", value_parser = limit)]
    fail_below: Vec<Limit>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum MetricArg {
    /// Mean squared error
    Mse,
    /// Root of the mean squared error
    Rmse,
    /// Mean of squared errors over the squared reference plus ε
    Relmse,
    /// Mean squared error over the mean square of the reference
    Nmse,
    /// Peak signal-to-noise ratio
    Psnr,
    /// ꟻLIP on a display
    Flip,
    /// Maximum ꟻLIP over all exposures
    Hdrflip,
    /// Error in units of the visual threshold
    Tvi,
    /// Mean difference with its confidence interval
    Bias,
    /// Tests against the variances in the files
    Z,
}

impl MetricArg {
    fn metric(self) -> Metric {
        match self {
            MetricArg::Mse => Metric::Mse,
            MetricArg::Rmse => Metric::Rmse,
            MetricArg::Relmse => Metric::RelMse,
            MetricArg::Nmse => Metric::Nmse,
            MetricArg::Psnr => Metric::Psnr,
            MetricArg::Flip => Metric::Flip,
            MetricArg::Hdrflip => Metric::HdrFlip,
            MetricArg::Tvi => Metric::Tvi,
            MetricArg::Bias => Metric::Bias,
            MetricArg::Z => Metric::Z,
        }
    }
}

/// A metric with its threshold.
#[derive(Clone, Copy, Debug)]
struct Limit {
    column: &'static Column,
    value: f64,
}

fn number(text: &str) -> Result<f64, String> {
    text.trim().parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| format!("`{text}` is not a number"))
}

fn positive(text: &str) -> Result<f64, String> {
    number(text).and_then(|v| if v > 0.0 { Ok(v) } else { Err("must be greater than 0".to_owned()) })
}

fn not_negative(text: &str) -> Result<f64, String> {
    number(text).and_then(|v| if v >= 0.0 { Ok(v) } else { Err("must not be negative".to_owned()) })
}

/// The filters of ꟻLIP cover a fraction of a degree, which must be a few pixels to a few hundred.
fn pixels_per_degree(text: &str) -> Result<f64, String> {
    number(text).and_then(|v| if (1.0..=1000.0).contains(&v) { Ok(v) } else { Err("must be in 1..1000".to_owned()) })
}

fn limit(text: &str) -> Result<Limit, String> {
    let (name, value) = text.split_once('=').ok_or("is not of the form NUMBER=LIMIT")?;
    let names = || COLUMNS.map(|c| c.key).join(", ");
    let column = column(name.trim()).ok_or_else(|| format!("there is no number `{name}`; there are {}", names()))?;
    Ok(Limit { column, value: number(value)? })
}

pub(super) fn run(args: &CompareArgs) -> anyhow::Result<ExitCode> {
    check_files(args)?;
    let set = load(&args.images, &args.reference, args.layer.as_deref())?;
    let settings = settings(args);
    let compared = compare(&set, &settings);
    for (name, remark) in remarks(&set, &compared) {
        progress::say(&format!("{name}: {remark}"));
    }
    let failures = failures(args, &set, &compared)?;

    let report = report(args, &set, &settings, &compared, &failures);
    let text = serde_json::to_string_pretty(&report)? + "\n";
    let file = args.json.as_deref().filter(|path| *path != Path::new("-"));
    if let Some(path) = file {
        write_text(path, &text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    if let Some(folder) = &args.html {
        let page = write_page(folder, &set, &settings, &compared)
            .with_context(|| format!("cannot write the page into {}", folder.display()))?;
        progress::say(&format!("The page is in {}", page.display()));
    }
    // Written after the files, which are complete even if the standard output fails
    let is_printed = args.json.is_some() && file.is_none();
    progress::print(&if is_printed { text.trim_end().to_owned() } else { table(&set, &settings, &compared) })?;
    failures.iter().for_each(|f| progress::say(f));
    Ok(if failures.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// Refuses files that cannot be written.
fn check_files(args: &CompareArgs) -> anyhow::Result<()> {
    let json = args.json.as_deref().filter(|path| *path != Path::new("-"));
    json.map_or(Ok(()), check_writable)?;
    args.html.as_deref().map_or(Ok(()), check_page)?;
    Ok(())
}

/// The selected metrics, and the metrics of the limits.
fn settings(args: &CompareArgs) -> Settings {
    let limits = args.fail_above.iter().chain(&args.fail_below);
    let mut metrics: Vec<Metric> = args.metrics.iter().map(|m| m.metric()).collect();
    if metrics.is_empty() {
        metrics.extend(Metric::ALL);
    }
    metrics.extend(limits.filter_map(|l| l.column.metric));
    Settings {
        metrics: metrics.into_iter().collect(),
        exposure: args.exposure,
        epsilon: args.epsilon,
        peak: args.peak,
        candelas: args.luminance,
        pixels_per_degree: args.ppd as f32,
    }
}

/// Remarks on the images, each with the name of its image.
fn remarks(set: &ImageSet, compared: &[Compared]) -> TextEntries {
    // Remarks on loading
    let mut remarks = Vec::new();
    for shown in set.images.iter().chain([&set.reference]) {
        remarks.extend(shown.remarks.iter().map(|r| (shown.name.clone(), r.clone())));
    }

    // Pixels that are not finite
    let odd = compared.iter().map(|c| c.scores.differences.nonfinite);
    let reference_odd = compared.first().map_or(0, |c| c.scores.differences.reference_nonfinite);
    let names = set.images.iter().chain([&set.reference]).map(|s| &s.name);
    for (name, count) in names.zip(odd.chain([reference_odd])).filter(|(_, count)| *count > 0) {
        remarks.push((name.clone(), format!("{count} pixels are not finite and take no part")));
    }

    // Region
    let [region, display] = [set.region.size(), set.display];
    if region != display {
        let r = set.region;
        let text = format!(
            "only columns {}..{} and rows {}..{} of {}×{} are in all images, and only they are compared",
            r.x,
            r.x + r.width,
            r.y,
            r.y + r.height,
            display[0],
            display[1]
        );
        remarks.push(("region".to_owned(), text));
    }
    remarks
}

/// The violated limits as messages. Fails if the metric of a limit cannot be computed.
fn failures(args: &CompareArgs, set: &ImageSet, compared: &[Compared]) -> anyhow::Result<Vec<String>> {
    let mut failures = Vec::new();
    let above = args.fail_above.iter().map(|l| (l, "above"));
    for (limit, side) in above.chain(args.fail_below.iter().map(|l| (l, "below"))) {
        for (image, c) in set.images.iter().zip(compared) {
            let Some(value) = (limit.column.value)(&c.scores) else {
                bail!("{}: `{}` cannot be computed: the file has no variances", image.name, limit.column.key);
            };
            // The negation makes NaN fail
            let magnitude = value.abs();
            let within = if side == "above" { magnitude <= limit.value } else { magnitude >= limit.value };
            if !within {
                failures.push(format!("{}: {} = {value} is {side} {}", image.name, limit.column.key, limit.value));
            }
        }
    }
    Ok(failures)
}

/// One line per image, one aligned column per metric.
fn table(set: &ImageSet, settings: &Settings, compared: &[Compared]) -> String {
    // Cells
    let scores: Vec<&Scores> = compared.iter().map(|c| &c.scores).collect();
    let columns = shown_columns(&settings.metrics, &scores);
    let header = ["image"].into_iter().chain(columns.iter().map(|c| c.title)).map(str::to_owned);
    let mut rows: Vec<Vec<String>> = vec![header.collect()];
    for (image, s) in set.images.iter().zip(&scores) {
        let cell = |c: &&Column| (c.value)(s).map_or("–".to_owned(), c.text);
        rows.push([image.name.clone()].into_iter().chain(columns.iter().map(cell)).collect());
    }

    // Alignment: names to the left, numbers to the right
    let width = |column: usize| rows.iter().map(|r| r[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..=columns.len()).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).enumerate().map(|(i, (cell, &width))| match i {
            0 => format!("{cell:<width$}"),
            _ => format!("{cell:>width$}"),
        });
        cells.collect::<Vec<_>>().join("  ")
    };
    rows.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// All numbers as JSON. Infinite and undefined numbers are null.
fn report(
    args: &CompareArgs,
    set: &ImageSet,
    settings: &Settings,
    compared: &[Compared],
    failures: &[String],
) -> Value {
    // Entries of the images
    let image_json = |shown: &Shown| {
        json!({
            "path": shown.path.display().to_string(), "layer": shown.layer,
            "has_variance": shown.variance.is_some(),
        })
    };
    let images = set.images.iter().zip(compared).map(|(image, c)| {
        let mut entry = image_json(image);
        if let Value::Object(map) = &mut entry {
            numbers(map, settings, c);
        }
        entry
    });

    // Report
    let r = set.region;
    json!({
        "reference": image_json(&set.reference),
        "resolution": set.display,
        "region": { "x": r.x, "y": r.y, "width": r.width, "height": r.height },
        "settings": {
            "exposure": settings.exposure, "epsilon": settings.epsilon, "peak": settings.peak,
            "luminance": settings.candelas, "ppd": settings.pixels_per_degree,
            "layer": args.layer, "confidence_z": Z_95,
        },
        "images": images.collect::<Vec<_>>(),
        "failures": failures,
    })
}

fn numbers(map: &mut Map<String, Value>, settings: &Settings, compared: &Compared) {
    // Columns of the table
    let s = &compared.scores;
    for column in &COLUMNS {
        if column.metric.is_none_or(|m| settings.metrics.contains(&m)) {
            map.insert(column.key.to_owned(), json!((column.value)(s)));
        }
    }

    // Numbers beside the table
    let d = &s.differences;
    map.insert("pixels".into(), json!(d.pixels));
    map.insert("reference_nonfinite".into(), json!(d.reference_nonfinite));
    map.insert("mean".into(), json!(d.mean));
    map.insert("reference_mean".into(), json!(d.reference_mean));
    if let Some((start, stop, count)) = s.hdr_exposures {
        map.insert("hdrflip_exposures".into(), json!({ "start": start, "stop": stop, "count": count }));
    }
    if let Some(b) = s.bias {
        let half = b.channel_errors.map(|e| Z_95 * e);
        map.insert("bias_rgb".into(), json!(b.channels));
        map.insert("bias_rgb_ci95".into(), json!(half));
        map.insert("bias_error_from".into(), json!(<&str>::from(b.source)));
    }
    map.insert("variances".into(), json!(<&str>::from(compared.noise)));
    if let Some(z) = s.significance {
        map.insert("z_values".into(), json!(z.values));
        map.insert("z_certain".into(), json!(z.certain));
    }
}

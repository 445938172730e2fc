//! `lumiris bench`

use super::args::SceneArgs;
use super::bench_efficiency::{EfficiencyArgs, efficiency};
use super::progress;
use super::settings::{Setup, complete, load_job};
use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use lumiris::planning::Preparation;
use lumiris::scene::{AccelKind, RenderJob};
use lumiris_bench::frame::{FrameReport, measure_frame};
use lumiris_bench::photons::{PhotonReport, measure_photons};
use lumiris_bench::stages::{BenchSettings, RayCase, Report, measure};
use lumiris_formats::output::{check_writable, write_text};
use serde_json::json;
use std::path::PathBuf;
use std::process::ExitCode;

/// Measurements of `lumiris bench`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Subject {
    /// Proposals, and the times of all stages
    T1,
    /// Shadow segments against a bare Embree loop
    T2,
    /// First hits against a bare Embree loop
    Intersect,
    /// Photon tracing and photon maps
    Photons,
    /// A whole frame, and the share of a bare Embree loop over its rays
    Frame,
    /// All of the above
    All,
    /// Efficiency of settings: 1/(error × CPU time)
    Efficiency,
}

/// `lumiris bench`
#[derive(Args, Clone, Debug)]
pub(super) struct BenchArgs {
    /// Measurement
    #[arg(default_value = "all")]
    subject: Subject,
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    efficiency: EfficiencyArgs,
    /// Runs of the renderer and of the bare Embree loop, alternating; medians are reported
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    runs: u32,
    /// Maximum number of camera rays, in batches spread over the image
    #[arg(long, value_name = "K", default_value_t = 1 << 20, value_parser = clap::value_parser!(u32).range(1..))]
    rays: u32,
    /// Write the report as JSON
    #[arg(long, value_name = "FILE.json")]
    json: Option<PathBuf>,
}

pub(super) fn run(args: &BenchArgs) -> anyhow::Result<ExitCode> {
    // Efficiency has its own options and report
    if args.subject == Subject::Efficiency {
        efficiency(&args.scene, &args.efficiency, args.json.as_deref())?;
        return Ok(ExitCode::SUCCESS);
    }

    // Check the arguments before the scene is loaded
    if args.scene.accel != AccelKind::Embree {
        bail!("bench measures Embree; leave out --accel");
    }
    args.json.as_deref().map_or(Ok(()), check_writable)?;
    let Setup { mut job, times, given, .. } = load_job(&args.scene)?;
    complete(&args.scene, &mut job, &given, &Preparation::default(), false)?;

    // Measure
    let asked = |subject| args.subject == subject || args.subject == Subject::All;
    let settings = BenchSettings {
        intersect: asked(Subject::Intersect),
        t1: asked(Subject::T1),
        t2: asked(Subject::T2),
        runs: args.runs,
        rays: args.rays as usize,
        packet_width: args.scene.packet_width,
        tile_size: args.scene.tile_size,
    };
    let frame = || measure_frame(&job, args.scene.tile_size, args.rays as usize, args.runs);
    let frame = if asked(Subject::Frame) { Some(frame()?) } else { None };
    let photons = if asked(Subject::Photons) { photons(args, &job)? } else { None };
    let report = measure(job, &settings)?;

    // Write the JSON report
    if let Some(path) = &args.json {
        let mut value = serde_json::to_value(&report)?;
        let name = args.scene.scene.display().to_string();
        value["frame"] = serde_json::to_value(&frame)?;
        value["photons"] = serde_json::to_value(&photons)?;
        value["scene"] = json!(name);
        value["seconds"] = json!({ "load": times.load, "build": times.build });
        value["embree"] = json!(env!("LUMIRIS_EMBREE_VERSION"));
        write_text(path, &serde_json::to_string_pretty(&value)?)
            .with_context(|| format!("cannot write {}", path.display()))?;
    }

    // Print the tables
    frame.iter().try_for_each(|report| progress::print(frame_table(report).trim_end()))?;
    photons.iter().try_for_each(|report| progress::print(&photon_table(report)))?;
    if settings.intersect || settings.t1 || settings.t2 {
        progress::print(&table(&report))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn frame_table(report: &FrameReport) -> String {
    let mut text =
        format!("{} camera samples, one thread\n{:<22}{:>10}\n", report.camera_samples, "ns per camera sample", "");
    let mut line = |name: &str, value: f64| text += &format!("{name:<22}{value:>10.1}\n");
    line("all", report.ns_per_camera_sample);
    for stage in &report.stages {
        line(stage.name, stage.ns_per_camera_sample);
    }
    line("bare tracing", report.bare_trace_ns_per_camera_sample);
    text += &format!("{:<22}{:>10.3}\n", "share of bare tracing", report.tracing_share);
    text += &format!("{:<22}{:>10}{:>10}{:>10}\n", "bare rays", "each", "width", "ns/ray");
    for rays in &report.rays {
        text +=
            &format!("{:<22}{:>10.3}{:>10}{:>10.1}\n", rays.name, rays.per_camera_sample, rays.width, rays.ns_per_ray);
    }
    text
}

/// Measures photon tracing; `all` skips it for a scene without photons.
fn photons(args: &BenchArgs, job: &RenderJob) -> anyhow::Result<Option<PhotonReport>> {
    match measure_photons(job, args.scene.threads.map(|t| t as usize), args.runs) {
        Ok(report) => Ok(Some(report)),
        Err(e) if args.subject == Subject::All => {
            progress::say(&format!("photons: {e}"));
            Ok(None)
        }
        Err(e) => Err(e.into()),
    }
}

fn table(report: &Report) -> String {
    // Stages
    let mut text = format!("{} camera rays, one thread\n", report.camera_rays);
    if !report.stages.is_empty() {
        text += &format!("\n{:<22}{:>10}{:>12}{:>10}\n", "stage", "seconds", "items", "ns/item");
    }
    for stage in &report.stages {
        let each = stage.seconds * 1e9 / stage.items.max(1) as f64;
        text += &format!("{:<22}{:>10.4}{:>12}{each:>10.1}\n", stage.name, stage.seconds, stage.items);
    }

    // Rays
    if let Some([ours, bare]) = report.build_seconds {
        text += &format!("\nbuild on all cores: renderer {ours:.3} s, bare {bare:.3} s\n");
        text += "ratio: speed of the renderer relative to the bare loop, which has no curves, from medians of batches;\n\
                 whole runs: median (range) of the ratio of whole runs\n";
        text += &format!(
            "{:<22}{:>6}{:>10}{:>13}{:>13}{:>11}{:>20}\n",
            "rays", "width", "rays", "Mrays/s", "bare Mrays/s", "ratio", "whole runs"
        );
    }
    for case in report.intersect.iter().chain(&report.t2) {
        text += &line(case);
    }
    text.trim_end().to_owned()
}

fn photon_table(report: &PhotonReport) -> String {
    let mut text = format!("{} photon paths, {} photons, {} rays\n", report.paths, report.photons, report.rays);
    for (threads, seconds) in &report.tracing {
        let rate = |count: u64| count as f64 * 1e-6 / seconds.max(1e-12);
        text += &format!(
            "tracing, {threads} threads: {seconds:.3} s, {:.3} M photons/s, {:.3} M rays/s\n",
            rate(report.photons),
            rate(report.rays)
        );
    }
    text += &format!(
        "map of {} photons: {:.1} bytes each, built in {:.3} s\n",
        report.stored, report.bytes_per_photon, report.build_seconds
    );
    for (name, rate) in &report.queries {
        text += &format!("{name}: {rate:.0} queries/s on one thread\n");
    }
    text
}

fn line(case: &RayCase) -> String {
    let [min, max] = case.turn_ratio_range;
    let range = format!("{:.3} ({min:.2}-{max:.2})", case.turn_ratio);
    format!(
        "{:<22}{:>6}{:>10}{:>13.2}{:>13.2}{:>11.3}{range:>20}\n",
        case.name, case.width, case.rays, case.mrays, case.bare_mrays, case.ratio
    )
}

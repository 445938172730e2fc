//! `lumiris crosscheck`

use super::args::SceneArgs;
use super::progress;
use super::settings::{Setup, complete, load_job, render_settings};
use anyhow::{Context, bail};
use clap::Args;
use lumiris::accel::Accel;
use lumiris::accel::bvh::Bvh;
use lumiris::imaging::oiio::{self, Part};
use lumiris::planning::Preparation;
use lumiris::render::{output, render};
use lumiris::scene::{AccelKind, RenderJob, World};
use lumiris_bench::crosscheck::{EDGE_ULPS, Report, T_TOLERANCE_ULPS, crosscheck};
use lumiris_formats::output::{check_writable, write_text};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Fraction of the pixels that may differ visibly between the two images, because of rays at edges.
const MAX_DIFFERENT_PIXELS: f64 = 0.005;
/// A pixel differs visibly if it is off by more than this, relative to the larger of it and the image's mean.
const PIXEL_TOLERANCE: f64 = 0.01;
/// Allowed relative difference of the images' means.
const MEAN_TOLERANCE: f64 = 1e-3;

/// Names of the images written by `--images`.
const IMAGES: [&str; 3] = ["embree", "bvh", "difference"];

/// `lumiris crosscheck`
#[derive(Args, Clone, Debug)]
pub(super) struct CrosscheckArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Rays of each family
    #[arg(long, value_name = "K", default_value_t = 1_000_000, value_parser = clap::value_parser!(u32).range(1..))]
    rays: u32,
    /// Write the report as JSON
    #[arg(long, value_name = "FILE.json")]
    json: Option<PathBuf>,
    /// Write both images and their difference into this folder
    #[arg(long, value_name = "DIR")]
    images: Option<PathBuf>,
}

/// Differences between two images rendered with the same random numbers.
#[derive(Clone, Copy, Debug, Serialize)]
struct ImageReport {
    pixels: usize,
    identical: usize,
    different: usize,
    relative_mean_difference: f64,
}

impl ImageReport {
    fn agrees(&self) -> bool {
        self.different as f64 <= MAX_DIFFERENT_PIXELS * self.pixels as f64
            && self.relative_mean_difference.abs() <= MEAN_TOLERANCE
    }
}

pub(super) fn run(args: &CrosscheckArgs) -> anyhow::Result<ExitCode> {
    if args.scene.accel != AccelKind::Embree {
        bail!("crosscheck always compares Embree with the BVH; leave out --accel");
    }
    check_files(args)?;

    // Rays
    let Setup { mut job, given, .. } = load_job(&args.scene)?;
    complete(&args.scene, &mut job, &given, &Preparation::default(), true)?;
    let bvh: Box<dyn Accel> =
        Box::new(Bvh::new(Arc::clone(&job.world.scene.geometry), Some(Arc::clone(&job.world.scene.textures) as _)));
    let report = crosscheck(&job, &*bvh, args.rays);

    // Images
    let embree_image = image(args, &job)?;
    job.world = World::new(job.world.scene, AccelKind::Bvh, None)?;
    let bvh_image = image(args, &job)?;
    let images = compare(&embree_image, &bvh_image);
    if let Some(folder) = &args.images {
        write_images(folder, &job, &embree_image, &bvh_image)?;
    }
    if let Some(path) = &args.json {
        let text = serde_json::to_string_pretty(&serde_json::json!({ "rays": report, "images": images }))?;
        write_text(path, &text).with_context(|| format!("cannot write {}", path.display()))?;
    }

    progress::print(&table(&report))?;
    progress::print(&format!(
        "images: {} of {} pixels bit-identical, {} off by more than {} %, means differ by {:.2e}",
        images.identical,
        images.pixels,
        images.different,
        PIXEL_TOLERANCE * 100.0,
        images.relative_mean_difference
    ))?;
    let agree = report.disagreements() == 0 && images.agrees();
    progress::print(if agree { "Embree and the BVH agree" } else { "Embree and the BVH DISAGREE" })?;
    Ok(ExitCode::from(u8::from(!agree)))
}

/// Refuses files that cannot be written.
fn check_files(args: &CrosscheckArgs) -> anyhow::Result<()> {
    // The folder is created later if it does not exist
    let folder = args.images.as_ref().filter(|folder| folder.exists());
    let images = folder.into_iter().flat_map(|folder| IMAGES.map(|name| image_in(folder, name)));
    images.chain(args.json.clone()).try_for_each(|path| check_writable(&path))?;
    Ok(())
}

fn table(report: &Report) -> String {
    let mut text = format!(
        "t equal within {T_TOLERANCE_ULPS} ulp of the largest coordinate; edge: the ray passes an edge within \
         {EDGE_ULPS} ulp\n\
         {:<10}{:>12}{:>12}{:>12}{:>8}{:>12}{:>14}{:>12}\n",
        "family", "rays", "hits", "equal", "ties", "edge flips", "disagreements", "max t ulps"
    );
    for (family, t) in &report.tallies {
        let name = format!("{family:?}").to_lowercase();
        text += &format!(
            "{name:<10}{:>12}{:>12}{:>12}{:>8}{:>12}{:>14}{:>12.1}\n",
            t.rays, t.hits, t.equal, t.ties, t.edge_flips, t.disagreements, t.max_t_ulps
        );
    }
    for e in &report.examples {
        text += &format!("  {:?} o {:?} d {:?}: t {:?} against {:?}\n", e.family, e.o, e.d, e.t_a, e.t_b);
    }
    text.trim_end().to_owned()
}

/// Mean of every pixel, RGB interleaved.
fn image(args: &CrosscheckArgs, job: &RenderJob) -> anyhow::Result<Vec<f32>> {
    let settings = render_settings(&args.scene, job);
    let rendering = render(job, &settings, &AtomicBool::new(false), &|_| ())?;
    Ok(output::channels(&rendering.film, &[], None).data)
}

fn compare(a: &[f32], b: &[f32]) -> ImageReport {
    let sum = |v: &[f32]| v.iter().map(|&x| f64::from(x)).sum::<f64>();
    let mean = sum(a) / a.len().max(1) as f64;
    let (mut identical, mut different) = (0, 0);
    for (x, y) in a.chunks(3).zip(b.chunks(3)) {
        identical += usize::from(x == y);
        let off = x.iter().zip(y).any(|(&x, &y)| {
            let (x, y) = (f64::from(x), f64::from(y));
            (x - y).abs() > PIXEL_TOLERANCE * x.abs().max(y.abs()).max(mean)
        });
        different += usize::from(off);
    }
    let relative_mean_difference = if sum(a) == 0.0 { sum(b) } else { (sum(b) - sum(a)) / sum(a) };
    ImageReport { pixels: a.len() / 3, identical, different, relative_mean_difference }
}

fn image_in(folder: &Path, name: &str) -> PathBuf {
    folder.join(format!("{name}.exr"))
}

fn write_images(folder: &Path, job: &RenderJob, a: &[f32], b: &[f32]) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    let bounds = job.world.scene.film.bounds;
    let difference: Vec<f32> = a.iter().zip(b).map(|(x, y)| (x - y).abs()).collect();
    for (name, data) in IMAGES.into_iter().zip([a, b, &difference]) {
        let names = ["R", "G", "B"].map(str::to_owned).to_vec();
        let part = Part::linear(bounds.width() as usize, bounds.height() as usize, names, data.to_vec());
        oiio::write_image(&image_in(folder, name), &[part])?;
    }
    Ok(())
}

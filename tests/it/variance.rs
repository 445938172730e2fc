//! Stated variances of images, compared with the variances between many seeds.

use lumiris::film::Film;
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load, load_text};
use lumiris::planning::{Preparation, prepare};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::{Allocation, EstimatorKind, IntegratorKind, Settings};
use lumiris_numbers::samplers::SamplerKind;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use strum::IntoEnumIterator;

/// A scene, its size, and whether it has indirect light.
struct Case {
    scene: &'static str,
    size: [u32; 2],
    kind: IntegratorKind,
}

/// A smooth integrand, and one with edges.
const QUIET: [Case; 2] = [
    Case { scene: "scenes/analytic/rectangle.pbrt", size: [12, 12], kind: IntegratorKind::Direct },
    Case { scene: "scenes/analytic/half-environment.pbrt", size: [12, 12], kind: IntegratorKind::Direct },
];

/// A rendering mode.
struct Mode {
    name: &'static str,
    change: fn(&mut Settings),
}

/// Modes with a variance above or below s²/N.
const MODES: [Mode; 7] = [
    Mode { name: "mis", change: |_| () },
    Mode { name: "sobol", change: |s| s.sampling.sampler = SamplerKind::Sobol },
    Mode { name: "shared paths", change: |s| s.integrator.path_reuse = Some(4) },
    Mode { name: "adaptive, looks", change: |s| s.sampling.allocation = Allocation::Adaptive },
    Mode { name: "ocv over pixels", change: over_pixels },
    Mode { name: "light paths", change: |s| s.integrator.light_paths = Some(1.0) },
    Mode { name: "adaptive, shared, light paths", change: all_together },
];

fn over_pixels(s: &mut Settings) {
    s.integrator.estimator = EstimatorKind::Ocv;
    (s.integrator.samples, s.integrator.bsdf_fraction) = (Some(2), Some(0.5));
}

fn all_together(s: &mut Settings) {
    s.sampling.allocation = Allocation::Adaptive;
    (s.integrator.path_reuse, s.integrator.light_paths) = (Some(4), Some(1.0));
}

/// Independent paths by `mis`, the same number in each pixel, then the changes of the mode.
fn set(job: &mut RenderJob, mode: &Mode) {
    job.change(|s| {
        s.integrator.estimator = EstimatorKind::Mis;
        (s.integrator.path_reuse, s.integrator.light_paths) = (Some(1), Some(0.0));
        s.sampling.allocation = Allocation::Uniform;
        (mode.change)(s);
    });
}

/// Scenes of the table.
const SCENES: [&str; 8] = [
    "analytic/half-environment",
    "demo/gallery",
    "demo/window",
    "demo/fog",
    "demo/light-groups",
    "keller-wald/rooms",
    "keller-wald/slit",
    "talbot/spheres",
];

/// Environment variable with other scenes instead: files, separated by colons.
const OTHER_SCENES: &str = "VARIANCE_SCENES";

fn job(case: &Case, sampler: SamplerKind) -> RenderJob {
    let mut job = job_of(Path::new(env!("CARGO_MANIFEST_DIR")).join(case.scene), case.size);
    set(&mut job, &MODES[0]);
    job.change(|s| (s.integrator.kind, s.sampling.sampler) = (case.kind, sampler));
    job
}

fn job_of(path: PathBuf, size: [u32; 2]) -> RenderJob {
    let options = LoadOptions { resolution: Some(size), ..LoadOptions::default() };
    load(&path, &options).map_err(|d| d.to_string()).unwrap().job(AccelKind::Embree, None).unwrap()
}

fn film(job: &RenderJob, settings: RenderSettings) -> Film {
    render(job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film
}

/// Mean and standard error of the mean.
fn mean(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt())
}

/// Statistics of images of many seeds. Ratios are relative to the variance between seeds, summed over channels and over
/// the pixels of the image or of a block of 8 × 8.
struct Study {
    /// The stated variance.
    stated: f64,
    /// Its standard error, from both terms of the ratio.
    error: f64,
    /// The variance of independent samples.
    independent: f64,
    /// The stated variance in the median block, and its minimum and maximum over blocks.
    blocks: [f64; 3],
}

fn study(job: &mut RenderJob, spp: u32, seeds: u32) -> Study {
    let (mut means, mut stated, mut independent) = (Vec::new(), Vec::new(), Vec::new());
    for seed in 0..seeds {
        job.change(|s| (s.sampling.seed, s.sampling.spp) = (seed, spp));
        job.pixel_samples = None;
        if job.settings().sampling.allocation == Allocation::Adaptive {
            prepare(job, &Preparation::on(None)).unwrap();
        }
        let spp = job.pixel_samples.as_ref().map_or(spp, |samples| samples.spp);
        let film = film(job, RenderSettings { spp, with_replicas: true, ..RenderSettings::default() });
        means.push(film.pixels().iter().map(|p| p.mean()).collect::<Vec<_>>());
        stated.push(film.variances().iter().map(|v| v.iter().sum()).collect::<Vec<f64>>());
        independent.push(film.pixels().iter().flat_map(|p| p.variance_of_mean()).sum::<f64>());
    }

    // The variance between seeds is the mean over seeds of squared deviations, scaled by n/(n − 1)
    let (n, pixels) = (f64::from(seeds), means[0].len());
    let centre = |i: usize, c: usize| means.iter().map(|m| m[i][c]).sum::<f64>() / n;
    let centres: Vec<[f64; 3]> = (0..pixels).map(|i| [0, 1, 2].map(|c| centre(i, c))).collect();
    let square = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    let deviations = |m: &Vec<[f64; 3]>| {
        m.iter().zip(&centres).map(|(m, centre)| square(*m, *centre) * n / (n - 1.0)).collect::<Vec<f64>>()
    };
    let deviations: Vec<Vec<f64>> = means.iter().map(deviations).collect();
    let totals = |rows: &[Vec<f64>]| rows.iter().map(|r| r.iter().sum()).collect::<Vec<f64>>();
    let (truth, truth_error) = mean(&totals(&deviations));
    let (total, total_error) = mean(&totals(&stated));

    let width = job.world.scene.film.bounds.width() as usize;
    let blocks = width.div_ceil(8) * (pixels / width).div_ceil(8);
    let of_blocks = |rows: &[Vec<f64>]| {
        let mut sums = vec![0.0; blocks];
        for (i, value) in rows.iter().flat_map(|row| row.iter().enumerate()) {
            sums[i / width / 8 * width.div_ceil(8) + i % width / 8] += value;
        }
        sums
    };
    let ratios = of_blocks(&stated).into_iter().zip(of_blocks(&deviations)).filter(|(_, truth)| *truth > 0.0);
    let mut ratios: Vec<f64> = ratios.map(|(stated, truth)| stated / truth).collect();
    ratios.sort_by(f64::total_cmp);
    Study {
        stated: total / truth,
        error: total / truth * (total_error / total).hypot(truth_error / truth),
        independent: mean(&independent).0 / truth,
        blocks: [ratios[ratios.len() / 2], ratios[0], ratios[ratios.len() - 1]],
    }
}

#[test]
fn variances_are_those_between_seeds_for_every_sampler_and_number_of_samples() {
    for case in &QUIET {
        for sampler in SamplerKind::iter() {
            let mut job = job(case, sampler);
            for spp in [2, 3, 16] {
                let s = study(&mut job, spp, 32);
                let what =
                    format!("{}, {}, {spp} samples: {} ± {}", case.scene, <&str>::from(sampler), s.stated, s.error);
                // With 32 seeds of 144 pixels and replicas each, both errors are about √(2/144/32) = 2 %, and larger
                // where variances differ between pixels: 20 % is more than three standard errors
                assert!(s.error < 0.06, "{what}");
                assert!((s.stated - 1.0).abs() < 0.2, "{what}");
                // The formula for independent samples would fail
                assert!(sampler.has_independent_samples() || spp < 8 || s.independent > 2.0, "{what}");
            }
        }
    }
}

/// A room with a visible lamp and a metal ball, 32 × 32 pixels.
const ROOM: &str = r#"
LookAt 0 0 4  0 0 0  0 1 0
Camera "perspective" "float fov" 42
Film "rgb" "integer xresolution" 32 "integer yresolution" 32
Integrator "path" "integer maxdepth" 4
Sampler "zsobol"
WorldBegin
AttributeBegin AreaLightSource "diffuse" "rgb L" [ 9 8 7 ]
Shape "bilinearmesh" "point3 P" [ -0.4 0.99 0.3  0.3 0.99 0.4  -0.3 0.99 -0.4  0.4 0.99 -0.3 ] AttributeEnd
Material "diffuse" "rgb reflectance" [ 0.6 0.6 0.5 ]
Shape "bilinearmesh" "point3 P" [ -1 -1 1  1 -1 1  -1 -1 -1  1 -1 -1 ]
Shape "bilinearmesh" "point3 P" [ -1 1 1  1 1 1  -1 1 -1  1 1 -1 ]
Shape "bilinearmesh" "point3 P" [ -1 -1 -1  1 -1 -1  -1 1 -1  1 1 -1 ]
Material "conductor" "float roughness" 0.05
AttributeBegin Translate 0.4 -0.6 0.2 Shape "sphere" "float radius" 0.4 AttributeEnd
"#;

/// The edge of the lamp, of few pixels, has most of the variance. With 24 seeds, the ratio has a standard error of 7 to
/// 10 %, and of 19 % with adaptive sample counts. At 3 standard errors, a right ratio fails with a probability of
/// 0.003. At an error of 10 %, a factor of 1.8 is detected with a probability of 0.9. Blocks have errors of 10 %.
#[test]
fn variances_are_those_between_seeds_in_every_mode() {
    let loaded = load_text(ROOM, "room", Path::new("."), &LoadOptions::default(), &FileCache::default());
    let loaded = loaded.map_err(|d| d.to_string()).unwrap();
    let mut job = loaded.job(AccelKind::Embree, None).unwrap();
    let base = *job.settings();
    for mode in &MODES {
        job.change(|s| *s = base);
        set(&mut job, mode);
        let s = study(&mut job, 8, 24);
        let what = format!("{}: {} ± {}, blocks {:?}", mode.name, s.stated, s.error, s.blocks);
        assert!(s.error < 0.35 && (s.stated - 1.0).abs() < 3.0 * s.error, "{what}");
        let [median, least, most] = s.blocks;
        assert!((0.75..1.33).contains(&median) && least > 0.2 && most < 5.0, "{what}");
    }
}

#[test]
fn light_paths_have_their_part_of_the_variance() {
    let mut job = crate::light_paths::caustics(1.0);
    job.change(|s| s.sampling.allocation = Allocation::Uniform);
    let s = study(&mut job, 16, 48);
    assert!(s.error < 0.08 && (s.stated - 1.0).abs() < 0.25, "{} ± {}", s.stated, s.error);
}

#[test]
fn replicas_change_no_image_and_do_not_depend_on_tiles_and_threads() {
    // Without replicas
    let job = job_of(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/demo/gallery.pbrt"), [48, 27]);
    let plain = film(&job, RenderSettings { spp: 5, ..RenderSettings::default() });
    assert!(plain.replicas().is_empty());

    // With replicas: the same image, and variances independent of tiles and threads
    let mut variances: Vec<Vec<[f64; 3]>> = Vec::new();
    for (threads, tile_size) in [(1, 16), (2, 16), (2, 7)] {
        let settings = RenderSettings {
            spp: 5,
            threads: Some(threads),
            tile_size,
            with_replicas: true,
            ..RenderSettings::default()
        };
        let film = film(&job, settings);
        assert!(film.replicas().len() > 300);
        assert!(film.pixels().iter().zip(&plain.pixels()).all(|(a, b)| a.radiance == b.radiance));
        variances.push(film.variances());
    }
    assert!(variances.iter().all(|v| *v == variances[0]));
    assert_ne!(variances[0], plain.variances());
}

#[test]
#[ignore = "prints the table of docs/measurements/variance"]
#[allow(clippy::print_stdout)]
fn table() {
    // Scenes, from the environment or the list
    println!("| scene | mode | s²/N | stated | ± | median block | least | most |\n|---|---|---|---|---|---|---|---|");
    let own = |name: &&str| Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).with_extension("pbrt");
    let others = |paths: String| paths.split(':').map(PathBuf::from).collect();
    let paths: Vec<PathBuf> = std::env::var(OTHER_SCENES).map_or_else(|_| SCENES.iter().map(own).collect(), others);

    // A row for each scene and mode
    for path in paths {
        let mut job = job_of(path.clone(), [96, 64]);
        let base = *job.settings();
        for mode in &MODES {
            job.change(|s| *s = base);
            set(&mut job, mode);
            let Study { stated, error, independent, blocks: [median, least, most] } = study(&mut job, 16, 16);
            let folder = path.parent().and_then(Path::file_name).unwrap_or_default().display();
            let (file, name) = (path.file_stem().unwrap_or_default().display(), mode.name);
            println!(
                "| {folder}/{file} | {name} | {independent:.2} | {stated:.2} | {error:.2} | {median:.2} | {least:.2} | {most:.2} |"
            );
        }
    }
}

//! The variances that an image states, against those that many seeds show.

use lumiris::film::Film;
use lumiris::import::{LoadOptions, load};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::IntegratorKind;
use lumiris_numbers::samplers::SamplerKind;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use strum::IntoEnumIterator;

/// A scene, its size, and whether indirect light is computed.
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

/// Those of the table, with textures, glass and indirect light.
const LOUD: [Case; 3] = [
    Case { scene: "scenes/demo/gallery.pbrt", size: [48, 27], kind: IntegratorKind::Direct },
    Case { scene: "scenes/demo/gallery.pbrt", size: [48, 27], kind: IntegratorKind::Path },
    Case { scene: "scenes/keller-wald/rooms.pbrt", size: [32, 32], kind: IntegratorKind::Path },
];

fn job(case: &Case, sampler: SamplerKind) -> RenderJob {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(case.scene);
    let options = LoadOptions { resolution: Some(case.size), ..LoadOptions::default() };
    let mut loaded = load(&path, &options).map_err(|d| d.to_string()).unwrap();
    loaded.settings.integrator.kind = case.kind;
    loaded.settings.sampling.sampler = sampler;
    loaded.job(AccelKind::Embree, None).unwrap()
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

/// What `seeds` images show; ratios are to the variance between seeds, all summed over pixels and channels.
struct Study {
    /// The variance stated.
    stated: f64,
    /// Its standard error: those of both terms of the ratio.
    error: f64,
    /// The variance that independent samples would have.
    independent: f64,
    /// The median over pixels of the variance stated to that between seeds.
    median: f64,
    /// Mean of z² of the difference of two images, per pixel and channel: 1 if every pixel states its own variance.
    chi_squared: f64,
}

fn study(job: &mut RenderJob, spp: u32, seeds: u32) -> Study {
    let settings = RenderSettings { spp, with_replicas: true, ..RenderSettings::default() };
    let (mut means, mut stated, mut independent) = (Vec::new(), Vec::new(), Vec::new());
    for seed in 0..seeds {
        job.change(|s| s.sampling.seed = seed);
        let film = film(job, settings);
        let flat = |values: Vec<[f64; 3]>| values.into_flattened();
        means.push(flat(film.pixels().iter().map(|p| p.mean()).collect()));
        stated.push(flat(film.variances()));
        independent.push(film.pixels().iter().flat_map(|p| p.variance_of_mean()).sum::<f64>());
    }

    // The variance between seeds is the mean over seeds of squared deviations, scaled by n/(n − 1).
    let n = f64::from(seeds);
    let column_mean = |rows: &[Vec<f64>]| -> Vec<f64> {
        (0..rows[0].len()).map(|i| rows.iter().map(|r| r[i]).sum::<f64>() / n).collect()
    };
    let centre = column_mean(&means);
    let deviations: Vec<Vec<f64>> =
        means.iter().map(|m| m.iter().zip(&centre).map(|(x, c)| (x - c).powi(2) * n / (n - 1.0)).collect()).collect();
    let totals = |rows: &[Vec<f64>]| rows.iter().map(|r| r.iter().sum()).collect::<Vec<f64>>();
    let (truth, truth_error) = mean(&totals(&deviations));
    let (total, total_error) = mean(&totals(&stated));

    let each = column_mean(&stated).into_iter().zip(column_mean(&deviations));
    let mut ratios: Vec<f64> = each.filter(|(_, v)| *v > 0.0).map(|(stated, v)| stated / v).collect();
    ratios.sort_by(f64::total_cmp);
    let pairs = (0..seeds as usize - 1).flat_map(|s| (0..centre.len()).map(move |i| (s, i)));
    let z_squared = pairs.filter_map(|(s, i)| {
        let variance = stated[s][i] + stated[s + 1][i];
        (variance > 0.0).then(|| (means[s][i] - means[s + 1][i]).powi(2) / variance)
    });
    Study {
        stated: total / truth,
        error: total / truth * (total_error / total).hypot(truth_error / truth),
        independent: mean(&independent).0 / truth,
        median: ratios[ratios.len() / 2],
        chi_squared: mean(&z_squared.collect::<Vec<f64>>()).0,
    }
}

#[test]
fn variances_are_those_between_seeds_for_every_sampler_and_number_of_samples() {
    for case in &QUIET {
        for sampler in SamplerKind::iter() {
            let mut job = job(case, sampler);
            for spp in [2, 3, 8, 16] {
                let s = study(&mut job, spp, 32);
                let what =
                    format!("{}, {}, {spp} samples: {} ± {}", case.scene, <&str>::from(sampler), s.stated, s.error);
                // Of 32 seeds with 144 pixels and replicas each, both errors are about √(2/144/32) = 2 %, and more
                // where variances differ between pixels: 20 % are more than three of them.
                assert!(s.error < 0.06, "{what}");
                assert!((s.stated - 1.0).abs() < 0.2, "{what}");
                // The formula for independent samples would not do
                assert!(sampler.has_independent_samples() || spp < 8 || s.independent > 2.0, "{what}");
            }
        }
    }
}

#[test]
fn light_paths_have_their_part_of_the_variance() {
    let mut job = crate::light_paths::caustics(1.0);
    let s = study(&mut job, 16, 48);
    assert!(s.error < 0.08 && (s.stated - 1.0).abs() < 0.25, "{} ± {}", s.stated, s.error);
}

#[test]
fn replicas_change_no_image_and_do_not_depend_on_tiles_and_threads() {
    let job = job(&LOUD[1], SamplerKind::SobolBlueNoise);
    let plain = film(&job, RenderSettings { spp: 5, ..RenderSettings::default() });
    assert!(plain.replicas().is_empty());
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
    println!(
        "| scene | sampler | spp | as if independent | stated | ± | median pixel | χ²/n |\n|---|---|---|---|---|---|---|---|"
    );
    let (quiet, loud) = (QUIET.iter().map(|c| (c, 48)), LOUD.iter().map(|c| (c, 24)));
    for (case, seeds) in quiet.chain(loud) {
        for sampler in SamplerKind::iter() {
            let mut job = job(case, sampler);
            for spp in [4, 12, 64] {
                let s = study(&mut job, spp, seeds);
                let scene = case.scene.trim_start_matches("scenes/").trim_end_matches(".pbrt");
                println!(
                    "| {scene}, {} | {} | {spp} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} |",
                    <&str>::from(case.kind),
                    <&str>::from(sampler),
                    s.independent,
                    s.stated,
                    s.error,
                    s.median,
                    s.chi_squared
                );
            }
        }
    }
}

//! Paths that pixels share: known answers, the light of every region, and bits.

use crate::analytic_scenes::answer;
use lumiris::film::Film;
use lumiris::import::{LoadOptions, load};
use lumiris::integrators::reuse;
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::{EstimatorKind, IntegratorKind, RouletteKind};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).with_extension("pbrt")
}

fn job(scene: &Path, resolution: [u32; 2], path_reuse: u32) -> RenderJob {
    let options = LoadOptions { resolution: Some(resolution), ..LoadOptions::default() };
    let mut loaded = load(scene, &options).map_err(|d| d.to_string()).unwrap();
    let integrator = &mut loaded.settings.integrator;
    (integrator.estimator, integrator.path_reuse) = (EstimatorKind::Mis, Some(path_reuse));
    loaded.job(AccelKind::Embree, None).unwrap()
}

fn film(job: &RenderJob, settings: RenderSettings) -> Film {
    render(job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film
}

/// Means of `columns` × `rows` regions of images of different seeds, which are independent: by image, region and channel.
fn region_means(job: &mut RenderJob, seeds: std::ops::Range<u32>, [columns, rows]: [usize; 2]) -> Vec<Vec<[f64; 3]>> {
    let image = |seed| {
        job.change(|s| s.sampling.seed = seed);
        let film = film(job, RenderSettings { spp: 8, ..RenderSettings::default() });
        let (width, height) = (film.bounds.width() as usize, film.bounds.height() as usize);
        let mut sums = vec![[0.0; 4]; columns * rows];
        for (i, pixel) in film.pixels().iter().enumerate() {
            let sum = &mut sums[i / width * rows / height * columns + i % width * columns / width];
            let [r, g, b] = pixel.mean();
            *sum = [sum[0] + r, sum[1] + g, sum[2] + b, sum[3] + 1.0];
        }
        sums.iter().map(|s| [0, 1, 2].map(|c| s[c] / s[3])).collect()
    };
    seeds.map(image).collect()
}

/// Mean and the variance of it.
fn mean_of(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    (mean, values.map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n)
}

/// 2 scenes × 3 edges × 3 estimators × 3 channels: with 31 degrees of freedom a t of 5.2 has a level of 10⁻⁵, so all
/// together 10⁻³. A bias of 8 standard errors, which is at most 2 %, is found with a probability above 0.99.
#[test]
fn known_answers_remain_where_pixels_share_paths() {
    for name in ["furnace-closed-4", "furnace-box-3"] {
        let path = scene(&format!("analytic/{name}"));
        let answer = answer(&path);
        for edge in [2, 4, 7] {
            let mut job = job(&path, [20, 18], edge);
            for estimator in [EstimatorKind::Mis, EstimatorKind::Ris, EstimatorKind::Mc] {
                job.change(|s| s.integrator.estimator = estimator);
                let images = region_means(&mut job, 0..32, [1, 1]);
                for c in 0..3 {
                    let (mean, variance) = mean_of(images.iter().map(|image| image[0][c]));
                    // Rounding, where there is no noise
                    let error = variance.sqrt() + 1e-6 * answer[c];
                    let what = format!("{name}, blocks of {edge}, {estimator:?}: {mean} ± {error}, not {}", answer[c]);
                    assert!((mean - answer[c]).abs() < 5.2 * error, "{what}");
                    assert!(8.0 * error < 0.02 * answer[c], "too much noise: {what}");
                }
            }
        }
    }
}

/// Regions of images with textures, curved surfaces with normals of their own, glass, metal, corners and occluders: those
/// with shared paths have the mean of those without. 4 × 3 regions × 3 channels in two scenes, at a level of 10⁻⁵ each. A
/// bias of 8 standard errors, which is at most 10 % and 4 % in half of the regions, would be found.
#[test]
fn every_region_has_the_light_that_it_has_without_sharing() {
    for (name, seeds, limit) in [("demo/gallery", 40, 0.1), ("fan/box", 80, 0.04)] {
        let path = scene(name);
        let [alone, shared] = [(1, 0..seeds), (4, 1000..1000 + seeds)].map(|(edge, seeds)| {
            let mut job = job(&path, [64, 48], edge);
            job.change(|s| (s.integrator.kind, s.integrator.max_depth) = (IntegratorKind::Path, 5));
            job.change(|s| s.integrator.samples = Some(6));
            assert_eq!(reuse::edge(&job), edge);
            region_means(&mut job, seeds, [4, 3])
        });
        let mut limits = Vec::new();
        for region in 0..12 {
            for c in 0..3 {
                let of = |images: &[Vec<[f64; 3]>]| mean_of(images.iter().map(|image| image[region][c]));
                let ((a, v_a), (b, v_b)) = (of(&alone), of(&shared));
                let error = (v_a + v_b).sqrt();
                let what = format!("{name}, region {region}, channel {c}: {b} with and {a} without, ± {error}");
                assert!((a - b).abs() < 4.9 * error, "{what}");
                limits.push(8.0 * error / a);
            }
        }
        limits.sort_by(f64::total_cmp);
        assert!(limits[limits.len() / 2] < limit, "too much noise in {name}: {limits:?}");
    }
}

/// Errors relative to brightness, which pixels at the edge of the light do not dominate; of 1024 pixels, of which some tens
/// are independent where blocks are large.
#[test]
fn shared_paths_leave_a_part_of_the_variance() {
    let noise = |edge| {
        let mut job = job(&scene("fan/box"), [32, 32], edge);
        job.change(|s| (s.integrator.kind, s.integrator.max_depth) = (IntegratorKind::Path, 5));
        job.change(|s| s.integrator.samples = Some(12));
        let mut image = |seed| {
            job.change(|s| s.sampling.seed = seed);
            film(&job, RenderSettings { spp: 4, ..RenderSettings::default() })
        };
        let (a, b) = (image(1), image(2));
        let relative = |(a, b): (f64, f64)| (a - b).powi(2) / (0.25 * (a + b).powi(2) + 0.01);
        a.pixels().iter().zip(&b.pixels()).map(|(a, b)| relative((a.mean()[0], b.mean()[0]))).sum::<f64>()
    };
    let [alone, two, four] = [1, 2, 4].map(noise);
    assert!(two < 0.65 * alone && four < 0.4 * alone, "{alone} {two} {four}");
}

#[test]
fn threads_tiles_packets_and_passes_do_not_change_a_bit() {
    let image = |packet_width, settings: RenderSettings| {
        let options = LoadOptions { resolution: Some([70, 45]), ..LoadOptions::default() };
        let mut loaded = load(&scene("demo/gallery"), &options).map_err(|d| d.to_string()).unwrap();
        (loaded.settings.integrator.estimator, loaded.settings.integrator.path_reuse) = (EstimatorKind::Mis, Some(3));
        let job = loaded.job(AccelKind::Embree, packet_width).unwrap();
        let film = film(&job, RenderSettings { spp: 5, ..settings });
        film.pixels().iter().flat_map(|p| p.mean().map(f64::to_bits)).collect::<Vec<_>>()
    };
    let settings = RenderSettings { threads: Some(1), ..RenderSettings::default() };
    let reference = image(None, settings);
    for (threads, tile_size, packet_width) in [(2, 16, Some(1)), (3, 1, Some(8)), (1, 64, Some(16)), (2, 200, None)] {
        let other = image(packet_width, RenderSettings { threads: Some(threads), tile_size, ..settings });
        assert!(reference == other, "{threads} threads, tiles of {tile_size}, packets of {packet_width:?}");
    }
}

#[test]
fn images_whose_pixels_cannot_share_paths_are_those_without() {
    let path = scene("demo/gallery");
    let mut job = job(&path, [16, 16], 4);
    assert_eq!(reuse::obstacle(&job), None);
    job.change(|s| s.integrator.roulette = RouletteKind::Efficiency);
    assert!(reuse::obstacle(&job).is_some() && reuse::edge(&job) == 1);
    job.change(|s| s.integrator.roulette = RouletteKind::Throughput);
    job.change(|s| s.integrator.kind = IntegratorKind::Direct);
    let direct = film(&job, RenderSettings { spp: 2, ..RenderSettings::default() });
    job.change(|s| s.integrator.path_reuse = Some(1));
    let alone = film(&job, RenderSettings { spp: 2, ..RenderSettings::default() });
    assert!(direct.pixels().iter().zip(&alone.pixels()).all(|(a, b)| a.mean() == b.mean()));
}

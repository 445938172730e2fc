//! Paths that pixels share: known answers, the light of every region, and bits.

use crate::analytic_scenes::answer;
use lumiris::film::{Film, PixelSums};
use lumiris::import::{LoadOptions, load};
use lumiris::integrators::reuse;
use lumiris::render::plan::{Preparation, follows_from_times, prepare};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, PixelSamples, RenderJob};
use lumiris::settings::{Allocation, EstimatorKind, IntegratorKind, IntegratorSettings, RouletteKind};
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

pub(crate) fn film(job: &RenderJob, settings: RenderSettings) -> Film {
    render(job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film
}

/// Images of different seeds, which are independent: channels of the means of all pixels.
pub(crate) fn pixel_means(job: &mut RenderJob, seeds: std::ops::Range<u32>, spp: u32) -> Vec<Vec<f64>> {
    let numbers = job.pixel_samples.clone();
    let image = |seed| {
        job.change(|s| s.sampling.seed = seed);
        job.pixel_samples.clone_from(&numbers);
        let film = film(job, RenderSettings { spp, ..RenderSettings::default() });
        film.pixels().iter().flat_map(PixelSums::mean).collect()
    };
    seeds.map(image).collect()
}

/// Asserts that each channel of each pixel has one mean in the images without something and with it, at a level of 10⁻⁶ (|z| of
/// 4.9), and that half of the values notice a relative difference of `detects`, of 8 standard errors.
pub(crate) fn assert_pixels_agree((without, with): (&[Vec<f64>], &[Vec<f64>]), detects: f64, what: &str) {
    let (mut limits, mut wrong) = (Vec::new(), Vec::new());
    for k in 0..without[0].len() {
        let of = |images: &[Vec<f64>]| mean_of(images.iter().map(|image| image[k]));
        let ((a, v_a), (b, v_b)) = (of(without), of(with));
        let error = (v_a + v_b).sqrt();
        if (a - b).abs() > 4.9 * error {
            wrong.push(format!("pixel {}, channel {}: {b} with and {a} without, ± {error}", k / 3, k % 3));
        }
        limits.push(8.0 * error / a);
    }
    assert!(wrong.is_empty(), "{what}: {} values, such as {}", wrong.len(), wrong[0]);
    limits.sort_by(f64::total_cmp);
    let median = limits[limits.len() / 2];
    assert!(median < detects, "{what} notices {median}");
}

/// From a quarter of the mean number of samples to twice as many, in no order.
fn different_numbers(job: &RenderJob, spp: u32) -> PixelSamples {
    let bounds = job.world.scene.film.bounds;
    let counts = (0..bounds.area() as u32).map(|i| (spp / 4) << (i * 7 / 3 % 4)).collect();
    PixelSamples { bounds, spp, counts, looks: Vec::new() }
}

/// Mean and the variance of it.
pub(crate) fn mean_of(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    (mean, values.map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n)
}

/// No light is lost, and none is counted twice, in columns and in stages: where all surfaces reflect the same, a block keeps
/// its sum whatever the weights. 2 scenes × 3 edges × 3 estimators × 3 channels: with 31 degrees of freedom a t of 5.2 has a
/// level of 10⁻⁵, so all together 10⁻³. A bias of 8 standard errors, which is at most 2 %, is found with a probability above
/// 0.99.
#[test]
fn known_answers_remain_where_pixels_share_paths() {
    for name in ["furnace-closed-4", "furnace-box-3"] {
        let path = scene(&format!("analytic/{name}"));
        let answer = answer(&path);
        for edge in [2, 4, 7] {
            let mut job = job(&path, [20, 18], edge);
            for estimator in [EstimatorKind::Mis, EstimatorKind::Ris, EstimatorKind::Mc] {
                job.change(|s| s.integrator.estimator = estimator);
                let images = pixel_means(&mut job, 0..32, 8);
                for c in 0..3 {
                    let channel = |image: &Vec<f64>| image.iter().skip(c).step_by(3).sum::<f64>() / (20.0 * 18.0);
                    let (mean, variance) = mean_of(images.iter().map(channel));
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

/// Weights are right: images of few pixels, where a block has first vertices far apart, that face each other, reflect
/// differently, and hide from each other. A wrong weight moves light from pixel to pixel there, though the sum of a block may
/// stay. Each channel of each of 192 pixels has the mean that it has without sharing, at a level of 10⁻⁶ each (|z| of 4.9).
/// The box has the power: half of its values would notice 10 %, and without one of the cosines, the distance, the occlusion
/// of a pair or of the others, or with the reflectance of another pixel, 31 to 250 values differed with 128 samples, which notice 8 %. The gallery has
/// textures, normals of their own, glass and metal, and notices 38 %. The same where pixels that share have different numbers of samples.
#[test]
fn every_pixel_has_the_light_that_it_has_without_sharing() {
    const SPP: u32 = 80;
    let (mis, ris) = (EstimatorKind::Mis, EstimatorKind::Ris);
    for (name, estimator, seeds, cases) in [
        ("fan/box", mis, 48, &[(0.1, false), (0.13, true)][..]),
        ("fan/box", ris, 24, &[(0.15, false)]),
        ("demo/gallery", mis, 32, &[(0.38, false)]),
    ] {
        let images = |edge, seeds, differ: bool| {
            let mut job = job(&scene(name), [16, 12], edge);
            job.change(|s| (s.integrator.kind, s.integrator.max_depth) = (IntegratorKind::Path, 5));
            job.change(|s| (s.integrator.estimator, s.integrator.samples) = (estimator, Some(6)));
            job.pixel_samples = differ.then(|| different_numbers(&job, SPP));
            assert_eq!(reuse::edge(&job), edge);
            pixel_means(&mut job, seeds, SPP)
        };
        let alone = images(1, 0..seeds, false);
        for &(detects, differ) in cases {
            let shared = images(4, 1000..1000 + seeds, differ);
            assert_pixels_agree((&alone, &shared), detects, &format!("{name}, {estimator:?}"));
        }
    }
}

/// Blocks of 2 × 2 and 4 × 4 pixels leave less than 1/1.5 and 1/2.5 of the variance: the error is relative to brightness, which
/// pixels at the edge of the light do not dominate, and the gains of independent pairs of images tell their standard error.
#[test]
fn shared_paths_leave_a_part_of_the_variance() {
    let pairs = |edge| {
        let mut job = job(&scene("fan/box"), [32, 32], edge);
        job.change(|s| (s.integrator.kind, s.integrator.max_depth) = (IntegratorKind::Path, 5));
        job.change(|s| s.integrator.samples = Some(12));
        let images = pixel_means(&mut job, 0..16, 4);
        let relative = |(a, b): (&f64, &f64)| (a - b).powi(2) / (0.25 * (a + b).powi(2) + 0.01);
        let error = |pair: &[Vec<f64>]| pair[0].iter().zip(&pair[1]).map(relative).sum::<f64>();
        images.chunks(2).map(error).collect::<Vec<_>>()
    };
    let alone = pairs(1);
    for (edge, least) in [(2, 1.5_f64), (4, 2.5)] {
        let gains: Vec<f64> = alone.iter().zip(pairs(edge)).map(|(alone, shared)| (alone / shared).ln()).collect();
        let (gain, variance) = mean_of(gains.iter().copied());
        let what = format!("blocks of {edge}: variance by {} ± {:.0} %", gain.exp(), 100.0 * variance.sqrt());
        assert!(gain - 4.0 * variance.sqrt() > least.ln(), "{what}");
    }
}

#[test]
fn threads_tiles_packets_and_passes_do_not_change_a_bit() {
    let image = |packet_width, settings: RenderSettings| {
        let options = LoadOptions { resolution: Some([70, 45]), ..LoadOptions::default() };
        let mut loaded = load(&scene("demo/gallery"), &options).map_err(|d| d.to_string()).unwrap();
        (loaded.settings.integrator.estimator, loaded.settings.integrator.path_reuse) = (EstimatorKind::Mis, Some(3));
        let mut job = loaded.job(AccelKind::Embree, packet_width).unwrap();
        let mut images = Vec::new();
        for numbers in [None, Some(different_numbers(&job, 20))] {
            job.pixel_samples = numbers;
            let film = film(&job, RenderSettings { spp: 5, ..settings });
            images.extend(film.pixels().iter().flat_map(|p| p.mean().map(f64::to_bits)));
        }
        images
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

/// What `auto` is where an image is too small to be measured: what is good in most scenes, where it is open and possible.
#[test]
fn auto_shares_paths_in_images_that_are_too_small_to_be_measured() {
    let path = scene("demo/gallery");
    let of = |change: fn(&mut RenderJob)| {
        let mut job = job(&path, [64, 36], 1);
        job.change(|s| {
            s.integrator.kind = IntegratorKind::Path;
            s.integrator.max_depth = 5;
            (s.integrator.estimator, s.integrator.path_reuse) = (EstimatorKind::Auto, None);
            s.sampling.spp = 4;
        });
        change(&mut job);
        let bounds = job.world.scene.film.bounds;
        assert!(!follows_from_times(job.settings(), &bounds));
        prepare(&mut job, &Preparation::on(Some(1))).unwrap();
        let IntegratorSettings { estimator, path_reuse, .. } = job.settings().integrator;
        assert_eq!(estimator, EstimatorKind::Mis);
        let samples = [0, 1].map(|vertex| job.settings().integrator.sample_counts_at(vertex).samples);
        (samples, path_reuse)
    };
    assert_eq!(of(|_| ()), ([3, 2], Some(3)));
    assert_eq!(of(|job| job.change(|s| s.integrator.samples = Some(7))), ([7, 2], Some(3)));
    assert_eq!(of(|job| job.change(|s| s.integrator.path_reuse = Some(1))), ([3, 2], Some(1)));
    assert_eq!(of(|job| job.change(|s| s.integrator.roulette = RouletteKind::Efficiency)), ([3, 2], None));
    assert_eq!(of(|job| job.change(|s| s.sampling.allocation = Allocation::Uniform)), ([3, 2], None));
    assert_eq!(of(|job| job.change(|s| s.integrator.kind = IntegratorKind::Direct)).0[0], 8);

    // Sixteen times as many pixels of eight times as many samples are measured
    let mut large = job(&path, [256, 144], 1);
    large.change(|s| {
        (s.integrator.kind, s.integrator.max_depth) = (IntegratorKind::Path, 5);
        (s.integrator.estimator, s.sampling.spp) = (EstimatorKind::Auto, 32);
    });
    assert!(follows_from_times(large.settings(), &large.world.scene.film.bounds));
}

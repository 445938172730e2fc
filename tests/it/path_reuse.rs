//! Path reuse between pixels: known answers, the light of every region, and bit-identical images.

use crate::analytic_scenes::answer;
use crate::same_light::assert_same_light;
use lumiris::film::{Film, PixelSums};
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load, load_text};
use lumiris::integrators::exclusions::{Feature, allows};
use lumiris::integrators::reuse;
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, PixelSamples, RenderJob};
use lumiris::settings::{EstimatorKind, IntegratorKind};
use lumiris_test_support::power::by_power;
use lumiris_test_support::significance::{critical_t, detectable_deviation};
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

/// The image as a function of its seed, with the given sample counts.
pub(crate) fn image_of_seed(mut job: RenderJob, numbers: Option<PixelSamples>, spp: u32) -> impl FnMut(u32) -> Film {
    move |seed| {
        job.change(|s| s.sampling.seed = seed);
        job.pixel_samples.clone_from(&numbers);
        film(&job, RenderSettings { spp, ..RenderSettings::default() })
    }
}

/// Images of independent seeds: the channels of all pixel means.
pub(crate) fn pixel_means(job: &mut RenderJob, seeds: std::ops::Range<u32>, spp: u32) -> Vec<Vec<f64>> {
    let image = |seed| {
        job.change(|s| s.sampling.seed = seed);
        let film = film(job, RenderSettings { spp, ..RenderSettings::default() });
        film.pixels().iter().flat_map(PixelSums::mean).collect()
    };
    seeds.map(image).collect()
}

/// Sample counts from a quarter to twice the mean, in no order.
fn different_numbers(job: &RenderJob, spp: u32) -> PixelSamples {
    let bounds = job.world.scene.film.bounds;
    let counts = (0..bounds.area() as u32).map(|i| (spp / 4) << (i * 7 / 3 % 4)).collect();
    PixelSamples { bounds, spp, counts, emission_rays: Vec::new() }
}

/// The mean and its variance.
pub(crate) fn mean_of(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    (mean, values.map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n)
}

/// No light is lost or counted twice, in columns and in stages. Where all surfaces have the same reflectance, a block
/// keeps its sum for any weights. 2 scenes × 3 edges × 3 estimators × 3 channels, at a level of 10⁻⁵ each. A bias of
/// 2 % (3.4 % in `make test`) is detected with a probability of 0.99.
#[test]
fn known_answers_remain_where_pixels_share_paths() {
    let count = by_power(32, 16);
    let freedom = u64::from(count - 1);
    let (limit, deviation) = (critical_t(1e-5, freedom), detectable_deviation(1e-5, 0.99, freedom));
    for name in ["furnace-closed-4", "furnace-box-3"] {
        let path = scene(&format!("analytic/{name}"));
        let answer = answer(&path);
        for edge in [2, 4, 7] {
            let mut job = job(&path, [20, 18], edge);
            for estimator in [EstimatorKind::Mis, EstimatorKind::Ris, EstimatorKind::Mc] {
                job.change(|s| s.integrator.estimator = estimator);
                let images = pixel_means(&mut job, 0..count, 8);
                for c in 0..3 {
                    let channel = |image: &Vec<f64>| image.iter().skip(c).step_by(3).sum::<f64>() / (20.0 * 18.0);
                    let (mean, variance) = mean_of(images.iter().map(channel));
                    // Allows for rounding where there is no noise
                    let error = variance.sqrt() + 1e-6 * answer[c];
                    let what = format!("{name}, blocks of {edge}, {estimator:?}: {mean} ± {error}, not {}", answer[c]);
                    assert!((mean - answer[c]).abs() < limit * error, "{what}");
                    assert!(deviation * error < by_power(0.02, 0.034) * answer[c], "too much noise: {what}");
                }
            }
        }
    }
}

/// The weights are right. In images of few pixels, the first vertices of a block are far apart, face each other,
/// reflect differently, and are hidden from each other. There a wrong weight moves light from block to block, even if
/// the total stays the same. The gallery has textures, shading normals, glass and metal. The same holds with different
/// sample counts within a block.
#[test]
fn images_have_the_light_that_they_have_without_sharing() {
    const SPP: u32 = 48;
    let (mis, ris) = (EstimatorKind::Mis, EstimatorKind::Ris);
    for (name, estimator, differ) in
        [("fan/box", mis, false), ("fan/box", mis, true), ("fan/box", ris, false), ("demo/gallery", mis, false)]
    {
        let image = |edge: u32, differ: bool| {
            let mut job = job(&scene(name), [16, 12], edge);
            job.change(|s| (s.integrator.kind, s.integrator.max_depth) = (IntegratorKind::Path, 5));
            job.change(|s| (s.integrator.estimator, s.integrator.samples) = (estimator, Some(6)));
            assert_eq!(reuse::edge(&job), edge);
            let numbers = differ.then(|| different_numbers(&job, SPP));
            image_of_seed(job, numbers, SPP)
        };
        let what = if differ { ", numbers of samples that differ" } else { "" };
        let name = format!("shared paths: {name}, {estimator:?}{what}");
        assert_same_light(&name, image(1, false), image(4, differ));
    }
}

/// Blocks of 2 × 2 and 4 × 4 pixels leave less than 1/1.5 and 1/2.5 of the variance. The error is relative to the
/// brightness, so pixels at the edge of the light do not dominate. Independent pairs of images give the standard error
/// of the gains.
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
    // Bits of the image with equal and with different sample counts
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

    // Every other partition of the work gives the same bits
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
    assert!(allows(&job, Feature::Sharing));
    job.change(|s| s.integrator.kind = IntegratorKind::Direct);
    assert!(!allows(&job, Feature::Sharing) && reuse::edge(&job) == 1);
    let direct = film(&job, RenderSettings { spp: 2, ..RenderSettings::default() });
    job.change(|s| s.integrator.path_reuse = Some(1));
    let alone = film(&job, RenderSettings { spp: 2, ..RenderSettings::default() });
    assert!(direct.pixels().iter().zip(&alone.pixels()).all(|(a, b)| a.mean() == b.mean()));
}

/// A floor lit only by the ceiling: uniform except for noise.
const FLOOR: &str = r#"
LookAt 0 0 5  0 0 0  0 1 0
Camera "perspective" "float fov" 5
Film "rgb" "integer xresolution" 96 "integer yresolution" 96
Integrator "path" "integer maxdepth" 3
WorldBegin
AttributeBegin AreaLightSource "diffuse" "rgb L" [ 9 8 7 ]
Shape "bilinearmesh" "point3 P" [ 1 -1 5.5  3 -1 5.5  1 1 5.5  3 1 5.5 ] AttributeEnd
Material "diffuse" "rgb reflectance" [ 0.6 0.6 0.5 ]
Shape "bilinearmesh" "point3 P" [ -9 -9 0  9 -9 0  -9 9 0  9 9 0 ]
Shape "bilinearmesh" "point3 P" [ -9 -9 6  9 -9 6  -9 9 6  9 9 6 ]
"#;
const WIDTH: usize = 96;

/// The power spectrum, averaged over rows and columns.
fn spectrum(image: &[f64]) -> Vec<f64> {
    let mean = image.iter().sum::<f64>() / image.len() as f64;
    let waves: Vec<[f64; 2]> =
        (0..WIDTH).map(|i| (std::f64::consts::TAU * i as f64 / WIDTH as f64).sin_cos().into()).collect();
    let power = |line: usize, step: usize, frequency: usize| {
        let add = |[s, c]: [f64; 2], i: usize| {
            let ([sin, cos], value) = (waves[i * frequency % WIDTH], image[line + i * step] - mean);
            [s + sin * value, c + cos * value]
        };
        (0..WIDTH).fold([0.0; 2], add).map(|sum| sum * sum).iter().sum::<f64>()
    };
    let of = |k: usize| (0..WIDTH).map(|i| power(i * WIDTH, 1, k) + power(i, WIDTH, k)).sum();
    (0..WIDTH / 2).map(of).collect()
}

/// Noise e, |e| and e² have no more power at the periods of blocks (4 pixels), cells (32) and twice-estimated cells
/// (16), and at their harmonics, than at neighbouring frequencies. The standard error is 2.5 %. Cells of 16 × 16 pixels
/// at the same position in all rounds, ending at an edge as blocks do, have 1.17 and 1.18 times the power of |e| at
/// periods of 16 and 8 pixels.
#[test]
fn neither_blocks_nor_cells_are_seen_in_the_noise() {
    // Mean spectra of e, |e| and e² over seeds
    let loaded = load_text(FLOOR, "floor", Path::new("."), &LoadOptions::default(), &FileCache::default());
    let mut job = loaded.map_err(|d| d.to_string()).unwrap().job(AccelKind::Embree, None).unwrap();
    job.change(|s| {
        (s.integrator.estimator, s.integrator.samples, s.integrator.path_reuse) =
            (EstimatorKind::Mis, Some(1), Some(4));
    });
    assert_eq!(reuse::edge(&job), 4);
    let mut powers = [(); 3].map(|()| vec![0.0; WIDTH / 2]);
    for seed in 0..by_power(192, 48) {
        let image: Vec<f64> = pixel_means(&mut job, seed..seed + 1, 8)[0].chunks(3).map(|c| c.iter().sum()).collect();
        let mean = image.iter().sum::<f64>() / image.len() as f64;
        for (powers, of) in powers.iter_mut().zip([|e: f64| e, f64::abs, |e: f64| e * e]) {
            let values: Vec<f64> = image.iter().map(|value| of(value / mean - 1.0)).collect();
            powers.iter_mut().zip(spectrum(&values)).for_each(|(sum, power)| *sum += power);
        }
    }

    // Power at the suspect frequencies against the neighbouring ones
    let is_suspect = |k: usize| k.is_multiple_of(6) || k == 3 || k == 9;
    for (name, power) in ["e", "|e|", "e²"].iter().zip(&powers) {
        for k in (2..WIDTH / 2 - 2).filter(|&k| is_suspect(k)) {
            let beside: Vec<f64> = (k - 2..=k + 2).filter(|&j| j > 0 && !is_suspect(j)).map(|j| power[j]).collect();
            let ratio = power[k] * beside.len() as f64 / beside.iter().sum::<f64>();
            assert!(ratio < 1.1, "{name}: {ratio} times as much noise of {k}/{WIDTH} per pixel as beside it");
        }
    }
}

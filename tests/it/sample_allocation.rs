//! Adaptive sample counts: they are independent of the samples that they count, and of threads.

use crate::path_reuse::image_of_seed;
use crate::same_light::assert_same_light;
use lumiris::film::{Film, PixelSums};
use lumiris::import::{LoadOptions, load};
use lumiris::lights::LightSamplerKind;
use lumiris::planning::{PlanError, Preparation, prepare};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, PixelSamples, RenderJob};
use lumiris::settings::{Allocation, EstimatorKind, IntegratorKind, Settings};
use lumiris_numbers::estimators::stats::{Welford, z_test};
use lumiris_numbers::math::luminance;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

fn gallery(change: impl FnOnce(&mut Settings)) -> RenderJob {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/demo/gallery.pbrt");
    let options = LoadOptions { resolution: Some([96, 54]), ..LoadOptions::default() };
    let mut loaded = load(&path, &options).map_err(|d| d.to_string()).unwrap();
    loaded.settings.sampling.spp = 16;
    loaded.settings.integrator.kind = IntegratorKind::Direct;
    loaded.settings.integrator.estimator = EstimatorKind::Mis;
    change(&mut loaded.settings);
    loaded.job(AccelKind::Embree, None).unwrap()
}

/// The film, with the sample counts of its plan.
fn rendered(job: &mut RenderJob, threads: usize, tile_size: u32) -> (Film, PixelSamples) {
    prepare(job, &Preparation::on(Some(threads))).unwrap();
    let samples = job.pixel_samples.clone().expect("numbers that differ");
    let settings = RenderSettings {
        threads: Some(threads),
        tile_size,
        spp: samples.spp,
        with_replicas: true,
        ..Default::default()
    };
    let rendering = render(job, &settings, &AtomicBool::new(false), &|_| ()).unwrap();
    assert!(rendering.complete);
    (rendering.film, samples)
}

#[test]
fn adaptive_images_have_the_samples_they_ask_for_and_do_not_depend_on_threads_or_tiles() {
    for noise in [None, Some(0.2)] {
        // An adaptive job, with a target time or a noise threshold
        let job = || {
            let mut job = lottery_beside(LAMP, 48, ("spot\" \"float coneangle\" 8", 4.0), 4);
            job.change(|s| {
                s.sampling.allocation = Allocation::Adaptive;
                s.sampling.noise = noise;
                s.sampling.spp = if noise.is_some() { 400 } else { 64 };
                s.integrator.samples = noise.is_none().then_some(8);
            });
            job
        };

        // The film has the planned sample counts
        let (film, samples) = rendered(&mut job(), 1, 16);
        let (min, max) = (samples.counts.iter().min().unwrap(), samples.counts.iter().max().unwrap());
        assert!(max > &(2 * min), "{min} to {max}");
        assert!(film.pixels().iter().zip(&samples.counts).all(|(p, &n)| p.count == u64::from(n)));
        let pixels = film.pixels();
        assert!(film.replicas().iter().all(|r| r.count == pixels[r.pixel as usize].count));
        // Edges of the lamp have extra emission rays
        assert!(samples.emission_rays.iter().any(|n| *n > 2));
        if noise.is_none() {
            let mean = samples.total() as f64 / film.len() as f64;
            assert!((32.0..128.0).contains(&mean), "the time is that of 64: {mean}");
        }

        // The same bits for any threads and tiles
        let bits = |film: &Film| film.pixels().iter().map(|p| p.radiance.map(f64::to_bits)).collect::<Vec<_>>();
        for (threads, tile_size) in [(3, 16), (2, 7)] {
            let (other, again) = rendered(&mut job(), threads, tile_size);
            assert_eq!(samples, again);
            assert!(bits(&film) == bits(&other), "{threads} threads, tiles of {tile_size}");
        }
    }
}

/// Sample counts and extra emission rays from a new pilot for each image, against uniform counts.
#[test]
#[ignore = "of `make test-power` only"]
fn adaptive_numbers_leave_the_light_of_equal_ones() {
    let mut adaptive = gallery(|s| s.sampling.allocation = Allocation::Adaptive);
    let equal = gallery(|s| s.sampling.allocation = Allocation::Uniform);
    let with = |seed| {
        adaptive.change(|s| s.sampling.seed = seed);
        rendered(&mut adaptive, 2, 16).0
    };
    assert_same_light("adaptive numbers: gallery, direct, mis", image_of_seed(equal, None, 16), with);
}

#[test]
fn integrators_that_share_noise_and_estimators_that_fit_blocks_have_uniform_numbers() {
    let changes: [fn(&mut Settings); 3] = [
        |s| s.integrator.kind = IntegratorKind::IrradianceCache,
        |s| s.integrator.estimator = EstimatorKind::OptimalMis,
        |s| s.sampling.spp = 4,
    ];
    for change in changes {
        let mut job = gallery(|s| {
            s.sampling.allocation = Allocation::Adaptive;
            change(s);
        });
        prepare(&mut job, &Preparation::on(Some(2))).unwrap();
        assert_eq!(job.pixel_samples, None);
    }
}

/// A floor below some lights. One of them has a different kind and power, so uniform light selection chooses it rarely.
/// The image has `size` × `size` pixels.
fn lottery(size: u32, other: (&str, f64), lights: u32) -> RenderJob {
    lottery_beside("", size, other, lights)
}

/// A visible lamp.
const LAMP: &str = r#"
AttributeBegin AreaLightSource "diffuse" "bool twosided" true "rgb L" [ 30 30 30 ]
Shape "bilinearmesh" "point3 P" [ 0.1 0.1 0.1  0.4 0.1 0.2  0.1 0.1 0.5  0.4 0.1 0.6 ] AttributeEnd
"#;

/// [`lottery`] with other things in the scene.
fn lottery_beside(things: &str, size: u32, other: (&str, f64), lights: u32) -> RenderJob {
    // The text of the scene
    let mut text = r#"
LookAt 0 2 0  0 0 0  0 0 1
Camera "perspective" "float fov" 40
Film "rgb" "integer xresolution" SIZE "integer yresolution" SIZE
Integrator "direct" "string estimator" "mc" "integer samples" 1
Sampler "independent"
WorldBegin
Material "diffuse" "rgb reflectance" [ 0.5 0.5 0.5 ]
Shape "bilinearmesh" "point3 P" [ -2 0 -2  2 0 -2  -2 0 2  2 0 2 ]
"#
    .replace("SIZE", &size.to_string())
        + things;
    for i in 0..lights {
        let (kind, power) = if i == lights / 2 { other } else { ("point\"", 1.0) };
        text += &format!(
            "LightSource \"{kind} \"rgb I\" [ 1 1 1 ] \"float scale\" {power} \"point3 from\" [ {0} 3 {1} ]{2}\n",
            0.1 * f64::from(i % 8),
            0.1 * f64::from(i / 8),
            if kind.starts_with("spot") { " \"point3 to\" [ 0 0 0 ]" } else { "" }
        );
    }

    // Load it with uniform light selection
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lottery.pbrt");
    std::fs::write(&path, text).unwrap();
    let mut loaded = load(&path, &LoadOptions::default()).map_err(|d| d.to_string()).unwrap();
    loaded.settings.integrator.light_sampler = LightSamplerKind::Uniform;
    loaded.job(AccelKind::Embree, None).unwrap()
}

fn mean(pixels: &[PixelSums]) -> f64 {
    pixels.iter().map(|p| luminance(p.mean())).sum::<f64>() / pixels.len() as f64
}

/// Samples from `first_sample` on of the whole image.
fn part(job: &RenderJob, first_sample: u32, spp: u32) -> Film {
    let settings = RenderSettings { threads: Some(1), first_sample, spp, ..Default::default() };
    render(job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film
}

/// The biased method: sampling until the samples' own noise is below the threshold.
fn stopped_by_its_own_samples(job: &RenderJob, threshold: f64, limit: u32) -> f64 {
    let mut pixels = part(job, 0, 2).pixels();
    loop {
        let count = pixels[0].count as u32;
        let own = pixels.iter().map(|p| luminance(p.variance_of_mean())).sum::<f64>() / pixels.len() as f64;
        if own.sqrt() / (mean(&pixels) + 0.01) < threshold || count >= limit {
            return mean(&pixels);
        }
        for (sum, more) in pixels.iter_mut().zip(&part(job, count, count).pixels()) {
            sum.count += more.count;
            for c in 0..3 {
                sum.radiance[c] += more.radiance[c];
                sum.radiance_squared[c] += more.radiance_squared[c];
            }
        }
    }
}

#[test]
fn numbers_of_samples_add_no_bias() {
    const RUNS: u32 = 2000;
    const THRESHOLD: f32 = 0.9;
    let mut job = lottery(4, ("point\"", 400.0), 64);
    job.change(|s| s.sampling.spp = 256);
    // The reference: the same lights selected by power, with hardly any variance
    let mut exact = lottery(4, ("point\"", 400.0), 64);
    exact.change(|s| s.integrator.light_sampler = LightSamplerKind::Power);
    let truth = mean(&part(&exact, 0, 4096).pixels());

    // The same with a visible lamp, whose edges have extra emission rays
    let beside_lamp = || lottery_beside(LAMP, 4, ("point\"", 400.0), 64);
    let (mut lamp, mut exact) = (beside_lamp(), beside_lamp());
    exact.change(|s| s.integrator.light_sampler = LightSamplerKind::Power);
    let truth_of_lamp = mean(&part(&exact, 0, 1 << 17).pixels());

    let (mut noise, mut adaptive, mut wrong) = (Welford::default(), Welford::default(), Welford::default());
    let (mut seen, mut with_rays) = (Welford::default(), 0);
    let mut numbers = std::collections::BTreeSet::new();
    for seed in 0..RUNS {
        job.change(|s| {
            (s.sampling.seed, s.sampling.noise, s.sampling.spp) = (seed, Some(THRESHOLD), 256);
        });
        let (film, samples) = rendered(&mut job, 1, 16);
        numbers.extend(samples.counts);
        noise.add(mean(&film.pixels()));
        lamp.change(|s| {
            (s.sampling.seed, s.sampling.noise, s.sampling.spp) = (seed, Some(THRESHOLD), 256);
        });
        let (film, samples) = rendered(&mut lamp, 1, 16);
        with_rays += u32::from(!samples.emission_rays.is_empty());
        seen.add(mean(&film.pixels()));

        job.change(|s| (s.sampling.noise, s.sampling.allocation, s.sampling.spp) = (None, Allocation::Adaptive, 16));
        prepare(&mut job, &Preparation::on(Some(1))).unwrap();
        adaptive.add(mean(&part(&job, 0, 16).pixels()));
        job.pixel_samples = None;
        if seed < RUNS / 4 {
            wrong.add(stopped_by_its_own_samples(&job, f64::from(THRESHOLD), 256));
        }
    }
    assert!(numbers.len() > 4, "the numbers vary: {numbers:?}");
    let z = |of: &Welford| z_test(of.mean(), truth, of.standard_error()).statistic;
    assert!(z(&noise).abs() < 3.0, "--noise: {} instead of {truth}, z = {}", noise.mean(), z(&noise));
    let of_lamp = z_test(seen.mean(), truth_of_lamp, seen.standard_error()).statistic;
    assert!(of_lamp.abs() < 3.0, "--noise, a lamp: {} instead of {truth_of_lamp}, z = {of_lamp}", seen.mean());
    assert!(with_rays > RUNS / 4, "{with_rays}");
    assert!(z(&adaptive).abs() < 3.0, "adaptive: {} instead of {truth}, z = {}", adaptive.mean(), z(&adaptive));
    // A quarter of the runs suffices to detect the bias of samples that determine their own number
    assert!(z(&wrong) < -5.0, "{} instead of {truth}, z = {}", wrong.mean(), z(&wrong));
}

#[test]
fn pilots_end_when_they_are_stopped_and_are_given_up_at_their_deadline() {
    let job = |noise: Option<f32>| {
        gallery(|s| {
            s.integrator.estimator = EstimatorKind::Auto;
            (s.sampling.spp, s.sampling.noise) = (100_000, noise);
        })
    };
    for noise in [None, Some(0.01)] {
        let (stop, deadline) = (AtomicBool::new(true), Some(Instant::now()));
        let how = Preparation { stop: &stop, deadline, ..Preparation::on(Some(1)) };
        let error = prepare(&mut job(noise), &how).unwrap_err();
        assert!(matches!(error, PlanError::Stopped), "{error}");

        let mut job = job(noise);
        let plan = prepare(&mut job, &Preparation { deadline, ..Preparation::on(Some(1)) }).unwrap();
        let settings = job.settings();
        assert_eq!((plan.warnings.len(), job.pixel_samples.is_none()), (1, true));
        assert_eq!((settings.sampling.allocation, settings.sampling.noise), (Allocation::Uniform, None));
        // The allocation becomes a setting, since the image depends on it
        let chosen = |key: &str| plan.chosen.iter().find(|(k, _)| *k == key).map(|(_, value)| value.as_str());
        assert_eq!((chosen("estimator"), chosen("allocation")), (Some("mis"), Some("uniform")));
    }
}

#[test]
fn pilots_say_what_they_do_and_how_much_of_it_is_done() {
    let told = Mutex::new(BTreeMap::<&str, Vec<f64>>::new());
    let observe = |name: &'static str, done: Option<f64>| told.lock().unwrap().entry(name).or_default().extend(done);
    let mut job = gallery(|s| {
        s.integrator.estimator = EstimatorKind::Auto;
        s.sampling.spp = 4096;
    });
    prepare(&mut job, &Preparation { observe: &observe, ..Preparation::on(Some(1)) }).unwrap();
    let told = told.into_inner().unwrap();
    let name = "measuring the noise of each pixel";
    let done = told.get(name).unwrap_or_else(|| panic!("{name}: {:?}", told.keys()));
    assert!(done.is_sorted() && done.iter().all(|done| (0.0..=1.0).contains(done)), "{name}: {done:?}");
    assert!(done.first().is_some_and(|first| *first < 0.2) && done.last().is_some_and(|last| *last > 0.7), "{done:?}");
}

#[test]
fn numbers_of_pixels_follow_from_the_pilot_that_is_asked_for() {
    let counts = |pilot_spp: Option<u32>, spp: u32| {
        let mut job = gallery(|s| {
            s.sampling.allocation = Allocation::Adaptive;
            (s.sampling.spp, s.sampling.pilot_spp) = (spp, pilot_spp);
        });
        prepare(&mut job, &Preparation::on(Some(2))).unwrap();
        job.pixel_samples.map(|samples| samples.counts)
    };
    assert_eq!(counts(Some(64), 64), counts(None, 64));
    assert_eq!(counts(Some(1000), 64), counts(None, 64), "not more than there are samples");
    assert!(counts(Some(32), 4096).is_some_and(|few| Some(few) != counts(None, 4096)));
}

//! `ocv` over pixels always applies its control variates.

use lumiris::import::{LoadOptions, load};
use lumiris::lights::LightSamplerKind;
use lumiris::planning::{Preparation, prepare};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, PixelSamples, RenderJob};
use lumiris::settings::{Allocation, EstimatorKind, IntegratorKind};
use lumiris_numbers::estimators::stats::Welford;
use lumiris_numbers::math::luminance;
use lumiris_numbers::samplers::SamplerKind;
use std::sync::atomic::AtomicBool;

/// A floor under `lamps` lamps, one of which is close to it.
fn floor(lamps: u32, resolution: [u32; 2]) -> RenderJob {
    // Scene
    let [width, height] = resolution;
    let mut text = format!(
        r#"
LookAt 0 3 -4  0 0 0  0 1 0
Camera "perspective" "float fov" 50
Film "rgb" "integer xresolution" {width} "integer yresolution" {height}
WorldBegin
Material "diffuse" "rgb reflectance" [ 0.6 0.5 0.4 ]
Shape "bilinearmesh" "point3 P" [ -9 0 -9  9 0 -9  -9 0 9  9 0 9 ]
"#
    );
    for i in 0..lamps {
        let (x, y) = (1.5 * f64::from(i) - 2.0, 0.7 + f64::from(i));
        text += &format!("LightSource \"point\" \"point3 from\" [ {x} {y} 0.5 ]\n");
    }

    // Settings
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("floor.pbrt");
    std::fs::write(&path, text).unwrap();
    let mut loaded = load(&path, &LoadOptions::default()).map_err(|d| d.to_string()).unwrap();
    let integrator = &mut loaded.settings.integrator;
    *integrator = integrator.of_kind(IntegratorKind::Direct);
    integrator.estimator = EstimatorKind::Ocv;
    integrator.light_sampler = LightSamplerKind::Power;
    let sampling = &mut loaded.settings.sampling;
    (sampling.spp, sampling.allocation) = (8, Allocation::Uniform);
    loaded.job(AccelKind::Embree, None).unwrap()
}

/// With one lamp, control variates gain nothing, but the estimator is still `ocv`.
#[test]
fn an_estimator_that_is_asked_for_by_name_is_not_another_one() {
    let mut job = floor(1, [192, 128]);
    assert_eq!(prepare(&mut job, &Preparation::default()).unwrap().chosen, []);
    assert_eq!(job.settings().integrator.estimator, EstimatorKind::Ocv);
}

/// Pixels may have different sample counts, some with extra emission rays. Their means equal those of `mis`. Two-sided
/// z-tests for quarters of the image, with 2 × 64 images: 4.2 standard errors have a level of 2.7·10⁻⁵, 10⁻⁴ for all
/// four. A bias of 6.6 standard errors, at most 3 %, is detected with a probability above 0.99. The noise must be
/// lower, too; it would not be if controls were divided by sample counts of other pixels.
#[test]
fn different_numbers_of_samples_change_no_mean() {
    // Images with different sample counts
    let resolution = [32, 24];
    let images = |estimator, seeds: std::ops::Range<u32>| {
        let mut job = floor(5, resolution);
        job.change(|s| {
            s.integrator.estimator = estimator;
            s.sampling.sampler = SamplerKind::Independent;
        });
        let bounds = job.world.scene.film.bounds;
        let counts = (0..bounds.area() as u32).map(|i| 8 << (i * 7 / 3 % 4)).collect();
        let emission_rays = (0..bounds.area()).map(|i| [1, 1, 3][i % 3]).collect();
        job.pixel_samples = Some(PixelSamples { bounds, spp: 16, counts, emission_rays });
        let image = |seed| {
            job.change(|s| s.sampling.seed = seed);
            let settings = RenderSettings { spp: 16, ..RenderSettings::default() };
            let film = render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film;
            film.pixels().iter().map(|p| luminance(p.mean())).collect::<Vec<f64>>()
        };
        seeds.map(image).collect::<Vec<_>>()
    };

    // Means
    let (ocv, mis) = (images(EstimatorKind::Ocv, 0..64), images(EstimatorKind::Mis, 64..128));
    let area = ocv[0].len();
    for quarter in 0..4 {
        let pixels = quarter * area / 4..(quarter + 1) * area / 4;
        let of = |images: &[Vec<f64>]| -> Welford {
            images.iter().map(|image| image[pixels.clone()].iter().sum::<f64>()).collect()
        };
        let (ocv, mis) = (of(&ocv), of(&mis));
        let error = ocv.standard_error().hypot(mis.standard_error());
        let what = format!("quarter {quarter}: {} by ocv, {} by mis, ± {error}", ocv.mean(), mis.mean());
        assert!((ocv.mean() - mis.mean()).abs() < 4.2 * error && 6.6 * error < 0.03 * mis.mean(), "{what}");
    }

    // Noise
    let relative_variance = |images: &[Vec<f64>]| -> f64 {
        let of_pixel = |i: usize| images.iter().map(|image| image[i]).collect::<Welford>();
        (0..area).map(of_pixel).map(|w| w.variance() / w.mean().powi(2)).sum()
    };
    let [corrected, alone] = [&ocv, &mis].map(|images| relative_variance(images));
    assert!(corrected < 0.7 * alone, "{corrected} of {alone}");
}

/// Sample counts depend on a pilot whose samples are not corrected.
#[test]
fn control_variates_leave_adaptive_numbers() {
    let counts = |estimator| {
        let mut job = floor(5, [96, 64]);
        job.change(|s| {
            s.integrator.estimator = estimator;
            (s.sampling.sampler, s.sampling.noise) = (SamplerKind::Independent, Some(0.05));
            s.sampling.spp = 64;
        });
        prepare(&mut job, &Preparation::default()).unwrap();
        assert_eq!(job.settings().integrator.estimator, estimator);
        job.pixel_samples.expect("numbers of samples").counts
    };
    let of_ocv = counts(EstimatorKind::Ocv);
    assert_eq!(of_ocv, counts(EstimatorKind::Mis));
    assert!(of_ocv.iter().any(|n| *n != of_ocv[0]), "{of_ocv:?}");
}

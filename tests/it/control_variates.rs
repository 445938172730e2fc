//! Whether `ocv` has control variates: what its pilot finds.

use lumiris::film::PixelSums;
use lumiris::import::{LoadOptions, load};
use lumiris::lights::LightSamplerKind;
use lumiris::render::plan::{Preparation, prepare};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::{Allocation, ControlVariates, EstimatorKind, IntegratorKind};
use lumiris_numbers::samplers::SamplerKind;
use std::sync::atomic::AtomicBool;

/// A floor under as many lamps, one of which stands close to it.
fn floor(lamps: u32, resolution: [u32; 2]) -> RenderJob {
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

fn means(job: &RenderJob) -> Vec<[f64; 3]> {
    let settings = RenderSettings { spp: 4, ..RenderSettings::default() };
    let film = render(job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film;
    film.pixels().iter().map(PixelSums::mean).collect()
}

#[test]
fn where_nothing_is_gained_the_image_is_that_of_mis_to_the_bit() {
    let mut job = floor(1, [192, 128]);
    let plan = prepare(&mut job, &Preparation::default()).unwrap();
    assert_eq!(plan.chosen, [("estimator", "mis".to_owned())]);
    let mut mis = floor(1, [192, 128]);
    mis.change(|s| s.integrator.estimator = EstimatorKind::Mis);
    assert_eq!(means(&job), means(&mis));
}

#[test]
fn paths_keep_the_number_of_samples_without_control_variates() {
    let mut job = floor(1, [192, 128]);
    job.change(|s| s.integrator = s.integrator.of_kind(IntegratorKind::Path));
    let before = job.settings().integrator.sample_counts();
    let plan = prepare(&mut job, &Preparation::default()).unwrap();
    assert_eq!(plan.chosen, [("estimator", "mis".to_owned()), ("samples", before.samples.to_string())]);
    assert_eq!(job.settings().integrator.sample_counts(), before);
}

#[test]
fn control_variates_remain_where_they_gain_and_where_the_image_is_too_small_to_tell() {
    // Which lamp a sample has is all of the noise, and columns know it
    let mut job = floor(5, [192, 128]);
    job.change(|s| s.sampling.sampler = SamplerKind::Independent);
    let plan = prepare(&mut job, &Preparation::default()).unwrap();
    assert_eq!(plan.chosen, [("control_variates", "always".to_owned())]);
    assert_eq!(job.settings().integrator.estimator, EstimatorKind::Ocv);

    for (resolution, given) in [([96, 64], ControlVariates::Auto), ([192, 128], ControlVariates::Always)] {
        let mut job = floor(1, resolution);
        job.change(|s| s.integrator.ocv.control_variates = given);
        assert_eq!(prepare(&mut job, &Preparation::default()).unwrap().chosen, []);
        assert_eq!(job.settings().integrator.estimator, EstimatorKind::Ocv);
    }
}

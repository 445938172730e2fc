//! A picture depends on the scene, its settings, the seed and the sample range, and on nothing else.

use lumiris::film::Film;
use lumiris::import::{LoadOptions, load};
use lumiris::lights::LightSamplerKind;
use lumiris::render::output::{Aov, channels};
use lumiris::render::plan::prepare;
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::{EstimatorKind, Proposals, Target};
use std::path::Path;
use std::sync::atomic::AtomicBool;

const ESTIMATORS: [EstimatorKind; 4] =
    [EstimatorKind::Mis, EstimatorKind::Ris, EstimatorKind::Ocv, EstimatorKind::Correlated];

fn gallery(estimator: EstimatorKind, packet_width: Option<u32>) -> RenderJob {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/demo/gallery.pbrt");
    let options = LoadOptions { resolution: Some([96, 54]), ..LoadOptions::default() };
    let mut loaded = load(&path, &options).map_err(|d| d.to_string()).unwrap();
    loaded.settings.integrator.estimator = estimator;
    loaded.job(AccelKind::Embree, packet_width).unwrap()
}

fn film(job: &RenderJob, settings: RenderSettings) -> Film {
    render(job, &RenderSettings { spp: 8, ..settings }, &AtomicBool::new(false), &|_| ()).unwrap().film
}

fn assert_same_bits(a: &Film, b: &Film, what: &str) {
    let bits = |f: &Film| channels(f, &Aov::ALL, None).data.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    let (a, b) = (bits(a), bits(b));
    assert!(a.iter().any(|&v| v != 0));
    let different = a.iter().zip(&b).filter(|(x, y)| x != y).count();
    assert_eq!(different, 0, "{what}: {different} of {} values differ", a.len());
}

#[test]
fn threads_and_tiles_do_not_change_a_bit() {
    for estimator in ESTIMATORS {
        let job = gallery(estimator, None);
        let reference = film(&job, RenderSettings { threads: Some(1), ..RenderSettings::default() });
        for threads in [1, 2, 3] {
            for tile_size in [1, 8, 13, 64] {
                let settings = RenderSettings { threads: Some(threads), tile_size, ..RenderSettings::default() };
                let what = format!("{estimator:?}, {threads} threads, tiles of {tile_size}");
                assert_same_bits(&reference, &film(&job, settings), &what);
            }
        }
    }
}

#[test]
fn packet_width_does_not_change_a_bit() {
    for estimator in ESTIMATORS {
        let reference = film(&gallery(estimator, Some(1)), RenderSettings::default());
        for width in [4, 8] {
            let other = film(&gallery(estimator, Some(width)), RenderSettings::default());
            assert_same_bits(&reference, &other, &format!("{estimator:?}, packets of {width}"));
        }
    }
}

#[test]
fn what_a_plan_chose_gives_the_same_picture_when_it_is_given() {
    for proposals in [Proposals::Auto, Proposals::Optimal] {
        // Chosen from times of this run
        let mut planned = gallery(EstimatorKind::Ris, None);
        planned.change(|s| s.integrator.ris.proposals = proposals);
        let plan = prepare(&mut planned, Some(2), false).unwrap().unwrap();
        assert!(plan.split.proposals >= plan.split.samples && plan.times.t1 > 0.0 && plan.times.t2 > 0.0);
        let reference = film(&planned, RenderSettings::default());

        // Given
        let mut given = gallery(EstimatorKind::Ris, None);
        given.change(|s| s.integrator.samples = Some(plan.split.samples));
        if proposals == Proposals::Optimal {
            let times = Some(plan.times);
            given.change(|s| (s.integrator.ris.proposals, s.integrator.ris.stage_times) = (proposals, times));
            prepare(&mut given, Some(1), false).unwrap();
        } else {
            given.change(|s| s.integrator.ris.proposals = Proposals::Fixed(plan.split.proposals));
        }
        assert_same_bits(&reference, &film(&given, RenderSettings::default()), &format!("{proposals:?}"));
    }
}

#[test]
fn pictures_with_photons_that_tell_of_lights_are_the_same_for_any_number_of_threads() {
    for estimator in [EstimatorKind::Mis, EstimatorKind::Ris, EstimatorKind::Ocv, EstimatorKind::Contributing] {
        let picture = |threads| {
            let mut job = gallery(estimator, None);
            job.change(|s| s.integrator.ris.proposals = Proposals::Fixed(16));
            job.change(|s| s.integrator.ris.target = Target::Visibility);
            job.change(|s| s.integrator.photons.light_photons = Some(20_000));
            job.change(|s| s.integrator.light_choice = LightSamplerKind::Photons);
            prepare(&mut job, Some(threads), false).unwrap();
            assert!(job.lights.hints().is_some());
            film(&job, RenderSettings { threads: Some(threads), ..RenderSettings::default() })
        };
        let reference = picture(1);
        for threads in [2, 3] {
            assert_same_bits(&reference, &picture(threads), &format!("{estimator:?}, {threads} threads"));
        }
    }
}

#[test]
fn seeds_give_different_pictures() {
    let mut job = gallery(EstimatorKind::Mis, None);
    let a = film(&job, RenderSettings::default());
    job.change(|s| s.sampling.seed = 1);
    let b = film(&job, RenderSettings::default());
    assert_ne!(channels(&a, &[], None).data, channels(&b, &[], None).data);
}

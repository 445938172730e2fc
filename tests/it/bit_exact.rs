//! An image depends only on the scene, its settings, the seed and the sample range.

use lumiris::film::Film;
use lumiris::import::{LoadOptions, load};
use lumiris::lights::LightSamplerKind;
use lumiris::planning::{Preparation, prepare};
use lumiris::render::output::{Aov, channels};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::{EstimatorKind, Proposals, Target};
use std::path::Path;
use std::sync::atomic::AtomicBool;

const ESTIMATORS: [EstimatorKind; 4] =
    [EstimatorKind::Mis, EstimatorKind::Ris, EstimatorKind::Ocv, EstimatorKind::Correlated];

fn gallery(estimator: EstimatorKind, packet_width: Option<u32>) -> RenderJob {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/demo/gallery.pbrt");
    let options = LoadOptions { resolution: Some([96, 36]), ..LoadOptions::default() };
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
        for (threads, tile_size) in [(1, 1), (1, 64), (2, 8), (2, 13), (3, 1), (3, 64)] {
            let settings = RenderSettings { threads: Some(threads), tile_size, ..RenderSettings::default() };
            let what = format!("{estimator:?}, {threads} threads, tiles of {tile_size}");
            assert_same_bits(&reference, &film(&job, settings), &what);
        }
    }
}

#[test]
fn the_instruction_set_of_the_lanes_does_not_change_a_bit() {
    for estimator in ESTIMATORS {
        let job = gallery(estimator, None);
        let reference = film(&job, RenderSettings::default());
        for level in lumiris_lanes::levels() {
            // Applies to the whole process: concurrent tests render the same bits
            lumiris_lanes::set_level(Some(level));
            let other = film(&job, RenderSettings::default());
            lumiris_lanes::set_level(None);
            assert_same_bits(&reference, &other, &format!("{estimator:?}, {level:?}"));
        }
    }
}

#[test]
fn packet_width_does_not_change_a_bit() {
    for estimator in ESTIMATORS {
        let reference = film(&gallery(estimator, Some(1)), RenderSettings::default());
        for width in [4, 8, 16] {
            let other = film(&gallery(estimator, Some(width)), RenderSettings::default());
            assert_same_bits(&reference, &other, &format!("{estimator:?}, packets of {width}"));
        }
    }
}

/// A textured floor, at a grazing angle.
const TEXTURED: &str = r#"
LookAt 0 0.4 -2  0 0 0  0 1 0
Camera "perspective" "float fov" 50
Film "rgb" "integer xresolution" 24 "integer yresolution" 16
WorldBegin
LightSource "distant" "point3 from" [ 1 3 -2 ]
Texture "dots" "spectrum" "imagemap" "string filename" "dots.pgm" "float uscale" 20 "float vscale" 20
Material "diffuse" "texture reflectance" "dots"
Shape "bilinearmesh" "point3 P" [ -3 0 -3  3 0 -3  -3 0 6  3 0 6 ] "point2 uv" [ 0 0  1 0  0 1  1 1 ]
"#;

#[test]
fn parts_of_an_image_add_up_if_their_footprints_are_those_of_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let dots: Vec<String> = (0..256_u32).map(|i| ((i * 97 + i / 16 * 31) % 256).to_string()).collect();
    std::fs::write(folder.path().join("dots.pgm"), format!("P2 16 16 255\n{}\n", dots.join("\n"))).unwrap();
    let path = folder.path().join("floor.pbrt");
    std::fs::write(&path, TEXTURED).unwrap();
    let part = |spp, footprint_spp, samples: std::ops::Range<u32>| {
        let mut loaded = load(&path, &LoadOptions::default()).map_err(|d| d.to_string()).unwrap();
        (loaded.settings.sampling.spp, loaded.settings.sampling.footprint_spp) = (spp, footprint_spp);
        let job = loaded.job(AccelKind::Embree, None).unwrap();
        let settings =
            RenderSettings { first_sample: samples.start, spp: samples.len() as u32, ..RenderSettings::default() };
        render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film
    };
    let sums = |films: &[Film]| -> Vec<[f64; 3]> {
        let pixels: Vec<_> = films.iter().map(Film::pixels).collect();
        let sum = |i: usize| [0, 1, 2].map(|c| pixels.iter().map(|p| p[i].radiance[c]).sum::<f64>());
        (0..films[0].len()).map(sum).collect()
    };
    // Sums of a few f32 in f64 are exact here
    let whole = sums(&[part(8, None, 0..8)]);
    assert_eq!(whole, sums(&[part(3, Some(8), 0..3), part(5, Some(8), 3..8)]));
    assert_ne!(whole, sums(&[part(3, None, 0..3), part(5, None, 3..8)]), "footprints of fewer samples are wider");
}

#[test]
fn numbers_of_proposals_that_follow_from_variances_are_the_same_for_any_number_of_threads() {
    let image = |threads| {
        let mut job = gallery(EstimatorKind::Ris, None);
        job.change(|s| s.integrator.ris.proposals = Proposals::Optimal);
        assert_eq!(prepare(&mut job, &Preparation::on(Some(threads))).unwrap().warnings, [""; 0]);
        assert!(job.sample_count_map.is_some());
        film(&job, RenderSettings { threads: Some(threads), ..RenderSettings::default() })
    };
    assert_same_bits(&image(1), &image(3), "optimal");
}

#[test]
fn images_with_photons_that_tell_of_lights_are_the_same_for_any_number_of_threads() {
    for estimator in [EstimatorKind::Mis, EstimatorKind::Ris, EstimatorKind::Ocv, EstimatorKind::Contributing] {
        let image = |threads| {
            let mut job = gallery(estimator, None);
            job.change(|s| s.integrator.ris.proposals = Proposals::Fixed(16));
            job.change(|s| s.integrator.ris.target = Target::Visibility);
            job.change(|s| s.integrator.photons.visibility_photons = Some(20_000));
            job.change(|s| s.integrator.light_sampler = LightSamplerKind::VisibilityCache);
            prepare(&mut job, &Preparation::on(Some(threads))).unwrap();
            assert!(job.lights.visibility_cache().is_some());
            film(&job, RenderSettings { threads: Some(threads), ..RenderSettings::default() })
        };
        let reference = image(1);
        for threads in [2, 3] {
            assert_same_bits(&reference, &image(threads), &format!("{estimator:?}, {threads} threads"));
        }
    }
}

#[test]
fn seeds_give_different_images() {
    let mut job = gallery(EstimatorKind::Mis, None);
    let a = film(&job, RenderSettings::default());
    job.change(|s| s.sampling.seed = 1);
    let b = film(&job, RenderSettings::default());
    assert_ne!(channels(&a, &[], None).data, channels(&b, &[], None).data);
}

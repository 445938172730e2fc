//! Photons: energy, known and path-traced irradiance, caustics, importance, bit-identical maps, and scenes without any.

use super::irradiance_cache::{ROOM, world_of};
use lumiris::integrators::irradiance_cache::gather::{Gatherer, RecordRequest};
use lumiris::photons::{
    GatherPoint, GatherScratch, Importance, ImportanceSettings, LowImportance, Photon, PhotonBudget, PhotonError,
    PhotonMap, Search, Traced, Tracing, path_count, trace_importons, trace_photons,
};
use lumiris::scene::RenderJob;
use lumiris::settings::{Cached, IntegratorKind};
use lumiris_numbers::estimators::stats::{Welford, sidak, t_test, two_sample_z_test};
use lumiris_numbers::math::{Frame, Rgb, Vec3};
use lumiris_test_support::random::{RngExt, pcg32};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Probability that a test fails by chance.
const SIGNIFICANCE: f64 = 1e-4;
/// Relative rounding error where there is no noise.
const ROUNDING: f64 = 5e-4;

/// A closed box of side 4 about the origin. Its walls of albedo 0.5, 0.25, 0.75 emit 0.5 inwards. It contains `things`.
fn furnace(things: &str) -> String {
    let mut text = "Camera \"perspective\"\nWorldBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ 0.5 0.25 0.75 ]\nAttributeBegin\n\
        AreaLightSource \"diffuse\" \"rgb L\" [ 0.5 0.5 0.5 ]\n"
        .to_owned();
    for wall in [
        "-2 -2 -2  2 -2 -2  2 2 -2  -2 2 -2",
        "-2 -2 2  -2 2 2  2 2 2  2 -2 2",
        "-2 -2 -2  -2 2 -2  -2 2 2  -2 -2 2",
        "2 -2 -2  2 -2 2  2 2 2  2 2 -2",
        "-2 -2 -2  -2 -2 2  2 -2 2  2 -2 -2",
        "-2 2 -2  2 2 -2  2 2 2  -2 2 2",
    ] {
        text += &format!("Shape \"trianglemesh\" \"point3 P\" [ {wall} ] \"integer indices\" [ 0 1 2 0 2 3 ]\n");
    }
    text + "AttributeEnd\n" + things
}

fn trace(job: &RenderJob, tracing: &Tracing<'_>, count: u64) -> Traced {
    trace_photons(job, tracing, None, PhotonBudget::Paths(count)).unwrap()
}

fn both(traced: &Traced) -> Vec<Photon> {
    traced.global.iter().chain(&traced.caustic).copied().collect()
}

fn assert_mean(values: &Welford, expected: f64, what: &str) {
    let near = (values.mean() - expected).abs() <= ROUNDING * expected.abs();
    assert!(
        near || t_test(values, expected).p_value > SIGNIFICANCE,
        "{what}: {} ± {}, not {expected}",
        values.mean(),
        values.standard_error()
    );
}

fn channels(rgb: Rgb) -> [f64; 3] {
    rgb.to_array().map(f64::from)
}

/// Irradiance at a point over seeds, by channel.
fn irradiances(runs: u32, place: &GatherPoint, search: Search, photons: impl Fn(u32) -> Vec<Photon>) -> [Welford; 3] {
    let mut e = [Welford::default(); 3];
    for seed in 0..runs {
        let map = PhotonMap::new(photons(seed));
        let value = map.irradiance(place, search, &mut GatherScratch::default());
        e.iter_mut().zip(channels(value)).for_each(|(e, value)| e.add(value));
    }
    e
}

#[test]
fn energy_is_kept_at_every_bounce() {
    let job = world_of(&furnace(""), |_| ());
    // π L A through all walls
    let flux = PI * 0.5 * 96.0;
    let mut sums: [[Welford; 3]; 2] = Default::default();
    for seed in 0..10 {
        for (depth, sums) in [0, 3].into_iter().zip(&mut sums) {
            let traced = trace(&job, &Tracing { seed, max_depth: depth, ..Tracing::default() }, 20_000);
            assert!(traced.caustic.is_empty());
            let mut sum = [0.0; 3];
            for photon in &traced.global {
                sum.iter_mut().zip(channels(photon.power())).for_each(|(sum, power)| *sum += power);
            }
            sums.iter_mut().zip(sum).for_each(|(w, sum)| w.add(sum));
        }
    }
    for (c, rho) in [0.5_f64, 0.25, 0.75].into_iter().enumerate() {
        assert_mean(&sums[0][c], flux, "primary photons");
        let series: f64 = (0..=3).map(|k| rho.powi(k)).sum();
        assert_mean(&sums[1][c], flux * series, "photons of four bounces");
    }
}

#[test]
fn a_furnace_has_its_irradiance_whatever_lossless_things_stand_in_it() {
    // In equilibrium L = 0.5/(1 − ρ) everywhere
    for (name, things) in [
        ("nothing", ""),
        ("glass", "Material \"dielectric\" Translate 0.2 -0.9 0.1 Shape \"sphere\" \"float radius\" [ 0.9 ]\n"),
        (
            "a mirror",
            "Material \"conductor\" \"rgb reflectance\" [ 1 1 1 ] \"float roughness\" [ 0 ] Translate 0.2 -0.9 0.1 Shape \"sphere\" \"float radius\" [ 0.9 ]\n",
        ),
        (
            "thin glass",
            "Material \"thindielectric\" Shape \"trianglemesh\" \"point3 P\" [ -2 -1.5 -2  2 -1.5 -2  2 -1.2 2  -2 -1.2 2 ] \"integer indices\" [ 0 1 2 0 2 3 ]\n",
        ),
        ("no surface", "Material \"interface\" Translate 0.2 -0.9 0.1 Shape \"sphere\" \"float radius\" [ 0.9 ]\n"),
    ] {
        let job = world_of(&furnace(things), |_| ());
        let place = GatherPoint::flat(Vec3::new(0.1, -2.0, 0.2), Vec3::Y);
        let tracing = |seed| Tracing { seed, max_depth: 80, ..Tracing::default() };
        let e = irradiances(12, &place, Search::Radius(0.5), |seed| both(&trace(&job, &tracing(seed), 20_000)));
        for (c, rho) in [0.5, 0.25, 0.75].into_iter().enumerate() {
            assert!(e[c].standard_error() < 0.05 * e[c].mean(), "{name}: the test can tell");
            assert_mean(&e[c], PI * 0.5 / (1.0 - rho), name);
        }
        let traced = trace(&job, &tracing(0), 20_000);
        let scatters = ["glass", "a mirror", "thin glass"].contains(&name);
        assert_eq!(traced.caustic.is_empty(), !scatters, "{name}");
        assert!(traced.caustic.iter().all(Photon::is_caustic) && !traced.global.iter().any(Photon::is_caustic));
    }
}

/// A request for the path-traced irradiance at a point.
fn wanted(p: Vec3, n: Vec3) -> RecordRequest {
    RecordRequest {
        p,
        p_error: Vec3::splat(1e-6),
        n,
        ns: n,
        time: 0.5,
        pixel_width: 0.0,
        spread: 0.0,
        pixel: [0, 0],
        key: 7,
    }
}

/// The mean over seeds of the path-traced irradiance, weighted by the density-estimation kernel of radius `radius`.
fn path_traced(job: &RenderJob, (p, n): (Vec3, Vec3), radius: f32, key: u32) -> [Welford; 3] {
    // Each group is a grid of strata over the kernel
    const GROUPS: u32 = 24;
    const GRID: u32 = 8;
    let (frame, mut stream) = (Frame::from_z(n), pcg32([3, 1, key]));
    let mut e = [Welford::default(); 3];
    for group in 0..GROUPS {
        let place = |cell: u32| {
            let [u, v] = stream.random::<[f32; 2]>();
            let (u, v) = (((cell % GRID) as f32 + u) / GRID as f32, ((cell / GRID) as f32 + v) / GRID as f32);
            // Density 2/(πr²) (1 − d²/r²): d²/r² = 1 − √(1 − u)
            let (d, phi) = (radius * (1.0 - (1.0 - u).sqrt()).sqrt(), std::f32::consts::TAU * v);
            let p = p + frame.to_world(Vec3::new(d * phi.cos(), d * phi.sin(), 0.0));
            RecordRequest { key: group * GRID * GRID + cell, ..wanted(p, n) }
        };
        let places: Vec<RecordRequest> = (0..GRID * GRID).map(place).collect();
        let records = Gatherer::default().records(job, &places);
        for (c, e) in e.iter_mut().enumerate() {
            e.add(records.iter().map(|r| channels(r.light.e)[c]).sum::<f64>() / f64::from(GRID * GRID));
        }
    }
    e
}

#[test]
fn photons_agree_with_path_tracing_among_many_materials() {
    // Both have the same expectation, the mean over the kernel, and measured standard errors
    let depth = 8;
    let job = world_of(ROOM, |s| {
        s.integrator.kind = IntegratorKind::IrradianceCache;
        s.integrator.cache.cached = Cached::All;
        s.integrator.cache.samples = 64;
        s.integrator.cache.passes = 4;
        s.integrator.max_depth = depth;
    });
    // Name, point, normal, radius of the kernel (which ends at edges), and detectable difference
    let places = [
        ("the floor", Vec3::new(-0.1, 0.0, 0.5), Vec3::Y, 0.3, 0.04),
        ("the red wall", Vec3::new(-1.0, 1.3, -0.3), Vec3::X, 0.3, 0.04),
        ("the coated wall", Vec3::new(0.2, 1.1, -1.0), Vec3::Z, 0.3, 0.04),
        ("the ceiling", Vec3::new(0.85, 2.0, 0.3), -Vec3::Y, 0.14, 0.18),
    ];
    let maps: Vec<PhotonMap> = (0..24)
        .map(|seed| {
            let tracing = Tracing { seed, max_depth: depth - 1, ..Tracing::default() };
            PhotonMap::new(both(&trace(&job, &tracing, 100_000)))
        })
        .collect();
    let level = sidak(1e-3, 3 * places.len());
    for (key, (name, p, n, radius, found)) in (0..).zip(places) {
        let expected = path_traced(&job, (p, n), radius, key);
        let mut e = [Welford::default(); 3];
        for map in &maps {
            let value = map.irradiance(&GatherPoint::flat(p, n), Search::Radius(radius), &mut GatherScratch::default());
            e.iter_mut().zip(channels(value)).for_each(|(e, value)| e.add(value));
        }
        for (c, (e, expected)) in e.iter().zip(&expected).enumerate() {
            let error = e.standard_error().hypot(expected.standard_error());
            let what = format!("{name}, channel {c}: {} by photons, {} by paths, ± {error}", e.mean(), expected.mean());
            // The level is at 3.9 standard errors, so differences of 6.3 are detected with a probability of 0.99
            assert!(6.3 * error < found * expected.mean(), "a difference of {found} might be missed: {what}");
            assert!(two_sample_z_test(e, expected).p_value > level, "{what}");
        }
    }
}

#[test]
fn inside_glass_light_is_denser_by_the_square_of_the_index() {
    // A white ball inside a glass ball absorbs no light: L = 1.5² · 0.5/(1 − ρ) around it
    let things = "Translate 0.2 -0.9 0.1\nMaterial \"dielectric\"\nShape \"sphere\" \"float radius\" [ 0.9 ]\n\
        Material \"diffuse\" \"rgb reflectance\" [ 1 1 1 ]\nShape \"sphere\" \"float radius\" [ 0.6 ]\n";
    let job = world_of(&furnace(things), |_| ());
    let place = GatherPoint::flat(Vec3::new(0.2, -0.3, 0.1), Vec3::Y);
    let tracing = |seed| Tracing { seed, max_depth: 150, ..Tracing::default() };
    let e = irradiances(12, &place, Search::Radius(0.25), |seed| both(&trace(&job, &tracing(seed), 20_000)));
    for (c, rho) in [0.5, 0.25, 0.75].into_iter().enumerate() {
        assert!(e[c].standard_error() < 0.1 * e[c].mean(), "the test can tell");
        assert_mean(&e[c], 2.25 * PI * 0.5 / (1.0 - rho), "inside glass");
    }
}

#[test]
fn shading_normals_reflect_photons_as_they_reflect_light() {
    // A spot lights a part of an upright wall whose shading normals tilt up. The floor gets light only from there
    const WALL: &str = r#"
Camera "perspective"
WorldBegin
LightSource "spot" "rgb I" [ 10 10 10 ] "point3 from" [ 2 1 0 ] "point3 to" [ 0 1 0 ] "float coneangle" [ 14 ]
Material "diffuse" "rgb reflectance" [ 0.8 0.8 0.8 ]
Shape "trianglemesh" "point3 P" [ -3 0 -3  3 0 -3  3 0 3  -3 0 3 ] "integer indices" [ 0 1 2 0 2 3 ]
Shape "trianglemesh" "point3 P" [ 0 0 -1  0 2 -1  0 2 1  0 0 1 ] "integer indices" [ 0 1 2 0 2 3 ]
  "normal N" [ 0.8 0.6 0  0.8 0.6 0  0.8 0.6 0  0.8 0.6 0 ]
"#;
    let job = world_of(WALL, |s| {
        s.integrator.kind = IntegratorKind::IrradianceCache;
        s.integrator.cache.cached = Cached::All;
        s.integrator.cache.samples = 65_536;
        s.integrator.max_depth = 2;
    });
    let (p, n) = (Vec3::new(1.0, 0.0, 0.1), Vec3::Y);
    let [record] = Gatherer::default().records(&job, &[wanted(p, n)])[..] else { panic!("one record") };
    let tracing = |seed| Tracing { seed, max_depth: 1, ..Tracing::default() };
    let search = Search::Radius(0.2);
    let e = irradiances(12, &GatherPoint::flat(p, n), search, |seed| trace(&job, &tracing(seed), 700_000).global);
    let expected = f64::from(record.light.e.g);
    let bound = 4.0 * e[1].standard_error() + 0.02 * expected;
    assert!(bound < 0.08 * expected, "the test can tell");
    assert!((e[1].mean() - expected).abs() < bound, "{}, not {expected} ± {bound}", e[1].mean());
}

/// A floor below a glass ball, with a light that shines up or down.
fn ball(light: &str) -> String {
    "Camera \"perspective\"\nWorldBegin\n".to_owned()
        + light
        + r#"
Material "diffuse" "rgb reflectance" [ 0.8 0.8 0.8 ]
Shape "trianglemesh" "point3 P" [ -3 0 -3  3 0 -3  3 0 3  -3 0 3 ] "integer indices" [ 0 1 2 0 2 3 ]
Shape "trianglemesh" "point3 P" [ -3 4 -3  3 4 -3  3 4 3  -3 4 3 ] "integer indices" [ 0 1 2 0 2 3 ]
Material "dielectric" Translate 0 1.05 0 Shape "sphere" "float radius" [ 0.7 ]
"#
}

#[test]
fn caustics_come_from_direct_and_from_indirect_light() {
    let below = GatherPoint::flat(Vec3::ZERO, Vec3::Y);
    let mut scratch = GatherScratch::default();
    let tracing = Tracing { max_depth: 6, ..Tracing::default() };

    // A light above the ball: the floor below is brighter than without the ball
    let lit = ball("LightSource \"point\" \"rgb I\" [ 10 10 10 ] \"point3 from\" [ 0 3.5 0 ]\n");
    let direct = trace(&world_of(&lit, |_| ()), &tracing, 100_000);
    let e = PhotonMap::new(direct.caustic).irradiance(&below, Search::Radius(0.1), &mut scratch).g;
    assert!(e > 2.0 * 10.0 / (3.5 * 3.5), "{e}");
    // No light of the global map passes through the ball
    let shadow = PhotonMap::new(direct.global.iter().filter(|p| p.is_primary()).copied().collect());
    assert_eq!(shadow.irradiance(&below, Search::Radius(0.1), &mut scratch), Rgb::BLACK);

    // A spot that lights only the ceiling
    let up = ball(
        "LightSource \"spot\" \"rgb I\" [ 100 100 100 ] \"point3 from\" [ 0 2.5 0 ] \"point3 to\" [ 0 4 0 ] \"float coneangle\" [ 20 ]\n",
    );
    let indirect = trace(&world_of(&up, |_| ()), &tracing, 100_000);
    assert!(indirect.global.iter().filter(|p| p.is_primary()).all(|p| p.p().y > 3.9));
    let map = PhotonMap::new(indirect.caustic);
    let at = |x: f32| GatherPoint::flat(Vec3::new(x, 0.0, 0.0), Vec3::Y);
    let e = |x: f32, scratch: &mut GatherScratch| map.irradiance(&at(x), Search::Radius(0.15), scratch).g;
    assert!(e(0.0, &mut scratch) > 10.0 * e(2.0, &mut scratch) && e(0.0, &mut scratch) > 0.0);
}

#[test]
fn a_global_map_of_some_of_the_photon_paths_is_the_same_on_average() {
    let job = world_of(ROOM, |_| ());
    let place = GatherPoint::flat(Vec3::new(0.4, 0.0, 0.5), Vec3::Y);
    let (q, count) = (0.2, 40_000);
    let of = |q| {
        let run = |seed| trace(&job, &Tracing { seed, q, max_depth: 5, ..Tracing::default() }, count);
        let search = Search::Radius(0.3);
        let global = irradiances(12, &place, search, |seed| run(seed).global);
        let caustic = irradiances(12, &place, search, |seed| run(seed).caustic);
        (global, caustic, run(0))
    };
    let (reference, thinned) = (of(1.0), of(q));
    for c in 0..3 {
        for (a, b) in [(&reference.0, &thinned.0), (&reference.1, &thinned.1)] {
            let test = two_sample_z_test(&a[c], &b[c]);
            assert!(test.p_value > SIGNIFICANCE, "{c}: {} {}", a[c].mean(), b[c].mean());
        }
    }
    // The caustic map stores all photon paths, the global map a fraction q of them
    assert_eq!(thinned.2.caustic.len(), reference.2.caustic.len());
    let share = thinned.2.global.len() as f64 / reference.2.global.len() as f64;
    assert!((share / f64::from(q) - 1.0).abs() < 0.03, "{share}");
}

/// Two rooms connected by a slit. The camera sees the floor of the left one; the light is in the right one or in both.
const ROOMS: &str = r#"
LookAt -1 1.9 0  -1 0 0  0 0 1
Camera "perspective" "float fov" [ 60 ]
Film "rgb" "integer xresolution" [ 16 ] "integer yresolution" [ 16 ]
WorldBegin
LightSource "point" "rgb I" [ 5 4 3 ] "point3 from" [ 1 1.5 0 ]
LightSource "point" "rgb I" [ 1 1 1 ] "point3 from" [ -1.5 1.5 0.5 ]
Material "diffuse" "rgb reflectance" [ 0.7 0.6 0.5 ]
Shape "trianglemesh" "point3 P" [ -2 0 -1  2 0 -1  2 0 1  -2 0 1 ] "integer indices" [ 0 1 2 0 2 3 ]
Shape "trianglemesh" "point3 P" [ -2 2 -1  2 2 -1  2 2 1  -2 2 1 ] "integer indices" [ 0 1 2 0 2 3 ]
Shape "trianglemesh" "point3 P" [ -2 0 -1  2 0 -1  2 2 -1  -2 2 -1 ] "integer indices" [ 0 1 2 0 2 3 ]
Shape "trianglemesh" "point3 P" [ -2 0 1  2 0 1  2 2 1  -2 2 1 ] "integer indices" [ 0 1 2 0 2 3 ]
Shape "trianglemesh" "point3 P" [ -2 0 -1  -2 2 -1  -2 2 1  -2 0 1 ] "integer indices" [ 0 1 2 0 2 3 ]
Shape "trianglemesh" "point3 P" [ 2 0 -1  2 2 -1  2 2 1  2 0 1 ] "integer indices" [ 0 1 2 0 2 3 ]
Shape "trianglemesh" "point3 P" [ 0 0 -1  0 2 -1  0 2 0.7  0 0 0.7 ] "integer indices" [ 0 1 2 0 2 3 ]
"#;

fn importance(job: &RenderJob, low_importance: LowImportance) -> Importance {
    let settings = ImportanceSettings { paths: 20_000, low_importance, ..ImportanceSettings::default() };
    trace_importons(job, &settings).unwrap()
}

#[test]
fn importance_moves_photons_to_what_is_seen_and_keeps_their_light() {
    let job = world_of(ROOMS, |_| ());
    let tracing = |seed| Tracing { seed, max_depth: 4, q: 0.5, ..Tracing::default() };
    let (count, runs) = (30_000, 20);
    let by = |importance: Option<&Importance>, seed| {
        trace_photons(&job, &tracing(seed), importance, PhotonBudget::Paths(count)).unwrap()
    };
    let floor = importance(&job, LowImportance::Floor(0.02));
    assert!(floor.is_unbiased() && !importance(&job, LowImportance::CutOff(0.02)).is_unbiased());

    // The same expected light at visible and hidden points
    let seen = GatherPoint::flat(Vec3::new(-1.0, 0.0, 0.2), Vec3::Y);
    let hidden = GatherPoint::flat(Vec3::new(1.2, 0.0, -0.3), Vec3::Y);
    for place in [seen, hidden] {
        let plain = irradiances(runs, &place, Search::Radius(0.3), |seed| by(None, seed).global);
        let thinned = irradiances(runs, &place, Search::Radius(0.3), |seed| by(Some(&floor), 100 + seed).global);
        for c in 0..3 {
            let test = two_sample_z_test(&plain[c], &thinned[c]);
            assert!(test.p_value > SIGNIFICANCE, "{} {}", plain[c].mean(), thinned[c].mean());
        }
    }

    // Visible points keep the number and power of their photons, hidden points have few
    let mut scratch = GatherScratch::default();
    assert!(floor.probability(seen.p, seen.n, &mut scratch) > 0.9);
    assert!(floor.probability(hidden.p, hidden.n, &mut scratch) < 0.2);
    let (plain, thinned) = (by(None, 0), by(Some(&floor), 0));
    let count = |traced: &Traced, side: f32| traced.global.iter().filter(|p| p.p().x * side > 0.0).count() as f64;
    let kept = |side| count(&thinned, side) / count(&plain, side);
    assert!(kept(-1.0) > 0.5 && kept(1.0) < 0.4 * kept(-1.0), "{} {}", kept(-1.0), kept(1.0));

    // With a cutoff, photons are missing and none is strong
    let cut = by(Some(&importance(&job, LowImportance::CutOff(0.2))), 0);
    assert!(cut.stored() < plain.stored());
    let strongest = |traced: &Traced| traced.global.iter().map(|p| p.power().r).fold(0.0, f32::max);
    assert!(strongest(&cut) < 5.1 * strongest(&plain));
}

/// The light of maps of about `k` photons relative to the expected `power`, and the number of empty maps. Each group of
/// 32 maps has one pilot, like the passes of an image.
fn relative_light(job: &RenderJob, k: u64, maps: u32, power: f64) -> (Welford, u32) {
    // Relative light of 32 maps with one pilot
    let group = |pilot: u32| {
        let (mut light, mut empty) = (Welford::new(), 0);
        let tracing = |seed| Tracing { seed, max_depth: 60, max_global_depth: 60, ..Tracing::default() };
        let budget = PhotonBudget::Stored { global: k, max_paths: 1 << 20 };
        let count = path_count(job, &tracing(pilot), None, budget).unwrap();
        for seed in 32 * pilot..32 * (pilot + 1) {
            let traced = trace(job, &tracing(seed), count);
            assert_eq!((traced.paths, traced.global_paths), (count, count));
            light.add(traced.global.iter().map(|p| f64::from(p.power().g)).sum::<f64>() / power);
            empty += u32::from(traced.global.is_empty());
        }
        (light, empty)
    };

    // Merge the groups
    let groups: Vec<(Welford, u32)> = (0..maps.div_ceil(32)).into_par_iter().map(group).collect();
    groups.into_iter().fold((Welford::new(), 0), |(mut all, empty), (light, more)| {
        all.merge(&light);
        (all, empty + more)
    })
}

#[test]
fn maps_of_few_photons_have_all_the_light_and_no_more() {
    // Tracing that ends at photon k has 17 % too much light with k = 4, and 1 % with k = 100
    let grey = furnace("").replace("[ 0.5 0.25 0.75 ]", "[ 0.5 0.5 0.5 ]");
    let job = world_of(&grey, |_| ());
    for k in [4, 16, 100, 1000] {
        // A path stores two photons on average with a variance of 2, so the relative variance of a map is 1/k
        let maps = (1.2 / (k as f64 * 0.003 * 0.003)) as u32;
        let (light, _) = relative_light(&job, k, maps, PI * 0.5 * 96.0 / (1.0 - 0.5));
        let sigma = light.standard_error();
        assert!(sigma <= 0.003, "{k} photons: ± {sigma}");
        assert!((light.mean() - 1.0).abs() <= 3.0 * sigma, "{k} photons: {} ± {sigma}", light.mean());
    }
}

#[test]
fn an_empty_map_counts_as_no_light() {
    // A sixth of the light falls on the only wall
    const WALL: &str = "Camera \"perspective\"\nWorldBegin\nLightSource \"point\" \"rgb I\" [ 3 3 3 ]\n\
        Shape \"trianglemesh\" \"point3 P\" [ -1 -1 1  1 -1 1  1 1 1  -1 1 1 ] \"integer indices\" [ 0 1 2 0 2 3 ]\n";
    let job = world_of(WALL, |_| ());
    let (light, empty) = relative_light(&job, 1, 12_000, 3.0 * 4.0 * PI / 6.0);
    // 28 % for independent paths; the strata of a sequence leave fewer
    assert!(empty > 1_000, "{empty} maps are empty");
    let sigma = light.standard_error();
    assert!(sigma <= 0.01 && (light.mean() - 1.0).abs() <= 3.0 * sigma, "{} ± {sigma}", light.mean());
}

#[test]
fn a_pilot_says_how_many_paths_store_as_many_photons_as_requested() {
    let job = world_of(ROOM, |_| ());
    let tracing = Tracing { q: 0.25, max_depth: 4, ..Tracing::default() };
    let budget = PhotonBudget::Stored { global: 20_000, max_paths: 10_000_000 };
    let traced = trace_photons(&job, &tracing, None, budget).unwrap();
    assert_eq!(path_count(&job, &tracing, None, budget), Ok(traced.paths));

    // The pilot stores 2500 photons. Paths of 1 to 5 photons at albedos of 0.4 to 0.8 give their number at most the
    // variance of 2500/5 independent ones: 5 standard deviations
    let off = traced.global.len() as f64 / 20_000.0 - 1.0;
    assert!(off.abs() < 5.0 * (5.0_f64 / 2500.0 + 5.0 / 20_000.0).sqrt(), "{off}");
    let again = trace(&job, &tracing, traced.paths);
    assert_eq!((again.global, again.caustic), (traced.global, traced.caustic));
    let budget = PhotonBudget::Stored { global: u64::MAX, max_paths: 5000 };
    let traced = trace_photons(&job, &Tracing::default(), None, budget).unwrap();
    assert_eq!((traced.paths, traced.global_paths), (5000, 5000));
}

#[test]
fn photons_are_the_same_for_any_number_of_threads() {
    let job = world_of(ROOM, |_| ());
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let importance = importance(&job, LowImportance::Floor(0.05));
            let tracing = Tracing { q: 0.3, max_depth: 5, ..Tracing::default() };
            let budget = PhotonBudget::Stored { global: 30_000, max_paths: 1_000_000 };
            trace_photons(&job, &tracing, Some(&importance), budget).unwrap()
        })
    };
    let one = run(1);
    assert!(one.caustic.len() > 1000);
    for threads in [2, 3] {
        let other = run(threads);
        assert_eq!((&other.global, &other.caustic), (&one.global, &one.caustic), "{threads} threads");
        assert_eq!(other.paths, one.paths);
    }
}

#[test]
fn what_cannot_be_traced_is_said() {
    const FLOOR: &str =
        "Shape \"trianglemesh\" \"point3 P\" [ -1 0 -1  1 0 -1  1 0 1  -1 0 1 ] \"integer indices\" [ 0 1 2 0 2 3 ]\n";
    let scene =
        |light: &str, things: &str| world_of(&format!("Camera \"perspective\"\nWorldBegin\n{light}{things}"), |_| ());
    let some = PhotonBudget::Paths(1000);
    let error = |job: &RenderJob, tracing: &Tracing<'_>, budget| trace_photons(job, tracing, None, budget).unwrap_err();
    let tracing = Tracing::default();
    let lamp = "LightSource \"point\" \"point3 from\" [ 0 1 0 ]\n";

    assert_eq!(error(&scene("", FLOOR), &tracing, some), PhotonError::NoLight);
    let black = "LightSource \"point\" \"rgb I\" [ 0 0 0 ]\n";
    assert_eq!(error(&scene(black, FLOOR), &tracing, some), PhotonError::NoEmission);
    let lit = scene(lamp, FLOOR);
    assert_eq!(error(&lit, &tracing, PhotonBudget::Paths(0)), PhotonError::NothingRequested);
    assert_eq!(error(&lit, &tracing, PhotonBudget::Stored { global: 0, max_paths: 9 }), PhotonError::NothingRequested);
    for q in [0.0, 1.5, f32::NAN] {
        assert!(matches!(error(&lit, &Tracing { q, ..tracing }, some), PhotonError::InvalidRatio(_)));
    }

    // No hits, or none on diffuse surfaces: a map without photons, and no endless loop where photons are counted
    let mirror = format!("Material \"conductor\"\n{FLOOR}");
    for things in ["", &mirror] {
        let empty = trace_photons(&scene(lamp, things), &tracing, None, some).unwrap();
        assert_eq!((empty.stored(), empty.paths), (0, 1000));
        let tracing = Tracing { max_in_pilot: 300_000, ..tracing };
        let budget = PhotonBudget::Stored { global: 10, max_paths: u64::MAX };
        let none = PhotonError::NothingStored { paths: 300_000, by_importance: false };
        assert_eq!(error(&scene(lamp, things), &tracing, budget), none);
    }
    let tight = Tracing { memory: Some(100_000), ..tracing };
    assert!(matches!(error(&lit, &tight, PhotonBudget::Paths(1_000_000)), PhotonError::OutOfMemory { .. }));

    // A camera without any hit: the floor is behind it
    let blind = trace_importons(&scene("Scale 1 1 1\n", "Translate 0 -1 -5 \n"), &ImportanceSettings::default());
    assert_eq!(blind.unwrap_err(), PhotonError::CameraSeesNothing);
}

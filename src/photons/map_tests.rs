use super::{GatherPoint, GatherScratch, Origin, Photon, PhotonMap, Search};
use lumiris_numbers::estimators::stats::{Welford, t_test};
use lumiris_numbers::math::warp::{sample_cosine_hemisphere, sample_uniform_sphere};
use lumiris_numbers::math::{Frame, Rgb, Vec3};
use lumiris_test_support::random::{Pcg32, RngExt, pcg32};
use std::time::{Duration, Instant};

/// Photons of constant density on the square |x|, |z| ≤ 1 of the plane y = height, by a Poisson process of `mean`
/// photons, which together carry 4 W: an irradiance of 1 W/m² on average.
fn plane(mean: f64, height: f32, n: Vec3, stream: &mut Pcg32) -> Vec<Photon> {
    // Sum of exponential gaps
    let mut photons = Vec::new();
    let mut t = 0.0;
    loop {
        t -= (1.0 - f64::from(stream.random::<f32>())).ln();
        if t > mean {
            return photons;
        }
        let [u, v] = stream.random::<[f32; 2]>();
        let p = Vec3::new(2.0 * u - 1.0, height, 2.0 * v - 1.0);
        let wi = Frame::from_z(n).to_world(sample_cosine_hemisphere(stream.random::<[f32; 2]>()));
        photons.push(Photon::new(p, wi, n, Rgb::splat((4.0 / mean) as f32), Origin::Diffuse));
    }
}

fn searches() -> [Search; 5] {
    [
        Search::Radius(0.2),
        Search::Nearest { count: 5, max_radius: 0.5 },
        Search::Nearest { count: 20, max_radius: 0.5 },
        // About as many photons as the largest disk holds, so that both cases occur
        Search::Nearest { count: 13, max_radius: 0.2 },
        Search::Nearest { count: 60, max_radius: f32::INFINITY },
    ]
}

#[test]
fn the_irradiance_of_even_photons_is_exact_on_average() {
    for (i, search) in searches().into_iter().enumerate() {
        let mut stream = pcg32([1, i as u32, 77]);
        let mut estimates = Welford::default();
        for _ in 0..3000 {
            let map = PhotonMap::new(plane(400.0, 0.0, Vec3::Y, &mut stream));
            let at = GatherPoint::flat(Vec3::new(0.1, 0.0, -0.05), Vec3::Y);
            estimates.add(f64::from(map.irradiance(&at, search, &mut GatherScratch::default()).g));
        }
        let test = t_test(&estimates, 1.0);
        assert!(test.p_value > 1e-4, "{search:?} {} ± {}", estimates.mean(), estimates.standard_error());
        assert!(estimates.standard_error() < 0.03, "the test can tell");
    }
}

#[test]
fn a_thin_wall_that_is_lit_on_one_side_is_black_on_the_other() {
    let mut stream = pcg32([1, 2, 78]);
    let photons = plane(4000.0, 0.0, Vec3::Y, &mut stream);
    let map = PhotonMap::new(photons);
    let mut scratch = GatherScratch::default();
    for search in searches() {
        for depth in [0.0, 1e-5, 1e-3, 0.02] {
            let behind = GatherPoint::flat(Vec3::new(0.0, -depth, 0.0), -Vec3::Y);
            assert_eq!(map.irradiance(&behind, search, &mut scratch), Rgb::BLACK, "{search:?}");
        }
        let lit = GatherPoint::flat(Vec3::ZERO, Vec3::Y);
        assert!(map.irradiance(&lit, search, &mut scratch).g > 0.05);
    }
}

#[test]
fn photons_off_the_tangent_plane_and_of_other_normals_do_not_count() {
    let mut scratch = GatherScratch::default();
    for (p, n, counts) in [
        (Vec3::new(0.5, 0.0, 0.0), Vec3::Y, true),
        (Vec3::new(0.5, 0.19, 0.0), Vec3::Y, true),
        (Vec3::new(0.5, 0.26, 0.0), Vec3::Y, false),
        (Vec3::new(0.1, 0.0, 0.0), Vec3::new(0.5, 0.5, 0.0).normalize(), false),
        (Vec3::new(0.1, 0.0, 0.0), Vec3::new(0.2, 0.5, 0.0).normalize(), true),
    ] {
        let map = PhotonMap::new(vec![Photon::new(p, n, n, Rgb::WHITE, Origin::Diffuse)]);
        let at = GatherPoint::flat(Vec3::ZERO, Vec3::Y);
        let e = map.irradiance(&at, Search::Radius(1.0), &mut scratch).g;
        assert_eq!(e > 0.0, counts, "{p} {n}");
    }
    // Light from below the horizon of the point, although the photon's own surface faces it
    let n = Vec3::new(0.5, 1.0, 0.0).normalize();
    let photon = Photon::new(Vec3::ZERO, Vec3::new(1.0, -0.1, 0.0).normalize(), n, Rgb::WHITE, Origin::Diffuse);
    let map = PhotonMap::new(vec![photon]);
    assert_eq!(map.irradiance(&GatherPoint::flat(Vec3::ZERO, Vec3::Y), Search::Radius(1.0), &mut scratch), Rgb::BLACK);
}

#[test]
fn irradiance_is_about_the_shading_normal() {
    // Uniform light from the hemisphere of y: about a normal tilted by θ, E/E_flat = (1 + cos θ)/2
    let mut stream = pcg32([1, 4, 79]);
    let map = PhotonMap::new(plane(400_000.0, 0.0, Vec3::Y, &mut stream));
    let ns = Vec3::new(0.6, 0.8, 0.0);
    let at = GatherPoint { p: Vec3::ZERO, n: Vec3::Y, ns };
    let e = map.irradiance(&at, Search::Radius(0.8), &mut GatherScratch::default()).g;
    // About 2·10⁵ photons, weighted by the kernel and the ratio of cosines
    assert!((e - 0.9).abs() < 0.015, "{e}");
}

#[test]
fn searches_find_what_a_scan_finds() {
    let mut stream = pcg32([1, 5, 80]);
    let photons: Vec<Photon> = (0..5000)
        .map(|i| {
            let on_sphere = sample_uniform_sphere(stream.random::<[f32; 2]>());
            let p = if i % 2 == 0 { on_sphere } else { Vec3::new(on_sphere.x, 0.25, 0.5) };
            Photon::new(p, Vec3::Y, Vec3::Y, Rgb::splat(1.0 + i as f32), Origin::Diffuse)
        })
        .collect();
    let map = PhotonMap::new(photons.clone());
    assert_eq!(map.len(), 5000);
    let mut scratch = GatherScratch::default();
    for i in 0..200 {
        let q = photons[i * 13].p() + sample_uniform_sphere(stream.random::<[f32; 2]>()) * (0.01 * (i % 3) as f32);
        let at = GatherPoint::flat(q, Vec3::Y);
        let mut distances: Vec<f32> =
            photons.iter().map(|p| (p.p() - q).length_squared().max(16.0 * (p.p() - q).y.powi(2))).collect();
        distances.sort_by(f32::total_cmp);
        let radius = map.gather(&at, Search::Nearest { count: 40, max_radius: 9.0 }, &mut scratch, |_, _| ());
        assert!((radius - distances[39].sqrt()).abs() <= 1e-5 * radius, "{radius} {}", distances[39].sqrt());
        let mut found = 0;
        map.gather(&at, Search::Radius(radius), &mut scratch, |_, _| found += 1);
        let strictly_inside = distances.iter().filter(|&&d| d < radius * radius * (1.0 - 1e-5)).count();
        let inside = distances.iter().filter(|&&d| d < radius * radius * (1.0 + 1e-5)).count();
        assert!((strictly_inside..=inside).contains(&found), "{strictly_inside} {found} {inside}");
    }
}

#[test]
fn nearest_photons_and_a_radius_agree() {
    let mut stream = pcg32([1, 6, 81]);
    let map = PhotonMap::new(plane(200_000.0, 0.0, Vec3::Y, &mut stream));
    let mut scratch = GatherScratch::default();
    for i in 0..20 {
        let at = GatherPoint::flat(Vec3::new(0.03 * i as f32, 0.0, -0.2), Vec3::Y);
        let near = map.irradiance(&at, Search::Nearest { count: 5000, max_radius: 1.0 }, &mut scratch).g;
        let mut radius = 0.0;
        radius += map.gather(&at, Search::Nearest { count: 5000, max_radius: 1.0 }, &mut scratch, |_, _| ());
        let within = map.irradiance(&at, Search::Radius(radius), &mut scratch).g;
        assert!((near - within).abs() < 1e-4 && (near - 1.0).abs() < 0.1, "{near} {within}");
    }
}

#[test]
fn a_million_photons_on_a_plane_are_sorted_fast_and_found() {
    let mut stream = pcg32([1, 7, 82]);
    let photons = plane(1e6, 0.0, Vec3::Y, &mut stream);
    let start = Instant::now();
    let map = PhotonMap::new(photons);
    // A second on a loaded machine, even without optimisation ten; a tree that cannot split would take hours
    assert!(start.elapsed() < Duration::from_secs(60), "{:?}", start.elapsed());
    assert!(map.bytes() < 31 * map.len() as u64);
    let mut scratch = GatherScratch::default();
    let search = Search::Nearest { count: 1000, max_radius: 0.5 };
    let e = map.irradiance(&GatherPoint::flat(Vec3::new(0.3, 0.0, 0.4), Vec3::Y), search, &mut scratch).g;
    // σ is about √(4/3/1000) = 0.037
    assert!((e - 1.0).abs() < 0.2, "{e}");
}

#[test]
fn photons_at_one_point_and_no_photons_do_no_harm() {
    let mut scratch = GatherScratch::default();
    let at = GatherPoint::flat(Vec3::ZERO, Vec3::Y);
    let empty = PhotonMap::new(Vec::new());
    assert!(empty.is_empty() && empty.bytes() == 0);
    let one_point = PhotonMap::new(vec![Photon::new(Vec3::ZERO, Vec3::Y, Vec3::Y, Rgb::WHITE, Origin::Diffuse); 1000]);
    for search in searches() {
        assert_eq!(empty.irradiance(&at, search, &mut scratch), Rgb::BLACK);
        assert!(one_point.irradiance(&at, search, &mut scratch).is_finite());
    }
    for search in [Search::Radius(0.0), Search::Radius(f32::NAN), Search::Nearest { count: 0, max_radius: 1.0 }] {
        assert_eq!(one_point.irradiance(&at, search, &mut scratch), Rgb::BLACK);
    }
    // All photons count if the largest disk holds fewer than k
    let e = one_point.irradiance(&at, Search::Nearest { count: 2000, max_radius: 1.0 }, &mut scratch).g;
    assert!((e / (1000.0 * 2.0 / std::f32::consts::PI) - 1.0).abs() < 1e-3, "{e}");
}

#[test]
fn a_map_does_not_depend_on_the_number_of_threads() {
    let mut stream = pcg32([1, 9, 84]);
    let photons = plane(100_000.0, 0.0, Vec3::Y, &mut stream);
    let build = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| PhotonMap::new(photons.clone()))
    };
    let one = build(1);
    for threads in [2, 3] {
        assert_eq!(build(threads).photons(), one.photons());
    }
}

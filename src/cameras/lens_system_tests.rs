use super::*;
use lumiris_test_support::random::{RngExt, pcg32};

/// The double Gauss lens of US patent 2673491 (Tronnier), scaled to 50 mm: mm of radius, thickness, index, diameter.
const DOUBLE_GAUSS: [[f64; 4]; 11] = [
    [29.475, 3.76, 1.67, 25.2],
    [84.83, 0.12, 1.0, 25.2],
    [19.275, 4.025, 1.67, 23.0],
    [40.77, 3.275, 1.699, 23.0],
    [12.75, 5.705, 1.0, 18.0],
    [0.0, 4.5, 0.0, 17.1],
    [-14.495, 1.18, 1.603, 17.0],
    [40.77, 6.065, 1.658, 20.0],
    [-20.385, 0.19, 1.0, 20.0],
    [437.065, 3.22, 1.717, 20.0],
    [-39.73, 5.0, 1.0, 20.0],
];

/// A film of 24 mm × 36 mm.
const DIAGONAL: f64 = 0.0432666;

/// The lens with a stop of the given diameter (mm).
fn elements(stop: f64) -> Vec<LensElement> {
    let of = |[radius, thickness, eta, diameter]: [f64; 4]| LensElement {
        curvature_radius: radius / 1e3,
        thickness: thickness / 1e3,
        eta,
        aperture_radius: 0.5 * (if radius == 0.0 { stop } else { diameter }) / 1e3,
    };
    DOUBLE_GAUSS.into_iter().map(of).collect()
}

fn double_gauss(stop: f64, focus: f64) -> LensSystem {
    LensSystem::new(&elements(stop), Aperture::Circle, focus, DIAGONAL).unwrap()
}

#[test]
fn the_focal_length_is_that_of_the_patent_and_the_film_is_where_points_are_sharp() {
    let lens = double_gauss(17.1, 1.5);
    assert!((lens.focal_length() - 0.05).abs() < 0.0007, "{}", lens.focal_length());
    // Distances from the principal planes obey 1/f = 1/image + 1/object
    let object = 1.0 / (1.0 / lens.focal_length() - 1.0 / lens.image_distance);
    assert!((object / 1.5 - 1.0).abs() < 0.06, "{object}");

    // Rays of a film point meet in the focus plane, with a magnification of image/object
    for focus in [0.6, 1.5, 30.0] {
        let lens = double_gauss(0.5, focus);
        let mut stream = pcg32([1, 2, 3]);
        for film in [Vec2::ZERO, Vec2::new(0.002, -0.001)] {
            let size = lens.image_distance / (1.0 / (1.0 / lens.focal_length() - 1.0 / lens.image_distance));
            let expected = -film.as_dvec2() / size;
            for _ in 0..200 {
                let ray = lens.sample(film, stream.random::<[f32; 2]>());
                let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
                let at = (o + d * ((focus - o.z) / d.z)).truncate();
                assert!((at - expected).length() < 0.002 * focus, "{focus} {film}: {at} {expected}");
            }
        }
    }
}

#[test]
fn samples_have_the_irradiance_of_all_directions() {
    for stop in [17.1, 6.0] {
        let lens = double_gauss(stop, 2.0);
        for film in [Vec2::ZERO, Vec2::new(0.009, 0.004), Vec2::new(-0.015, -0.01)] {
            // ∫ cos⁴θ/s² over the part of the rear plane that transmits light
            let (half, n) = (2.0 * lens.elements[10].aperture_radius, 500);
            let cell = 2.0 * half / f64::from(n);
            let place = |i: i32| (f64::from(i) + 0.5) * cell - half;
            let points =
                (0..n * n).filter_map(|k| lens.through(film.as_dvec2(), DVec2::new(place(k % n), place(k / n))));
            let expected: f64 = points.map(|t| t.form_factor * t.transmission * cell * cell).sum();
            let mut stream = pcg32([4, 5, film.x.to_bits()]);
            let samples = 100_000;
            let of = |_| f64::from(lens.sample(film, stream.random::<[f32; 2]>()).weight);
            let (sum, squares) = (0..samples).map(of).fold((0.0, 0.0), |(s, q), w| (s + w, q + w * w));
            let mean = sum / f64::from(samples);
            let error = ((squares / f64::from(samples) - mean * mean) / f64::from(samples)).sqrt();
            // Tolerance: rounding of the grid at the edge of the pupil, and noise; an error of 2 % would be detected
            assert!((mean / expected - 1.0).abs() < 0.004 + 4.0 * error / expected, "{stop} {film}: {mean} {expected}");
            assert!(error < 0.004 * mean);
            if film == Vec2::ZERO && stop == 17.1 {
                // π/4N² for N = 2, the f-number of the lens, within its own precision
                assert!((mean / (PI / 16.0) - 1.0).abs() < 0.1, "{mean}");
            }
        }
    }
}

#[test]
fn a_film_that_is_turned_sees_turned_rays() {
    let lens = double_gauss(10.0, 2.0);
    let turn = |v: Vec2| Vec2::new(-v.y, v.x);
    let film = Vec2::new(0.012, 0.003);
    for u in [[0.5, 0.5], [0.4, 0.6], [0.02, 0.01]] {
        let (a, b) = (lens.sample(film, u), lens.sample(turn(film), u));
        assert!((turn(a.d.truncate()) - b.d.truncate()).length() < 1e-6 && (a.d.z - b.d.z).abs() < 1e-6);
        assert!((a.weight - b.weight).abs() <= 1e-4 * a.weight.abs(), "{a:?} {b:?}");
    }
    // The image is upside down
    assert!(lens.sample(film, [0.5; 2]).d.x < 0.0);
}

#[test]
fn all_apertures_let_as_much_light_through() {
    let circle = double_gauss(8.0, 2.0);
    let mean = |lens: &LensSystem| {
        let mut stream = pcg32([7, 8, 9]);
        let n = 40_000;
        (0..n).map(|_| f64::from(lens.sample(Vec2::ZERO, stream.random::<[f32; 2]>()).weight)).sum::<f64>()
            / f64::from(n)
    };
    let expected = mean(&circle);
    let image = Aperture::Image(vec![0.0, 1.0, 1.0, 0.2], [2, 2]);
    for aperture in Aperture::NAMES.map(|name| Aperture::named(name).unwrap()).into_iter().chain([image]) {
        let lens = LensSystem::new(&elements(8.0), aperture.clone(), 2.0, DIAGONAL).unwrap();
        let ratio = mean(&lens) / expected;
        assert!((ratio - 1.0).abs() < 0.03, "{aperture:?}: {ratio}");
    }
    assert_eq!(Aperture::named("hexagon"), None);
}

#[test]
fn impossible_lenses_are_errors() {
    let error = |elements: &[LensElement], focus| {
        LensSystem::new(elements, Aperture::Circle, focus, DIAGONAL).map(|_| ()).unwrap_err()
    };
    let right = elements(17.1);
    assert!(error(&[], 1.0).contains("no surfaces"));
    assert!(error(&right, 0.02).contains("focus"), "{}", error(&right, 0.02));
    let change = |i: usize, f: fn(&mut LensElement)| {
        let mut elements = right.clone();
        f(&mut elements[i]);
        elements
    };
    assert!(error(&change(2, |e| e.eta = 0.5), 1.0).contains("surface 3"));
    assert!(error(&change(3, |e| e.aperture_radius = 1.0), 1.0).contains("surface 4"));
    assert!(error(&change(4, |e| e.curvature_radius = 0.0), 1.0).contains("2 aperture stops"));
    assert!(error(&right[5..6], 1.0).contains("focal length"));
}

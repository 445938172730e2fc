//! Media with known images: uniform light, Beer's law, single scattering, coloured glass.

use super::{BOX, assert_answer, camera, choose, cloud, estimators, in_even_light, job, media};
use lumiris::scene::AccelKind;

/// In uniform light, a medium that only scatters is invisible: an environment of radiance 1 around a box of albedo 1,
/// for every medium, phase function and estimator.
#[test]
fn a_medium_that_only_scatters_is_invisible_in_even_light() {
    let mut all = media(1.2, 0.0, "");
    all.push(("cloud", cloud(1.5, 0.0)));
    for (name, medium) in all {
        let mut job = in_even_light(&medium);
        for (estimator, settings) in estimators() {
            choose(&mut job, &settings);
            assert_answer(&mut job, 48, [1.0; 3], 0.13, &format!("{name}, {estimator}"));
        }
    }
}

/// A medium that emits as much as it absorbs is invisible, too: L_e = 1 is the radiance everywhere.
#[test]
fn a_medium_in_equilibrium_with_its_surroundings_is_invisible() {
    for (name, medium) in media(0.8, 1.0, r#""rgb Le" [1 1 1]"#) {
        let mut job = in_even_light(&medium);
        for (estimator, settings) in estimators() {
            choose(&mut job, &settings);
            assert_answer(&mut job, 48, [1.0; 3], 0.13, &format!("{name}, {estimator}"));
        }
    }
}

/// Beer's law: T = exp(−σ d) for light behind a box of thickness 2, exact in homogeneous media. In a grid, the density
/// falls to one half of the outermost sample at the walls.
#[test]
fn what_only_absorbs_weakens_light_by_the_law_of_beer() {
    let sigma = [0.3_f64, 0.9, 1.7];
    let slab = |medium: &str| {
        camera("0 0 3", "", 3)
            + &format!(
                r#"MakeNamedMedium "ink" {medium} LightSource "infinite" "rgb L" [2 2 2]
                Material "interface" MediumInterface "ink" "" {BOX}"#
            )
    };
    let colors = r#""rgb sigma_a" [0.3 0.9 1.7] "rgb sigma_s" [0 0 0]"#;
    let mut homogeneous = job(&slab(&format!(r#""string type" "homogeneous" {colors}"#)), AccelKind::Embree);
    assert_answer(&mut homogeneous, 1, sigma.map(|s| 2.0 * (-2.0 * s).exp()), 0.01, "homogeneous");
    let bounds = r#""point3 p0" [-1 -1 -1] "point3 p1" [1 1 1]"#;
    // The mean of 1 − |z|/2 over −1 < z < 1 is 3/4
    let mut one =
        job(&slab(&format!(r#""string type" "uniformgrid" {colors} "float density" 1 {bounds}"#)), AccelKind::Embree);
    assert_answer(&mut one, 64, sigma.map(|s| 2.0 * (-1.5 * s).exp()), 0.1, "a grid of one sample");
    // Densities 1 and 3 along z: means of 3/4 and 9/4 over the outer quarters, and of 2 between
    let two = format!(r#""string type" "uniformgrid" {colors} "float density" [1 3] "integer nz" 2 {bounds}"#);
    let mut two = job(&slab(&two), AccelKind::Embree);
    assert_answer(&mut two, 64, sigma.map(|s| 2.0 * (-3.5 * s).exp()), 0.4, "a grid of two samples");
    // The medium has the transformation of its definition
    let moved = r#"AttributeBegin Translate 0 0 0.5 Rotate 90 0 0 1 Scale 2 2 0.25
        MakeNamedMedium "ink" "string type" "uniformgrid" "rgb sigma_a" [0.3 0.9 1.7] "rgb sigma_s" [0 0 0] "float density" 1
        "point3 p0" [-1 -1 -1] "point3 p1" [1 1 1] AttributeEnd"#;
    let text = camera("0 0 3", "", 3)
        + &format!(r#"{moved} LightSource "infinite" "rgb L" [2 2 2] Material "" MediumInterface "ink" "" {BOX}"#);
    assert_answer(
        &mut job(&text, AccelKind::Embree),
        64,
        sigma.map(|s| 2.0 * (-0.5 * 0.75 * s).exp()),
        0.05,
        "a moved grid",
    );
}

/// A point light beside the viewing ray, in infinite fog in front of a black wall: single scattering is ∫ σ_s p I/r²
/// exp(−σ_t (t + r)) dt, computed by quadrature.
#[test]
fn single_scattering_of_a_point_light_is_that_of_quadrature() {
    let (sigma_s, sigma_a, g, depth, beside) = ([0.5_f64, 0.2, 0.05], [0.1_f64, 0.3, 0.0], 0.35_f64, 4.0_f64, 0.7_f64);
    let answer: [f64; 3] = std::array::from_fn(|c| {
        let n = 200_000;
        let step = depth / f64::from(n);
        let sum: f64 = (0..n)
            .map(|i| {
                // The camera is at z = 2, the light at z = 0
                let t = (f64::from(i) + 0.5) * step;
                let (z, r2) = (2.0 - t, beside * beside + (2.0 - t).powi(2));
                let r = r2.sqrt();
                // Between the directions to the viewer, +z, and to the light
                let cos = -z / r;
                let p = (1.0 - g * g) / (4.0 * std::f64::consts::PI * (1.0 + g * g + 2.0 * g * cos).powf(1.5));
                sigma_s[c] * p * 5.0 / r2 * (-(sigma_s[c] + sigma_a[c]) * (t + r)).exp()
            })
            .sum();
        sum * step
    });
    let wall = r#"Material "diffuse" "rgb reflectance" [0 0 0]
        Shape "trianglemesh" "point3 P" [-9 -9 -2  9 -9 -2  9 9 -2  -9 9 -2] "integer indices" [0 1 2 0 2 3]"#;
    let text = |medium: &str| {
        let camera =
            camera("0 0 2", "fog", 1).replace("Translate", &format!("MakeNamedMedium \"fog\" {medium}\nTranslate"));
        camera
            + &format!(r#"LightSource "point" "rgb I" [5 5 5] "point3 from" [0.7 0 0] MediumInterface "" "fog" {wall}"#)
    };
    let colors = r#""rgb sigma_s" [0.5 0.2 0.05] "rgb sigma_a" [0.1 0.3 0] "float g" 0.35"#;
    let homogeneous = format!(r#""string type" "homogeneous" {colors}"#);
    // A grid whose density is 1 in the whole region of the light
    let grid = format!(
        r#""string type" "uniformgrid" {colors} "float density" [{}] "integer nx" 4 "integer ny" 4 "integer nz" 4
        "point3 p0" [-40 -40 -40] "point3 p1" [40 40 40]"#,
        "1 ".repeat(64)
    );
    for (name, medium) in [("homogeneous", homogeneous), ("uniformgrid", grid)] {
        for accel in [AccelKind::Embree, AccelKind::Bvh] {
            let mut job = job(&text(&medium), accel);
            for (estimator, settings) in estimators() {
                choose(&mut job, &settings);
                assert_answer(&mut job, 48, answer, 0.25, &format!("{name}, {estimator}, {accel:?}"));
            }
        }
    }
}

/// A ray along the axis of an absorbing glass ball in uniform light: R + (1 − R)² T/(1 − R T), R = 0.04. Then the same
/// ball in a box of fog.
#[test]
fn coloured_glass_absorbs_along_every_inner_reflection() {
    let sigma = [0.2_f64, 0.7, 1.5];
    let glass = |outside: &str| {
        format!(
            r#"MakeNamedMedium "green" "rgb sigma_a" [0.2 0.7 1.5] "rgb sigma_s" [0 0 0] LightSource "infinite" "rgb L" [1 1 1]
            AttributeBegin MediumInterface "green" "{outside}" Material "dielectric" Shape "sphere" "float radius" 0.5 AttributeEnd"#
        )
    };
    let through = sigma.map(|s| {
        let (r, t) = (0.04, (-s).exp());
        r + (1.0 - r) * (1.0 - r) * t / (1.0 - r * t)
    });
    let mut ball = job(&(camera("0 0 3", "", 40) + &glass("")), AccelKind::Embree);
    assert_answer(&mut ball, 256, through, 0.05, "a ball");
    // Inside grey fog, which transmits exp(−0.5 · 0.3) on either side
    let text = camera("0 0 3", "", 40)
        + r#"MakeNamedMedium "grey" "rgb sigma_a" [0.3 0.3 0.3] "rgb sigma_s" [0 0 0]"#
        + &glass("grey")
        + &format!(r#" Material "interface" MediumInterface "grey" "" {BOX}"#);
    let fog = (-0.5_f64 * 0.3 * 2.0).exp();
    assert_answer(&mut job(&text, AccelKind::Embree), 256, through.map(|l| l * fog), 0.05, "a ball in fog");
    // The same ball as a mirrored instance
    let instance =
        text.replace("AttributeBegin MediumInterface", r#"ObjectBegin "ball" AttributeBegin MediumInterface"#);
    let instance = instance.replace(
        "0.5 AttributeEnd",
        r#"0.25 AttributeEnd ObjectEnd AttributeBegin Scale 2 2 -2 ObjectInstance "ball" AttributeEnd"#,
    );
    assert_answer(&mut job(&instance, AccelKind::Embree), 256, through.map(|l| l * fog), 0.05, "an instance");
}

//! `Material "subsurface"`: known answers of random walks through interiors, and refusals.
//!
//! t-tests over images of different seeds, at a level of 10⁻⁵ for each channel; the detectable bias is given.

use crate::media::{BOX, assert_answer, assert_they_agree, camera, choose, estimators, has_power, job, limit, means};
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load_text};
use lumiris::materials::HalfSpace;
use lumiris::scene::AccelKind;
use lumiris::settings::EstimatorKind;
use std::path::Path;

/// A shape with the material under uniform light of radiance 1; `depth` bounces.
fn in_even_light(material: &str, shape: &str, depth: u32) -> String {
    camera("0.3 0.2 3", "", depth)
        + &format!(r#"LightSource "infinite" "rgb L" [1 1 1] Material "subsurface" {material} {shape}"#)
}

/// A slab deep and wide enough to be a half-space.
const SLAB: &str = r#"Translate 0 0 -100 Scale 100 100 100 Shape "trianglemesh" "point3 P" [-1 -1 -1  1 -1 -1  1 1 -1  -1 1 -1  -1 -1 1  1 -1 1  1 1 1  -1 1 1]
    "integer indices" [0 2 1 0 3 2  4 5 6 4 6 7  0 1 5 0 5 4  3 7 6 3 6 2  0 4 7 0 7 3  1 2 6 1 6 5]"#;

/// A purely scattering interior returns all incident light, for every boundary and phase function. The shapes are
/// convex, so there are only two bounces: one inwards and one outwards.
#[test]
fn an_interior_that_only_scatters_is_invisible_in_even_light() {
    let ball = r#"Shape "sphere" "float radius" 1"#;
    let of = |more: &str| format!(r#""rgb sigma_s" [3 2.5 2] "rgb sigma_a" [0 0 0] {more}"#);
    for (name, material, shape) in [
        ("a ball", of(""), ball),
        ("a box of g = 0.6", of(r#""float g" 0.6 "float eta" 1.5"#), BOX),
        ("index-matched", of(r#""float eta" 1"#), ball),
        ("a small index", of(r#""float eta" 0.8"#), BOX),
    ] {
        for accel in [AccelKind::Embree, AccelKind::Bvh] {
            let mut job = job(&in_even_light(&material, shape, 2), accel);
            for (estimator, settings) in estimators() {
                choose(&mut job, &settings);
                assert_answer(&mut job, 24, [1.0; 3], 0.1, &format!("{name}, {estimator}, {accel:?}"));
            }
        }
    }
}

/// A rough boundary, lit from one direction, by a lamp and from everywhere: there is no analytic answer, but all
/// estimators agree.
#[test]
fn a_rough_boundary_has_light_samples_that_agree_with_those_of_its_bsdf() {
    let text = |accel| {
        let text = camera("0.3 0.2 3", "", 3)
            + &format!(
                r#"LightSource "infinite" "rgb L" [0.3 0.3 0.3] LightSource "distant" "rgb L" [2 2 2] "point3 from" [1 2 3]
                AttributeBegin AreaLightSource "diffuse" "rgb L" [3 3 3] Translate 0 1.6 1.6 Shape "sphere" "float radius" 0.7 AttributeEnd
                Material "subsurface" "rgb reflectance" [0.8 0.5 0.2] "float mfp" 0.2 "float roughness" 0.3 {BOX}"#
            );
        job(&text, accel)
    };
    let mut job = text(AccelKind::Embree);
    let mut answers = Vec::new();
    for (estimator, settings) in estimators() {
        choose(&mut job, &settings);
        answers.push((estimator, means(&mut job, 256)));
    }
    assert_they_agree(&answers, 0.25);
    // The other tracer has the same bits
    let both = [AccelKind::Embree, AccelKind::Bvh].map(|accel| means(&mut text(accel), 4));
    assert_eq!(both[0], both[1]);
}

/// The radiance of a half-space with an index-matched boundary under uniform light, viewed along the normal: 1 − √(1 −
/// α) H(1) by [Chandrasekhar 1960].
#[test]
fn an_index_matched_half_space_has_the_radiance_of_chandrasekhar() {
    let albedo = [0.3_f64, 0.7, 0.95];
    let answer = albedo.map(|a| 1.0 - (1.0 - a).sqrt() * h_of_normal(a));
    let sigma_s: Vec<String> = albedo.iter().map(|a| format!("{}", 20.0 * a)).collect();
    let sigma_a: Vec<String> = albedo.iter().map(|a| format!("{}", 20.0 * (1.0 - a))).collect();
    let material =
        format!(r#""float eta" 1 "rgb sigma_s" [{}] "rgb sigma_a" [{}]"#, sigma_s.join(" "), sigma_a.join(" "));
    let mut job = job(&in_even_light(&material, SLAB, 2), AccelKind::Embree);
    assert_answer(&mut job, 512, answer, 0.05, "a half-space");
}

/// H(1) by iteration on the midpoint rule.
fn h_of_normal(albedo: f64) -> f64 {
    let n = 2000;
    let mu = |i: usize| (i as f64 + 0.5) / n as f64;
    let sum = |at: f64, h: &[f64]| (0..n).map(|j| mu(j) * h[j] / (at + mu(j))).sum::<f64>() / n as f64;
    let next = |at: f64, h: &[f64]| 1.0 / ((1.0 - albedo).sqrt() + 0.5 * albedo * sum(at, h));
    let mut h = vec![1.0; n];
    for _ in 0..30 {
        h = (0..n).map(|i| 0.5 * (h[i] + next(mu(i), &h))).collect();
    }
    next(1.0, &h)
}

/// A half-space with the requested `reflectance` is a ceiling under uniform light. Its diffuse reflection lights a
/// white floor, which is too small to cast a shadow.
#[test]
fn a_half_space_gives_back_the_reflectance_that_is_asked_for() {
    let reflectance = [0.2_f64, 0.5, 0.8];
    for (eta, g) in [(1.0_f64, 0.0), (1.33, 0.0), (1.5, 0.0), (1.33, 0.5)] {
        let text = camera("0 0 -0.5", "", 3)
            + &format!(
                r#"LightSource "infinite" "rgb L" [1 1 1]
                AttributeBegin Material "diffuse" "rgb reflectance" [1 1 1] Shape "trianglemesh" "point3 P" [-0.01 -0.01 -1  0.01 -0.01 -1  0.01 0.01 -1  -0.01 0.01 -1] "integer indices" [0 1 2 0 2 3] AttributeEnd
                Material "subsurface" "rgb reflectance" [0.2 0.5 0.8] "float mfp" 0.05 "float eta" {eta} "float g" {g}
                Translate 0 0 101 Scale 1e4 1e4 100 {BOX}"#
            );
        let mut job = job(&text, AccelKind::Embree);
        job.change(|s| s.integrator.estimator = EstimatorKind::Mis);
        // The boundary reflects the mean of F of uniform light
        let n = 100_000;
        let fresnel = (0..n)
            .map(|i| {
                let mu = (f64::from(i) + 0.5) / f64::from(n);
                2.0 * mu * f64::from(lumiris::bsdfs::fresnel::fr_dielectric(mu as f32, eta as f32))
            })
            .sum::<f64>()
            / f64::from(n);
        let answer = reflectance.map(|r| fresnel + (1.0 - fresnel) * r);
        // Similarity is an approximation: the requested reflectance is met within 0.02
        let detects = if g == 0.0 { 0.03 } else { 0.1 };
        let (mean, error) = means(&mut job, 256);
        for c in 0..3 {
            let slack = if g == 0.0 { 0.0 } else { 0.02 };
            let text = format!("η = {eta}, g = {g}: {} ± {}, not {}", mean[c], error[c], answer[c]);
            assert!((mean[c] - answer[c]).abs() < limit() * error[c] + slack, "{text}");
            assert!(has_power(error[c] / answer[c], detects), "too much noise: {text}");
        }
    }
    assert!((HalfSpace::new(1.33).reflectance(HalfSpace::new(1.33).albedo(0.5, 0.0)) - 0.5).abs() < 1e-6);
}

/// A ball, instanced and mirrored, equals the ball itself; an emitter inside of it is sampled.
#[test]
fn interiors_are_those_of_instances_too_and_hold_other_things() {
    let ball = r#"AttributeBegin Material "subsurface" "rgb sigma_s" [3 3 3] "rgb sigma_a" [0.1 0.3 0.9] Shape "sphere" "float radius" 1 AttributeEnd"#;
    let lamp = r#"AttributeBegin AreaLightSource "diffuse" "rgb L" [4 4 4] Material "diffuse" Shape "sphere" "float radius" 0.3 AttributeEnd"#;
    let start = camera("0.2 0.1 3", "", 4);
    let plain = format!("{start} {lamp} {ball}");
    let instance = format!(
        r#"{start} {lamp} ObjectBegin "ball" Scale 0.5 0.5 0.5 {ball} ObjectEnd AttributeBegin Scale 2 2 -2 ObjectInstance "ball" AttributeEnd"#
    );
    let mut answers = Vec::new();
    for (name, text) in [("plain", plain), ("instance", instance)] {
        let mut job = job(&text, AccelKind::Embree);
        for (estimator, settings) in estimators() {
            choose(&mut job, &settings);
            answers.push((format!("{name}, {estimator}"), means(&mut job, 96)));
        }
    }
    assert_they_agree(&answers, 0.3);
}

#[test]
fn what_cannot_be_an_interior_is_refused_with_its_place() {
    // The error message for a box with the material
    let message = |material: &str| {
        let text = camera("0 0 3", "", 3) + "\n" + material + "\n" + BOX;
        let loaded = load_text(&text, "jade", Path::new("."), &LoadOptions::default(), &FileCache::default());
        loaded.err().map(|d| d.to_string()).unwrap_or_default()
    };

    // Wrong materials and their messages
    for (material, expected) in [
        (r#"Material "subsurface" "rgb sigma_a" [1 1 1]"#, "needs `sigma_s`"),
        (r#"Material "subsurface" "rgb sigma_a" [1 -1 1] "rgb sigma_s" [1 1 1]"#, "must not be negative"),
        (r#"Material "subsurface" "rgb reflectance" [1 1 1] "rgb sigma_s" [1 1 1]"#, "not both"),
        (r#"Material "subsurface" "rgb reflectance" [1 1 1] "float mfp" 0"#, "mfp must be finite and positive"),
        (r#"Material "subsurface" "string name" "Marbel""#, "Marble"),
        (r#"Material "subsurface" "float g" 2"#, "g must be from -1 to 1"),
        (r#"Material "subsurface" "float scale" 0"#, "scale must be positive"),
        (r#"Material "subsurface" "float eta" -1"#, "index of refraction"),
    ] {
        let found = message(material);
        assert!(found.contains(expected) && found.contains("jade:9:"), "{material}:\n{found}");
    }
    assert_eq!(message(r#"Material "subsurface" "string name" "Marble" "float scale" 0.5"#), "");
}

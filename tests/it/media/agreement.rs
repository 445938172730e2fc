//! Media in which estimators and ray tracers must agree: fog, glowing smoke, and interface surfaces.

use super::{BOX, assert_answer, assert_they_agree, camera, choose, estimators, grid, job, means, media};
use crate::path_reuse::image_of_seed;
use crate::same_light::assert_same_light;
use lumiris::integrators::exclusions::{Feature, allows};
use lumiris::lights::LightCtx;
use lumiris::media::Medium;
use lumiris::render::{RenderSettings, render};
use lumiris::scene::AccelKind;
use lumiris::settings::{EstimatorKind, IntegratorSettings, Proposals, Target};
use lumiris_numbers::math::Vec3;
use std::sync::atomic::AtomicBool;

/// Area lights, an infinite light and a glowing medium, in fog in front of a wall.
fn fog(depth: u32) -> String {
    camera("0.1 0.2 3", "", depth)
        + &format!(
            r#"MakeNamedMedium "fog" "rgb sigma_s" [0.4 0.3 0.2] "rgb sigma_a" [0.05 0.1 0.2] "rgb Le" [0.5 0.2 0.1] "float g" 0.5
                LightSource "infinite" "rgb L" [0.2 0.3 0.4] LightSource "distant" "rgb L" [0.3 0.3 0.3] "point3 from" [1 2 3]
                AttributeBegin Material "interface" MediumInterface "fog" "" {BOX} AttributeEnd
                MediumInterface "fog" "fog"
                AttributeBegin Material "coateddiffuse" "rgb reflectance" [0.6 0.5 0.4] "float roughness" 0.3
                Shape "trianglemesh" "point3 P" [-0.9 -0.9 -0.8  0.9 -0.9 -0.8  0.9 0.9 -0.8  -0.9 0.9 -0.8] "integer indices" [0 1 2 0 2 3]
                AttributeEnd
                AttributeBegin AreaLightSource "diffuse" "rgb L" [6 5 4] "bool twosided" true Translate -0.4 0.6 0.3 Material "diffuse"
                Shape "sphere" "float radius" 0.1 AttributeEnd
                AttributeBegin AreaLightSource "diffuse" "rgb L" [2 5 7] Material "diffuse" Shape "trianglemesh"
                "point3 P" [0.5 -0.5 0  0.9 -0.5 0.1  0.7 -0.2 0] "integer indices" [0 1 2] AttributeEnd"#
        )
}

/// Area lights, an infinite light and a glowing medium, in fog in front of a wall, with every estimator and both ray
/// tracers. The answer is unknown, but all agree on it. Emission beyond the last vertex counts.
#[test]
fn estimators_and_ray_tracers_agree_in_fog_with_surfaces() {
    for depth in [1, 4] {
        let mut answers = Vec::new();
        for accel in [AccelKind::Embree, AccelKind::Bvh] {
            let mut job = job(&fog(depth), accel);
            for (estimator, settings) in estimators() {
                choose(&mut job, &settings);
                answers.push((format!("{estimator}, {accel:?}, {depth} bounces"), means(&mut job, 24)));
            }
        }
        assert_they_agree(&answers, 0.25);
    }
}

/// The same to half a percent: every estimator against `mis` with two samples.
#[test]
#[ignore = "of `make test-power` only"]
fn estimators_agree_in_fog_to_half_a_percent() {
    let text = fog(4);
    let image = |settings: &IntegratorSettings| {
        let mut job = job(&text, AccelKind::Embree);
        choose(&mut job, settings);
        image_of_seed(job, None, 256)
    };
    let all = estimators();
    let (_, plain) = &all[1];
    for (name, settings) in &all {
        assert_same_light(&format!("media: fog, {name}"), image(plain), image(settings));
    }
}

/// If all media are behind glass, shadow segments never enter one: `mis` has its columns, and pixels share paths. A
/// wall behind a ball of coloured glass, in a corner of white walls.
#[test]
fn behind_glass_alone_media_leave_shadow_segments_and_shared_paths_as_they_are() {
    // Scene
    let text = |sigma: &str| {
        camera("0.1 0.1 3", "", 6)
            + &format!(
                r#"MakeNamedMedium "green" "rgb sigma_a" [{sigma}] "rgb sigma_s" [0 0 0]
                AttributeBegin MediumInterface "green" "" Material "dielectric" Shape "sphere" "float radius" 0.5 AttributeEnd
                Material "diffuse" "rgb reflectance" [0.8 0.8 0.8]
                Shape "trianglemesh" "point3 P" [-2 -2 -1  2 -2 -1  2 2 -1  -2 2 -1] "integer indices" [0 1 2 0 2 3]
                Shape "trianglemesh" "point3 P" [-2 -2 -1  2 -2 -1  2 -2 4  -2 -2 4] "integer indices" [0 1 2 0 2 3]
                AttributeBegin MediumInterface "green" "green" Shape "sphere" "float radius" 0.1 AttributeEnd
                AreaLightSource "diffuse" "rgb L" [5 5 5] "bool twosided" true
                Shape "trianglemesh" "point3 P" [-1 2 -0.5  1 2 -0.5  1 2 1.5  -1 2 1.5] "integer indices" [0 1 2 0 2 3]"#
            )
    };

    // Estimators, with and without shared paths
    let mut job = job(&text("0.2 0.5 1"), AccelKind::Embree);
    assert!(allows(&job, Feature::Sharing));
    let mut answers = Vec::new();
    for (estimator, samples, edge) in
        [(EstimatorKind::Ris, 2, 1), (EstimatorKind::Mis, 2, 1), (EstimatorKind::Mis, 4, 1), (EstimatorKind::Mis, 2, 4)]
    {
        job.change(|s| {
            (s.integrator.estimator, s.integrator.samples) = (estimator, Some(samples));
            (s.integrator.path_reuse, s.integrator.ris.proposals) = (Some(edge), Proposals::Fixed(8));
        });
        answers.push((format!("{estimator:?} {samples}, blocks of {edge}"), means(&mut job, 256)));
    }
    assert_they_agree(&answers, 0.1);
}

/// A sheet in front of a lamp, half interface and half black, transmits half of the light, also without media: L = ρ/π
/// · I/d² · 1/2.
#[test]
fn surfaces_that_rays_may_pass_let_light_through_where_there_are_no_media() {
    for depth in [1, 4] {
        // Scene
        let text = camera("0 0 1", "", depth)
            + r#"LightSource "point" "rgb I" [ 1 2 4 ] "point3 from" [ 0 0 2 ]
            Material "diffuse" "rgb reflectance" [ 0.5 0.5 0.5 ]
            Shape "bilinearmesh" "point3 P" [ -9 -9 0  9 -9 0  -9 9 0  9 9 0 ]
            MakeNamedMaterial "nothing" "string type" "interface"
            MakeNamedMaterial "black" "string type" "diffuse" "rgb reflectance" [ 0 0 0 ]
            Material "mix" "string materials" [ "nothing" "black" ] "float amount" 0.5
            Shape "bilinearmesh" "point3 P" [ -9 -9 1.5  9 -9 1.5  -9 9 1.5  9 9 1.5 ]"#;
        let mut job = job(&text, AccelKind::Embree);
        assert!(job.world.scene.media.is_empty() && !allows(&job, Feature::Sharing));

        // Every estimator has the answer
        let answer = [1.0, 2.0, 4.0].map(|i| 0.5 / std::f64::consts::PI * i / 4.0 * 0.5);
        for (name, settings) in estimators() {
            choose(&mut job, &settings);
            assert_answer(&mut job, 64, answer, 0.2, &format!("{name}, {depth} bounces"));
        }
        job.change(|s| (s.integrator.estimator, s.integrator.samples) = (EstimatorKind::Ocv, Some(4)));
        assert_answer(&mut job, 64, answer, 0.2, &format!("ocv, {depth} bounces"));

        // The target Gv is refused
        job.change(|s| (s.integrator.estimator, s.integrator.ris.target) = (EstimatorKind::Ris, Target::Gv));
        let refused = render(&job, &RenderSettings::default(), &AtomicBool::new(false), &|_| ());
        assert!(refused.err().is_some_and(|error| error.to_string().contains("interface")));
    }
}

/// A medium also glows beyond the last vertex. In front of a wall of reflectance ρ in an infinite absorbing and
/// emitting medium, L = L_e (1 − T) + T ρ L_e.
#[test]
fn what_glows_beyond_the_last_vertex_lights_it() {
    // Scene
    let camera = camera("0 0 2", "fire", 1).replace(
        "Translate",
        "MakeNamedMedium \"fire\" \"rgb sigma_a\" [0.3 0.6 1] \"rgb sigma_s\" [0 0 0] \"rgb Le\" [2 1 0.5]\nTranslate",
    );
    let text = camera
        + r#"MediumInterface "" "fire" Material "diffuse" "rgb reflectance" [0.5 0.5 0.8]
        Shape "trianglemesh" "point3 P" [-90 -90 0  90 -90 0  90 90 0  -90 90 0] "integer indices" [0 1 2 0 2 3]"#;

    // Answer
    let le = [2.0, 1.0, 0.5];
    let (sigma, rho) = ([0.3_f64, 0.6, 1.0], [0.5, 0.5, 0.8]);
    let answer = std::array::from_fn(|c| {
        let t = (-2.0 * sigma[c]).exp();
        le[c] * (1.0 - t) + t * rho[c] * le[c]
    });

    // Estimators
    let mut job = job(&text, AccelKind::Embree);
    for (estimator, settings) in estimators() {
        choose(&mut job, &settings);
        assert_answer(&mut job, 2, answer, 0.01, &estimator);
    }
}

/// A wall beside a glowing medium whose boundary contains half of it: L = ρ/π ∫ σ_a L_e cos θ/r² dV over that half,
/// with negligible absorption. Light samples find it, and so do BSDF paths.
#[test]
fn light_samples_find_what_glows_where_it_is_and_not_beyond_its_boundary() {
    let place = r#""point3 p0" [0.5 -0.5 -0.9] "point3 p1" [1.3 0.3 0.1] "integer nx" 4 "integer ny" 4 "integer nz" 4"#;
    let (low, high) = (Vec3::new(0.5, -0.5, -0.9), Vec3::new(0.9, 0.3, 0.1));
    let boundary = r#"Shape "trianglemesh" "point3 P" [0.5 -0.5 -0.9  0.9 -0.5 -0.9  0.9 0.3 -0.9  0.5 0.3 -0.9
        0.5 -0.5 0.1  0.9 -0.5 0.1  0.9 0.3 0.1  0.5 0.3 0.1]
        "integer indices" [0 2 1 0 3 2  4 5 6 4 6 7  0 1 5 0 5 4  3 7 6 3 6 2  0 4 7 0 7 3  1 2 6 1 6 5]"#;
    let text = camera("0.1 0.2 3", "", 1)
        + &format!(
            r#"MakeNamedMedium "fire" "string type" "uniformgrid" "rgb sigma_a" [0.002 0.001 0.003] "rgb sigma_s" [0 0 0] {place}
            "float density" [{}] "rgb Le" [300 200 100]
            AttributeBegin Material "interface" MediumInterface "fire" "" {boundary} AttributeEnd
            Material "diffuse" "rgb reflectance" [0.5 0.4 0.8]
            Shape "trianglemesh" "point3 P" [-9 -9 -1  9 -9 -1  9 9 -1  -9 9 -1] "integer indices" [0 1 2 0 2 3]"#,
            grid(1, 2.0)
        );
    let mut job = job(&text, AccelKind::Embree);
    let Medium::Heterogeneous(fire) = job.world.scene.media.media[0].clone() else { panic!("no grid") };
    let at = Vec3::new(0.1, -0.2, -1.0);
    // Midpoint rule in the unit cube; the boundary contains the lower half along x
    let (steps, mut irradiance) = (64, [0.0_f64; 3]);
    for i in 0..steps * steps * steps / 2 {
        let place = [i % (steps / 2), i / (steps / 2) % steps, i / (steps * steps / 2)];
        let unit = Vec3::from(place.map(|x| (x as f32 + 0.5) / steps as f32));
        let p = fire.world_point(unit);
        assert!(p.cmpge(low).all() && p.cmple(high).all());
        let (r2, cos) = ((p - at).length_squared(), (p - at).normalize().z);
        let volume = fire.volume() / (steps * steps * steps) as f32;
        let glow = fire.emission(unit).to_array();
        (0..3).for_each(|c| irradiance[c] += f64::from(glow[c] * cos / r2 * volume));
    }
    let rho = [0.5, 0.4, 0.8];
    let answer = [0, 1, 2].map(|c| rho[c] / std::f64::consts::PI * irradiance[c]);
    for (name, settings) in estimators() {
        choose(&mut job, &settings);
        let looks = settings.estimator == EstimatorKind::Mis && settings.samples > Some(1);
        let ctx = LightCtx::on(at, Vec3::Z);
        assert_eq!(job.lights.sampler.sample(&ctx, 0.5).is_some(), looks, "{name}");
        assert_answer(&mut job, 128, answer, if looks { 0.03 } else { 0.4 }, &name);
    }
}

/// Smoke that glows and scatters, in front of a wall and around a glossy ball, with a lamp and a sky. The answer is
/// unknown, but all estimators agree on it.
#[test]
fn estimators_agree_where_smoke_glows() {
    for depth in [1, 4] {
        // Scene
        let text = camera("0.1 0.2 3", "", depth)
            + &format!(
                r#"MakeNamedMedium "smoke" {} LightSource "infinite" "rgb L" [0.2 0.3 0.4]
                AttributeBegin Material "interface" MediumInterface "smoke" "" {BOX} AttributeEnd
                AttributeBegin MediumInterface "smoke" "smoke" Material "coateddiffuse" "rgb reflectance" [0.6 0.5 0.4] "float roughness" 0.3
                Translate 0.2 0 -0.2 Shape "sphere" "float radius" 0.4 AttributeEnd
                AreaLightSource "diffuse" "rgb L" [2 5 7] Material "diffuse" Shape "trianglemesh"
                "point3 P" [1.5 -0.5 0  1.9 -0.5 0.1  1.7 -0.2 0] "integer indices" [0 1 2]"#,
                media(0.6, 0.8, r#""rgb Le" [3 2 1]"#)[1].1
            );

        // Estimators
        let mut job = job(&text, AccelKind::Embree);
        let mut answers = Vec::new();
        for (name, settings) in estimators() {
            choose(&mut job, &settings);
            answers.push((format!("{name}, {depth} bounces"), means(&mut job, 32)));
        }
        assert_they_agree(&answers, 0.25);
    }
}

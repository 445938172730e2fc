//! Self-intersections and intersections of coincident surfaces: flat emitters, coincident surfaces, and cut-outs that a
//! ray crosses twice.

use crate::media::job;
use lumiris::film::PixelSums;
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::{Cached, EstimatorKind, IntegratorKind, OcvForm, Settings};
use lumiris_numbers::math::{Affine3A, Quat, Vec3};
use std::fmt::Write;
use std::sync::atomic::AtomicBool;

/// Red channels of the pixels.
fn pixels(job: &RenderJob) -> Vec<f64> {
    let settings = RenderSettings { spp: job.settings().sampling.spp, ..RenderSettings::default() };
    let rendering = render(job, &settings, &AtomicBool::new(false), &|_| ()).unwrap();
    rendering.film.pixels().iter().map(|p| PixelSums::mean(p)[0]).collect()
}

fn mean(job: &RenderJob) -> f64 {
    let pixels = pixels(job);
    pixels.iter().sum::<f64>() / pixels.len() as f64
}

/// At the origin, off it, rotated, and rotated at other scales.
fn placements() -> [Affine3A; 5] {
    let turn = Quat::from_axis_angle(Vec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    let scaled = |s: f32, p: Vec3| Affine3A::from_scale_rotation_translation(Vec3::splat(s), turn, p);
    [
        Affine3A::IDENTITY,
        Affine3A::from_translation(Vec3::new(3.0, -1.0, -37.3)),
        scaled(1.0, Vec3::new(12.0, -40.0, 7.0)),
        scaled(1e-3, Vec3::new(0.01, 0.02, -0.03)),
        scaled(500.0, Vec3::new(900.0, 20.0, 70.0)),
    ]
}

/// A scene of 4 × 4 pixels, viewed from (0.4, 0.3, 5) of a placement, roughly along −z.
fn header(at: &Affine3A, spp: u32, depth: u32) -> String {
    let [eye, target] = [Vec3::new(0.4, 0.3, 5.0), Vec3::ZERO].map(|p| at.transform_point3(p));
    let up = at.transform_vector3(Vec3::Y).normalize();
    format!(
        r#"LookAt {} {} {} {} {} {} {} {} {} Camera "perspective" "float fov" 20
        Film "rgb" "integer xresolution" 4 "integer yresolution" 4 "string filename" "surfaces.exr"
        PixelFilter "box" Sampler "independent" "integer pixelsamples" {spp}
        Integrator "path" "integer maxdepth" {depth}
        WorldBegin
        "#,
        eye.x, eye.y, eye.z, target.x, target.y, target.z, up.x, up.y, up.z
    )
}

fn points(at: &Affine3A, corners: &[[f32; 2]]) -> String {
    corners.iter().fold(String::new(), |mut text, &[x, y]| {
        let p = at.transform_point3(Vec3::new(x, y, 0.0));
        write!(text, "{} {} {} ", p.x, p.y, p.z).unwrap();
        text
    })
}

fn triangles(at: &Affine3A, corners: &[[f32; 2]], indices: &str) -> String {
    format!("Shape \"trianglemesh\" \"point3 P\" [{}] \"integer indices\" [{indices}]\n", points(at, corners))
}

fn patch(at: &Affine3A, corners: [[f32; 2]; 4]) -> String {
    format!("Shape \"bilinearmesh\" \"point3 P\" [{}]\n", points(at, &corners))
}

fn disk(at: &Affine3A, radius: f32) -> String {
    let [x, y, z, p] = [at.matrix3.x_axis, at.matrix3.y_axis, at.matrix3.z_axis, at.translation].map(Vec3::from);
    let columns = [(x, 0), (y, 0), (z, 0), (p, 1)].map(|(v, w)| format!("{} {} {} {w}", v.x, v.y, v.z)).join(" ");
    format!("AttributeBegin Transform [{columns}] Shape \"disk\" \"float radius\" {radius} AttributeEnd\n")
}

const SQUARE: [[f32; 2]; 4] = [[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]];
const TWO: &str = "0 1 2 0 2 3";

/// Flat surfaces in the plane z = 0 of a placement that fill the image.
fn flat_shapes(at: &Affine3A) -> Vec<(&'static str, String)> {
    let trapezoid = [[-2.0, -2.0], [2.0, -2.1], [2.5, 2.0], [-1.9, 2.0]];
    let [a, b, c, d] = trapezoid;
    let grid: Vec<[f32; 2]> = (0..36).map(|i| [(i % 6) as f32 - 2.5, (i / 6) as f32 * 0.9 - 2.2]).collect();
    let cells = (0..25).map(|i| i % 5 + 6 * (i / 5));
    let cells: Vec<String> = cells.map(|k| format!("{k} {} {} {k} {} {}", k + 1, k + 7, k + 7, k + 6)).collect();
    vec![
        ("triangle", triangles(at, &[[-9.0, -9.0], [9.0, -9.0], [0.3, 9.0]], "0 1 2")),
        ("rectangle of triangles", triangles(at, &SQUARE, TWO)),
        ("trapezoid of triangles", triangles(at, &trapezoid, TWO)),
        ("many triangles", triangles(at, &grid, &cells.join(" "))),
        ("rectangular patch", patch(at, [SQUARE[0], SQUARE[1], SQUARE[3], SQUARE[2]])),
        ("planar patch", patch(at, [a, b, d, c])),
        ("disk", disk(at, 2.0)),
    ]
}

type Change = Box<dyn Fn(&mut Settings)>;

/// All estimators of direct light.
fn estimators() -> Vec<(String, Change)> {
    // Estimators with direct and with indirect light
    let mut all: Vec<(String, Change)> = Vec::new();
    for (kind, samples) in [
        (EstimatorKind::Auto, None),
        (EstimatorKind::Mc, Some(2)),
        (EstimatorKind::Mis, Some(1)),
        (EstimatorKind::Mis, Some(4)),
        (EstimatorKind::Ris, Some(2)),
        (EstimatorKind::Ocv, Some(4)),
        (EstimatorKind::OptimalMis, Some(4)),
        (EstimatorKind::Correlated, Some(4)),
        (EstimatorKind::Contributing, Some(2)),
    ] {
        for depth in [1, 3] {
            let change = move |s: &mut Settings| {
                (s.integrator.estimator, s.integrator.samples) = (kind, samples);
                s.integrator.max_depth = depth;
                if depth == 3 {
                    s.integrator.ocv.form = OcvForm::Pixels;
                }
            };
            all.push((format!("{kind:?} {samples:?}, depth {depth}"), Box::new(change)));
        }
    }

    // Irradiance caches
    for cached in [Cached::Indirect, Cached::All] {
        let change = move |s: &mut Settings| {
            s.integrator.kind = IntegratorKind::IrradianceCache;
            (s.integrator.cache.cached, s.integrator.cache.samples) = (cached, 16);
        };
        all.push((format!("irradiance cache of {cached:?}"), Box::new(change)));
    }
    all
}

#[test]
fn a_flat_emitter_does_not_light_itself() {
    for (k, at) in placements().into_iter().enumerate() {
        for (name, shape) in flat_shapes(&at) {
            // A white emitter of radiance 1
            let emitter = r#"Material "diffuse" "rgb reflectance" [1 1 1]
                AreaLightSource "diffuse" "rgb L" [1 1 1] "bool twosided" true "#;
            let mut scene = job(&format!("{}{emitter}{shape}", header(&at, 4, 1)), AccelKind::Embree);
            let start = *scene.settings();
            let all = k == 0 || k == 2;
            // No estimator adds light to its own emission
            for (estimator, change) in estimators().into_iter().filter(|(name, _)| all || name.starts_with("Mis")) {
                scene.change(|s| {
                    *s = start;
                    change(s);
                });
                for value in pixels(&scene) {
                    assert!((value - 1.0).abs() < 1e-5, "{name} at {at:?}: {value} by {estimator}");
                }
            }
        }
    }
}

#[test]
fn a_flat_emitter_does_not_hide_other_light_from_itself() {
    // A sky of 0.5 adds the same amount; the emitter would occlude a sixth of it
    for at in placements().into_iter().step_by(2) {
        for (name, shape) in flat_shapes(&at) {
            let lights = r#"LightSource "infinite" "rgb L" [0.5 0.5 0.5] Material "diffuse" "rgb reflectance" [1 1 1]
                AreaLightSource "diffuse" "rgb L" [1 1 1] "bool twosided" true "#;
            let mut scene = job(&format!("{}{lights}{shape}", header(&at, 512, 1)), AccelKind::Embree);
            for estimator in [EstimatorKind::Mis, EstimatorKind::Ris] {
                scene.change(|s| (s.integrator.estimator, s.integrator.samples) = (estimator, Some(2)));
                let mean = mean(&scene);
                // Five standard errors; a sixth of the sky is 0.08
                assert!((mean - 1.5).abs() < 0.04, "{name} at {at:?}: {mean} by {estimator:?}");
            }
        }
    }
}

#[test]
fn surfaces_of_two_kinds_in_the_same_place_do_not_shadow_each_other() {
    // Both reflect half of a sky of 1; any shadow on the other one darkens it
    for at in placements() {
        let placed = |p: Vec3| Affine3A::from_translation(at.matrix3 * p) * at;
        let off = placed(Vec3::new(1.5, -0.5, 0.0));
        let trapezoid = [[-5.3, -5.1], [5.2, -5.3], [-5.7, 5.2], [5.1, 5.4]];
        let [a, b, d, c] = trapezoid;
        let kinds = [
            triangles(&at, &[a, b, c, d], TWO),
            patch(&at, trapezoid),
            disk(&at, 6.0),
            disk(&off, 5.0),
            format!("ObjectBegin \"o\" {} ObjectEnd ObjectInstance \"o\"\n", disk(&off, 5.5)),
        ];
        for (i, j) in (0..kinds.len()).flat_map(|j| (0..j).map(move |i| (i, j))) {
            let world = r#"LightSource "infinite" "rgb L" [1 1 1] Material "diffuse" "rgb reflectance" [0.5 0.5 0.5] "#;
            let text = format!("{}{world}{}{}", header(&at, 256, 2), kinds[i], kinds[j]);
            let mut scene = job(&text, AccelKind::Embree);
            scene.change(|s| (s.integrator.estimator, s.integrator.samples) = (EstimatorKind::Mis, Some(2)));
            let mean = mean(&scene);
            // Five standard errors
            assert!((mean - 0.5).abs() < 0.015, "{} {} at {at:?}: {mean}", kinds[i], kinds[j]);
        }
    }
}

#[test]
fn a_lamp_in_the_plane_of_a_ceiling_of_another_kind_is_seen_whole() {
    // A disk of radius r at the distance h above a point of a floor gives it ρ L r²/(r² + h²)
    for at in placements() {
        let ceiling_at = at * Affine3A::from_translation(Vec3::new(0.0, 0.0, 2.0));
        let facing = ceiling_at * Affine3A::from_rotation_x(std::f32::consts::PI);
        let eye = at.transform_point3(Vec3::new(0.0, 0.0, 1.0));
        let [target, up] = [at.transform_point3(Vec3::ZERO), at.transform_vector3(Vec3::Y).normalize()];
        let trapezoid = [[-5.3, -5.1], [5.2, -5.3], [5.1, 5.4], [-5.7, 5.2]];
        for ceiling in [triangles(&ceiling_at, &trapezoid, TWO), disk(&ceiling_at, 5.0)] {
            let text = format!(
                r#"LookAt {} {} {} {} {} {} {} {} {} Camera "perspective" "float fov" 1
                Film "rgb" "integer xresolution" 4 "integer yresolution" 4 "string filename" "surfaces.exr"
                PixelFilter "box" Sampler "independent" "integer pixelsamples" 64
                Integrator "path" "integer maxdepth" 1
                WorldBegin
                Material "diffuse" "rgb reflectance" [0.5 0.5 0.5] {}
                Material "diffuse" "rgb reflectance" [0 0 0] {ceiling}
                AreaLightSource "diffuse" "rgb L" [1 1 1] {}"#,
                eye.x,
                eye.y,
                eye.z,
                target.x,
                target.y,
                target.z,
                up.x,
                up.y,
                up.z,
                triangles(&at, &SQUARE, TWO),
                disk(&facing, 1.0)
            );
            let mut scene = job(&text, AccelKind::Embree);
            for estimator in [EstimatorKind::Mc, EstimatorKind::Mis, EstimatorKind::Ris] {
                scene.change(|s| (s.integrator.estimator, s.integrator.samples) = (estimator, Some(4)));
                let mean = mean(&scene);
                assert!((mean / 0.1 - 1.0).abs() < 0.05, "{ceiling} at {at:?}: {mean} by {estimator:?}");
            }
        }
    }
}

/// Cut-outs about the origin that rays roughly along z cross twice.
const CROSSED_TWICE: [(&str, &str); 6] = [
    ("sphere", r#"Shape "sphere" "float radius" 2 "float alpha" 0.5"#),
    (
        "cylinder",
        r#"Rotate 90 1 0 0 Shape "cylinder" "float zmin" -2 "float zmax" 2 "float radius" 1 "float alpha" 0.5"#,
    ),
    // z = 2xy/9, cut at z = 0.5 along x = y
    (
        "patch",
        r#"Rotate 90 0 1 0 Rotate -45 0 0 1 Translate 0 0 -0.5
        Shape "bilinearmesh" "point3 P" [-3 -3 2  3 -3 -2  -3 3 -2  3 3 2] "float alpha" 0.5"#,
    ),
    (
        "loop surface",
        r#"Scale 3 3 3 Shape "loopsubdiv" "integer levels" 2 "point3 P" [1 0 0  0 1 0  -1 0 0  0 -1 0  0 0 1  0 0 -1]
        "integer indices" [0 1 4  1 2 4  2 3 4  3 0 4  1 0 5  2 1 5  3 2 5  0 3 5] "float alpha" 0.5"#,
    ),
    (
        "instance",
        r#"ObjectBegin "o" Shape "sphere" "float radius" 1 "float alpha" 0.5 ObjectEnd
        Scale 2 2.5 2 ObjectInstance "o""#,
    ),
    (
        "sphere with a surface between that does not scatter",
        r#"Shape "sphere" "float radius" 2 "float alpha" 0.5 Material "interface" Shape "disk" "float radius" 5"#,
    ),
];

#[test]
fn an_alpha_of_half_lets_a_quarter_through_where_it_is_crossed_twice() {
    let view = |z: f32, depth: u32| {
        let at = Affine3A::from_translation(Vec3::new(0.0, 0.0, z - 5.0));
        header(&at, 256, depth).replace(r#""float fov" 20"#, r#""float fov" 1"#)
    };
    for (name, shape) in CROSSED_TWICE {
        let shape = format!("AttributeBegin Material \"diffuse\" \"rgb reflectance\" [0 0 0] {shape} AttributeEnd ");
        let lamp = r#"AttributeBegin AreaLightSource "diffuse" "rgb L" [1 1 1]
            Translate 0 0 -5 Shape "disk" "float radius" 3 AttributeEnd "#;
        let floor = r#"Material "diffuse" "rgb reflectance" [0.5 0.5 0.5]
            Shape "trianglemesh" "point3 P" [-9 -9 -5  9 -9 -5  9 9 -5  -9 9 -5] "integer indices" [0 1 2 0 2 3] "#;
        let distant =
            r#"LightSource "distant" "point3 from" [0 0 1] "point3 to" [0 0 0] "rgb L" [6.2832 6.2832 6.2832] "#;
        let point = r#"LightSource "point" "point3 from" [0 0 4] "rgb I" [508.938 508.938 508.938] "#;
        let scenes = [
            ("camera rays", format!("{}{shape}{lamp}", view(9.0, 0))),
            ("segments to a light at infinity", format!("{}{distant}{shape}{floor}", view(-3.5, 1))),
            ("segments to a point", format!("{}{point}{shape}{floor}", view(-3.5, 1))),
        ];
        for (rays, text) in scenes {
            let found = [AccelKind::Embree, AccelKind::Bvh].map(|accel| mean(&job(&text, accel)));
            // Five standard deviations of 4096 decisions
            assert!((found[0] - 0.25).abs() < 0.034, "{name}, {rays}: {found:?}");
            // Rays at edges of triangles may decide differently
            assert!((found[0] - found[1]).abs() < 1e-3, "{name}, {rays}: {found:?}");
        }
    }
}

//! Portals of infinite lights: known answers, the same light as without portals if there are no other openings, and
//! errors.
//!
//! t-tests over 32 images of different seeds, at a level of 10⁻⁵ for each channel; the detectable bias is given.

use crate::media::{assert_answer, assert_they_agree, choose, estimators, means};
use lumiris::imaging::oiio::{Part, write_image};
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load_text};
use lumiris::lights::{EnvironmentFilter, EnvironmentMap, EnvironmentMapping};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris_numbers::math::{Rgb, Vec3};
use std::f64::consts::PI;
use std::path::Path;

/// A camera at a point of the room, with a single direction.
fn camera(look: &str, depth: u32) -> String {
    format!(
        r#"LookAt {look} 0 1 0
        Camera "orthographic" "float screenwindow" [ -0.0005 0.0005 -0.0005 0.0005 ]
        Film "rgb" "integer xresolution" 4 "integer yresolution" 4
        PixelFilter "box" "float xradius" 0.5 "float yradius" 0.5
        Integrator "path" "integer maxdepth" {depth}
        WorldBegin
        "#
    )
}

/// Towards the floor, and out of the window.
const LOOKS: [&str; 2] = ["0.3 0.2 0.5  0.3 0.2 0 ", "0.3 0.2 0  0.4 0.1 1 "];

/// The window of the room, by its corners; the outside is at greater z.
const WINDOW: &str = r#""point3 portal" [-0.4 -0.3 1  -0.4 0.6 1  0.5 0.6 1  0.5 -0.3 1]"#;

/// A closed room with a window in its ceiling, and a black lintel outside that covers a part of the sky.
const ROOM: &str = r#"
Material "diffuse" "rgb reflectance" [ 0.7 0.5 0.3 ]
Shape "trianglemesh" "point3 P" [-1 -1 -1  1 -1 -1  1 1 -1  -1 1 -1  -1 -1 1  1 -1 1  1 1 1  -1 1 1]
    "integer indices" [0 2 1 0 3 2  0 1 5 0 5 4  3 7 6 3 6 2  0 4 7 0 7 3  1 2 6 1 6 5]
Shape "trianglemesh" "point3 P" [-1 -1 1  1 -1 1  1 -0.3 1  -1 -0.3 1  -1 0.6 1  1 0.6 1  1 1 1  -1 1 1
    -0.4 -0.3 1  -0.4 0.6 1  0.5 -0.3 1  0.5 0.6 1] "integer indices" [0 1 2 0 2 3  4 5 6 4 6 7  3 8 9 3 9 4  10 2 5 10 5 11]
Material "diffuse" "rgb reflectance" [ 0 0 0 ]
Shape "trianglemesh" "point3 P" [-1 0.3 1.2  1 0.3 1.2  1 0.9 1.3  -1 0.9 1.3] "integer indices" [0 1 2 0 2 3]
"#;

const FLOOR: &str =
    r#"Shape "trianglemesh" "point3 P" [ -9 -9 0  9 -9 0  9 9 0  -9 9 0 ] "integer indices" [ 0 1 2 0 2 3 ]"#;

/// A sky of 4 × 4 texels.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let names = ["R", "G", "B"].map(str::to_owned).to_vec();
    let pixels = (0..48).map(|i| ((i * 37 + 11) % 23) as f32 / 8.0).collect();
    write_image(&folder.path().join("sky.exr"), &[Part::linear(4, 4, names, pixels)]).unwrap();
    folder
}

fn job(folder: &Path, text: &str, accel: AccelKind) -> Result<RenderJob, String> {
    let loaded = load_text(text, "room.pbrt", folder, &LoadOptions::default(), &FileCache::default());
    Ok(loaded.map_err(|d| d.to_string())?.job(accel, None).unwrap())
}

/// The current transformation rotates the sky, but not the portal.
fn sky(portal: &str) -> String {
    format!(
        "AttributeBegin Rotate 40 1 2 3 LightSource \"infinite\" \"string filename\" \"sky.exr\" \"float scale\" 2 {portal} AttributeEnd\n"
    )
}

#[test]
fn a_room_has_the_light_that_it_has_without_a_portal() {
    let folder = folder();
    let text = |portal: &str, look: &str| camera(look, 3) + &sky(portal) + ROOM;
    let mut without = job(folder.path(), &text("", LOOKS[0]), AccelKind::Embree).unwrap();
    let mut answers = vec![("without a portal".to_owned(), means(&mut without, 4096))];
    for accel in [AccelKind::Embree, AccelKind::Bvh] {
        let mut job = job(folder.path(), &text(WINDOW, LOOKS[0]), accel).unwrap();
        for (estimator, settings) in estimators() {
            choose(&mut job, &settings);
            answers.push((format!("{estimator}, {accel:?}"), means(&mut job, 128)));
        }
    }
    assert_they_agree(&answers, 0.1);

    // Through the portal, the camera sees the sky itself
    let seen = ["", WINDOW].map(|portal| {
        let mut job = job(folder.path(), &text(portal, LOOKS[1]), AccelKind::Embree).unwrap();
        means(&mut job, 1).0
    });
    assert_eq!(seen[0], seen[1]);
}

#[test]
fn an_even_sky_lights_a_floor_by_the_form_factor_of_its_portal() {
    // From (0.3, 0.2, 0) to the window in the plane z = 1
    const N: usize = 600;
    let mut form = 0.0;
    for i in 0..N * N {
        let [x, y] = [i % N, i / N].map(|k| 0.9 * (k as f64 + 0.5) / N as f64);
        let squared = (x - 0.7).powi(2) + (y - 0.5).powi(2) + 1.0;
        form += 0.81 / (N * N) as f64 / (PI * squared * squared);
    }
    let text = camera(LOOKS[0], 1)
        + &format!("LightSource \"infinite\" \"rgb L\" [ 3 2 1 ] \"float scale\" 2 {WINDOW}\n")
        + "Material \"diffuse\" \"rgb reflectance\" [ 0.5 0.5 0.5 ]\n"
        + FLOOR;
    for accel in [AccelKind::Embree, AccelKind::Bvh] {
        let mut job = job(Path::new("."), &text, accel).unwrap();
        for (estimator, settings) in estimators() {
            choose(&mut job, &settings);
            assert_answer(&mut job, 64, [3.0, 2.0, 1.0].map(|l| l * form), 0.05, &format!("{estimator}, {accel:?}"));
        }
    }
}

/// Resolution of the sky with a bright horizon (texels per side).
const SIZE: usize = 64;
/// Half the side of the portal in the tests below (m).
const HALF: f64 = 1.0;

/// Radiances of a sky of 1 with a band around its horizon.
fn horizon(contrast: f32) -> Vec<f32> {
    let distance = |i: usize| ((i as f32 + 0.5) * 2.0 / SIZE as f32 - 1.0).abs();
    // The horizon is |x| + |y| = 1 in an equal-area map
    let is_band = |i: usize| (distance(i % SIZE) + distance(i / SIZE) - 1.0).abs() < 0.06;
    (0..SIZE * SIZE).map(|i| if is_band(i) { contrast } else { 1.0 }).collect()
}

/// Irradiance over π at the point (x, 0, 0) of a floor, lit by the sky through a hole in an opaque plane at z =
/// `height`.
fn oracle(sky: &[f32], x: f64, height: f64) -> f64 {
    const N: usize = 600;
    let texels = sky.iter().map(|&l| Rgb::splat(l)).collect();
    let map = EnvironmentMap::new(texels, [SIZE; 2], EnvironmentMapping::EqualArea, EnvironmentFilter::Nearest);
    let map = map.unwrap();
    // Points of the hole in units of the height, denser near the point: sinh t, with their spacings
    let places = |centre: f64| {
        let [begin, end] = [-HALF, HALF].map(|edge| ((edge - centre) / height).asinh());
        let step = (end - begin) / N as f64;
        (0..N).map(move |i| begin + (i as f64 + 0.5) * step).map(move |t| (t.sinh(), t.cosh() * step))
    };
    let mut sum = 0.0;
    for (dx, width) in places(x) {
        for (dy, length) in places(0.0) {
            let le = map.le(Vec3::new(dx as f32, dy as f32, 1.0).normalize()).r;
            sum += f64::from(le) * width * length / (1.0 + dx * dx + dy * dy).powi(2);
        }
    }
    sum / PI
}

/// A portal lights a point of the floor like the sky through a hole, for every distance of the hole, every brightness
/// of the horizon, and every sampling technique. A bias of 10 % is detected with a probability above 0.99.
#[test]
fn a_bright_horizon_lights_a_floor_as_through_a_hole() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["Mis 2", "Mc 2", "Contributing 2", "ris Fgl"];
    let estimators = || estimators().into_iter().filter(|(name, _)| names.contains(&name.as_str()));
    assert_eq!(estimators().count(), names.len());
    for contrast in [1.0, 30.0, 1000.0] {
        let sky = horizon(contrast);
        let pixels = sky.iter().flat_map(|&l| [l; 3]).collect();
        let channels = ["R", "G", "B"].map(str::to_owned).to_vec();
        write_image(&folder.path().join("horizon.exr"), &[Part::linear(SIZE, SIZE, channels, pixels)]).unwrap();
        // Beneath the portal, and beside it
        for (x, height) in [(0.3, 0.05), (0.3, 1.0), (0.3, 10.0), (2.5, 0.05), (2.5, 1.0)] {
            let text = camera(&format!("{x} 0 {}  {x} 0 0", 0.5 * height), 1)
                + r#"LightSource "infinite" "string filename" "horizon.exr" "point3 portal""#
                + &format!("[-1 -1 {height}  -1 1 {height}  1 1 {height}  1 -1 {height}]\n")
                + "Material \"diffuse\" \"rgb reflectance\" [ 1 1 1 ]\n"
                + FLOOR;
            let mut job = job(folder.path(), &text, AccelKind::Embree).unwrap();
            let answer = oracle(&sky, x, height);
            for (estimator, settings) in estimators() {
                choose(&mut job, &settings);
                let what = format!("{estimator}, contrast {contrast}, at {x}, {height}");
                assert_answer(&mut job, 16, [answer; 3], 0.1, &what);
            }
        }
    }
}

#[test]
fn what_is_wrong_with_a_portal_is_said_with_its_place() {
    let text = |portal: &str| camera(LOOKS[0], 1) + "LightSource \"infinite\" \"rgb L\" [ 3 2 1 ] " + portal;
    let line = text("").lines().count();
    for (portal, message) in [
        ("\"point3 portal\" [0 0 0  1 0 0  1 1 0]", "a portal has four corners"),
        ("\"point3 portal\" [0 0 0  1 0 0  1 1 0  0 2 0]", "a portal is a rectangle"),
        ("\"float portal\" [0 0 0  1 0 0  1 1 0  0 1 0]", "has the wrong type"),
    ] {
        let error = job(Path::new("."), &text(portal), AccelKind::Bvh).err().unwrap();
        assert!(error.contains(message) && error.contains(&format!("room.pbrt:{line}:")), "{portal}: {error}");
    }
}

#[test]
fn a_portal_that_lights_nothing_is_a_warning() {
    let folder = folder();
    let warnings = |portal: &str| {
        let text = camera(LOOKS[0], 1) + &sky(portal) + ROOM;
        let loaded = load_text(&text, "room.pbrt", folder.path(), &LoadOptions::default(), &FileCache::default());
        loaded.map_err(|d| d.to_string()).unwrap().warnings.to_string()
    };
    // The lintel lies outside, and would be lit from there
    assert_eq!(warnings(WINDOW), "");
    let reversed = r#""point3 portal" [-0.4 -0.3 2  0.5 -0.3 2  0.5 0.6 2  -0.4 0.6 2]"#;
    let warning = warnings(reversed);
    assert!(warning.contains("its light will not be seen") && warning.contains("room.pbrt:7:"), "{warning}");
}

//! glTF scenes: contents of small files, agreement with the same scenes in pbrt format, and errors without panics.

mod animations;
mod broken;
mod materials;
mod nodes;

use lumiris::geometry::PrimitiveCounts;
use lumiris::import::cache::FileCache;
use lumiris::import::gltf::LightUnits;
use lumiris::import::{LoadOptions, Loaded, load, load_text};
use lumiris::render::output::channels;
use lumiris::render::{RenderSettings, render};
use lumiris::scene::AccelKind;
use lumiris_numbers::math::{Bounds3, Vec2, Vec3};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// A container with a JSON document and a buffer.
fn container(json: &str, mut bytes: Vec<u8>) -> Vec<u8> {
    let mut text = json.as_bytes().to_vec();
    text.resize(text.len().next_multiple_of(4), b' ');
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend(((28 + text.len() + bytes.len()) as u32).to_le_bytes());
    for (kind, chunk) in [(0x4e4f_534a_u32, text), (0x004e_4942, bytes)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind.to_le_bytes());
        file.extend(chunk);
    }
    file
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// A container with a triangle of a principled material, a light and a camera.
fn triangle() -> Vec<u8> {
    let json = r#"{"asset":{"version":"2.0"},"scene":0,"extensionsUsed":["KHR_lights_punctual"],
        "extensions":{"KHR_lights_punctual":{"lights":[{"type":"point","intensity":683}]}},
        "scenes":[{"nodes":[0,1,2]}],
        "nodes":[{"mesh":0},{"translation":[0,0,2],"extensions":{"KHR_lights_punctual":{"light":0}}},
                 {"translation":[0,0,3],"camera":0}],
        "cameras":[{"type":"perspective","perspective":{"yfov":0.7,"znear":0.1,"aspectRatio":2}}],
        "materials":[{"pbrMetallicRoughness":{"baseColorFactor":[1,0.5,0.25,1],"metallicFactor":0},
            "extensions":{"KHR_materials_sheen":{"sheenColorFactor":[0.2,0.9,0.5],"sheenRoughnessFactor":0.7}}}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1,"material":0}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
                     {"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}],
        "bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6}],
        "buffers":[{"byteLength":42}]}"#;
    let mut bytes = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    bytes.extend([0_u16, 1, 2].iter().flat_map(|v| v.to_le_bytes()));
    container(json, bytes)
}

fn loaded(folder: &Path, bytes: &[u8]) -> Result<Loaded, String> {
    let path = folder.join("a.glb");
    std::fs::write(&path, bytes).unwrap();
    load(&path, &LoadOptions::default()).map_err(|report| report.to_string())
}

/// Bounds of the scene of `nodes` and `rest`. The accessors have `values`: three vectors each, except for the third
/// one, which has a matrix.
fn bounds(nodes: &str, rest: &str, values: &[f32]) -> Result<(Bounds3, Loaded), String> {
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0,1]}}],"nodes":[{nodes}],{rest},
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}},
                     {{"bufferView":0,"byteOffset":36,"componentType":5126,"count":3,"type":"VEC3"}},
                     {{"bufferView":0,"byteOffset":72,"componentType":5126,"count":1,"type":"MAT4"}},
                     {{"bufferView":0,"byteOffset":136,"componentType":5121,"count":3,"type":"VEC4"}},
                     {{"bufferView":0,"byteOffset":148,"componentType":5121,"count":3,"type":"VEC4","normalized":true}}],
        "bufferViews":[{{"buffer":0,"byteLength":160}}],"buffers":[{{"byteLength":160}}]}}"#
    );
    let mut bytes = floats(values);
    bytes.resize(148, 0);
    bytes.extend([255, 0, 0, 0].repeat(3));
    let folder = tempfile::tempdir().unwrap();
    let loaded = loaded(folder.path(), &container(&json, bytes))?;
    Ok((loaded.scene.geometry.world_bounds(), loaded))
}

/// A triangle, morph offsets of its vertices, and a translation by (0, 0, 5).
const VALUES: [f32; 34] = [
    0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, // vertices
    0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 4.0, // changes
    1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 5.0, 1.0,
];

/// A file with one text replaced by another of the same length.
fn replaced(file: &[u8], from: &str, to: &str) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let at = file.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
    [&file[..at], to.as_bytes(), &file[at + from.len()..]].concat()
}

/// An image of one pixel.
const PIXEL: &str = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGNoaPgPAAODAgAApfuJAAAAAElFTkSuQmCC";

#[test]
fn a_triangle_with_a_light_and_a_camera_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let scene = loaded(folder.path(), &triangle()).unwrap().scene;
    assert_eq!(scene.geometry.primitive_counts(), PrimitiveCounts { triangles: 1, ..PrimitiveCounts::default() });
    assert_eq!(scene.film.resolution, [1440, 720]);
    assert!(
        (scene.lights.lights[0].power_luminance(1.0) - 4.0 * std::f32::consts::PI).abs() < 1e-3,
        "683 cd are 1 W/sr"
    );
}

#[test]
fn lights_are_in_watts_or_in_the_candela_of_emission() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    let light = |file: &[u8], light_units| {
        std::fs::write(&path, file).unwrap();
        let options = LoadOptions { light_units, ..LoadOptions::default() };
        load(&path, &options).unwrap().scene.lights.lights[0].power_luminance(1.0)
    };
    // Blanks compensate for the different lengths
    let [point, sun] = [("point", 8), ("directional", 2)]
        .map(|(kind, blanks)| format!("\"type\":\"{kind}\",\"intensity\":683}}]}}}},\n{:blanks$}\"scenes\"", ""));
    let sun = replaced(&triangle(), &point, &sun);
    for (file, watts) in [(triangle(), 4.0 * std::f32::consts::PI), (sun, std::f32::consts::PI)] {
        for (units, factor) in [(None, 1.0), (Some(LightUnits::Watt), 1.0), (Some(LightUnits::Candela), 683.0)] {
            let found = light(&file, units);
            assert!((found / (watts * factor) - 1.0).abs() < 1e-5, "{units:?}: {found}");
        }
    }
}

#[test]
fn a_range_of_a_light_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let said = |file: &[u8]| loaded(folder.path(), file).unwrap().warnings.to_string();
    assert!(!said(&triangle()).contains("range"));
    let file = replaced(&triangle(), r#""intensity":683"#, r#""range":2      "#);
    let said = said(&file);
    assert!(said.contains("no range") && said.contains("lights[0].range"), "{said}");
}

#[test]
fn a_scene_looks_like_the_same_scene_of_pbrt() {
    let folder = tempfile::tempdir().unwrap();
    let text = r#"Scale -1 1 1
        LookAt 0 0 3  0 0 0  0 1 0
        Camera "perspective" "float fov" 40.107045
        WorldBegin
        LightSource "point" "rgb I" [1 1 1] "point3 from" [0 0 2]
        Material "principled" "rgb base_color" [1 0.5 0.25] "float specular_roughness" 1
            "float fuzz_weight" 1 "rgb fuzz_color" [0.2 0.9 0.5] "float fuzz_roughness" 0.7
        Shape "trianglemesh" "point3 P" [0 0 0  1 0 0  0 1 0] "integer indices" [0 1 2]"#;
    let options = LoadOptions { resolution: Some([64, 32]), ..LoadOptions::default() };
    let of_pbrt = load_text(text, "a.pbrt", folder.path(), &options, &FileCache::default());
    let path = folder.path().join("a.glb");
    std::fs::write(&path, triangle()).unwrap();
    let [a, b] = [load(&path, &options), of_pbrt].map(|loaded| {
        let mut loaded = loaded.map_err(|report| report.to_string()).unwrap();
        loaded.settings = lumiris::settings::Settings::default();
        let job = loaded.job(AccelKind::Embree, None).unwrap();
        let settings = RenderSettings { spp: 16, ..RenderSettings::default() };
        channels(&render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film, &[], None).data
    });
    // The cameras differ by rounding, so a few samples at edges may differ
    let different = a.iter().zip(&b).filter(|(a, b)| (*a - *b).abs() > 1e-3 * a.abs().max(1e-3)).count();
    assert!(different * 50 < a.len(), "{different} of {} values differ", a.len());
    let [sum_a, sum_b]: [f32; 2] = [&a, &b].map(|data| data.iter().sum());
    assert!(sum_a > 1.0 && (sum_a / sum_b - 1.0).abs() < 1e-3, "{sum_a} {sum_b}");
}

#[test]
fn an_environment_is_seen_as_it_is_stored() {
    let folder = tempfile::tempdir().unwrap();
    let (path, sky) = (folder.path().join("a.gltf"), folder.path().join("sky.pfm"));
    // Columns of 90°: the first two meet in direction −z; the lower row is stored first
    let colors = |row: f32| [[1.0, 0.0, row], [0.0, 1.0, row], [0.0, 0.0, row], [0.0, 0.0, row]].concat();
    std::fs::write(&sky, [b"PF\n4 2\n-1.0\n".to_vec(), floats(&colors(0.0)), floats(&colors(1.0))].concat()).unwrap();
    let json = r#"{"asset":{"version":"2.0"},"nodes":[{"camera":0}],
        "cameras":[{"type":"perspective","perspective":{"yfov":0.5,"znear":0.1}}]}"#;
    std::fs::write(&path, json).unwrap();
    let resolution = Some([2, 2]);
    let options = LoadOptions { resolution, environment: Some(sky), ..LoadOptions::default() };
    let job = load(&path, &options).unwrap().job(AccelKind::Embree, None).unwrap();
    let settings = RenderSettings { spp: 64, ..RenderSettings::default() };
    let image = channels(&render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film, &[], None).data;
    let red_left_of_green = |row: &[f32]| row[0] > 3.0 * row[1] && row[4] > 3.0 * row[3];
    assert!(image.chunks_exact(6).all(red_left_of_green), "{image:?}");
    assert!(image[2] > 3.0 * image[8], "blue above: {image:?}");
}

#[test]
fn orthographic_cameras_see_all_that_they_ask_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    let seen = |resolution, size: &str| {
        let camera = format!(r#"{{"type":"orthographic","orthographic":{{{size}"znear":0.1,"zfar":9}}}}"#);
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"cameras":[{camera}],"nodes":[{{"camera":0,"translation":[0,0,3]}}]}}"#
        );
        std::fs::write(&path, json).unwrap();
        let scene = load(&path, &LoadOptions { resolution, ..LoadOptions::default() }).unwrap().scene;
        let inverse = scene.camera.ndc_from_world().unwrap().inverse();
        // Distance between opposite corners of the image, in either order
        let corners = [Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0)].map(|ndc| inverse.project_point3(ndc));
        (scene.film.resolution, (corners[1] - corners[0]).abs().truncate())
    };
    let near = |(resolution, size): ([u32; 2], Vec2), expected: ([u32; 2], [f32; 2])| {
        assert_eq!(resolution, expected.0);
        assert!((size - Vec2::from(expected.1)).abs().max_element() < 1e-4, "{size}");
    };
    let high = r#""xmag":1,"ymag":2,"#;
    near(seen(None, high), ([360, 720], [2.0, 4.0]));
    near(seen(Some([50, 100]), high), ([50, 100], [2.0, 4.0]));
    near(seen(Some([100, 100]), high), ([100, 100], [4.0, 4.0]));
    // The height follows from the width
    near(seen(Some([100, 400]), high), ([100, 400], [2.0, 8.0]));
    near(seen(None, r#""ymag":3,"#), ([720, 720], [6.0, 6.0]));
    near(seen(None, r#""xmag":0,"ymag":0,"#), ([1280, 720], [2.0 * 16.0 / 9.0, 2.0]));
}

//! glTF scenes: what small ones become, that they look like the same scenes of pbrt, and that broken ones are refused
//! without a panic.

use lumiris::geometry::Shape;
use lumiris::import::cache::FileCache;
use lumiris::import::gltf::LightUnits;
use lumiris::import::{LoadOptions, Loaded, load, load_text};
use lumiris::lights::{AreaLight, Light};
use lumiris::render::output::{Aov, channels};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::AccelKind;
use lumiris_numbers::math::{Bounds3, Rgb, Vec2, Vec3};
use lumiris_test_support::random::{RngExt, pcg32};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// A container of some JSON and bytes.
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

/// A container of a triangle with a principled material, a light and a camera.
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

/// Bounds of the scene of `nodes` and `rest`, whose accessors have `values`: three vectors each, but a matrix for the
/// third one.
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

/// A triangle, the changes of its vertices, and a translation by (0, 0, 5).
const VALUES: [f32; 34] = [
    0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, // vertices
    0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 4.0, // changes
    1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 5.0, 1.0,
];

#[test]
fn a_triangle_with_a_light_and_a_camera_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let scene = loaded(folder.path(), &triangle()).unwrap().scene;
    assert_eq!(scene.geometry.primitive_counts(), (1, 0, 0));
    assert_eq!(scene.film.resolution, [1440, 720]);
    assert!((scene.lights.lights[0].phi(1.0) - 4.0 * std::f32::consts::PI).abs() < 1e-3, "683 cd are 1 W/sr");
}

#[test]
fn lights_are_in_watts_or_in_the_candela_of_emission() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    let light = |file: &[u8], light_units| {
        std::fs::write(&path, file).unwrap();
        let options = LoadOptions { light_units, ..LoadOptions::default() };
        load(&path, &options).unwrap().scene.lights.lights[0].phi(1.0)
    };
    // Blanks make up for the length of the word
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

/// A file in which a text is another of the same length.
fn replaced(file: &[u8], from: &str, to: &str) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let at = file.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
    [&file[..at], to.as_bytes(), &file[at + from.len()..]].concat()
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
    // The cameras are not the same to the bit, so a few samples at edges may differ
    let different = a.iter().zip(&b).filter(|(a, b)| (*a - *b).abs() > 1e-3 * a.abs().max(1e-3)).count();
    assert!(different * 50 < a.len(), "{different} of {} values differ", a.len());
    let [sum_a, sum_b]: [f32; 2] = [&a, &b].map(|data| data.iter().sum());
    assert!(sum_a > 1.0 && (sum_a / sum_b - 1.0).abs() < 1e-3, "{sum_a} {sum_b}");
}

#[test]
fn an_environment_is_seen_as_it_is_stored() {
    let folder = tempfile::tempdir().unwrap();
    let (path, sky) = (folder.path().join("a.gltf"), folder.path().join("sky.pfm"));
    // Columns of 90°: the first two meet in direction −z; the lower row is the first one
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

/// A file of one pixel.
const PIXEL: &str = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGNoaPgPAAODAgAApfuJAAAAAElFTkSuQmCC";

#[test]
fn morph_targets_have_their_default_weights() {
    let mesh = |weights: &str| {
        format!(
            r#""meshes":[{{{weights}"primitives":[{{"attributes":{{"POSITION":0}},"targets":[{{"POSITION":1}}]}}]}}]"#
        )
    };
    let top = |nodes: &str, weights: &str| bounds(nodes, &mesh(weights), &VALUES).unwrap().0.max;
    assert_eq!(top(r#"{"mesh":0},{}"#, ""), Vec3::new(1.0, 1.0, 0.0));
    assert_eq!(top(r#"{"mesh":0},{}"#, r#""weights":[0.5],"#), Vec3::new(2.0, 1.0, 2.0));
    let of_node = r#"{"mesh":0,"weights":[1],"translation":[0,1,0]},{}"#;
    assert_eq!(top(of_node, r#""weights":[0.5],"#), Vec3::new(3.0, 2.0, 4.0));
}

#[test]
fn unlit_surfaces_emit_the_colours_of_their_vertices_and_others_do_not() {
    let light = |material: &str| -> AreaLight {
        let mesh = format!(
            r#""materials":[{{{material}}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"COLOR_0":1}},"material":0}}]}}]"#
        );
        let (_, loaded) = bounds(r#"{"mesh":0},{}"#, &mesh, &VALUES).unwrap();
        let [Light::Area(light)] = &loaded.scene.lights.lights[..] else { panic!("{:?}", loaded.scene.lights) };
        light.clone()
    };
    // The colours are (0, 0, 0), (2, 0, 0) and (0, 0, 4)
    let factor = r#""pbrMetallicRoughness":{"baseColorFactor":[0.5,0.5,0.5,1]}"#;
    let unlit = light(&format!(r#"{factor},"extensions":{{"KHR_materials_unlit":{{}}}}"#)).mean_radiance();
    assert!((unlit - Rgb::new(1.0 / 3.0, 0.0, 2.0 / 3.0)).map(f32::abs).max_component() < 1e-6, "{unlit:?}");
    let lit = light(&format!(r#"{factor},"emissiveFactor":[1,1,1]"#)).mean_radiance();
    assert_eq!(lit, Rgb::WHITE);
}

#[test]
fn specular_glossiness_goes_before_its_fallback() {
    let loaded = |fallback: &str| {
        let mesh = format!(
            r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"material":0}}]}}],
            "images":[{{"uri":"nope.png"}}],"textures":[{{"source":0}}],"materials":[{{{fallback}
                "extensions":{{"KHR_materials_pbrSpecularGlossiness":{{"diffuseFactor":[0.1,0.2,0.3,1],"glossinessFactor":0.25}}}}}}]"#
        );
        let (_, loaded) = bounds(r#"{"mesh":0},{}"#, &mesh, &VALUES).unwrap();
        format!("{:?} {:?}", loaded.scene.materials, loaded.scene.textures)
    };
    let alone = loaded("");
    assert_eq!(loaded(r#""pbrMetallicRoughness":{},"#), alone);
    let whole = r#""baseColorFactor":[1,0,0,1],"baseColorTexture":{"index":0},"metallicRoughnessTexture":{"index":0}"#;
    assert_eq!(loaded(&format!(r#""pbrMetallicRoughness":{{{whole}}},"#)), alone);
    assert!(alone.contains("0.75") && alone.contains("0.3"), "{alone}");
}

#[test]
fn texture_coordinates_beyond_the_second_are_told_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    let texture = r#"{"index":0,"texCoord":2}"#;
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"images":[{{"uri":"data:image/png;base64,{PIXEL}"}}],"textures":[{{"source":0}}],
        "materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{texture},"metallicRoughnessTexture":{texture}}},
            "normalTexture":{{"index":0,"extensions":{{"KHR_texture_transform":{{"texCoord":3}}}}}},
            "emissiveTexture":{texture}}},
            {{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0,"texCoord":1}}}}}}]}}"#
    );
    std::fs::write(&path, json).unwrap();
    let said = load(&path, &LoadOptions::default()).unwrap().warnings.to_string();
    assert_eq!(said.matches("TEXCOORD_2 is not read: textures have TEXCOORD_0").count(), 1, "{said}");
    assert_eq!(said.matches("TEXCOORD_3 is not read").count(), 1, "{said}");
    assert!(said.contains("materials[0].pbrMetallicRoughness.baseColorTexture.texCoord"), "{said}");
    assert!(!said.contains("TEXCOORD_1"), "{said}");
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
        // From corner to corner of the image, whatever it calls them
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
    // The width is what the height follows
    near(seen(Some([100, 400]), high), ([100, 400], [2.0, 8.0]));
    near(seen(None, r#""ymag":3,"#), ([720, 720], [6.0, 6.0]));
    near(seen(None, r#""xmag":0,"ymag":0,"#), ([1280, 720], [2.0 * 16.0 / 9.0, 2.0]));
}

#[test]
fn hidden_nodes_and_their_children_are_left_out_but_for_cameras_and_joints() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    let load_with = |visible: &str, child: &str| {
        // (0, 0, 0), (1, 0, 0) and (0, 1, 0)
        let data = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"extensionsRequired":["KHR_node_visibility","KHR_lights_punctual"],
            "scenes":[{{"nodes":[0,2]}}],
            "nodes":[{{"children":[1],"mesh":0,"extensions":{{"KHR_node_visibility":{{{visible}}}}}}},
                {{"mesh":0,"camera":0,"translation":[5,0,3],
                  "extensions":{{"KHR_lights_punctual":{{"light":0}},"KHR_node_visibility":{{{child}}}}}}},
                {{"mesh":0}}],
            "extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"point"}}]}}}},
            "cameras":[{{"type":"perspective","perspective":{{"yfov":0.7,"znear":0.1,"aspectRatio":2}}}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}}],
            "bufferViews":[{{"buffer":0,"byteLength":36}}],
            "buffers":[{{"byteLength":36,"uri":"data:application/octet-stream;base64,{data}"}}]}}"#
        );
        std::fs::write(&path, json).unwrap();
        let scene = load(&path, &LoadOptions::default()).map_err(|report| report.to_string()).unwrap().scene;
        let points = scene.lights.lights.iter().filter(|light| matches!(light, Light::Point { .. })).count();
        assert_eq!(scene.film.resolution, [1440, 720], "the camera is there");
        (scene.geometry.world_bounds().max.x, points)
    };
    assert_eq!(load_with("", ""), (6.0, 1));
    assert_eq!(load_with(r#""visible":true"#, ""), (6.0, 1));
    assert_eq!(load_with("", r#""visible":false"#), (1.0, 0));
    assert_eq!(load_with(r#""visible":false"#, r#""visible":true"#), (1.0, 0));
}

#[test]
fn skins_follow_their_joints_and_not_their_node() {
    let rest = |joint: u32| {
        format!(
            r#""skins":[{{"joints":[1],"inverseBindMatrices":2}}],"meshes":[{{"primitives":[
            {{"attributes":{{"POSITION":0,"JOINTS_0":{joint},"WEIGHTS_0":4}}}}]}}]"#
        )
    };
    let nodes = r#"{"mesh":0,"skin":0,"translation":[9,9,9]},{"translation":[10,0,0],"scale":[2,1,1]}"#;
    let (bounds_of_skin, _) = bounds(nodes, &rest(3), &VALUES).unwrap();
    assert_eq!((bounds_of_skin.min, bounds_of_skin.max), (Vec3::new(10.0, 0.0, 5.0), Vec3::new(12.0, 1.0, 5.0)));
    let hidden = nodes.replace(r#""scale""#, r#""extensions":{"KHR_node_visibility":{"visible":false}},"scale""#);
    assert_eq!(bounds(&hidden, &rest(3), &VALUES).unwrap().0, bounds_of_skin, "joints need not be seen");
    let error = bounds(nodes, &rest(4), &VALUES).map(|_| ()).unwrap_err();
    assert!(error.contains("JOINTS_0") && error.contains("of 1"), "{error}");
}

#[test]
fn meshes_that_stand_twice_are_instances() {
    let mesh = r#""meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}]"#;
    let (bounds, loaded) = bounds(r#"{"mesh":0},{"mesh":0,"scale":[-3,1,1]}"#, mesh, &VALUES).unwrap();
    let geometry = &loaded.scene.geometry;
    assert_eq!((geometry.groups.len(), geometry.instances.len(), geometry.geometries.len()), (1, 2, 1));
    assert_eq!((bounds.min, bounds.max), (Vec3::new(-3.0, 0.0, 0.0), Vec3::new(1.0, 1.0, 0.0)));
    assert!(loaded.warnings.to_string().contains("no light"), "{}", loaded.warnings);
}

#[test]
fn what_is_not_read_is_an_error_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let changed = |from: &str, to: &str| {
        let to = format!("{to:0$}", from.len());
        loaded(folder.path(), &replaced(&triangle(), from, &to)).map(|_| ()).unwrap_err()
    };
    let error = changed(r#""extensionsUsed":["KHR_lights_punctual"]"#, r#""extensionsRequired":["KHR_draco_mesh"]"#);
    assert!(error.contains("extensionsRequired[0]") && error.contains("KHR_draco_mesh"), "{error}");
    let error = changed(r#""count":3,"type":"VEC3""#, r#""count":9,"type":"VEC3""#);
    assert!(error.contains("accessors[0]"), "{error}");
    let error = changed(r#""indices":1"#, r#""indices":7"#);
    assert!(error.contains("meshes[0].primitives[0].indices") && error.contains("a.glb, byte"), "{error}");
    let error = changed(r#""mesh":0}"#, r#""mesh":0]"#);
    assert!(error.contains("a.glb, byte"), "{error}");
    let error = loaded(folder.path(), &triangle()[..50]).map(|_| ()).unwrap_err();
    assert!(error.contains("byte 8: ") && error.contains("a.glb, byte 8"), "{error}");
    assert!(!error.contains("glTF"), "bytes are not shown: {error}");
    let error = loaded(folder.path(), &triangle()[..5]).map(|_| ()).unwrap_err();
    assert!(error.contains("ends after 5 of the 12 bytes") && error.contains("a.glb, byte 5"), "{error}");
    let mut old = triangle();
    old[4] = 1;
    let error = loaded(folder.path(), &old).map(|_| ()).unwrap_err();
    assert!(error.contains("has version 1,"), "{error}");
}

/// A triangle in text, whose positions, base colour and emission are in files.
const WITH_FILES: &str = r#"{"asset":{"version":"2.0"},"nodes":[{"mesh":0}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0},"material":0}]}],
    "materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}},
                  "emissiveFactor":[1,1,1],"emissiveTexture":{"index":1}}],
    "textures":[{"source":0},{"source":1}],
    "images":[{"uri":"skin.png"},
              {"uri":"glow.png"}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],
    "bufferViews":[{"buffer":0,"byteLength":36}],
    "buffers":[{"byteLength":36,"uri":"a.bin"},
               {"byteLength":4,"uri":"b%20.bin"}]}"#;

#[test]
fn missing_buffers_images_and_environments_are_one_list_with_places() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    std::fs::write(&path, WITH_FILES).unwrap();
    let options = LoadOptions { environment: Some(folder.path().join("sky.hdr")), ..LoadOptions::default() };
    let report = |options| load(&path, options).map(|_| ()).unwrap_err();
    let all = report(&options);
    let text = all.to_string();
    assert_eq!(all.errors, 1, "{text}");
    for (name, place) in [("a.bin", "10:39"), ("b .bin", "11:38"), ("skin.png", "6:22"), ("glow.png", "7:22")] {
        assert!(text.contains(&format!("{name}: no such file, asked for at {}:{place}", path.display())), "{text}");
    }
    assert!(text.contains("5 files cannot") && text.contains("sky.hdr: no such file, asked for by --env"), "{text}");

    // Where the buffers are there, the images are still missing
    for (name, bytes) in [("a.bin", floats(&VALUES[..9])), ("b .bin", vec![0; 4])] {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    let text = report(&options).to_string();
    assert!(text.contains("3 files cannot") && text.contains("a.gltf:7:22") && text.contains("sky.hdr"), "{text}");
}

#[test]
fn broken_images_and_buffers_are_errors_where_they_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    std::fs::write(&path, WITH_FILES).unwrap();
    for (name, bytes) in [("a.bin", vec![0; 35]), ("b .bin", vec![0; 3]), ("skin.png", b"\x89PNG".to_vec())] {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    std::fs::write(folder.path().join("glow.png"), "no image").unwrap();
    let report = load(&path, &LoadOptions::default()).map(|_| ()).unwrap_err();
    let places: Vec<String> = report.entries.iter().filter_map(|e| Some(e.location.as_ref()?.to_string())).collect();
    let places: Vec<&str> = places.iter().map(|place| place.rsplit_once(".gltf:").unwrap().1).collect();
    for place in ["10:30", "11:30", "6:22", "7:22"] {
        assert!(places.contains(&place), "{places:?}: {report}");
    }
}

#[test]
fn broken_containers_never_panic() {
    let (folder, mut random) = (tempfile::tempdir().unwrap(), pcg32([6, 1, 8]));
    let mut refused = 0;
    for i in 0..3000 {
        let mut bytes = triangle();
        let length = bytes.len();
        if i % 4 == 0 {
            bytes.truncate(random.random_range(0..length));
        } else {
            for _ in 0..1 + i % 5 {
                let at = random.random_range(0..length);
                bytes[at] ^= 1 << random.random_range(0..8_u32);
            }
        }
        let outcome = catch_unwind(AssertUnwindSafe(|| loaded(folder.path(), &bytes)));
        refused += usize::from(outcome.unwrap_or_else(|_| panic!("mutation {i} panicked")).is_err());
    }
    assert!(refused > 1000, "{refused}");
}

/// What is said of a scene with a principled material of these parameters.
fn said_of_principled(parameters: &str) -> String {
    let text = format!("WorldBegin\nMaterial \"principled\" {parameters}\nShape \"sphere\"\n");
    let loaded = load_text(&text, "a.pbrt", Path::new(""), &LoadOptions::default(), &FileCache::default());
    loaded.map_or_else(|report| report.to_string(), |loaded| loaded.warnings.to_string())
}

#[test]
fn numbers_of_principled_materials_outside_of_their_ranges_are_errors_with_places() {
    let wrong = [
        ("\"float base_metalness\" 2", "base_metalness must be from 0 to 1, not 2"),
        ("\"float specular_roughness\" -1", "specular_roughness must be from 0 to 1, not -1"),
        ("\"float specular_roughness_anisotropy\" 1.5", "must be from 0 to 1, not 1.5"),
        ("\"float sheen\" 1.5", "sheen must be from 0 to 1, not 1.5"),
        ("\"float anisotropic\" 2", "anisotropic must be from 0 to 1, not 2"),
        ("\"float fuzz_weight\" 1.5", "fuzz_weight must be from 0 to 1, not 1.5"),
        ("\"float specular_ior\" 0", "an index of refraction must be positive, not 0"),
        ("\"rgb base_color\" [0.5 2 0.5]", "base_color must be from 0 to 1, not 0.5 2 0.5"),
        ("\"rgb specular_color\" [0.5 -1 0.5]", "specular_color must be 0 or more, not 0.5 -1 0.5"),
    ];
    for (parameters, message) in wrong {
        let said = said_of_principled(parameters);
        assert!(said.contains(message) && said.contains("a.pbrt:2:23"), "{said}");
    }
    let right =
        "\"float coat_weight\" 1 \"rgb specular_color\" [3 1 0] \"rgb base_color\" [0 1 1] \"float coat_roughness\" 0";
    assert!(!said_of_principled(right).contains("must be"), "{}", said_of_principled(right));
}

#[test]
fn names_of_blender_and_disney_mean_those_of_openpbr() {
    let material = |parameters: &str| {
        let text =
            format!("WorldBegin\nLightSource \"infinite\"\nMaterial \"principled\" {parameters}\nShape \"sphere\"\n");
        let loaded = load_text(&text, "a.pbrt", Path::new(""), &LoadOptions::default(), &FileCache::default());
        let loaded = loaded.map_err(|report| report.to_string()).unwrap();
        assert_eq!(loaded.warnings.to_string(), "");
        format!("{:?} {:?}", loaded.scene.materials, loaded.scene.textures)
    };
    let openpbr = "\"rgb base_color\" [.2 .4 .6] \"float base_metalness\" .1 \"float specular_roughness\" .4 \"float specular_ior\" 1.4
        \"rgb specular_color\" [1 .5 1] \"float transmission_weight\" .2 \"float fuzz_weight\" .3 \"rgb fuzz_color\" [1 .9 .8]
        \"float fuzz_roughness\" .6 \"float coat_weight\" .7 \"bool geometry_thin_walled\" true";
    let others = "\"rgb basecolor\" [.2 .4 .6] \"float metallic\" .1 \"float roughness\" .4 \"float ior\" 1.4
        \"rgb specular_tint\" [1 .5 1] \"float spectrans\" .2 \"float sheen_weight\" .3 \"rgb sheen_tint\" [1 .9 .8]
        \"float sheen_roughness\" .6 \"float clearcoat\" .7 \"bool thin\" true";
    assert_eq!(material(openpbr), material(others));
    assert!(
        material("\"float specular\" 1 \"float anisotropic\" .5 \"float clearcoatgloss\" 1").contains("Disney(0.5)")
    );
    let said = said_of_principled("\"float metallic\" 0.5 \"float base_metalness\" 0.5");
    assert!(said.contains("metallic is base_metalness, which is given as well"), "{said}");
}

#[test]
fn suggestions_for_parameters_name_what_is_wanted() {
    let said = said_of_principled("\"float base_roughness\" 0.5");
    assert!(said.contains("did you mean `specular_roughness`?"), "{said}");
    let said = said_of_principled("\"texture specular_ior\" \"x\"");
    assert!(said.contains("write `float specular_ior` or `spectrum specular_ior`"), "{said}");
}

/// A triangle that an animation moves, turns and bends: keys at 1 s and 3 s.
fn animated(rest: &str) -> Vec<u8> {
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0,"weights":[0.25]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"targets":[{{"POSITION":1}}]}}]}}],
        "animations":[{{"samplers":[{{"input":2,"output":3}},{{"input":2,"output":4}},{{"input":2,"output":5,"interpolation":"STEP"}},
                                   {{"input":2,"output":6}}],
            "channels":[{{"sampler":0,"target":{{"node":0,"path":"translation"}}}},{{"sampler":1,"target":{{"node":0,"path":"rotation"}}}},
                        {{"sampler":2,"target":{{"node":0,"path":"weights"}}}}{rest}]}},
            {{"samplers":[{{"input":2,"output":6}}],"channels":[{{"sampler":0,"target":{{"node":0,"path":"translation"}}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}},
                     {{"bufferView":0,"byteOffset":36,"componentType":5126,"count":3,"type":"VEC3"}},
                     {{"bufferView":0,"byteOffset":72,"componentType":5126,"count":2,"type":"SCALAR"}},
                     {{"bufferView":0,"byteOffset":80,"componentType":5126,"count":2,"type":"VEC3"}},
                     {{"bufferView":0,"byteOffset":104,"componentType":5126,"count":2,"type":"VEC4"}},
                     {{"bufferView":0,"byteOffset":136,"componentType":5126,"count":2,"type":"SCALAR"}},
                     {{"bufferView":0,"byteOffset":144,"componentType":5126,"count":2,"type":"VEC3"}}],
        "bufferViews":[{{"buffer":0,"byteLength":168}}],"buffers":[{{"byteLength":168}}]}}"#
    );
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let values = [
        &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0][..], // vertices
        &[0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 4.0],     // changes
        &[1.0, 3.0],                                        // times
        &[10.0, 0.0, 0.0, 20.0, 0.0, 0.0],                  // translation
        &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half],        // rotation: 90° about z
        &[0.0, 1.0],                                        // weights
        &[100.0, 0.0, 0.0, 100.0, 0.0, 0.0],                // translation by another animation
    ];
    container(&json, floats(&values.concat()))
}

#[test]
fn animations_move_nodes_and_bend_meshes_at_a_time() {
    let folder = tempfile::tempdir().unwrap();
    let at = |bytes: &[u8], time: Option<f32>| {
        let path = folder.path().join("a.glb");
        std::fs::write(&path, bytes).unwrap();
        let options = LoadOptions { time, ..LoadOptions::default() };
        load(&path, &options).map_err(|report| report.to_string())
    };
    let file = animated("");
    let vertices = |time| {
        let scene = at(&file, time).unwrap().scene;
        let Shape::Mesh(mesh) = &scene.geometry.geometries[0].shape else { panic!("a mesh") };
        mesh.positions().to_vec()
    };
    let near = |time, expected: [[f32; 3]; 3]| {
        let found = vertices(time);
        let off = found.iter().zip(expected).map(|(a, b)| (*a - Vec3::from(b)).length()).fold(0.0, f32::max);
        assert!(off < 1e-4, "{time:?}: {found:?}");
    };
    // At rest: the weight of the node
    near(None, [[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [0.0, 1.0, 1.0]]);
    near(Some(0.0), [[10.0, 0.0, 0.0], [11.0, 0.0, 0.0], [10.0, 1.0, 0.0]]);
    // Half of the way: turned by 45°; steps have not been made
    let half = std::f32::consts::FRAC_1_SQRT_2;
    near(Some(2.0), [[15.0, 0.0, 0.0], [15.0 + half, half, 0.0], [15.0 - half, half, 0.0]]);
    near(Some(7.0), [[20.0, 0.0, 0.0], [20.0, 3.0, 0.0], [19.0, 0.0, 4.0]]);

    let error = |rest: &str| at(&animated(rest), Some(1.0)).map(|_| ()).unwrap_err();
    let wrong = error(r#",{"sampler":9,"target":{"node":0,"path":"scale"}}"#);
    assert!(wrong.contains("is not there") && wrong.contains("animations[0].channels[3].sampler"), "{wrong}");
    let wrong = error(r#",{"sampler":1,"target":{"node":0,"path":"scale"}}"#);
    assert!(wrong.contains("has not 3 numbers for each key"), "{wrong}");
    let still = at(&triangle(), Some(1.0)).unwrap().warnings.to_string();
    assert!(still.contains("no animation"), "{still}");
}

#[test]
fn a_camera_that_frames_an_animation_is_the_same_at_all_times_and_sees_all_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    std::fs::write(&path, animated("")).unwrap();
    let at = |time| {
        let options = LoadOptions { time: Some(time), resolution: Some([64, 64]), ..LoadOptions::default() };
        load(&path, &options).map_err(|report| report.to_string()).unwrap().scene
    };
    let view = |time| {
        let scene = at(time);
        let corners = [[0.0, 0.0], [64.0, 0.0], [0.0, 64.0], [64.0, 64.0]];
        let rays = corners.map(|[x, y]| scene.camera.ray(Vec2::new(x, y), [0.5; 2], 0.5).ray);
        (scene.origin, rays.map(|ray| (ray.o, ray.d)))
    };
    let first = view(1.0);
    for time in [0.0, 1.7, 2.0, 3.0, 9.0] {
        assert_eq!(view(time), first, "at {time} s");
        // What is seen lies between the rays of the corners
        let (_, [(o, a), (_, b), (_, c), (_, d)]) = first;
        let bounds = at(time).geometry.world_bounds();
        for p in [bounds.min, bounds.max] {
            let inside = [(a, b), (b, d), (d, c), (c, a)].map(|(u, v)| u.cross(v).dot(p - o).signum());
            assert!(inside.iter().all(|side| *side == inside[0]), "{p} at {time} s");
        }
    }
}

/// A box 2 wide, with glass that bends nothing and absorbs, seen from outside in white surroundings.
fn glass(volume: &str) -> Vec<u8> {
    glass_of(1.0, &format!(r#""KHR_materials_volume":{{{volume}}}"#))
}

/// A box 2 wide of glass of an index, with extensions, seen from outside in white surroundings.
fn glass_of(ior: f32, extensions: &str) -> Vec<u8> {
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0,1]}}],
        "nodes":[{{"mesh":0}},{{"translation":[0.1,0.2,9],"camera":0}}],
        "cameras":[{{"type":"orthographic","orthographic":{{"xmag":0.01,"ymag":0.01,"znear":0.1,"zfar":20}}}}],
        "materials":[{{"pbrMetallicRoughness":{{"metallicFactor":0,"roughnessFactor":0}},"extensions":{{
            "KHR_materials_transmission":{{"transmissionFactor":1}},"KHR_materials_ior":{{"ior":{ior}}},
            {extensions}}}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"material":0}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":8,"type":"VEC3"}},
                     {{"bufferView":1,"componentType":5121,"count":36,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":96}},{{"buffer":0,"byteOffset":96,"byteLength":36}}],
        "buffers":[{{"byteLength":132}}]}}"#
    );
    let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { 1.0 } else { -1.0 });
    let mut bytes = floats(&(0..8).flat_map(corner).collect::<Vec<f32>>());
    // Seen from outside, corners go counterclockwise
    for [a, b, c, d] in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
        bytes.extend([a, b, c, a, c, d]);
    }
    container(&json, bytes)
}

fn load_glass(folder: &Path, bytes: &[u8]) -> Loaded {
    let path = folder.join("a.glb");
    std::fs::write(&path, bytes).unwrap();
    let options = LoadOptions { resolution: Some([4, 4]), ..LoadOptions::default() };
    load(&path, &options).map_err(|r| r.to_string()).unwrap()
}

/// The mean colour that is seen.
fn color_of(folder: &Path, bytes: &[u8], spp: u32) -> [f32; 3] {
    let job = load_glass(folder, bytes).job(AccelKind::Embree, None).unwrap();
    let settings = RenderSettings { spp, ..RenderSettings::default() };
    let data = channels(&render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film, &[], None).data;
    [0, 1, 2].map(|c| data.iter().skip(c).step_by(3).sum::<f32>() / 16.0)
}

#[test]
fn dispersion_has_the_abbe_number_of_the_file_and_leaves_white_light_white() {
    let folder = tempfile::tempdir().unwrap();
    let with = |ior: f32, volume: &str| {
        glass_of(ior, &format!(r#""KHR_materials_dispersion":{{"dispersion":4}},"KHR_materials_volume":{{{volume}}}"#))
    };
    let solid = r#""thicknessFactor":1"#;
    let loaded = load_glass(folder.path(), &with(1.5, solid));
    assert!(!loaded.warnings.to_string().contains("dispersion"), "{}", loaded.warnings);
    let entry = &loaded.scene.materials.entries()[0];
    let dispersion = entry.dispersion.as_ref().unwrap();
    // The Abbe number is 5
    let difference = dispersion.eta(486.13) - dispersion.eta(656.27);
    assert!((dispersion.eta(587.56) - 1.5).abs() < 1e-4 && (difference - 0.1).abs() < 1e-3, "{difference}");
    for (ior, volume) in [(1.5, ""), (1.0, solid), (0.0, solid)] {
        assert!(!load_glass(folder.path(), &with(ior, volume)).scene.materials.has_dispersion(), "{ior} {volume}");
    }
    // Smooth glass without absorption loses nothing of even light, whatever its wavelength
    let plain = color_of(folder.path(), &glass_of(1.5, &format!(r#""KHR_materials_volume":{{{solid}}}"#)), 1024);
    let dispersed = color_of(folder.path(), &with(1.5, solid), 1024);
    for (a, b) in plain.into_iter().zip(dispersed) {
        assert!((a - b).abs() < 0.02, "{plain:?} {dispersed:?}");
    }
}

#[test]
fn light_in_a_volume_has_the_colour_of_its_distance() {
    let folder = tempfile::tempdir().unwrap();
    let near = |volume: &str, expected: [f32; 3]| {
        let found = color_of(folder.path(), &glass(volume), 2048);
        let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 2e-3, "{volume}: {found:?}, not {expected:?}");
    };
    // Two units of the box are four times the distance
    let attenuation = r#""attenuationColor":[0.9,0.5,1],"attenuationDistance":0.5"#;
    near(&format!(r#""thicknessFactor":1,{attenuation}"#), [0.9_f32.powi(4), 0.5_f32.powi(4), 1.0]);
    near(attenuation, [1.0; 3]);
    near(r#""thicknessFactor":1,"attenuationColor":[0.9,0.5,1]"#, [1.0; 3]);
}

/// A square of −1..1 with texture coordinates as images have them (0), turned by 90° (1), and tangents along x whose fourth
/// components are −1 (`TANGENT` 4) and 1 (5); an orthographic camera sees it from +z.
fn square(nodes: &str, attributes: &str, rest: &str) -> Vec<u8> {
    let accessor = |(i, width): (usize, usize)| {
        format!(r#"{{"bufferView":0,"byteOffset":{},"componentType":5126,"count":4,"type":"VEC{width}"}}"#, 64 * i)
    };
    let accessors: Vec<String> = [3, 3, 2, 2, 4, 4].into_iter().enumerate().map(accessor).collect();
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0,1]}}],"nodes":[{{"translation":[0,0,5],"camera":0}},{nodes}],
        "cameras":[{{"type":"orthographic","orthographic":{{"xmag":1,"ymag":1,"znear":0.1,"zfar":20}}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"NORMAL":1,"TEXCOORD_0":2{attributes}}},"indices":6,
            "material":0}}]}}],"textures":[{{"source":0,"sampler":0}}],
        "accessors":[{},{{"bufferView":0,"byteOffset":384,"componentType":5121,"count":6,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":390}}],"buffers":[{{"byteLength":390}}],{rest}}}"#,
        accessors.join(",")
    );
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let bytes = |element: &dyn Fn([f32; 2]) -> Vec<f32>| {
        let mut bytes = floats(&corners.iter().flat_map(|&c| element(c)).collect::<Vec<f32>>());
        bytes.resize(64, 0);
        bytes
    };
    let all = [
        bytes(&|[x, y]| vec![x, y, 0.0]),
        bytes(&|_| vec![0.0, 0.0, 1.0]),
        bytes(&|[x, y]| vec![(x + 1.0) / 2.0, (1.0 - y) / 2.0]),
        bytes(&|[x, y]| vec![(y + 1.0) / 2.0, (x + 1.0) / 2.0]),
        bytes(&|_| vec![1.0, 0.0, 0.0, -1.0]),
        bytes(&|_| vec![1.0, 0.0, 0.0, 1.0]),
    ];
    container(&json, [all.concat(), vec![0, 1, 2, 0, 2, 3]].concat())
}

/// The channels of an image of 16 × 16 pixels, and their names.
fn image_of(bytes: &[u8]) -> (Vec<String>, Vec<f32>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    std::fs::write(&path, bytes).unwrap();
    let options = LoadOptions { resolution: Some([16, 16]), ..LoadOptions::default() };
    let job = load(&path, &options).map_err(|r| r.to_string()).unwrap().job(AccelKind::Embree, None).unwrap();
    let settings = RenderSettings { spp: 4, ..RenderSettings::default() };
    let rendering = render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap();
    let image = channels(&rendering.film, &[Aov::Normal], None);
    (image.names, image.data)
}

#[test]
fn emitted_and_unlit_images_are_filtered_as_their_samplers_say() {
    // Red in the first quadrant
    let image = "iVBORw0KGgoAAAANSUhEUgAAAAIAAAACCAIAAAD91JpzAAAAEklEQVR4nGP4z8DAAMIM/4EAAB/uBfsL2WiLAAAAAElFTkSuQmCC";
    let unlit = r#"{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}},"extensions":{"KHR_materials_unlit":{}}}"#;
    let emissive = r#"{"emissiveFactor":[1,1,1],"emissiveTexture":{"index":0},"extensions":{"KHR_materials_ior":{"ior":1}},
        "pbrMetallicRoughness":{"baseColorFactor":[0,0,0,1],"metallicFactor":0}}"#;
    for material in [unlit, emissive] {
        for (filter, is_nearest) in [(9728, true), (9729, false)] {
            let rest = format!(
                r#""materials":[{material}],"samplers":[{{"magFilter":{filter}}}],
                "images":[{{"uri":"data:image/png;base64,{image}"}}]"#
            );
            let (names, data) = image_of(&square(r#"{"mesh":0}"#, "", &rest));
            // Within the quadrant, two pixels from the next: the pixel filter has a radius of 1.5
            let pixel = &data[names.len() * (16 * 5 + 5)..][..3];
            let is_red = (pixel[0] - 1.0).abs() < 1e-3 && pixel[1].max(pixel[2]) < 1e-3;
            assert_eq!(is_red, is_nearest, "{material} {filter}: {pixel:?}");
        }
    }
}

#[test]
fn normal_maps_have_the_bitangents_of_their_tangents_or_of_their_texture_coordinates() {
    // (0, sin 30°, cos 30°) in tangent space
    let image = "iVBORw0KGgoAAAANSUhEUgAAAAgAAAAICAIAAABLbSncAAAAEUlEQVR4nGNo2P8OK2IYWhIATXKLQdHJGNsAAAAASUVORK5CYII=";
    let normal = |node: &str, attributes: &str, set: u32| {
        let rest = format!(
            r#""materials":[{{"normalTexture":{{"index":0,"texCoord":{set}}}}}],"samplers":[{{}}],
            "images":[{{"uri":"data:image/png;base64,{image}"}}]"#
        );
        let (names, data) = image_of(&square(node, attributes, &rest));
        let at = names.iter().position(|name| name == "normal.X").unwrap();
        Vec3::from_slice(&data[names.len() * (16 * 5 + 5) + at..])
    };
    let plain = r#"{"mesh":0}"#;
    let mirrored = r#"{"mesh":0,"scale":[-1,1,1]}"#;
    let (sin, cos) = (0.5, 0.75_f32.sqrt());
    let (up, down, left) = (Vec3::new(0.0, sin, cos), Vec3::new(0.0, -sin, cos), Vec3::new(-sin, 0.0, cos));
    for (node, attributes, set, expected) in [
        (plain, "", 0, up),
        (plain, r#","TANGENT":5"#, 0, up),
        (plain, r#","TANGENT":4"#, 0, down),
        // A mirror image, which only turns what is along x
        (mirrored, r#","TANGENT":5"#, 0, up),
        (mirrored, r#","TANGENT":4"#, 0, down),
        (plain, r#","TEXCOORD_1":3"#, 0, up),
        (plain, r#","TEXCOORD_1":3"#, 1, left),
        (mirrored, r#","TEXCOORD_1":3"#, 1, left * Vec3::new(-1.0, 1.0, 1.0)),
        (plain, r#","TEXCOORD_1":3,"TANGENT":4"#, 1, down),
    ] {
        let found = normal(node, attributes, set);
        assert!((found - expected).length() < 0.02, "{node} {attributes} {set}: {found}, not {expected}");
    }
}

#[test]
fn nodes_with_a_scale_of_zero_flatten_their_meshes() {
    let mesh = r#""meshes":[{"primitives":[{"attributes":{"POSITION":1,"NORMAL":0}}]}]"#;
    // With a z of its own
    let mut values = VALUES;
    values[9..18].copy_from_slice(&[0.0, 0.0, 0.0, 1.0, 0.0, 2.0, 0.0, 1.0, 4.0]);
    values[..9].copy_from_slice(&[0.6, 0.0, 0.8, 0.6, 0.0, 0.8, 0.6, 0.0, 0.8]);
    let flat = r#"{"mesh":0,"scale":[1,1,0],"translation":[0,0,7]}"#;
    let (one, loaded) = bounds(&format!("{flat},{{}}"), mesh, &values).unwrap();
    assert_eq!((one.min, one.max), (Vec3::new(0.0, 0.0, 7.0), Vec3::new(1.0, 1.0, 7.0)));
    let hit = loaded.scene.geometry.surface_hit(0, 0, u32::MAX, [0.2, 0.2], 0.0);
    assert!((hit.n - Vec3::Z).length() < 1e-6 && (hit.ns - Vec3::Z).length() < 1e-6, "{hit:?}");
    // Beside instances, which have inverses
    let nodes = format!(r#"{{"children":[2,3]}},{flat},{{"mesh":0}},{{"mesh":0,"translation":[1,0,0]}}"#);
    let (all, loaded) = bounds(&nodes, mesh, &values).unwrap();
    let geometry = &loaded.scene.geometry;
    assert_eq!((geometry.instances.len(), geometry.geometries.len(), geometry.root.geometries.len()), (2, 2, 1));
    assert_eq!(all.max, Vec3::new(2.0, 1.0, 7.0));
    assert!(loaded.job(AccelKind::Embree, None).is_ok());
}

/// A document of `n` nodes in a chain, which have a mesh and a material each.
fn chain(n: usize) -> String {
    let list = |item: &dyn Fn(usize) -> String| (0..n).map(item).collect::<Vec<_>>().join(",");
    let children = |i: usize| if i + 1 < n { format!(r#","children":[{}]"#, i + 1) } else { String::new() };
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{}],"meshes":[{}],"materials":[{}],
        "accessors":[{}]}}"#,
        list(&|i| format!(r#"{{"mesh":{i},"translation":[1,0,0]{}}}"#, children(i))),
        list(&|i| format!(r#"{{"primitives":[{{"attributes":{{"POSITION":{i}}},"material":{i}}}]}}"#)),
        list(&|i| format!(r#"{{"name":"{i}"}}"#)),
        list(&|_| r#"{"componentType":5126,"count":3,"type":"VEC3"}"#.to_owned()),
    )
}

#[test]
fn chains_of_nodes_may_be_as_deep_as_they_are_long() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    std::fs::write(&path, chain(20_000)).unwrap();
    let scene = load(&path, &LoadOptions::default()).map_err(|r| r.to_string()).unwrap().scene;
    assert_eq!((scene.geometry.geometries.len(), scene.materials.entries().len()), (20_000, 20_001));
    assert_eq!(f64::from(scene.geometry.world_bounds().max.x) + scene.origin.x, 20_000.0);
}

#[test]
fn primitives_take_their_own_vertices_of_a_shared_accessor() {
    let json = r#"{"asset":{"version":"2.0"},"nodes":[{"mesh":0}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0,"COLOR_0":0},"indices":1}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":40,"type":"VEC3"},
                     {"bufferView":1,"componentType":5121,"count":3,"type":"SCALAR"}],
        "bufferViews":[{"buffer":0,"byteLength":480},{"buffer":0,"byteOffset":480,"byteLength":3}],
        "buffers":[{"byteLength":483}]}"#;
    let vertex = |i: usize| [i as f32, (i * i) as f32, 0.5];
    let with = |indices: [u8; 3]| {
        let bytes = [floats(&(0..40).flat_map(vertex).collect::<Vec<f32>>()), indices.to_vec()].concat();
        let folder = tempfile::tempdir().unwrap();
        loaded(folder.path(), &container(json, bytes))
    };
    let scene = with([30, 4, 17]).unwrap().scene;
    let Shape::Mesh(mesh) = &scene.geometry.geometries[0].shape else { panic!("a mesh") };
    assert_eq!((mesh.positions().len(), mesh.colors.len()), (3, 3));
    assert_eq!(mesh.triangle(0), [30, 4, 17].map(|i| Vec3::from(vertex(i))));
    assert_eq!(mesh.indices[0].map(|v| mesh.colors[v as usize][1]), [900.0, 16.0, 289.0]);
    let error = with([0, 1, 40]).map(|_| ()).unwrap_err();
    assert!(error.contains("[0, 1, 40], but there are 40 vertices"), "{error}");
}

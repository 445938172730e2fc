//! Direction of anisotropic reflection: angle and texture of `KHR_materials_anisotropy`, and Blender's rotation.

use lumiris::imaging::oiio::{Part, write_image};
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, Loaded, load, load_text};
use lumiris::render::output::channels;
use lumiris::render::{RenderSettings, render};
use lumiris::scene::AccelKind;
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Texture coordinates of the corners at (−1, −1), (2, −1) and (−1, 2), with v from the top as in glTF. u points to the
/// right, to the top, and to the left.
const RIGHT: [f32; 6] = [0.0, 1.0, 1.0, 1.0, 0.0, 0.0];
const TOP: [f32; 6] = [0.0, 0.0, 0.0, 1.0, 1.0, 0.0];
const LEFT: [f32; 6] = [1.0, 1.0, 0.0, 1.0, 1.0, 0.0];

/// A metal triangle in front of a lamp; `anisotropy` has the members of the extension.
fn metal(folder: &Path, uv: [f32; 6], anisotropy: &str) -> Loaded {
    // Document
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0,1,2]}}],
        "extensionsUsed":["KHR_lights_punctual","KHR_materials_anisotropy"],
        "extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"point","intensity":683}}]}}}},
        "nodes":[{{"mesh":0}},{{"translation":[0.6,0.2,1],"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}},
                 {{"translation":[0,0,3],"camera":0}}],
        "cameras":[{{"type":"perspective","perspective":{{"yfov":0.5,"znear":0.1,"aspectRatio":1}}}}],
        "images":[{{"uri":"direction.png"}}],"textures":[{{"source":0}}],
        "materials":[{{"pbrMetallicRoughness":{{"roughnessFactor":0.4}},
            "extensions":{{"KHR_materials_anisotropy":{{{anisotropy}}}}}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"TEXCOORD_0":1}},"material":0}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[-1,-1,0],"max":[2,2,0]}},
                     {{"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":24}}],
        "buffers":[{{"byteLength":60,"uri":"a.bin"}}]}}"#
    );

    // Buffer
    let corners = [-1.0, -1.0, 0.0, 2.0, -1.0, 0.0, -1.0, 2.0, 0.0];
    let bytes: Vec<u8> = corners.into_iter().chain(uv).flat_map(f32::to_le_bytes).collect();
    std::fs::write(folder.join("a.bin"), bytes).unwrap();
    std::fs::write(folder.join("a.gltf"), json).unwrap();
    let options = LoadOptions { resolution: Some([16, 16]), ..LoadOptions::default() };
    load(&folder.join("a.gltf"), &options).map_err(|report| report.to_string()).unwrap()
}

fn pixels(loaded: Loaded) -> Vec<f32> {
    assert_eq!(loaded.warnings.to_string(), "");
    let job = loaded.job(AccelKind::Embree, None).unwrap();
    let settings = RenderSettings { spp: 4, ..RenderSettings::default() };
    channels(&render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film, &[], None).data
}

/// Largest difference over the largest value.
fn difference(a: &[f32], b: &[f32]) -> f32 {
    let greatest = a.iter().fold(0.0_f32, |m, v| m.max(*v));
    assert!(greatest > 0.01, "{greatest}");
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) / greatest
}

#[test]
fn the_direction_is_that_of_rotation_and_texture() {
    let folder = tempfile::tempdir().unwrap();
    let image = |rgb: [f32; 3]| {
        let names = ["R", "G", "B"].map(str::to_owned).to_vec();
        write_image(&folder.path().join("direction.png"), &[Part::display(1, 1, names, rgb.to_vec())]).unwrap();
    };
    let turned = |uv, angle: f32| {
        pixels(metal(folder.path(), uv, &format!(r#""anisotropyStrength":0.9,"anisotropyRotation":{angle}"#)))
    };
    let textured = |uv, rgb, strength: f32| {
        image(rgb);
        let members = format!(r#""anisotropyStrength":{strength},"anisotropyTexture":{{"index":0}}"#);
        pixels(metal(folder.path(), uv, &members))
    };
    image([0.0; 3]);
    let along = turned(RIGHT, 0.0);
    let [across, between, beyond] = [1.0, 0.5, 1.5].map(|k| turned(RIGHT, k * FRAC_PI_2));
    for (a, b) in [(&along, &across), (&along, &between), (&between, &beyond)] {
        assert!(difference(a, b) > 0.05, "{}", difference(a, b));
    }

    // Texture coordinates with u in the direction of the rotation. With u to the left, rotations have the opposite
    // sense
    let same = |what: &str, a: &[f32], b: &[f32]| assert!(difference(a, b) < 0.01, "{what}: {}", difference(a, b));
    same("u to the top", &turned(TOP, 0.0), &across);
    same("mirrored", &turned(LEFT, FRAC_PI_4), &beyond);

    // 127.5 means 0, and blue scales the strength
    same("green", &textured(RIGHT, [0.5, 1.0, 1.0], 0.9), &across);
    same("red and green", &textured(RIGHT, [1.0, 1.0, 1.0], 0.9), &between);
    same("mirrored red and green", &textured(LEFT, [1.0, 1.0, 1.0], 0.9), &beyond);
    same("blue", &textured(RIGHT, [1.0, 1.0, 0.6], 1.0), &textured(RIGHT, [1.0, 1.0, 1.0], 0.6));
    assert!(difference(&textured(RIGHT, [1.0, 1.0, 0.6], 1.0), &between) > 0.05);
}

#[test]
fn the_rotation_of_blender_is_in_turns() {
    // Rotations of u and of the material by a quarter
    let of = |uv: &str, rotation: &str| {
        let text = format!(
            r#"LookAt 0 0 3  0 0 0  0 1 0
            Camera "perspective" "float fov" 30
            WorldBegin
            LightSource "point" "rgb I" [1 1 1] "point3 from" [0.6 0.2 1]
            Material "principled" "float metallic" 1 "float roughness" 0.4 "float anisotropic" 0.9 {rotation}
            Shape "trianglemesh" "point3 P" [-1 -1 0  2 -1 0  -1 2 0] "integer indices" [0 1 2] "point2 uv" [{uv}]"#
        );
        let options = LoadOptions { resolution: Some([16, 16]), ..LoadOptions::default() };
        let loaded = load_text(&text, "a.pbrt", Path::new("."), &options, &FileCache::default());
        pixels(loaded.map_err(|report| report.to_string()).unwrap())
    };
    let quarter = "\"float anisotropic_rotation\" 0.25";
    let (along, across) = (of("0 0  1 0  0 1", ""), of("0 0  1 0  0 1", quarter));
    assert!(difference(&along, &across) > 0.05);
    assert!(difference(&of("0 0  0 1  1 0", ""), &across) < 0.01);
    assert!(difference(&of("0 0  0 1  1 0", quarter), &along) < 0.01);
}

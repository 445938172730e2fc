//! glTF scenes: what a small one becomes, and that broken ones are refused without a panic.

use lumiris::import::{LoadOptions, load};
use lumiris_test_support::random::{RngExt, pcg32};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// A container of a triangle with a principled material, a light and a camera.
fn triangle() -> Vec<u8> {
    let json = r#"{"asset":{"version":"2.0"},"scene":0,"extensionsUsed":["KHR_lights_punctual"],
        "extensions":{"KHR_lights_punctual":{"lights":[{"type":"point","intensity":683}]}},
        "scenes":[{"nodes":[0,1,2]}],
        "nodes":[{"mesh":0},{"translation":[0,0,2],"extensions":{"KHR_lights_punctual":{"light":0}}},
                 {"translation":[0,0,3],"camera":0}],
        "cameras":[{"type":"perspective","perspective":{"yfov":0.7,"znear":0.1,"aspectRatio":2}}],
        "materials":[{"pbrMetallicRoughness":{"baseColorFactor":[1,0.5,0.25,1],"metallicFactor":0}}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1,"material":0}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
                     {"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}],
        "bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6}],
        "buffers":[{"byteLength":42}]}"#;
    let mut text = json.as_bytes().to_vec();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bytes: Vec<u8> =
        [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    bytes.extend([0_u16, 1, 2, 0].iter().flat_map(|v| v.to_le_bytes()));
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend(((28 + text.len() + bytes.len()) as u32).to_le_bytes());
    for (kind, chunk) in [(0x4e4f_534a_u32, text), (0x004e_4942, bytes)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind.to_le_bytes());
        file.extend(chunk);
    }
    file
}

fn loaded(folder: &Path, bytes: &[u8]) -> Result<lumiris::import::Loaded, String> {
    let path = folder.join("a.glb");
    std::fs::write(&path, bytes).unwrap();
    load(&path, &LoadOptions::default()).map_err(|report| report.to_string())
}

#[test]
fn a_triangle_with_a_light_and_a_camera_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let scene = loaded(folder.path(), &triangle()).unwrap().scene;
    assert_eq!(scene.geometry.primitive_counts(), (1, 0, 0));
    assert_eq!(scene.film.resolution, [1440, 720]);
    assert!((scene.lights.lights[0].phi(1.0) - 4.0 * std::f32::consts::PI).abs() < 1e-3, "683 cd are 1 W/sr");
}

#[test]
fn what_is_not_read_is_an_error_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let changed = |from: &str, to: &str| {
        assert_eq!(from.len(), to.len());
        let (mut bytes, from) = (triangle(), from.as_bytes());
        let at = bytes.windows(from.len()).position(|w| w == from).unwrap();
        bytes[at..at + from.len()].copy_from_slice(to.as_bytes());
        loaded(folder.path(), &bytes).map(|_| ()).unwrap_err()
    };
    let error = changed(r#""extensionsUsed":["KHR_lights_punctual"]"#, r#""extensionsRequired":["KHR_draco_m"]   "#);
    assert!(error.contains("extensionsRequired[0]") && error.contains("KHR_draco_m"), "{error}");
    let error = changed(r#""count":3,"type":"VEC3""#, r#""count":9,"type":"VEC3""#);
    assert!(error.contains("accessors[0]"), "{error}");
    let error = changed(r#""indices":1"#, r#""indices":7"#);
    assert!(error.contains("meshes[0].primitives[0].indices"), "{error}");
    let error = loaded(folder.path(), &triangle()[..50]).map(|_| ()).unwrap_err();
    assert!(error.contains("byte 8"), "{error}");
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

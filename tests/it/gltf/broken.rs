//! Missing and broken files of glTF scenes are errors, never panics.

use super::{VALUES, floats, loaded, replaced, triangle};
use lumiris::import::{LoadOptions, load};
use lumiris_test_support::random::{RngExt, pcg32};
use std::panic::{AssertUnwindSafe, catch_unwind};

#[test]
fn what_is_not_read_is_an_error_with_its_place() {
    // A container with one change
    let folder = tempfile::tempdir().unwrap();
    let changed = |from: &str, to: &str| {
        let to = format!("{to:0$}", from.len());
        loaded(folder.path(), &replaced(&triangle(), from, &to)).map(|_| ()).unwrap_err()
    };

    // Errors with their positions
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

/// A triangle in a text file, with positions, base colour and emission in other files.
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

    // With the buffers in place, the images are still missing
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

//! glTF scenes: their options are stored in parts and checkpoints.

use super::parts::{assert_same, lumiris, run};
use super::program::stderr;
use std::path::Path;

/// A triangle from a file, animated by one unit per second, a camera, and an environment of two colours.
fn write_scene(folder: &Path) {
    // (0, 0, 0), (1, 0, 0) and (0, 1, 0)
    let data = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0}},{{"camera":0,"translation":[0.5,0.5,4]}}],
        "cameras":[{{"type":"perspective","perspective":{{"yfov":0.7,"znear":0.1}}}}],
        "animations":[{{"samplers":[{{"input":1,"output":2}}],
                       "channels":[{{"sampler":0,"target":{{"node":0,"path":"translation"}}}}]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}},
                     {{"bufferView":0,"byteOffset":8,"componentType":5126,"count":2,"type":"SCALAR"}},
                     {{"bufferView":0,"componentType":5126,"count":2,"type":"VEC3"}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],
        "buffers":[{{"byteLength":36,"uri":"data:application/octet-stream;base64,{data}"}}]}}"#
    );
    std::fs::write(folder.join("a.gltf"), text).unwrap();
    let mut sky = b"PF\n2 1\n-1.0\n".to_vec();
    sky.extend([0.5_f32, 1.0, 2.0, 2.0, 1.0, 0.5].iter().flat_map(|v| v.to_le_bytes()));
    std::fs::write(folder.join("sky.pfm"), sky).unwrap();
}

#[test]
fn parts_and_checkpoints_keep_environment_and_camera() {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path());
    let options = "--environment sky.pfm --camera-auto --resolution 16x16 --estimator mis --quiet";
    run(&format!("render a.gltf {options} --spp 8 -o whole.exr"), folder.path());
    for part in 1..=2 {
        run(&format!("render a.gltf {options} --spp 8 --part {part}/2 -o {part}.part"), folder.path());
    }
    run("merge 1.part 2.part -o merged.exr --quiet", folder.path());
    assert_same("whole.exr", "merged.exr", folder.path(), "parts");
    run(&format!("render a.gltf {options} --spp 4 --checkpoint c.film -o half.exr"), folder.path());
    run("render a.gltf --resume c.film --spp 8 --quiet -o resumed.exr", folder.path());
    assert_same("whole.exr", "resumed.exr", folder.path(), "a checkpoint");
}

#[test]
fn frames_are_times_of_an_animation() {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path());
    let options = "--environment sky.pfm --resolution 16x16 --estimator mis --spp 4 --quiet";
    run(&format!("render a.gltf {options} --frames 0-2 --fps 2 --seed-per-frame off -o f.####.exr"), folder.path());
    for (frame, time) in [("0000", "0"), ("0001", "0.5"), ("0002", "1")] {
        run(&format!("render a.gltf {options} --time-in-scene {time} -o {frame}.exr"), folder.path());
        assert_same(&format!("f.{frame}.exr"), &format!("{frame}.exr"), folder.path(), frame);
    }
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_ne!(bytes("f.0000.exr"), bytes("f.0002.exr"));

    // A part stores its time
    run(&format!("render a.gltf {options} --time-in-scene 0.5 --checkpoint c.film -o half.exr"), folder.path());
    run("render a.gltf --resume c.film --quiet -o resumed.exr", folder.path());
    assert_same("0001.exr", "resumed.exr", folder.path(), "a checkpoint");
}

#[test]
fn options_of_gltf_are_refused_for_pbrt() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.pbrt"), "WorldBegin\n").unwrap();
    for (option, name) in [
        ("--camera-auto", "--camera-auto"),
        ("--camera 0", "--camera"),
        ("--light-units watt", "--light-units"),
        ("--scene-in-file 0", "--scene-in-file"),
        ("--environment sky.hdr", "--environment"),
        ("--time-in-scene 1", "--time-in-scene"),
    ] {
        let output = lumiris(&format!("info a.pbrt {option}"), folder.path());
        assert_eq!(output.status.code(), Some(2));
        assert!(stderr(&output).contains(&format!("lumiris: {name} is for glTF")), "{}", stderr(&output));
        assert!(!stderr(&output).contains("1:1"), "an option has no line: {}", stderr(&output));
    }
}

#[test]
fn cameras_are_listed_and_chosen_by_name_or_index() {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path());
    let path = folder.path().join("a.gltf");
    let nodes = r#""scenes":[{"nodes":[0,1,2]},{"name":"b","nodes":[2]}],"nodes":["#;
    let near = r#""translation":[0.5,0.5,4]},{"camera":0,"name":"near","translation":[0.5,0.5,2]}"#;
    let text = std::fs::read_to_string(&path).unwrap();
    let text = text.replace(r#""nodes":["#, nodes).replace(r#""translation":[0.5,0.5,4]}"#, near);
    std::fs::write(&path, text).unwrap();
    let facts = |scene: &str| -> serde_json::Value {
        let output = lumiris(&format!("info a.gltf --environment sky.pfm --json {scene}"), folder.path());
        serde_json::from_slice(&output.stdout).unwrap()
    };
    assert_eq!(facts("")["cameras"], serde_json::json!(["", "near"]));
    assert_eq!(facts("")["scenes"], serde_json::json!(["", "b"]));
    assert_eq!(facts("--scene-in-file b")["cameras"], serde_json::json!(["near"]));

    let options = "--environment sky.pfm --resolution 16x16 --estimator mis --spp 4 --quiet";
    for (image, camera) in [("0", "--camera 0"), ("1", "--camera 1"), ("near", "--camera near"), ("first", "")] {
        run(&format!("render a.gltf {options} {camera} -o {image}.exr"), folder.path());
    }
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_ne!(bytes("0.exr"), bytes("1.exr"));
    assert_same("1.exr", "near.exr", folder.path(), "a name");
    assert_same("0.exr", "first.exr", folder.path(), "the default");

    let output = lumiris("info a.gltf --camera far", folder.path());
    assert_eq!(output.status.code(), Some(3));
    assert!(
        stderr(&output).contains("--camera: there is no camera `far`; cameras: 0, 1 (near)"),
        "{}",
        stderr(&output)
    );
    let output = lumiris("info a.gltf --scene-in-file 2", folder.path());
    assert!(stderr(&output).contains("there is no scene `2`; scenes: 0, 1 (b)"), "{}", stderr(&output));
    assert_eq!(lumiris("info a.gltf --camera 0 --camera-auto", folder.path()).status.code(), Some(2));

    // A checkpoint stores its camera
    run(&format!("render a.gltf {options} --camera near --checkpoint c.film -o half.exr"), folder.path());
    run("render a.gltf --resume c.film --quiet -o resumed.exr", folder.path());
    assert_same("1.exr", "resumed.exr", folder.path(), "a checkpoint");
    // The same choices in other words
    run(
        "render a.gltf --camera 1 --light-units watt --scene-in-file 0 --resume c.film --quiet -o again.exr",
        folder.path(),
    );
    assert_same("1.exr", "again.exr", folder.path(), "an index, and what is the default");
    // Other choices make another image
    for (option, difference) in [
        ("--camera 0", "camera: none, not 1 near"),
        ("--camera-auto", "camera: one that frames the scene, not 1 near"),
        ("--light-units candela", "light_units: candela, which was not set"),
        ("--time-in-scene 1", "time_in_scene: 1, which was not set"),
    ] {
        let output = lumiris(&format!("render a.gltf {option} --resume c.film --quiet -o other.exr"), folder.path());
        assert!(!output.status.success() && stderr(&output).contains(difference), "{option}: {}", stderr(&output));
    }
}

#[test]
fn a_missing_environment_is_a_fault_of_the_option_and_not_of_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path());
    let output = lumiris("info a.gltf --camera-auto --environment nope.hdr", folder.path());
    assert_eq!(output.status.code(), Some(3));
    let said = stderr(&output);
    assert!(said.contains("nope.hdr: no such file, asked for by --environment") && !said.contains("a.gltf:"), "{said}");
    std::fs::write(folder.path().join("nope.hdr"), "nothing").unwrap();
    let said = stderr(&lumiris("info a.gltf --camera-auto --environment nope.hdr", folder.path()));
    assert!(said.contains("error: --environment: nope.hdr: ") && !said.contains("a.gltf:"), "{said}");
}

//! Light groups: the files with their layers, documented commands that show them, and messages if there are none.

use super::parts::{image, lumiris, refuse, run};
use super::program::stderr;
use std::path::Path;

fn scene() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/demo/light-groups.pbrt");
    format!("render {} --resolution 16x12 --spp 2 --estimator mis", path.display())
}

#[test]
fn layers_are_listed_and_can_be_looked_at_one_by_one() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    run(&format!("{} -q -o a.exr", scene()), folder);
    let output = lumiris("info a.exr", folder);
    let listed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success() && stderr(&output).is_empty(), "{}", stderr(&output));
    for word in ["16x12", "light_key", "R G B", "estimator", "mis", "samples done", "2 per pixel"] {
        assert!(listed.contains(word), "no `{word}` in: {listed}");
    }
    run("compare a.exr -r a.exr --layer light_key --html page", folder);
    assert!(folder.join("page/index.html").exists());
    refuse("compare a.exr -r a.exr --layer light_none", folder, 3, &["light_none"]);
}

#[test]
fn a_note_says_once_that_only_exr_files_have_layers() {
    let folder = tempfile::tempdir().unwrap();
    let said = |options: &str| stderr(&lumiris(&format!("{} {options}", scene()), folder.path()));
    let text = said("-o a.png -o b.png");
    assert_eq!(text.matches("note: only EXR files have the layers of light groups").count(), 1, "{text}");
    for options in ["-o a.png -o a.exr", "-o a.png --light-groups none", "-o a.png --aov none", "-o a.part"] {
        let text = said(options);
        assert!(!text.contains("note:") && text.contains("samples per pixel"), "{options}: {text}");
    }
    // Without an output that stores the layers, the film has none
    let film_bytes = |options: &str| {
        said(&format!("{options} --stats a.json"));
        let text = std::fs::read_to_string(folder.path().join("a.json")).unwrap();
        serde_json::from_str::<serde_json::Value>(&text).unwrap()["memory"]["film_bytes"].as_u64().unwrap()
    };
    assert_eq!(film_bytes("-o a.png"), film_bytes("-o a.png --light-groups none"));
    assert!(film_bytes("-o a.png -o a.exr") > film_bytes("-o a.png"));
    assert!(image("a.exr", folder.path()).image.channels.iter().any(|name| name == "light_key.R"));
}

#[test]
fn the_name_of_lights_without_a_group_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let text = "WorldBegin\nLightSource \"infinite\" \"string lightgroup\" \"other\"\n";
    std::fs::write(folder.path().join("a.pbrt"), text).unwrap();
    refuse(
        "info a.pbrt",
        folder.path(),
        3,
        &["a.pbrt:2:24", "light group `other` is reserved for lights without a group"],
    );
}

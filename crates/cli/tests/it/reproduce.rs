//! `lumiris reproduce` from outside: a page and a file of numbers with every figure.

use std::path::{Path, PathBuf};
use std::process::Command;

const FIGURES: [&str; 6] = [
    "paper-figure-3",
    "paper-figure-4",
    "paper-figure-4-lights",
    "paper-figure-5",
    "thesis-figure-5.3",
    "thesis-figure-5.4",
];

const FAN_FIGURES: [&str; 4] = ["checkers", "statue", "room", "box"];

const PHOTON_FIGURES: [&str; 4] = ["rooms", "ring", "slit", "direct"];

/// Files that the page shows.
fn sources(html: &str) -> Vec<&str> {
    html.split("src=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect()
}

/// A sky, a lamp, a floor and a ball, by the names of the scenes.
fn write_scenes(folder: &Path) {
    let head = "LookAt 0 1.6 -4.6  0 0.6 0  0 1 0\nCamera \"perspective\" \"float fov\" [ 34 ]\nWorldBegin\n";
    let sky = "LightSource \"infinite\" \"rgb L\" [ 0.3 0.4 0.6 ]\n";
    let lamp = "AttributeBegin\n  AreaLightSource \"diffuse\" \"rgb L\" [ 18 15 11 ]\n  Shape \"bilinearmesh\" \
                \"point3 P\" [ -1.4 3.2 -1.2  -0.4 3.2 -1.2  -1.4 3.2 -0.2  -0.4 3.2 -0.2 ]\nAttributeEnd\n";
    let things = "Material \"diffuse\"\nShape \"bilinearmesh\" \"point3 P\" [ -9 0 -9  9 0 -9  -9 0 9  9 0 9 ]\n\
                  AttributeBegin Translate 0 0.7 0 Shape \"sphere\" \"float radius\" [ 0.7 ] AttributeEnd\n";
    for (name, lights) in [("env", sky), ("lights", lamp), ("env-lights", &format!("{sky}{lamp}"))] {
        std::fs::write(folder.join(format!("statue-{name}.pbrt")), format!("{head}{lights}{things}")).unwrap();
    }
}

/// Reproduces a paper on the scenes of a folder: the page's folder, its text, and its numbers.
fn reproduced(paper: &str, folder: &Path) -> (PathBuf, String, serde_json::Value) {
    let output = Command::new(env!("CARGO_BIN_EXE_lumiris"))
        .args(["reproduce", paper, "--out", "page", "--quick", "--size", "16", "--scenes", ".", "-q"])
        .current_dir(folder)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let page = folder.join("page");
    let html = std::fs::read_to_string(page.join("index.html")).unwrap();
    let numbers = std::fs::read_to_string(page.join(format!("{paper}.json"))).unwrap();
    (page, html, serde_json::from_str(&numbers).unwrap())
}

#[test]
fn the_page_and_the_numbers_hold_every_figure() {
    let folder = tempfile::tempdir().unwrap();
    write_scenes(folder.path());
    let (page, html, numbers) = reproduced("talbot", folder.path());

    let figures = numbers["figures"].as_object().unwrap();
    assert_eq!(figures.len(), FIGURES.len());
    for id in FIGURES {
        assert!(html.contains(&format!("<h2 id=\"{id}\">")), "{id}");
        let figure = &figures[id];
        assert!(figure["summary"]["reached"].is_boolean(), "{id}");
        let methods = figure["numbers"].get("methods").and_then(|m| m.as_array());
        for m in methods.into_iter().flatten() {
            assert_eq!(m["invalid_samples"], 0, "{id} {}", m["name"]);
            assert!(m["at_equal_time"]["value"].as_f64().unwrap() > 0.0, "{id} {}", m["name"]);
            // All methods are unbiased; of some fifty none has a mean this far off by chance.
            assert!(m["same_mean_p"].as_f64().unwrap() > 1e-6, "{id} {}", m["name"]);
        }
    }
    let shown = sources(&html);
    assert!(shown.len() > 30, "{shown:?}");
    for file in shown {
        assert!(page.join(file).is_file(), "{file}");
    }
}

/// A lamp, a floor and a ball, by the names of the scenes of optimizing control variates.
fn write_fan_scenes(folder: &Path) {
    write_scenes(folder);
    let scene = folder.join("statue-lights.pbrt");
    for name in FAN_FIGURES {
        std::fs::copy(&scene, folder.join(format!("{name}.pbrt"))).unwrap();
    }
}

#[test]
fn the_page_of_control_variates_holds_every_scene_and_method() {
    let folder = tempfile::tempdir().unwrap();
    write_fan_scenes(folder.path());
    let (page, html, numbers) = reproduced("fan", folder.path());

    let figures = numbers["figures"].as_object().unwrap();
    assert_eq!(figures.len(), FAN_FIGURES.len());
    for id in FAN_FIGURES {
        assert!(html.contains(&format!("<h2 id=\"{id}\">")), "{id}");
        let figure = &figures[id];
        assert!(figure["summary"]["reached"].is_boolean(), "{id}");
        let methods = figure["numbers"]["methods"].as_array().unwrap();
        assert_eq!(methods.len(), if id == "box" { 6 } else { 36 }, "{id}");
        for m in methods {
            assert_eq!(m["invalid_samples"], 0, "{id} {}", m["name"]);
            let error = m["error"]["value"].as_f64().unwrap();
            // The cache has few records in 16 pixels, and interpolates the edges of shadows
            let most = if id == "box" { f64::MAX } else { 50.0 };
            assert!(error > 0.0 && error < most, "{id} {}: {error}", m["name"]);
        }
        // Independent samples are never much better than stratified ones
        if id != "box" {
            let error = |i: usize| methods[i]["error"]["value"].as_f64().unwrap();
            assert!(error(12) < 1.2 * error(24), "{id}");
        }
    }
    let shown = sources(&html);
    assert!(shown.len() > 50, "{shown:?}");
    for file in shown {
        assert!(page.join(file).is_file(), "{file}");
    }
}

/// The scenes of the repository; the rooms with many lights are those with few.
fn write_photon_scenes(folder: &Path) {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/keller-wald");
    for name in ["rooms", "ring", "ring-indirect", "ring-geometry", "slit"] {
        let file = format!("{name}.pbrt");
        std::fs::copy(scenes.join(&file), folder.join(&file)).unwrap();
    }
    std::fs::copy(scenes.join("rooms.pbrt"), folder.join("rooms-10000.pbrt")).unwrap();
}

#[test]
fn the_page_of_photon_maps_holds_every_figure_and_its_maps() {
    let folder = tempfile::tempdir().unwrap();
    write_photon_scenes(folder.path());
    let (page, html, numbers) = reproduced("keller-wald", folder.path());

    let figures = numbers["figures"].as_object().unwrap();
    assert_eq!(figures.len(), PHOTON_FIGURES.len());
    for id in PHOTON_FIGURES {
        assert!(html.contains(&format!("<h2 id=\"{id}\">")), "{id}");
        assert!(figures[id]["summary"]["reached"].is_boolean(), "{id}");
    }
    let maps = |figure: &serde_json::Value| figure["maps"].as_array().unwrap().clone();
    let count = |map: &serde_json::Value, key: &str| map[key].as_f64().unwrap();

    // Importance brings photons into the room, and not more of them into the map
    let rooms = maps(&figures["rooms"]["numbers"]);
    assert_eq!(rooms.len(), 4);
    for pair in rooms.chunks(2) {
        assert!(count(&pair[1], "photons_in_room") > 5.0 * count(&pair[0], "photons_in_room"));
        assert!((count(&pair[1], "photons") / count(&pair[0], "photons") - 1.0).abs() < 0.02);
    }
    let slit = maps(&figures["slit"]["numbers"]);
    assert!(count(&slit[2], "photons_in_room") > count(&slit[0], "photons_in_room"));

    // The global map stays, the caustic map grows
    for scene in figures["ring"]["numbers"]["scenes"].as_array().unwrap() {
        let maps = maps(scene);
        for pair in maps.windows(2) {
            assert!((count(&pair[1], "global_photons") / count(&pair[0], "global_photons") - 1.0).abs() < 0.02);
            assert!(count(&pair[1], "caustic_photons") > 2.0 * count(&pair[0], "caustic_photons"));
        }
    }

    // Direct light is the same by every method without bias
    for scene in ["few", "many"] {
        for m in figures["direct"]["numbers"][scene]["methods"].as_array().unwrap() {
            assert_eq!(m["invalid_samples"], 0, "{}", m["name"]);
            let is_same = m["same_mean_p"].as_f64().unwrap() > 1e-6;
            assert!(is_same || m["biased"] == true, "{}", m["name"]);
        }
    }
    let shown = sources(&html);
    assert!(shown.len() > 30, "{shown:?}");
    for file in shown {
        assert!(page.join(file).is_file(), "{file}");
    }
}

#[test]
fn a_folder_without_scenes_is_an_error_that_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_lumiris"))
        .args(["reproduce", "talbot", "--out", "page", "--quick", "--scenes", "nowhere", "-q"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&output.stderr).contains("statue-env-lights.pbrt"));
    assert!(!folder.path().join("page/index.html").exists());
}

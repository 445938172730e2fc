//! Plans: the choices of one rendering, used by another.

use lumiris::imaging::oiio::{ReadImage, ReadLimits, read_image};
use std::path::Path;
use std::process::{Command, Output};

fn lumiris(args: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lumiris")).args(args).current_dir(folder).output().unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn gallery() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/demo/gallery.pbrt").display().to_string()
}

/// Large enough for a pilot.
const IMAGE: [&str; 6] = ["--integrator", "direct", "--resolution", "160x100", "--spp", "100"];

fn render(options: &[&str], name: &str, folder: &Path) -> ReadImage {
    let path = gallery();
    let args = [&["render", &path], &IMAGE[..], options, &["--aov", "samples", "-q", "-o", name]].concat();
    let output = lumiris(&args, folder);
    assert!(output.status.success(), "{}", stderr(&output));
    read_image(&folder.join(name), &ReadLimits::default()).unwrap()
}

#[test]
fn a_plan_gives_the_image_of_the_rendering_that_made_it_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let auto = render(&[], "auto.exr", folder.path());
    let plan = &auto.metadata["lumiris:plan"];
    std::fs::write(folder.path().join("plan.json"), plan).unwrap();
    let value: serde_json::Value = serde_json::from_str(plan).unwrap();
    assert!(
        value["settings"]["estimator"].is_string() && value["tuning"].is_null(),
        "the rule measures nothing: {plan}"
    );

    let planned = render(&["--plan", "plan.json", "--threads", "1"], "planned.exr", folder.path());
    let bits = |file: &ReadImage| file.image.data.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert!(bits(&auto) == bits(&planned));
    assert_eq!(auto.metadata["lumiris:estimator"], planned.metadata["lumiris:estimator"]);

    // Options take precedence over the plan
    let other = render(&["--plan", "plan.json", "--estimator", "mc", "--samples", "1"], "other.exr", folder.path());
    assert_eq!(other.metadata["lumiris:estimator"], "mc");
    assert_eq!(other.metadata["lumiris:samples"], "1");
}

#[test]
fn the_plan_of_a_scene_is_stored_with_what_it_follows_from() {
    let folder = tempfile::tempdir().unwrap();
    let path = gallery();
    let args = [&["plan", &path], &IMAGE[..], &["-o", "plan.json"]].concat();
    let output = lumiris(&args, folder.path());
    assert!(output.status.success(), "{}", stderr(&output));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("times the efficiency of the rule") && text.contains("direct light: "), "{text}");
    let stored = std::fs::read_to_string(folder.path().join("plan.json")).unwrap();
    let stored: serde_json::Value = serde_json::from_str(&stored).unwrap();
    assert_eq!(stored["scene"], path);
    assert!(stored["tuning"]["trials"][0]["nanoseconds"].as_f64().unwrap() > 0.0);
}

#[test]
fn a_plan_of_another_image_is_used_with_a_warning() {
    // Plans and the warnings about them
    let folder = tempfile::tempdir().unwrap();
    let plan = |scene: &str, image: &str| {
        format!(r#"{{"version": "1", "scene": "{scene}", "image": {image}, "settings": {{"estimator": "mis"}}}}"#)
    };
    let small = ["--resolution", "8x6", "--spp", "1", "-q", "-o", "a.png"];
    for (text, warning) in [
        (plan("a/gallery.pbrt", "[8, 6, 1]"), None),
        (plan("a/gallery.0012.pbrt", "null"), Some("was made for a/gallery.0012.pbrt:")),
        (
            plan("a/gallery.pbrt", "[8, 6, 1]")
                .replace("\"settings\": {", "\"settings\": {\"roulette\": \"efficiency\", "),
            Some("plan.json: the setting `roulette` no longer exists and is ignored"),
        ),
        (plan("a/fog.pbrt", "[8, 6, 1]"), Some("was made for a/fog.pbrt:")),
        (plan("gallery.pbrt", "[80, 60, 16]"), Some("was made for 80x60 pixels with 16 samples:")),
    ] {
        // Render with each plan
        std::fs::write(folder.path().join("plan.json"), text).unwrap();
        let output = lumiris(&[&["render", &gallery(), "--plan", "plan.json"], &small[..]].concat(), folder.path());
        assert!(output.status.success(), "{}", stderr(&output));
        match warning {
            Some(warning) => assert!(stderr(&output).contains(warning), "{}", stderr(&output)),
            None => assert_eq!(stderr(&output), ""),
        }
    }
}

#[test]
fn what_is_no_plan_is_an_error_that_says_why() {
    // Broken plans
    let folder = tempfile::tempdir().unwrap();
    let path = gallery();
    let wrong = [
        ("{\n\"version\": 1", "line 2"),
        ("{}", "missing field"),
        (r#"{"version": "1", "scene": "a", "settings": {"smaples": "3"}}"#, "there is no setting `smaples`"),
        (r#"{"version": "1", "scene": "a", "settings": {"samples": "many"}}"#, "`samples`: expected"),
    ];
    for (text, message) in wrong {
        std::fs::write(folder.path().join("plan.json"), text).unwrap();
        let output = lumiris(&["render", &path, "--plan", "plan.json", "-q", "-o", "a.exr"], folder.path());
        assert_eq!(output.status.code(), Some(3), "{text}: {}", stderr(&output));
        assert!(stderr(&output).contains("plan.json") && stderr(&output).contains(message), "{}", stderr(&output));
        assert!(!folder.path().join("a.exr").exists());
    }

    // Settings for which no plan can be made
    let output = lumiris(&["render", &path, "--noise", "0.1", "--integrator", "photon-map", "-q"], folder.path());
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("--noise needs"), "{}", stderr(&output));
}

#[test]
fn noise_is_reached_with_samples_where_they_are_needed() {
    let folder = tempfile::tempdir().unwrap();
    let path = gallery();
    let image = |noise: &str, name: &str| {
        // Trials could choose differently for the two
        let size = ["--resolution", "64x48", "--estimator", "mis", "--samples", "2"];
        let args = ["render", &path, "--integrator", "direct", "--noise", noise, "-q", "-o", name];
        let output = lumiris(&[&args[..], &size].concat(), folder.path());
        assert!(output.status.success(), "{}", stderr(&output));
        read_image(&folder.path().join(name), &ReadLimits::default()).unwrap().image
    };
    let counts = |noise: &str, name: &str| {
        let image = image(noise, name);
        let channel = image.channels.iter().position(|c| c == "samples").unwrap();
        image.data.iter().skip(channel).step_by(image.channels.len()).copied().collect::<Vec<f32>>()
    };
    let [coarse, fine] = [counts("0.2", "a.exr"), counts("0.05", "b.exr")];
    let sum = |counts: &[f32]| counts.iter().sum::<f32>();
    assert!(sum(&fine) > 4.0 * sum(&coarse), "{} {}", sum(&fine), sum(&coarse));
    let (min, max) = fine.iter().fold((f32::INFINITY, 0.0_f32), |(a, b), &n| (a.min(n), b.max(n)));
    assert!(max > 1.5 * min, "{min} to {max}");
}

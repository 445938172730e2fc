//! Messages about unsuitable files, and about samples and noise of an image.

use super::parts::{image, lumiris, refuse, run};
use super::program::stderr;

#[test]
fn the_reason_why_a_file_cannot_be_read_is_said_once() {
    let folder = tempfile::tempdir().unwrap();
    let said = stderr(&lumiris("merge missing.exr -o a.exr", folder.path()));
    assert_eq!(said.matches("No such file").count(), 1, "{said}");
    assert!(said.contains("missing.exr: No such file"), "{said}");
}

#[test]
fn one_sample_has_no_known_noise() {
    let folder = tempfile::tempdir().unwrap();
    let one = "render GALLERY --resolution 16x9 --estimator mis --spp 1";
    let said = stderr(&lumiris(&format!("{one} -o a.exr"), folder.path()));
    assert!(said.contains(", 1 sample per pixel, noise unknown") && !said.contains("inf"), "{said}");
}

#[test]
fn samples_are_told_by_their_mean_and_range() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scene = "render GALLERY --resolution 96x54 --integrator direct --estimator mis --spp 64";
    let said = stderr(&lumiris(&format!("{scene} --allocation adaptive -o a.exr"), folder));
    let text = &image("a.exr", folder).metadata["lumiris:samples_done"];
    let (mean, range) = text.split_once(" per pixel (").unwrap();
    let samples = image("a.exr", folder);
    let channel = samples.image.channel("samples").unwrap();
    let counts = || samples.image.data.iter().skip(channel).step_by(samples.image.channels.len()).copied();
    let expected = f64::from(counts().sum::<f32>()) / counts().count() as f64;
    assert!((mean.parse::<f64>().unwrap() - expected).abs() <= 0.05 + 1e-9, "{text}, but {expected}");
    // Additional emission rays take part of the time of 64 samples
    assert!((40.0..68.0).contains(&expected), "{expected}");
    assert!(said.contains("; adaptive sampling"), "{said}");
    let [least, most] = [counts().fold(f32::INFINITY, f32::min), counts().fold(0.0, f32::max)];
    assert_eq!(range, format!("{least} to {most})"));
    assert!(said.contains(&format!("{mean} samples per pixel ({range}")), "{said}");

    run(&format!("{scene} --allocation uniform -o b.exr"), folder);
    assert_eq!(image("b.exr", folder).metadata["lumiris:samples_done"], "64 per pixel");
    let said = stderr(&lumiris(&format!("{scene} --allocation uniform --part 1/2 --part-by tiles -o b.part"), folder));
    assert!(said.contains(", 64 samples per pixel"), "a part of tiles has all samples of its pixels: {said}");
}

#[test]
fn images_are_described_and_not_read_as_scenes() {
    // Info
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    run("render GALLERY --resolution 16x9 --estimator mis --spp 2 -q -o a.exr -o a.png -o a.part", folder);
    for name in ["a.exr", "a.png", "a.part"] {
        let output = lumiris(&format!("info {name} --json"), folder);
        let facts: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(
            (facts["size"].as_str(), facts["settings"]["estimator"].as_str()),
            (Some("16x9"), Some("mis")),
            "{name}"
        );
    }

    // Images and meshes are no scenes
    refuse("render a.exr -o b.exr", folder, 2, &["a.exr is an image, not a scene", "lumiris info a.exr"]);
    refuse("render a.ply -o b.exr", folder, 2, &["a.ply is a mesh, not a scene", "plymesh"]);
    refuse("info a.OBJ", folder, 2, &["a.OBJ is a mesh, not a scene", "convert it to PLY"]);
    refuse("info no.exr", folder, 3, &["no.exr: no such file"]);
    std::fs::write(folder.join("broken.exr"), "no image").unwrap();
    refuse("info broken.exr", folder, 3, &["broken.exr: "]);
}

#[test]
fn what_can_hardly_be_meant_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let said = |text: &str| {
        let text = format!("WorldBegin\n{text}\nShape \"sphere\"");
        std::fs::write(folder.join("s.pbrt"), text).unwrap();
        let output = lumiris("render s.pbrt --resolution 8x8 --spp 1 --estimator mis -o a.png", folder);
        (output.status.code(), stderr(&output))
    };
    let (code, dark) = said("");
    assert!(code == Some(0) && dark.contains("nothing emits light: the image will be black"), "{dark}");
    let (code, light) = said("LightSource \"infinite\"");
    assert!(code == Some(0) && !light.contains("warning"), "{light}");
    let (code, bright) = said("LightSource \"infinite\" Material \"diffuse\" \"rgb reflectance\" [ 5 0.5 0.5 ]");
    assert!(code == Some(0) && bright.contains("`reflectance` is beyond 0 to 1") && bright.contains("s.pbrt:2:"));
    let (code, rough) = said("Material \"conductor\" \"float vroughness\" -1 \"float uroughness\" 0.1");
    assert!(code == Some(3) && rough.contains("vroughness must be at least 0, not -1"), "{rough}");
    assert_eq!(rough.matches("must be at least 0").count(), 1, "{rough}");
    // Other errors of a mesh without vertices are not reported
    let (code, empty) = said("Shape \"trianglemesh\" \"integer indices\" [ 0 1 2 ]");
    assert!(code == Some(3) && empty.contains("needs `point3 P`") && !empty.contains("has no parameter"), "{empty}");
}

#[test]
fn options_without_effect_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let image = "render GALLERY --resolution 8x6 --spp 1 -o a.png";
    let said =
        stderr(&lumiris(&format!("{image} --estimator mis --proposals 16 --samples 2 --cache-error 0.1"), folder));
    let warnings = |said: &str| -> Vec<String> {
        let lines = said.lines().filter_map(|line| line.strip_prefix("warning: "));
        lines.filter_map(|line| Some(line.split_once(" has no effect on ")?.0.to_owned())).collect()
    };
    assert_eq!(warnings(&said), ["--proposals 16", "--cache-error 0.1"], "{said}");
    let cases: [(&str, &[&str]); 7] = [
        ("--estimator ris --proposals 16 --samples 2", &[]),
        ("--integrator direct --max-depth 7 --estimator mis", &["--max-depth 7"]),
        (
            "--integrator photon-map --photons 100 --allocation adaptive --path-reuse 4",
            &["--path-reuse 4", "--allocation adaptive"],
        ),
        ("--estimator mc --heuristic maximum", &["--heuristic maximum"]),
        ("--estimator mis --cryptomatte --exr-type half --aov depth", &["--aov", "--cryptomatte", "--exr-type"]),
        ("--estimator mis --cryptomatte --exr-type half --aov depth -o a.exr", &[]),
        ("--estimator mis --aov none --exposure 1", &[]),
    ];
    for (options, expected) in cases {
        let said = stderr(&lumiris(&format!("{image} -q {options}"), folder));
        assert_eq!(warnings(&said), expected, "{options}: {said}");
    }
    let said =
        stderr(&lumiris("render GALLERY --resolution 8x6 --spp 1 -o a.exr --estimator mis --exposure 1", folder));
    assert_eq!(warnings(&said), ["--exposure"], "{said}");

    // In a scene file, with the position
    let head = "Integrator \"direct\" \"integer maxdepth\" 7\n  \"string estimator\" \"mis\" \"integer proposals\" 4";
    std::fs::write(folder.join("s.pbrt"), format!("{head}\nWorldBegin\nLightSource \"infinite\"\n")).unwrap();
    let said = stderr(&lumiris("render s.pbrt --resolution 8x6 --spp 1 -q -o a.png", folder));
    let places = ["s.pbrt:1:21: `maxdepth` 7", "s.pbrt:2:28: `proposals` 4"];
    assert_eq!(warnings(&said), places, "{said}");
    let said = stderr(&lumiris("render s.pbrt --resolution 8x6 --spp 1 -q -o a.png --estimator ris", folder));
    assert_eq!(warnings(&said), places[..1], "{said}");
}

#[test]
fn statistics_that_cannot_be_written_are_refused_before_the_image_is_rendered() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    refuse(
        "render GALLERY --resolution 8x6 --spp 1 -o a.png --stats no/s.json",
        folder,
        3,
        &["folder no does not exist"],
    );
    assert!(!folder.join("a.png").exists());
}

#[test]
fn a_scene_that_names_an_image_of_another_type_has_an_exr() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let film = "Film \"rgb\" \"string filename\" \"b.pfm\"\nWorldBegin\nLightSource \"infinite\"";
    std::fs::write(folder.join("s.pbrt"), film).unwrap();
    let said = stderr(&lumiris("render s.pbrt --resolution 8x8 --spp 1", folder));
    assert!(said.contains("note: b.pfm becomes b.exr") && folder.join("b.exr").exists(), "{said}");
}

#[test]
fn there_is_a_sample_however_little_time_there_is() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    run("render GALLERY --resolution 64x36 --spp 100000 --time 0.000001 -q -o a.exr", folder);
    let file = image("a.exr", folder);
    let channel = file.image.channel("samples").unwrap();
    assert!(file.image.data.iter().skip(channel).step_by(file.image.channels.len()).all(|&n| n >= 1.0));
    // The pilots' sample count for such a short time
    assert_eq!(file.metadata["lumiris:pilot_spp"], "1");
}

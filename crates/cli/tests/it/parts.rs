//! Parts of images: merged, they have the bits of the image rendered at once; parts that do not belong together are
//! refused.

use super::program::{self, stderr};
use lumiris::imaging::oiio::ReadImage;
use std::path::Path;
use std::process::{Command, Output};

/// The program with arguments in one text. The last of repeated options counts. GALLERY is a scene.
pub(crate) fn command(args: &str, folder: &Path) -> Command {
    let gallery = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/demo/gallery.pbrt");
    let mut words: Vec<String> = Vec::new();
    for word in args.split_whitespace() {
        let is_option = word.starts_with("--");
        if let Some(at) = words.iter().position(|before| is_option && before == word) {
            let next = words[at + 1..].iter().position(|w| w.starts_with('-')).map_or(words.len(), |n| at + 1 + n);
            words.drain(at..next);
        }
        words.push(word.replace("GALLERY", &gallery.display().to_string()));
    }
    let mut command = program::command(folder, "");
    command.args(words);
    command
}

pub(crate) fn lumiris(args: &str, folder: &Path) -> Output {
    command(args, folder).output().unwrap()
}

/// Runs the program, which must succeed.
pub(crate) fn run(args: &str, folder: &Path) {
    let output = lumiris(args, folder);
    assert!(output.status.success(), "{args}: {}", stderr(&output));
}

/// Runs the program, which must fail with the exit code and print all of the words.
pub(crate) fn refuse(args: &str, folder: &Path, code: i32, words: &[&str]) {
    let output = lumiris(args, folder);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(code), "{args}: {said}");
    for word in words {
        assert!(said.contains(word), "{args}: no `{word}` in: {said}");
    }
    assert!(!said.contains("panicked"), "{args}: {said}");
}

pub(crate) fn image(name: &str, folder: &Path) -> ReadImage {
    program::read(folder, name)
}

/// Channels and the bits of all values.
pub(crate) fn bits(file: &ReadImage) -> (Vec<String>, Vec<u32>) {
    (file.image.channels.clone(), file.image.data.iter().map(|v| v.to_bits()).collect())
}

/// Fails unless two images have the same bits in all their channels.
pub(crate) fn assert_same(a: &str, b: &str, folder: &Path, what: &str) {
    let [(names, a), (other_names, b)] = [a, b].map(|name| bits(&image(name, folder)));
    assert_eq!(names, other_names, "{what}");
    let channels: Vec<&str> =
        (0..a.len()).filter(|i| a[*i] != b[*i]).map(|i| names[i % names.len()].as_str()).collect();
    assert!(channels.is_empty(), "{what}: {} of {} values differ, first in {}", channels.len(), a.len(), channels[0]);
}

/// Integrators and estimators; true if the samples of a pixel can be divided.
pub(crate) const METHODS: &[(&str, bool)] = &[
    ("--integrator path --estimator mis", true),
    ("--integrator path --estimator mis --path-reuse 3", true),
    ("--integrator path --estimator mis --path-reuse 2 --light-paths 0.5", true),
    ("--integrator path --estimator mis --allocation adaptive --spp 12", true),
    ("--integrator direct --estimator mis --samples 8 --allocation adaptive --spp 16", true),
    ("--integrator direct --estimator mc --sampler independent", true),
    ("--integrator path --estimator ris --samples 2 --proposals 12", true),
    ("--integrator direct --estimator ris --samples 1 --proposals optimal", true),
    ("--integrator direct --estimator ocv --ocv pixels", true),
    ("--integrator direct --estimator ocv --allocation adaptive --spp 16", true),
    ("--integrator direct --estimator ocv --ocv progressive", false),
    ("--integrator direct --estimator optimal-mis --optimal-mis progressive", false),
    ("--integrator direct --estimator correlated", true),
    ("--integrator direct --estimator contributing", true),
    ("--integrator irradiance-cache --estimator mis --cache-samples 16", true),
    ("--integrator photon-map --estimator mis --photons 2000 --gather 2", true),
    ("--integrator photon-map --estimator mis --photons 2000 --gather 1 --progressive", true),
];

const IMAGE: &str = "render GALLERY --resolution 40x36 --spp 7 -q";

#[test]
fn merged_parts_have_the_bits_of_the_single_image_whatever_the_method_and_the_split() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (k, (method, allows_samples)) in METHODS.iter().enumerate() {
        run(&format!("{IMAGE} {method} -o single.exr"), folder);
        let by_tiles =
            ["--part 1/3 --part-by tiles", "--part 2/3 --part-by tiles --threads 1", "--part 3/3 --part-by tiles"];
        let by_share = ["--part 1/3", "--part 2/3 --tile-size 5", "--part 3/3"];
        let by_hand = [
            "--samples-to 1",
            "--samples-from 1 --samples-to 6",
            "--samples-from 6 --part 2/2 --part-by tiles",
            "--samples-from 6 --part 1/2 --part-by tiles",
        ];
        let splits: &[&[&str]] = match allows_samples {
            // Paths are shared by pixels of different tiles
            _ if method.contains("path-reuse") => &[&by_share],
            true => &[&by_tiles, &by_share, &by_hand],
            false => &[&by_tiles],
        };
        // All splits for the first methods, then one per method in turn
        let chosen = |i: &usize| k < 2 || *i == k % splits.len();
        for (i, split) in splits.iter().enumerate().filter(|(i, _)| chosen(i)) {
            for (p, part) in split.iter().enumerate() {
                run(&format!("{IMAGE} {method} {part} -o {p}.part"), folder);
            }
            let mut names: Vec<String> = (0..split.len()).map(|p| format!("{p}.part")).collect();
            names.rotate_left(1 + k % 2);
            run(&format!("merge {} -q -o merged.exr", names.join(" ")), folder);
            if !method.contains("--proposals optimal") {
                assert_same("single.exr", "merged.exr", folder, &format!("{method}, split {i}"));
            } else {
                // Its additional layer, the ratio, is not part of the sums
                let [a, b] = ["single.exr", "merged.exr"].map(|name| image(name, folder));
                let beauty = |f: &ReadImage| {
                    let pixels = f.image.data.chunks_exact(f.image.channels.len());
                    pixels.flat_map(|p| [p[0], p[1], p[2], p[3]].map(f32::to_bits)).collect::<Vec<_>>()
                };
                assert!(beauty(&a) == beauty(&b), "{method}");
            }
            let [single, merged] = ["single.exr", "merged.exr"].map(|name| image(name, folder).metadata);
            for (key, value) in single.iter().filter(|(key, _)| key.starts_with("lumiris:")) {
                assert!(key == "lumiris:seconds" || merged.get(key) == Some(value), "{key} = {:?}", merged.get(key));
            }
        }
    }
}

#[test]
fn layers_of_light_groups_are_those_of_the_single_image() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/demo/light-groups.pbrt");
    let render = format!("render {} --resolution 40x36 --spp 7 --estimator mis -q", scene.display());
    run(&format!("{render} -o single.exr"), folder);
    let single = image("single.exr", folder);
    for group in ["sky", "other", "rim", "key"] {
        for channel in ["R", "G", "B"] {
            let name = format!("light_{group}.{channel}");
            let place = single.image.channels.iter().position(|c| *c == name).unwrap();
            assert!(single.image.data.iter().skip(place).step_by(single.image.channels.len()).any(|v| *v > 0.0));
        }
    }
    for (by, other) in [("", " --part-by tiles --tile-size 5"), (" --part-by tiles", "")] {
        (1..4).for_each(|i| run(&format!("{render} --part {i}/3{by} -o {i}.part"), folder));
        run("merge 2.part 3.part 1.part -q -o merged.exr", folder);
        assert_same("single.exr", "merged.exr", folder, by);
        run(&format!("{render} --light-groups none --part 1/3{other} -o 1.part"), folder);
        refuse("merge 2.part 3.part 1.part -o none.exr", folder, 3, &["light_groups: none, not layers"]);
    }
    run(&format!("{render} --spp 3 --checkpoint c.film -o some.exr"), folder);
    run(&format!("{render} --resume c.film --threads 1 -o resumed.exr"), folder);
    assert_same("single.exr", "resumed.exr", folder, "resumed");

    // An integrator without support for these layers prints a warning
    let output = lumiris(&format!("{render} --integrator irradiance-cache --cache-samples 8 -o cache.exr"), folder);
    assert!(output.status.success() && stderr(&output).contains("light groups have no layers"), "{}", stderr(&output));
    assert!(!image("cache.exr", folder).image.channels.iter().any(|name| name.starts_with("light_")));
}

#[test]
fn more_samples_than_first_asked_for_are_one_more_part() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let method = "--integrator path --estimator mis";
    run(&format!("{IMAGE} {method} --samples-to 12 -o single.exr"), folder);
    run(&format!("{IMAGE} {method} -o first.part"), folder);
    run(&format!("{IMAGE} {method} --samples-from 7 --samples-to 12 -o more.part -o more.exr"), folder);
    run("merge more.part first.part -o merged.exr", folder);
    assert_same("single.exr", "merged.exr", folder, "7 + 5 samples");
    assert_eq!(image("merged.exr", folder).metadata["lumiris:samples_done"], "12 per pixel");
    let [(_, all), (_, more)] = ["single.exr", "more.exr"].map(|name| bits(&image(name, folder)));
    assert_ne!(all, more, "an image of some of the samples");
}

#[test]
fn parts_by_the_rule_are_merged_to_the_image() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let auto = "render GALLERY --integrator path --resolution 32x24 --spp 4 --estimator auto -q";
    run(&format!("{auto} -o single.exr"), folder);
    assert_eq!(image("single.exr", folder).metadata["lumiris:estimator"], "mis");
    (1..3).for_each(|i| run(&format!("{auto} --part {i}/2 -o {i}.part"), folder));
    let output = lumiris("merge 2.part 1.part -o merged.exr", folder);
    assert!(output.status.success() && stderr(&output).contains("from 2 parts"), "{}", stderr(&output));
    assert_same("single.exr", "merged.exr", folder, "by the rule");
    let said = stderr(&lumiris("merge 1.part --allow-missing -o some.exr", folder));
    assert!(said.contains("from 1 part,"), "{said}");
}

#[test]
fn what_cannot_be_divided_is_refused_with_the_reason() {
    // Options and settings
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let render = format!("{IMAGE} --integrator direct --estimator mis");
    for (options, words) in [
        ("--part 1/2 --time 1 -o a.part", ["--time", "parts"]),
        ("--part 1/2 --noise 0.1 --spp 16 -o a.part", ["--noise", "--spp"]),
        ("--part 1/2 --estimator ocv --ocv progressive -o a.part", ["progressive", "--part-by tiles"]),
        ("--samples-to 3 --estimator optimal-mis --optimal-mis progressive -o a.part", ["progressive", "tiles"]),
        ("--part 1/2 -o a.exr", ["lumiris merge", ".part"]),
        ("--part 1/8 -o a.part", ["7 samples per pixel", "8 parts"]),
        ("--part 1/2 --samples-from 1 -o a.part", ["--part", "--samples-from"]),
        ("--samples-from 5 --samples-to 5 -o a.part", ["no samples", "from 5 to 5"]),
        ("--part 3/2 -o a.part", ["--part", "1 <= I <= N"]),
        ("--part-by tiles -o a.part", ["--part", "required"]),
        ("--checkpoint a,-3 -o a.exr", ["--checkpoint", "positive"]),
    ] {
        refuse(&format!("{render} {options}"), folder, 2, &words);
        assert!(!folder.join("a.part").exists());
    }

    // Shared paths
    for shared in ["--estimator mis --path-reuse 3", "--estimator auto --resolution 40x40"] {
        let part = format!("{IMAGE} --integrator path {shared} --part 1/2 --part-by tiles -o a.part");
        refuse(&part, folder, 2, &["share paths", "--part-by samples", "--path-reuse 1"]);
    }
    run(&format!("{IMAGE} --integrator path --part 1/2 --part-by tiles --path-reuse 1 -o a.part"), folder);

    // Checkpoints
    refuse(&format!("{render} --checkpoint no/a -o a.exr"), folder, 3, &["no/a", "does not exist"]);
    refuse(&format!("{render} --resume no -o a.exr"), folder, 3, &["no: ", "No such file"]);

    // Missing parts are counted
    refuse(
        "merge a.part no.1.part no.2.part -o a.exr",
        folder,
        3,
        &["2 of 3 parts do not exist, the first is no.1.part"],
    );
}

#[test]
fn parts_without_pixels_are_parts_and_times_beyond_all_bounds_are_never() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let render = format!("{IMAGE} --integrator direct --estimator mis --resolution 16x16");
    run(&format!("{render} --time 1e300 --checkpoint c.film,1e300 -o single.exr"), folder);
    (1..4).for_each(|i| run(&format!("{render} --part {i}/3 --part-by tiles -o {i}.part"), folder));
    run("merge 2.part 1.part 3.part -q -o merged.exr", folder);
    assert_same("single.exr", "merged.exr", folder, "of one tile");
    refuse("merge 2.part 3.part -o m.exr", folder, 3, &["samples 0 to 7 of all pixels"]);
    // All parts with pixels are missing
    run("merge 2.part 3.part --allow-missing -q -o black.exr", folder);
    run("merge c.film -q -o checkpoint.exr", folder);
    assert_same("single.exr", "checkpoint.exr", folder, "a checkpoint");
}

#[cfg(unix)]
#[test]
fn two_renderings_with_one_checkpoint_leave_it_whole() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let render = "render GALLERY --resolution 96x64 --integrator direct --estimator mis --spp 24 --threads 1 -q";
    let start = |i: u32| {
        let mut command = command(&format!("{render} --checkpoint c.film,0.001 -o {i}.exr"), folder);
        command.stderr(std::process::Stdio::piped()).spawn().unwrap()
    };
    for child in [start(1), start(2)] {
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
    }
    run("merge c.film -q -o merged.exr", folder);
    assert_same("1.exr", "merged.exr", folder, "the checkpoint of two renderings");
    assert!(!folder.join("c.film.tmp").exists());
}

#[test]
fn missing_double_and_foreign_parts_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let render = format!("{IMAGE} --integrator direct --estimator mis");
    run(&format!("{render} -o single.exr"), folder);
    (1..4).for_each(|i| run(&format!("{render} --part {i}/3 -o {i}.part"), folder));
    (1..4).for_each(|i| run(&format!("{render} --part {i}/3 --part-by tiles -o t{i}.part"), folder));
    run(&format!("{render} --part 2/3 --seed 5 -o seed.part"), folder);
    run(&format!("{render} --part 2/3 --aov none -o bare.part"), folder);
    let scene = folder.join("other.pbrt");
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/demo/gallery.pbrt"));
    std::fs::write(&scene, text.unwrap() + "\n# changed\n").unwrap();

    refuse("merge 1.part 3.part -o m.exr", folder, 3, &["missing", "samples 2 to 4 of all pixels", "--allow-missing"]);
    refuse("merge t1.part t3.part -o m.exr", folder, 3, &["samples 0 to 7 of part 2/3 by tiles"]);
    refuse("merge 1.part t2.part -o m.exr", folder, 3, &["1.part and t2.part both have the samples 0 to 2"]);
    refuse("merge 1.part 2.part 3.part 2.part -o m.exr", folder, 2, &["2.part is given twice"]);
    std::fs::copy(folder.join("2.part"), folder.join("copy.part")).unwrap();
    refuse("merge 1.part 2.part 3.part copy.part -o m.exr", folder, 3, &["2.part", "copy.part", "both", "2 to 4"]);
    refuse("merge 1.part seed.part 3.part -o m.exr", folder, 3, &["seed.part", "1.part", "seed: 5, not 0"]);
    refuse("merge 1.part bare.part 3.part -o m.exr", folder, 3, &["bare.part", "layers: "]);
    refuse("merge 1.part no.part -o m.exr", folder, 3, &["no.part"]);
    refuse("merge 1.part single.exr -o m.exr", folder, 3, &["single.exr", "neither a part"]);
    refuse("merge 1.part . -o m.exr", folder, 3, &["folder"]);
    refuse("merge 1.part 2.part 3.part -o m.part", folder, 2, &["m.part"]);
    assert!(!folder.join("m.exr").exists());
    let output = lumiris(&format!("{} --part 2/3 -o foreign.part", render.replace("GALLERY", "other.pbrt")), folder);
    if output.status.success() {
        refuse("merge 1.part foreign.part 3.part -o m.exr", folder, 3, &["foreign.part", "the scene"]);
    } else {
        panic!("{}", stderr(&output));
    }

    // Merges existing parts
    run("merge 3.part 1.part --allow-missing -o some.exr", folder);
    let some = image("some.exr", folder);
    assert_eq!(some.metadata["lumiris:complete"], "false");
    assert_eq!(some.metadata["lumiris:missing"], "samples 2 to 4 of all pixels");
    assert_eq!(some.metadata["lumiris:samples_done"], "5 per pixel");
    run("merge t3.part t1.part --allow-missing -o some.exr", folder);
    assert_eq!(image("some.exr", folder).metadata["lumiris:samples_done"], "4.2 per pixel (0 to 7)");
}

#[test]
fn parts_that_are_cut_off_or_changed_are_errors_with_the_name_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    run(&format!("{IMAGE} --resolution 20x17 --integrator direct --estimator mis -o a.part"), folder);
    let good = std::fs::read(folder.join("a.part")).unwrap();
    let merge = |bytes: &[u8]| {
        std::fs::write(folder.join("b.part"), bytes).unwrap();
        refuse("merge b.part -o m.exr", folder, 3, &["b.part"]);
        assert!(!folder.join("m.exr").exists());
    };
    let len = good.len();
    for end in [0, 5, 11, 12, 20, 100, len / 4, len / 2, len - 200, len - 13, len - 1] {
        merge(&good[..end]);
    }
    merge(&[&good[..], &[0]].concat());
    // Every byte is checked: test some of each region
    for at in (0..40).chain((40..len).step_by(len / 60)).chain(len - 25..len) {
        let mut bytes = good.clone();
        bytes[at] ^= 1 << (at % 8);
        merge(&bytes);
    }
    run("merge a.part -o m.exr", folder);
}

//! Animations: `lumiris render --frames`.

use super::program::{command, stderr};
use lumiris::imaging::Image;
use lumiris::imaging::oiio::{Part, ReadLimits, read_image, read_metadata, write_image};
use std::path::Path;
use std::process::{Command, Output};

const QUAD: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                    element face 2\nproperty list uchar int vertex_indices\nend_header\n\
                    -1 -1 0\n1 -1 0\n1 1 0\n-1 1 0\n3 0 1 2\n3 0 2 3\n";

fn lumiris(folder: &Path, args: &str) -> Output {
    command(folder, args).output().unwrap()
}

/// Scene of a frame: a quadrilateral under a sky, both from files. It moves from frame to frame.
fn frame(number: u32, mesh: &str) -> String {
    format!(
        "LookAt 0 0 {} 0 0 0 0 1 0\nCamera \"perspective\"\nSampler \"independent\" \"integer pixelsamples\" [ 2 ]\n\
         Film \"rgb\" \"integer xresolution\" [ 24 ] \"integer yresolution\" [ 16 ]\nWorldBegin\n\
         LightSource \"infinite\" \"string filename\" \"sky.exr\"\n\
         Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"t.png\"\n\
         Material \"diffuse\" \"texture reflectance\" \"t\"\n\
         Shape \"plymesh\" \"string filename\" \"{mesh}\"\nShape \"plymesh\" \"string filename\" \"floor.ply\"\n\
         Translate 0 0 -1\nShape \"plymesh\" \"string filename\" \"floor.ply\"\n",
        3 + number
    )
}

/// Frames 1 to 4 with the meshes `floor.ply` and `old.ply`, or `new.ply` from the third frame on.
fn animation() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    for name in ["floor.ply", "old.ply"] {
        std::fs::write(path(name), QUAD).unwrap();
    }
    std::fs::write(path("new.ply"), QUAD.replace("1 1 0", "1 2 0")).unwrap();
    let names = || ["R", "G", "B"].map(str::to_owned).to_vec();
    let texels: Vec<f32> = (0..48).map(|i| (i % 7) as f32 / 7.0).collect();
    write_image(&path("t.png"), &[Part::display(4, 4, names(), texels.clone())]).unwrap();
    write_image(&path("sky.exr"), &[Part::linear(4, 4, names(), texels)]).unwrap();
    for number in 1..=4 {
        let text = frame(number, if number < 3 { "old.ply" } else { "new.ply" });
        std::fs::write(path(&format!("shot.{number:04}.pbrt")), text).unwrap();
    }
    folder
}

fn image(path: &Path) -> Image {
    read_image(path, &ReadLimits::default()).unwrap().image
}

/// A setting in the metadata.
fn setting(path: &Path, name: &str) -> String {
    read_metadata(path).unwrap()[&format!("lumiris:{name}")].clone()
}

fn bits(image: &Image) -> Vec<u32> {
    image.data.iter().map(|v| v.to_bits()).collect()
}

fn stats(path: &Path) -> Vec<serde_json::Value> {
    let stats: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    stats["frames"].as_array().unwrap().clone()
}

#[test]
fn frames_read_each_file_once_and_have_the_pixels_of_single_renderings() {
    let folder = animation();
    let path = |name: &str| folder.path().join(name);
    let output = lumiris(folder.path(), "render shot.####.pbrt --frames 1-4 -o f.##.exr -o f.##.png --stats s.json");
    assert!(output.status.success(), "{}", stderr(&output));

    // Sky, texture, floor (twice) and a mesh; only the mesh differs in the third frame
    let expected = [(4, 0), (0, 4), (1, 3), (0, 4)];
    for (frame, (read, shared)) in stats(&path("s.json")).iter().zip(expected) {
        let counts = (frame["files"]["read"].as_u64().unwrap(), frame["files"]["shared"].as_u64().unwrap());
        assert_eq!((counts, frame["result"].as_str().unwrap()), ((read, shared), "done"), "{frame}");
        assert!(frame["stats"]["counts"]["camera_rays"].as_u64().unwrap() > 0);
    }
    let table = stderr(&output);
    assert!(table.contains("files read, shared") && table.contains("1, 3"), "{table}");

    let mut pictures = std::collections::HashSet::new();
    for number in 1..=4 {
        let of_frames = path(&format!("f.{number:02}.exr"));
        let one = format!("render shot.{number:04}.pbrt --seed {} -o one.exr -q", setting(&of_frames, "seed"));
        assert!(lumiris(folder.path(), &one).status.success());
        let (of_frames, alone) = (image(&of_frames), image(&path("one.exr")));
        assert_eq!(bits(&of_frames), bits(&alone), "frame {number}");
        assert!(path(&format!("f.{number:02}.png")).exists());
        pictures.insert(bits(&of_frames));
    }
    assert_eq!(pictures.len(), 4);
}

#[test]
fn a_frame_that_fails_does_not_stop_the_others_and_the_table_says_why() {
    let folder = animation();
    let path = |name: &str| folder.path().join(name);
    let wrong = frame(2, "old.ply").replace("Translate", "Shape \"sphere\" \"float radios\" [ 1 ] Translate");
    std::fs::write(path("shot.0002.pbrt"), wrong).unwrap();
    std::fs::remove_file(path("shot.0003.pbrt")).unwrap();
    std::fs::create_dir(path("f.4.exr")).unwrap();
    let output = lumiris(folder.path(), "render shot.####.pbrt --frames 1-5 -o f.#.exr --stats s.json -q");
    assert_eq!(output.status.code(), Some(3));
    let text = stderr(&output);
    assert!(text.contains("shot.0002.pbrt:") && text.contains("radios"), "{text}");
    assert!(text.contains("4 of 5 frames failed"), "{text}");
    let row = |frame: &str| text.lines().find(|l| l.trim_start().starts_with(&format!("{frame}  failed:")));
    assert!(row("1").is_none() && row("2").is_some(), "{text}");
    assert!(row("4").is_some_and(|row| row.contains("f.4.exr: is a folder")), "{text}");
    let results: Vec<_> = stats(&path("s.json")).iter().map(|f| f["result"].as_str().unwrap().to_owned()).collect();
    assert_eq!(results, ["done", "failed", "failed", "failed", "failed"]);
    assert!(path("f.1.exr").exists() && !path("f.2.exr").exists());
}

#[test]
fn existing_images_are_left_alone_unless_they_are_incomplete() {
    let folder = animation();
    let path = |name: &str| folder.path().join(name);
    let all = "render shot.####.pbrt --frames 1-4 -o f.#.exr -o f.#.png --stats s.json --skip-existing -q";
    let results = || {
        let output = lumiris(folder.path(), all);
        assert!(output.status.success(), "{}", stderr(&output));
        stats(&path("s.json")).iter().map(|f| f["result"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(results(), ["done"; 4]);
    assert_eq!(results(), ["skipped"; 4]);

    // One of two is missing; one is no image; one was cut short by Ctrl-C
    std::fs::remove_file(path("f.1.png")).unwrap();
    std::fs::write(path("f.2.exr"), "half of").unwrap();
    let names = ["R", "G", "B"].map(str::to_owned).to_vec();
    let part = Part::display(1, 1, names, vec![0.0; 3]);
    let interrupted = vec![("lumiris:interrupted".to_owned(), "true".to_owned())];
    write_image(&path("f.3.png"), &[part.with_metadata(interrupted)]).unwrap();
    assert_eq!(results(), ["done", "done", "done", "skipped"]);
    assert_eq!(image(&path("f.3.png")).width, 24);
    assert_eq!(results(), ["skipped"; 4]);
}

#[test]
fn frames_have_other_noise_each_unless_it_is_to_be_the_same() {
    let folder = animation();
    let path = |name: &str| folder.path().join(name);
    for number in 1..=2 {
        std::fs::write(path(&format!("still.{number}.pbrt")), frame(1, "old.ply")).unwrap();
    }
    let run = |args: &str| {
        let output = lumiris(folder.path(), args);
        assert!(output.status.success(), "{args}: {}", stderr(&output));
    };
    let pixels = |name: &str| bits(&image(&path(name)));
    run("render still.#.pbrt --frames 1-2 --seed 7 -q -o f.#.exr");
    assert_ne!(pixels("f.1.exr"), pixels("f.2.exr"));
    assert_ne!(setting(&path("f.1.exr"), "seed"), setting(&path("f.2.exr"), "seed"));
    run("render still.#.pbrt --frames 2 --seed 7 -q -o again.#.exr");
    assert_eq!(pixels("again.2.exr"), pixels("f.2.exr"), "other frames do not matter");
    run("render still.#.pbrt --frames 1-2 --seed 7 --seed-per-frame off -q -o same.#.exr");
    let help = String::from_utf8_lossy(&lumiris(folder.path(), "render --help").stdout).into_owned();
    let of_option = help.split("--seed-per-frame").nth(1).unwrap();
    assert!(of_option.split("--skip-existing").next().unwrap().contains("[possible values: on, off]"), "{of_option}");
    run("render still.1.pbrt --seed 7 -q -o alone.exr");
    assert_eq!(pixels("same.1.exr"), pixels("same.2.exr"));
    assert_eq!(pixels("same.1.exr"), pixels("alone.exr"));

    // A resumed frame keeps its seed, whether or not the seed of the sequence is given again
    run("render still.#.pbrt --frames 1-2 --seed 7 --estimator mis -q -o whole.#.exr");
    run("render still.#.pbrt --frames 1-2 --seed 7 --estimator mis --spp 1 --checkpoint c.#.film -q -o half.#.exr");
    for given in ["", "--seed 7"] {
        run(&format!("render still.#.pbrt --frames 1-2 {given} --spp 2 --resume c.#.film -q -o more.#.exr"));
        assert_eq!(pixels("more.2.exr"), pixels("whole.2.exr"), "{given}");
    }
}

#[test]
fn the_settings_of_a_frame_do_not_depend_on_other_frames() {
    // A ball in the open, then a room: paths are shared only there
    let folder = tempfile::tempdir().unwrap();
    let scene = |shapes: &str| {
        format!(
            "LookAt 0 0 3 0 0 0 0 1 0\nCamera \"perspective\"\nSampler \"independent\" \"integer pixelsamples\" [ 4 ]\n\
             Film \"rgb\" \"integer xresolution\" [ 24 ] \"integer yresolution\" [ 16 ]\nWorldBegin\n\
             LightSource \"infinite\"\nShape \"sphere\"\n{shapes}"
        )
    };
    std::fs::write(folder.path().join("shot.1.pbrt"), scene("")).unwrap();
    let room =
        "Shape \"sphere\" \"float radius\" [ 9 ]\nAreaLightSource \"diffuse\"\nTranslate 0 4 0\nShape \"sphere\"\n";
    std::fs::write(folder.path().join("shot.2.pbrt"), scene(room)).unwrap();
    for (frames, name) in [("1-2", "f"), ("2", "alone")] {
        let args = format!("render shot.#.pbrt --frames {frames} --estimator auto -q -o {name}.#.exr");
        let output = lumiris(folder.path(), &args);
        assert!(output.status.success(), "{args}: {}", stderr(&output));
    }
    let path = |name: &str| folder.path().join(name);
    assert_ne!(setting(&path("f.1.exr"), "path_reuse"), setting(&path("f.2.exr"), "path_reuse"));
    assert_eq!(bits(&image(&path("f.2.exr"))), bits(&image(&path("alone.2.exr"))));
}

#[test]
fn parts_of_frames_are_merged_to_the_frames() {
    let folder = animation();
    let path = |name: &str| folder.path().join(name);
    let run = |args: &str| {
        let output = lumiris(folder.path(), args);
        assert!(output.status.success(), "{args}: {}", stderr(&output));
        stderr(&output)
    };
    let frames = "render shot.####.pbrt --frames 1-3:2 --estimator mis -q";
    run(&format!("{frames} -o whole.##.exr"));
    run(&format!("{frames} --part 1/2 -o f.####.1.part --checkpoint c.####.film"));
    // The other part of a frame, rendered alone: parts of single frames and of sequences are compatible
    let seed = setting(&path("whole.03.exr"), "seed");
    run(&format!("render shot.0003.pbrt --estimator mis --seed {seed} -q --part 2/2 -o f.0003.2.part"));
    run(&format!("{frames} --part 2/2 -o f.####.2.part --skip-existing --stats s.json"));
    let results: Vec<_> = stats(&path("s.json")).iter().map(|f| f["result"].as_str().unwrap().to_owned()).collect();
    assert_eq!(results, ["done", "skipped"]);
    run("merge f.####.2.part f.####.1.part --frames 1,3 -q -o m.##.exr");
    for number in ["01", "03"] {
        let [whole, merged] = ["whole", "m"].map(|name| image(&path(&format!("{name}.{number}.exr"))));
        assert_eq!(bits(&whole), bits(&merged), "frame {number}");
    }

    // Resumes every frame from its own checkpoint
    run(&format!("{frames} --part 1/2 --checkpoint c.####.film --resume c.####.film -o again.####.part"));
    run("merge again.####.part f.####.2.part --frames 3 -q -o n.#.exr");
    assert_eq!(bits(&image(&path("n.3.exr"))), bits(&image(&path("m.03.exr"))));

    // A frame without parts does not stop the others
    std::fs::remove_file(path("f.0001.1.part")).unwrap();
    let output = lumiris(folder.path(), "merge f.####.2.part f.####.1.part --frames 1,3 -o o.#.exr");
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(3), "{text}");
    assert!(text.contains("frame 1: f.0001.1.part: No such file") && text.contains("1 of 2 frames failed"), "{text}");
    assert!(path("o.3.exr").exists() && !path("o.1.exr").exists());
    // An unfinished part is not skipped
    std::fs::write(path("f.0001.1.part"), "half of").unwrap();
    run(&format!("{frames} --part 1/2 -o f.####.1.part --skip-existing"));
    run("merge f.####.2.part f.####.1.part --frames 1,3 -q -o o.#.exr");
}

#[test]
fn ctrl_c_ends_a_sequence_and_its_frame_is_rendered_again() {
    let folder = animation();
    let args = "render shot.####.pbrt --frames 1-2 -o f.#.exr --spp 1000000000 --stats s.json -q";
    let mut child = Command::new(env!("CARGO_BIN_EXE_lumiris"))
        .args(args.split_whitespace())
        .current_dir(folder.path())
        .spawn()
        .unwrap();
    // Long enough to read the scene, even on a busy machine
    std::thread::sleep(std::time::Duration::from_secs(4));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let found = stats(&folder.path().join("s.json"));
    assert_eq!((&found[0]["result"], &found[1]["result"]), (&"done".into(), &"not rendered".into()));
    assert_eq!(found[0]["stats"]["complete"], false);
    let again = "render shot.####.pbrt --frames 1 -o f.#.exr --spp 1 --stats s.json -q --skip-existing";
    assert!(lumiris(folder.path(), again).status.success());
    assert_eq!(stats(&folder.path().join("s.json"))[0]["result"], "done");
}

#[test]
fn names_without_a_place_for_the_number_are_usage_errors() {
    let folder = animation();
    for args in [
        "render shot.####.pbrt --frames 1-2 -o f.exr",
        "render shot.0001.pbrt --frames 1-2 -o f.#.exr",
        "render shot.####.pbrt --frames 1-2",
        "render shot.####.pbrt --frames 2-1 -o f.#.exr",
        "render shot.####.pbrt --frames 1 -o f.#.exr --aov none,depth",
        "render shot.0001.pbrt --skip-existing -o f.exr",
        "render shot.####.pbrt --frames 1-2 --estimator mis --part 1/2 -o f.part",
        "render shot.####.pbrt --frames 1-2 --checkpoint c.film -o f.#.exr",
        "render shot.####.pbrt --frames 1-2 --resume c.film -o f.#.exr",
        "merge f.####.part --frames 1-2 -o f.exr",
        "merge f.1.part --frames 1-2 -o f.#.exr",
    ] {
        assert_eq!(lumiris(folder.path(), args).status.code(), Some(2), "{args}");
    }
}

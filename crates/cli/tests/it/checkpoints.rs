//! Checkpoints: a rendering that is killed and resumed has the bits of an uninterrupted one.

use super::parts::{METHODS, assert_same, command, image, lumiris, run};
use super::program::stderr;
use lumiris::render::parts::FilmReader;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Starts the program.
fn start(args: &str, folder: &Path) -> Child {
    command(args, folder).stderr(Stdio::piped()).spawn().unwrap()
}

/// Waits until the condition holds, which must be before the program ends.
fn wait_until(is_so: impl Fn() -> bool, child: &mut Child) {
    while !is_so() {
        assert!(child.try_wait().unwrap().is_none(), "it ended too early for this test");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Stops a rendering by a signal as soon as it has stored something in `c.film`.
#[cfg(unix)]
fn begin(args: &str, folder: &Path) {
    begin_until(1, args, folder);
}

/// As [`begin`], but waits for a checkpoint of at least `bytes` bytes.
fn begin_until(bytes: u64, args: &str, folder: &Path) {
    let mut child = start(&format!("{args} --checkpoint c.film,0.0001"), folder);
    let is_written = || std::fs::metadata(folder.join("c.film")).is_ok_and(|file| file.len() >= bytes);
    wait_until(is_written, &mut child);
    let signal = Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    assert!(signal.success());
    assert_eq!(child.wait().unwrap().code(), Some(130), "as if stopped by Ctrl-C");
}

/// Camera samples in a checkpoint, which must be complete; 0 if there is none.
fn stored_samples(path: &Path) -> u64 {
    if !path.exists() {
        return 0;
    }
    let tiles = FilmReader::open(path).unwrap().all_tiles().unwrap();
    tiles.iter().map(|t| t.bounds.area() as u64 * u64::from(t.done)).sum()
}

fn names_in(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Pseudorandom numbers.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn below(&mut self, n: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % n
    }
}

/// Renders with a method, kills and resumes the program repeatedly, and compares the images. Returns the numbers of
/// kills, and of resumptions from stored samples. The first kill is either `early`, possibly before anything is stored,
/// or some time after the first checkpoint, however busy the machine is.
fn killed(method: &str, spp: u32, early: bool, random: &mut Random) -> (u32, u32) {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let image = format!("render GALLERY --resolution 80x60 {method} --spp {spp} -q");
    let begin = Instant::now();
    run(&format!("{image} -o whole.exr"), folder);
    let whole = begin.elapsed();
    let checkpoint = folder.join("c.film");
    let (mut kills, mut resumed, mut stored) = (0, 0, 0);
    loop {
        let threads = 1 + random.below(3);
        let tile = [16, 7, 32][random.below(3) as usize];
        let options = format!("--threads {threads} --tile-size {tile} --checkpoint c.film,0.02 --resume c.film");
        resumed += u32::from(stored > 0);
        let mut child = start(&format!("{image} {options} -o resumed.exr"), folder);
        while !(checkpoint.exists() || early && kills == 0) && child.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_millis(1));
        }
        // Some runs are killed during the preparation. The time before a kill grows, so that the rendering ends
        let life = random.below(40 + whole.as_millis() as u64 * u64::from(2 + kills) / 8);
        let end = Instant::now() + Duration::from_millis(life);
        let status = loop {
            match child.try_wait().unwrap() {
                None if Instant::now() < end => std::thread::sleep(Duration::from_millis(1)),
                status => break status,
            }
        };
        if let Some(status) = status {
            assert!(status.success(), "{method}: {}", stderr(&child.wait_with_output().unwrap()));
            break;
        }
        child.kill().unwrap();
        child.wait().unwrap();
        kills += 1;
        let now = stored_samples(&checkpoint);
        assert!(now >= stored, "{method}: a checkpoint had {stored} samples, and a later one {now}");
        stored = now;
    }
    assert_same("whole.exr", "resumed.exr", folder, method);
    assert_eq!(stored_samples(&checkpoint), 80 * 60 * u64::from(spp));
    // An image that was interrupted while it was written has no name yet
    let names: Vec<String> = names_in(folder).into_iter().filter(|name| !name.starts_with(".partial-")).collect();
    assert_eq!(names, ["c.film", "resumed.exr", "whole.exr"], "half of a file is left");
    (kills, resumed)
}

/// Kills renderings by all methods in turn, `times` times in total.
fn kill(times: u32) {
    let mut random = Random(2026);
    let (mut kills, mut resumed) = (0, 0);
    // Sample counts that take long enough with each method, and are no powers of two
    let (mut turn, methods) = (0, METHODS.iter().map(|(method, _)| method.split(" --spp").next().unwrap()));
    let methods: Vec<&str> = methods.collect();
    while kills < times {
        // Steps of 4, so that a few rounds include methods of all kinds
        let method = methods[(turn * 4 + turn / methods.len()) % methods.len()];
        let spp = if method.contains("photon") || method.contains("cache") { 9 } else { 43 };
        let (k, r) = killed(method, spp, turn % 4 == 0, &mut random);
        (kills, resumed, turn) = (kills + k, resumed + r, turn + 1);
    }
    assert!(2 * resumed > kills, "only {resumed} of {kills} killed renderings had stored anything");
}

#[test]
fn renderings_that_are_killed_at_any_time_end_with_the_same_bits() {
    let times = std::env::var("LUMIRIS_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(5);
    kill(times);
}

#[cfg(unix)]
#[test]
fn info_lists_the_samples_of_an_interrupted_rendering() {
    let folder = tempfile::tempdir().unwrap();
    begin("render GALLERY --resolution 40x30 --spp 200000 --estimator mis -q -o a.exr", folder.path());
    let output = lumiris("info c.film --json", folder.path());
    let facts: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let mean: f64 = facts["samples done"].as_str().unwrap().split(' ').next().unwrap().parse().unwrap();
    let stored = stored_samples(&folder.path().join("c.film")) as f64 / (40.0 * 30.0);
    assert!(stored < 200_000.0 && (mean - stored).abs() <= 0.05, "{stored} {facts}");
}

#[cfg(unix)]
#[test]
fn every_method_goes_on_from_the_middle_of_an_image() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (method, _) in METHODS {
        let image = format!("render GALLERY --resolution 32x24 {method} --spp 153 -q");
        run(&format!("{image} -o whole.exr"), folder);
        begin(&format!("{image} --threads 1 -o begun.exr"), folder);
        let stored = stored_samples(&folder.join("c.film"));
        assert!(stored > 0 && stored < 32 * 24 * 153, "{method}: {stored}");
        run("render GALLERY --resume c.film --threads 3 -q -o resumed.exr", folder);
        assert_same("whole.exr", "resumed.exr", folder, method);
        std::fs::remove_file(folder.join("c.film")).unwrap();
    }
}

#[test]
fn a_finished_checkpoint_goes_on_to_more_samples_and_is_a_part() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let begun = "render GALLERY --resolution 40x36 --integrator direct --estimator ocv --spp 5 -q";
    run(&format!("{begun} --checkpoint c.film -o five.exr"), folder);
    run("merge c.film -q -o merged.exr", folder);
    assert_same("five.exr", "merged.exr", folder, "a checkpoint as part");
    run("render GALLERY --resume c.film --spp 12 -q -o resumed.exr", folder);
    run(&format!("{begun} --samples-to 12 -o twelve.exr"), folder);
    assert_same("twelve.exr", "resumed.exr", folder, "5 and 7 more samples");
    // An image of --spp 12 has narrower texture footprints, but no texture is visible here
    assert_eq!(image("resumed.exr", folder).metadata["lumiris:samples_done"], "12 per pixel");
    let output = lumiris("render GALLERY --resume c.film --spp 3 -q -o less.exr", folder);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("c.film cannot go on to 3 samples"), "{}", stderr(&output));
}

#[test]
fn a_checkpoint_of_another_scene_or_of_other_settings_is_refused_with_what_differs() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = "Camera \"perspective\"\nFilm \"rgb\" \"integer xresolution\" 8 \"integer yresolution\" 8\nWorldBegin\n\
                LightSource \"infinite\"\nShape \"plymesh\" \"string filename\" \"a.ply\"\n";
    let mesh = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 5\n1 0 5\n0 1 5\n3 0 1 2\n";
    std::fs::write(folder.join("a.pbrt"), text).unwrap();
    std::fs::write(folder.join("a.ply"), mesh).unwrap();
    run("render a.pbrt --integrator direct --estimator mis -q --checkpoint c.film -o a.exr", folder);
    let refused = |options: &str, words: &[&str]| {
        let output = lumiris(&format!("render a.pbrt --resume c.film -q -o b.exr {options}"), folder);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(3), "{options}: {said}");
        assert!(words.iter().all(|word| said.contains(word)) && said.contains("c.film"), "{options}: {said}");
        assert!(!folder.join("b.exr").exists());
    };
    refused("--seed 3 --estimator mc", &["seed: 3, not 0", "estimator: mc, not mis"]);
    refused("--resolution 9x8", &["resolution: 9x8, not 8x8"]);
    refused("--accel bvh", &["accel: bvh, not embree"]);
    refused("--aov none", &["layers"]);
    // One digit of a mesh
    std::fs::write(folder.join("a.ply"), mesh.replace("0 1 5", "0 1 6")).unwrap();
    refused("", &["the scene: its files are not the same"]);
    std::fs::write(folder.join("a.ply"), mesh).unwrap();
    std::fs::write(folder.join("a.pbrt"), format!("{text}# more\n")).unwrap();
    refused("", &["the scene"]);
    std::fs::write(folder.join("a.pbrt"), text).unwrap();
    run("render a.pbrt --resume c.film -q -o b.exr", folder);
    assert_same("a.exr", "b.exr", folder, "the same scene again");
}

/// A rendering of a few seconds.
const LONG: &str = "render GALLERY --resolution 64x48 --integrator path --estimator mis --spp 150 --threads 1 -q";

#[test]
fn a_checkpoint_that_can_no_longer_be_written_is_a_warning_and_the_last_one_stays() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut child = start(&format!("{LONG} --checkpoint c.film,0.01 -o a.exr"), folder);
    let checkpoint = folder.join("c.film");
    wait_until(|| checkpoint.exists(), &mut child);
    // A folder blocks the name of the temporary file, even for the root user
    wait_until(|| std::fs::create_dir(folder.join("c.film.tmp")).is_ok(), &mut child);
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let said = stderr(&output);
    assert_eq!(said.matches("warning: the checkpoint c.film cannot be written").count(), 1, "{said}");
    assert!(said.contains("the last one stays"), "{said}");
    std::fs::remove_dir(folder.join("c.film.tmp")).unwrap();
    let stored = stored_samples(&checkpoint);
    assert!(stored > 0 && stored < 64 * 48 * 150, "{stored}");
    run("render GALLERY --resume c.film -q -o b.exr", folder);
    assert_same("a.exr", "b.exr", folder, "from the last good checkpoint");
}

/// Runs the program in a shell after a preparation.
#[cfg(unix)]
fn by_shell(preparation: &str, args: &str, folder: &Path) -> std::process::Output {
    let gallery = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/demo/gallery.pbrt");
    let args = args.replace("GALLERY", &gallery.display().to_string());
    let script = format!("{preparation}; exec '{}' {args}", env!("CARGO_BIN_EXE_lumiris"));
    Command::new("sh").args(["-c", &script]).current_dir(folder).output().unwrap()
}

#[cfg(unix)]
#[test]
fn a_full_disk_ends_no_rendering_and_leaves_no_half_of_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    run(&format!("{LONG} -o whole.exr"), folder);
    begin_until(400 * 512, &format!("{LONG} -o begun.png"), folder);
    let good = std::fs::read(folder.join("c.film")).unwrap();
    // Files of at most 300 blocks of 512 bytes: enough for the image and the shim of OpenImageIO, but not for a
    // checkpoint
    let full = "trap '' XFSZ; ulimit -f 300";
    let args = "render GALLERY --resume c.film --checkpoint c.film,0.05 --threads 1 -q -o a.png";
    let output = by_shell(full, args, folder);
    let said = stderr(&output);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("warning: the checkpoint c.film cannot be written: File too large"), "{said}");
    assert!(std::fs::read(folder.join("c.film")).unwrap() == good, "the last good one");
    assert_eq!(names_in(folder), ["a.png", "begun.png", "c.film", "whole.exr"]);
    run("render GALLERY --resume c.film -q -o b.exr", folder);
    assert_same("whole.exr", "b.exr", folder, "after the disk was full");
    // A part is a result, so a failure to write it is an error
    let part = format!("{LONG} --part 1/50 -o a.part");
    let output = by_shell(full, &part, folder);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    assert!(stderr(&output).contains("a.part: File too large"), "{}", stderr(&output));
    assert_eq!(names_in(folder), ["a.png", "b.exr", "begun.png", "c.film", "whole.exr"]);
}

#[cfg(unix)]
#[test]
fn a_folder_that_cannot_be_written_ends_no_rendering() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let locked = folder.join("locked");
    std::fs::create_dir(&locked).unwrap();
    std::fs::set_permissions(&locked, std::fs::Permissions::from_mode(0o555)).unwrap();
    // The root user can write anywhere except to files of the kernel
    let path = if std::fs::write(locked.join("a"), "").is_ok() { "/proc/c.film" } else { "locked/c.film" };
    let image = "render GALLERY --resolution 16x16 --integrator direct --estimator mis --spp 2 -q";
    let output = lumiris(&format!("{image} --checkpoint {path},0.001 -o a.exr"), folder);
    assert!(output.status.success(), "{}", stderr(&output));
    let said = stderr(&output);
    assert_eq!(said.matches(&format!("warning: the checkpoint {path} cannot be written")).count(), 1, "{said}");
    assert!(folder.join("a.exr").exists());
}

#[cfg(unix)]
#[test]
fn a_part_that_is_interrupted_is_no_part_until_it_is_finished() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let image = "render GALLERY --resolution 64x48 --integrator path --estimator mis --spp 150 --threads 1 -q";
    run(&format!("{image} --part 2/2 -o 2.part"), folder);
    begin(&format!("{image} --part 1/2 -o 1.part"), folder);
    let output = lumiris("merge 1.part 2.part -o m.exr", folder);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    assert!(stderr(&output).contains("1.part, which is not finished"), "{}", stderr(&output));
    run("merge 1.part 2.part --allow-missing -q -o some.exr", folder);
    assert_eq!(image_complete("some.exr", folder), "false");
    run("render GALLERY --resume 1.part -q -o 1.part", folder);
    run("merge 1.part 2.part -q -o merged.exr", folder);
    // The original command can also resume: the sample range of a part follows from the image's sample count
    let part = format!("{image} --part 1/2");
    run(&format!("{part} --resume c.film -o again.part"), folder);
    run("merge again.part 2.part -q -o again.exr", folder);
    assert_same("merged.exr", "again.exr", folder, "a part resumed by its own command");
    assert_eq!(image_complete("merged.exr", folder), "true");
    run(&format!("{image} -o whole.exr"), folder);
    assert_same("whole.exr", "merged.exr", folder, "an interrupted part");
}

#[cfg(unix)]
fn image_complete(name: &str, folder: &Path) -> String {
    image(name, folder).metadata["lumiris:complete"].clone()
}

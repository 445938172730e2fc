//! `lumiris farm slurm`: its jobs give the bits of the image rendered at once. Tested in a simulated cluster of two
//! nodes (`make test-farm`), and with an `sbatch` that runs jobs immediately.

use crate::parts::{assert_same, command, run};
use crate::program::{read, stderr};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// An `sbatch` that runs the tasks of a job immediately and logs its arguments.
const SBATCH: &str = r#"#!/bin/bash
echo "$@" >>"$CALLS"
id=$(wc -l <"$CALLS")
[ "$id" != "${FAIL_AT:-}" ] || { echo "sbatch: error: invalid partition specified: none" >&2; exit 1; }
for word in "$@"; do
  case $word in --array=*) last=${word##*-} ;; --chdir=*) cd "${word#*=}" || exit 1 ;; esac
done
script=("${@: -1}")
[[ $script == *.sh ]] || script=("${@: -2}")
for i in $(seq "${last:-1}"); do SLURM_ARRAY_TASK_ID=$i SLURM_CPUS_ON_NODE=1 bash "${script[@]}" >>log 2>&1 || exit 1; done
echo "$id;cluster"
"#;
const FARM: &str = "farm slurm GALLERY --resolution 40x36 --spp 7 --parts 3 -o image.exr";

/// A folder with an unfriendly name, and programs that simulate a queue.
fn queue() -> (tempfile::TempDir, PathBuf) {
    let root = tempfile::tempdir().unwrap();
    for (name, text) in
        [("sbatch", SBATCH), ("squeue", "#!/bin/sh\n"), ("scancel", "#!/bin/sh\necho cancel $@ >>$CALLS\n")]
    {
        let path = root.path().join(name);
        fs::write(&path, text).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    }
    let folder = root.path().join("it's a 100% \"test\"");
    fs::create_dir(&folder).unwrap();
    (root, folder)
}

fn farm(args: &str, folder: &Path) -> Command {
    let root = folder.parent().unwrap();
    let mut command = command(args, folder);
    let path = format!("{}:{}", root.display(), std::env::var("PATH").unwrap());
    command.env("PATH", path).env("CALLS", root.join("calls"));
    command
}

fn assert_success(output: &Output) {
    assert!(output.status.success(), "{}", stderr(output));
}

#[test]
fn jobs_render_the_bits_of_the_image_at_once_in_any_folder_and_do_nothing_again() {
    let (root, folder) = queue();
    let args = format!("{FARM} --integrator path --submit --sbatch --time=1:00:00");
    let output = farm(&args, &folder).output().unwrap();
    assert_success(&output);
    assert_eq!(String::from_utf8_lossy(&output.stdout), "part: job 1\nmerge: job 2\n");
    run("render GALLERY --resolution 40x36 --spp 7 -q --integrator path -o whole.exr", &folder);
    assert_same("image.exr", "whole.exr", &folder, "merged by a queue");
    let calls = fs::read_to_string(root.path().join("calls")).unwrap();
    let calls: Vec<&str> = calls.lines().collect();
    assert!(calls.iter().all(|call| call.contains("--time=1:00:00") && call.contains("--requeue")), "{calls:?}");
    assert!(calls[0].contains("--array=1-3"), "{}", calls[0]);
    assert!(calls[1].contains("--dependency=afterok:1 "), "{}", calls[1]);

    // Again: finished parts are not rendered again
    let modified = |name: &str| fs::metadata(folder.join("image.farm").join(name)).unwrap().modified().unwrap();
    let before = modified("2.part");
    assert_success(&farm(&args, &folder).output().unwrap());
    assert_eq!(modified("2.part"), before);
    let log = fs::read_to_string(folder.join("image.farm/log")).unwrap();
    assert!(log.contains("part 2 of 3 is rendered") && log.contains("part 2 of 3 is complete"), "{log}");
}

/// Scenes of two frames.
fn write_frames(folder: &Path) {
    for number in [1, 2] {
        let scene = format!(
            "LookAt 0 0 {number} 0 0 -5 0 1 0\nCamera \"perspective\"\nSampler \"independent\" \"integer pixelsamples\" [ 4 ]\n\
             Film \"rgb\" \"integer xresolution\" [ 24 ] \"integer yresolution\" [ 16 ]\nWorldBegin\n\
             LightSource \"infinite\"\nTranslate 0 0 -5\nShape \"sphere\"\n"
        );
        fs::write(folder.join(format!("shot.{number:04}.pbrt")), scene).unwrap();
    }
}

/// Fails unless the frames have the pixels of images rendered at once.
fn assert_frames(folder: &Path, options: &str) {
    for number in 1..=2 {
        run(&format!("render shot.####.pbrt --frames {number} -q {options} -o whole.####.exr"), folder);
        assert_same(
            &format!("out.000{number}.exr"),
            &format!("whole.000{number}.exr"),
            folder,
            &format!("frame {number}"),
        );
    }
}

#[test]
fn frames_have_jobs_of_their_own_and_those_that_are_merged_are_left_alone() {
    let (root, folder) = queue();
    write_frames(&folder);
    let args = "farm slurm shot.####.pbrt --frames 1-2 --parts 2 -o out.####.exr";
    let output = farm(&format!("{args} --submit"), &folder).output().unwrap();
    assert_success(&output);
    let told = "part of frame 1: job 1\nmerge of frame 1: job 2\npart of frame 2: job 3\nmerge of frame 2: job 4\n";
    assert_eq!(String::from_utf8_lossy(&output.stdout), told);
    assert_frames(&folder, "");
    let calls = fs::read_to_string(root.path().join("calls")).unwrap();
    let calls: Vec<&str> = calls.lines().collect();
    for (i, words) in [(0, "--output=0001.%a.log --array=1-2 "), (1, "--dependency=afterok:1 "), (3, "afterok:3 ")] {
        assert!(calls[i].contains(words), "{}", calls[i]);
    }

    // Only the missing frame is rendered and submitted
    fs::remove_file(folder.join("out.farm/0002.merged")).unwrap();
    fs::remove_file(folder.join("out.farm/0002.1.part")).unwrap();
    fs::remove_file(folder.join("out.0002.exr")).unwrap();
    let output = farm(&format!("{args} --submit"), &folder).output().unwrap();
    assert_success(&output);
    let told = "frame 1 is merged\npart of frame 2: job 5\nmerge of frame 2: job 6\n";
    assert_eq!(String::from_utf8_lossy(&output.stdout), told);
    assert_frames(&folder, "");
    let log = fs::read_to_string(folder.join("out.farm/log")).unwrap();
    assert!(log.contains("part 2 of 2 of frame 2 is complete"), "{log}");

    // Without a queue
    fs::remove_dir_all(folder.join("out.farm")).unwrap();
    fs::remove_file(folder.join("out.0001.exr")).unwrap();
    let args = "farm slurm shot.####.pbrt --frames 1-2 --estimator mis -o out.####.exr";
    assert_success(&farm(args, &folder).output().unwrap());
    let script = |args: &str| Command::new("bash").args(args.split(' ')).current_dir(folder.join("out.farm")).output();
    for line in ["part.sh 1 1", "part.sh 2", "merge.sh 1", "merge.sh 2"] {
        assert_success(&script(line).unwrap());
    }
    assert_frames(&folder, "--estimator mis");
    for (line, words) in
        [("part.sh", "which frame?"), ("part.sh 3 1", "no frame 3"), ("part.sh 1 2", "no part 2 of 1 of frame 1")]
    {
        let output = script(line).unwrap();
        assert!(!output.status.success() && stderr(&output).contains(words), "{line}: {}", stderr(&output));
    }
}

#[test]
fn values_with_dashes_and_bare_options_reach_the_parts() {
    let (_root, folder) = queue();
    let options =
        "--estimator mis --part-by tiles --box-filter --crop 0,0.5,0,1 --seed 5 --aov none --exr-compression piz";
    assert_success(&farm(&format!("{FARM} {options} --submit --dir d"), &folder).output().unwrap());
    run(
        "render GALLERY --resolution 40x36 --spp 7 -q --estimator mis --box-filter --crop 0,0.5,0,1 --seed 5 --aov none -o w.exr",
        &folder,
    );
    assert_same("image.exr", "w.exr", &folder, "with options");
    assert_eq!(read(&folder, "image.exr").metadata["compression"], "piz");
}

#[test]
fn what_cannot_be_rendered_or_submitted_is_refused() {
    let (root, folder) = queue();
    let refuse = |args: &str, code: i32, words: &str| {
        let output = farm(args, &folder).output().unwrap();
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(code), "{args}: {said}");
        assert!(said.contains(words), "{args}: no `{words}` in: {said}");
    };
    refuse(&format!("{FARM} --estimator mis --noise 0.1"), 2, "--noise");
    refuse(&format!("{FARM} --estimator mis --parts 8"), 2, "cannot be 8 parts");
    refuse(&format!("{FARM} --integrator direct --estimator ocv --ocv progressive"), 2, "--part-by tiles");
    refuse(&FARM.replace("GALLERY", "none.pbrt"), 3, "none.pbrt");
    refuse(&FARM.replace("GALLERY", "-"), 2, "it must be a file");
    refuse(&FARM.replace("image.exr", "image.part"), 2, "merged to an image");
    write_frames(&folder);
    let frames = FARM.replace("GALLERY", "shot.####.pbrt --frames 1-2 --estimator mis");
    refuse(&frames, 2, "image.exr has no ####");
    refuse(&FARM.replace("image.exr", "image.#.exr --frames 1-2"), 2, "gallery.pbrt has no ####");
    let frames = frames.replace("image.exr", "image.####.exr");
    refuse(&format!("{frames} --frames 1-3"), 3, "shot.0003.pbrt");
    refuse(&format!("{frames} --dir a#b"), 2, "a --dir without #");
    assert!(!folder.join("image.farm").exists());

    // Foreign files are kept
    fs::create_dir(folder.join("image.farm")).unwrap();
    fs::write(folder.join("image.farm/mine"), "").unwrap();
    refuse(FARM, 3, "not of this rendering");
    fs::remove_file(folder.join("image.farm/mine")).unwrap();
    assert_success(&farm(FARM, &folder).output().unwrap());
    refuse(&format!("{FARM} --seed 9"), 3, "not of this rendering");

    // If a job is refused, the jobs before it are cancelled
    let output = farm(&format!("{FARM} --submit"), &folder).env("FAIL_AT", "2").output().unwrap();
    assert_eq!(output.status.code(), Some(3));
    assert!(stderr(&output).contains("invalid partition specified"), "{}", stderr(&output));
    assert!(fs::read_to_string(root.path().join("calls")).unwrap().ends_with("cancel 1\n"));
    assert!(!folder.join("image.farm/jobs").exists());
}

/// A cluster. Dropping it stops its daemons.
struct Cluster(PathBuf);

impl Cluster {
    fn script(&self, action: &str, node: &str) {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/farm/cluster.sh");
        let output = Command::new("bash").arg(script).arg(action).arg(&self.0).arg(node).output().unwrap();
        assert!(output.status.success(), "{action} {node}: {}", stderr(&output));
    }

    /// Runs a program of Slurm, and returns its output.
    fn slurm(&self, line: &str) -> String {
        let mut words = line.split_whitespace();
        let output =
            Command::new(words.next().unwrap()).args(words).env("SLURM_CONF", self.0.join("slurm.conf")).output();
        String::from_utf8_lossy(&output.unwrap().stdout).trim().to_owned()
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/farm/cluster.sh");
        let _ = Command::new("bash").arg(script).arg("stop").arg(&self.0).status();
    }
}

fn wait_until(what: &str, limit: u64, holds: impl Fn() -> bool) {
    let start = Instant::now();
    while !holds() {
        assert!(start.elapsed() < Duration::from_secs(limit), "after {limit} s not yet: {what}");
        sleep(Duration::from_millis(200));
    }
}

#[test]
#[ignore = "needs Slurm, which `make test-farm` installs"]
fn a_cluster_renders_the_bits_of_the_image_though_a_task_is_requeued_and_a_node_goes_down() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path();
    let cluster = Cluster(folder.join("cluster"));
    fs::create_dir(&cluster.0).unwrap();
    cluster.script("start", "");
    let image = "GALLERY --estimator mis --resolution 160x90 --spp 400";
    run(&format!("render {image} --threads 2 -q -o whole.exr"), folder);

    let args = format!("farm slurm {image} --parts 4 --checkpoint-seconds 1 -o image.exr --submit");
    let output = command(&args, folder).env("SLURM_CONF", cluster.0.join("slurm.conf")).output().unwrap();
    assert_success(&output);
    let jobs = fs::read_to_string(folder.join("image.farm/jobs")).unwrap();
    let (array, merge) = jobs.trim().split_once(',').unwrap();
    let films = || [1, 2].iter().all(|i| folder.join(format!("image.farm/{i}.film")).exists());
    wait_until("checkpoints of two tasks", 60, films);

    // One task is requeued; the node of another goes down, its daemon first
    cluster.slurm(&format!("scontrol requeue {array}_1"));
    let node = cluster.slurm(&format!("squeue --noheader --format=%N --jobs={array}_2"));
    let pid = fs::read_to_string(cluster.0.join(format!("{node}.pid"))).unwrap();
    assert!(Command::new("kill").args(["-KILL", pid.trim()]).status().unwrap().success());
    cluster.slurm(&format!("scontrol update nodename={node} state=down reason=test"));
    let is_done = || {
        // Slurm waits two minutes before it restarts such tasks
        for task in [1, 2] {
            if cluster.slurm(&format!("squeue --noheader --format=%r --jobs={array}_{task}")) == "BeginTime" {
                cluster.slurm(&format!("scontrol update jobid={array}_{task} starttime=now"));
            }
        }
        cluster.slurm("squeue --noheader").is_empty() && folder.join("image.exr").exists()
    };
    wait_until("the merged image", 240, is_done);

    for job in [format!("{array}_1"), format!("{array}_2")] {
        let shown = cluster.slurm(&format!("scontrol show job {job}"));
        assert!(shown.contains("Restarts=1") && shown.contains("JobState=COMPLETED"), "{shown}");
        assert!(!shown.contains(&format!("NodeList={node}")), "not on the node that is down: {shown}");
    }
    assert!(cluster.slurm(&format!("scontrol show job {merge}")).contains("JobState=COMPLETED"));
    assert_same("image.exr", "whole.exr", folder, "merged by a cluster");
}

#[test]
#[ignore = "needs Slurm, which `make test-farm` installs"]
fn a_cluster_says_what_is_wrong_and_renders_frames() {
    let root = tempfile::tempdir().unwrap();
    let cluster = Cluster(root.path().join("cluster"));
    fs::create_dir(&cluster.0).unwrap();
    cluster.script("start", "");
    let args = format!("{FARM} --estimator mis --submit --sbatch --partition=none");
    let output = command(&args, root.path()).env("SLURM_CONF", cluster.0.join("slurm.conf")).output().unwrap();
    assert_eq!(output.status.code(), Some(3));
    assert!(stderr(&output).contains("invalid partition specified: none"), "{}", stderr(&output));
    assert!(cluster.slurm("squeue --noheader").is_empty());

    // The same cluster renders frames
    write_frames(root.path());
    let args = "farm slurm shot.####.pbrt --frames 1-2 --parts 2 --estimator mis -o out.####.exr --submit";
    assert_success(&command(args, root.path()).env("SLURM_CONF", cluster.0.join("slurm.conf")).output().unwrap());
    let is_merged = |frame| root.path().join(format!("out.farm/000{frame}.merged")).exists();
    wait_until("two merged frames", 120, || is_merged(1) && is_merged(2));
    assert_frames(root.path(), "--estimator mis");
}

//! Ctrl-C and SIGTERM before there is an image.

use super::program::{command, stderr};
use std::io::Write;
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::time::{Duration, Instant};

/// A program that loads a scene from its standard input, which does not end.
fn loading(folder: &Path, args: &str) -> (Child, ChildStdin) {
    let mut command = command(folder, args);
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    // More than a pipe holds, so part of it has been read once it is written
    let mut scene = child.stdin.take().unwrap();
    scene.write_all(&b"# still going on\n".repeat(1 << 15)).unwrap();
    (child, scene)
}

/// Every subcommand that loads a scene can be ended while it does. A scene that never ends keeps it loading.
#[test]
fn signals_end_the_loading_of_a_scene_within_a_second() {
    let folder = tempfile::tempdir().unwrap();
    for (args, signal) in [
        ("render - -o a.exr", "-INT"),
        ("render - -o a.exr", "-TERM"),
        ("render - -o a.exr --estimator mis --view=0", "-INT"),
        ("info -", "-INT"),
        ("crosscheck -", "-INT"),
        ("bench -", "-INT"),
    ] {
        let (child, scene) = loading(folder.path(), args);
        let start = Instant::now();
        assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
        let output = child.wait_with_output().unwrap();
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(130), "{args} {signal}: {text}");
        assert!(start.elapsed() < Duration::from_secs(1), "{args} {signal}: {:?}", start.elapsed());
        assert!(text.contains("stopped while loading <stdin>"), "{args} {signal}: {text}");
        drop(scene);
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left behind");
}

#[test]
fn a_second_signal_ends_the_program_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let (mut child, _scene) = loading(folder.path(), "info -");
    // A signal can be lost if another one follows before it is handled
    let id = child.id().to_string();
    while child.try_wait().unwrap().is_none() {
        let _ = Command::new("kill").args(["-INT", &id]).stderr(Stdio::null()).status();
        std::thread::sleep(Duration::from_millis(5));
    }
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), stderr(&output).as_str()), (Some(130), ""));
}

/// `timeout` signals the program, and then its group.
#[test]
fn two_signals_together_are_one() {
    let folder = tempfile::tempdir().unwrap();
    let (child, _scene) = loading(folder.path(), "info -");
    let twice = format!("kill -TERM {0}; sleep 0.02; kill -TERM {0}", child.id());
    assert!(Command::new("sh").args(["-c", &twice]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert!(stderr(&output).contains("stopped while loading <stdin>"), "{}", stderr(&output));
    assert_eq!(output.status.code(), Some(130));
}

//! Renderings whose images cannot be written to their destinations.

use lumiris::imaging::oiio::{ReadLimits, read_image};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

const SCENE: &str = "Film \"rgb\" \"integer xresolution\" [ 64 ] \"integer yresolution\" [ 48 ]\n\
                     Sampler \"independent\" \"integer pixelsamples\" [ 1 ]\nWorldBegin\nLightSource \"infinite\"\n\
                     Translate 0 0 3\nShape \"sphere\"\n";

/// Path of the rescued copy in a message.
fn rescued(output: &Output, name: &str, temporary: &Path) -> PathBuf {
    let text = String::from_utf8_lossy(&output.stderr);
    let lines: Vec<&str> = text.lines().filter(|line| line.contains(name) && line.contains("; it is in ")).collect();
    let [line] = lines[..] else { panic!("{text}") };
    let place = line.rsplit_once("; it is in ").unwrap().1.strip_suffix(" instead").unwrap();
    let place = PathBuf::from(place);
    assert!(place.starts_with(temporary), "{text}");
    place
}

#[test]
fn an_image_whose_folder_vanished_while_it_was_rendered_is_in_the_temporary_folder() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    for name in ["out", "tmp"] {
        std::fs::create_dir(path(name)).unwrap();
    }
    // The scene comes through a pipe, which the program opens after it has checked its outputs
    assert!(Command::new("mkfifo").arg(path("scene.pbrt")).status().unwrap().success());
    let child = Command::new(env!("CARGO_BIN_EXE_lumiris"))
        .args(["render", "scene.pbrt", "-o", "out/a.exr", "-o", "b.png"])
        .current_dir(folder.path())
        .env("TMPDIR", path("tmp"))
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut pipe = std::fs::File::options().write(true).open(path("scene.pbrt")).unwrap();
    std::fs::remove_dir(path("out")).unwrap();
    std::io::Write::write_all(&mut pipe, SCENE.as_bytes()).unwrap();
    drop(pipe);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(3), "{}", String::from_utf8_lossy(&output.stderr));
    let image = read_image(&rescued(&output, "out/a.exr", &path("tmp")), &ReadLimits::default()).unwrap().image;
    assert_eq!((image.width, image.height), (64, 48));
    assert!(path("b.png").exists(), "the other image has its place");
}

#[test]
fn an_image_that_does_not_fit_on_the_disk_is_in_the_temporary_folder() {
    // A disk of 40 kB, visible only to this process and its children
    let script = "mkdir disk tmp && mount -t tmpfs -o size=40k none disk && exec \"$0\" render scene.pbrt -o disk/a.exr \
                  --resolution 256x192";
    let unshare = |args: &[&str], folder: &Path| {
        let mut unshare = Command::new("unshare");
        unshare.args(["--user", "--map-root-user", "--mount"]).args(args);
        unshare.current_dir(folder).env("TMPDIR", folder.join("tmp")).output().unwrap()
    };
    let folder = tempfile::tempdir().unwrap();
    if !unshare(&["true"], folder.path()).status.success() {
        // Some systems do not let users mount. `rescue.rs` tests the message without a disk
        return;
    }
    std::fs::write(folder.path().join("scene.pbrt"), SCENE).unwrap();
    let output = unshare(&["sh", "-c", script, env!("CARGO_BIN_EXE_lumiris")], folder.path());
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{text}");
    assert!(text.contains("No space left on device"), "{text}");
    let image = read_image(&rescued(&output, "disk/a.exr", &folder.path().join("tmp")), &ReadLimits::default());
    assert_eq!(image.unwrap().image.width, 256);
}

#[test]
fn a_folder_that_nothing_can_be_written_to_is_refused_before_rendering() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.pbrt"), SCENE).unwrap();
    std::fs::create_dir(folder.path().join("taken.exr")).unwrap();
    // Not even root writes to /proc
    for (name, reason) in [("/proc/a.exr", "nothing can be written to /proc"), ("taken.exr", "is a folder")] {
        let output = Command::new(env!("CARGO_BIN_EXE_lumiris"))
            .args(["render", "scene.pbrt", "-o", name])
            .current_dir(folder.path())
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(3) && text.contains(reason), "{text}");
        assert!(!text.contains("samples per pixel"), "{text}");
    }
}

//! Runs the program in tests.

use lumiris::imaging::oiio::{ReadImage, ReadLimits, read_image};
use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;

/// A folder with a scene, `scene.pbrt`.
pub(crate) fn folder_with(scene: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.pbrt"), scene).unwrap();
    folder
}

/// The program with arguments in one text.
pub(crate) fn command(folder: &Path, args: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lumiris"));
    command.args(args.split_whitespace()).current_dir(folder);
    command
}

/// Standard error as text.
pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Reads an image.
pub(crate) fn read(folder: &Path, name: &str) -> ReadImage {
    read_image(&folder.join(name), &ReadLimits::default()).unwrap()
}

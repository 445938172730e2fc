//! Destinations of outputs: symbolic links, read-only files, a full disk and a closed pipe.

use super::program::{command, folder_with, read, stderr};
use std::fs::{self, File, Permissions};
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::Path;
use std::process::{Output, Stdio};

const SCENE: &str = "Film \"rgb\" \"integer xresolution\" [ 16 ] \"integer yresolution\" [ 8 ]\nIntegrator \"direct\"\n\
                     Sampler \"independent\" \"integer pixelsamples\" [ 1 ]\nWorldBegin\nLightSource \"infinite\"\n\
                     Translate 0 0 3\nShape \"sphere\"\n";

fn lumiris(folder: &Path, args: &str) -> Output {
    command(folder, args).output().unwrap()
}

fn names_in(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn outputs_go_to_where_symbolic_links_lead() {
    let folder = folder_with(SCENE);
    let (folder, far) = (folder.path(), folder.path().join("far"));
    fs::create_dir(&far).unwrap();
    let names = ["a.exr", "a.film", "a.json", "a.part", "a.png", "index.html"];
    for name in names {
        symlink(format!("far/{name}"), folder.join(name)).unwrap();
    }
    // One file exists, and others may not read it
    fs::write(far.join("a.exr"), "an image of yesterday").unwrap();
    fs::set_permissions(far.join("a.exr"), Permissions::from_mode(0o600)).unwrap();

    let render =
        "render scene.pbrt --estimator mis -q -o a.exr -o a.png -o a.part --stats a.json --checkpoint a.film,0.001";
    for args in [render, "compare a.exr -r a.exr --metrics mse --html ."] {
        let output = lumiris(folder, args);
        assert!(output.status.success(), "{args}: {}", stderr(&output));
    }
    let written: Vec<String> = names_in(&far);
    assert_eq!(
        written.iter().filter(|name| *name != "a.film").collect::<Vec<_>>(),
        ["a.exr", "a.json", "a.part", "a.png", "index.html"]
    );
    assert!(names.iter().all(|name| folder.join(name).is_symlink()));
    assert_eq!(read(&far, "a.exr").image.width, 16);
    assert_eq!(far.join("a.exr").metadata().unwrap().permissions().mode() & 0o777, 0o600);
}

#[test]
fn a_file_without_write_permission_is_refused_before_anything_is_done() {
    let folder = folder_with(SCENE);
    let folder = folder.path();
    assert!(lumiris(folder, "render scene.pbrt --estimator mis -q -o i.exr -o i.part").status.success());
    fs::create_dir(folder.join("page")).unwrap();
    let protected = ["a.exr", "a.png", "a.part", "a.film", "a.json", "page/index.html"];
    for name in protected {
        fs::write(folder.join(name), "of yesterday").unwrap();
        fs::set_permissions(folder.join(name), Permissions::from_mode(0o444)).unwrap();
    }
    symlink("a.exr", folder.join("link.exr")).unwrap();
    let before = names_in(folder);
    // Later arguments would be an error as well, or take long
    let commands = [
        ("a.exr", "render gone.pbrt -o b.exr -o a.exr"),
        ("link.exr", "render gone.pbrt -o link.exr"),
        ("a.png", "render gone.pbrt -o a.png"),
        ("a.part", "render gone.pbrt -o a.part"),
        ("a.film", "render gone.pbrt -o b.exr --checkpoint a.film"),
        ("a.json", "render gone.pbrt -o b.exr --stats a.json"),
        ("a.exr", "merge gone.part -o a.exr"),
        ("a.exr", "denoise gone.exr -o a.exr"),
        ("a.json", "compare gone.exr -r i.exr --json a.json"),
        ("page/index.html", "compare gone.exr -r i.exr --html page"),
        ("page/index.html", "reproduce talbot --scenes gone -o page"),
        ("a.json", "crosscheck gone.pbrt --json a.json"),
        ("a.json", "bench gone.pbrt --json a.json"),
    ];
    for (name, args) in commands {
        let output = lumiris(folder, args);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(3), "{args}: {said}");
        assert!(said.contains(&format!("{name}: is read-only")) && !said.contains("gone"), "{args}: {said}");
    }
    assert_eq!(names_in(folder), before);
    for name in protected {
        assert_eq!(fs::read(folder.join(name)).unwrap(), b"of yesterday");
    }
}

/// Commands that print, each with its exit code.
const PRINTING: [(&str, i32); 8] = [
    ("info scene.pbrt", 0),
    ("info i.exr --json", 0),
    ("compare i.exr -r i.exr --metrics mse", 0),
    ("compare i.exr -r i.exr --metrics mse --json -", 0),
    ("compare i.exr -r i.exr --fail-below mse=1", 1),
    ("completions bash", 0),
    ("render --help", 0),
    ("--version", 0),
];

#[test]
fn printing_to_a_full_disk_is_an_error() {
    let folder = folder_with(SCENE);
    let folder = folder.path();
    assert!(lumiris(folder, "render scene.pbrt --estimator mis -q -o i.exr").status.success());
    for (args, _) in PRINTING {
        let full = File::options().write(true).open("/dev/full").unwrap();
        let output = command(folder, args).stdout(full).output().unwrap();
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(3), "{args}: {said}");
        assert!(said.contains("cannot write to the standard output: No space left on device"), "{args}: {said}");
    }
    // Files are written nevertheless
    let full = File::options().write(true).open("/dev/full").unwrap();
    let args = "compare i.exr -r i.exr --metrics mse --json a.json --html page";
    assert_eq!(command(folder, args).stdout(full).output().unwrap().status.code(), Some(3));
    assert!(folder.join("a.json").exists() && folder.join("page/index.html").exists());
    let output = lumiris(folder, "compare i.exr -r i.exr --metrics mse --json /dev/full");
    assert!(
        output.status.code() == Some(3) && stderr(&output).contains("cannot write /dev/full"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn a_closed_pipe_is_no_error() {
    let folder = folder_with(SCENE);
    let folder = folder.path();
    assert!(lumiris(folder, "render scene.pbrt --estimator mis -q -o i.exr").status.success());
    for (args, code) in PRINTING {
        let mut child = command(folder, args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{args}: {}", stderr(&output));
        assert!(!stderr(&output).contains("standard output"), "{args}: {}", stderr(&output));
    }
}

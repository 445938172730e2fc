//! Generated bindings: identical to the committed ones if these fit the headers, and usable if no committed ones fit.
#![cfg(feature = "generate-bindings")]

use embree4_sys::{FAMILY, HEADER_VERSION};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Both must agree to the letter. `LUMIRIS_BLESS=1` writes the committed file.
#[test]
fn generated_and_committed_bindings_are_one_text() {
    let (generated, path) = (include_str!(env!("EMBREE_BINDINGS")), env!("EMBREE_COMMITTED_BINDINGS"));
    if std::env::var_os("LUMIRIS_BLESS").is_some() {
        fs::write(path, generated).unwrap();
    }
    let committed = fs::read_to_string(path).unwrap();
    let first_line = |text: &str| text.lines().next().unwrap_or_default().to_owned();
    if first_line(&committed) != first_line(generated) {
        eprintln!("not compared: {path} was made from another version than {HEADER_VERSION}, which is installed");
        return;
    }
    let mut lines = committed.lines().zip(generated.lines()).enumerate();
    let difference = lines.find(|(_, (a, b))| a != b);
    assert!(committed == generated, "{path}: first difference (committed, generated): {difference:?}");
}

/// A copy of the installed headers with another version and an additional member in hits.
fn headers_of(version: [u32; 3]) -> tempfile::TempDir {
    // Folders
    let prefix = tempfile::tempdir().unwrap();
    let (include, lib) = (prefix.path().join(format!("include/embree{FAMILY}")), prefix.path().join("lib"));
    fs::create_dir_all(&include).unwrap();
    fs::create_dir_all(&lib).unwrap();
    fs::write(lib.join(format!("libembree{FAMILY}.so")), "").unwrap();

    // Changed headers
    for entry in fs::read_dir(installed_headers()).unwrap() {
        let path = entry.unwrap().path();
        let mut text = fs::read_to_string(&path).unwrap();
        if path.ends_with("rtcore_config.h") {
            let [major, minor, patch] = version;
            text += &format!("#undef RTC_VERSION_MAJOR\n#define RTC_VERSION_MAJOR {major}\n");
            text += &format!("#undef RTC_VERSION_MINOR\n#define RTC_VERSION_MINOR {minor}\n");
            text += &format!("#undef RTC_VERSION_PATCH\n#define RTC_VERSION_PATCH {patch}\n");
        }
        if path.ends_with("rtcore_ray.h") {
            assert!(text.contains("unsigned int geomID;"));
            text = text.replacen("unsigned int geomID;", "unsigned int geomID; unsigned int another[4];", 1);
        }
        fs::write(include.join(path.file_name().unwrap()), text).unwrap();
    }
    prefix
}

/// The folder of the headers that the build script found.
fn installed_headers() -> PathBuf {
    let prefixes = std::env::var_os("EMBREE_DIR").map(PathBuf::from).into_iter();
    let include = |prefix: PathBuf| prefix.join(format!("include/embree{FAMILY}"));
    let mut places = prefixes.chain(["/usr/local".into(), "/usr".into()]).map(include);
    places.find(|place| place.join("rtcore.h").is_file()).expect("the headers that the build script found")
}

/// Checks this crate against headers, with or without the feature. Returns success and cargo's output.
fn check(prefix: &Path, features: &[&str]) -> (bool, String) {
    let output = Command::new(env!("CARGO"))
        .args(["check", "--offline", "--package", "embree4-sys", "--target-dir", env!("CARGO_TARGET_TMPDIR")])
        .args(features)
        .env("EMBREE_DIR", prefix)
        .output()
        .unwrap();
    (output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn headers_that_no_committed_file_fits_name_the_feature_and_build_with_it() {
    let prefix = headers_of([FAMILY, 99, 0]);
    let (built, message) = check(prefix.path(), &[]);
    assert!(!built);
    for part in [&format!("Embree {FAMILY}.99.0"), "sizeof(RTCHit)", "embree4-sys/generate-bindings", "libclang-dev"] {
        assert!(message.contains(part), "{part} is missing in:\n{message}");
    }
    let (built, message) = check(prefix.path(), &["--features", "generate-bindings"]);
    assert!(built, "{message}");
}

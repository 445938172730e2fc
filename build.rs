//! Passes on what the build scripts of the bindings found, and the version of the sources.

use std::env;
use std::process::Command;

fn main() {
    embree();
    openimageio();
    git_hash();
}

/// The cfg of Embree's family, its version, and where the binaries find it at run time.
fn embree() {
    for family in ["embree3", "embree4"] {
        println!("cargo:rustc-check-cfg=cfg({family})");
    }
    if let Ok(family) = env::var("DEP_EMBREE_FAMILY") {
        println!("cargo:rustc-cfg=embree{family}");
    }
    let version = env::var("DEP_EMBREE_VERSION").unwrap_or_else(|_| "unknown".to_owned());
    println!("cargo:rustc-env=LUMIRIS_EMBREE_VERSION={version}");
    // Set only if the library lies outside the loader's directories.
    if let Ok(path) = env::var("DEP_EMBREE_RPATH") {
        println!("cargo:rustc-link-arg=-Wl,-rpath,{path}");
    }
}

/// The version of OpenImageIO, on which the values of decoded images may depend.
fn openimageio() {
    let version = env::var("DEP_OIIO_SHIM_VERSION").unwrap_or_else(|_| "unknown".to_owned());
    println!("cargo:rustc-env=LUMIRIS_OIIO_VERSION={version}");
}

/// `LUMIRIS_GIT_HASH`, if the sources are a git checkout: the commit, with a `+` if it was changed.
fn git_hash() {
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).output().ok().filter(|output| output.status.success())?;
        Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let Some(commit) = git(&["rev-parse", "--short=12", "HEAD"]) else { return };
    for path in ["HEAD", "index", "logs/HEAD"].into_iter().filter_map(|name| git(&["rev-parse", "--git-path", name])) {
        println!("cargo:rerun-if-changed={path}");
    }
    let changed = git(&["status", "--porcelain", "--untracked-files=no"]).is_some_and(|status| !status.is_empty());
    println!("cargo:rustc-env=LUMIRIS_GIT_HASH={commit}{}", if changed { "+" } else { "" });
}

//! Compiles the shim into a separate shared object, linked to OpenImageIO, which `load` opens at its first use. Nothing
//! is linked to the Rust side.

use std::env;
use std::path::{Path, PathBuf};
use std::process::exit;

/// Installation hint for the end of each error message.
const HELP: &str = "Install OpenImageIO's headers (Debian, Ubuntu: apt-get install \
                    libopenimageio-dev pkg-config g++), or set PKG_CONFIG_PATH to the directory that \
                    holds OpenImageIO.pc.";

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=shim");
    // The crate tracks pkg-config's own variables
    let library = pkg_config::Config::new()
        .range_version("2.4".."4")
        .cargo_metadata(false)
        .env_metadata(true)
        .probe("OpenImageIO")
        .unwrap_or_else(|error| fail(&format!("no OpenImageIO from 2.4 to 3.x:\n{error}")));
    let shim = build_shim(&library).unwrap_or_else(|reason| fail(&reason));
    println!("cargo:rustc-env=LUMIRIS_OIIO_SHIM_BUILT={}", shim.display());
    println!("cargo:path={}", shim.display());
    println!("cargo:version={}", library.version);
}

/// Stops the build with `reason` and the installation hint.
fn fail(reason: &str) -> ! {
    eprintln!("\nerror: openimageio-sys: {reason}\n{HELP}\n");
    exit(1);
}

/// Compiles and links the shared object in `OUT_DIR`.
fn build_shim(library: &pkg_config::Library) -> Result<PathBuf, String> {
    let mut build = cc::Build::new();
    build.cpp(true).std("c++17").pic(true).opt_level(2).debug(false).warnings(false);
    build.flag_if_supported("-fvisibility=hidden").files(["shim/color.cpp", "shim/reading.cpp", "shim/writing.cpp"]);
    build.includes(&library.include_paths);
    for (name, value) in &library.defines {
        build.define(name, value.as_deref());
    }
    let objects = build.try_compile_intermediates().map_err(|e| format!("the shim does not compile: {e}"))?;
    let compiler = build.try_get_compiler().map_err(|e| format!("no C++ compiler: {e}"))?;

    let macos = env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "macos");
    let name = if macos { "liblumiris_oiio.dylib" } else { "liblumiris_oiio.so" };
    let out_dir = env::var_os("OUT_DIR").ok_or("OUT_DIR is not set")?;
    let shim = Path::new(&out_dir).join(name);

    let mut command = compiler.to_command();
    if macos {
        command.arg("-dynamiclib");
    } else {
        // An undefined symbol must fail here, not when the first image is read
        command.args(["-shared", "-Wl,--no-undefined", "-Wl,-soname,liblumiris_oiio.so"]);
    }
    command.arg("-o").arg(&shim).args(&objects);
    for path in &library.link_paths {
        command.arg("-L").arg(path).arg(format!("-Wl,-rpath,{}", path.display()));
    }
    command.args(library.libs.iter().map(|lib| format!("-l{lib}")));
    let output = command.output().map_err(|e| format!("{}: {e}", compiler.path().display()))?;
    if output.status.success() {
        Ok(shim)
    } else {
        Err(format!("the shim does not link:\n{}", String::from_utf8_lossy(&output.stderr)))
    }
}

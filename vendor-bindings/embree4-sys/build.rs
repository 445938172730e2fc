//! Finds Embree, checks its headers against the committed bindings, and links it. With the feature `generate-bindings`,
//! the bindings are generated from the headers instead.
//!
//! Search order: `EMBREE_DIR` (an installation prefix, or its CMake configuration directory), the compiler's own
//! include directories, then `embree_DIR` (CMake's variable) and pkg-config.

#[cfg(feature = "generate-bindings")]
mod generate;

use std::env;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, exit};

/// Installation hint for the end of each error message.
const HELP: &str = "Install Embree's headers (Debian, Ubuntu: apt-get install libembree-dev), or \
                    set EMBREE_DIR to the prefix of an installation of Embree 3.13 or 4.x.";

/// Hint for headers that fit no committed bindings.
#[cfg(not(feature = "generate-bindings"))]
const GENERATE: &str = "The feature `generate-bindings` makes bindings from these headers: build with \
                        --features embree4-sys/generate-bindings (needs libclang: apt-get install libclang-dev).";

/// Library directories below an installation prefix, most specific first.
const LIB_DIRS: [&str; 4] = ["lib/x86_64-linux-gnu", "lib/aarch64-linux-gnu", "lib64", "lib"];

/// An installation of Embree with its headers.
struct Embree {
    /// `None`: the headers are in the compiler's default include directories.
    prefix: Option<PathBuf>,
    family: u32,
    version: [u32; 3],
    instance_array: bool,
}

impl Embree {
    fn version_string(&self) -> String {
        self.version.map(|number| number.to_string()).join(".")
    }
}

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=detect.c");
    println!("cargo:rerun-if-changed=probe.c");
    println!("cargo:rerun-if-env-changed=EMBREE_DIR");
    println!("cargo:rerun-if-env-changed=embree_DIR");
    println!("cargo:rerun-if-changed=generate.rs");
    for cfg in ["embree3", "embree4", "embree_instance_array"] {
        println!("cargo:rustc-check-cfg=cfg({cfg})");
    }

    let embree = find().unwrap_or_else(|reason| fail(&reason));
    let bindings = bindings(&embree).unwrap_or_else(|reason| fail(&reason));
    println!("cargo:rustc-env=EMBREE_BINDINGS={}", bindings.display());
    emit(&embree);
}

/// Stops the build with `reason` and the installation hint.
fn fail(reason: &str) -> ! {
    eprintln!("\nerror: embree4-sys: {reason}\n{HELP}\n");
    exit(1);
}

/// Finds the headers; the error gives the reason if there are none.
fn find() -> Result<Embree, String> {
    // EMBREE_DIR
    if let Some(dir) = env::var_os("EMBREE_DIR").filter(|dir| !dir.is_empty()) {
        let dir = PathBuf::from(dir);
        let prefix = prefix_of(&dir).ok_or_else(|| {
            format!(
                "EMBREE_DIR is {}, but include/embree4/rtcore.h and include/embree3/rtcore.h are \
                 neither below it nor below its parents",
                dir.display()
            )
        })?;
        return detect(Some(prefix))?
            .ok_or_else(|| format!("the compiler cannot read the headers below EMBREE_DIR = {}", dir.display()));
    }

    // The compiler's directories, then configured prefixes
    if let Some(found) = detect(None)? {
        return Ok(found);
    }
    for prefix in config_prefixes() {
        if let Some(found) = detect(Some(prefix))? {
            return Ok(found);
        }
    }
    Err("found neither embree4/rtcore.h nor embree3/rtcore.h".to_owned())
}

/// Prefixes named by CMake's `embree_DIR` and by pkg-config.
fn config_prefixes() -> Vec<PathBuf> {
    let cmake = env::var_os("embree_DIR").map(PathBuf::from);
    let mut prefixes: Vec<PathBuf> = cmake.as_deref().and_then(prefix_of).into_iter().collect();
    for package in ["embree4", "embree3", "embree"] {
        let found = pkg_config::Config::new().cargo_metadata(false).probe(package);
        let include_paths = found.map(|library| library.include_paths).unwrap_or_default();
        prefixes.extend(include_paths.iter().filter_map(|path| prefix_of(path)));
    }
    prefixes
}

/// The nearest of `dir` and five of its parents that has Embree's headers in `include/`.
fn prefix_of(dir: &Path) -> Option<PathBuf> {
    let has_headers = |prefix: &&Path| {
        ["embree4", "embree3"].iter().any(|family| prefix.join("include").join(family).join("rtcore.h").is_file())
    };
    dir.ancestors().take(6).find(has_headers).map(Path::to_path_buf)
}

/// Runs the compiler with `args` and the include directory of `prefix`. Returns its status, output and errors.
fn compiler(prefix: Option<&Path>, args: &[&str]) -> Result<(ExitStatus, String, String), String> {
    let mut build = cc::Build::new();
    build.cargo_metadata(false).warnings(false);
    let tool = build.try_get_compiler().map_err(|e| format!("no C compiler: {e}"))?;
    let mut command: Command = tool.to_command();
    if let Some(prefix) = prefix {
        command.arg("-I").arg(prefix.join("include"));
    }
    command.args(args);
    let output = command.output().map_err(|e| format!("{}: {e}", tool.path().display()))?;
    Ok((
        output.status,
        String::from_utf8_lossy(&output.stdout).into_owned(),
        String::from_utf8_lossy(&output.stderr).into_owned(),
    ))
}

/// Detects the headers with the preprocessor. `Ok(None)`: there are none.
fn detect(prefix: Option<PathBuf>) -> Result<Option<Embree>, String> {
    let (status, expanded, errors) = compiler(prefix.as_deref(), &["-E", "detect.c"])?;
    if !status.success() {
        return Err(format!("the C compiler does not preprocess detect.c:\n{errors}"));
    }
    // A header that changes (an upgrade of the library) must run this script again
    let markers = expanded.lines().filter(|line| line.starts_with('#'));
    let config = markers.filter_map(|line| line.split('"').nth(1));
    if let Some(path) = config.into_iter().find(|path| path.ends_with("rtcore_config.h")) {
        println!("cargo:rerun-if-changed={path}");
    }

    // The compiler may spread the numbers over several lines, separated by line markers
    let Some((_, rest)) = expanded.split_once("EMBREE_FOUND") else {
        return Ok(None);
    };
    let words = rest.lines().filter(|line| !line.starts_with('#')).flat_map(str::split_whitespace);
    let numbers: Vec<u32> = words.filter_map(|word| word.parse().ok()).collect();
    let [family, major, minor, patch, instance_array] = numbers[..] else {
        return Err(format!("rtcore_config.h has no version that can be read: {rest}"));
    };
    Ok(Some(Embree { prefix, family, version: [major, minor, patch], instance_array: instance_array == 1 }))
}

/// The bindings, generated from the headers.
#[cfg(feature = "generate-bindings")]
fn bindings(embree: &Embree) -> Result<PathBuf, String> {
    let include = embree.prefix.as_ref().map(|prefix| prefix.join("include"));
    let text = generate::bindings(include.as_deref(), embree.family, &embree.version_string())?;
    let path = PathBuf::from(env::var_os("OUT_DIR").ok_or("cargo sets no OUT_DIR")?).join("bindings.rs");
    std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))?;
    println!("cargo:rustc-env=EMBREE_COMMITTED_BINDINGS={}", committed(embree)?.display());
    Ok(path)
}

/// The committed bindings, if they fit the headers.
#[cfg(not(feature = "generate-bindings"))]
fn bindings(embree: &Embree) -> Result<PathBuf, String> {
    check_layout(embree).map_err(|reason| format!("{reason}\n{GENERATE}"))?;
    committed(embree)
}

/// The committed bindings for a family; for family 4, also for a layout of hits.
fn committed(embree: &Embree) -> Result<PathBuf, String> {
    let name = match (embree.family, embree.instance_array) {
        (3, _) => "embree3.rs",
        (_, true) => "embree4.rs",
        (_, false) => "embree4_pre43.rs",
    };
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").ok_or("cargo sets no CARGO_MANIFEST_DIR")?);
    Ok(root.join("src/bindings").join(name))
}

/// Compiles the static assertions of probe.c against the headers.
#[cfg(not(feature = "generate-bindings"))]
fn check_layout(embree: &Embree) -> Result<(), String> {
    let family = format!("-DEXPECT_FAMILY={}", embree.family);
    let instance_array = format!("-DEXPECT_INSTANCE_ARRAY={}", u32::from(embree.instance_array));
    let args = ["-std=c11", "-fsyntax-only", &family, &instance_array, "probe.c"];
    let (status, _, errors) = compiler(embree.prefix.as_deref(), &args)?;
    if status.success() {
        return Ok(());
    }
    let mut reason = format!("the headers of Embree {} do not fit the committed bindings:", embree.version_string());
    let asserts: Vec<&str> = errors.lines().filter(|line| line.contains("static assertion failed")).collect();
    for line in &asserts {
        reason += &format!("\n  {}", line.trim());
    }
    if asserts.is_empty() {
        reason += &format!("\n{errors}");
    }
    Err(reason)
}

/// Prints the instructions for cargo and for dependents' build scripts.
fn emit(embree: &Embree) {
    let family = embree.family;
    println!("cargo:rustc-cfg=embree{family}");
    if embree.instance_array {
        println!("cargo:rustc-cfg=embree_instance_array");
    }
    let [major, minor, patch] = embree.version;
    println!("cargo:rustc-env=EMBREE_HEADER_VERSION={}", major * 10_000 + minor * 100 + patch);
    println!("cargo:version={}", embree.version_string());
    println!("cargo:family={family}");

    let libdir = find_libdir(embree);
    println!("cargo:rustc-link-lib=dylib=embree{family}");
    if let Some(libdir) = &libdir {
        println!("cargo:libdir={}", libdir.display());
    }
    // A library outside the loader's directories needs a search path, and a run path in each binary: in this crate's
    // tests, and in dependents through `DEP_EMBREE_RPATH`
    if let (Some(_), Some(libdir)) = (&embree.prefix, &libdir) {
        println!("cargo:rustc-link-search=native={}", libdir.display());
        println!("cargo:rustc-link-arg-tests=-Wl,-rpath,{}", libdir.display());
        println!("cargo:rpath={}", libdir.display());
    }
}

/// The directory of the library. Stops the build if the given prefix has none.
fn find_libdir(embree: &Embree) -> Option<PathBuf> {
    let names = ["so", "dylib"].map(|suffix| format!("libembree{}.{suffix}", embree.family));
    let below = |prefix: &Path| {
        let dirs = LIB_DIRS.iter().map(|dir| prefix.join(dir));
        dirs.into_iter().find(|dir| names.iter().any(|name| dir.join(name).exists()))
    };
    match &embree.prefix {
        None => ["/usr/local", "/usr"].iter().find_map(|prefix| below(Path::new(prefix))),
        Some(prefix) => below(prefix).or_else(|| {
            let prefix = prefix.display();
            fail(&format!("headers, but no {} below {prefix}: looked in {LIB_DIRS:?}", names[0]))
        }),
    }
}

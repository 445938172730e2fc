//! A module imports only from layers above it in the table of `src/lib.rs`.

use std::fs;
use std::path::Path;

/// Modules by layer; a module may import from strictly smaller layers, and the pairs in `SIDEWAYS`.
const LAYERS: &[&[&str]] = &[
    &["math", "estimators", "simd"],
    &["samplers", "imaging"],
    &["textures", "geometry", "bsdfs", "cameras", "film"],
    &["materials", "lights", "accel"],
    &["scene"],
    &["import", "direct", "photons", "procedural"],
    &["integrators"],
    &["render"],
    &["cli", "compare", "distributed", "reproduce"],
];

/// Modules that may import less than their layer allows.
const ONLY: &[(&str, &[&str])] = &[("procedural", &["math", "imaging", "geometry"])];

/// Imports inside a layer that are allowed: (importer, imported).
const SIDEWAYS: &[(&str, &str)] =
    &[("estimators", "math"), ("estimators", "simd"), ("simd", "math"), ("cli", "compare"), ("cli", "reproduce")];

fn layer(module: &str) -> Option<usize> {
    LAYERS.iter().position(|l| l.contains(&module))
}

fn check_file(module: &str, path: &Path, violations: &mut Vec<String>) {
    let text = fs::read_to_string(path).unwrap();
    for (number, line) in text.lines().enumerate() {
        let code = line.split("//").next().unwrap_or("");
        for piece in code.split("crate::").skip(1) {
            let imported: String = piece.chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '_').collect();
            if imported == module || code.contains("pub(in crate::") {
                continue;
            }
            let allowed = match (layer(module), layer(&imported)) {
                (Some(here), Some(there)) => there < here || SIDEWAYS.contains(&(module, imported.as_str())),
                _ => false,
            };
            let only = ONLY.iter().find(|(m, _)| *m == module);
            if !allowed || only.is_some_and(|(_, list)| !list.contains(&imported.as_str())) {
                violations.push(format!("{}:{}: {module} imports {imported}", path.display(), number + 1));
            }
        }
    }
}

fn visit(module: &str, path: &Path, violations: &mut Vec<String>) {
    if path.is_dir() {
        for entry in fs::read_dir(path).unwrap() {
            visit(module, &entry.unwrap().path(), violations);
        }
    } else if path.extension().is_some_and(|e| e == "rs") {
        check_file(module, path, violations);
    }
}

#[test]
fn modules_import_only_from_lower_layers() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut violations = Vec::new();
    for entry in fs::read_dir(&src).unwrap() {
        let path = entry.unwrap().path();
        let module = path.file_stem().unwrap().to_string_lossy().into_owned();
        if module == "lib" || module == "main" {
            continue;
        }
        assert!(layer(&module).is_some(), "src/{module} has no layer: add it to the table");
        visit(&module, &path, &mut violations);
    }
    assert!(violations.is_empty(), "{}", violations.join("\n"));
}

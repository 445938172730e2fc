//! Allowed imports: between crates, between the renderer's modules by layer, and without cycles inside a folder. No
//! file has conflict markers of an unfinished merge ([`conflicts`]).
//!
//! [`imports`] parses the sources. Imports between a folder's `mod.rs` and its files do not count as cycles, so the
//! `mod.rs` of a folder must not define anything: it only declares and re-exports.

mod conflicts;
mod imports;

use imports::{Crate, Import};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Crates: package folder, name in code, and the crates of the workspace that it may import.
const CRATES: &[(&str, &str, &[&str])] = &[
    ("crates/numbers", "lumiris_numbers", &[]),
    ("crates/lanes", "lumiris_lanes", &["lumiris_numbers"]),
    ("crates/formats", "lumiris_formats", &["lumiris_numbers"]),
    (".", "lumiris", &["lumiris_numbers", "lumiris_lanes", "lumiris_formats"]),
    ("crates/lab", "lumiris_lab", &["lumiris_numbers", "lumiris_lanes", "lumiris_formats", "lumiris"]),
    ("crates/bench", "lumiris_bench", &["lumiris_numbers", "lumiris_lanes", "lumiris_formats", "lumiris"]),
    (
        "crates/cli",
        "lumiris_cli",
        &["lumiris_numbers", "lumiris_lanes", "lumiris_formats", "lumiris", "lumiris_lab", "lumiris_bench"],
    ),
    ("python", "_lumiris", &["lumiris_numbers", "lumiris_formats", "lumiris"]),
    ("crates/test-support", "lumiris_test_support", &["lumiris_numbers"]),
];

/// Modules of the renderer by layer. A module may import only from lower layers.
const LAYERS: &[&[&str]] = &[
    &["imaging"],
    &["textures", "geometry", "bsdfs", "media", "cameras", "film"],
    &["materials", "lights", "accel"],
    &["settings"],
    &["scene"],
    &["import", "direct", "photons"],
    &["integrators"],
    &["planning"],
    &["render"],
];

/// Modules of the numbers crate, with the modules that each may import.
const NUMBERS: &[(&str, &[&str])] = &[("math", &[]), ("estimators", &["math"]), ("samplers", &["math"])];

fn workspace() -> Vec<Crate> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    CRATES.iter().map(|(folder, name, _)| Crate::read(name, &root.join(folder).join("src"))).collect()
}

fn layer(module: &str) -> usize {
    let found = LAYERS.iter().position(|layer| layer.contains(&module));
    found.unwrap_or_else(|| panic!("src/{module} has no layer: add it to the table"))
}

/// True if the module `from` of the crate may import the module `to` of the same crate.
fn is_allowed(krate: &str, from: &str, to: &str) -> bool {
    match krate {
        "lumiris" => layer(to) < layer(from),
        "lumiris_numbers" => {
            let row = NUMBERS.iter().find(|(module, _)| *module == from);
            row.unwrap_or_else(|| panic!("{from} is not in the table of the arithmetic")).1.contains(&to)
        }
        _ => true,
    }
}

#[test]
fn crates_import_only_what_the_table_lists() {
    let mut violations = Vec::new();
    for (krate, (_, _, allowed)) in workspace().iter().zip(CRATES) {
        for name in
            CRATES.iter().map(|(_, name, _)| *name).filter(|name| *name != krate.name && !allowed.contains(name))
        {
            for file in krate.files_that_name(name) {
                violations.push(format!("{file}: {} imports {name}", krate.name));
            }
        }
    }
    assert!(violations.is_empty(), "{}", violations.join("\n"));
}

#[test]
fn modules_import_only_from_lower_layers() {
    let mut violations = Vec::new();
    for krate in workspace() {
        for Import { from, to, file } in krate.imports() {
            let (Some(from), Some(to)) = (from.first(), to.first()) else { continue };
            if from != to && !is_allowed(&krate.name, from, to) {
                violations.push(format!("{file}: {from} imports {to}"));
            }
        }
    }
    assert!(violations.is_empty(), "{}", violations.join("\n"));
}

/// True for the first line of a definition at the top level of a file.
fn is_definition(line: &str) -> bool {
    const KEYWORDS: &[&str] = &["const", "enum", "fn", "impl", "macro_rules", "static", "struct", "trait", "type"];
    let is_visibility = |word: &&str| word.starts_with("pub") || word.ends_with(')');
    line.split([' ', '<', '!']).find(|word| !is_visibility(word)).is_some_and(|word| KEYWORDS.contains(&word))
}

#[test]
fn interfaces_are_in_files_of_their_own() {
    let mut violations = Vec::new();
    for krate in workspace() {
        for (file, code) in krate.mod_files() {
            let definitions = code.lines().filter(|line| is_definition(line));
            violations.extend(definitions.map(|line| format!("{file} defines: {line}")));
        }
    }
    assert!(violations.is_empty(), "{}", violations.join("\n"));
    assert!(is_definition("pub(crate) struct Light<'a> {") && is_definition("impl<T> Trait for T {"));
    assert!(!is_definition("pub use light::Light;") && !is_definition("    const N: usize = 1;"));
}

/// Import graphs inside each folder: folder, importing file, imported files.
fn graphs(krate: &Crate) -> BTreeMap<String, BTreeMap<String, BTreeSet<String>>> {
    let mut graphs: BTreeMap<_, BTreeMap<_, BTreeSet<_>>> = BTreeMap::new();
    for Import { from, to, .. } in krate.imports() {
        let common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
        let (Some(a), Some(b)) = (from.get(common), to.get(common)) else { continue };
        let folder = [std::slice::from_ref(&krate.name), &from[..common]].concat().join("::");
        graphs.entry(folder).or_default().entry(a.clone()).or_default().insert(b.clone());
    }
    graphs
}

/// All nodes that are reachable from `start`.
fn reachable<'a>(graph: &'a BTreeMap<String, BTreeSet<String>>, start: &str) -> BTreeSet<&'a str> {
    let mut found = BTreeSet::new();
    let mut open = vec![start];
    while let Some(node) = open.pop() {
        for next in graph.get(node).into_iter().flatten() {
            if found.insert(next.as_str()) {
                open.push(next);
            }
        }
    }
    found
}

#[test]
fn files_of_a_folder_do_not_import_each_other_in_circles() {
    let mut circles = Vec::new();
    for krate in workspace() {
        for (folder, graph) in graphs(&krate) {
            let in_circle = |node: &&String| reachable(&graph, node).contains(node.as_str());
            let members: Vec<&str> = graph.keys().filter(in_circle).map(String::as_str).collect();
            if !members.is_empty() {
                circles.push(format!("{folder}: {}", members.join(", ")));
            }
        }
    }
    assert!(circles.is_empty(), "circles:\n{}", circles.join("\n"));
}

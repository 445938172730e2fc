//! Imports of a crate, parsed from the text of its sources.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Path of a module below the crate's root.
pub(super) type Module = Vec<String>;

/// A file of a crate.
#[derive(Debug)]
struct Source {
    module: Module,
    file: String,
    code: String,
}

/// An import from another module.
#[derive(Debug)]
pub(super) struct Import {
    /// The importing module.
    pub from: Module,
    /// The module that defines the imported item.
    pub to: Module,
    /// The importing file.
    pub file: String,
}

/// The sources of a crate without comments and unit tests.
#[derive(Debug)]
pub(super) struct Crate {
    /// Its name in code.
    pub name: String,
    sources: Vec<Source>,
}

impl Crate {
    /// Reads the sources below `folder`.
    pub(super) fn read(name: &str, folder: &Path) -> Crate {
        let mut sources = Vec::new();
        visit(folder, &mut Vec::new(), &mut sources);
        assert!(!sources.is_empty(), "{} has sources", folder.display());
        Crate { name: name.to_owned(), sources }
    }

    /// Files that name another crate.
    pub(super) fn files_that_name<'a>(&'a self, name: &str) -> impl Iterator<Item = &'a str> {
        let path = format!("{name}::");
        let names = move |s: &&Source| {
            s.code.match_indices(&path).any(|(i, _)| !s.code[..i].ends_with(|c: char| c == '_' || c.is_alphanumeric()))
        };
        self.sources.iter().filter(names).map(|s| s.file.as_str())
    }

    /// The `mod.rs` files with their code.
    pub(super) fn mod_files(&self) -> impl Iterator<Item = (&str, &str)> {
        self.sources.iter().filter(|s| s.file.ends_with("/mod.rs")).map(|s| (s.file.as_str(), s.code.as_str()))
    }

    /// All imports between different modules of the crate.
    pub(super) fn imports(&self) -> Vec<Import> {
        let re_exports: BTreeMap<Module, BTreeMap<String, Module>> =
            self.sources.iter().map(|s| (s.module.clone(), self.re_exports(s))).collect();
        let mut imports = Vec::new();
        for source in &self.sources {
            for path in paths(&source.code) {
                let Some(mut path) = absolute(&source.module, &path) else { continue };
                // An item that a module re-exports belongs to the module that defines it
                let mut to = self.longest_module(&path);
                while let Some(target) = path.get(to.len()).and_then(|name| re_exports.get(&to)?.get(name)) {
                    path = [target.clone(), path.split_off(to.len())].concat();
                    to = self.longest_module(&path);
                    if to == *target {
                        break;
                    }
                }
                if to != source.module {
                    imports.push(Import { from: source.module.clone(), to, file: source.file.clone() });
                }
            }
        }
        imports
    }

    /// Names that a file re-exports with `pub use` from modules of the crate, with those modules.
    fn re_exports(&self, source: &Source) -> BTreeMap<String, Module> {
        let mut names = BTreeMap::new();
        for statement in source.code.split(';').filter_map(|s| s.rsplit_once("pub use ")) {
            for path in expand(statement.1) {
                let name = path.last().cloned().unwrap_or_default();
                let full =
                    absolute(&source.module, &path).unwrap_or_else(|| [source.module.clone(), path.clone()].concat());
                let module = self.longest_module(&full);
                if module != source.module && module.len() < full.len() {
                    names.insert(name, module);
                }
            }
        }
        names
    }

    /// The module named by a path, or the module that contains the named item.
    fn longest_module(&self, path: &[String]) -> Module {
        let is_module = |n: &usize| self.sources.iter().any(|s| s.module == path[..*n]);
        path[..(0..=path.len()).rev().find(is_module).unwrap_or(0)].to_vec()
    }
}

fn visit(folder: &Path, module: &mut Module, sources: &mut Vec<Source>) {
    // Sources without tests, folders recursively
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let stem = path.file_stem().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            module.push(stem);
            visit(&path, module, sources);
            module.pop();
        } else if path.extension().is_some_and(|e| e == "rs") && !stem.ends_with("tests") {
            let mut module = module.clone();
            if !["mod", "lib", "main"].contains(&stem.as_str()) {
                module.push(stem);
            }
            if module.iter().any(|m| m == "tests") {
                continue;
            }
            let text = fs::read_to_string(&path).unwrap();
            sources.push(Source { module, file: path.display().to_string(), code: code_of(&text) });
        }
    }
}

/// The text without comments, and without the unit tests at its end.
fn code_of(text: &str) -> String {
    let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    code.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// All paths that begin with `crate`, `super` or `self`, as written.
fn paths(code: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    for start in ["crate::", "super::", "self::"] {
        for (i, _) in code.match_indices(start) {
            let before = &code[..i];
            if before.ends_with(|c: char| c == '_' || c == ':' || c.is_alphanumeric()) || before.ends_with("pub(in ") {
                continue;
            }
            // A use tree ends at its semicolon, other paths at their last word
            let line = before.rsplit(['\n', ';']).next().unwrap_or_default().trim();
            let rest = &code[i..];
            let end = if line.ends_with("use") {
                rest.find(';').unwrap_or(rest.len())
            } else {
                rest.find(|c: char| !(c == '_' || c == ':' || c.is_alphanumeric())).unwrap_or(rest.len())
            };
            found.extend(expand(&rest[..end]));
        }
    }
    found
}

/// Expands a use tree: `a::{b, c::d}` is `a::b` and `a::c::d`.
fn expand(tree: &str) -> Vec<Vec<String>> {
    // Without braces
    let tree = tree.trim();
    let Some((head, rest)) = tree.split_once('{') else {
        let plain = tree.split(" as ").next().unwrap_or_default();
        let words = plain.split("::").map(str::trim).filter(|w| !w.is_empty() && *w != "*" && *w != "self");
        let keeps_self = plain.starts_with("self::").then(|| "self".to_owned());
        return vec![keeps_self.into_iter().chain(words.map(str::to_owned)).collect()];
    };

    // Split at the commas outside of inner braces
    let inner = rest.rsplit_once('}').map_or(rest, |(inner, _)| inner);
    let (mut parts, mut depth, mut start) = (Vec::new(), 0, 0);
    for (i, c) in inner.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                parts.push(&inner[start..i]);
                start = i + 1;
            }
            _ => {}
        }
    }
    parts.push(&inner[start..]);

    // Expand each part
    let head = head.trim_end_matches("::");
    let below = |part: &str| expand(&format!("{head}::{}", part.trim()));
    parts.iter().filter(|part| !part.trim().is_empty()).flat_map(|part| below(part)).collect()
}

/// The path from the crate's root; `None` if it does not begin with `crate`, `super` or `self`.
fn absolute(module: &[String], path: &[String]) -> Option<Module> {
    match path.first()?.as_str() {
        "crate" => Some(path[1..].to_vec()),
        "self" => Some([module, &path[1..]].concat()),
        "super" => {
            let ups = path.iter().take_while(|word| *word == "super").count();
            Some([&module[..module.len().checked_sub(ups)?], &path[ups..]].concat())
        }
        _ => None,
    }
}

//! The files of `tests/pbrt`: each is parsed, and the result is compared with the `.txt` beside it.
//!
//! A missing `.txt` is written by a run with `LUMIRIS_BLESS=1` in the environment.

use lumiris_formats::diagnostic::{Diagnostics, Report};
use lumiris_formats::pbrt::directive::Directive;
use lumiris_formats::pbrt::parser::parse_source;
use lumiris_formats::source::SourceMap;
use proptest::prelude::*;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

fn parse(name: &str, folder: &Path, text: &[u8]) -> (Vec<Directive>, Report) {
    let mut sources = SourceMap::new();
    let mut diagnostics = Diagnostics::new();
    let mut all = Vec::new();
    let file = sources.add_text(name, text.to_vec());
    let mut collect = |d: Directive, _: &SourceMap, _: &mut Diagnostics| all.push(d);
    parse_source(file, &folder.join(name), &mut sources, &mut diagnostics, &mut collect);
    let report = diagnostics.finish(&sources);
    (all, report)
}

fn describe(directives: &[Directive]) -> String {
    let mut text = String::new();
    for d in directives {
        writeln!(text, "{:?}", d.kind).unwrap();
        for p in d.params.iter() {
            writeln!(text, "    {} {} = {:?}", p.ty.name(), p.name, p.values).unwrap();
        }
    }
    // Source positions are covered by the diagnostics.
    let mut plain = String::new();
    let mut rest = text.as_str();
    while let Some((before, after)) = rest.split_once(", span: Span {") {
        plain.push_str(before);
        rest = after.split_once('}').unwrap().1;
    }
    plain + rest
}

fn compare(path: &Path, found: &str) {
    let expected_path = path.with_extension("txt");
    if std::env::var_os("LUMIRIS_BLESS").is_some() {
        std::fs::write(&expected_path, found).unwrap();
    }
    let expected = std::fs::read_to_string(&expected_path).unwrap();
    assert_eq!(found, expected, "{}", path.display());
}

fn files(folder: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/pbrt").join(folder);
    let entries = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    let mut files: Vec<_> = entries.filter(|p| p.extension().is_some_and(|e| e == "pbrt")).collect();
    files.sort();
    assert!(files.len() > 2);
    files
}

fn parse_path(path: &Path) -> (Vec<Directive>, Report) {
    let name = path.file_name().unwrap().to_str().unwrap();
    parse(name, path.parent().unwrap(), &std::fs::read(path).unwrap())
}

/// Text without the folder of the checkout.
fn portable(text: &str) -> String {
    text.replace(concat!(env!("CARGO_MANIFEST_DIR"), "/"), "")
}

#[test]
fn valid_files_give_their_directives() {
    for path in files("valid") {
        let (directives, report) = parse_path(&path);
        assert_eq!(report.errors, 0, "{report}");
        compare(&path, &portable(&format!("{}{report}", describe(&directives))));
    }
}

#[test]
fn invalid_files_are_reported_with_places() {
    for path in files("invalid") {
        let (_, report) = parse_path(&path);
        assert!(report.errors > 0, "{}", path.display());
        compare(&path, &portable(&report.to_string()));
    }
}

#[test]
fn files_that_include_each_other_end() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.pbrt"), "WorldBegin\nInclude \"b.pbrt\"\nInclude \"gone.pbrt\"\n").unwrap();
    std::fs::write(folder.path().join("b.pbrt"), "Include \"a.pbrt\"\nImport \"gone2.pbrt\"\n").unwrap();
    let (_, report) = parse_path(&folder.path().join("a.pbrt"));
    let text = report.to_string();
    assert_eq!(report.errors, 2, "{text}");
    assert!(text.contains("includes itself") && text.contains("2 files cannot be read"), "{text}");
}

#[test]
fn imports_keep_their_state_to_themselves() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("part.pbrt"), "Translate 1 2 3\n").unwrap();
    let (directives, report) = parse("a.pbrt", folder.path(), b"WorldBegin Import \"part.pbrt\" Identity");
    assert!(report.is_empty(), "{report}");
    let expected = "WorldBegin\nAttributeBegin\nTranslate([1.0, 2.0, 3.0])\nAttributeEnd\nIdentity\n";
    assert_eq!(describe(&directives), expected);
}

const PIECES: &[&str] = &[
    "Shape",
    "WorldBegin",
    "AttributeBegin",
    "AttributeEnd",
    "\"sphere\"",
    "\"float radius\"",
    "\"rgb L\"",
    "[",
    "]",
    "1",
    "2.5",
    "-3e4",
    "true",
    "\"x\"",
    "Translate",
    "Rotate",
    "#c\n",
    "\n",
    "\"bool a\"",
    "\"spectrum s\"",
    "\"broken\n",
    "Include",
    "\"point3 P\"",
    "ObjectBegin",
    "ObjectEnd",
    "Texture",
    "\"integer i\"",
    "99999999999",
    "\u{e4}",
    "LookAt",
    "Attribute",
    "\"shape\"",
    "MediumInterface",
    "ActiveTransform",
    "All",
    "TransformBegin",
    "TransformEnd",
    "Option",
    "\"seed\"",
    "\"\\q\"",
];

proptest! {
    #[test]
    fn random_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        parse("random", Path::new("/nonexistent"), &bytes);
    }

    #[test]
    fn shuffled_pieces_never_panic(pieces in proptest::collection::vec(0..PIECES.len(), 0..80)) {
        let text: Vec<&str> = pieces.into_iter().map(|i| PIECES[i]).collect();
        let (directives, report) = parse("pieces", Path::new("/nonexistent"), text.join(" ").as_bytes());
        prop_assert!(!report.to_string().contains('\0'));
        prop_assert!(directives.len() <= text.len());
    }
}

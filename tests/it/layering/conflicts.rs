//! No file of the repository has conflict markers of an unfinished merge.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Folders that are never committed, for sources without a repository.
const NOT_COMMITTED: [&str; 2] = ["target", ".git"];

/// Returns the line of the first conflict marker. Lines of equals signs are ignored, since they can underline a
/// heading.
fn conflict(text: &[u8]) -> Option<usize> {
    let is_mark =
        |line: &[u8]| [b'<', b'>', b'|'].iter().any(|&mark| line.starts_with(&[mark; 7]) && line.get(7) == Some(&b' '));
    text.split(|&b| b == b'\n').position(is_mark).map(|line| line + 1)
}

/// The tracked files; all files if git or its repository is missing.
fn files(root: &Path) -> Vec<PathBuf> {
    let tracked = Command::new("git").args(["ls-files", "-z"]).current_dir(root).output();
    if let Some(output) = tracked.ok().filter(|output| output.status.success() && !output.stdout.is_empty()) {
        let names = String::from_utf8_lossy(&output.stdout).into_owned();
        return names.split_terminator('\0').map(|name| root.join(name)).collect();
    }
    let (mut found, mut open) = (Vec::new(), vec![root.to_owned()]);
    while let Some(folder) = open.pop() {
        for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            let is_committed = path.file_name().is_none_or(|name| !NOT_COMMITTED.iter().any(|n| name == *n));
            match path.is_dir() {
                true if is_committed && !path.is_symlink() => open.push(path),
                true => {}
                false => found.push(path),
            }
        }
    }
    found
}

#[test]
fn no_file_has_marks_of_a_merge() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let files = files(root);
    assert!(files.iter().any(|path| path.ends_with("docs/architecture.md")), "the documents are looked at");
    // A tracked file may have been deleted from the working tree
    let read = files.iter().filter_map(|path| Some((path, fs::read(path).ok()?)));
    let marked = read.filter_map(|(path, text)| Some(format!("{}:{}", path.display(), conflict(&text)?)));
    let marked: Vec<String> = marked.collect();
    assert!(marked.is_empty(), "{}", marked.join("\n"));
}

#[test]
fn marks_of_a_merge_are_found() {
    let mark = "<".repeat(7);
    assert_eq!(conflict(format!("a\n{mark} HEAD\nb\n").as_bytes()), Some(2));
    assert_eq!(conflict(b"Title\n=======\na << b\n"), None);
}

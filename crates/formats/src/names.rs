//! Names in different Unicode normal forms: `ü` is one character or two. Names that look the same are equal.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use unicode_normalization::{UnicodeNormalization, is_nfc};

/// A name in normal form C, in which names are compared.
pub fn nfc(name: &str) -> Cow<'_, str> {
    if is_nfc(name) { Cow::Borrowed(name) } else { Cow::Owned(name.nfc().collect()) }
}

/// The path of a named file in a folder: exactly as named, or else an existing file with the same name in another
/// normal form, as files from macOS have.
pub fn file_in(folder: &Path, name: &str) -> PathBuf {
    let path = folder.join(name);
    if name.is_ascii() || path.exists() {
        return path;
    }
    Path::new(name).components().fold(folder.to_owned(), |folder, component| {
        let path = folder.join(component);
        if path.exists() { path } else { entry_like(&folder, &component.as_os_str().to_string_lossy()).unwrap_or(path) }
    })
}

/// An entry of a folder by its name in any normal form; the first one if there are several.
fn entry_like(folder: &Path, name: &str) -> Option<PathBuf> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let entries = std::fs::read_dir(folder).ok()?.flatten();
    let is_same = |entry: &std::fs::DirEntry| entry.file_name().to_str().is_some_and(|other| nfc(other) == nfc(name));
    entries.filter(is_same).map(|entry| entry.path()).min()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In normal forms C and D.
    const FORMS: [&str; 2] = ["gr\u{fc}n", "gru\u{308}n"];

    #[test]
    fn files_are_found_by_their_names_in_any_normal_form() {
        assert_eq!(FORMS.map(nfc), [FORMS[0]; 2]);
        for [there, asked] in [FORMS, [FORMS[1], FORMS[0]], [FORMS[0]; 2], [FORMS[1]; 2]] {
            let root = tempfile::tempdir().unwrap();
            let path = root.path().join(there).join(format!("{there}.png"));
            std::fs::create_dir(root.path().join(there)).unwrap();
            std::fs::write(&path, "").unwrap();
            let name = format!("{asked}/{asked}.png");
            assert_eq!(file_in(root.path(), &name), path);
            assert_eq!(file_in(Path::new("/elsewhere"), root.path().join(&name).to_str().unwrap()), path);
            // A missing file keeps its name
            assert_eq!(file_in(root.path(), "gr\u{fc}ner.png"), root.path().join("gr\u{fc}ner.png"));
        }
        // The exact name takes precedence
        let root = tempfile::tempdir().unwrap();
        FORMS.iter().for_each(|name| std::fs::write(root.path().join(name), "").unwrap());
        FORMS.iter().for_each(|name| assert_eq!(file_in(root.path(), name), root.path().join(name)));
    }
}

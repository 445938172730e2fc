//! Atomic writing of files: either the whole file appears under its name, or the old one stays.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use tempfile::{Builder, NamedTempFile};

/// Temporary files and folders that there are now.
static TEMPORARY: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn temporary() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    TEMPORARY.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Until this is dropped, [`remove_temporary`] removes a file or folder.
#[derive(Debug)]
pub struct Temporary(PathBuf);

impl Temporary {
    /// Of the file or folder with this path.
    pub fn new(path: &Path) -> Self {
        temporary().insert(path.to_owned());
        Temporary(path.to_owned())
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        temporary().remove(&self.0);
    }
}

/// Removes the temporary files and folders that there are now, for a program that ends without running destructors.
pub fn remove_temporary() {
    remove_where(|_| true);
}

fn remove_where(is_chosen: impl Fn(&Path) -> bool) {
    for path in temporary().iter().filter(|path| is_chosen(path)) {
        // Whoever made it may have removed it meanwhile
        let _ = if path.is_dir() { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
    }
}

/// Writes a file. `write` gets another one beside it with the same extension, which takes the name when all of it is on
/// the disk, and is removed if anything fails.
pub fn write_whole(path: &Path, write: impl FnOnce(&mut NamedTempFile) -> io::Result<()>) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let suffix = path.extension().map_or_else(String::new, |extension| format!(".{}", extension.to_string_lossy()));
    let mut builder = Builder::new();
    builder.prefix(".partial-").suffix(&suffix);
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut partial = builder.tempfile_in(folder)?;
    let _temporary = Temporary::new(partial.path());
    write(&mut partial)?;
    // On the disk before it takes the name, lest a crash leaves an empty file in place of a good one. It is opened
    // anew, for whoever wrote it by its name may have made it anew.
    File::open(partial.path())?.sync_all()?;
    partial.persist(path)?;
    Ok(())
}

/// Gives a file its name when all of it is on the disk, and waits until the disk knows the name, where that can be.
pub fn sync_and_rename(partial: &Path, path: &Path) -> io::Result<()> {
    File::open(partial)?.sync_all()?;
    std::fs::rename(partial, path)?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // Some file systems refuse that for folders
    let _ = File::open(folder).and_then(|folder| folder.sync_all());
    Ok(())
}

/// Writes a text, as [`write_whole`]; what is no file (a pipe, a terminal) gets it directly.
pub fn write_text(path: &Path, text: &str) -> io::Result<()> {
    match path.metadata() {
        Ok(is) if !is.is_file() && !is.is_dir() => std::fs::write(path, text),
        _ => write_whole(path, |file| file.write_all(text.as_bytes())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_write_that_fails_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        write_text(&path, "first").unwrap();
        let failed = write_whole(&path, |file| {
            assert_eq!(file.path().extension(), path.extension());
            file.write_all(b"half of the sec")?;
            Err(io::Error::other("the disk is full"))
        });
        assert_eq!(failed.unwrap_err().to_string(), "the disk is full");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "first");
        write_text(&path, "second").unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "second");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        assert!(write_text(&folder.path().join("no/where.txt"), "").is_err());
        assert!(write_text(folder.path(), "").is_err());
    }

    #[test]
    fn a_program_that_ends_at_once_leaves_no_temporary_files() {
        let folder = tempfile::tempdir().unwrap();
        let files = |path: &Path| std::fs::read_dir(path).unwrap().count();
        // Those of other tests are needed
        let remove = || remove_where(|path| path.starts_with(folder.path()));
        let inner = tempfile::tempdir_in(folder.path()).unwrap().keep();
        std::fs::write(inner.join("image"), "").unwrap();
        let held = Temporary::new(&inner);
        let written = write_whole(&folder.path().join("a.txt"), |file| {
            assert_eq!((file.path().exists(), files(folder.path())), (true, 2));
            remove();
            assert_eq!(files(folder.path()), 0);
            Ok(())
        });
        assert!(written.is_err());
        drop(held);
        write_text(&folder.path().join("b.txt"), "b").unwrap();
        remove();
        assert_eq!(files(folder.path()), 1, "a file that has its name is not temporary");
    }

    #[cfg(unix)]
    #[test]
    fn others_may_read_what_the_user_lets_them_read() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let [ours, plain] = ["ours", "plain"].map(|name| folder.path().join(name));
        write_text(&ours, "").unwrap();
        std::fs::write(&plain, "").unwrap();
        let mode = |path: &Path| path.metadata().unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }
}

//! A file that is being written, under a temporary name, by one process at a time.
//!
//! Two processes can write the same file: a queue restarts a task while its lost node is still running, or a command is
//! given twice. Each replaces the whole file, so the last one wins. A lock prevents them from writing into the same
//! temporary file.

use lumiris_formats::output::Destination;
use std::fs::{File, TryLockError, remove_file};
use std::io;
use std::path::{Path, PathBuf};

/// Attempts to lock the file: another process may rename it between opening and locking.
const ATTEMPTS: u32 = 100;

/// A file with a temporary name.
#[derive(Debug)]
pub(super) struct Partial {
    file: File,
    name: PathBuf,
    destination: Destination,
}

impl Partial {
    /// Writes a file that will be named `path`. Removes it if that fails.
    pub(super) fn write(path: &Path, write: impl FnOnce(&mut File) -> io::Result<()>) -> io::Result<Partial> {
        let mut partial = Partial::create(path)?;
        match write(&mut partial.file) {
            Ok(()) => Ok(partial),
            Err(error) => {
                partial.remove();
                Err(error)
            }
        }
    }

    /// Creates an empty file, or empties an existing one.
    fn create(path: &Path) -> io::Result<Partial> {
        let destination = Destination::of(path)?;
        if destination.is_stream() {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "is no regular file"));
        }
        let name = partial_path(destination.path());
        for _ in 0..ATTEMPTS {
            let file = File::options().write(true).create(true).truncate(false).open(&name)?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    let text = format!("another process is writing it ({})", name.display());
                    return Err(io::Error::new(io::ErrorKind::ResourceBusy, text));
                }
                // Some file systems have no locks
                Err(TryLockError::Error(_)) => {}
            }
            if has_name(&file, &name)? {
                file.set_len(0)?;
                return Ok(Partial { file, name, destination });
            }
        }
        Err(io::Error::new(io::ErrorKind::ResourceBusy, "other processes are writing it"))
    }

    /// Renames the file after all of it is on the disk.
    pub(super) fn end(self) -> io::Result<()> {
        let ended = self.destination.replace_by(&self.name);
        if ended.is_err() {
            self.remove();
        }
        ended
    }

    /// Removes the file, so that it does not keep a full disk full.
    fn remove(self) {
        let _ = remove_file(&self.name);
    }
}

/// The temporary name of a file.
fn partial_path(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".tmp");
    PathBuf::from(name)
}

/// True if `name` still refers to the opened file.
#[cfg(unix)]
fn has_name(file: &File, name: &Path) -> io::Result<bool> {
    use std::os::unix::fs::MetadataExt;
    let identity = |metadata: std::fs::Metadata| (metadata.dev(), metadata.ino());
    match name.metadata() {
        Ok(there) => Ok(identity(there) == identity(file.metadata()?)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}

/// Always true on systems where open files cannot be renamed.
#[cfg(not(unix))]
fn has_name(_file: &File, _name: &Path) -> io::Result<bool> {
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn two_writers_of_one_file_never_write_into_one_another() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.part");
        let write = |text: &'static str| Partial::write(&path, |file| file.write_all(text.as_bytes()));
        let first = write("first").unwrap();
        let error = write("second").unwrap_err();
        assert!(
            error.kind() == io::ErrorKind::ResourceBusy && error.to_string().contains("another process"),
            "{error}"
        );
        first.end().unwrap();
        // The next writer starts with an empty file, whatever an earlier one left
        std::fs::write(folder.path().join("a.part.tmp"), "half of a file that is long").unwrap();
        let next = write("next").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"first");
        next.end().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"next");
        assert!(Partial::write(&path, |_| Err(io::Error::other("full"))).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn many_writers_leave_one_whole_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.film");
        let write = |k: u8| {
            let mut done = 0;
            while done < 20 {
                if let Ok(partial) = Partial::write(&path, |file| file.write_all(&[k; 10_000])) {
                    partial.end().unwrap();
                    done += 1;
                }
            }
        };
        std::thread::scope(|scope| (0..4).for_each(|k| drop(scope.spawn(move || write(k)))));
        let bytes = std::fs::read(&path).unwrap();
        assert!(bytes.len() == 10_000 && bytes.iter().all(|b| *b == bytes[0]));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}

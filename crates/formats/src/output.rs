//! Atomic writing of files: either the complete file appears under its name, or the old one remains.
//!
//! A symbolic link stands for its target, which is replaced. The new file has the owner and mode of the old one, as far
//! as permitted. A file without write permission is not replaced even if the folder would allow it, since it was
//! protected on purpose. Pipes, terminals and devices such as `/dev/stdout` are written directly.

use std::collections::BTreeSet;
use std::fs::{File, Metadata};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use tempfile::{Builder, NamedTempFile};

/// Maximum number of chained symbolic links, as in Linux.
const MAX_LINKS: usize = 40;

/// The target of an output name.
#[derive(Debug)]
pub struct Destination {
    path: PathBuf,
    /// Metadata of the existing file.
    earlier: Option<Metadata>,
    /// True for targets other than files, which are written directly.
    is_stream: bool,
}

impl Destination {
    /// Follows symbolic links.
    ///
    /// Fails for a file without write permission, for a folder, and if the parent folder does not exist.
    pub fn of(path: &Path) -> io::Result<Destination> {
        let wrong = |kind, text: &str| Err(io::Error::new(kind, text));
        let target = followed(path)?;
        // Only links of processes are not followed
        let is_descriptor = target.is_symlink();
        let earlier = target.metadata().ok();
        match &earlier {
            Some(earlier) if earlier.is_dir() => return wrong(ErrorKind::IsADirectory, "is a folder"),
            Some(earlier) if earlier.is_file() && !is_descriptor => {
                // The mode is respected even for root, whom the system would let write
                if earlier.permissions().readonly() {
                    return wrong(ErrorKind::PermissionDenied, "is read-only");
                }
                File::options().write(true).open(&target)?;
            }
            Some(_) => {}
            None if folder_of(&target).is_dir() => {}
            None => {
                return wrong(ErrorKind::NotFound, &format!("folder {} does not exist", folder_of(&target).display()));
            }
        }
        let is_stream = is_descriptor || earlier.as_ref().is_some_and(|earlier| !earlier.is_file());
        Ok(Destination { path: target, earlier, is_stream })
    }

    /// The target after all links.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// True for targets other than files: a pipe, a terminal, a device.
    pub fn is_stream(&self) -> bool {
        self.is_stream
    }

    /// Prepares the complete file `partial` to replace the earlier one. Its content is flushed to disk, so that a crash
    /// cannot leave an empty file, and it gets the owner and mode of the earlier one.
    fn prepare(&self, partial: &Path) -> io::Result<()> {
        // Reopened, since the writer may have recreated it by name
        File::open(partial)?.sync_all()?;
        let Some(earlier) = &self.earlier else { return Ok(()) };
        #[cfg(unix)]
        {
            use std::os::unix::fs::{MetadataExt, chown};
            let now = partial.metadata()?;
            if (now.uid(), now.gid()) != (earlier.uid(), earlier.gid()) {
                // Only root may change the owner; the group may be another one of the user's
                let _ = chown(partial, Some(earlier.uid()), Some(earlier.gid()))
                    .or_else(|_| chown(partial, None, Some(earlier.gid())));
            }
        }
        std::fs::set_permissions(partial, earlier.permissions())
    }

    /// Renames a file in the same folder to the target after its content is on disk, and waits until the folder is on
    /// disk too, if possible.
    pub fn replace_by(&self, partial: &Path) -> io::Result<()> {
        self.prepare(partial)?;
        std::fs::rename(partial, &self.path)?;
        // Some file systems do not support this for folders
        let _ = File::open(folder_of(&self.path)).and_then(|folder| folder.sync_all());
        Ok(())
    }

    /// A partial file with the same extension: in the same folder, or in the temporary folder for a stream.
    fn partial(&self) -> io::Result<NamedTempFile> {
        let suffix = self.path.extension().map_or_else(String::new, |e| format!(".{}", e.to_string_lossy()));
        let mut builder = Builder::new();
        builder.prefix(".partial-").suffix(&suffix);
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        if self.is_stream { builder.tempfile() } else { builder.tempfile_in(folder_of(&self.path)) }
    }
}

/// The folder of a file.
fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// The end of the chain of symbolic links from `path`, whether it exists or not. An open file of a process, such as
/// `/dev/stdout`, has no name to be replaced: its link in `/proc` is the end.
fn followed(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_owned();
    for _ in 0..MAX_LINKS {
        let Ok(next) = path.read_link() else { return Ok(path) };
        let folder = folder_of(&path).canonicalize()?;
        if folder.starts_with("/proc") {
            return Ok(path);
        }
        path = folder.join(next);
    }
    Err(io::Error::other("too many symbolic links"))
}

/// Fails for an output that [`Destination::of`] rejects. The error names the file.
pub fn check_destination(path: &Path) -> io::Result<Destination> {
    Destination::of(path).map_err(|error| io::Error::new(error.kind(), format!("{}: {error}", path.display())))
}

/// Checks that an output can be written, before time is spent on making it. The error names the file.
pub fn check_writable(path: &Path) -> io::Result<()> {
    let destination = check_destination(path)?;
    // Creates and removes a file in the same way as the output
    destination.partial().map(drop).map_err(|error| {
        let folder = folder_of(&destination.path).display();
        io::Error::new(error.kind(), format!("{}: nothing can be written to {folder}: {error}", path.display()))
    })
}

/// Existing temporary files and folders.
static TEMPORARY: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn temporary() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    TEMPORARY.lock().unwrap_or_else(PoisonError::into_inner)
}

/// While this exists, [`remove_temporary`] removes a file or folder.
#[derive(Debug)]
pub struct Temporary(PathBuf);

impl Temporary {
    /// For the file or folder at this path.
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

/// Removes all existing temporary files and folders, for a program that ends without running destructors.
pub fn remove_temporary() {
    remove_where(|_| true);
}

fn remove_where(is_chosen: impl Fn(&Path) -> bool) {
    for path in temporary().iter().filter(|path| is_chosen(path)) {
        // The owner may have removed it meanwhile
        let _ = if path.is_dir() { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
    }
}

/// Writes a file. `write` gets a partial file with the same extension in the same folder. It is renamed when its
/// content is on disk, and removed after an error.
pub fn write_whole(path: &Path, write: impl FnOnce(&mut NamedTempFile) -> io::Result<()>) -> io::Result<()> {
    let destination = Destination::of(path)?;
    let mut partial = destination.partial()?;
    let _temporary = Temporary::new(partial.path());
    write(&mut partial)?;
    if destination.is_stream {
        // Reopened, as below
        let mut stream = File::options().append(true).open(&destination.path)?;
        io::copy(&mut File::open(partial.path())?, &mut stream)?;
        return Ok(());
    }
    destination.prepare(partial.path())?;
    partial.persist(&destination.path)?;
    Ok(())
}

/// Writes a text, as [`write_whole`].
pub fn write_text(path: &Path, text: &str) -> io::Result<()> {
    write_whole(path, |file| file.write_all(text.as_bytes()))
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
        // Temporary files of other tests must remain
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

    #[cfg(unix)]
    #[test]
    fn the_target_of_a_symbolic_link_is_replaced_and_the_link_stays() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::create_dir(path("far")).unwrap();
        // A chain, one link of it relative, and the last one without a target
        symlink("b.txt", path("a.txt")).unwrap();
        symlink(path("far/c.txt"), path("b.txt")).unwrap();
        for text in ["first", "second"] {
            check_writable(&path("a.txt")).unwrap();
            write_text(&path("a.txt"), text).unwrap();
            assert_eq!(std::fs::read_to_string(path("far/c.txt")).unwrap(), text);
            assert!(["a.txt", "b.txt"].iter().all(|name| path(name).is_symlink()));
        }
        assert_eq!(std::fs::read_dir(path("far")).unwrap().count(), 1);

        symlink("gone/d.txt", path("d.txt")).unwrap();
        let error = check_writable(&path("d.txt")).unwrap_err();
        assert!(error.kind() == ErrorKind::NotFound && error.to_string().contains("gone does not exist"), "{error}");
        symlink("e.txt", path("e.txt")).unwrap();
        assert!(check_writable(&path("e.txt")).unwrap_err().to_string().contains("too many symbolic links"));
    }

    #[cfg(unix)]
    #[test]
    fn a_file_keeps_its_mode_and_one_that_is_read_only_its_content() {
        use std::os::unix::fs::{MetadataExt, PermissionsExt, chown};
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        let mode = |mode| std::fs::set_permissions(&path, PermissionsExt::from_mode(mode)).unwrap();
        std::fs::write(&path, "first").unwrap();
        mode(0o640);
        // Only root can change the owner
        let is_root = chown(&path, Some(1234), Some(1235)).is_ok();
        write_text(&path, "second").unwrap();
        let now = path.metadata().unwrap();
        assert_eq!(now.permissions().mode() & 0o777, 0o640);
        assert!(!is_root || (now.uid(), now.gid()) == (1234, 1235));

        mode(0o444);
        for error in [check_writable(&path).unwrap_err(), write_text(&path, "third").unwrap_err()] {
            assert!(
                error.kind() == ErrorKind::PermissionDenied && error.to_string().ends_with("is read-only"),
                "{error}"
            );
        }
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "second");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn devices_and_open_files_are_written_to_and_not_replaced() {
        use std::os::fd::AsRawFd;
        let folder = tempfile::tempdir().unwrap();
        let [full, file] = ["full", "file"].map(|name| folder.path().join(name));
        std::os::unix::fs::symlink("/dev/full", &full).unwrap();
        check_writable(&full).unwrap();
        assert_eq!(write_text(&full, "text").unwrap_err().kind(), ErrorKind::StorageFull);

        // Like `/dev/stdout` when a shell redirects it to a file
        let open = File::create(&file).unwrap();
        let descriptor = format!("/dev/fd/{}", open.as_raw_fd());
        write_text(Path::new(&descriptor), "text").unwrap();
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "text");
        assert_eq!(open.metadata().unwrap().len(), 4, "it is still the same file");
    }
}

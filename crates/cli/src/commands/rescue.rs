//! Rescue of results that cannot be written to their destination: a full disk must not lose hours of rendering.

use anyhow::anyhow;
use std::path::{Path, PathBuf};

/// Writes a file. If that fails, writes it into a new folder in the temporary folder; the error then gives the reason
/// and the path of the copy.
pub(super) fn write_or_rescue(path: &Path, write: impl Fn(&Path) -> anyhow::Result<()>) -> anyhow::Result<()> {
    let Err(error) = write(path) else { return Ok(()) };
    Err(match rescue(path, write) {
        Ok(rescued) => anyhow!("{error:#}; it is in {} instead", rescued.display()),
        Err(second) => anyhow!("{error:#}; nor is there a place for it elsewhere: {second:#}"),
    })
}

/// Writes a file of the same name into a new folder, and returns its path. The folder is removed if that fails.
fn rescue(path: &Path, write: impl Fn(&Path) -> anyhow::Result<()>) -> anyhow::Result<PathBuf> {
    let folder = tempfile::Builder::new().prefix("lumiris-").tempdir()?;
    let name = path.file_name().ok_or_else(|| anyhow!("{} names no file", path.display()))?;
    write(&folder.path().join(name))?;
    Ok(folder.keep().join(name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::bail;

    /// Writes, unless the path is below `forbidden`.
    fn write_outside(forbidden: &Path) -> impl Fn(&Path) -> anyhow::Result<()> {
        move |path| {
            if path.starts_with(forbidden) {
                bail!("no space left for {}", path.display());
            }
            Ok(std::fs::write(path, "picture")?)
        }
    }

    #[test]
    fn a_file_that_cannot_be_written_in_its_place_is_written_elsewhere() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let error = write_or_rescue(&path, write_outside(folder.path())).unwrap_err().to_string();
        assert!(error.starts_with("no space left for ") && !path.exists(), "{error}");
        let place = error.rsplit_once("; it is in ").and_then(|(_, place)| place.strip_suffix(" instead")).unwrap();
        let place = Path::new(place);
        assert!(place.ends_with("a.exr") && place.starts_with(std::env::temp_dir()), "{error}");
        assert_eq!(std::fs::read_to_string(place).unwrap(), "picture");
        std::fs::remove_dir_all(place.parent().unwrap()).unwrap();

        write_or_rescue(&path, write_outside(&folder.path().join("b"))).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "picture");
    }

    #[test]
    fn both_reasons_are_told_if_there_is_no_place_at_all() {
        let error = write_or_rescue(Path::new("a.exr"), |path| bail!("no {}", path.display())).unwrap_err().to_string();
        assert!(error.starts_with("no a.exr; nor ") && error.ends_with("/a.exr"), "{error}");
    }
}

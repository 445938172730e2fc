//! Writes the scenes.

use super::rooms::{Building, building};
use crate::procedural::files::{ProceduralError, write_texts};
use std::path::Path;

/// Name and text of each scene file that is not generated.
const SCENES: [(&str, &str); 3] = [
    ("ring.pbrt", include_str!("../../../../../scenes/keller-wald/ring.pbrt")),
    ("ring-indirect.pbrt", include_str!("../../../../../scenes/keller-wald/ring-indirect.pbrt")),
    ("slit.pbrt", include_str!("../../../../../scenes/keller-wald/slit.pbrt")),
];
/// Shared part of `ring.pbrt` and `ring-indirect.pbrt`.
const SHARED: (&str, &str) =
    ("ring-geometry.pbrt", include_str!("../../../../../scenes/keller-wald/ring-geometry.pbrt"));

/// Number of scenes.
pub const COUNT: usize = SCENES.len() + 2;

/// Writes the scenes into a folder, which is created if necessary.
pub fn write_scenes(folder: &Path) -> Result<(), ProceduralError> {
    let rooms = building(&Building::default());
    let many = building(&Building::with_many_lights());
    let computed = [("rooms.pbrt", rooms.as_str()), ("rooms-10000.pbrt", many.as_str()), SHARED];
    write_texts(folder, &[&SCENES[..], &computed[..]].concat())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_folder_gets_every_file_and_the_rooms_are_those_of_the_repository() {
        let folder = tempfile::tempdir().unwrap();
        write_scenes(folder.path()).unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), COUNT + 1);
        let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/keller-wald/rooms.pbrt");
        let read = |path: &Path| std::fs::read_to_string(path).unwrap();
        assert!(read(&folder.path().join("rooms.pbrt")) == read(&here), "run `lumiris generate keller-wald`");
    }
}

//! The scenes of `scenes/fan`, after [Fan et al. 2006]: a glossy board under a large light and a small one, a
//! statue with narrow highlights, a room with small lights, a box for irradiance caching.

use super::files::{ProceduralError, Written, write_statue, write_texts};
use super::statue::StatueOptions;
use std::path::Path;

/// Name and text of each scene file.
const SCENES: [(&str, &str); 4] = [
    ("checkers.pbrt", include_str!("../../../../scenes/fan/checkers.pbrt")),
    ("statue.pbrt", include_str!("../../../../scenes/fan/statue.pbrt")),
    ("room.pbrt", include_str!("../../../../scenes/fan/room.pbrt")),
    ("box.pbrt", include_str!("../../../../scenes/fan/box.pbrt")),
];

/// Writes the scenes and `statue.ply` into a folder, which is made if there is none.
pub fn write_scenes(folder: &Path, statue: &StatueOptions) -> Result<Written, ProceduralError> {
    write_texts(folder, &SCENES)?;
    write_statue(&folder.join("statue.ply"), statue)
}

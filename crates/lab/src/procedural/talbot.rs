//! The scenes of `scenes/talbot`: a statue illuminated by a sky, by panels, or by both, after the test scenes of
//! [Talbot et al. 2005]. At nearly every point each light is partly visible.

use super::files::{ProceduralError, Written, write_sky, write_statue, write_texts};
use super::sky::SkyOptions;
use super::statue::StatueOptions;
use std::path::Path;

/// Name and text of each scene file.
const SCENES: [(&str, &str); 4] = [
    ("statue-geometry.pbrt", include_str!("../../../../scenes/talbot/statue-geometry.pbrt")),
    ("statue-env.pbrt", include_str!("../../../../scenes/talbot/statue-env.pbrt")),
    ("statue-env-lights.pbrt", include_str!("../../../../scenes/talbot/statue-env-lights.pbrt")),
    ("statue-lights.pbrt", include_str!("../../../../scenes/talbot/statue-lights.pbrt")),
];

/// Detail of the files of the scenes.
#[derive(Clone, Copy, Debug)]
pub struct TalbotOptions {
    /// The statue.
    pub statue: StatueOptions,
    /// The sky.
    pub sky: SkyOptions,
}

impl Default for TalbotOptions {
    fn default() -> Self {
        TalbotOptions { statue: StatueOptions::default(), sky: sky_of_the_scenes() }
    }
}

/// A sun low enough for long shadows, slightly enlarged, among broken clouds.
fn sky_of_the_scenes() -> SkyOptions {
    SkyOptions {
        elevation: 24_f32.to_radians(),
        azimuth: 215_f32.to_radians(),
        haze: 2.0,
        sun_size: 4.0,
        cloud_cover: 0.45,
        irradiance: 2.2,
        seed: 7,
        ..SkyOptions::default()
    }
}

/// Writes the scenes, `statue.ply` and `sky.exr` into a folder, which is created if necessary.
pub fn write_scenes(folder: &Path, options: &TalbotOptions) -> Result<Written, ProceduralError> {
    write_texts(folder, &SCENES)?;
    write_sky(&folder.join("sky.exr"), &options.sky)?;
    write_statue(&folder.join("statue.ply"), &options.statue)
}

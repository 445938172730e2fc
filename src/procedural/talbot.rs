//! The scenes of `scenes/talbot`: one statue, lit by a sky, by panels, or by both, after the test scenes of
//! [Talbot et al. 2005]. Nearly every point sees a part of each light.

use super::ply::write_ply;
use super::sky::{SkyOptions, sky};
use super::statue::{StatueOptions, statue};
use crate::imaging::oiio::{ImageError, Part, Storage, write_image};
use std::io;
use std::path::{Path, PathBuf};

/// Name and text of each scene file.
const SCENES: [(&str, &str); 4] = [
    ("statue-geometry.pbrt", include_str!("../../scenes/talbot/statue-geometry.pbrt")),
    ("statue-env.pbrt", include_str!("../../scenes/talbot/statue-env.pbrt")),
    ("statue-env-lights.pbrt", include_str!("../../scenes/talbot/statue-env-lights.pbrt")),
    ("statue-lights.pbrt", include_str!("../../scenes/talbot/statue-lights.pbrt")),
];

/// What kept content from being made.
#[derive(Debug, thiserror::Error)]
pub enum ProceduralError {
    /// An option is out of range.
    #[error("{0}")]
    Option(String),
    /// A file cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A picture cannot be written.
    #[error(transparent)]
    Image(#[from] ImageError),
}

/// How much work goes into the files of the scenes.
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

/// A sun low enough for long shadows, a little widened, among broken clouds.
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

/// What was written.
#[derive(Clone, Copy, Debug)]
pub struct Written {
    /// Triangles of the statue.
    pub triangles: usize,
}

/// Makes a statue and writes it as PLY.
pub fn write_statue(path: &Path, options: &StatueOptions) -> Result<Written, ProceduralError> {
    let mesh = statue(options).map_err(ProceduralError::Option)?;
    write_ply(path, &mesh).map_err(|source| ProceduralError::Io { path: path.to_owned(), source })?;
    Ok(Written { triangles: mesh.triangle_count() })
}

/// Makes a sky and writes it, usually as EXR.
pub fn write_sky(path: &Path, options: &SkyOptions) -> Result<(), ProceduralError> {
    let image = sky(options).map_err(ProceduralError::Option)?;
    let part = Part::linear(image.width, image.height, image.channels, image.data).stored_as(Storage::Float);
    Ok(write_image(path, &[part])?)
}

/// Writes the scenes, `statue.ply` and `sky.exr` into a folder, which is made if there is none.
pub fn write_scenes(folder: &Path, options: &TalbotOptions) -> Result<Written, ProceduralError> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| ProceduralError::Io { path, source }
    };
    std::fs::create_dir_all(folder).map_err(failed(folder))?;
    for (name, text) in SCENES {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(failed(&path))?;
    }
    write_sky(&folder.join("sky.exr"), &options.sky)?;
    write_statue(&folder.join("statue.ply"), &options.statue)
}

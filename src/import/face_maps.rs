//! Ptex files as textures of faces.

use crate::imaging::{ColorEncoding, FaceMap};
use lumiris_formats::ptex::{PtexError, read_ptex};
use std::path::{Path, PathBuf};

/// A request for textures of faces.
#[derive(Clone, Debug, PartialEq)]
pub struct FaceMapRequest {
    /// File.
    pub path: PathBuf,
    /// Encoding of its values.
    pub encoding: ColorEncoding,
}

/// Reads a file.
pub fn load_face_map(path: &Path, encoding: ColorEncoding) -> Result<FaceMap, PtexError> {
    Ok(FaceMap::new(read_ptex(path)?, encoding))
}

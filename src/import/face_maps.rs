//! Ptex files as textures of faces.

use super::memory::FileSize;
use crate::imaging::{ColorEncoding, FaceMap};
use lumiris_formats::ptex::{PtexError, PtexSize, ptex_size, read_ptex};
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

/// Bytes of a file: its pyramids; and the file with its texels. None if it is unreadable, which reading it reports.
pub fn face_map_size(path: &Path) -> FileSize {
    let PtexSize { file, texels, faces } = ptex_size(path).unwrap_or_default();
    FileSize { kept: texels.saturating_add(texels / 3).saturating_add(faces), loading: file.saturating_add(texels) }
}

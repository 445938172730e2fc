//! Image files by OpenImageIO: safe wrapper of the shim.
//!
//! OpenImageIO is loaded when the first image is read or written. Images whose header requests more memory than the
//! caller allows are rejected. Files are written under a temporary name and renamed at the end, so that a failure never
//! leaves a partial image under the name. Equal images give equal files: a date is written only if the caller gives one
//! (`DateTime`), since OpenImageIO would insert the current time.
//!
//! Reading order: `part` (images to write), `shim` (calls and strings), `radiance`, `read`, `image_file`, `write`, `ocio`.

mod image_file;
mod ocio;
mod part;
mod radiance;
mod read;
mod shim;
mod write;

#[cfg(test)]
mod image_tests;

pub use super::file::{ImageError, PartHeader, ReadLimits, Window};
pub use image_file::{ImageFile, Values};
pub use ocio::{OcioView, ocio_display};
pub use part::{MetaValue, Part, Storage};
pub(super) use read::{Input, read_failure};
pub use read::{ReadImage, read_headers, read_image, read_metadata, read_part};
pub use shim::{library_bytes, load};
pub use write::{ROWS_AT_ONCE, RowSource, write_image, write_rows};

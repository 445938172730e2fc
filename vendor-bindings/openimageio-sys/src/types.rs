//! The structures and constants of `shim/oiio_shim.h`.

use std::ffi::{c_char, c_void};
use std::mem::size_of;

/// Version of the interface. The shim reports its own by `Api::abi`.
pub const OIIO_SHIM_ABI: i32 = 4;

/// Success.
pub const OIIO_OK: i32 = 0;
/// The caller's fault: null pointer, wrong index, wrong length.
pub const OIIO_INVALID_ARGUMENT: i32 = 1;
/// Missing, unreadable, not an image, or the header is broken.
pub const OIIO_CANNOT_OPEN: i32 = 2;
/// Deep or volume data, or a format that cannot hold the requested data.
pub const OIIO_UNSUPPORTED: i32 = 3;
/// The header asks for more memory than the caller allows.
pub const OIIO_TOO_LARGE: i32 = 4;
/// The pixels are damaged or missing.
pub const OIIO_CANNOT_READ: i32 = 5;
/// Disk full, no permission, or the encoder failed.
pub const OIIO_CANNOT_WRITE: i32 = 6;
/// An allocation failed.
pub const OIIO_OUT_OF_MEMORY: i32 = 7;
/// Any other C++ exception.
pub const OIIO_EXCEPTION: i32 = 8;

/// Any other channel type.
pub const OIIO_FORMAT_UNKNOWN: i32 = 0;
/// Unsigned 8-bit integers; 0…255 is 0…1 as a float.
pub const OIIO_FORMAT_U8: i32 = 1;
/// Unsigned 16-bit integers; 0…65535 is 0…1 as a float.
pub const OIIO_FORMAT_U16: i32 = 2;
/// Unsigned 32-bit integers, scaled likewise.
pub const OIIO_FORMAT_U32: i32 = 3;
/// 16-bit floats.
pub const OIIO_FORMAT_HALF: i32 = 4;
/// 32-bit floats.
pub const OIIO_FORMAT_FLOAT: i32 = 5;
/// 64-bit floats.
pub const OIIO_FORMAT_DOUBLE: i32 = 6;
/// Signed 8-bit integers; ±127 is ±1 as a float.
pub const OIIO_FORMAT_I8: i32 = 7;
/// Signed 16-bit integers, scaled likewise.
pub const OIIO_FORMAT_I16: i32 = 8;
/// Signed 32-bit integers, scaled likewise.
pub const OIIO_FORMAT_I32: i32 = 9;

/// A file open for reading.
#[repr(C)]
pub struct OiioInput {
    _opaque: [u8; 0],
}

/// A file being written.
#[repr(C)]
pub struct OiioOutput {
    _opaque: [u8; 0],
}

/// Header of a subimage. Not checked: a damaged file may contain any values.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OiioSpec {
    /// Width of the data window (pixels).
    pub width: i32,
    /// Height of the data window (pixels).
    pub height: i32,
    /// 1 for images, more for volumes.
    pub depth: i32,
    /// First column of the data window (pixels).
    pub x: i32,
    /// First row of the data window (pixels).
    pub y: i32,
    /// First column of the display window (pixels).
    pub full_x: i32,
    /// First row of the display window (pixels).
    pub full_y: i32,
    /// Width of the display window (pixels).
    pub full_width: i32,
    /// Height of the display window (pixels).
    pub full_height: i32,
    /// Number of channels.
    pub nchannels: i32,
    /// `OIIO_FORMAT_…` in the file; the widest if the channels differ.
    pub format: i32,
    /// Index of the alpha channel, or -1.
    pub alpha_channel: i32,
    /// 1 if a pixel has several samples; such subimages cannot be read.
    pub deep: i32,
    /// Number of metadata entries.
    pub attributes: i32,
}

/// One level of the pyramid of a subimage.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OiioLevel {
    /// Width (pixels).
    pub width: i32,
    /// Height (pixels).
    pub height: i32,
    /// Width of its tiles (pixels); 0 if stored in rows.
    pub tile_width: i32,
    /// Height of its tiles (pixels); 0 if stored in rows.
    pub tile_height: i32,
}

/// One metadata entry. The pointers live until the input is closed.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct OiioAttribute {
    /// Name, for instance `oiio:ColorSpace`.
    pub name: *const c_char,
    /// OpenImageIO's name of the type: `string`, `int`, `float[3]`, `matrix`, …
    pub r#type: *const c_char,
    /// The value as text; a string without quotes.
    pub value: *const c_char,
    /// The raw values, not necessarily aligned; null if the type holds strings.
    pub data: *const c_void,
    /// Length of `data` (bytes).
    pub bytes: usize,
}

/// One part (subimage) of a file to write. The pointers are read during the call only.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct OiioPart {
    /// Name of the part, or null.
    pub name: *const c_char,
    /// For instance `zip`, `piz`, `dwaa:45`, `jpeg:90`; null for the format's default.
    pub compression: *const c_char,
    /// Width of the data window (pixels).
    pub width: i32,
    /// Height of the data window (pixels).
    pub height: i32,
    /// First column of the data window (pixels).
    pub x: i32,
    /// First row of the data window (pixels).
    pub y: i32,
    /// First column of the display window (pixels).
    pub full_x: i32,
    /// First row of the display window (pixels).
    pub full_y: i32,
    /// Width of the display window (pixels); 0 for the data window's.
    pub full_width: i32,
    /// Height of the display window (pixels); 0 for the data window's.
    pub full_height: i32,
    /// Number of channels.
    pub nchannels: i32,
    /// `nchannels` names.
    pub channel_names: *const *const c_char,
    /// `nchannels` values `OIIO_FORMAT_…`.
    pub channel_formats: *const i32,
}

// The shim asserts the same sizes
const _: () = {
    assert!(size_of::<OiioSpec>() == 14 * 4);
    assert!(size_of::<OiioLevel>() == 4 * 4);
    assert!(size_of::<*const c_char>() != 8 || size_of::<OiioAttribute>() == 40);
    assert!(size_of::<*const c_char>() != 8 || size_of::<OiioPart>() == 72);
};

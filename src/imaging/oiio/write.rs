//! Writing of image files.
#![allow(unsafe_code)]

use super::part::{MetaValue, Part};
use super::shim::{api, c_path, c_text, call};
use crate::imaging::file::ImageError;
use lumiris_formats::output::write_whole;
use openimageio_sys as sys;
use std::borrow::Cow;
use std::ffi::{CString, c_char};
use std::io;
use std::ops::Range;
use std::path::Path;
use std::ptr;

/// Date of files without a date.
pub(super) const NO_DATE: &str = "1970:01:01 00:00:00";

/// Compression `zip` of EXR files, with its level. Level 4, the default of OpenImageIO, takes a quarter more time or
/// more, and gives files that are 0.4 to 5 % smaller (docs/measurements/light-groups.md).
const ZIP_OF_EXR: &str = "zip:1";

/// A file being written.
struct Output {
    api: &'static sys::Api,
    handle: *mut sys::OiioOutput,
}

impl Output {
    fn create(path: &Path) -> Result<Self, String> {
        let api = api().map_err(|e| e.to_string())?;
        let name = c_path(path)?;
        let mut handle = ptr::null_mut();
        // SAFETY: the name ends in a zero byte, and `handle` is only written.
        call(|e, n| unsafe { (api.output_create)(name.as_ptr(), &mut handle, e, n) }).map_err(|f| f.message)?;
        Ok(Output { api, handle })
    }

    fn add_part(&mut self, index: i32, part: &Part, is_exr: bool) -> Result<(), String> {
        let names = part.channels.iter().map(|c| c_text(c)).collect::<Result<Vec<_>, _>>()?;
        let pointers: Vec<*const c_char> = names.iter().map(|n| n.as_ptr()).collect();
        let mut formats = vec![part.storage.format(); names.len()];
        for &(channel, storage) in &part.channel_storage {
            formats[channel] = storage.format();
        }
        let name = part.name.as_deref().map(c_text).transpose()?;
        let compression = match part.compression.as_deref() {
            None | Some("zip") if is_exr => Some(ZIP_OF_EXR),
            named => named,
        };
        let compression = compression.map(c_text).transpose()?;
        let or_null = |text: &Option<CString>| text.as_ref().map_or(ptr::null(), |t| t.as_ptr());
        let size = |n: usize| i32::try_from(n).map_err(|_| "the image is too large".to_owned());
        let description = sys::OiioPart {
            name: or_null(&name),
            compression: or_null(&compression),
            width: size(part.width)?,
            height: size(part.height)?,
            x: size(part.origin[0])?,
            y: size(part.origin[1])?,
            full_x: 0,
            full_y: 0,
            full_width: size(part.full[0])?,
            full_height: size(part.full[1])?,
            nchannels: size(names.len())?,
            channel_names: pointers.as_ptr(),
            channel_formats: formats.as_ptr(),
        };
        // SAFETY: the handle is live until drop, here and below; names and formats outlive the call.
        call(|e, n| unsafe { (self.api.output_add_part)(self.handle, &description, e, n) }).map_err(|f| f.message)?;

        if !part.metadata.iter().any(|(name, _)| name == "DateTime") {
            self.set(index, "DateTime", &MetaValue::Text(NO_DATE.to_owned()))?;
        }
        part.metadata.iter().try_for_each(|(name, value)| self.set(index, name, value))
    }

    /// Sets metadata of a part.
    fn set(&mut self, part: i32, name: &str, value: &MetaValue) -> Result<(), String> {
        let (api, handle, name) = (self.api, self.handle, c_text(name)?);
        let result = match value {
            MetaValue::Text(text) => {
                let text = c_text(text)?;
                // SAFETY: the handle is live, name and text end in a zero byte; so below.
                call(|e, n| unsafe { (api.output_set_string)(handle, part, name.as_ptr(), text.as_ptr(), e, n) })
            }
            MetaValue::Integer(value) => {
                // SAFETY: as above.
                call(|e, n| unsafe { (api.output_set_int)(handle, part, name.as_ptr(), *value, e, n) })
            }
            MetaValue::Number(value) => {
                // SAFETY: as above.
                call(|e, n| unsafe { (api.output_set_float)(handle, part, name.as_ptr(), *value, e, n) })
            }
            MetaValue::Matrix(rows) => {
                // SAFETY: as above; the matrix has 16 floats.
                call(|e, n| unsafe { (api.output_set_matrix)(handle, part, name.as_ptr(), rows.as_ptr(), e, n) })
            }
        };
        result.map_err(|failure| failure.message)
    }

    fn write(&mut self, parts: &[Part], values: &RowSource<'_>) -> Result<(), String> {
        // SAFETY: as above.
        call(|e, n| unsafe { (self.api.output_open)(self.handle, e, n) }).map_err(|f| f.message)?;
        for (index, part) in parts.iter().enumerate() {
            let mut begin = 0;
            while begin < part.height {
                let rows = begin..part.height.min(begin + ROWS_AT_ONCE);
                let data = values(index, rows.clone());
                let expected = part.width.checked_mul(rows.len()).and_then(|n| n.checked_mul(part.channels.len()));
                if expected != Some(data.len()) {
                    return Err("the number of values does not fit the size of the image".to_owned());
                }
                let (first, count) = (rows.start as i32, data.len() as u64);
                // SAFETY: `data` holds `count` floats, which is rows × width × channels by the check above.
                call(|e, n| unsafe {
                    let write = self.api.output_write;
                    write(self.handle, index as i32, first, rows.len() as i32, data.as_ptr(), count, e, n)
                })
                .map_err(|f| f.message)?;
                begin = rows.end;
            }
        }
        // SAFETY: as above. Data are flushed here, so a full disk is reported.
        call(|e, n| unsafe { (self.api.output_close)(self.handle, e, n) }).map_err(|f| f.message)
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        // SAFETY: the handle is live and freed once.
        unsafe { (self.api.output_free)(self.handle) };
    }
}

/// Rows that are written together. OpenEXR compresses 16 rows per thread.
pub const ROWS_AT_ONCE: usize = 64;

/// Computes the values of some rows of a part, interleaved. Called for one part after the other, with rows in order.
pub type RowSource<'a> = dyn Fn(usize, Range<usize>) -> Cow<'a, [f32]> + 'a;

/// Writes an image; several parts in EXR only. On failure, no file appears under the name.
pub fn write_image(path: &Path, parts: &[Part]) -> Result<(), ImageError> {
    let values = |part: usize, rows: Range<usize>| {
        let Part { width, channels, data, .. } = &parts[part];
        let row = width * channels.len();
        // Missing values are detected at the last row; superfluous ones as well
        let end = if rows.end == parts[part].height { data.len() } else { data.len().min(row * rows.end) };
        Cow::Borrowed(&data[end.min(row * rows.start)..end])
    };
    write_rows(path, parts, &values)
}

/// Writes an image whose values are computed on demand. The parts have no data.
pub fn write_rows(path: &Path, parts: &[Part], values: &RowSource<'_>) -> Result<(), ImageError> {
    // The temporary file keeps the extension, which determines the format
    write_whole(path, |file| write_to(file.path(), parts, values).map_err(io::Error::other))
        .map_err(|e| ImageError::Write { path: path.to_owned(), reason: e.to_string() })
}

fn write_to(path: &Path, parts: &[Part], values: &RowSource<'_>) -> Result<(), String> {
    let mut output = Output::create(path)?;
    let is_exr = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"));
    for (index, part) in (0_i32..).zip(parts) {
        output.add_part(index, part, is_exr)?;
    }
    output.write(parts, values)
}

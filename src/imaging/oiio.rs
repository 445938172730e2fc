//! Image files, by OpenImageIO: the safe layer over the shim.
//!
//! OpenImageIO is loaded when the first image is read or written. Reading refuses images whose header requests more
//! memory than the caller allows; writing goes to a temporary file beside the target, which is renamed at the end, so
//! that a failure never leaves a partial image under the name. Equal images give equal files: a date is written only if
//! the caller gives one (`DateTime`), since OpenImageIO would fill in the current time.
#![allow(unsafe_code)]

pub use super::file::{ImageError, PartHeader, ReadLimits, Window};
use super::{ColorEncoding, Image};
use lumiris_formats::output::write_whole;
use openimageio_sys as sys;
use std::collections::BTreeMap;
use std::ffi::{CStr, CString, c_char};
use std::io;
use std::path::Path;
use std::ptr;
use std::sync::OnceLock;

/// What stands for a date where there is none.
const NO_DATE: &str = "1970:01:01 00:00:00";

/// How the values of a part are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Storage {
    /// 8-bit integers for 0..1.
    Bytes,
    /// 16-bit floats: 11 significant bits, up to 65504.
    Half,
    /// 32-bit floats.
    Float,
}

impl Storage {
    fn format(self) -> i32 {
        match self {
            Storage::Bytes => sys::OIIO_FORMAT_U8,
            Storage::Half => sys::OIIO_FORMAT_HALF,
            Storage::Float => sys::OIIO_FORMAT_FLOAT,
        }
    }

    /// What holds the values of a format: a float, where it is none of the others.
    fn of_format(format: i32) -> Self {
        match format {
            sys::OIIO_FORMAT_U8 => Storage::Bytes,
            sys::OIIO_FORMAT_HALF => Storage::Half,
            _ => Storage::Float,
        }
    }
}

/// A value of metadata.
#[derive(Clone, Debug, PartialEq)]
pub enum MetaValue {
    /// Text.
    Text(String),
    /// An integer.
    Integer(i32),
    /// A number.
    Number(f32),
    /// A matrix for row vectors, row by row.
    Matrix([f32; 16]),
}

/// An image as read.
#[derive(Clone, Debug)]
pub struct ReadImage {
    /// The pixels: integers of the file are 0..1 here, and nothing is decoded.
    pub image: Image,
    /// The usual encoding of such a file: sRGB for 8-bit and 16-bit integers, linear for everything else.
    pub encoding: ColorEncoding,
    /// Metadata by name, as text.
    pub metadata: BTreeMap<String, String>,
    /// Number of parts in the file.
    pub parts: usize,
    /// Where the pixels lie in the full image.
    pub window: Window,
    /// The values are stored as 16-bit floats.
    pub is_half: bool,
}

/// An image to write: one part of a file.
#[derive(Clone, Debug)]
pub struct Part {
    width: usize,
    height: usize,
    channels: Vec<String>,
    data: Vec<f32>,
    metadata: Vec<(String, MetaValue)>,
    /// Column and row of the first pixel inside the full image.
    origin: [usize; 2],
    /// Size of the full image.
    full: [usize; 2],
    storage: Storage,
    /// Storage of channels that differ from `storage`.
    channel_storage: Vec<(usize, Storage)>,
    name: Option<String>,
    compression: Option<String>,
}

impl Part {
    /// Linear values, stored as f32. `data` is row-major from the top left, channels interleaved.
    pub fn linear(width: usize, height: usize, channels: Vec<String>, data: Vec<f32>) -> Self {
        Part {
            width,
            height,
            channels,
            data,
            metadata: Vec::new(),
            origin: [0, 0],
            full: [width, height],
            storage: Storage::Float,
            channel_storage: Vec::new(),
            name: None,
            compression: None,
        }
    }

    /// Values for a display, 0..1, stored in 8 bits.
    pub fn display(width: usize, height: usize, channels: Vec<String>, data: Vec<f32>) -> Self {
        Part { storage: Storage::Bytes, ..Part::linear(width, height, channels, data) }
    }

    /// Adds metadata that is text.
    #[must_use]
    pub fn with_metadata(mut self, metadata: Vec<(String, String)>) -> Self {
        self.metadata.extend(metadata.into_iter().map(|(name, value)| (name, MetaValue::Text(value))));
        self
    }

    /// Adds metadata.
    #[must_use]
    pub fn with_value(mut self, name: &str, value: MetaValue) -> Self {
        self.metadata.push((name.to_owned(), value));
        self
    }

    /// Names the part, which files of several parts need.
    #[must_use]
    pub fn named(mut self, name: &str) -> Self {
        self.name = Some(name.to_owned());
        self
    }

    /// Chooses how all channels are stored.
    #[must_use]
    pub fn stored_as(mut self, storage: Storage) -> Self {
        (self.storage, self.channel_storage) = (storage, Vec::new());
        self
    }

    /// Chooses how some channels are stored (EXR only). Unknown names are ignored.
    #[must_use]
    pub fn channels_stored_as(mut self, names: &[&str], storage: Storage) -> Self {
        let found = self.channels.iter().enumerate().filter(|(_, name)| names.contains(&name.as_str()));
        self.channel_storage.extend(found.map(|(i, _)| (i, storage)));
        self
    }

    /// Chooses the compression, as OpenImageIO names it: `piz`, `dwaa:45`, `jpeg:90`. EXR files use `zip` by default.
    #[must_use]
    pub fn compressed_by(mut self, compression: &str) -> Self {
        self.compression = Some(compression.to_owned());
        self
    }

    /// Says which part of a larger image this is.
    #[must_use]
    pub fn with_window(mut self, origin: [usize; 2], full: [usize; 2]) -> Self {
        (self.origin, self.full) = (origin, full);
        self
    }
}

/// The shim; its threads are kept to one, since images are read in parallel already.
fn api() -> Result<&'static sys::Api, ImageError> {
    static CONFIGURED: OnceLock<()> = OnceLock::new();
    let api = sys::load().map_err(ImageError::Library)?;
    CONFIGURED.get_or_init(|| {
        for (name, value) in [(c"threads", 1), (c"exr_threads", 1)] {
            // A version that lacks the attribute goes on as it is.
            // SAFETY: the name ends in a zero byte; a null message buffer of size 0 is not written.
            let _ = call(|e, n| unsafe { (api.set_int)(name.as_ptr(), value, e, n) });
        }
    });
    Ok(api)
}

/// Calls a function of the shim; `Err` holds its code and message.
fn call(f: impl FnOnce(*mut c_char, usize) -> i32) -> Result<(), (i32, String)> {
    let mut message = [0 as c_char; 1024];
    match f(message.as_mut_ptr(), message.len()) {
        sys::OIIO_OK => Ok(()),
        code => Err((code, text(message.as_ptr()))),
    }
}

/// A string of the shim.
fn text(string: *const c_char) -> String {
    if string.is_null() {
        return String::new();
    }
    // SAFETY: strings of the shim end in a zero byte and live while their handle does, and the bytes are copied here.
    unsafe { CStr::from_ptr(string) }.to_string_lossy().into_owned()
}

fn c_text(text: &str) -> Result<CString, String> {
    CString::new(text).map_err(|_| format!("{text:?} holds a zero byte"))
}

fn c_path(path: &Path) -> Result<CString, String> {
    CString::new(path.as_os_str().as_encoded_bytes()).map_err(|_| "the name holds a zero byte".to_owned())
}

/// A file open for reading.
pub(super) struct Input {
    api: &'static sys::Api,
    handle: *mut sys::OiioInput,
    part: i32,
}

impl Input {
    pub(super) fn open(path: &Path, part: i32) -> Result<Self, ImageError> {
        let unreadable = |reason: String| ImageError::Unreadable { path: path.to_owned(), reason };
        match path.metadata() {
            Ok(metadata) if metadata.is_dir() => return Err(unreadable("is a folder".to_owned())),
            Ok(_) => {}
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Err(ImageError::NotFound { path: path.to_owned() });
            }
            Err(error) => return Err(unreadable(error.to_string())),
        }
        let api = api()?;
        let name = c_path(path).map_err(unreadable)?;
        let mut handle = ptr::null_mut();
        // SAFETY: the name ends in a zero byte, and `handle` is only written. Alpha stays unassociated: colours of
        // textures must not be multiplied by it in 8 bits.
        call(|e, n| unsafe { (api.input_open)(name.as_ptr(), 1, &mut handle, e, n) })
            .map_err(|(_, m)| unreadable(m))?;
        Ok(Input { api, handle, part })
    }

    fn parts(&self) -> Result<usize, (i32, String)> {
        let mut count = 0;
        // SAFETY: the handle is live until drop, here and below.
        call(|e, n| unsafe { (self.api.input_subimages)(self.handle, &mut count, e, n) })?;
        Ok(usize::try_from(count).unwrap_or(0))
    }

    fn spec(&self) -> Result<sys::OiioSpec, (i32, String)> {
        let mut spec = sys::OiioSpec::default();
        // SAFETY: as above.
        call(|e, n| unsafe { (self.api.input_spec)(self.handle, self.part, &mut spec, e, n) })?;
        Ok(spec)
    }

    fn channel(&self, index: i32) -> Result<(String, Storage), (i32, String)> {
        let (mut name, mut format) = (ptr::null(), 0);
        // SAFETY: as above; the name is copied while the handle is live.
        call(|e, n| unsafe { (self.api.input_channel)(self.handle, self.part, index, &mut name, &mut format, e, n) })?;
        Ok((text(name), Storage::of_format(format)))
    }

    fn channels(&self, count: i32) -> Result<Vec<String>, (i32, String)> {
        (0..count).map(|i| self.channel(i).map(|(name, _)| name)).collect()
    }

    /// How the channels of the part are stored.
    pub(super) fn storage(&self) -> Result<Vec<Storage>, (i32, String)> {
        (0..self.spec()?.nchannels).map(|i| self.channel(i).map(|(_, storage)| storage)).collect()
    }

    /// The metadata of the part whose types [`MetaValue`] has.
    pub(super) fn values(&self) -> Result<Vec<(String, MetaValue)>, (i32, String)> {
        let value = |a: &sys::OiioAttribute| {
            let bytes: &[u8] = if a.data.is_null() {
                &[]
            } else {
                // SAFETY: the shim says that so many bytes are there; they are copied while the handle is live.
                unsafe { std::slice::from_raw_parts(a.data.cast(), a.bytes) }
            };
            let words: Vec<[u8; 4]> = bytes.as_chunks().0.to_vec();
            match (text(a.r#type).as_str(), &words[..]) {
                ("string", _) => Some(MetaValue::Text(text(a.value))),
                ("int", [word]) => Some(MetaValue::Integer(i32::from_ne_bytes(*word))),
                ("float", [word]) => Some(MetaValue::Number(f32::from_ne_bytes(*word))),
                ("matrix", words) => {
                    let rows: Vec<f32> = words.iter().map(|word| f32::from_ne_bytes(*word)).collect();
                    rows.try_into().ok().map(MetaValue::Matrix)
                }
                _ => None,
            }
        };
        let entries =
            (0..self.spec()?.attributes).filter_map(|i| self.attribute(i, |a| Some((text(a.name), value(a)?))));
        Ok(entries.collect())
    }

    fn metadata(&self, count: i32) -> BTreeMap<String, String> {
        let entry = |index| self.attribute(index, |a| Some((text(a.name), text(a.value))));
        (0..count).filter_map(entry).collect()
    }

    /// What `read` makes of an entry of metadata.
    fn attribute<T>(&self, index: i32, read: impl FnOnce(&sys::OiioAttribute) -> Option<T>) -> Option<T> {
        let mut a = sys::OiioAttribute {
            name: ptr::null(),
            r#type: ptr::null(),
            value: ptr::null(),
            data: ptr::null(),
            bytes: 0,
        };
        // SAFETY: as above; `read` copies what it needs while the handle is live.
        call(|e, n| unsafe { (self.api.input_attribute)(self.handle, self.part, index, &mut a, e, n) }).ok()?;
        read(&a)
    }

    fn pixels(&self, max_bytes: u64) -> Result<Vec<f32>, (i32, String)> {
        let mut count = 0;
        // SAFETY: as above.
        call(|e, n| unsafe { (self.api.input_float_count)(self.handle, self.part, max_bytes, &mut count, e, n) })?;
        let mut pixels = vec![0.0; count as usize];
        // SAFETY: `pixels` holds `count` floats.
        call(|e, n| unsafe { (self.api.input_read)(self.handle, self.part, pixels.as_mut_ptr(), count, e, n) })?;
        Ok(pixels)
    }
}

impl Drop for Input {
    fn drop(&mut self) {
        // SAFETY: the handle is live and closed once.
        unsafe { (self.api.input_close)(self.handle) };
    }
}

/// Reads the first part of an image.
pub fn read_image(path: &Path, limits: &ReadLimits) -> Result<ReadImage, ImageError> {
    read_part(path, 0, limits)
}

/// Reads a part of an image, counted from 0.
pub fn read_part(path: &Path, part: usize, limits: &ReadLimits) -> Result<ReadImage, ImageError> {
    let input = Input::open(path, i32::try_from(part).unwrap_or(i32::MAX))?;
    let failed = |failure| read_failure(path, failure);
    let parts = input.parts().map_err(failed)?;
    if part >= parts {
        return Err(failed((sys::OIIO_INVALID_ARGUMENT, format!("has {parts} parts, none of number {part}"))));
    }
    let spec = input.spec().map_err(failed)?;
    let data = input.pixels(limits.bytes_for(path.metadata().map_or(0, |m| m.len()))).map_err(failed)?;
    let channels = input.channels(spec.nchannels).map_err(failed)?;
    let metadata = input.metadata(spec.attributes);
    let is_integer = matches!(spec.format, sys::OIIO_FORMAT_U8 | sys::OIIO_FORMAT_U16);
    let encoding = if is_integer { ColorEncoding::Srgb } else { ColorEncoding::Linear };
    // The header was checked against the pixels by the shim: the sizes are positive.
    let image = Image { width: spec.width as usize, height: spec.height as usize, channels, data };
    let size = |n: i32| usize::try_from(n).unwrap_or(0);
    let window = Window {
        origin: [spec.x, spec.y],
        full_origin: [spec.full_x, spec.full_y],
        full_size: [size(spec.full_width), size(spec.full_height)],
    };
    Ok(ReadImage { image, encoding, metadata, parts, window, is_half: spec.format == sys::OIIO_FORMAT_HALF })
}

/// Reads the metadata of the first part of an image, as text by name, and no pixels.
pub fn read_metadata(path: &Path) -> Result<BTreeMap<String, String>, ImageError> {
    let input = Input::open(path, 0)?;
    let spec = input.spec().map_err(|failure| read_failure(path, failure))?;
    Ok(input.metadata(spec.attributes))
}

/// Reads the headers of all parts of an image, and no pixels.
pub fn read_headers(path: &Path) -> Result<Vec<PartHeader>, ImageError> {
    let mut input = Input::open(path, 0)?;
    let failed = |failure| read_failure(path, failure);
    let parts = input.parts().map_err(failed)?;
    let mut headers = Vec::with_capacity(parts);
    for part in 0..parts {
        input.part = i32::try_from(part).unwrap_or(i32::MAX);
        let spec = input.spec().map_err(failed)?;
        let channels = input.channels(spec.nchannels).map_err(failed)?;
        let name = input.metadata(spec.attributes).remove("oiio:subimagename").unwrap_or_default();
        headers.push(PartHeader { name, channels });
    }
    Ok(headers)
}

pub(super) fn read_failure(path: &Path, (code, reason): (i32, String)) -> ImageError {
    let path = path.to_owned();
    match code {
        sys::OIIO_TOO_LARGE => ImageError::TooLarge { path, reason },
        _ => ImageError::Unreadable { path, reason },
    }
}

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
        call(|e, n| unsafe { (api.output_create)(name.as_ptr(), &mut handle, e, n) }).map_err(|(_, m)| m)?;
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
        let compression = part.compression.as_deref().or(is_exr.then_some("zip")).map(c_text).transpose()?;
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
        call(|e, n| unsafe { (self.api.output_add_part)(self.handle, &description, e, n) }).map_err(|(_, m)| m)?;

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
        result.map_err(|(_, message)| message)
    }

    fn write(&mut self, parts: &[Part]) -> Result<(), String> {
        // SAFETY: as above.
        call(|e, n| unsafe { (self.api.output_open)(self.handle, e, n) }).map_err(|(_, m)| m)?;
        for (index, part) in parts.iter().enumerate() {
            let expected = part.width.checked_mul(part.height).and_then(|n| n.checked_mul(part.channels.len()));
            if expected != Some(part.data.len()) {
                return Err("the number of values does not fit the size of the image".to_owned());
            }
            let (rows, count) = (part.height as i32, part.data.len() as u64);
            // SAFETY: `data` holds `count` floats, which is rows × width × channels by the check above.
            call(|e, n| unsafe {
                (self.api.output_write)(self.handle, index as i32, 0, rows, part.data.as_ptr(), count, e, n)
            })
            .map_err(|(_, m)| m)?;
        }
        // SAFETY: as above; what was written is flushed, and a full disk shows here.
        call(|e, n| unsafe { (self.api.output_close)(self.handle, e, n) }).map_err(|(_, m)| m)
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        // SAFETY: the handle is live and freed once.
        unsafe { (self.api.output_free)(self.handle) };
    }
}

/// Writes an image; several parts in EXR only. Either the whole file appears under its name, or none.
pub fn write_image(path: &Path, parts: &[Part]) -> Result<(), ImageError> {
    // The extension chooses the format: the file on its way has the same
    write_whole(path, |file| write_to(file.path(), parts).map_err(io::Error::other))
        .map_err(|e| ImageError::Write { path: path.to_owned(), reason: e.to_string() })
}

fn write_to(path: &Path, parts: &[Part]) -> Result<(), String> {
    let mut output = Output::create(path)?;
    let is_exr = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"));
    for (index, part) in (0_i32..).zip(parts) {
        output.add_part(index, part, is_exr)?;
    }
    output.write(parts)
}

/// A view of an OpenColorIO configuration.
#[derive(Clone, Copy, Debug)]
pub struct OcioView<'a> {
    /// Colour space of the pixels.
    pub input: &'a str,
    /// Display; the configuration's default if it is empty.
    pub display: &'a str,
    /// View; the display's default if it is empty.
    pub view: &'a str,
    /// Looks; the view's own if it is empty.
    pub looks: &'a str,
}

/// Turns RGB triples into the colours of a display, by the configuration that the environment variable OCIO names.
/// Returns display and view.
pub fn ocio_display(pixels: &mut [f32], view: &OcioView<'_>) -> Result<[String; 2], ImageError> {
    let api = api()?;
    let [input, display, name, looks] =
        [view.input, view.display, view.view, view.looks].map(|text| c_text(text).map_err(ImageError::Color));
    let (input, display, name, looks) = (input?, display?, name?, looks?);
    let mut chosen = [0 as c_char; 512];
    let (data, count, chosen_size) = (pixels.as_mut_ptr(), pixels.len() as u64, chosen.len());
    // SAFETY: the names end in a zero byte, `data` holds `count` floats, and `chosen` as many bytes as it says.
    call(|e, n| unsafe {
        let [input, display, name, looks] = [&input, &display, &name, &looks].map(|text| text.as_ptr());
        (api.ocio_display)(input, display, name, looks, data, count, chosen.as_mut_ptr(), chosen_size, e, n)
    })
    .map_err(|(_, message)| ImageError::Color(message))?;
    let chosen = text(chosen.as_ptr());
    let (display, view) = chosen.split_once('\n').unwrap_or((&chosen, ""));
    Ok([display.to_owned(), view.to_owned()])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(names: &[&str]) -> Vec<String> {
        names.iter().map(|&n| n.to_owned()).collect()
    }

    #[test]
    fn exr_keeps_floats_metadata_and_windows() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let data: Vec<f32> = (0..24).map(|i| i as f32 * 0.37 - 2.0).collect();
        let part = Part::linear(3, 2, names(&["R", "G", "B", "depth.Z"]), data.clone())
            .with_metadata(vec![("lumiris:seed".to_owned(), "7".to_owned())])
            .with_window([4, 5], [30, 20]);
        write_image(&path, &[part]).unwrap();
        let read = read_image(&path, &ReadLimits::default()).unwrap();
        assert_eq!((read.image.width, read.image.height), (3, 2));
        for (i, name) in ["R", "G", "B", "depth.Z"].iter().enumerate() {
            let c = read.image.channel(name).unwrap();
            for pixel in 0..6 {
                assert_eq!(read.image.data[pixel * 4 + c], data[pixel * 4 + i]);
            }
        }
        assert_eq!(read.metadata.get("lumiris:seed").map(String::as_str), Some("7"));
        assert_eq!(read.encoding, ColorEncoding::Linear);
        assert_eq!(read.window, Window { origin: [4, 5], full_origin: [0, 0], full_size: [30, 20] });
        // Nothing is left beside it.
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn an_exr_holds_parts_with_names_half_floats_and_values() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let beauty: Vec<f32> = (0..6 * 4).map(|i| (i as f32 * 0.7).exp2() * 1e-3).collect();
        let albedo: Vec<f32> = (0..6 * 3).map(|i| i as f32 / 17.0).collect();
        let matrix = std::array::from_fn(|i| i as f32 * 0.25);
        let first = Part::linear(3, 2, names(&["R", "G", "B", "Z"]), beauty.clone())
            .named("beauty")
            .channels_stored_as(&["R", "G", "B"], Storage::Half)
            .with_value("lumiris:samples", MetaValue::Integer(64))
            .with_value("lumiris:exposure", MetaValue::Number(0.5))
            .with_value("lumiris:world_from_camera", MetaValue::Matrix(matrix));
        let second = Part::linear(3, 2, names(&["albedo.R", "albedo.G", "albedo.B"]), albedo.clone())
            .named("albedo")
            .stored_as(Storage::Half)
            .compressed_by("piz");
        write_image(&path, &[first.clone(), second.clone()]).unwrap();

        let limits = ReadLimits::default();
        let read = read_image(&path, &limits).unwrap();
        assert_eq!(read.parts, 2);
        for (channel, name) in ["R", "G", "B", "Z"].iter().enumerate() {
            let c = read.image.channel(name).unwrap();
            for pixel in 0..6 {
                let (wrote, found) = (beauty[pixel * 4 + channel], read.image.data[pixel * 4 + c]);
                let tolerance = if *name == "Z" { 0.0 } else { wrote / 2048.0 };
                assert!((wrote - found).abs() <= tolerance, "{name} {wrote} {found}");
            }
        }
        let value = |name: &str| read.metadata.get(name).map(String::as_str);
        assert_eq!(value("lumiris:samples"), Some("64"));
        assert_eq!(value("lumiris:exposure"), Some("0.5"));
        assert!(value("lumiris:world_from_camera").unwrap().contains("3.75"));
        assert_eq!(value("oiio:subimagename"), Some("beauty"));
        assert_eq!(value("compression"), Some("zip"));
        assert_eq!(value("DateTime"), Some(NO_DATE));

        let headers = read_headers(&path).unwrap();
        assert_eq!(headers.iter().map(|h| h.name.as_str()).collect::<Vec<_>>(), ["beauty", "albedo"]);
        assert!(headers[0].channels.contains(&"Z".to_owned()) && headers[1].channels.len() == 3);
        let read = read_part(&path, 1, &limits).unwrap();
        assert!(read.is_half);
        assert_eq!(read.metadata["compression"], "piz");
        let g = read.image.channel("albedo.G").unwrap();
        assert!((0..6).all(|p| (read.image.data[p * 3 + g] - albedo[p * 3 + 1]).abs() < 1e-3));
        let error = read_part(&path, 2, &limits).unwrap_err();
        assert!(matches!(&error, ImageError::Unreadable { .. }) && error.to_string().contains("2 parts"), "{error}");

        // The same parts give the same bytes.
        let again = folder.path().join("b.exr");
        write_image(&again, &[first, second]).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), std::fs::read(&again).unwrap());
    }

    #[test]
    fn damaged_and_refused_files_are_errors_in_every_format() {
        let folder = tempfile::tempdir().unwrap();
        let data: Vec<f32> = (0..40 * 30 * 3).map(|i| (i % 251) as f32 / 250.0).collect();
        for extension in ["exr", "png", "jpg"] {
            let path = folder.path().join(format!("whole.{extension}"));
            let part = match extension {
                "exr" => Part::linear(40, 30, names(&["R", "G", "B"]), data.clone()),
                _ => Part::display(40, 30, names(&["R", "G", "B"]), data.clone()),
            };
            write_image(&path, std::slice::from_ref(&part)).unwrap();
            assert_eq!(read_image(&path, &ReadLimits::default()).unwrap().image.data.len(), data.len());
            let bytes = std::fs::read(&path).unwrap();
            for length in [0, 10, 100] {
                std::fs::write(&path, &bytes[..length]).unwrap();
                let error = read_image(&path, &ReadLimits::default()).unwrap_err();
                assert!(error.to_string().contains("whole."), "{error}");
            }

            // Not a folder that can be written to; a folder in the file's place.
            let error = write_image(&path.join("below.exr"), std::slice::from_ref(&part)).unwrap_err();
            assert!(matches!(error, ImageError::Write { .. }), "{error}");
            let taken = folder.path().join(format!("taken.{extension}"));
            std::fs::create_dir(&taken).unwrap();
            assert!(write_image(&taken, &[part]).is_err());
            assert!(taken.is_dir());
        }
        let left = std::fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(left, 6, "no partial file is left");
        let error = write_image(&folder.path().join("a.unknown"), &[]).unwrap_err();
        assert!(matches!(error, ImageError::Write { .. }), "{error}");
    }

    #[test]
    fn png_keeps_eight_bits_and_is_taken_as_srgb() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let data: Vec<f32> = (0..12).map(|i| i as f32 / 11.0).collect();
        write_image(&path, &[Part::display(2, 2, names(&["R", "G", "B"]), data.clone())]).unwrap();
        let read = read_image(&path, &ReadLimits::default()).unwrap();
        assert_eq!(read.encoding, ColorEncoding::Srgb);
        assert!(read.image.data.iter().zip(&data).all(|(a, b)| (a - b).abs() <= 0.5 / 255.0 + 1e-6));
    }

    #[test]
    fn failures_say_what_and_leave_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let limits = ReadLimits::default();
        assert!(matches!(read_image(&folder.path().join("no.exr"), &limits), Err(ImageError::NotFound { .. })));
        assert!(matches!(read_image(folder.path(), &limits), Err(ImageError::Unreadable { .. })));

        let path = folder.path().join("a.exr");
        write_image(&path, &[Part::linear(8, 8, names(&["Y"]), vec![0.5; 64])]).unwrap();
        assert!(matches!(
            read_image(&path, &ReadLimits { max_bytes: 100, ..limits }),
            Err(ImageError::TooLarge { .. })
        ));
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        assert!(matches!(read_image(&path, &limits), Err(ImageError::Unreadable { .. })));

        let good = std::fs::read(&path).unwrap();
        let wrong = Part::linear(8, 8, names(&["Y"]), vec![0.5; 3]);
        assert!(matches!(write_image(&path, &[wrong]), Err(ImageError::Write { .. })));
        assert_eq!(std::fs::read(&path).unwrap(), good, "a failed write leaves the old file");
        assert!(write_image(&folder.path().join("no/where.exr"), &[]).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}

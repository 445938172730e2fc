//! A small safe layer for the tests.
#![allow(dead_code, reason = "each test binary uses a part of it")]

use openimageio_sys::*;
use std::collections::BTreeMap;
use std::ffi::{CStr, CString, c_char};
use std::path::{Path, PathBuf};
use std::ptr;

/// Memory limit for the tests' images (bytes).
pub const LIMIT: u64 = 1 << 28;

pub fn api() -> &'static Api {
    load().unwrap()
}

/// A file in cargo's folder for temporary files of tests.
pub fn temp(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// Calls a function with a buffer for the error message.
pub fn check(call: impl FnOnce(*mut c_char, usize) -> i32) -> Result<(), (i32, String)> {
    let mut message = [0 as c_char; 512];
    let code = call(message.as_mut_ptr(), message.len());
    if code == OIIO_OK {
        return Ok(());
    }
    Err((code, string(message.as_ptr())))
}

pub fn c(text: &str) -> CString {
    CString::new(text).unwrap()
}

pub fn string(text: *const c_char) -> String {
    // SAFETY: the shim's strings end in a zero byte.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

/// A file open for reading.
pub struct Input(*mut OiioInput);

impl Input {
    pub fn open(path: &Path, unassociated: bool) -> Result<Input, (i32, String)> {
        let path = c(path.to_str().unwrap());
        let mut input = ptr::null_mut();
        // SAFETY: the path ends in a zero byte, and `input` is written only.
        check(|e, n| unsafe { (api().input_open)(path.as_ptr(), i32::from(unassociated), &mut input, e, n) })?;
        Ok(Input(input))
    }

    pub fn format_name(&self) -> String {
        // SAFETY: the handle is live.
        string(unsafe { (api().input_format_name)(self.0) })
    }

    pub fn subimages(&self) -> Result<i32, (i32, String)> {
        let mut count = 0;
        // SAFETY: the handle is live, as in all calls below.
        check(|e, n| unsafe { (api().input_subimages)(self.0, &mut count, e, n) })?;
        Ok(count)
    }

    pub fn spec(&self, subimage: i32) -> Result<OiioSpec, (i32, String)> {
        let mut spec = OiioSpec::default();
        // SAFETY: as above.
        check(|e, n| unsafe { (api().input_spec)(self.0, subimage, &mut spec, e, n) })?;
        Ok(spec)
    }

    pub fn channels(&self, subimage: i32) -> Vec<(String, i32)> {
        let channel = |index| {
            let (mut name, mut format) = (ptr::null(), 0);
            // SAFETY: as above.
            check(|e, n| unsafe { (api().input_channel)(self.0, subimage, index, &mut name, &mut format, e, n) })
                .unwrap();
            (string(name), format)
        };
        (0..self.spec(subimage).unwrap().nchannels).map(channel).collect()
    }

    /// Type and value of each attribute.
    pub fn attributes(&self, subimage: i32) -> BTreeMap<String, (String, String)> {
        let attribute = |index| {
            let a = self.attribute(subimage, index);
            (string(a.name), (string(a.r#type), string(a.value)))
        };
        (0..self.spec(subimage).unwrap().attributes).map(attribute).collect()
    }

    /// The raw floats of an attribute.
    pub fn floats(&self, subimage: i32, name: &str) -> Vec<f32> {
        let count = self.spec(subimage).unwrap().attributes;
        let mut all = (0..count).map(|index| self.attribute(subimage, index));
        let found = all.find(|a| string(a.name) == name).unwrap();
        // SAFETY: `data` holds `bytes` bytes, and is read before the input is closed.
        let bytes = unsafe { std::slice::from_raw_parts(found.data.cast::<u8>(), found.bytes) };
        bytes.chunks_exact(4).map(|b| f32::from_ne_bytes(b.try_into().unwrap())).collect()
    }

    fn attribute(&self, subimage: i32, index: i32) -> OiioAttribute {
        let mut attribute =
            OiioAttribute { name: ptr::null(), r#type: ptr::null(), value: ptr::null(), data: ptr::null(), bytes: 0 };
        // SAFETY: as above.
        check(|e, n| unsafe { (api().input_attribute)(self.0, subimage, index, &mut attribute, e, n) }).unwrap();
        attribute
    }

    pub fn read(&self, subimage: i32, max_bytes: u64) -> Result<Vec<f32>, (i32, String)> {
        let mut count = 0;
        // SAFETY: as above.
        check(|e, n| unsafe { (api().input_value_count)(self.0, subimage, max_bytes, &mut count, e, n) })?;
        let OiioSpec { width, height, nchannels, .. } = self.spec(subimage)?;
        let mut values = vec![0.0_f32; count as usize];
        let (read, out) = (api().input_read_region, values.as_mut_ptr().cast());
        // SAFETY: `values` holds `count` floats.
        check(|e, n| unsafe {
            read(self.0, subimage, 0, 0, 0, width, height, 0, nchannels, OIIO_FORMAT_FLOAT, out, count, e, n)
        })?;
        Ok(values)
    }
}

impl Drop for Input {
    fn drop(&mut self) {
        // SAFETY: the handle is live and closed once.
        unsafe { (api().input_close)(self.0) };
    }
}

/// One part to write.
pub struct Part<'a> {
    pub name: &'a str,
    pub compression: &'a str,
    pub width: i32,
    pub height: i32,
    pub channels: &'a [(&'a str, i32)],
}

/// A file being written.
pub struct Output(pub *mut OiioOutput);

impl Output {
    /// Creates a file with its parts, without opening it.
    pub fn create(path: &Path, parts: &[Part<'_>]) -> Result<Output, (i32, String)> {
        let path = c(path.to_str().unwrap());
        let mut output = ptr::null_mut();
        // SAFETY: the path ends in a zero byte, and `output` is written only.
        check(|e, n| unsafe { (api().output_create)(path.as_ptr(), &mut output, e, n) })?;
        let output = Output(output);
        for part in parts {
            let (name, compression) = (c(part.name), c(part.compression));
            let names: Vec<CString> = part.channels.iter().map(|channel| c(channel.0)).collect();
            let pointers: Vec<*const c_char> = names.iter().map(|name| name.as_ptr()).collect();
            let formats: Vec<i32> = part.channels.iter().map(|channel| channel.1).collect();
            let optional = |text: &CString| if text.is_empty() { ptr::null() } else { text.as_ptr() };
            let part = OiioPart {
                name: optional(&name),
                compression: optional(&compression),
                width: part.width,
                height: part.height,
                x: 0,
                y: 0,
                full_x: 0,
                full_y: 0,
                full_width: 0,
                full_height: 0,
                nchannels: formats.len() as i32,
                channel_names: pointers.as_ptr(),
                channel_formats: formats.as_ptr(),
            };
            // SAFETY: names and formats live until the end of the call.
            check(|e, n| unsafe { (api().output_add_part)(output.0, &part, e, n) })?;
        }
        Ok(output)
    }

    pub fn open(&self) -> Result<(), (i32, String)> {
        // SAFETY: the handle is live, as in all calls below.
        check(|e, n| unsafe { (api().output_open)(self.0, e, n) })
    }

    pub fn write(&self, part: i32, row: i32, rows: i32, pixels: &[f32]) -> Result<(), (i32, String)> {
        let count = pixels.len() as u64;
        // SAFETY: `pixels` holds `count` floats.
        check(|e, n| unsafe { (api().output_write)(self.0, part, row, rows, pixels.as_ptr(), count, e, n) })
    }

    pub fn close(&self) -> Result<(), (i32, String)> {
        // SAFETY: as above.
        check(|e, n| unsafe { (api().output_close)(self.0, e, n) })
    }

    pub fn set_string(&self, part: i32, name: &str, value: &str) {
        let (name, value) = (c(name), c(value));
        // SAFETY: as above; both strings end in a zero byte.
        check(|e, n| unsafe { (api().output_set_string)(self.0, part, name.as_ptr(), value.as_ptr(), e, n) }).unwrap();
    }

    pub fn set_numbers(&self, part: i32) {
        let matrix: Vec<f32> = (0..16).map(|i| i as f32 + 0.1).collect();
        let [int, float, m44] = ["lumiris:samples", "lumiris:time", "lumiris:world_from_camera"].map(c);
        // SAFETY: as above; the matrix has 16 floats.
        unsafe {
            check(|e, n| (api().output_set_int)(self.0, part, int.as_ptr(), 64, e, n)).unwrap();
            check(|e, n| (api().output_set_float)(self.0, part, float.as_ptr(), 0.1, e, n)).unwrap();
            check(|e, n| (api().output_set_matrix)(self.0, part, m44.as_ptr(), matrix.as_ptr(), e, n)).unwrap();
        }
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        // SAFETY: the handle is live and freed once.
        unsafe { (api().output_free)(self.0) };
    }
}

/// Writes an image with one part.
pub fn write_picture(
    path: &Path,
    width: i32,
    height: i32,
    channels: &[(&str, i32)],
    pixels: &[f32],
) -> Result<(), (i32, String)> {
    let part = Part { name: "", compression: "", width, height, channels };
    let output = Output::create(path, &[part])?;
    output.open()?;
    output.write(0, 0, height, pixels)?;
    output.close()
}

/// `count` values in 0…1 without a pattern.
pub fn noise(count: usize) -> Vec<f32> {
    let mut state = 0x9E37_79B9_u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    (0..count).map(|_| next()).collect()
}

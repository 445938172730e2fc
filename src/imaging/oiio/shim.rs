//! Calls of the shim, its strings and its messages.
#![allow(unsafe_code)]

use crate::imaging::file::ImageError;
use openimageio_sys as sys;
use std::ffi::{CStr, CString, c_char};
use std::path::Path;
use std::sync::OnceLock;

/// The shim. It uses one thread, since images are read in parallel already, except for the compression threads of EXR
/// files, which all files share. Their number is set once: if it changes while a file is written, OpenEXR 3.1 loses
/// rows of that file and waits for them forever.
pub(super) fn api() -> Result<&'static sys::Api, ImageError> {
    static CONFIGURED: OnceLock<()> = OnceLock::new();
    let api = sys::load().map_err(ImageError::Library)?;
    CONFIGURED.get_or_init(|| {
        let threads = i32::try_from(rayon::current_num_threads()).unwrap_or(1);
        for (name, value) in [(c"threads", 1), (c"exr_threads", threads)] {
            // Versions without the attribute keep their default
            // SAFETY: the name ends in a zero byte; a null message buffer of size 0 is not written.
            let _ = call(|e, n| unsafe { (api.set_int)(name.as_ptr(), value, e, n) });
        }
    });
    Ok(api)
}

/// Memory of OpenImageIO with its dependencies (bytes), unless they are loaded.
pub fn library_bytes() -> u64 {
    if sys::is_loaded() { 0 } else { 118 << 20 }
}

/// Loads OpenImageIO and its dependencies, unless they are loaded. The first access to an image does so as well.
pub fn load() -> Result<(), ImageError> {
    api().map(|_| ())
}

/// Failure of a call of the shim.
#[derive(Debug)]
pub(in crate::imaging) struct Failure {
    /// One of the codes of the shim, such as [`sys::OIIO_TOO_LARGE`].
    pub(super) code: i32,
    pub(super) message: String,
}

/// Calls a function of the shim.
pub(super) fn call(f: impl FnOnce(*mut c_char, usize) -> i32) -> Result<(), Failure> {
    let mut message = [0 as c_char; 1024];
    match f(message.as_mut_ptr(), message.len()) {
        sys::OIIO_OK => Ok(()),
        code => Err(Failure { code, message: text(message.as_ptr()) }),
    }
}

/// Copies a string of the shim.
pub(super) fn text(string: *const c_char) -> String {
    if string.is_null() {
        return String::new();
    }
    // SAFETY: strings of the shim end in a zero byte and live while their handle does, and the bytes are copied here.
    unsafe { CStr::from_ptr(string) }.to_string_lossy().into_owned()
}

/// Converts a string for the shim.
pub(super) fn c_text(text: &str) -> Result<CString, String> {
    CString::new(text).map_err(|_| format!("{text:?} holds a zero byte"))
}

/// Converts a file name for the shim.
pub(super) fn c_path(path: &Path) -> Result<CString, String> {
    CString::new(path.as_os_str().as_encoded_bytes()).map_err(|_| "the name holds a zero byte".to_owned())
}

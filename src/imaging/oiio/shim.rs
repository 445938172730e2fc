//! Calls of the shim, with its strings and its messages.
#![allow(unsafe_code)]

use crate::imaging::file::ImageError;
use openimageio_sys as sys;
use std::ffi::{CStr, CString, c_char};
use std::path::Path;
use std::sync::OnceLock;

/// The shim. Its threads are kept to one, since images are read in parallel already, but for those that compress rows of EXR
/// files, which all files share. Their number never changes: OpenEXR 3.1 loses rows of a file that is being written
/// when that happens, and waits for them for ever.
pub(super) fn api() -> Result<&'static sys::Api, ImageError> {
    static CONFIGURED: OnceLock<()> = OnceLock::new();
    let api = sys::load().map_err(ImageError::Library)?;
    CONFIGURED.get_or_init(|| {
        let threads = i32::try_from(rayon::current_num_threads()).unwrap_or(1);
        for (name, value) in [(c"threads", 1), (c"exr_threads", threads)] {
            // A version that lacks the attribute goes on as it is.
            // SAFETY: the name ends in a zero byte; a null message buffer of size 0 is not written.
            let _ = call(|e, n| unsafe { (api.set_int)(name.as_ptr(), value, e, n) });
        }
    });
    Ok(api)
}

/// Loads OpenImageIO and all that it is linked with, unless that is done: the first image that is read or written does it as
/// well, and waits for it.
pub fn load() -> Result<(), ImageError> {
    api().map(|_| ())
}

/// Calls a function of the shim; `Err` holds its code and message.
pub(super) fn call(f: impl FnOnce(*mut c_char, usize) -> i32) -> Result<(), (i32, String)> {
    let mut message = [0 as c_char; 1024];
    match f(message.as_mut_ptr(), message.len()) {
        sys::OIIO_OK => Ok(()),
        code => Err((code, text(message.as_ptr()))),
    }
}

/// A string of the shim.
pub(super) fn text(string: *const c_char) -> String {
    if string.is_null() {
        return String::new();
    }
    // SAFETY: strings of the shim end in a zero byte and live while their handle does, and the bytes are copied here.
    unsafe { CStr::from_ptr(string) }.to_string_lossy().into_owned()
}

/// A string for the shim.
pub(super) fn c_text(text: &str) -> Result<CString, String> {
    CString::new(text).map_err(|_| format!("{text:?} holds a zero byte"))
}

/// The name of a file for the shim.
pub(super) fn c_path(path: &Path) -> Result<CString, String> {
    CString::new(path.as_os_str().as_encoded_bytes()).map_err(|_| "the name holds a zero byte".to_owned())
}

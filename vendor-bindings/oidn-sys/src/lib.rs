//! Raw bindings to the part of Open Image Denoise 2 used by Lumiris, loaded at run time.
//!
//! A device runs filters. A filter reads and writes images in the caller's memory, and is committed before it is
//! executed. Objects are reference-counted; their creator releases them once. Functions report errors only through
//! [`Api::get_device_error`].

use libloading::Library;
use std::ffi::{OsStr, c_char, c_int, c_void};

/// Name of the library for the dynamic loader.
pub const LIBRARY_NAME: &str =
    if cfg!(target_os = "macos") { "libOpenImageDenoise.2.dylib" } else { "libOpenImageDenoise.so.2" };

/// The CPU as a device.
pub const OIDN_DEVICE_TYPE_CPU: c_int = 1;
/// Three 32-bit floats per pixel.
pub const OIDN_FORMAT_FLOAT3: c_int = 3;
/// No error.
pub const OIDN_ERROR_NONE: c_int = 0;

/// A device.
#[repr(C)]
#[derive(Debug)]
pub struct OidnDevice {
    _private: [u8; 0],
}

/// A filter of a device.
#[repr(C)]
#[derive(Debug)]
pub struct OidnFilter {
    _private: [u8; 0],
}

/// Declares [`Api`], and the symbol of each function.
macro_rules! api {
    ($(
        $(#[doc = $doc:literal])*
        $symbol:literal fn $name:ident($($arg:ident: $type:ty),* $(,)?) $(-> $result:ty)?;
    )*) => {
        /// The functions. All of them are unsafe to call: names must end in a zero byte, objects must be live, and
        /// images must be valid as described until the filter has been executed.
        #[derive(Clone, Copy, Debug)]
        pub struct Api {
            $($(#[doc = $doc])* pub $name: unsafe extern "C" fn($($arg: $type),*) $(-> $result)?,)*
        }

        impl Api {
            /// Looks up all functions.
            fn from_library(library: &Library) -> Result<Api, libloading::Error> {
                $(
                    // SAFETY: the type is the function's in all versions of the library; the library is never closed.
                    let $name = unsafe {
                        *library.get::<unsafe extern "C" fn($($arg: $type),*) $(-> $result)?>($symbol.as_bytes())?
                    };
                )*
                Ok(Api { $($name),* })
            }
        }
    };
}

api! {
    /// Creates a device of an `OIDN_DEVICE_TYPE_…`; null if there is none.
    "oidnNewDevice\0" fn new_device(device_type: c_int) -> *mut OidnDevice;
    /// Sets an integer parameter: `numThreads`, `verbose`.
    "oidnSetDeviceInt\0" fn set_device_int(device: *mut OidnDevice, name: *const c_char, value: c_int);
    /// Sets a boolean parameter: `setAffinity`.
    "oidnSetDeviceBool\0" fn set_device_bool(device: *mut OidnDevice, name: *const c_char, value: bool);
    /// Gets a parameter: `versionMajor`, `versionMinor`, `versionPatch`.
    "oidnGetDeviceInt\0" fn get_device_int(device: *mut OidnDevice, name: *const c_char) -> c_int;
    /// Commits the device.
    "oidnCommitDevice\0" fn commit_device(device: *mut OidnDevice);
    /// The first error since the last call, with its message, which is valid until the next call. A null device reports
    /// errors of devices that could not be created.
    "oidnGetDeviceError\0" fn get_device_error(device: *mut OidnDevice, message: *mut *const c_char) -> c_int;
    /// Releases a device.
    "oidnReleaseDevice\0" fn release_device(device: *mut OidnDevice);
    /// Creates a filter: `RT`.
    "oidnNewFilter\0" fn new_filter(device: *mut OidnDevice, kind: *const c_char) -> *mut OidnFilter;
    /// Sets an image in the caller's memory: `color`, `albedo`, `normal`, `output`. Strides are in bytes; 0 means no
    /// gaps.
    "oidnSetSharedFilterImage\0" fn set_shared_filter_image(
        filter: *mut OidnFilter, name: *const c_char, data: *mut c_void, format: c_int, width: usize, height: usize,
        offset: usize, pixel_stride: usize, row_stride: usize,
    );
    /// Sets a boolean parameter: `hdr`, `cleanAux`.
    "oidnSetFilterBool\0" fn set_filter_bool(filter: *mut OidnFilter, name: *const c_char, value: bool);
    /// Commits the filter.
    "oidnCommitFilter\0" fn commit_filter(filter: *mut OidnFilter);
    /// Runs the filter to its end.
    "oidnExecuteFilter\0" fn execute_filter(filter: *mut OidnFilter);
    /// Releases a filter.
    "oidnReleaseFilter\0" fn release_filter(filter: *mut OidnFilter);
}

/// Opens the library: a path, or a name for the dynamic loader.
pub fn load(library: &OsStr) -> Result<Api, String> {
    let described = |error: libloading::Error| error.to_string();
    // SAFETY: opening runs the initialisers of the library and of its dependencies, which the user chose by installing
    // or naming it.
    let opened = unsafe { Library::new(library) }.map_err(described)?;
    let api = Api::from_library(&opened)
        .map_err(|error| format!("{} is not Open Image Denoise 2: {error}", library.display()))?;
    // The functions live as long as the process
    std::mem::forget(opened);
    Ok(api)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_such_library_is_an_error_that_names_it() {
        let error = load(OsStr::new("/nowhere/libOpenImageDenoise.so.2")).unwrap_err();
        assert!(error.contains("/nowhere/libOpenImageDenoise.so.2"), "{error}");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn another_library_is_refused_by_the_first_function_that_it_lacks() {
        let error = load(OsStr::new("libm.so.6")).unwrap_err();
        assert!(error.starts_with("libm.so.6 is not Open Image Denoise 2: "), "{error}");
    }
}

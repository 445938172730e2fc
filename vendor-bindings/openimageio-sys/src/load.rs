//! Opens the shim.

use crate::types::{OIIO_SHIM_ABI, OiioAttribute, OiioInput, OiioLevel, OiioOutput, OiioPart, OiioSpec};
use libloading::Library;
use std::env;
use std::ffi::{c_char, c_void};
use std::io::{self, Write};
use std::path::Path;
use std::sync::OnceLock;
use tempfile::NamedTempFile;

/// The shim as built by the build script.
static SHIM: &[u8] = include_bytes!(env!("LUMIRIS_OIIO_SHIM_BUILT"));

/// Declares [`Api`], and looks up each function as `oiio_shim_<name>`.
macro_rules! api {
    ($($(#[doc = $doc:literal])* fn $name:ident($($arg:ident: $type:ty),* $(,)?) $(-> $result:ty)?;)*) => {
        /// The functions of the shim, documented in `shim/oiio_shim.h`. All of them are unsafe to call: pointers must
        /// be valid as described in the header, handles must be live.
        #[derive(Clone, Copy, Debug)]
        pub struct Api {
            $($(#[doc = $doc])* pub $name: unsafe extern "C" fn($($arg: $type),*) $(-> $result)?,)*
        }

        impl Api {
            /// Looks up all functions.
            fn from_library(library: &Library) -> Result<Api, libloading::Error> {
                $(
                    let name = concat!("oiio_shim_", stringify!($name), "\0");
                    // SAFETY: the type is declared in oiio_shim.h, whose version the caller compares before it calls
                    // anything else; the library is never closed.
                    let $name = unsafe {
                        *library.get::<unsafe extern "C" fn($($arg: $type),*) $(-> $result)?>(name.as_bytes())?
                    };
                )*
                Ok(Api { $($name),* })
            }
        }
    };
}

api! {
    /// `OIIO_SHIM_ABI` of the loaded shim.
    fn abi() -> i32;
    /// Version of the loaded OpenImageIO, for instance `2.4.7`. Valid forever.
    fn version() -> *const c_char;
    /// Formats with their extensions: `openexr:exr,sxr,mxr;png:png;…`. Valid forever.
    fn extensions() -> *const c_char;
    /// Sets a global attribute: `threads`, `exr_threads`, `limits:imagesize_MB`, `limits:channels`.
    fn set_int(name: *const c_char, value: i32, error: *mut c_char, error_size: usize) -> i32;

    /// Converts RGB triples of a colour space to display colours, with the configuration named by `$OCIO`. `chosen`
    /// receives the display and the view, one per line.
    fn ocio_display(
        input: *const c_char, display: *const c_char, view: *const c_char, looks: *const c_char,
        pixels: *mut f32, count: u64, chosen: *mut c_char, chosen_size: usize,
        error: *mut c_char, error_size: usize,
    ) -> i32;

    /// Opens a file for reading. `unassociated_alpha` 1: colours as stored, not multiplied by alpha.
    fn input_open(
        path: *const c_char, unassociated_alpha: i32, input: *mut *mut OiioInput,
        error: *mut c_char, error_size: usize,
    ) -> i32;
    /// Name of the file format: `openexr`, `png`, …
    fn input_format_name(input: *mut OiioInput) -> *const c_char;
    /// Number of subimages, at least 1.
    fn input_subimages(
        input: *mut OiioInput, count: *mut i32, error: *mut c_char, error_size: usize,
    ) -> i32;
    /// Header of a subimage.
    fn input_spec(
        input: *mut OiioInput, subimage: i32, spec: *mut OiioSpec,
        error: *mut c_char, error_size: usize,
    ) -> i32;
    /// Name and `OIIO_FORMAT_…` of a channel, in the file's order.
    fn input_channel(
        input: *mut OiioInput, subimage: i32, channel: i32, name: *mut *const c_char,
        format: *mut i32, error: *mut c_char, error_size: usize,
    ) -> i32;
    /// A metadata entry, `0 <= index < spec.attributes`.
    fn input_attribute(
        input: *mut OiioInput, subimage: i32, index: i32, attribute: *mut OiioAttribute,
        error: *mut c_char, error_size: usize,
    ) -> i32;
    /// Number of values of a subimage. Fails if they take more than `max_bytes` as floats, or if the subimage is deep, a
    /// volume, or empty.
    fn input_value_count(
        input: *mut OiioInput, subimage: i32, max_bytes: u64, count: *mut u64,
        error: *mut c_char, error_size: usize,
    ) -> i32;
    /// A level of the pyramid of a subimage; level 0 is the image itself.
    fn input_level(
        input: *mut OiioInput, subimage: i32, level: i32, out: *mut OiioLevel,
        error: *mut c_char, error_size: usize,
    ) -> i32;
    /// Reads `width` × `height` pixels of a level from column `x` and row `y` on: the channels
    /// `channel_begin..channel_end`, interleaved, top row first. `count` is the total number of values, whose type is
    /// `format`: `OIIO_FORMAT_U8` or `OIIO_FORMAT_FLOAT`.
    fn input_read_region(
        input: *mut OiioInput, subimage: i32, level: i32, x: i32, y: i32, width: i32, height: i32,
        channel_begin: i32, channel_end: i32, format: i32, values: *mut c_void, count: u64,
        error: *mut c_char, error_size: usize,
    ) -> i32;
    /// Closes and frees; null is allowed.
    fn input_close(input: *mut OiioInput);

    /// Chooses the encoder by the extension of the path. No file is created yet.
    fn output_create(
        path: *const c_char, output: *mut *mut OiioOutput, error: *mut c_char, error_size: usize,
    ) -> i32;
    /// Adds a part; parts are numbered from 0. Only OpenEXR files hold more than one.
    fn output_add_part(
        output: *mut OiioOutput, part: *const OiioPart, error: *mut c_char, error_size: usize,
    ) -> i32;
    /// Sets metadata of a part to a string.
    fn output_set_string(
        output: *mut OiioOutput, part: i32, name: *const c_char, value: *const c_char,
        error: *mut c_char, error_size: usize,
    ) -> i32;
    /// Sets metadata of a part to an integer.
    fn output_set_int(
        output: *mut OiioOutput, part: i32, name: *const c_char, value: i32,
        error: *mut c_char, error_size: usize,
    ) -> i32;
    /// Sets metadata of a part to a float.
    fn output_set_float(
        output: *mut OiioOutput, part: i32, name: *const c_char, value: f32,
        error: *mut c_char, error_size: usize,
    ) -> i32;
    /// Sets metadata of a part to a matrix of 16 floats, for row vectors.
    fn output_set_matrix(
        output: *mut OiioOutput, part: i32, name: *const c_char, value: *const f32,
        error: *mut c_char, error_size: usize,
    ) -> i32;
    /// Creates the file and writes its header.
    fn output_open(output: *mut OiioOutput, error: *mut c_char, error_size: usize) -> i32;
    /// Writes `rows` rows from `row_begin` on (0 is the top), in order and without gaps. After the last row of a part,
    /// the next call writes `part + 1`.
    fn output_write(
        output: *mut OiioOutput, part: i32, row_begin: i32, rows: i32, pixels: *const f32,
        count: u64, error: *mut c_char, error_size: usize,
    ) -> i32;
    /// Ends the file. Reports everything that could not be stored, including a full disk.
    fn output_close(output: *mut OiioOutput, error: *mut c_char, error_size: usize) -> i32;
    /// Frees the handle. Without `output_close` before, the file is incomplete. Null is allowed.
    fn output_free(output: *mut OiioOutput);
}

/// The shim, opened by the first call. An error is final: later calls return it again.
///
/// The shim is the file named by `$LUMIRIS_OIIO_SHIM`, else the copy inside the executable. The copy is opened from
/// memory, or from a temporary file of the user if that is impossible. No other locations are searched: whoever can
/// write there could run code in this process.
pub fn load() -> Result<&'static Api, String> {
    API.get_or_init(find).as_ref().map_err(Clone::clone)
}

/// True if [`load`] has succeeded.
pub fn is_loaded() -> bool {
    matches!(API.get(), Some(Ok(_)))
}

static API: OnceLock<Result<Api, String>> = OnceLock::new();

/// Opens the shim: see [`load`].
fn find() -> Result<Api, String> {
    if let Some(path) = env::var_os("LUMIRIS_OIIO_SHIM").filter(|path| !path.is_empty()) {
        return open(Path::new(&path));
    }
    #[cfg(target_os = "linux")]
    if let Ok(path) = in_memory() {
        return open(&path).map_err(|reason| format!("cannot load OpenImageIO: {reason}"));
    }
    // Once open, the library does not need its name any more
    let file = temporary().map_err(|error| format!("cannot load OpenImageIO: temporary file: {error}"))?;
    open(file.path()).map_err(|reason| format!("cannot load OpenImageIO: {reason}"))
}

/// Opens a file and checks its interface version.
fn open(path: &Path) -> Result<Api, String> {
    let described = |error: libloading::Error| format!("{}: {error}", path.display());
    // SAFETY: opening runs the initialisers of OpenImageIO and of its dependencies, which the user chose by installing
    // or naming the library.
    let library = unsafe { Library::new(path) }.map_err(described)?;
    let api = Api::from_library(&library).map_err(described)?;
    // SAFETY: `abi` has this type in all versions.
    let abi = unsafe { (api.abi)() };
    if abi != OIIO_SHIM_ABI {
        return Err(format!("{}: interface version {abi}, not {OIIO_SHIM_ABI}", path.display()));
    }
    // The functions live as long as the process
    std::mem::forget(library);
    Ok(api)
}

/// The executable's copy as a file without a name. Returns its path, which is valid in this process only. The file
/// remains open, since debuggers and backtraces open the library by that path.
#[cfg(target_os = "linux")]
fn in_memory() -> io::Result<std::path::PathBuf> {
    use std::os::fd::{AsRawFd, IntoRawFd};
    let fd = rustix::fs::memfd_create("liblumiris_oiio.so", rustix::fs::MemfdFlags::CLOEXEC)?;
    let mut file = std::fs::File::from(fd);
    file.write_all(SHIM)?;
    let path = format!("/proc/self/fd/{}", file.as_raw_fd()).into();
    // Fails without /proc
    std::fs::metadata(&path)?;
    let _ = file.into_raw_fd();
    Ok(path)
}

/// The executable's copy as a temporary file that only the user can read and write.
fn temporary() -> io::Result<NamedTempFile> {
    let mut file = tempfile::Builder::new().prefix("lumiris-oiio-").suffix(".so").tempfile()?;
    file.write_all(SHIM)?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn the_temporary_file_is_for_its_owner_alone_and_opens() {
        let file = temporary().unwrap();
        assert_eq!(file.as_file().metadata().unwrap().permissions().mode() & 0o777, 0o600);
        open(file.path()).unwrap();
    }

    /// A shim loaded from a folder could be replaced by whoever can write there.
    #[test]
    #[cfg(target_os = "linux")]
    fn the_shim_is_opened_from_memory_and_not_from_where_it_was_built() {
        load().unwrap();
        let maps = fs::read_to_string("/proc/self/maps").unwrap();
        let shims: Vec<_> = maps.lines().filter(|line| line.contains("liblumiris_oiio")).collect();
        assert!(!shims.is_empty() && shims.iter().all(|line| line.contains("/memfd:")), "{shims:#?}");
        assert!(!maps.contains(env!("LUMIRIS_OIIO_SHIM_BUILT")), "{shims:#?}");
    }
}

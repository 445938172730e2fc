//! Raw bindings to the part of OpenImageIO used by Lumiris, loaded at first use.
//!
//! OpenImageIO's interface is C++, so a shim with a C interface wraps it (`shim/oiio_shim.h`, which documents each
//! function). Linking OpenImageIO would load some 260 shared objects at every start of the process. The shim is
//! therefore a separate shared object, which [`load()`] opens when the first image is read or written.
//!
//! Every function that can fail returns an `OIIO_…` code and takes a buffer for the message, as `error, error_size`.
//! Handles may move between threads, but must not be used by two threads at once.

mod load;
mod types;

pub use load::{Api, is_loaded, load};
pub use types::*;

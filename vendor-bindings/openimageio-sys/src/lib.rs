//! Raw bindings to the part of OpenImageIO that Lumiris uses, loaded on first use.
//!
//! OpenImageIO's interface is C++, so a shim with a C interface (`shim/oiio_shim.h`, which documents
//! each function) stands between. Linking OpenImageIO would load some 260 shared objects at every
//! start of the process; the shim is therefore a shared object of its own, which [`load()`] opens when
//! the first picture is read or written.
//!
//! Every function that can fail returns an `OIIO_…` code and takes a buffer for the message, as
//! `error, error_size`. Handles may move between threads, but two threads must not use one at
//! once.

mod load;
mod types;

pub use load::{Api, is_loaded, load};
pub use types::*;

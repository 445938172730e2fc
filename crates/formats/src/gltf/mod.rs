//! glTF 2.0: containers, checked JSON, buffers and accessors. What they mean is decided by the renderer.
//!
//! The types of what is read and all indices are checked first; whether accessors lie inside their buffers, before
//! anything is read or allocated. Errors name the place in the JSON, or the byte of the container.
//!
//! Reading order: [`json`], [`place`], [`container`], [`schema`], [`document`], [`accessor`]; [`mod@locate`] for
//! messages.

pub mod accessor;
pub mod container;
pub mod document;
pub mod json;
pub mod locate;
pub mod place;
pub mod schema;

pub use document::Document;
pub use locate::{locate, locate_members};
pub use place::{GltfError, Place};

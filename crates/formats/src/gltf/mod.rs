//! glTF 2.0: containers, validated JSON, buffers and accessors. The renderer defines their semantics.
//!
//! Types of values and all indices are checked first. Accessors are checked against their buffers before anything is
//! read or allocated. Errors name the path in the JSON, or the byte of the container.
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

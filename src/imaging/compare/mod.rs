//! Comparison of images with a reference: loading of files and arrays, and all metrics by name.
//!
//! Reading order: [`mod@load`] (images of a common size), [`metric`] (names), [`scores`] (values), [`columns`]
//! (tables).

pub mod columns;
pub mod load;
pub mod metric;
pub mod scores;

pub use columns::{COLUMNS, Column};
pub use load::{ImageSet, LoadError, Raw, Shown, load};
pub use metric::Metric;
pub use scores::{Compared, Scores, Settings, compare};

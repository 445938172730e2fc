//! Comparison of images with a reference: files and arrays to pixels of one size, and all metrics by name.
//!
//! Reading order: [`mod@load`] (images of one size), [`metric`] (names of metrics), [`scores`] (metrics), [`columns`]
//! (metrics by name).

pub mod columns;
pub mod load;
pub mod metric;
pub mod scores;

pub use columns::{COLUMNS, Column};
pub use load::{ImageSet, LoadError, Raw, Shown, load};
pub use metric::Metric;
pub use scores::{Compared, Scores, Settings, compare};

//! Comparison of images with a reference: metrics, and a page to inspect them.
//!
//! Reading order: [`layers`] (which channels of a file are the image), [`mod@load`] (files to pixels of one size),
//! [`metric`] (names of metrics), [`scores`] (metrics), [`columns`] (metrics by name), [`page`] (an HTML page, whose
//! parts are in `viewer/`: `index.html`, `style.css`, `images.js` for values and images, `viewer.js` for controls).

pub(crate) mod columns;
pub(crate) mod layers;
pub(crate) mod load;
pub(crate) mod metric;
pub(crate) mod page;
pub(crate) mod scores;

pub(crate) use columns::{COLUMNS, Column};
pub(crate) use load::{ImageSet, Shown, load};
pub(crate) use metric::Metric;
pub(crate) use page::write_page;
pub(crate) use scores::{Compared, Scores, Settings, compare};

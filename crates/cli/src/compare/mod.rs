//! Images against a reference: metrics, and a page to inspect them.
//!
//! Reading order: [`layers`] (which channels of a file are the picture), [`mod@load`] (files to pixels of one size),
//! [`metric`] (their names), [`scores`] (metrics), [`columns`] (metrics by name), [`page`] (a page for a browser, whose own parts are in `viewer/`:
//! `index.html`, `style.css`, `pictures.js` for values and their pictures, `viewer.js` for controls).

pub mod columns;
pub mod layers;
pub mod load;
pub mod metric;
pub mod page;
pub mod scores;

pub use columns::{COLUMNS, Column};
pub use load::{Pictures, Shown, load};
pub use metric::Metric;
pub use page::write_page;
pub use scores::{Compared, Scores, Settings, compare};

//! Figures of papers, reproduced by rendering and measuring, as a page with images and a JSON file with all numbers.
//!
//! Reading order: [`method`] (an estimator of light), [`measure`] (alternating methods on one scene, variances and
//! times), [`calibrate`] (sample counts for equal time), [`talbot`] (resampled importance sampling), [`fan`]
//! (optimizing control variates), [`keller_wald`] (photon maps), [`verdicts`] (criteria of reproduction); then the
//! parts of a page: [`figure`], [`page`], [`images`], [`chart`]. `options`, `budget` and `error` serve all papers.

mod budget;
pub mod calibrate;
pub mod chart;
mod error;
pub mod fan;
pub mod figure;
pub mod images;
pub mod keller_wald;
pub mod measure;
pub mod method;
mod options;
pub mod page;
pub mod talbot;
pub mod verdicts;

pub use budget::Budget;
pub use error::ReproduceError;
pub use options::{Observer, Options};

//! Direct light at vertices, in columns, for estimators that trace all their samples: `mc`, `mis`, and `ocv` over
//! pixels.
//!
//! ```text
//! vertices ─light samples─▶ f·cos, weights ─segments─▶ T2 ─▶ radiance
//!          └BSDF samples──▶ emitters among which they are looked up ─▶ f·cos, weights ─segments─▶ T2 ─▶ radiance
//! ```
//!
//! Each step is a loop over rows, for one sample of each row. The first rows may have a different allocation than most
//! rows. If all lobes are specular, light samples are useless; if the path cannot continue by the BSDF sample, BSDF
//! samples are drawn here. Samples beyond the allocation of most rows are made for the first rows only.
//!
//! Reading order: [`techniques`] (number of samples), [`batch`] (vertices, and the sample being drawn), [`samples`]
//! (columns), [`emitters`] (emitters hit by BSDF samples), [`control_columns`] (control variates of `ocv`), [`sinks`]
//! (callbacks), [`column_direct_lighting`] (the steps).

mod batch;
mod column_direct_lighting;
mod control_columns;
mod emitters;
mod samples;
mod sinks;
mod techniques;

pub use column_direct_lighting::ColumnDirectLighting;
pub use sinks::{SampleOnLight, Sinks, VisibleSample, WeightAgainstLightPaths};
pub use techniques::Techniques;

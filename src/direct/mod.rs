//! Direct light at vertices of paths. Two ways lead to the same integral ∫ f_s L_direct |cos θ| dω:
//! [`PointDirectLighting`] runs every estimator on shading points, in four stages; [`ColumnDirectLighting`] runs `mc`,
//! `mis` and `ocv --ocv pixels` on [`vertices`] in columns. [`estimators`] has a file for each estimator with its part
//! in every stage. The other files are shared by all estimators, in reading order:
//!
//! | file | |
//! |---|---|
//! | [`point`], [`domain`] | shading points, and the domains of their random numbers |
//! | [`candidates`], [`stats`] | candidates, their contributions, counts and times |
//! | [`light_samples`], [`bsdf_samples`], [`t1`] | T1 by light sampling and by BSDF sampling |
//! | [`mixture`], [`components`], [`fits`] | component densities, normal equations, coefficients for later estimates |
//! | [`proposal_columns`] | light samples of resampling, in columns |
//! | [`shadow_segments`], [`transmittance`] | T2, in empty space and through media |

mod bsdf_samples;
pub mod candidates;
pub mod columns;
mod components;
pub(crate) mod domain;
pub mod estimators;
pub mod fits;
mod light_samples;
pub mod mixture;
pub mod point;
mod point_direct_lighting;
pub mod proposal_columns;
pub mod shadow_segments;
pub mod stats;
mod t1;
mod transmittance;
pub mod vertices;

pub use columns::{ColumnDirectLighting, Techniques};
pub use estimators::Estimator;
pub use fits::Fits;
pub use point::{ShadingPoint, lobe_for_lights};
pub use point_direct_lighting::PointDirectLighting;
pub use stats::DirectStats;
pub use vertices::Vertices;

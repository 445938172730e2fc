//! The lights of a scene and the choice among them: [`light_sampler`] chooses one light, [`set`] holds all lights,
//! [`groups`] are components of the mixture density, [`sampling`] joins them, and [`sample_columns`] samples for many points.

pub mod groups;
pub mod light_sampler;
pub mod sample_columns;
pub mod sampling;
pub mod set;

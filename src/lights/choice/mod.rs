//! The lights of a scene and the choice among them: [`light_sampler`] chooses one light, [`set`] holds all lights,
//! [`mixture_groups`] are components of the mixture density, [`job_lights`] joins them for a render job, and
//! [`sample_columns`] samples for many points.

pub mod job_lights;
pub mod light_sampler;
pub mod mixture_groups;
pub mod sample_columns;
pub mod set;

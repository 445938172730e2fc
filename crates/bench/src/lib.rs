//! Measurements of the renderer.
//!
//! [`stages`] times ray queries and the stages of a rendering, [`frame`] a camera sample from the camera to the film,
//! [`photons`] photons and their maps. [`efficiency`] compares settings by error and CPU time, and [`crosscheck`] two ray
//! tracers by their answers.

pub mod crosscheck;
pub mod efficiency;
pub mod frame;
pub mod photons;
pub mod stages;

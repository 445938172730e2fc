//! Measurements of the renderer.
//!
//! [`stages`] times ray queries and the stages of a rendering, [`frame`] a camera sample from the camera to the film,
//! [`stages`] times ray queries and the stages of a rendering, [`frame`] a camera sample from the camera to the film,
//! [`photons`] photon tracing and photon maps. [`efficiency`] compares settings by error and CPU time; [`crosscheck`]
//! compares the answers of two ray tracers.

pub mod crosscheck;
pub mod efficiency;
pub mod frame;
pub mod photons;
pub mod stages;

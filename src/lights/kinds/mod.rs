//! The kinds of lights, each with its sampling, density and radiance: [`point`] and [`spot`], [`image_light`] (a point
//! with an image), [`area`]; [`environment`] and [`portal`] (an environment through a rectangle); [`glow`] of media.

pub mod area;
pub mod environment;
pub mod glow;
pub mod image_light;
pub mod point;
pub mod portal;
pub mod spot;

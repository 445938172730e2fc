//! The kinds of lights, each with its sampling, density and radiance: [`point`] and [`spot`], [`image_light`] (a point
//! with an image), [`area`]; [`distant`], [`environment`] and [`portal`] (an environment through a rectangle);
//! [`volume_light`] (emission of media).

pub mod area;
pub mod distant;
pub mod environment;
pub mod image_light;
pub mod point;
pub mod portal;
pub mod spot;
pub mod volume_light;

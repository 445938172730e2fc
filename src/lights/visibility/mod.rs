//! Visibility of lights from photons: [`visibility_cache`] records the lights that reach a point,
//! [`learned_visibility`] estimates the visibility of all lights, and [`visibility_cache_sampler`] chooses by both.

pub mod learned_visibility;
pub mod visibility_cache;
pub mod visibility_cache_sampler;

//! Light transport: from camera rays to radiance.
//!
//! All threads share one [`Integrator`]. It prepares the data of the samples, makes a [`Tracer`] for each thread, and
//! reports [`Statistics`]. Reading order: [`path`] is the loop over vertices, `path_state` the state of a path between
//! two vertices and the MIS weight of an emitter hit, `vertex_search` traces to the next vertices, `interior` walks
//! through the interiors of materials, `direct_light` adds L_d, `scatter` samples the next segments, and `roulette`
//! ends paths. Neighbouring pixels may share paths ([`reuse`], [`cells`]), and light paths add caustics
//! ([`light_paths`]). [`exclusions`] lists the features that exclude each other. [`irradiance_cache`] and
//! [`photon_map`] replace the light reflected by Lambertian lobes (`diffuse`). [`camera_sampler`] makes camera rays,
//! and [`light_layers`] sums light by light group.

mod camera_sample;
pub mod camera_sampler;
pub mod cells;
mod choice;
mod diffuse;
mod direct_light;
mod domain;
pub mod exclusions;
mod integrator;
mod interior;
pub mod irradiance_cache;
pub mod light_layers;
pub mod light_paths;
pub mod path;
mod path_state;
pub mod photon_map;
mod recording;
pub mod reuse;
mod roulette;
mod scatter;
mod statistics;
mod vertex_search;

pub use camera_sample::{CameraSample, CameraSamples};
pub use choice::make_integrator;
pub use integrator::{Cameras, Integrator, Tracer};
pub use irradiance_cache::{CacheIntegrator, IrradianceCache};
pub use path::{PathIntegrator, PathTracer};
pub use photon_map::PhotonMapIntegrator;
pub use statistics::{BuildStats, CacheReport, LightPathStats, LookupStats, MapStats, PathStats, Statistics};

//! Whole-program tests; one binary, a module per subject.
#![allow(clippy::unwrap_used)]

mod analytic_scenes;
mod anisotropy;
mod bit_exact;
mod crosscheck;
mod dispersion;
mod displacement;
mod evaluated;
mod gltf;
mod hair;
mod image_hashes;
mod image_lights;
mod irradiance_cache;
mod layering;
mod lenses;
mod light_groups;
mod light_paths;
mod measured;
mod media;
mod motion;
mod mutations;
mod path_reuse;
mod photon_map;
mod photons;
mod portals;
mod roulette;
mod sample_allocation;
mod subsurface;
mod texture_pyramids;
mod texture_tiles;
mod udim;
mod variance;
mod visibility_cache;
mod volumes;
mod wavefront;
mod white_balance;

//! A tropical island with up to 10⁸ plants and pebbles, as a benchmark of large scenes.
//!
//! Plants stand in patches, objects that hold instances of plants, and the scene places patches on the terrain. All
//! lengths of the terrain are proportional to its side, which grows until the island has room for all instances.
//! Lengths are in metres, z is up, and the sea is the plane z = 0.
//!
//! Reading order: `random`, `meshes` (stems, blades, pebbles), `terrain`, `leaves` (alpha images), `kinds` (the plants),
//! `patches`, `text` (the scene), `files`.

mod files;
mod kinds;
mod leaves;
mod meshes;
mod patches;
mod random;
mod terrain;
mod text;

pub use files::{IslandOptions, WrittenIsland, write_scenes};

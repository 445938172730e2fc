//! Photon maps [Jensen 1996] with deposition by importance [Keller and Wald 2000].
//!
//! Reading order: [`photon`], `tree`, [`map`].

pub mod map;
#[cfg(test)]
mod map_tests;
pub mod photon;
mod tree;

pub use map::{GatherScratch, PhotonMap, Place, Search};
pub use photon::{Origin, Photon};

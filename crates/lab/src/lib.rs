//! Experiments: figures of papers, reproduced by rendering and measurement, and their scenes.
//!
//! [`procedural`] generates content (a statue, skies, adjacent rooms), [`sphere_study`] estimates a sphere by BSDF
//! sampling only, and [`reproduce`] measures figures and writes them as a page.

pub mod procedural;
pub mod reproduce;
pub mod sphere_study;

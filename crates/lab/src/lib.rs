//! The laboratory: figures of papers, rendered and measured again, and the scenes that show them.
//!
//! [`procedural`] makes content (a statue, skies, nets of rooms), [`sphere_study`] estimates a sphere by BSDF sampling alone, and
//! [`reproduce`] measures figures and writes them as a page.

pub mod procedural;
pub mod reproduce;
pub mod sphere_study;

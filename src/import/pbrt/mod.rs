//! The pbrt-v4 scene format.
//!
//! Reading order: [`lexer`] (tokens), [`params`] (typed parameters), [`directive`], [`parser`] (text to directives).

pub mod directive;
pub mod lexer;
pub mod params;
pub mod parser;

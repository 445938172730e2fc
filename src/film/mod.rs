//! (in progress)

pub mod filter;

//! Content that the program makes itself.
//!
//! Reading order: [`noise`], [`nets`], [`solids`], [`relief`], [`dragon`], [`statue`], [`ply`].

pub mod dragon;
mod head;
pub mod nets;
pub mod noise;
pub mod ply;
pub mod relief;
pub mod solids;
pub mod statue;

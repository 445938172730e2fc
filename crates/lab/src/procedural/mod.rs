//! Generated content: a statue, a sky, an island, and the scenes that use them.
//!
//! Reading order: [`gradient_noise`], [`nets`], [`solids`], [`relief`], [`dragon`] (with `head`), [`statue`], [`ply`],
//! [`sky`], [`files`], [`talbot`], [`fan`], [`keller_wald`], [`island`].

pub mod dragon;
pub mod fan;
pub mod files;
pub mod gradient_noise;
mod head;
pub mod island;
pub mod keller_wald;
mod limbs;
pub mod nets;
pub mod ply;
pub mod relief;
pub mod sky;
pub mod solids;
pub mod statue;
pub mod talbot;

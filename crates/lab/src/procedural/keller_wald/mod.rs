//! The scenes of `scenes/keller-wald`, after [Keller and Wald 2000]: rooms of which one is visible, a caustic ring, a
//! room lit through a slit. [`rooms`] writes the rooms.

pub mod rooms;
mod scenes;

pub use scenes::{COUNT, write_scenes};

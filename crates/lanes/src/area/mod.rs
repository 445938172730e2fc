//! Area lights of constant emission, sampled from many points. The formulas are in the modules of
//! `lights::kinds::area`.
//!
//! Reading order: `shapes`, [`spherical`], [`many`].

pub mod many;
mod shapes;
pub mod spherical;

pub use shapes::Rectangle;

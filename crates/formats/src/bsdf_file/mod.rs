//! Files of measured BSDFs (`.bsdf`) [Dupuy and Jakob 2018]: tables over the unit square, by the direction of one of both
//! rays. Their spectra become linear Rec.709 here.
//!
//! Reading order: [`tensor`], the container; [`tables`], what is in it.

pub mod tables;
pub mod tensor;

pub use tables::{BsdfFileError, MeasuredBsdf, read_bsdf};
pub use tensor::{TensorError, TensorFile};

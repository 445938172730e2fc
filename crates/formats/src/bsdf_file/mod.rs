//! Files of measured BSDFs (`.bsdf`) [Dupuy and Jakob 2018]: tables over the unit square for each direction of one of
//! the rays. Spectra are converted to linear Rec.709.
//!
//! Reading order: [`tensor`], the container; [`tables`], its content.

pub mod tables;
pub mod tensor;

pub use tables::{BsdfFileError, MeasuredBsdf, read_bsdf};
pub use tensor::{TensorError, TensorFile};

//! Stateless random numbers: `u(pixel, sample, domain)`, independent of the order of use.
//!
//! A [`SampleStream`] is a small value. The root stream of a (pixel, sample) pair is split into *domains*, one for each
//! decision (lens, light choice, BSDF, …). Each domain gives up to four numbers that are well distributed over the
//! samples of the pixel. [`SampleStream::split`] gives several points to one decision, which are well distributed over
//! both the points and the samples. The sequences are those of the `openqmc` crate: Owen-scrambled Sobol' [Burley
//! 2020], and its variant with blue-noise errors within blocks of pixels [Belcour and Heitz 2021]. Each is scrambled
//! once more by a hash of all bits of the seed, the domains, and the pixel or block, so that no two of them are
//! correlated.

mod blue_noise;
mod columns;
mod kind;
mod net;
mod stream;

pub use blue_noise::BlueNoise;
pub use columns::{StreamColumns, StreamKind};
pub use kind::SamplerKind;
pub use stream::{INDEPENDENT, SampleStream};

//! Participating media, which absorb, scatter and emit light between surfaces, and free flights through them.
//!
//! σ_a and σ_s are the absorption and scattering coefficients (1/m), and σ_t = σ_a + σ_s, all of them RGB. Over a
//! distance d, light is attenuated by the transmittance T = exp(−∫₀ᵈ σ_t). A medium emits σ_a·L_e per unit length. Its
//! phase function is [Henyey and Greenstein 1941].
//!
//! Reading order: [`coefficients`], [`flight`], [`homogeneous`], [`sparse`], [`grid`], [`cloud`], [`majorants`],
//! [`heterogeneous`], [`medium`] (all kinds).

pub mod cloud;
pub mod coefficients;
pub mod flight;
pub mod grid;
pub mod heterogeneous;
pub mod homogeneous;
pub mod majorants;
pub mod medium;
pub mod sparse;

pub use cloud::Cloud;
pub use coefficients::Coefficients;
pub use flight::{EmissionLookup, EmissionLookups, End, Flight, FlightSampler, Segment};
pub use grid::{RgbGrid, Samples, Scalars, Temperature, UniformGrid};
pub use heterogeneous::{Field, Heterogeneous};
pub use homogeneous::Homogeneous;
pub use medium::{Medium, MediumId, MediumSet, Sides};
pub use sparse::{Cube, SparseGrid, SparseSamples};

//! The figures of importance sampling for photon maps [Keller and Wald 2000].
//!
//! [`above`] plots points on the floor plan. [`seen`] has the diffuse surfaces visible to the camera, and the error of
//! images that visualise a map directly. [`maps`] renders such images. The figures are [`rooms`] (1 and 2), [`ring`]
//! (3), [`slit`] (4) and [`direct`] (5).

mod above;
mod direct;
mod maps;
mod ring;
mod rooms;
mod seen;
mod setup;
mod slit;
mod study;

pub use study::run;

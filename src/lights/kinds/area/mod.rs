//! Area lights: surfaces that emit the same radiance in all directions, on one or both sides. A light has its own copy
//! of its geometry, in world space.
//!
//! | shape | density of `sample_li` |
//! |---|---|
//! | [`triangle`] | uniform in area |
//! | [`rectangle`] | uniform in solid angle; in area where that is small or ill-conditioned |
//! | [`quadric`] sphere, full and uniformly scaled | uniform in its cone; in area from inside |
//! | [`quadric`] others | uniform in the area of the local quadric |
//! | [`patch`] | uniform in (u, v) |

pub mod alpha_mask;
pub mod area_light;
pub mod area_shape;
pub mod build;
pub mod emission;
pub mod patch;
pub mod plane;
pub mod quadric;
pub mod rectangle;
mod shape_sample;
pub mod triangle;

pub use alpha_mask::AlphaMask;
pub use area_light::AreaLight;
pub use area_shape::AreaShape;
pub use build::{AreaLights, area_lights_of};
pub use emission::{Emission, EmissionImage, EmissionMapping};
pub use patch::PatchLight;
pub use plane::Plane;
pub use quadric::QuadricLight;
pub use rectangle::RectangleLight;
pub use triangle::TriangleLight;

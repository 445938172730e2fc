//! Scene-independent numerics: vectors, frames, colour, warps, distributions, rays.
//!
//! Conventions of the whole program: `wo` points to the viewer and `wi` to the light, both unit and away from the
//! surface; the shading frame has n = +z; transforms are named `to_from`; colour is linear Rec.709; angles are in
//! radians; light is in f32.
//!
//! Reading order: [`scalar`], [`rgb`], [`frame`], [`transform`], [`origin`], [`ray`], [`bounds`], [`warp`],
//! [`sphere_map`], [`octahedral`], [`cumulative`], [`distribution`], [`texel_distribution`], [`bilinear`], [`alias`],
//! [`hash`], [`noise`], [`number`], [`v3`], [`elementary`], [`subtended_cone`], [`light_bound`],
//! [`expected_visibility`].

pub mod alias;
pub mod bilinear;
pub mod bounds;
pub mod cumulative;
pub mod distribution;
pub mod elementary;
pub mod expected_visibility;
pub mod frame;
pub mod hash;
pub mod light_bound;
pub mod noise;
pub mod number;
pub mod octahedral;
pub mod origin;
pub mod ray;
pub mod rgb;
pub mod scalar;
pub mod sphere_map;
pub mod subtended_cone;
pub mod texel_distribution;
pub mod transform;
pub mod v3;
pub mod warp;

pub use alias::{AliasTable, DiscreteSample};
pub use bilinear::{BilinearTables, Blend, ParameterGrid, PiecewiseBilinear2D};
pub use bounds::{Bounds3, Sphere};
pub use distribution::{PiecewiseConstant1D, PiecewiseConstant2D, Sample1D, Sample2D};
pub use frame::Frame;
pub use glam::{
    Affine3A, DAffine3, DMat3, DMat4, DQuat, DVec2, DVec3, Mat3, Mat3A, Mat4, Quat, Vec2, Vec3, Vec3A, Vec4,
};
pub use ray::Ray;
pub use rgb::{Rgb, luminance};
pub use scalar::{ONE_MINUS_EPSILON, gamma, safe_sqrt, sqr};
pub use texel_distribution::TexelDistribution;

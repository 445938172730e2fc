//! Vertices that have no row yet.

use crate::bsdfs::Bsdf;
use crate::materials::SurfaceBsdf;
use crate::media::Sides;
use lumiris_numbers::math::{Rgb, Vec3};

/// A vertex with all its data.
#[derive(Clone, Copy, Debug)]
pub struct VertexData<'w> {
    /// Index of its path.
    pub path: u32,
    /// The point.
    pub p: Vec3,
    /// Bound of its rounding error.
    pub p_error: Vec3,
    /// Direction to the viewer, unit.
    pub wo: Vec3,
    /// Scattering.
    pub bsdf: SurfaceBsdf<'w>,
    /// The media on both sides of the surface.
    pub media: Sides,
}

/// A vertex on a mesh in world space, whose point is computed by a kernel.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlainMeshVertex {
    /// Index of its path.
    pub(super) path: u32,
    /// Reflectance.
    pub(super) rho: Rgb,
}

impl VertexData<'_> {
    /// True if the vertex fits into a Lambertian row.
    pub(super) fn is_lambertian(&self) -> bool {
        matches!(self.bsdf.bsdf, Bsdf::Diffuse(_)) && self.media == Sides::default()
    }
}

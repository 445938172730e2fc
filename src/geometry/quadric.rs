//! Spheres, disks and cylinders, possibly partial.

use crate::math::{Affine3A, Bounds3, Vec3};

/// Which quadric, in its local space (pbrt's parameters; angles in radians).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum QuadricKind {
    /// Sphere about the origin, cut to z_min..z_max and φ in 0..phi_max.
    Sphere {
        /// Radius.
        radius: f32,
        /// Lower cut, in −radius..radius.
        z_min: f32,
        /// Upper cut.
        z_max: f32,
        /// Sweep angle.
        phi_max: f32,
    },
    /// Disk z = height, inner_radius..radius.
    Disk {
        /// z of its plane.
        height: f32,
        /// Outer radius.
        radius: f32,
        /// Inner radius, 0 for a full disk.
        inner_radius: f32,
        /// Sweep angle.
        phi_max: f32,
    },
    /// Open cylinder about z, z_min..z_max.
    Cylinder {
        /// Radius.
        radius: f32,
        /// Lower end.
        z_min: f32,
        /// Upper end.
        z_max: f32,
        /// Sweep angle.
        phi_max: f32,
    },
}

/// A quadric placed in the space of its group.
#[derive(Clone, Copy, Debug)]
pub struct Quadric {
    /// Shape in local space.
    pub kind: QuadricKind,
    /// Placement.
    pub group_from_local: Affine3A,
    /// Inverse of the placement.
    pub local_from_group: Affine3A,
    /// True if the geometric normal is reversed (pbrt's `ReverseOrientation` xor mirroring).
    pub flip_normal: bool,
}

impl Quadric {
    /// Bounds of the full quadric (the sweep angle is not used to tighten them).
    pub fn bounds(&self) -> Bounds3 {
        let local = match self.kind {
            QuadricKind::Sphere { radius, z_min, z_max, .. } | QuadricKind::Cylinder { radius, z_min, z_max, .. } => {
                Bounds3 { min: Vec3::new(-radius, -radius, z_min), max: Vec3::new(radius, radius, z_max) }
            }
            QuadricKind::Disk { height, radius, .. } => {
                Bounds3 { min: Vec3::new(-radius, -radius, height), max: Vec3::new(radius, radius, height) }
            }
        };
        local.transformed(&self.group_from_local)
    }
}

//! The memory that the geometry of a scene takes, before its PLY files are read.

use super::descriptions::{ShapeDesc, ShapeSource};
use super::state::Builder;
use crate::import::cache::FileCache;
use crate::import::memory::{MemoryAccount, ShapeSize};
use lumiris_formats::ply::ply_size;
use rayon::prelude::*;

impl Builder<'_> {
    /// Shapes, instances and lights; empty without a limit of memory.
    pub(super) fn geometry_account(&self, shapes: &[ShapeDesc], files: &FileCache) -> MemoryAccount {
        let mut account = MemoryAccount::now();
        if files.memory_limit().is_some() {
            let sizes: Vec<ShapeSize> = shapes.par_iter().map(size_of).collect();
            let nested: usize = self.objects.iter().map(|object| object.instances.len()).sum();
            account.add_geometry(sizes.into_iter(), self.objects.len(), self.instances.len() + nested);
        }
        account
    }
}

/// The size of a shape. An unreadable file counts as 0; reading it reports the error.
fn size_of(shape: &ShapeDesc) -> ShapeSize {
    let (name, bytes, primitives) = match &shape.source {
        ShapeSource::Ply(path) => {
            let size = ply_size(path).unwrap_or_default();
            (Some(path.display().to_string()), size.bytes, size.triangles)
        }
        // Their arrays are in memory
        ShapeSource::Mesh(mesh) => (None, 0, mesh.indices.len() as u64),
        ShapeSource::Bilinear(mesh) => (None, 0, mesh.indices.len() as u64),
        ShapeSource::Curves(curves) => (None, 0, curves.curves.len() as u64),
        ShapeSource::Quadric(_) => (None, 0, 1),
        ShapeSource::Loop(mesh, levels) => {
            let triangles = (mesh.indices.len() as u64).saturating_mul(1 << (2 * (*levels).min(20)));
            (None, triangles.saturating_mul(18), triangles)
        }
    };
    let emits = shape.area_light.is_some() && shape.object.is_none() && !shape.ctm.is_moving();
    ShapeSize { name, bytes, primitives, emits, group: shape.object }
}

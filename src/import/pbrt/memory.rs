//! The memory that a scene takes beside textures, before its files are read.

use super::descriptions::{ShapeDesc, ShapeSource};
use super::layout::{Groups, Layout, Stored};
use super::state::Builder;
use crate::import::cache::FileCache;
use crate::import::face_maps::face_map_size;
use crate::import::images::light_image_size;
use crate::import::measured::tables_size;
use crate::import::memory::{FileSize, MemoryAccount, ShapeSize};
use crate::import::volumes::volume_size;
use lumiris_formats::ply::ply_size;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

impl Builder<'_> {
    /// Everything but textures; empty without a limit of memory.
    pub(super) fn account(&self, shapes: &[ShapeDesc], files: &FileCache) -> MemoryAccount {
        let mut account = MemoryAccount::now();
        if files.memory_limit().is_none() {
            return account;
        }

        // Shapes, instances and lights
        let sizes: Vec<ShapeSize> = shapes.par_iter().map(|shape| size_of(shape, files)).collect();
        let layout = Layout::new(&self.objects, &self.own_groups(shapes), &self.instances);
        // Too many are reported later
        let Stored { instances, places, members, with_curves } =
            layout.map_or_else(|_| Stored::default(), |l| l.stored);
        account.add_geometry(sizes.into_iter(), self.objects.len(), instances as usize);
        account.add_clusters(places, members, with_curves);

        // Other files
        let mut add = |path: &Path, size: &dyn Fn() -> FileSize| {
            account.add_file(path.display().to_string(), files.missing(path, size));
        };
        let lights: BTreeSet<&PathBuf> =
            self.environments.iter().map(|e| &e.path).chain(&self.emission_images).collect();
        lights.into_iter().for_each(|path| add(path, &|| light_image_size(path)));
        for request in self.face_maps.list() {
            add(&request.file.path, &|| face_map_size(&request.file.path));
        }
        for request in self.measured_files.list() {
            add(&request.file, &|| tables_size(&request.file));
        }
        self.volume_requests().iter().for_each(|request| add(&request.path, &|| volume_size(request)));
        account
    }
}

impl Builder<'_> {
    /// By object, the groups of its shapes. Shapes that move alike may be fewer groups.
    fn own_groups(&self, shapes: &[ShapeDesc]) -> Vec<Groups> {
        let mut own = vec![Groups { count: 1, with_curves: 0, is_moving: false }; self.objects.len()];
        for shape in shapes {
            let Some(own) = shape.object.map(|object| &mut own[object]) else { continue };
            let is_curves = matches!(shape.source, ShapeSource::Curves(_));
            own.count += u64::from(shape.ctm.is_moving());
            own.is_moving |= shape.ctm.is_moving();
            own.with_curves = own.with_curves.max(u64::from(is_curves));
        }
        own
    }
}

/// The size of a shape. An unreadable file counts as 0; reading it reports the error.
fn size_of(shape: &ShapeDesc, files: &FileCache) -> ShapeSize {
    let (name, bytes, primitives) = match &shape.source {
        ShapeSource::Ply(path) => {
            let size = ply_size(path).unwrap_or_default();
            // Cached content is copied
            let copies = 1 + u64::from(files.keeps() && !files.holds(path));
            (Some(path.display().to_string()), size.bytes.saturating_mul(copies), size.triangles)
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

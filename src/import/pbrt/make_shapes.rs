//! Shapes from their descriptions, after all files have been read.

use super::curves::placed;
use super::descriptions::{DisplacementDesc, MeshData, PatchData, ShapeDesc, ShapeSource};
use super::files::Meshes;
use super::transform::affine;
use crate::geometry::displacement::MAX_TRIANGLES;
use crate::geometry::loop_subdiv::loop_subdivide;
use crate::geometry::{BilinearMesh, DisplacedMesh, Quadric, QuadricKind, Shape, TriangleMesh};
use crate::textures::{TextureContext, TextureSet};
use lumiris_formats::ply::PlyError;
use lumiris_numbers::math::origin::{near_origin, rebased};
use lumiris_numbers::math::transform::{swaps_handedness, transform_normal};
use lumiris_numbers::math::{Affine3A, DAffine3, DVec3, Vec2, Vec3};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The result of making a shape.
#[derive(Debug)]
pub(super) struct Made {
    /// The shapes: a PLY file may hold triangles and patches.
    pub shapes: Vec<Shape>,
    /// Their origin: the origin of rendered space; in objects and for moving shapes, a point near the shapes.
    pub origin: DVec3,
    /// Warnings.
    pub warnings: Vec<String>,
}

/// Errors of shapes.
#[derive(Debug)]
pub(super) enum ShapeError {
    /// Its file is missing.
    Missing(PathBuf, String),
    /// It is invalid.
    Wrong(String),
}

impl From<String> for ShapeError {
    fn from(reason: String) -> Self {
        ShapeError::Wrong(reason)
    }
}

/// The data that shapes are made with.
#[derive(Clone, Copy)]
pub(super) struct ShapeMaker<'a> {
    /// The point of world space that is the origin of rendered space.
    pub origin: DVec3,
    /// PLY files.
    pub meshes: &'a Meshes<'a>,
    /// Textures of displacements.
    pub textures: &'a TextureSet,
}

impl ShapeMaker<'_> {
    /// Makes the shapes of a description in the space of their group. Moves the arrays out of the description.
    pub(super) fn make(&self, desc: &mut ShapeDesc) -> Result<Made, ShapeError> {
        let source = std::mem::replace(&mut desc.source, ShapeSource::Mesh(MeshData::default()));
        // Points of shapes are relative to an origin of their own
        let placement = |origin| desc.placement(origin, self.origin);
        match source {
            ShapeSource::Quadric(kind) => {
                let placement = placement(DVec3::ZERO);
                let quadric = placed_quadric(kind, &placement.group_from_object)
                    .ok_or_else(|| "the shape is flattened".to_owned())?;
                Ok(placement.made(Shape::Quadric(quadric.with_flip(placement.flip))))
            }
            ShapeSource::Mesh(data) => {
                let placement = placement(data.origin);
                Ok(placement.made(self.mesh(desc, data, &placement)?))
            }
            ShapeSource::Loop(data, levels) => {
                let placement = placement(data.origin);
                Ok(placement.made(self.mesh(desc, subdivided(data, levels)?, &placement)?))
            }
            ShapeSource::Curves(data) => {
                let placement = placement(data.origin);
                Ok(placement.made(Shape::Curves(placed(data, &placement.group_from_object)?)))
            }
            ShapeSource::Bilinear(data) => {
                let placement = placement(data.origin);
                Ok(placement.made(patches(data, &placement)?))
            }
            ShapeSource::Ply(path) => self.ply(desc, &path),
        }
    }

    /// Triangles, displaced if the description says so.
    fn mesh(&self, desc: &ShapeDesc, data: MeshData, placement: &Placement) -> Result<Shape, ShapeError> {
        let data = match &desc.displacement {
            Some(displacement) => displaced(data, displacement, placement, self.textures)?,
            None => data,
        };
        Ok(Shape::Mesh(triangles(data, placement)?))
    }

    /// The patches and triangles of a PLY file.
    fn ply(&self, desc: &ShapeDesc, path: &Path) -> Result<Made, ShapeError> {
        let ply = self.meshes.mesh(path).map_err(|error| match error {
            PlyError::Io { source, .. } => ShapeError::Missing(path.to_owned(), source.to_string()),
            other => ShapeError::Wrong(format!("{}: {other}", path.display())),
        })?;
        let mut ply = Arc::unwrap_or_clone(ply);
        let placement = desc.placement(ply.origin, self.origin);
        let warnings = ply.warnings.iter().map(|w| format!("{}: {w}", path.display())).collect();

        // Displaced surfaces have triangles only
        if desc.displacement.is_some() {
            let halves = ply.quads.drain(..).flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
            ply.triangles.extend(halves);
        }

        // Patches
        let mut shapes = Vec::new();
        if !ply.quads.is_empty() {
            let data = PatchData {
                positions: ply.positions.clone(),
                // A patch has its corners row by row, a face in circular order
                indices: ply.quads.iter().map(|&[a, b, c, d]| [a, b, d, c]).collect(),
                normals: ply.normals.clone(),
                uvs: ply.uvs.clone(),
                faces: ply.quad_numbers,
                origin: ply.origin,
                tangents: Vec::new(),
            };
            shapes.push(patches(data, &placement)?);
        }

        // Triangles
        if !ply.triangles.is_empty() {
            let data = MeshData {
                positions: ply.positions,
                indices: ply.triangles,
                normals: ply.normals,
                tangents: Vec::new(),
                uvs: ply.uvs,
                faces: ply.triangle_numbers,
                origin: ply.origin,
            };
            shapes.push(self.mesh(desc, data, &placement)?);
        }
        Ok(Made { shapes, origin: placement.group_origin, warnings })
    }
}

impl ShapeDesc {
    /// True if it is the same where the instance of its object is. In objects, lights are dark, and media stay where
    /// they are defined; the width of curves and the mesh of displaced surfaces depend on the space of the object.
    pub fn can_leave_object(&self) -> bool {
        let is_curve = matches!(self.source, ShapeSource::Curves(_));
        !is_curve
            && !self.ctm.is_moving()
            && self.area_light.is_none()
            && self.displacement.is_none()
            && !self.media.differ()
    }

    /// The transform from coordinates relative to `origin` to the group: the current transform at the start, unless an
    /// instance does more than shift the shape. `world_origin` is the origin of rendered space.
    fn placement(&self, origin: DVec3, world_origin: DVec3) -> Placement {
        let m = if self.ctm.only_shifts() { affine(&self.ctm.start) } else { DAffine3::IDENTITY };
        let is_in_world = self.object.is_none() && self.ctm.only_shifts();
        let group_origin = if is_in_world { world_origin } else { near_origin(m.transform_point3(origin)) };
        // pbrt flips the orientation if the transform of the shape reflects, moving or not.
        let flip = self.reverse_orientation ^ swaps_handedness(&affine(&self.ctm.start).as_affine3a());
        Placement {
            group_from_object: rebased(&m, group_origin, origin).as_affine3a(),
            group_origin,
            textured_from_object: rebased(&m, world_origin, origin),
            flip,
            reverse: self.reverse_orientation,
        }
    }
}

/// A transformed quadric; `None` if the transform flattens it, except for a disk along its axis.
pub(super) fn placed_quadric(kind: QuadricKind, m: &Affine3A) -> Option<Quadric> {
    let with = |kind, m: Affine3A| {
        let quadric = Quadric::new(kind, m, swaps_handedness(&m));
        (m.matrix3.determinant() != 0.0 && quadric.local_from_group.is_finite()).then_some(quadric)
    };
    let flat_disk = || {
        let QuadricKind::Disk { height, radius, inner_radius, phi_max } = kind else { return None };
        // The disk has no thickness: any third axis is valid
        let mut upright = *m;
        upright.matrix3.z_axis = m.matrix3.x_axis.cross(m.matrix3.y_axis).normalize_or_zero();
        upright.translation += m.matrix3.z_axis * height;
        with(QuadricKind::Disk { height: 0.0, radius, inner_radius, phi_max }, upright)
    };
    with(kind, *m).or_else(flat_disk)
}

fn place(points: &mut [Vec3], m: &Affine3A) {
    if *m != Affine3A::IDENTITY {
        points.iter_mut().for_each(|p| *p = m.transform_point3(*p));
    }
}

/// Transforms normals to group space; pbrt reverses them if `ReverseOrientation` is set.
fn place_normals(normals: &mut [Vec3], m: &Affine3A, reverse: bool) {
    let sign = if reverse { -1.0 } else { 1.0 };
    normals.iter_mut().for_each(|n| *n = transform_normal(m, *n) * sign);
}

/// The transforms of a shape.
struct Placement {
    group_from_object: Affine3A,
    group_origin: DVec3,
    /// To the space of position-dependent textures: rendered space, with moving shapes and shapes in objects at the
    /// position of their definition.
    textured_from_object: DAffine3,
    /// True if the geometric normal is reversed.
    flip: bool,
    /// `ReverseOrientation`, which reverses given normals as well.
    reverse: bool,
}

impl Placement {
    /// One shape, which takes no more memory than it needs.
    fn made(&self, shape: Shape) -> Made {
        Made { shapes: vec![shape], origin: self.group_origin, warnings: Vec::new() }
    }
}

/// The fine mesh of a control mesh.
fn subdivided(data: MeshData, levels: u32) -> Result<MeshData, String> {
    let faces = data.indices.len() as u64 * 4_u64.saturating_pow(levels);
    if faces > 200_000_000 {
        return Err(format!("{levels} levels make {faces} triangles; at most 200 million are"));
    }
    let mesh = loop_subdivide(levels, data.positions, data.indices)?;
    Ok(MeshData {
        positions: mesh.positions().to_vec(),
        normals: mesh.normals.clone(),
        indices: mesh.indices,
        ..MeshData::default()
    })
}

/// A mesh refined and displaced in its own space.
fn displaced(
    data: MeshData,
    displacement: &DisplacementDesc,
    placement: &Placement,
    textures: &TextureSet,
) -> Result<MeshData, String> {
    let mut mesh = DisplacedMesh::new(data.positions, data.normals, data.uvs, data.indices)?;
    let Placement { group_from_object, textured_from_object, .. } = placement;
    let length = |a: Vec3, b: Vec3| group_from_object.transform_vector3(a - b).length();
    mesh.refine(length, displacement.edge_length, MAX_TRIANGLES)?;
    mesh.displace(|p, n, uv| {
        let p = textured_from_object.transform_point3(p.as_dvec3());
        let n = transform_normal(group_from_object, n);
        let point = TextureContext { uv, uv_width: Vec2::ZERO, uv1: Vec2::ZERO, color: [1.0; 4], face: 0, p, n };
        textures.float(displacement.texture, &point)
    });
    let DisplacedMesh { positions, normals, uvs, indices } = mesh;
    Ok(MeshData { positions, indices, normals, uvs, ..MeshData::default() })
}

fn triangles(mut data: MeshData, placement: &Placement) -> Result<TriangleMesh, String> {
    let m = &placement.group_from_object;
    place(&mut data.positions, m);
    place_normals(&mut data.normals, m, placement.reverse);
    data.tangents.iter_mut().for_each(|t| *t = m.transform_vector3(*t));
    let mut mesh = TriangleMesh::new(data.positions, data.indices)?;
    (mesh.normals, mesh.tangents, mesh.uvs, mesh.faces) = (data.normals, data.tangents, data.uvs, data.faces);
    mesh.flip_normal = placement.flip;
    Ok(mesh)
}

/// Maximum distance of a corner of a parallelogram from its position by the other three, relative to its edges.
const PARALLELOGRAM: f32 = 1e-6;

/// Two triangles for each patch, if all patches are parallelograms without normals. The surface and texture coordinates
/// are the same, and ray tracing is much faster.
fn parallelograms(data: &PatchData) -> Option<MeshData> {
    let corners = |c: &[u32; 4]| c.map(|i| data.positions[i as usize]);
    let is_flat = |c: &[u32; 4]| {
        let [a, b, c, d] = corners(c);
        (a + d - b - c).length() <= PARALLELOGRAM * ((b - a).length() + (c - a).length())
    };
    if !data.normals.is_empty() || !data.indices.iter().all(is_flat) {
        return None;
    }

    // Corners, with the default texture coordinates of patches
    let mut mesh = MeshData::default();
    for patch in &data.indices {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(corners(patch));
        mesh.uvs.extend((0..4).map(|i| match data.uvs.get(patch[i] as usize) {
            Some(&uv) => uv,
            None => Vec2::new((i % 2) as f32, (i / 2) as f32),
        }));
        mesh.indices.extend([[first, first + 1, first + 3], [first, first + 3, first + 2]]);
    }
    mesh.faces = data.faces.iter().flat_map(|&face| [face; 2]).collect();
    Some(mesh)
}

fn patches(mut data: PatchData, placement: &Placement) -> Result<Shape, String> {
    if let Some(mesh) = parallelograms(&data) {
        return triangles(mesh, placement).map(Shape::Mesh);
    }
    let m = &placement.group_from_object;
    place(&mut data.positions, m);
    place_normals(&mut data.normals, m, placement.reverse);
    Ok(Shape::Bilinear(BilinearMesh {
        positions: data.positions,
        indices: data.indices,
        normals: data.normals,
        uvs: data.uvs,
        faces: data.faces,
        flip_normal: placement.flip,
    }))
}

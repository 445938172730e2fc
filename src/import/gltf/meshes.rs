//! Primitives of meshes as triangles.

use super::Messages;
use super::pose::{Pose, Vertices};
use crate::geometry::TriangleMesh;
use lumiris_formats::gltf::{Document, GltfError, Place};
use lumiris_numbers::math::origin::near_origin;
use lumiris_numbers::math::{Affine3A, DVec3, Vec2, Vec3};

/// A primitive in the space of its mesh, relative to an origin.
pub(super) struct Primitive {
    pub mesh: TriangleMesh,
    /// Index of the material.
    pub material: Option<usize>,
}

/// Triangles of a primitive, bent by a pose; `None` for points and lines. The first primitive of a mesh determines the origin of
/// all of them, which is near to its vertices.
pub(super) fn primitive(
    document: &Document,
    place: &Place<'_>,
    (pose, origin): (&Pose, &mut Option<DVec3>),
    messages: &mut Messages<'_>,
) -> Result<Option<Primitive>, GltfError> {
    let mode = place.key("mode").index().unwrap_or(4);
    if !(4..=6).contains(&mode) {
        messages.warning(&place.key("mode"), "points and lines are not rendered");
        return Ok(None);
    }
    let attributes = place.key("attributes");
    let Some(positions) = attributes.key("POSITION").index() else {
        messages.warning(&attributes, "without POSITION there is nothing to render");
        return Ok(None);
    };
    let count = document.accessor(positions)?.count();
    let mut vertices = Vertices {
        positions: vectors(document, &attributes.key("POSITION"), count)?,
        normals: vectors(document, &attributes.key("NORMAL"), count)?,
        tangents: vectors(document, &attributes.key("TANGENT"), count)?,
    };
    pose.bend(document, place, &mut vertices, messages)?;
    let Vertices { mut positions, normals, tangents } = vertices;
    if let Some(i) = positions.iter().position(|p| !p.is_finite()) {
        return Err(attributes.key("POSITION").error(format!("vertex {i} is not finite")));
    }
    let middle = positions.get(count / 2).map_or(DVec3::ZERO, |p| p.as_dvec3());
    let origin = *origin.get_or_insert_with(|| near_origin(middle));
    if origin != DVec3::ZERO {
        positions.iter_mut().for_each(|p| *p = (p.as_dvec3() - origin).as_vec3());
    }
    let indices = match place.key("indices").index() {
        Some(index) => document.accessor(index)?.values.iter().map(|&v| v as u32).collect(),
        None => (0..count as u32).collect::<Vec<u32>>(),
    };
    let triangles = triangles(&indices, mode);
    let mut mesh = TriangleMesh::new(positions, triangles).map_err(|message| place.key("indices").error(message))?;
    let uvs = |name: &str| -> Result<Vec<Vec2>, GltfError> {
        let uvs = per_vertex::<2>(document, &attributes.key(name), count, 0.0)?;
        Ok(uvs.into_iter().map(|[u, v]| Vec2::new(u, 1.0 - v)).collect())
    };
    (mesh.uvs, mesh.uvs1) = (uvs("TEXCOORD_0")?, uvs("TEXCOORD_1")?);
    (mesh.normals, mesh.tangents) = (normals, tangents);
    mesh.colors = per_vertex(document, &attributes.key("COLOR_0"), count, 1.0)?;
    Ok(Some(Primitive { mesh, material: place.key("material").index() }))
}

/// Elements of an attribute, one per vertex, or none if it is not there.
fn per_vertex<const N: usize>(
    document: &Document,
    place: &Place<'_>,
    count: usize,
    fill: f32,
) -> Result<Vec<[f32; N]>, GltfError> {
    let Some(index) = place.index() else { return Ok(Vec::new()) };
    let elements = document.accessor(index)?.elements::<N>(fill);
    if let Some(i) = elements.iter().position(|e| e.iter().any(|x| !x.is_finite())) {
        return Err(place.error(format!("vertex {i} is not finite")));
    }
    if elements.len() == count { Ok(elements) } else { Err(place.error("has not one element per vertex")) }
}

fn vectors(document: &Document, place: &Place<'_>, count: usize) -> Result<Vec<Vec3>, GltfError> {
    Ok(per_vertex::<3>(document, place, count, 0.0)?.into_iter().map(Vec3::from).collect())
}

/// Corners of a list, a strip or a fan.
fn triangles(indices: &[u32], mode: usize) -> Vec<[u32; 3]> {
    match mode {
        5 => indices
            .windows(3)
            .enumerate()
            .map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] })
            .collect(),
        6 => indices.get(1..).unwrap_or_default().windows(2).map(|w| [indices[0], w[0], w[1]]).collect(),
        _ => indices.as_chunks::<3>().0.to_vec(),
    }
}

/// The mesh placed by a transformation.
pub(super) fn placed(mesh: &TriangleMesh, m: &Affine3A) -> Result<TriangleMesh, String> {
    let positions = mesh.positions().iter().map(|&p| m.transform_point3(p)).collect();
    let mut out = TriangleMesh::new(positions, mesh.indices.clone())?;
    let normal = |&n: &Vec3| lumiris_numbers::math::transform::transform_normal(m, n);
    out.normals = mesh.normals.iter().map(normal).collect();
    out.tangents = mesh.tangents.iter().map(|&t| m.transform_vector3(t)).collect();
    (out.uvs, out.uvs1, out.colors) = (mesh.uvs.clone(), mesh.uvs1.clone(), mesh.colors.clone());
    out.flip_normal = m.matrix3.determinant() < 0.0;
    Ok(out)
}

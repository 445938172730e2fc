//! Primitives of meshes as triangles.

use super::messages::Messages;
use super::pose::{Pose, Vertices};
use super::vertices::InUse;
use crate::geometry::TriangleMesh;
use lumiris_formats::gltf::{Document, GltfError, Place};
use lumiris_numbers::math::origin::near_origin;
use lumiris_numbers::math::{DVec3, Vec2, Vec3};

/// A primitive in the space of its mesh, relative to an origin.
pub(super) struct Primitive {
    pub mesh: TriangleMesh,
    /// Index of the material.
    pub material: Option<usize>,
}

/// Triangles of a primitive, deformed by a pose; `None` for points and lines. The first primitive of a mesh determines
/// the common origin, which is near its vertices.
pub(super) fn primitive(
    document: &Document,
    place: &Place<'_>,
    pose: &Pose,
    origin: &mut Option<DVec3>,
    messages: &mut Messages<'_>,
) -> Result<Option<Primitive>, GltfError> {
    let mode = place.key("mode").index().unwrap_or(4);
    if !(4..=6).contains(&mode) {
        messages.warning(&place.key("mode"), "points and lines are not rendered");
        return Ok(None);
    }

    // Indices of the vertices in use
    let attributes = place.key("attributes");
    let Some(positions) = attributes.key("POSITION").index() else {
        messages.warning(&attributes, "without POSITION there is nothing to render");
        return Ok(None);
    };
    let count = document.open(positions)?.count();
    let mut triangles = triangles(&indices(document, place, count)?, mode);
    let in_use = InUse::of(count, &mut triangles, &place.key("indices"))?;

    // Attributes, deformed by the pose
    let read = |name| in_use.read::<3>(document, &attributes.key(name), 0.0);
    let vectors = |values: Vec<[f32; 3]>| values.into_iter().map(Vec3::from).collect::<Vec<_>>();
    let tangents = in_use.read::<4>(document, &attributes.key("TANGENT"), 1.0)?;
    let mut vertices = Vertices {
        positions: vectors(read("POSITION")?),
        normals: vectors(read("NORMAL")?),
        tangents: tangents.iter().map(|&[x, y, z, _]| Vec3::new(x, y, z)).collect(),
    };
    pose.bend(document, place, &in_use, &mut vertices, messages)?;
    let Vertices { mut positions, normals, tangents: moved } = vertices;
    if let Some(i) = positions.iter().position(|p| !p.is_finite()) {
        return Err(attributes.key("POSITION").error(format!("vertex {} is not finite", in_use.vertex(i))));
    }

    move_to_origin(&mut positions, origin);
    let mut mesh = TriangleMesh::new(positions, triangles).map_err(|message| place.key("indices").error(message))?;

    // Other attributes
    mesh.uvs = uvs(document, &in_use, &attributes.key("TEXCOORD_0"))?;
    mesh.uvs1 = uvs(document, &in_use, &attributes.key("TEXCOORD_1"))?;
    (mesh.normals, mesh.tangents) = (normals, moved);
    mesh.tangent_signs = tangents.iter().map(|&[.., w]| if w < 0.0 { -1 } else { 1 }).collect();
    mesh.colors = in_use.read(document, &attributes.key("COLOR_0"), 1.0)?;
    Ok(Some(Primitive { mesh, material: place.key("material").index() }))
}

/// Vertices of the corners of a primitive whose attributes have `count` elements.
fn indices(document: &Document, place: &Place<'_>, count: usize) -> Result<Vec<u32>, GltfError> {
    match place.key("indices").index() {
        Some(index) => Ok(document.accessor(index)?.values.iter().map(|&v| v as u32).collect()),
        None => Ok((0..count as u32).collect()),
    }
}

/// Subtracts the common origin, which is near the positions if there is none yet.
fn move_to_origin(positions: &mut [Vec3], origin: &mut Option<DVec3>) {
    let middle = positions.get(positions.len() / 2).map_or(DVec3::ZERO, |p| p.as_dvec3());
    let origin = *origin.get_or_insert_with(|| near_origin(middle));
    if origin != DVec3::ZERO {
        positions.iter_mut().for_each(|p| *p = (p.as_dvec3() - origin).as_vec3());
    }
}

/// Texture coordinates; glTF has v downwards.
fn uvs(document: &Document, in_use: &InUse, place: &Place<'_>) -> Result<Vec<Vec2>, GltfError> {
    let uvs = in_use.read::<2>(document, place, 0.0)?;
    Ok(uvs.into_iter().map(|[u, v]| Vec2::new(u, 1.0 - v)).collect())
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

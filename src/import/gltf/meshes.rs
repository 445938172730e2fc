//! Primitives of meshes as triangles.

use super::Messages;
use crate::geometry::TriangleMesh;
use lumiris_formats::gltf::document::error;
use lumiris_formats::gltf::{Document, GltfError, Place};
use lumiris_numbers::math::{Affine3A, Vec2, Vec3};

/// A primitive in the space of its mesh.
pub(super) struct Primitive {
    pub mesh: TriangleMesh,
    /// Index of the material.
    pub material: Option<usize>,
}

/// Triangles of a primitive; `None` for points and lines.
pub(super) fn primitive(
    document: &Document,
    place: &Place<'_>,
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
    let positions: Vec<Vec3> = document.accessor(positions)?.elements::<3>(0.0).into_iter().map(Vec3::from).collect();
    if let Some(i) = positions.iter().position(|p| !p.is_finite()) {
        return Err(error(&attributes.key("POSITION"), format!("vertex {i} is not finite")));
    }
    let count = positions.len();
    let indices = match place.key("indices").index() {
        Some(index) => document.accessor(index)?.values.iter().map(|&v| v as u32).collect(),
        None => (0..count as u32).collect::<Vec<u32>>(),
    };
    let triangles = triangles(&indices, mode);
    let mut mesh = TriangleMesh::new(positions, triangles).map_err(|message| error(&place.key("indices"), message))?;
    let values = |name: &str| match attributes.key(name).index() {
        Some(index) => {
            let values = document.accessor(index)?;
            let has_all = values.values.len() == count * values.width;
            if has_all { Ok(Some(values)) } else { Err(error(&attributes.key(name), "has not one element per vertex")) }
        }
        None => Ok(None),
    };
    let uvs = |name: &str| -> Result<Vec<Vec2>, GltfError> {
        let uvs = values(name)?.map_or_else(Vec::new, |v| v.elements::<2>(0.0));
        Ok(uvs.into_iter().map(|[u, v]| Vec2::new(u, 1.0 - v)).collect())
    };
    let vectors = |name: &str| -> Result<Vec<Vec3>, GltfError> {
        Ok(values(name)?.map_or_else(Vec::new, |v| v.elements::<3>(0.0)).into_iter().map(Vec3::from).collect())
    };
    (mesh.uvs, mesh.uvs1) = (uvs("TEXCOORD_0")?, uvs("TEXCOORD_1")?);
    (mesh.normals, mesh.tangents) = (vectors("NORMAL")?, vectors("TANGENT")?);
    mesh.colors = values("COLOR_0")?.map_or_else(Vec::new, |v| v.elements::<4>(1.0));
    if place.key("targets").exists() {
        messages.warning(&place.key("targets"), "morph targets are not applied");
    }
    Ok(Some(Primitive { mesh, material: place.key("material").index() }))
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

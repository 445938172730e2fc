//! Texture coordinates of the corners of faces, as photogrammetry programs write them. A vertex at a texture seam has
//! several coordinates and is split into several vertices.

use super::mesh::PlyMesh;
use lumiris_numbers::math::Vec2;
use std::collections::HashMap;

/// Stands for a corner without coordinates, which uses the coordinates of its vertex.
pub(super) const NONE: Vec2 = Vec2::NAN;

/// Assigns texture coordinates to the corners of the mesh's triangles and quads, by vertices with one pair each. The
/// first pair of a vertex is assigned to it; other pairs are assigned to copies, which are appended.
pub(super) fn apply(mesh: &mut PlyMesh, triangles: &[[Vec2; 3]], quads: &[[Vec2; 4]]) {
    let count = mesh.positions.len();
    let given = std::mem::take(&mut mesh.uvs);
    let of_vertex = |v: usize| given.get(v).copied().filter(|uv| !uv.is_nan()).unwrap_or(Vec2::ZERO);
    let mut uvs = vec![NONE; count];
    let mut sources: Vec<u32> = Vec::new();
    let mut copies: HashMap<(u32, [u32; 2]), u32> = HashMap::new();
    let mut set = |vertex: &mut u32, uv: Vec2| {
        let v = *vertex as usize;
        let uv = if uv.is_nan() { of_vertex(v) } else { uv };
        if uvs[v].is_nan() {
            uvs[v] = uv;
        } else if uvs[v] != uv {
            *vertex = *copies.entry((*vertex, uv.to_array().map(f32::to_bits))).or_insert_with(|| {
                // Meshes with more than 2³² vertices would not fit into memory
                let Ok(copy) = u32::try_from(count + sources.len()) else { return *vertex };
                sources.push(*vertex);
                uvs.push(uv);
                copy
            });
        }
    };
    mesh.triangles.iter_mut().zip(triangles).for_each(|(t, uvs)| t.iter_mut().zip(uvs).for_each(|(v, uv)| set(v, *uv)));
    mesh.quads.iter_mut().zip(quads).for_each(|(q, uvs)| q.iter_mut().zip(uvs).for_each(|(v, uv)| set(v, *uv)));

    // Vertices without faces
    uvs.iter_mut().enumerate().filter(|(_, uv)| uv.is_nan()).for_each(|(v, uv)| *uv = of_vertex(v));
    mesh.uvs = uvs;
    mesh.positions.reserve_exact(sources.len() + 1);
    mesh.normals.reserve_exact(if mesh.normals.is_empty() { 0 } else { sources.len() });
    for source in sources {
        mesh.positions.push(mesh.positions[source as usize]);
        if let Some(&normal) = mesh.normals.get(source as usize) {
            mesh.normals.push(normal);
        }
    }
}

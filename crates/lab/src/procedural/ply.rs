//! Writes meshes as PLY, binary and little-endian: positions, normals and texture coordinates if there are any, and
//! triangles.

use lumiris::geometry::TriangleMesh;
use lumiris_formats::output::write_whole;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Writes a mesh. The file is written completely or not at all.
pub fn write_ply(path: &Path, mesh: &TriangleMesh) -> io::Result<()> {
    write_whole(path, |file| {
        let mut file = BufWriter::with_capacity(1 << 20, file);
        write_to(&mut file, mesh)?;
        file.flush()
    })
}

fn write_to(file: &mut impl Write, mesh: &TriangleMesh) -> io::Result<()> {
    // The header
    let positions = mesh.positions();
    let has_normals = mesh.normals.len() == positions.len();
    let normals = if has_normals { "property float nx\nproperty float ny\nproperty float nz\n" } else { "" };
    let has_uvs = mesh.uvs.len() == positions.len();
    let uvs = if has_uvs { "property float u\nproperty float v\n" } else { "" };
    write!(
        file,
        "ply\nformat binary_little_endian 1.0\ncomment made by Lumiris {}\nelement vertex {}\n\
         property float x\nproperty float y\nproperty float z\n{normals}{uvs}element face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        env!("CARGO_PKG_VERSION"),
        positions.len(),
        mesh.triangle_count()
    )?;

    // Vertices, with the values that the mesh has
    for (i, p) in positions.iter().enumerate() {
        let normal = has_normals.then(|| mesh.normals[i].to_array());
        let uv = has_uvs.then(|| mesh.uvs[i].to_array());
        for x in p.to_array().into_iter().chain(normal.into_iter().flatten()).chain(uv.into_iter().flatten()) {
            file.write_all(&x.to_le_bytes())?;
        }
    }

    // Triangles
    for t in &mesh.indices {
        file.write_all(&[3])?;
        for i in t {
            file.write_all(&i.to_le_bytes())?;
        }
    }
    Ok(())
}

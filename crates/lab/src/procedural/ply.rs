//! Writes meshes as PLY, binary and little-endian: positions, normals if there are any, and triangles.

use lumiris::geometry::TriangleMesh;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Writes a mesh. Either the whole file appears under its name, or none.
pub fn write_ply(path: &Path, mesh: &TriangleMesh) -> io::Result<()> {
    let name = path.file_name().ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "is no name of a file"))?;
    let partial = path.with_file_name(format!(".{}.{}.partial", name.to_string_lossy(), std::process::id()));
    let write = || {
        let mut file = BufWriter::with_capacity(1 << 20, File::create(&partial)?);
        write_to(&mut file, mesh)?;
        file.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()?;
        std::fs::rename(&partial, path)
    };
    write().inspect_err(|_| {
        // What is left of the attempt is of no use; if it is not there, so much the better.
        let _ = std::fs::remove_file(&partial);
    })
}

fn write_to(file: &mut impl Write, mesh: &TriangleMesh) -> io::Result<()> {
    let positions = mesh.positions();
    let has_normals = mesh.normals.len() == positions.len();
    let normals = if has_normals { "property float nx\nproperty float ny\nproperty float nz\n" } else { "" };
    write!(
        file,
        "ply\nformat binary_little_endian 1.0\ncomment made by Lumiris {}\nelement vertex {}\n\
         property float x\nproperty float y\nproperty float z\n{normals}element face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        env!("CARGO_PKG_VERSION"),
        positions.len(),
        mesh.triangle_count()
    )?;
    for (i, p) in positions.iter().enumerate() {
        let vectors = if has_normals { [p, &mesh.normals[i]] } else { [p, p] };
        for v in &vectors[..1 + usize::from(has_normals)] {
            for x in v.to_array() {
                file.write_all(&x.to_le_bytes())?;
            }
        }
    }
    for t in &mesh.indices {
        file.write_all(&[3])?;
        for i in t {
            file.write_all(&i.to_le_bytes())?;
        }
    }
    Ok(())
}

use super::*;
use proptest::prelude::*;
use std::fmt::Write as _;
use std::io::Write as _;

fn parse(bytes: &[u8]) -> Result<PlyMesh, PlyError> {
    parse_ply(bytes, bytes.len() as u64)
}

fn message(bytes: &[u8]) -> String {
    parse(bytes).unwrap_err().to_string()
}

const CUBE_HEAD: &str = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty float u\nproperty float v\nelement face 2\nproperty list uchar int vertex_indices\nproperty int face_indices\nend_header\n";

fn ascii() -> String {
    format!(
        "ply\nformat ascii 1.0\ncomment hello\n{CUBE_HEAD}0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n4 0 1 2 3 7\n3 0 2 3 8\n"
    )
}

fn binary(big: bool) -> Vec<u8> {
    let format = if big { "binary_big_endian" } else { "binary_little_endian" };
    let mut out = format!("ply\r\nformat {format} 1.0\r\n{}", CUBE_HEAD.replace('\n', "\r\n")).into_bytes();
    let float = |v: f32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
    let int = |v: i32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
    for v in [[0., 0., 0., 0., 0.], [1., 0., 0., 1., 0.], [1., 1., 0., 1., 1.], [0., 1., 0., 0., 1.]] {
        v.iter().for_each(|&c| out.extend(float(c)));
    }
    out.push(4);
    [0, 1, 2, 3, 7].iter().for_each(|&i| out.extend(int(i)));
    out.push(3);
    [0, 2, 3, 8].iter().for_each(|&i| out.extend(int(i)));
    out
}

#[test]
fn all_encodings_give_the_same_mesh() {
    let mesh = parse(ascii().as_bytes()).unwrap();
    assert_eq!(mesh.positions.len(), 4);
    assert_eq!(mesh.uvs[2], Vec2::ONE);
    assert_eq!(mesh.triangles, [[0, 2, 3]]);
    assert_eq!(mesh.quads, [[0, 1, 3, 2]]);
    assert_eq!(mesh, parse(&binary(false)).unwrap());
    assert_eq!(mesh, parse(&binary(true)).unwrap());
}

#[test]
fn gzip_files_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply.gz");
    let mut encoder = flate2::write::GzEncoder::new(File::create(&path).unwrap(), flate2::Compression::fast());
    encoder.write_all(&binary(false)).unwrap();
    encoder.finish().unwrap();
    assert_eq!(read_ply(&path).unwrap().quads.len(), 1);
}

#[test]
fn broken_files_are_refused_with_a_reason() {
    assert!(message(b"").contains("empty"));
    assert!(message(b"obj\n").contains("not a PLY"));
    assert!(message(b"ply\nformat ascii 1.0\nend_header\n").contains("no vertices"));
    let text = ascii();
    assert!(message(text.replace("3 0 2 3 8", "3 0 2 4 8").as_bytes()).contains("face 1 refers to vertex 4"));
    assert!(message(text.replace("3 0 2 3 8", "3 0 -2 3 8").as_bytes()).contains("refers to vertex -2"));
    assert!(message(text.replace("3 0 2 3 8", "3 0 2 x 8").as_bytes()).contains("`x`"));
    assert!(message(text.replace("vertex 4", "vertex 4000000000").as_bytes()).contains("more than the file can hold"));
    assert!(message(text.replace("face 2", "face 99999999999999999999").as_bytes()).contains("not understood"));
    assert!(message(text.replace("float x", "quaternion x").as_bytes()).contains("line 5 of the header"));
    assert!(message(text.replace("float x", "float w").as_bytes()).contains("no x, y and z"));
    for cut in 0..binary(false).len() {
        assert!(parse(&binary(false)[..cut]).is_err(), "{cut} bytes were accepted");
    }
}

#[test]
fn polygons_become_fans_and_broken_vertices_lose_their_faces() {
    let text = ascii().replace("3 0 2 3 8", "5 0 1 2 3 1 8").replace("0 1 0 0 1", "0 nan 0 0 1");
    let mesh = parse(text.as_bytes()).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
    assert!(mesh.quads.is_empty());
    assert_eq!(mesh.positions[3], Vec3::ZERO);
    assert_eq!(mesh.warnings.len(), 2, "{:?}", mesh.warnings);
}

/// A grid of 2·columns·rows triangles with a wave, in the commonest layout.
fn grid(columns: u32, rows: u32) -> Vec<u8> {
    let vertices = (columns + 1) * (rows + 1);
    let mut head = String::new();
    let faces = 2 * columns * rows;
    write!(head, "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\nelement face {faces}\nproperty list uchar int vertex_indices\nend_header\n").unwrap();
    let mut out = head.into_bytes();
    out.reserve((vertices * 12 + faces * 13) as usize);
    for y in 0..=rows {
        for x in 0..=columns {
            for c in [x as f32, y as f32, (x as f32 * 0.1).sin()] {
                out.extend(c.to_le_bytes());
            }
        }
    }
    for y in 0..rows {
        for x in 0..columns {
            let a = y * (columns + 1) + x;
            for t in [[a, a + 1, a + columns + 2], [a, a + columns + 2, a + columns + 1]] {
                out.push(3);
                t.iter().for_each(|i| out.extend(i.to_le_bytes()));
            }
        }
    }
    out
}

#[test]
fn large_meshes_are_read_in_blocks() {
    let mut bytes = grid(300, 200);
    let mesh = parse(&bytes).unwrap();
    assert_eq!((mesh.positions.len(), mesh.triangles.len()), (301 * 201, 120_000));
    assert_eq!(mesh.triangles[119_999], [301 * 199 + 299, 301 * 200 + 300, 301 * 200 + 299]);
    assert_eq!(mesh.positions[301 * 7 + 5].y, 7.0);
    // The last index becomes too large.
    let end = bytes.len();
    bytes[end - 1] = 1;
    assert!(message(&bytes).contains("face 119999 refers to vertex"), "{}", message(&bytes));
}

/// The reader must not be slower than the disk: 190 MB in well under a second.
#[test]
fn ten_million_triangles_are_read_fast() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grid.ply");
    std::fs::write(&path, grid(2500, 2000)).unwrap();
    let mut best = f64::INFINITY;
    for _ in 0..3 {
        let start = std::time::Instant::now();
        assert_eq!(read_ply(&path).unwrap().triangles.len(), 10_000_000);
        best = best.min(start.elapsed().as_secs_f64());
    }
    eprintln!("10 M triangles in {best:.3} s");
    // Generous: the machine may be shared and the build unoptimised.
    assert!(best < 5.0, "{best} s");
}

proptest! {
    #[test]
    fn damaged_files_never_panic(damage in proptest::collection::vec((any::<proptest::sample::Index>(), any::<u8>()), 1..6), which in 0..3) {
        let mut bytes = match which { 0 => ascii().into_bytes(), 1 => binary(false), _ => binary(true) };
        for (place, value) in damage {
            let i = place.index(bytes.len());
            bytes[i] = value;
        }
        if let Ok(mesh) = parse(&bytes) {
            let n = mesh.positions.len();
            prop_assert!(mesh.triangles.iter().flatten().chain(mesh.quads.iter().flatten()).all(|&v| (v as usize) < n));
        }
    }
}

//! Faces, corners, strips, and the size of a mesh.

use super::writer::*;
use crate::ply::header::Scalar::*;
use crate::ply::*;
use lumiris_numbers::math::Vec3;
use lumiris_test_support::random::pcg32;

#[test]
fn polygons_become_fans_and_faces_without_area_are_left_out() {
    for format in FORMATS {
        let head = "element face 5\nproperty list uchar int vertex_indices";
        let bytes = with_faces(format, head, |w| {
            for face in [&[0., 1., 2., 3., 4.][..], &[], &[1.], &[1., 2.], &[4., 3., 2.]] {
                w.list(U8, I32, face).end_row();
            }
        });
        let mesh = parse_ply(&bytes).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [4, 3, 2]], "{format}");
        assert!(mesh.quads.is_empty());
        let expected = [
            "1 faces have more than four vertices; each becomes a fan of triangles",
            "3 faces have less than three vertices and are left out",
        ];
        assert_eq!(mesh.warnings, expected);
    }
}

#[test]
fn corners_of_faces_have_texture_coordinates_of_their_own() {
    // A triangle, a quad, a polygon, and one with none; before the indices and behind them
    let faces: [&[f64]; 4] = [&[0., 1., 2.], &[0., 1., 2., 3.], &[0., 1., 2., 3., 4.], &[2., 3., 4.]];
    let uv = |face: usize, corner: usize| match face {
        // The triangle and the quad have a seam at the corners 1 and 2, and agree at 0
        0 | 1 => [corner as f64 / 8.0 + if corner > 0 { face as f64 } else { 0.0 }, 0.5],
        _ => [corner as f64, 2.0],
    };
    for format in FORMATS {
        for is_first in [false, true] {
            let lists = ["property list uchar int vertex_indices", "property list uchar float texcoord"];
            let [a, b] = if is_first { [lists[1], lists[0]] } else { lists };
            let mut w = Writer::new(format);
            w.head("element vertex 5").head(XYZ).head("property float nx\nproperty float ny\nproperty float nz");
            w.head("property float s\nproperty float t\nelement face 4").head(a).head("property int texnumber").head(b);
            for (i, c) in CORNERS.iter().enumerate() {
                w.numbers(F32, c).numbers(F32, &[i as f64, 0., 0.]).numbers(F32, &[10. + i as f64, 0.]).end_row();
            }
            for (f, face) in faces.iter().enumerate() {
                let uvs: Vec<f64> = if f == 3 { vec![] } else { (0..face.len()).flat_map(|c| uv(f, c)).collect() };
                if is_first {
                    w.list(U8, F32, &uvs).number(I32, 0.).list(U8, I32, face).end_row();
                } else {
                    w.list(U8, I32, face).number(I32, 0.).list(U8, F32, &uvs).end_row();
                }
            }
            let mesh = parse_ply(&w.bytes()).unwrap();
            assert_is_sound(&mesh);
            let check = |vertex: u32, face: usize, corner: usize| {
                let [v, source] = [vertex as usize, faces[face][corner] as usize];
                let expected = if face == 3 { [10. + source as f64, 0.] } else { uv(face, corner) };
                assert_eq!(mesh.uvs[v].to_array(), expected.map(|x| x as f32), "{format} face {face}, corner {corner}");
                assert_eq!(mesh.positions[v], Vec3::from(CORNERS[source].map(|x| x as f32)));
                assert_eq!(mesh.normals[v].x, source as f32);
            };
            let fans = [(0, [0, 1, 2]), (2, [0, 1, 2]), (2, [0, 2, 3]), (2, [0, 3, 4]), (3, [0, 1, 2])];
            assert_eq!((mesh.triangles.len(), mesh.quads.len()), (5, 1));
            for (triangle, (face, corners)) in mesh.triangles.iter().zip(fans) {
                triangle.iter().zip(corners).for_each(|(&v, corner)| check(v, face, corner));
            }
            mesh.quads[0].iter().enumerate().for_each(|(corner, &v)| check(v, 1, corner));
            // Pairs of a vertex and its coordinates: 3 + 3 of the quad (one shared) + 5 + 3
            assert_eq!(mesh.positions.len(), 14, "{format}");
            assert!(mesh.positions.capacity() > mesh.positions.len());
            assert_eq!(mesh.warnings, ["1 faces have more than four vertices; each becomes a fan of triangles"]);
        }
    }
}

#[test]
fn colours_and_textures_that_are_not_read_are_named_once() {
    let head = "element face 3\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\n\
                property int texnumber\nproperty uchar red\nelement multi_texture_vertex 1\nproperty float tx\n\
                element edge 0\nproperty uchar blue";
    let bytes = with_faces("ascii", head, |w| {
        w.list(U8, I32, &[0., 1., 2.]).list(U8, F32, &[0.; 5]).numbers(I32, &[0., 255.]).end_row();
        w.list(U8, I32, &[0., 1., 2.]).list(U8, F32, &[]).numbers(I32, &[0., 255.]).end_row();
        w.list(U8, I32, &[0., 1., 2.]).list(U8, F32, &[0.; 6]).numbers(I32, &[1., 255.]).end_row();
        w.number(F32, 0.5).end_row();
    });
    let with_colors =
        String::from_utf8(bytes).unwrap().replacen("float z", "float z\nproperty uchar Red\nproperty float u", 1);
    let with_colors = CORNERS.iter().fold(with_colors, |text, c| {
        let row = format!("{} {} {} \n", c[0], c[1], c[2]);
        text.replacen(&row, &row.replace('\n', "255 0\n"), 1)
    });
    let mesh = parse_ply(with_colors.as_bytes()).unwrap();
    let expected = [
        "colours and textures are those of the material; not read: `Red`, `u` of `vertex`; `red` of `face`; \
         `multi_texture_vertex`",
        "1 faces have a `texcoord` that is not two numbers for each corner; it is not used",
        "faces have different textures (`texnumber`), but all of them get that of the material",
    ];
    assert_eq!(mesh.warnings, expected);
    assert_eq!(mesh.uvs.len(), mesh.positions.len());
    assert!(parse_ply(&sample("ascii")).unwrap().warnings.is_empty());
}

#[test]
fn strips_keep_their_orientation_and_restart() {
    for format in FORMATS {
        let bytes = with_faces(format, "element tristrips 2\nproperty list int int vertex_indices", |w| {
            w.list(I32, I32, &[0., 1., 3., 2., 4., -1., 4., 3., 2., -1., 0., 1.]).end_row();
            w.list(I32, I32, &[0., 1., 1., 2., 3.]).end_row();
        });
        let mesh = parse_ply(&bytes).unwrap();
        // The second strip has two degenerate triangles; the last one is the third, which keeps the orientation.
        assert_eq!(mesh.triangles, [[0, 1, 3], [3, 1, 2], [3, 2, 4], [4, 3, 2], [1, 2, 3]], "{format}");
        let wrong = with_faces(format, "element tristrips 1\nproperty list int int vertex_indices", |w| {
            w.list(I32, I32, &[0., 1., -2.]).end_row();
        });
        assert!(message(&wrong).contains("face 0 refers to vertex -2"), "{}", message(&wrong));
    }
}

#[test]
fn blocks_of_triangles_and_other_faces_mix_in_any_way() {
    let mut random = pcg32([7, 0, 0]);
    for format in FORMATS {
        let kinds: Vec<usize> =
            (0..60_000).map(|i| if i % 20_000 < 15_000 { 3 } else { below(&mut random, 6) }).collect();
        let head = format!("element face {}\nproperty list uchar uint vertex_indices\nproperty uchar tag", kinds.len());
        let bytes = with_faces(format, &head, |w| {
            for (i, &kind) in kinds.iter().enumerate() {
                let corners: Vec<f64> = (0..kind).map(|k| ((i + k) % 5) as f64).collect();
                w.list(U8, U32, &corners).number(U8, 3.).end_row();
            }
        });
        let (mut triangles, mut quads) = (Vec::new(), Vec::new());
        for (i, &kind) in kinds.iter().enumerate() {
            let at = |k: usize| ((i + k) % 5) as u32;
            match kind {
                4 => quads.push([at(0), at(1), at(2), at(3)]),
                kind => (2..kind).for_each(|k| triangles.push([at(0), at(k - 1), at(k)])),
            }
        }
        let mesh = parse_ply(&bytes).unwrap();
        assert!(mesh.triangles == triangles && mesh.quads == quads, "{format}");
    }
}

#[test]
fn the_size_of_a_mesh_is_known_from_its_header() {
    let head = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
             property float nx\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
        )
        .into_bytes()
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    let size = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        ply_size(&path).unwrap()
    };
    // A quadrilateral and a triangle
    let mut binary = head("binary_little_endian");
    binary.extend([0; 5 * 16 + 1 + 4 * 4 + 1 + 3 * 4]);
    assert_eq!(size(&binary), PlySize { bytes: 5 * 24 + 3 * 12, triangles: 3 });
    // The corners in text and in compressed files are not known
    let at_least = PlySize { bytes: 5 * 24 + 2 * 12, triangles: 2 };
    let text = [&head("ascii")[..], &b"0 0 0 0\n".repeat(5), b"4 0 1 2 3\n3 0 1 2\n"].concat();
    assert_eq!([size(&text), size(&compressed(&binary))], [at_least; 2]);
    // Counts that the file cannot have
    std::fs::write(&path, head("ascii")).unwrap();
    assert!(ply_size(&path).is_err());
}

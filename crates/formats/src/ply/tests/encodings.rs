//! Encodings, types and orders of values.

use super::writer::*;
use crate::ply::header::Scalar::*;
use crate::ply::*;
use lumiris_numbers::math::{DVec3, Vec2, Vec3};

#[test]
fn all_encodings_give_the_same_mesh() {
    let mesh = parse_ply(&sample("ascii")).unwrap();
    assert_eq!(mesh.positions, CORNERS.map(|c| Vec3::from(c.map(|v| v as f32))));
    assert_eq!(mesh.uvs, CORNERS.map(|c| Vec2::new(c[0] as f32, c[1] as f32)));
    assert_eq!((mesh.triangles.as_slice(), mesh.quads.as_slice()), ([[3, 2, 4]].as_slice(), [[0, 1, 2, 3]].as_slice()));
    assert!(mesh.normals.is_empty() && mesh.warnings.is_empty(), "{:?}", mesh.warnings);
    assert!(mesh.positions.capacity() > mesh.positions.len());
    for format in FORMATS {
        assert_eq!(parse_ply(&sample(format)).unwrap(), mesh, "{format}");
    }
}

#[test]
fn every_scalar_type_can_hold_every_property() {
    for format in FORMATS {
        for (ty, spellings) in SCALARS {
            for (count, _) in SCALARS.iter().filter(|s| s.0.is_integer()) {
                let mut w = Writer::new(format);
                w.head("element vertex 3");
                for property in ["x", "y", "z", "nx", "ny", "nz", "s", "t"] {
                    w.head(&format!("property {} {property}", spellings[0]));
                }
                w.head("element face 1");
                w.head(&format!("property list {} {} vertex_index", name(*count, 1), spellings[1]));
                for i in 0..3 {
                    w.numbers(ty, &[f64::from(i), 20., 30., 0., 0., 1., 5., f64::from(i)]).end_row();
                }
                w.list(*count, ty, &[2., 0., 1.]).end_row();
                let mesh = parse_ply(&w.bytes()).unwrap();
                assert_eq!(mesh.positions, [0., 1., 2.].map(|x| Vec3::new(x, 20., 30.)), "{format} {ty:?} {count:?}");
                assert_eq!(mesh.normals, [Vec3::Z; 3]);
                assert_eq!(mesh.uvs[2], Vec2::new(5., 2.));
                assert_eq!(mesh.triangles, [[2, 0, 1]]);
            }
        }
    }
}

#[test]
fn signed_values_keep_their_sign() {
    for format in FORMATS {
        for (ty, value) in
            [(I8, -128.), (I16, -32768.), (I32, -2147483648.), (F32, -0.1), (F64, -1e-3), (U8, 255.), (U16, 65535.)]
        {
            let mut w = Writer::new(format);
            w.head("element vertex 1");
            ["x", "y", "z"].iter().for_each(|p| {
                w.head(&format!("property {} {p}", name(ty, 0)));
            });
            w.numbers(ty, &[value; 3]);
            let mesh = parse_ply(&w.bytes()).unwrap();
            let p = mesh.positions[0].as_dvec3() + mesh.origin;
            assert_eq!(p.as_vec3(), Vec3::splat(value as f32), "{format} {ty:?}");
        }
    }
}

#[test]
fn doubles_far_from_the_origin_keep_their_differences() {
    let at = [4e6, 4e6 + 0.01, 4e6 + 12.37];
    for format in FORMATS {
        for with_list in [false, true] {
            let mut w = Writer::new(format);
            w.head("element vertex 3\nproperty double x\nproperty double y\nproperty double z");
            if with_list {
                w.head("property list uchar uchar weights");
            }
            for x in at {
                w.numbers(F64, &[x, -x, 0.5]);
                if with_list {
                    w.list(U8, U8, &[]);
                }
                w.end_row();
            }
            let mesh = parse_ply(&w.bytes()).unwrap();
            for (x, near) in at.iter().zip(&mesh.positions) {
                let p = near.as_dvec3() + mesh.origin;
                assert!((p - DVec3::new(*x, -x, 0.5)).length() < 1e-5, "{format}: {p}");
                assert!(near.length() < 120.0, "{format}: {near}");
            }
            assert!(mesh.positions.capacity() > 3, "room for the element that a mesh adds");
        }
    }
}

#[test]
fn properties_may_come_in_any_order_with_others_between() {
    for format in FORMATS {
        for with_list in [false, true] {
            let mut w = Writer::new(format);
            w.head(
                "element vertex 2\nproperty uchar red\nproperty float z\nproperty double nz\nproperty float texture_v",
            );
            if with_list {
                w.head("property list ushort double weights");
            }
            w.head(
                "property short y\nproperty float nx\nproperty float texture_u\nproperty float x\nproperty float ny",
            );
            for i in 0..2 {
                w.number(U8, 9.).number(F32, 3.).number(F64, 6.).number(F32, 8.);
                if with_list {
                    w.list(U16, F64, &[0.5; 3][..i + 1]);
                }
                w.number(I16, 2.).number(F32, 4.).number(F32, 7.).number(F32, 1.).number(F32, 5.).end_row();
            }
            let mesh = parse_ply(&w.bytes()).unwrap();
            assert_eq!(mesh.positions, [Vec3::new(1., 2., 3.); 2], "{format} {with_list}");
            assert_eq!(mesh.normals, [Vec3::new(4., 5., 6.); 2]);
            assert_eq!(mesh.uvs, [Vec2::new(7., 8.); 2]);
        }
    }
}

#[test]
fn every_name_of_texture_coordinates_is_known() {
    for (u, v) in [("u", "v"), ("s", "t"), ("texture_u", "texture_v"), ("texture_s", "texture_t")] {
        let text = String::from_utf8(replaced("float u", &format!("float {u}"))).unwrap();
        let mesh = parse_ply(text.replace("float v", &format!("float {v}")).as_bytes()).unwrap();
        assert_eq!(mesh.uvs[1], Vec2::X, "{u}");
    }
    assert!(parse_ply(&replaced("float v", "float t")).unwrap().uvs.is_empty());
}

#[test]
fn other_elements_before_between_and_behind_are_passed_over() {
    for format in FORMATS {
        let mut w = Writer::new(format);
        w.head(
            "element camera 2\nproperty double fov\nproperty list uchar short ids\nelement nothing 4\nelement vertex 3",
        );
        w.head(XYZ).head("element material 1\nproperty int id\nelement face 1\nproperty uchar flags");
        w.head("property list int float weights\nproperty list uchar uint vertex_indices\nproperty ushort tail");
        w.head("element edge 1\nproperty int a\nproperty int b");
        for i in 0..2 {
            w.number(F64, 0.5).list(U8, I16, &[1., -2., 3.][..i]).end_row();
        }
        CORNERS[..3].iter().for_each(|c| {
            w.numbers(F32, c).end_row();
        });
        w.number(I32, 3.).end_row();
        w.number(U8, 1.).list(I32, F32, &[0.25, 0.75]).list(U8, U32, &[0., 2., 1.]).number(U16, 5.).end_row();
        w.numbers(I32, &[1., 2.]).end_row();
        let mesh = parse_ply(&w.bytes()).unwrap();
        assert_eq!((mesh.positions.len(), mesh.triangles.as_slice()), (3, [[0, 2, 1]].as_slice()), "{format}");
    }
}

#[test]
fn faces_may_come_before_the_vertices() {
    for format in FORMATS {
        let mut w = Writer::new(format);
        w.head("element face 1\nproperty list uchar int vertex_indices\nelement vertex 3").head(XYZ);
        w.list(U8, I32, &[0., 1., 2.]).end_row();
        CORNERS[..3].iter().for_each(|c| {
            w.numbers(F32, c).end_row();
        });
        assert_eq!(parse_ply(&w.bytes()).unwrap().triangles, [[0, 1, 2]], "{format}");
    }
}

#[test]
fn line_ends_and_the_last_newline_do_not_matter() {
    let expected = parse_ply(&sample("ascii")).unwrap();
    for end in ["\r\n", "\r", "\n"] {
        let text = String::from_utf8(sample("ascii")).unwrap();
        assert_eq!(parse_ply(text.replace('\n', end).as_bytes()).unwrap(), expected, "{end:?}");
        assert_eq!(parse_ply(text.trim_end().replace('\n', end).as_bytes()).unwrap(), expected, "{end:?}");
        for format in &FORMATS[1..] {
            let bytes = sample(format);
            let at = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
            let head = String::from_utf8(bytes[..at].to_vec()).unwrap().replace('\n', end);
            assert_eq!(parse_ply(&[head.as_bytes(), &bytes[at..]].concat()).unwrap(), expected, "{format} {end:?}");
        }
    }
}

#[test]
fn data_that_looks_like_a_line_end_is_data() {
    for end in ["\r\n", "\r", "\n"] {
        let head =
            format!("ply\nformat binary_little_endian 1.0\nelement vertex 1\n{XYZ}\nend_header\n").replace('\n', end);
        // A number whose first byte is LF.
        let x = f32::from_le_bytes([b'\n', 0, 0x80, 0x3f]);
        let bytes = [head.as_bytes(), &x.to_le_bytes(), &[0; 8]].concat();
        assert_eq!(parse_ply(&bytes).unwrap().positions, [Vec3::new(x, 0., 0.)], "{end:?}");
    }
}

#[test]
fn files_are_read_plain_and_compressed() {
    let folder = tempfile::tempdir().unwrap();
    for format in FORMATS {
        let expected = parse_ply(&sample(format)).unwrap();
        let path = folder.path().join("a.ply");
        std::fs::write(&path, sample(format)).unwrap();
        assert_eq!(read_ply(&path).unwrap(), expected);
        std::fs::write(&path, compressed(&sample(format))).unwrap();
        assert_eq!(read_ply(&path).unwrap(), expected);
        // Two members, as some tools write.
        let (first, second) = (&sample(format)[..100], &sample(format)[100..]);
        assert_eq!(parse_ply(&[compressed(first), compressed(second)].concat()).unwrap(), expected);
    }
    let missing = read_ply(&folder.path().join("none.ply")).unwrap_err().to_string();
    assert!(missing.contains("none.ply: "), "{missing}");
    assert!(read_ply(folder.path()).unwrap_err().to_string().contains("not a regular file"));
}

#[test]
fn damaged_compression_is_noticed() {
    let bytes = compressed(&sample("binary_little_endian"));
    for cut in 2..bytes.len() {
        assert!(parse_ply(&bytes[..cut]).is_err(), "{cut} of {} bytes were accepted", bytes.len());
    }
    let mut wrong = bytes.clone();
    let checksum = wrong.len() - 8;
    wrong[checksum] ^= 1;
    assert!(matches!(parse_ply(&wrong), Err(PlyError::Io { .. })));
}

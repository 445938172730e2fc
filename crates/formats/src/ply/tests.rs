use super::*;
use flate2::{Compression, write::GzEncoder};
use header::Scalar::{self, *};
use lumiris_numbers::math::{DVec3, Vec2, Vec3};
use lumiris_test_support::random::{Pcg32, RngExt, pcg32};
use std::io::Write as _;
use stream::Stream;

const FORMATS: [&str; 3] = ["ascii", "binary_little_endian", "binary_big_endian"];
const SCALARS: [(Scalar, [&str; 2]); 8] = [
    (I8, ["char", "int8"]),
    (U8, ["uchar", "uint8"]),
    (I16, ["short", "int16"]),
    (U16, ["ushort", "uint16"]),
    (I32, ["int", "int32"]),
    (U32, ["uint", "uint32"]),
    (F32, ["float", "float32"]),
    (F64, ["double", "float64"]),
];

/// Writes a file in any encoding.
struct Writer {
    format: &'static str,
    head: String,
    body: Vec<u8>,
}

impl Writer {
    fn new(format: &'static str) -> Self {
        Writer { format, head: format!("ply\nformat {format} 1.0\n"), body: Vec::new() }
    }

    fn head(&mut self, lines: &str) -> &mut Self {
        self.head.push_str(lines);
        self.head.push('\n');
        self
    }

    fn number(&mut self, ty: Scalar, value: f64) -> &mut Self {
        macro_rules! put {
            ($ty:ty) => {
                match self.format {
                    "ascii" => write!(self.body, "{} ", value as $ty).unwrap(),
                    "binary_little_endian" => self.body.extend((value as $ty).to_le_bytes()),
                    _ => self.body.extend((value as $ty).to_be_bytes()),
                }
            };
        }
        match ty {
            I8 => put!(i8),
            U8 => put!(u8),
            I16 => put!(i16),
            U16 => put!(u16),
            I32 => put!(i32),
            U32 => put!(u32),
            F32 => put!(f32),
            F64 => put!(f64),
        }
        self
    }

    fn numbers(&mut self, ty: Scalar, values: &[f64]) -> &mut Self {
        values.iter().for_each(|&v| {
            self.number(ty, v);
        });
        self
    }

    fn list(&mut self, count: Scalar, ty: Scalar, values: &[f64]) -> &mut Self {
        self.number(count, values.len() as f64).numbers(ty, values)
    }

    fn end_row(&mut self) -> &mut Self {
        if self.format == "ascii" {
            self.body.push(b'\n');
        }
        self
    }

    fn bytes(&self) -> Vec<u8> {
        [self.head.as_bytes(), b"end_header\n", &self.body].concat()
    }
}

fn name(ty: Scalar, spelling: usize) -> &'static str {
    SCALARS.iter().find(|s| s.0 == ty).unwrap().1[spelling]
}

const XYZ: &str = "property float x\nproperty float y\nproperty float z";
const CORNERS: [[f64; 3]; 5] = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.], [0.5, 2., 0.25]];

/// Five vertices with texture coordinates, a quad and a triangle with a number each.
fn sample(format: &'static str) -> Vec<u8> {
    let mut w = Writer::new(format);
    w.head("comment made by hand\nobj_info nothing").head("element vertex 5").head(XYZ);
    w.head("property float u\nproperty float v\nelement face 2");
    w.head("property list uchar int vertex_indices\nproperty int face_indices");
    for c in CORNERS {
        w.numbers(F32, &c).numbers(F32, &c[..2]).end_row();
    }
    w.list(U8, I32, &[0., 1., 2., 3.]).number(I32, 7.0).end_row();
    w.list(U8, I32, &[3., 2., 4.]).number(I32, 8.0).end_row();
    w.bytes()
}

/// A file with five vertices, followed by the content of `fill`.
fn with_faces(format: &'static str, head: &str, fill: impl Fn(&mut Writer)) -> Vec<u8> {
    let mut w = Writer::new(format);
    w.head("element vertex 5").head(XYZ).head(head);
    for c in CORNERS {
        w.numbers(F32, &c).end_row();
    }
    fill(&mut w);
    w.bytes()
}

fn message(bytes: &[u8]) -> String {
    parse_ply(bytes).unwrap_err().to_string()
}

fn replaced(from: &str, to: &str) -> Vec<u8> {
    let text = String::from_utf8(sample("ascii")).unwrap();
    assert!(text.contains(from), "{from}");
    text.replace(from, to).into_bytes()
}

fn below(random: &mut Pcg32, count: usize) -> usize {
    random.random_range(0..count)
}

fn compressed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn assert_is_sound(mesh: &PlyMesh) {
    let n = mesh.positions.len();
    assert!(mesh.triangles.iter().flatten().chain(mesh.quads.iter().flatten()).all(|&v| (v as usize) < n));
    assert!(mesh.positions.iter().all(|p| p.is_finite()));
    assert!(mesh.normals.is_empty() || mesh.normals.len() == n);
    assert!(mesh.uvs.is_empty() || mesh.uvs.len() == n);
}

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

#[test]
fn broken_headers_are_refused_with_line_and_reason() {
    assert_eq!(message(b""), "line 1 of the header: the file is empty");
    assert!(message(b"obj\n").contains("line 1 of the header: is not a PLY file"));
    assert!(message(b"ply\nformat ascii 1.0\nend_header\n").contains("no `vertex` element"));
    assert!(
        message(b"ply\nelement vertex 0\nend_header\n")
            .contains("line 3 of the header: `end_header`, where a `format`")
    );
    assert!(message(b"ply\nformat ascii 1.0\nproperty int x\n").contains("line 3"));
    assert!(
        message(&[b"ply\ncomment ".as_slice(), &[b'x'; 9000]].concat())
            .contains("line 2 of the header: the line has no end")
    );
    let endless = format!("ply\nformat ascii 1.0\n{}", "comment\n".repeat(20_000));
    assert!(message(endless.as_bytes()).contains("the header has no end"));
    for (from, to, expected) in [
        ("float x", "quaternion x", "line 6 of the header: `property quaternion x`"),
        ("float x", "float w", "line 5 of the header: vertices have no properties x, y and z"),
        ("format ascii", "format octal", "line 2 of the header: `format octal 1.0`"),
        ("vertex 5", "vertex -5", "line 5 of the header"),
        ("face 2", "face 99999999999999999999", "line 11 of the header"),
        ("element face", "element vertex", "`vertex` is announced twice"),
        ("list uchar", "list float", "line 12 of the header"),
        ("obj_info", "info", "line 4 of the header: `info nothing`"),
    ] {
        let found = message(&replaced(from, to));
        assert!(found.contains(expected), "{from} -> {to}: {found}");
    }
}

#[test]
fn absurd_counts_are_refused_before_anything_is_allocated() {
    for format in FORMATS {
        for (from, to) in
            [("vertex 5", "vertex 4000000000"), ("face 2", "face 18446744073709551615"), ("face 2", "face 4294967296")]
        {
            let bytes = sample(format);
            let at = bytes.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
            let changed = [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat();
            for bytes in [compressed(&changed), changed] {
                let error = parse_ply(&bytes).unwrap_err();
                assert!(matches!(error, PlyError::Counts { .. }), "{format} {to}: {error}");
            }
        }
    }
    // The maximum expansion of deflate is accepted, but memory is only reserved as data are read.
    let mut reader: &[u8] = &[];
    assert_eq!(Stream::new(&mut reader, 1200).trusted_items(u64::MAX, 12), 100);
    let mut reader: &[u8] = &[];
    let stream = Stream::inflated(&mut reader, 1200);
    assert!(stream.remaining_limit() > 1_000_000 && stream.trusted_items(u64::MAX, 12) == 1600);
    // Rows without columns take no bytes and no time.
    let empty =
        with_faces("ascii", "element face 4294967295\nelement tristrips 4294967295\nelement x 4294967295", |_| ());
    assert_eq!(parse_ply(&empty).unwrap().positions.len(), 5);
}

#[test]
fn lists_that_do_not_fit_are_refused_before_anything_is_allocated() {
    for format in FORMATS {
        for (name, length) in [("face", 4e9), ("tristrips", 4e9), ("other", 4e9)] {
            let head = format!("element {name} 1\nproperty list uint int vertex_indices");
            let bytes = with_faces(format, &head, |w| {
                w.number(U32, length).number(I32, 0.0);
            });
            assert!(matches!(parse_ply(&bytes), Err(PlyError::Truncated { .. })), "{format} {name}");
            let bytes = with_faces(format, &head.replace("uint", "char"), |w| {
                w.number(I8, -3.).number(I32, 0.0);
            });
            assert!(matches!(parse_ply(&bytes), Err(PlyError::ListLength { length: -3, .. })), "{format} {name}");
        }
    }
}

#[test]
fn indices_out_of_range_are_refused_with_their_face() {
    for format in FORMATS {
        for (ty, index) in [(I32, 5.), (I32, -1.), (U32, 4294967295.), (U8, 255.), (F32, 1.5), (F32, f64::NAN)] {
            let head = format!("element face 3\nproperty list uchar {} vertex_indices", name(ty, 0));
            let bytes = with_faces(format, &head, |w| {
                w.list(U8, ty, &[0., 1., 2.]).end_row().list(U8, ty, &[0., 1., 2.]).end_row();
                w.list(U8, ty, &[0., index, 2.]).end_row();
            });
            match parse_ply(&bytes).unwrap_err() {
                PlyError::IndexOutOfRange { face: 2, index: found, vertices: 5, place } => {
                    assert_eq!(found, if ty == F32 { -1 } else { index as i64 }, "{format} {ty:?}");
                    let expected = if format == "ascii" { Place::Line(17) } else { place };
                    assert_eq!(place, expected);
                }
                // Text distinguishes non-integers.
                PlyError::Number { place: Place::Line(17), .. } if format == "ascii" && ty == F32 => {}
                other => panic!("{format} {ty:?} {index}: {other}"),
            }
        }
    }
}

#[test]
fn words_that_are_no_numbers_are_refused_with_their_line() {
    for (from, to, expected) in [
        ("3 3 2 4 8", "3 3 x2 4 8", "line 21: `x2` in `face`, where a whole number is expected"),
        ("1 1 0 1 1", "1 1 0 1,5 1", "line 17: `1,5` in `vertex`, where a number is expected"),
        ("1 1 0 1 1", "1 1 0 1.#INF 1", "line 17: `1.#INF` in `vertex`"),
        ("1 1 0 1 1", "1 1 0 \u{7}\" 1", "line 17: `\\x07\\\"` in `vertex`"),
    ] {
        assert!(message(&replaced(from, to)).contains(expected), "{}", message(&replaced(from, to)));
    }
    let long = message(&replaced("1 1 0 1 1", &format!("1 1 0 {} 1", "1".repeat(300))));
    assert!(long.contains("line 17: `1111111111111111111111111111111111111111`"), "{long}");
    assert!(parse_ply(&replaced("3 3 2 4 8", "3.0 3 2e0 +4 8")).is_ok());
}

#[test]
fn broken_vertices_lose_their_faces_and_are_counted() {
    for odd in ["nan", "-nan(ind)", "inf", "-Infinity", "NaN", "1e60"] {
        let mesh = parse_ply(&replaced("0.5 2 0.25 0.5 2", &format!("0.5 {odd} 0.25 0.5 2"))).unwrap();
        assert_eq!((mesh.triangles.len(), mesh.quads.len(), mesh.positions[4]), (0, 1, Vec3::ZERO), "{odd}");
        assert_eq!(mesh.warnings, ["1 vertices are not finite; 1 faces of them are left out"]);
    }
    for format in &FORMATS[1..] {
        let bytes = with_faces(format, "element face 1\nproperty list uchar int vertex_indices", |w| {
            // Overwrites y and z of the last vertex.
            let end = w.body.len() - 8;
            w.body.truncate(end);
            w.numbers(F32, &[f64::NAN, f64::INFINITY]).list(U8, I32, &[0., 1., 2.]);
        });
        let mesh = parse_ply(&bytes).unwrap();
        assert_eq!(mesh.warnings, ["1 vertices are not finite; 0 faces of them are left out"], "{format}");
    }
    // Large finite values are valid.
    let large = parse_ply(&replaced("0.5 2 0.25 0.5 2", "3e38 3e38 3e38 0 0")).unwrap();
    assert!(large.warnings.is_empty() && large.positions[4].x == 3e38);
}

#[test]
fn truncated_files_are_refused_wherever_they_end() {
    for format in FORMATS {
        let bytes = sample(format);
        // In text, the last number may lack digits, and the blank and line end after it.
        let end = bytes.len() - if format == "ascii" { 3 } else { 0 };
        for cut in 0..end {
            let error = parse_ply(&bytes[..cut]).expect_err(&format!("{cut} bytes of {format}"));
            assert!(!matches!(error, PlyError::Io { .. }), "{error}");
        }
    }
}

#[test]
fn damaged_files_never_panic() {
    let strips = with_faces("binary_little_endian", "element tristrips 1\nproperty list int int vertex_indices", |w| {
        w.list(I32, I32, &[0., 1., 3., 2., 4.]);
    });
    let mut samples: Vec<Vec<u8>> = FORMATS.map(sample).into();
    let wedges = with_faces(
        "binary_big_endian",
        "element face 1\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord",
        |w| {
            w.list(U8, I32, &[0., 1., 3., 2., 4.]).list(U8, F32, &[0.5; 10]);
        },
    );
    samples.push(wedges);
    samples.extend([compressed(&sample("binary_little_endian")), compressed(&sample("ascii")), strips]);
    let mut random = pcg32([20, 0, 0]);
    let mut accepted = 0;
    for round in 0..24_000 {
        let mut bytes = samples[round % samples.len()].clone();
        for _ in 0..=below(&mut random, 4) {
            let bit = below(&mut random, 8 * bytes.len());
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        if let Ok(mesh) = parse_ply(&bytes) {
            assert_is_sound(&mesh);
            accepted += 1;
        }
    }
    assert!((1..24_000).contains(&accepted), "{accepted}");
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
    let mut gzip = GzEncoder::new(Vec::new(), Compression::fast());
    gzip.write_all(&binary).unwrap();
    let at_least = PlySize { bytes: 5 * 24 + 2 * 12, triangles: 2 };
    let text = [&head("ascii")[..], &b"0 0 0 0\n".repeat(5), b"4 0 1 2 3\n3 0 1 2\n"].concat();
    assert_eq!([size(&text), size(&gzip.finish().unwrap())], [at_least; 2]);
    // Counts that the file cannot have
    std::fs::write(&path, head("ascii")).unwrap();
    assert!(ply_size(&path).is_err());
}

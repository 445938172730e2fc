//! Files of every encoding, written for tests.

use crate::ply::header::Scalar::{self, *};
use crate::ply::{PlyMesh, parse_ply};
use flate2::{Compression, write::GzEncoder};
use lumiris_test_support::random::{Pcg32, RngExt};
use std::io::Write as _;

pub(super) const FORMATS: [&str; 3] = ["ascii", "binary_little_endian", "binary_big_endian"];
pub(super) const SCALARS: [(Scalar, [&str; 2]); 8] = [
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
pub(super) struct Writer {
    format: &'static str,
    head: String,
    pub(super) body: Vec<u8>,
}

impl Writer {
    pub(super) fn new(format: &'static str) -> Self {
        Writer { format, head: format!("ply\nformat {format} 1.0\n"), body: Vec::new() }
    }

    pub(super) fn head(&mut self, lines: &str) -> &mut Self {
        self.head.push_str(lines);
        self.head.push('\n');
        self
    }

    pub(super) fn number(&mut self, ty: Scalar, value: f64) -> &mut Self {
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

    pub(super) fn numbers(&mut self, ty: Scalar, values: &[f64]) -> &mut Self {
        values.iter().for_each(|&v| {
            self.number(ty, v);
        });
        self
    }

    pub(super) fn list(&mut self, count: Scalar, ty: Scalar, values: &[f64]) -> &mut Self {
        self.number(count, values.len() as f64).numbers(ty, values)
    }

    pub(super) fn end_row(&mut self) -> &mut Self {
        if self.format == "ascii" {
            self.body.push(b'\n');
        }
        self
    }

    pub(super) fn bytes(&self) -> Vec<u8> {
        [self.head.as_bytes(), b"end_header\n", &self.body].concat()
    }
}

pub(super) fn name(ty: Scalar, spelling: usize) -> &'static str {
    SCALARS.iter().find(|s| s.0 == ty).unwrap().1[spelling]
}

pub(super) const XYZ: &str = "property float x\nproperty float y\nproperty float z";
pub(super) const CORNERS: [[f64; 3]; 5] = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.], [0.5, 2., 0.25]];

/// Five vertices with texture coordinates, a quad and a triangle with a number each.
pub(super) fn sample(format: &'static str) -> Vec<u8> {
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
pub(super) fn with_faces(format: &'static str, head: &str, fill: impl Fn(&mut Writer)) -> Vec<u8> {
    let mut w = Writer::new(format);
    w.head("element vertex 5").head(XYZ).head(head);
    for c in CORNERS {
        w.numbers(F32, &c).end_row();
    }
    fill(&mut w);
    w.bytes()
}

pub(super) fn message(bytes: &[u8]) -> String {
    parse_ply(bytes).unwrap_err().to_string()
}

pub(super) fn replaced(from: &str, to: &str) -> Vec<u8> {
    let text = String::from_utf8(sample("ascii")).unwrap();
    assert!(text.contains(from), "{from}");
    text.replace(from, to).into_bytes()
}

pub(super) fn below(random: &mut Pcg32, count: usize) -> usize {
    random.random_range(0..count)
}

pub(super) fn compressed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

pub(super) fn assert_is_sound(mesh: &PlyMesh) {
    let n = mesh.positions.len();
    assert!(mesh.triangles.iter().flatten().chain(mesh.quads.iter().flatten()).all(|&v| (v as usize) < n));
    assert!(mesh.positions.iter().all(|p| p.is_finite()));
    assert!(mesh.normals.is_empty() || mesh.normals.len() == n);
    assert!(mesh.uvs.is_empty() || mesh.uvs.len() == n);
}

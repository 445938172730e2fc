//! The tables of a PLY file.

use super::header::{Element, Encoding, Header, Property, Scalar};
use super::stream::Stream;
use super::{PlyError, PlyMesh};
use crate::import::number::{NumberError, is_delimiter, parse_f32, parse_i32};
use crate::math::{Vec2, Vec3};
use std::io::Read;

/// Longest word of an ASCII file (bytes).
const MAX_WORD: usize = 256;

/// Reads all tables.
pub fn read_body<R: Read>(header: &Header, stream: &mut Stream<R>) -> Result<PlyMesh, PlyError> {
    let vertices = header.element("vertex").ok_or_else(|| PlyError::format("has no vertices"))?;
    let mut mesh = PlyMesh::default();
    let mut faces = Faces { vertex_count: vertices.count as u32, ..Faces::default() };
    for element in &header.elements {
        match (element.name.as_str(), header.encoding) {
            ("vertex", Encoding::Ascii) => vertices_of(element, &mut Ascii(stream), &mut mesh)?,
            ("vertex", Encoding::LittleEndian) => fast_vertices::<R, false>(element, stream, &mut mesh)?,
            ("vertex", Encoding::BigEndian) => fast_vertices::<R, true>(element, stream, &mut mesh)?,
            ("face", Encoding::Ascii) => faces_of(element, &mut Ascii(stream), &mut faces)?,
            ("face", Encoding::LittleEndian) => fast_faces::<R, false>(element, stream, &mut faces)?,
            ("face", Encoding::BigEndian) => fast_faces::<R, true>(element, stream, &mut faces)?,
            (_, Encoding::Ascii) => skip_element(element, &mut Ascii(stream))?,
            (_, Encoding::LittleEndian) => skip_element(element, &mut Binary::<R, false>(stream))?,
            (_, Encoding::BigEndian) => skip_element(element, &mut Binary::<R, true>(stream))?,
        }
    }
    faces.finish(header, &mut mesh);
    Ok(mesh)
}

/// A source of numbers of given types.
trait Numbers {
    fn float(&mut self, ty: Scalar, what: &str) -> Result<f32, PlyError>;
    fn integer(&mut self, ty: Scalar, what: &str) -> Result<i64, PlyError>;
    fn skip(&mut self, ty: Scalar, count: u64, what: &str) -> Result<(), PlyError>;
}

struct Binary<'a, R, const BIG: bool>(&'a mut Stream<R>);

macro_rules! number_at {
    ($ty:ty, $bytes:expr, $at:expr) => {{
        let mut raw = [0; size_of::<$ty>()];
        raw.copy_from_slice(&$bytes[$at..$at + size_of::<$ty>()]);
        if BIG { <$ty>::from_be_bytes(raw) } else { <$ty>::from_le_bytes(raw) }
    }};
}

#[inline]
fn float_at<const BIG: bool>(bytes: &[u8], at: usize, ty: Scalar) -> f32 {
    match ty {
        Scalar::F32 => number_at!(f32, bytes, at),
        Scalar::F64 => number_at!(f64, bytes, at) as f32,
        _ => integer_at::<BIG>(bytes, at, ty) as f32,
    }
}

#[inline]
fn integer_at<const BIG: bool>(bytes: &[u8], at: usize, ty: Scalar) -> i64 {
    match ty {
        Scalar::I8 => i64::from(bytes[at] as i8),
        Scalar::U8 => i64::from(bytes[at]),
        Scalar::I16 => i64::from(number_at!(i16, bytes, at)),
        Scalar::U16 => i64::from(number_at!(u16, bytes, at)),
        Scalar::I32 => i64::from(number_at!(i32, bytes, at)),
        Scalar::U32 => i64::from(number_at!(u32, bytes, at)),
        Scalar::F32 => whole(f64::from(number_at!(f32, bytes, at))),
        Scalar::F64 => whole(number_at!(f64, bytes, at)),
    }
}

/// A float that is used as an index; what is no whole number becomes one that is out of range.
fn whole(value: f64) -> i64 {
    if value.fract() == 0.0 { value as i64 } else { -1 }
}

impl<R: Read, const BIG: bool> Numbers for Binary<'_, R, BIG> {
    fn float(&mut self, ty: Scalar, what: &str) -> Result<f32, PlyError> {
        let value = float_at::<BIG>(self.0.require(ty.size(), what)?, 0, ty);
        self.0.consume(ty.size());
        Ok(value)
    }

    fn integer(&mut self, ty: Scalar, what: &str) -> Result<i64, PlyError> {
        let value = integer_at::<BIG>(self.0.require(ty.size(), what)?, 0, ty);
        self.0.consume(ty.size());
        Ok(value)
    }

    fn skip(&mut self, ty: Scalar, count: u64, what: &str) -> Result<(), PlyError> {
        self.0.skip(count * ty.size() as u64, what)
    }
}

struct Ascii<'a, R>(&'a mut Stream<R>);

impl<R: Read> Ascii<'_, R> {
    /// Hands the next word to `parse`, which returns a value and the length of the word.
    #[inline]
    fn word<T>(&mut self, what: &str, parse: impl Fn(&[u8]) -> Result<(T, usize), NumberError>) -> Result<T, PlyError> {
        loop {
            let bytes = self.0.fill(MAX_WORD)?;
            let blanks = bytes.iter().take_while(|b| b.is_ascii_whitespace()).count();
            if blanks == bytes.len() {
                if bytes.is_empty() {
                    return Err(PlyError::format(format!("file ends inside {what}")));
                }
                self.0.consume(blanks);
                continue;
            }
            if blanks > 0 {
                self.0.consume(blanks);
                continue;
            }
            return match parse(bytes) {
                Ok((value, length)) => {
                    self.0.consume(length);
                    Ok(value)
                }
                Err(_) => {
                    let length = bytes.iter().take(40).position(|&b| is_delimiter(b)).unwrap_or(bytes.len().min(40));
                    let word = String::from_utf8_lossy(&bytes[..length]).into_owned();
                    Err(PlyError::format(format!("`{word}` in {what} is not a number that is expected there")))
                }
            };
        }
    }
}

/// As [`parse_f32`], and also `nan` and `inf`, which exporters write for broken vertices.
fn parse_any_f32(bytes: &[u8]) -> Result<(f32, usize), NumberError> {
    parse_f32(bytes).or_else(|error| {
        let length = bytes.iter().take(MAX_WORD).position(|&b| is_delimiter(b)).unwrap_or(bytes.len().min(MAX_WORD));
        let word = std::str::from_utf8(&bytes[..length]).map_err(|_| error)?;
        let is_name = word.trim_start_matches(['-', '+']).to_ascii_lowercase().starts_with(['n', 'i']);
        match error {
            NumberError::Malformed if is_name => word.parse().map(|value| (value, length)).map_err(|_| error),
            NumberError::Malformed => Err(error),
            NumberError::Overflow => Ok((f32::INFINITY, length)),
        }
    })
}

impl<R: Read> Numbers for Ascii<'_, R> {
    fn float(&mut self, _: Scalar, what: &str) -> Result<f32, PlyError> {
        self.word(what, parse_any_f32)
    }

    fn integer(&mut self, _: Scalar, what: &str) -> Result<i64, PlyError> {
        self.word(what, |bytes| match parse_i32(bytes) {
            Ok((value, length)) => Ok((i64::from(value), length)),
            Err(NumberError::Overflow) => Err(NumberError::Overflow),
            Err(NumberError::Malformed) => parse_f32(bytes).map(|(value, length)| (whole(f64::from(value)), length)),
        })
    }

    fn skip(&mut self, ty: Scalar, count: u64, what: &str) -> Result<(), PlyError> {
        for _ in 0..count {
            self.float(ty, what)?;
        }
        Ok(())
    }
}

fn skip_element(element: &Element, numbers: &mut impl Numbers) -> Result<(), PlyError> {
    if element.properties.is_empty() {
        return Ok(());
    }
    for _ in 0..element.count {
        for property in &element.properties {
            skip_property(property, &element.name, numbers)?;
        }
    }
    Ok(())
}

fn skip_property(property: &Property, what: &str, numbers: &mut impl Numbers) -> Result<(), PlyError> {
    match property.list {
        None => numbers.skip(property.ty, 1, what),
        Some(count_type) => {
            let count = numbers.integer(count_type, what)?;
            let count =
                u64::try_from(count).map_err(|_| PlyError::format(format!("negative list length in {what}")))?;
            numbers.skip(property.ty, count, what)
        }
    }
}

/// Which columns of the vertices are used.
struct VertexColumns {
    position: [usize; 3],
    normal: Option<[usize; 3]>,
    uv: Option<[usize; 2]>,
}

impl VertexColumns {
    fn new(element: &Element) -> Result<Self, PlyError> {
        let column = |name| element.scalar(&[name]);
        let (Some(x), Some(y), Some(z)) = (column("x"), column("y"), column("z")) else {
            return Err(PlyError::format("vertices have no x, y and z"));
        };
        let normal = match (column("nx"), column("ny"), column("nz")) {
            (Some(x), Some(y), Some(z)) => Some([x, y, z]),
            _ => None,
        };
        let pairs = [("u", "v"), ("s", "t"), ("texture_u", "texture_v"), ("texture_s", "texture_t")];
        let uv = pairs.iter().find_map(|&(u, v)| Some([column(u)?, column(v)?]));
        Ok(VertexColumns { position: [x, y, z], normal, uv })
    }

    fn reserve(&self, count: usize, mesh: &mut PlyMesh) {
        mesh.positions.reserve_exact(count + 1);
        mesh.normals.reserve_exact(if self.normal.is_some() { count } else { 0 });
        mesh.uvs.reserve_exact(if self.uv.is_some() { count } else { 0 });
    }
}

fn vertices_of(element: &Element, numbers: &mut impl Numbers, mesh: &mut PlyMesh) -> Result<(), PlyError> {
    let columns = VertexColumns::new(element)?;
    columns.reserve(element.count as usize, mesh);
    let mut row = vec![0.0; element.properties.len()];
    for _ in 0..element.count {
        for (value, property) in row.iter_mut().zip(&element.properties) {
            match property.list {
                None => *value = numbers.float(property.ty, "the vertices")?,
                Some(_) => skip_property(property, "the vertices", numbers)?,
            }
        }
        mesh.positions.push(Vec3::from(columns.position.map(|c| row[c])));
        mesh.normals.extend(columns.normal.map(|n| Vec3::from(n.map(|c| row[c]))));
        mesh.uvs.extend(columns.uv.map(|uv| Vec2::from(uv.map(|c| row[c]))));
    }
    Ok(())
}

/// Vertices of rows of fixed size: each wanted number is picked at its offset.
fn fast_vertices<R: Read, const BIG: bool>(
    element: &Element,
    stream: &mut Stream<R>,
    mesh: &mut PlyMesh,
) -> Result<(), PlyError> {
    let stride = element.min_stride();
    if element.has_list() || stride > MAX_WORD {
        return vertices_of(element, &mut Binary::<R, BIG>(stream), mesh);
    }
    let columns = VertexColumns::new(element)?;
    columns.reserve(element.count as usize, mesh);
    let place = |c: usize| {
        let offset = element.properties[..c].iter().map(|p| p.ty.size()).sum::<usize>();
        (offset, element.properties[c].ty)
    };
    let position = columns.position.map(place);
    let normal = columns.normal.map(|n| n.map(place));
    let uv = columns.uv.map(|uv| uv.map(place));
    let used = position.iter().chain(normal.iter().flatten()).chain(uv.iter().flatten());
    let all_f32 = used.clone().all(|&(_, ty)| ty == Scalar::F32);
    let mut left = element.count as usize;
    while left > 0 {
        let available = stream.require(stride, "the vertices")?;
        let rows = (available.len() / stride).min(left);
        let block = available[..rows * stride].chunks_exact(stride);
        if all_f32 {
            pick::<BIG>(block, (position, normal, uv), |row, (at, _)| number_at!(f32, row, at), mesh);
        } else {
            pick::<BIG>(block, (position, normal, uv), |row, (at, ty)| float_at::<BIG>(row, at, ty), mesh);
        }
        stream.consume(rows * stride);
        left -= rows;
    }
    Ok(())
}

type Place = (usize, Scalar);
type Places = ([Place; 3], Option<[Place; 3]>, Option<[Place; 2]>);

#[inline]
fn pick<'a, const BIG: bool>(
    block: impl Iterator<Item = &'a [u8]> + Clone,
    (position, normal, uv): Places,
    read: impl Fn(&[u8], Place) -> f32 + Copy,
    mesh: &mut PlyMesh,
) {
    mesh.positions.extend(block.clone().map(|row| Vec3::from(position.map(|p| read(row, p)))));
    if let Some(normal) = normal {
        mesh.normals.extend(block.clone().map(|row| Vec3::from(normal.map(|p| read(row, p)))));
    }
    if let Some(uv) = uv {
        mesh.uvs.extend(block.map(|row| Vec2::from(uv.map(|p| read(row, p)))));
    }
}

/// Faces as they come in.
#[derive(Default)]
struct Faces {
    vertex_count: u32,
    triangles: Vec<[u32; 3]>,
    quads: Vec<[u32; 4]>,
    polygons: usize,
    degenerate: usize,
}

impl Faces {
    /// Adds the face of some vertices, all in range.
    fn push(&mut self, corners: &[u32]) {
        match *corners {
            [a, b, c] => self.triangles.push([a, b, c]),
            // A patch has its corners row by row, not around.
            [a, b, c, d] => self.quads.push([a, b, d, c]),
            [first, ref rest @ ..] if rest.len() > 3 => {
                self.polygons += 1;
                self.triangles.extend(rest.windows(2).map(|pair| [first, pair[0], pair[1]]));
            }
            _ => self.degenerate += 1,
        }
    }

    fn check(&self, index: i64, face: u64) -> Result<u32, PlyError> {
        match u32::try_from(index) {
            Ok(i) if i < self.vertex_count => Ok(i),
            _ => {
                let count = self.vertex_count;
                Err(PlyError::format(format!("face {face} refers to vertex {index}, but there are {count} vertices")))
            }
        }
    }

    fn finish(self, header: &Header, mesh: &mut PlyMesh) {
        mesh.triangles = self.triangles;
        mesh.quads = self.quads;
        if self.polygons > 0 {
            let n = self.polygons;
            mesh.warnings.push(format!("{n} faces have more than four vertices; each becomes a fan of triangles"));
        }
        if self.degenerate > 0 {
            mesh.warnings.push(format!("{} faces have less than three vertices and are left out", self.degenerate));
        }
        if mesh.triangles.is_empty() && mesh.quads.is_empty() {
            let strips = if header.element("tristrips").is_some() { "; triangle strips are not read" } else { "" };
            mesh.warnings.push(format!("there are no faces{strips}"));
        }
        drop_broken_vertices(mesh);
    }
}

/// Removes faces of vertices that are not finite, and replaces such vertices by the origin.
fn drop_broken_vertices(mesh: &mut PlyMesh) {
    // A sum of products with zero is finite only if all are: one pass without branches finds the common case.
    let probe: f32 = mesh.positions.iter().map(|p| (p.x + p.y + p.z) * 0.0).sum();
    if probe == 0.0 {
        return;
    }
    let broken: Vec<bool> = mesh.positions.iter().map(|p| !p.is_finite()).collect();
    let count = broken.iter().filter(|&&b| b).count();
    if count == 0 {
        return;
    }
    let faces = mesh.triangles.len() + mesh.quads.len();
    mesh.triangles.retain(|t| t.iter().all(|&v| !broken[v as usize]));
    mesh.quads.retain(|q| q.iter().all(|&v| !broken[v as usize]));
    mesh.positions.iter_mut().filter(|p| !p.is_finite()).for_each(|p| *p = Vec3::ZERO);
    let left_out = faces - mesh.triangles.len() - mesh.quads.len();
    mesh.warnings.push(format!("{count} vertices are not finite; {left_out} faces of them are left out"));
}

fn faces_of(element: &Element, numbers: &mut impl Numbers, faces: &mut Faces) -> Result<(), PlyError> {
    let names = ["vertex_indices", "vertex_index"];
    let column = element.properties.iter().position(|p| p.list.is_some() && names.contains(&p.name.as_str()));
    let mut corners = Vec::new();
    if column.is_some() {
        // A count that passed the check against the file size.
        faces.triangles.reserve(element.count as usize);
    }
    for row in 0..element.count {
        for (i, property) in element.properties.iter().enumerate() {
            match property.list {
                Some(count_type) if Some(i) == column => {
                    let count = numbers.integer(count_type, "the faces")?;
                    if !(0..=1 << 20).contains(&count) {
                        return Err(PlyError::format(format!("face {row} has {count} vertices")));
                    }
                    corners.clear();
                    for _ in 0..count {
                        corners.push(faces.check(numbers.integer(property.ty, "the faces")?, row)?);
                    }
                    faces.push(&corners);
                }
                Some(_) | None => skip_property(property, "the faces", numbers)?,
            }
        }
    }
    Ok(())
}

/// Bytes of a triangle in the commonest layout: a length of one byte, three indices of four.
const TRIANGLE: usize = 13;

/// Faces of one list `uchar, int`: runs of triangles are copied in blocks.
fn fast_faces<R: Read, const BIG: bool>(
    element: &Element,
    stream: &mut Stream<R>,
    faces: &mut Faces,
) -> Result<(), PlyError> {
    let common = match element.properties.as_slice() {
        [p] => {
            p.list == Some(Scalar::U8) && matches!(p.ty, Scalar::I32 | Scalar::U32) && p.name.starts_with("vertex_ind")
        }
        _ => false,
    };
    if !common {
        return faces_of(element, &mut Binary::<R, BIG>(stream), faces);
    }
    faces.triangles.reserve_exact(element.count as usize);
    let mut row = 0;
    while row < element.count {
        let available = stream.fill(TRIANGLE)?;
        let block = (available.len() / TRIANGLE).min((element.count - row) as usize);
        let before = faces.triangles.len();
        let (mut largest, mut odd) = (0_u32, 0_u8);
        faces.triangles.extend(available[..block * TRIANGLE].chunks_exact(TRIANGLE).map(|face| {
            let t = [number_at!(u32, face, 1), number_at!(u32, face, 5), number_at!(u32, face, 9)];
            odd |= face[0] ^ 3;
            largest = largest.max(t[0]).max(t[1]).max(t[2]);
            t
        }));
        if block > 0 && odd == 0 && largest < faces.vertex_count {
            stream.consume(block * TRIANGLE);
            row += block as u64;
            continue;
        }
        // Something else is among them: take these faces one by one.
        faces.triangles.truncate(before);
        let slow = Element { count: (block as u64).max(1), ..element.clone() };
        let result = faces_of(&slow, &mut Binary::<R, BIG>(stream), faces);
        result.map_err(|error| renumber(error, row))?;
        row += slow.count;
    }
    faces.triangles.shrink_to_fit();
    Ok(())
}

/// Face numbers of a block are counted from the start of the file.
fn renumber(error: PlyError, first: u64) -> PlyError {
    let PlyError::Format(text) = &error else { return error };
    let Some((number, rest)) = text.strip_prefix("face ").and_then(|t| t.split_once(' ')) else { return error };
    match number.parse::<u64>() {
        Ok(n) => PlyError::Format(format!("face {} {rest}", n + first)),
        Err(_) => error,
    }
}

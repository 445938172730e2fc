//! The header of a PLY file: its encoding, and the layout of its elements.

use super::error::PlyError;
use super::mesh::PlySize;
use super::stream::{MAX_FILL, Stream};

/// Maximum number of header lines, and therefore of elements and properties.
const MAX_LINES: u64 = 10_000;
/// Elements with a meaning, which may occur only once.
const KNOWN: [&str; 3] = ["vertex", "face", "tristrips"];

/// Encoding of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// Decimal text.
    Ascii,
    /// Binary, little-endian.
    LittleEndian,
    /// Binary, big-endian.
    BigEndian,
}

/// Type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the variants are the format's types")]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Scalar::I8,
            "uchar" | "uint8" => Scalar::U8,
            "short" | "int16" => Scalar::I16,
            "ushort" | "uint16" => Scalar::U16,
            "int" | "int32" => Scalar::I32,
            "uint" | "uint32" => Scalar::U32,
            "float" | "float32" => Scalar::F32,
            "double" | "float64" => Scalar::F64,
            _ => return None,
        })
    }

    /// Size in binary files (bytes).
    pub(super) fn size(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::F64 => 8,
        }
    }

    /// True for integer types.
    pub(super) fn is_integer(self) -> bool {
        !matches!(self, Scalar::F32 | Scalar::F64)
    }
}

/// A column of an element.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Property {
    /// Its name.
    pub name: String,
    /// Type of the number, or of the items of the list.
    pub ty: Scalar,
    /// Type of the length if it is a list.
    pub list: Option<Scalar>,
}

/// A table of the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Element {
    /// Its name.
    pub name: String,
    /// Number of rows.
    pub count: u64,
    /// Line of its declaration in the header.
    pub line: u64,
    /// Its columns.
    pub properties: Vec<Property>,
}

impl Element {
    /// Size of a row in binary files, without the items of lists (bytes).
    pub(super) fn min_stride(&self) -> usize {
        self.properties.iter().map(|p| p.list.unwrap_or(p.ty).size()).sum()
    }

    /// True if a column is a list.
    pub(super) fn has_list(&self) -> bool {
        self.properties.iter().any(|p| p.list.is_some())
    }

    /// Index of the column of vertex indices.
    pub(super) fn indices(&self) -> Option<usize> {
        let names = ["vertex_indices", "vertex_index"];
        self.properties.iter().position(|p| p.list.is_some() && names.contains(&p.name.as_str()))
    }

    /// Index of the scalar column with a name.
    pub(super) fn scalar(&self, name: &str) -> Option<usize> {
        self.properties.iter().position(|p| p.list.is_none() && p.name == name)
    }
}

/// The header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Header {
    /// Encoding of numbers.
    pub encoding: Encoding,
    /// The tables in the order of the file.
    pub elements: Vec<Element>,
    /// Its number of lines.
    pub lines: u64,
}

impl Header {
    /// The table with a name.
    pub(super) fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|e| e.name == name)
    }

    /// The size of the mesh, where `available` bytes follow the header, if that is known.
    pub(super) fn size(&self, available: Option<u64>) -> PlySize {
        let Some(vertices) = self.element("vertex") else { return PlySize::default() };
        let floats = [&["x"][..], &["nx"], &["u", "s", "texture_u", "texture_s"]].map(|names| {
            let has_any = names.iter().any(|name| vertices.scalar(name).is_some());
            u64::from(has_any)
        });
        let vertex_bytes = 12 * floats[0] + 12 * floats[1] + 8 * floats[2];

        // Corners of faces, by the size of a binary file
        let faces = self.element("face");
        let count = faces.map_or(0, |faces| faces.count);
        let corners = faces.zip(available).and_then(|(faces, available)| {
            let list = &faces.properties[faces.indices()?];
            let rows = self.elements.iter().map(|e| e.count.saturating_mul(e.min_stride() as u64));
            let fixed = rows.fold(0, u64::saturating_add);
            let is_only_list =
                self.elements.iter().flat_map(|e| &e.properties).filter(|p| p.list.is_some()).count() == 1;
            let is_binary = self.encoding != Encoding::Ascii;
            (is_binary && is_only_list).then(|| available.saturating_sub(fixed) / list.ty.size() as u64)
        });
        let triangles = corners.map_or(count, |corners| corners.saturating_sub(count.saturating_mul(2)).max(count));
        PlySize {
            bytes: vertices.count.saturating_mul(vertex_bytes).saturating_add(triangles.saturating_mul(12)),
            triangles,
        }
    }

    /// Fails if the rows cannot fit into `available` bytes, so that nothing is allocated for false counts.
    pub(super) fn check_counts(&self, available: u64) -> Result<(), PlyError> {
        let mut needed = 0_u64;
        for element in &self.elements {
            let row = match self.encoding {
                // At least a digit and a blank each; the last blank of the file may be missing.
                Encoding::Ascii => 2 * element.properties.len() as u64,
                Encoding::LittleEndian | Encoding::BigEndian => element.min_stride() as u64,
            };
            needed = needed.saturating_add(element.count.saturating_mul(row));
            if needed > available.saturating_add(u64::from(self.encoding == Encoding::Ascii)) {
                let (element, count) = (element.name.clone(), element.count);
                return Err(PlyError::Counts { element, count, needed, available });
            }
            if element.count > u64::from(u32::MAX) {
                let message = format!("{} of `{}`; at most 2^32 - 1 are read", element.count, element.name);
                return Err(PlyError::header(self.lines, message));
            }
        }
        Ok(())
    }
}

/// Reads the header; the stream is then at the first row.
pub(super) fn read_header(stream: &mut Stream<'_>) -> Result<Header, PlyError> {
    if read_line(stream)?.trim_end() != "ply" {
        return Err(PlyError::header(
            1,
            "is not a PLY file: it does not start with `ply` (meshes of other formats must be converted)",
        ));
    }
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    for number in 2..MAX_LINES {
        let line = read_line(stream)?;
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        let bad = |expected: &str| {
            let shown: String = line.trim().chars().take(80).collect();
            PlyError::header(number, format!("`{shown}`, where {expected} is expected"))
        };
        match words.as_slice() {
            [] | ["comment" | "obj_info", ..] => {}
            ["format", rest @ ..] => {
                let known = rest.first().and_then(|name| encoding_of(name));
                let expected = "`format` with ascii, binary_little_endian or binary_big_endian, and 1.0,";
                encoding = Some(known.filter(|_| rest.len() == 2).ok_or_else(|| bad(expected))?);
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| bad("`element`, a name and a count"))?;
                if KNOWN.contains(name) && elements.iter().any(|e| e.name == *name) {
                    return Err(PlyError::header(number, format!("`{name}` is announced twice")));
                }
                elements.push(Element { name: (*name).to_owned(), count, line: number, properties: Vec::new() });
            }
            ["property", rest @ ..] => {
                let property = property(rest).ok_or_else(|| bad("`property`, a type (or list and two) and a name"))?;
                let element = elements.last_mut().ok_or_else(|| bad("an `element` before the properties"))?;
                element.properties.push(property);
            }
            ["end_header"] => {
                let encoding = encoding.ok_or_else(|| bad("a `format` line before the end"))?;
                return Ok(Header { encoding, elements, lines: number });
            }
            _ => return Err(bad("element, property, comment, obj_info or end_header")),
        }
    }
    Err(PlyError::header(MAX_LINES, "the header has no end"))
}

fn encoding_of(name: &str) -> Option<Encoding> {
    match name {
        "ascii" => Some(Encoding::Ascii),
        "binary_little_endian" => Some(Encoding::LittleEndian),
        "binary_big_endian" => Some(Encoding::BigEndian),
        _ => None,
    }
}

fn property(words: &[&str]) -> Option<Property> {
    match *words {
        ["list", count, item, name] => {
            let list = Scalar::from_name(count).filter(|t| t.is_integer())?;
            Some(Property { name: name.to_owned(), ty: Scalar::from_name(item)?, list: Some(list) })
        }
        [ty, name] => Some(Property { name: name.to_owned(), ty: Scalar::from_name(ty)?, list: None }),
        _ => None,
    }
}

/// Reads a line that ends in LF, in CR LF, or, if the first line does, in CR only.
fn read_line(stream: &mut Stream<'_>) -> Result<String, PlyError> {
    let number = stream.line;
    let newline = stream.newline;
    let available = stream.fill(MAX_FILL)?;
    let window = &available[..available.len().min(MAX_FILL)];
    let found = window.iter().position(|&b| b == newline);

    // The first line determines whether lines end in CR only; an LF after a CR is then data.
    let carriage = window.iter().position(|&b| b == b'\r').filter(|_| number == 1);
    let is_old = |&at: &usize| found.is_none_or(|lf| at + 1 < lf) && at + 1 < window.len();
    let (end, newline) = match carriage.filter(is_old) {
        Some(at) => (Some(at), b'\r'),
        None => (found, newline),
    };

    let Some(end) = end else {
        let message = match window.len() {
            0 if number == 1 => "the file is empty",
            MAX_FILL => "the line has no end",
            _ => "the file ends inside the header",
        };
        return Err(PlyError::header(number, message));
    };
    let line = String::from_utf8_lossy(&window[..end]).trim_end_matches('\r').to_owned();
    stream.consume(end + 1);
    stream.newline = newline;
    stream.line += 1;
    Ok(line)
}

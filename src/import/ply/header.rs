//! The header of a PLY file: its encoding, and the layout of its elements.

use super::PlyError;
use super::stream::Stream;
use std::io::Read;

/// Longest header line (bytes).
const MAX_LINE: usize = 4096;
/// Most header lines, elements and properties.
const MAX_LINES: usize = 10_000;

/// How numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// Decimal text.
    Ascii,
    /// Binary, low byte first.
    LittleEndian,
    /// Binary, high byte first.
    BigEndian,
}

/// Type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the variants are the format's types")]
pub enum Scalar {
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

    /// Bytes in binary files.
    pub fn size(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::F64 => 8,
        }
    }

    /// True for the types that can count.
    pub fn is_integer(self) -> bool {
        !matches!(self, Scalar::F32 | Scalar::F64)
    }
}

/// What one instance of an element holds in one place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Property {
    /// Its name.
    pub name: String,
    /// Type of the number, or of the items of the list.
    pub ty: Scalar,
    /// Type of the length if it is a list.
    pub list: Option<Scalar>,
}

/// A table of the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Element {
    /// Its name.
    pub name: String,
    /// Number of rows.
    pub count: u64,
    /// Its columns.
    pub properties: Vec<Property>,
}

impl Element {
    /// Bytes of a row in binary files, without the items of lists.
    pub fn min_stride(&self) -> usize {
        self.properties.iter().map(|p| p.list.unwrap_or(p.ty).size()).sum()
    }

    /// True if a column is a list.
    pub fn has_list(&self) -> bool {
        self.properties.iter().any(|p| p.list.is_some())
    }

    /// Index of the column called by one of the names, if it is no list.
    pub fn scalar(&self, names: &[&str]) -> Option<usize> {
        self.properties.iter().position(|p| p.list.is_none() && names.contains(&p.name.as_str()))
    }
}

/// The header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Header {
    /// How numbers are written.
    pub encoding: Encoding,
    /// The tables in the order of the file.
    pub elements: Vec<Element>,
}

impl Header {
    /// The table of a name.
    pub fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|e| e.name == name)
    }

    /// Fails if the rows cannot fit into `limit` bytes, so that nothing is allocated for counts that lie.
    pub fn check_counts(&self, limit: u64) -> Result<(), PlyError> {
        let mut needed = 0_u64;
        for element in &self.elements {
            let row = match self.encoding {
                // A digit and a blank each; the last blank of the file may be missing.
                Encoding::Ascii => 2 * element.properties.len() as u64,
                Encoding::LittleEndian | Encoding::BigEndian => element.min_stride() as u64,
            };
            needed = needed.saturating_add(element.count.saturating_mul(row));
            if needed > limit.saturating_add(1) {
                let (name, count) = (&element.name, element.count);
                return Err(PlyError::format(format!(
                    "{count} of `{name}` are announced, more than the file can hold"
                )));
            }
            if element.count > u64::from(u32::MAX) {
                return Err(PlyError::format(format!("more than 2^32 of `{}`", element.name)));
            }
        }
        Ok(())
    }
}

/// Reads the header; the stream then stands at the first row.
pub fn read_header<R: Read>(stream: &mut Stream<R>) -> Result<Header, PlyError> {
    if read_line(stream)?.trim_end() != "ply" {
        return Err(PlyError::format("is not a PLY file: it does not start with `ply`"));
    }
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    for number in 2..MAX_LINES {
        let line = read_line(stream)?;
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        let bad = || PlyError::format(format!("line {number} of the header is not understood: `{}`", line.trim()));
        match words.as_slice() {
            [] | ["comment" | "obj_info", ..] => {}
            ["format", name, _version] => encoding = Some(encoding_of(name).ok_or_else(bad)?),
            ["element", name, count] => {
                let count = count.parse().map_err(|_| bad())?;
                elements.push(Element { name: (*name).to_owned(), count, properties: Vec::new() });
            }
            ["property", rest @ ..] => {
                let property = property(rest).ok_or_else(bad)?;
                elements.last_mut().ok_or_else(bad)?.properties.push(property);
            }
            ["end_header"] => {
                let encoding = encoding.ok_or_else(|| PlyError::format("header has no `format` line"))?;
                return Ok(Header { encoding, elements });
            }
            _ => return Err(bad()),
        }
    }
    Err(PlyError::format("header has no end"))
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

/// Reads a line that ends in LF, CR LF or CR.
fn read_line<R: Read>(stream: &mut Stream<R>) -> Result<String, PlyError> {
    let available = stream.fill(MAX_LINE)?;
    let Some(end) = available.iter().take(MAX_LINE).position(|&b| b == b'\n' || b == b'\r') else {
        let message =
            if available.len() < MAX_LINE { "file ends inside the header" } else { "header has an endless line" };
        return Err(PlyError::format(if available.is_empty() { "is empty" } else { message }));
    };
    let line = String::from_utf8_lossy(&available[..end]).into_owned();
    let length = if available[end..].starts_with(b"\r\n") { end + 2 } else { end + 1 };
    stream.consume(length);
    Ok(line)
}

//! The container: named arrays of little-endian numbers.
//!
//! | bytes | content |
//! |---|---|
//! | 12 | `tensor_file` and a zero |
//! | 1, 1 | version: 1, 0 |
//! | 4 | number of fields; for each of them |
//! | 2, n | length of its name, the name |
//! | 2 | number of dimensions |
//! | 1 | type of its numbers |
//! | 8 | their offset from the beginning of the file |
//! | 8 each | length of each dimension; the last one varies fastest |
//!
//! All lengths and offsets are compared with the size of the file before anything is allocated.

use std::fmt;

const MAGIC: &[u8; 12] = b"tensor_file\0";
/// Maximum number of fields, and of dimensions of a field.
const MOST_FIELDS: usize = 1000;
const MOST_DIMENSIONS: usize = 16;

/// A format error with its position.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TensorError {
    /// Offset from the beginning of the file.
    pub byte: usize,
    /// One sentence without a full stop.
    pub message: String,
}

impl fmt::Display for TensorError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "byte {}: {}", self.byte, self.message)
    }
}

impl std::error::Error for TensorError {}

/// Type of the numbers of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the variants are the format's types")]
pub enum NumberType {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F16,
    F32,
    F64,
}

impl NumberType {
    fn from_code(code: u8) -> Option<Self> {
        use NumberType::{F16, F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
        const TYPES: [NumberType; 11] = [U8, I8, U16, I16, U32, I32, U64, I64, F16, F32, F64];
        TYPES.get(usize::from(code.checked_sub(1)?)).copied()
    }

    /// Size of a number (bytes).
    fn size(self) -> usize {
        match self {
            NumberType::U8 | NumberType::I8 => 1,
            NumberType::U16 | NumberType::I16 | NumberType::F16 => 2,
            NumberType::U32 | NumberType::I32 | NumberType::F32 => 4,
            NumberType::U64 | NumberType::I64 | NumberType::F64 => 8,
        }
    }
}

/// An array.
#[derive(Clone, Debug)]
pub struct Field<'a> {
    /// Its name.
    pub name: String,
    /// Type of its numbers.
    pub ty: NumberType,
    /// Length of each dimension.
    pub shape: Vec<usize>,
    /// Offset of its description in the file.
    pub byte: usize,
    /// Its numbers.
    bytes: &'a [u8],
}

impl Field<'_> {
    /// The numbers of a field of type u8.
    pub fn bytes(&self) -> Result<&[u8], TensorError> {
        self.check_type(NumberType::U8)?;
        Ok(self.bytes)
    }

    /// The numbers of a field of type f32, which must be finite.
    pub fn floats(&self) -> Result<Vec<f32>, TensorError> {
        self.check_type(NumberType::F32)?;
        let (words, _) = self.bytes.as_chunks::<4>();
        let numbers: Vec<f32> = words.iter().map(|&word| f32::from_le_bytes(word)).collect();
        match numbers.iter().position(|x| !x.is_finite()) {
            Some(i) => Err(self.wrong(format!("number {i} of `{}` is {}", self.name, numbers[i]))),
            None => Ok(numbers),
        }
    }

    /// An error about this field.
    pub fn wrong(&self, message: String) -> TensorError {
        TensorError { byte: self.byte, message }
    }

    fn check_type(&self, ty: NumberType) -> Result<(), TensorError> {
        if self.ty == ty {
            return Ok(());
        }
        Err(self.wrong(format!("`{}` has numbers of type {:?}, not {ty:?}", self.name, self.ty)))
    }
}

/// A file.
#[derive(Clone, Debug)]
pub struct TensorFile<'a> {
    fields: Vec<Field<'a>>,
}

/// The unread bytes.
struct Reader<'a> {
    file: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize, what: &str) -> Result<&'a [u8], TensorError> {
        let end = self.at.checked_add(count).filter(|&end| end <= self.file.len());
        let Some(end) = end else {
            return Err(self.wrong(format!("the file ends within {what}")));
        };
        let bytes = &self.file[self.at..end];
        self.at = end;
        Ok(bytes)
    }

    fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N], TensorError> {
        let mut bytes = [0; N];
        bytes.copy_from_slice(self.take(N, what)?);
        Ok(bytes)
    }

    fn wrong(&self, message: String) -> TensorError {
        TensorError { byte: self.at, message }
    }

    /// The description of a field, with its numbers.
    fn field(&mut self, index: usize) -> Result<Field<'a>, TensorError> {
        let byte = self.at;
        let what = format!("the description of field {index}");
        let length = u16::from_le_bytes(self.array(&what)?);
        let name = String::from_utf8_lossy(self.take(length.into(), &what)?).into_owned();
        let dimensions = usize::from(u16::from_le_bytes(self.array(&what)?));
        if dimensions > MOST_DIMENSIONS {
            return Err(
                self.wrong(format!("`{name}` has {dimensions} dimensions, but at most {MOST_DIMENSIONS} are read"))
            );
        }
        let [code] = self.array(&what)?;
        let Some(ty) = NumberType::from_code(code) else {
            return Err(self.wrong(format!("`{name}` has numbers of the unknown type {code}")));
        };
        let offset = u64::from_le_bytes(self.array(&what)?);
        let mut shape = Vec::with_capacity(dimensions);
        for _ in 0..dimensions {
            shape.push(u64::from_le_bytes(self.array(&what)?));
        }
        let size = shape.iter().try_fold(ty.size() as u64, |size, &length| size.checked_mul(length));
        let end = size.and_then(|size| offset.checked_add(size)).filter(|&end| end <= self.file.len() as u64);
        let Some(end) = end else {
            let message = format!("`{name}` of {shape:?} numbers at byte {offset} does not end in the file");
            return Err(TensorError { byte, message });
        };
        // Ranges within the file fit into usize
        let (shape, bytes) = (shape.iter().map(|&n| n as usize).collect(), &self.file[offset as usize..end as usize]);
        Ok(Field { name, ty, shape, byte, bytes })
    }
}

impl<'a> TensorFile<'a> {
    /// Parses the bytes of a file.
    pub fn parse(file: &'a [u8]) -> Result<Self, TensorError> {
        let mut reader = Reader { file, at: 0 };
        if !file.starts_with(MAGIC) {
            return Err(reader.wrong("the file does not begin with `tensor_file`".to_owned()));
        }
        reader.at = MAGIC.len();
        let [major, minor] = reader.array("its version")?;
        if [major, minor] != [1, 0] {
            return Err(reader.wrong(format!("the file has version {major}.{minor}, but only 1.0 is read")));
        }
        let count = u32::from_le_bytes(reader.array("the number of its fields")?) as usize;
        if count > MOST_FIELDS {
            return Err(reader.wrong(format!("the file has {count} fields, but at most {MOST_FIELDS} are read")));
        }
        let fields = (0..count).map(|index| reader.field(index)).collect::<Result<_, _>>()?;
        Ok(TensorFile { fields })
    }

    /// The field with a name.
    pub fn field(&self, name: &str) -> Option<&Field<'a>> {
        self.fields.iter().find(|field| field.name == name)
    }

    /// The field with a name; an error if it is missing.
    pub fn need(&self, name: &str) -> Result<&Field<'a>, TensorError> {
        let missing = || {
            let there: Vec<&str> = self.fields.iter().map(|field| field.name.as_str()).collect();
            TensorError {
                byte: MAGIC.len() + 2,
                message: format!("there is no field `{name}`, but {}", there.join(", ")),
            }
        };
        self.field(name).ok_or_else(missing)
    }
}

/// Writes a file with these fields: names, shapes and numbers.
pub fn write_tensor_file(fields: &[(&str, Vec<usize>, FieldData<'_>)]) -> Vec<u8> {
    let header: usize = 18 + fields.iter().map(|(name, shape, _)| 13 + name.len() + 8 * shape.len()).sum::<usize>();
    let (mut file, mut data) = (MAGIC.to_vec(), Vec::new());
    file.extend([1, 0]);
    file.extend((fields.len() as u32).to_le_bytes());
    for (name, shape, numbers) in fields {
        file.extend((name.len() as u16).to_le_bytes());
        file.extend(name.as_bytes());
        file.extend((shape.len() as u16).to_le_bytes());
        file.push(if matches!(numbers, FieldData::Bytes(_)) { 1 } else { 10 });
        file.extend(((header + data.len()) as u64).to_le_bytes());
        shape.iter().for_each(|&n| file.extend((n as u64).to_le_bytes()));
        match numbers {
            FieldData::Bytes(bytes) => data.extend_from_slice(bytes),
            FieldData::Floats(floats) => floats.iter().for_each(|x| data.extend(x.to_le_bytes())),
        }
    }
    file.extend(data);
    file
}

/// Numbers of [`write_tensor_file`].
#[derive(Clone, Copy, Debug)]
pub enum FieldData<'a> {
    /// Of type u8.
    Bytes(&'a [u8]),
    /// Of type f32.
    Floats(&'a [f32]),
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> Vec<u8> {
        write_tensor_file(&[
            ("text", vec![3], FieldData::Bytes(b"abc")),
            ("table", vec![2, 3], FieldData::Floats(&[1.0, 2.0, 3.0, 4.0, 5.0, -6.5])),
        ])
    }

    fn error_of(file: &[u8]) -> String {
        TensorFile::parse(file).err().map(|e| e.to_string()).unwrap_or_default()
    }

    #[test]
    fn fields_are_what_was_written() {
        let bytes = small();
        let file = TensorFile::parse(&bytes).unwrap();
        assert_eq!(file.need("text").unwrap().bytes().unwrap(), b"abc");
        let table = file.need("table").unwrap();
        assert_eq!(
            (table.shape.as_slice(), table.floats().unwrap()),
            (&[2, 3][..], vec![1.0, 2.0, 3.0, 4.0, 5.0, -6.5])
        );
        assert_eq!(table.bytes().unwrap_err().message, "`table` has numbers of type F32, not U8");
        assert!(file.need("wood").unwrap_err().to_string().ends_with("no field `wood`, but text, table"));
    }

    #[test]
    fn every_cut_is_an_error_and_none_a_panic() {
        let bytes = small();
        for length in 0..bytes.len() {
            let error = error_of(&bytes[..length]);
            let says = ["does not begin", "ends within", "does not end in"].iter().any(|s| error.contains(s));
            assert!(says, "{length}: {error}");
        }
    }

    #[test]
    fn changed_bytes_never_panic() {
        let bytes = small();
        for at in 0..bytes.len() {
            for value in [0, 1, 0x7f, 0xff] {
                let mut file = bytes.clone();
                file[at] = value;
                if let Ok(file) = TensorFile::parse(&file) {
                    file.fields.iter().for_each(|field| {
                        let _ = (field.floats(), field.bytes());
                    });
                }
            }
        }
    }

    #[test]
    fn errors_say_what_is_wrong() {
        let bytes = small();
        let with = |at: usize, value: u8| {
            let mut file = bytes.clone();
            file[at] = value;
            error_of(&file)
        };
        assert_eq!(with(12, 2), "byte 14: the file has version 2.0, but only 1.0 is read");
        assert!(with(17, 9).contains("at most 1000 are read"));
        // The type of `text`, and the length of its dimension
        assert!(with(18 + 2 + 4 + 2, 12).contains("`text` has numbers of the unknown type 12"));
        assert!(with(18 + 2 + 4 + 2 + 1 + 8 + 7, 0xff).contains("does not end in the file"));
        let file = write_tensor_file(&[("x", vec![2], FieldData::Floats(&[1.0, f32::NAN]))]);
        let error = TensorFile::parse(&file).unwrap().need("x").unwrap().floats().unwrap_err();
        assert_eq!(error.to_string(), "byte 18: number 1 of `x` is NaN");
    }
}

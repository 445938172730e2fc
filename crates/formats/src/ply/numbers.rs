//! Sequences of numbers in the three encodings.

use super::error::{Place, PlyError};
use super::header::{Element, Property, Scalar};
use super::stream::Stream;
use crate::number::{NumberError, Parsed, parse_f32, parse_f64, parse_i32};

/// Maximum length of a word in text (bytes).
const MAX_WORD: usize = 256;

/// Byte order of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ByteOrder {
    /// Little-endian.
    Little,
    /// Big-endian.
    Big,
}

/// A source of numbers of given types. `element` is named in errors.
pub(super) trait Numbers<'a> {
    /// Byte order; `None` for text.
    const ORDER: Option<ByteOrder>;

    /// The underlying bytes.
    fn stream(&mut self) -> &mut Stream<'a>;

    /// The next number.
    fn float(&mut self, ty: Scalar, element: &str) -> Result<f32, PlyError>;

    /// As [`Numbers::float`] in f64 precision.
    fn double(&mut self, ty: Scalar, element: &str) -> Result<f64, PlyError>;

    /// The next number, as an integer.
    fn integer(&mut self, ty: Scalar, element: &str) -> Result<i64, PlyError>;

    /// Skips `count` numbers.
    fn skip(&mut self, ty: Scalar, count: u64, element: &str) -> Result<(), PlyError>;

    /// Position of the next number.
    fn place(&mut self) -> Place;

    /// Minimum size of a number (bytes).
    fn size(ty: Scalar) -> u64;

    /// The length of a list; checked to fit into the rest of the file.
    fn list_length(&mut self, count_type: Scalar, ty: Scalar, element: &str) -> Result<u64, PlyError> {
        let place = self.place();
        let length = self.integer(count_type, element)?;
        let element = element.to_owned();
        let Ok(count) = u64::try_from(length) else {
            return Err(PlyError::ListLength { place, length, element });
        };
        // The blank after the last number of a text may be missing.
        if count.saturating_mul(Self::size(ty)) > self.stream().remaining_limit() + 1 {
            return Err(PlyError::Truncated { place, element });
        }
        Ok(count)
    }

    /// Skips a column of a row.
    fn skip_property(&mut self, property: &Property, element: &str) -> Result<(), PlyError> {
        let count = match property.list {
            None => 1,
            Some(count_type) => self.list_length(count_type, property.ty, element)?,
        };
        self.skip(property.ty, count, element)
    }

    /// Skips all rows.
    fn skip_element(&mut self, element: &Element) -> Result<(), PlyError> {
        if element.properties.is_empty() {
            return Ok(());
        }
        for _ in 0..element.count {
            for property in &element.properties {
                self.skip_property(property, &element.name)?;
            }
        }
        Ok(())
    }
}

/// Reads a number of type `$ty` at `$at`.
macro_rules! number_at {
    ($ty:ty, $big:expr, $bytes:expr, $at:expr) => {{
        let mut raw = [0; size_of::<$ty>()];
        raw.copy_from_slice(&$bytes[$at..$at + size_of::<$ty>()]);
        if $big { <$ty>::from_be_bytes(raw) } else { <$ty>::from_le_bytes(raw) }
    }};
}
pub(super) use number_at;

/// Reads a number of type `ty` at the offset `at`.
#[inline]
pub(super) fn double_at<const BIG: bool>(bytes: &[u8], at: usize, ty: Scalar) -> f64 {
    match ty {
        Scalar::F32 => f64::from(number_at!(f32, BIG, bytes, at)),
        Scalar::F64 => number_at!(f64, BIG, bytes, at),
        Scalar::I8 | Scalar::U8 | Scalar::I16 | Scalar::U16 | Scalar::I32 | Scalar::U32 => {
            integer_at::<BIG>(bytes, at, ty) as f64
        }
    }
}

#[inline]
fn integer_at<const BIG: bool>(bytes: &[u8], at: usize, ty: Scalar) -> i64 {
    match ty {
        Scalar::I8 => i64::from(bytes[at] as i8),
        Scalar::U8 => i64::from(bytes[at]),
        Scalar::I16 => i64::from(number_at!(i16, BIG, bytes, at)),
        Scalar::U16 => i64::from(number_at!(u16, BIG, bytes, at)),
        Scalar::I32 => i64::from(number_at!(i32, BIG, bytes, at)),
        Scalar::U32 => i64::from(number_at!(u32, BIG, bytes, at)),
        Scalar::F32 => whole(f64::from(number_at!(f32, BIG, bytes, at))),
        Scalar::F64 => whole(number_at!(f64, BIG, bytes, at)),
    }
}

/// Converts a float to an index; non-integers become an index out of range.
fn whole(value: f64) -> i64 {
    if value.fract() == 0.0 { value as i64 } else { -1 }
}

/// Binary numbers; big-endian if `BIG`.
pub(super) struct Binary<'s, 'a, const BIG: bool>(pub &'s mut Stream<'a>);

impl<'a, const BIG: bool> Numbers<'a> for Binary<'_, 'a, BIG> {
    const ORDER: Option<ByteOrder> = Some(if BIG { ByteOrder::Big } else { ByteOrder::Little });

    #[inline]
    fn stream(&mut self) -> &mut Stream<'a> {
        self.0
    }

    #[inline]
    fn float(&mut self, ty: Scalar, element: &str) -> Result<f32, PlyError> {
        self.double(ty, element).map(|value| value as f32)
    }

    #[inline]
    fn double(&mut self, ty: Scalar, element: &str) -> Result<f64, PlyError> {
        let value = double_at::<BIG>(self.0.require(ty.size(), element)?, 0, ty);
        self.0.consume(ty.size());
        Ok(value)
    }

    #[inline]
    fn integer(&mut self, ty: Scalar, element: &str) -> Result<i64, PlyError> {
        let value = integer_at::<BIG>(self.0.require(ty.size(), element)?, 0, ty);
        self.0.consume(ty.size());
        Ok(value)
    }

    fn skip(&mut self, ty: Scalar, count: u64, element: &str) -> Result<(), PlyError> {
        self.0.skip(count.saturating_mul(ty.size() as u64), element)
    }

    #[inline]
    fn place(&mut self) -> Place {
        Place::Byte(self.0.offset())
    }

    fn size(ty: Scalar) -> u64 {
        ty.size() as u64
    }
}

/// Numbers as words between blanks; line ends have no meaning, as in most readers.
pub(super) struct Ascii<'s, 'a>(pub &'s mut Stream<'a>);

impl Ascii<'_, '_> {
    /// Passes the next word to `parse`.
    #[inline]
    fn word<T>(
        &mut self,
        element: &str,
        expected: &'static str,
        parse: impl Fn(&[u8]) -> Result<Parsed<T>, NumberError>,
    ) -> Result<T, PlyError> {
        self.skip_blanks()?;
        let bytes = self.0.fill(MAX_WORD)?;
        match parse(bytes) {
            // The end of the buffer may cut a longer word; only blanks are delimiters here.
            Ok(Parsed { value, length })
                if length < MAX_WORD && bytes.get(length).is_none_or(u8::is_ascii_whitespace) =>
            {
                self.0.consume(length);
                Ok(value)
            }
            Ok(_) | Err(_) => Err(self.wrong_word(element, expected)),
        }
    }

    #[inline]
    fn skip_blanks(&mut self) -> Result<(), PlyError> {
        loop {
            let newline = self.0.newline;
            let bytes = self.0.fill(1)?;
            let blanks = bytes.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(bytes.len());
            let lines = bytes[..blanks].iter().filter(|&&b| b == newline).count();
            let is_done = blanks < bytes.len() || bytes.is_empty();
            self.0.line += lines as u64;
            self.0.consume(blanks);
            if is_done {
                return Ok(());
            }
        }
    }

    #[cold]
    fn wrong_word(&mut self, element: &str, expected: &'static str) -> PlyError {
        let (place, element) = (Place::Line(self.0.line), element.to_owned());
        match self.0.fill(MAX_WORD) {
            Err(error) => error,
            Ok([]) => PlyError::Truncated { place, element },
            Ok(bytes) => {
                let length = word_length(bytes).clamp(1, 40).min(bytes.len());
                let word = bytes[..length].escape_ascii().to_string();
                PlyError::Number { place, word, element, expected }
            }
        }
    }
}

/// Length of the word at the start, at most [`MAX_WORD`].
fn word_length(bytes: &[u8]) -> usize {
    bytes.iter().take(MAX_WORD).position(u8::is_ascii_whitespace).unwrap_or(bytes.len().min(MAX_WORD))
}

/// As [`parse_f32`], including the spellings of `nan` and `inf` that exporters write for invalid vertices.
#[inline]
fn parse_any_f32(bytes: &[u8]) -> Result<Parsed<f32>, NumberError> {
    parse_f32(bytes).or_else(|error| odd_float(&bytes[..word_length(bytes)], error))
}

/// As [`parse_any_f32`] in f64 precision.
#[inline]
fn parse_any_f64(bytes: &[u8]) -> Result<Parsed<f64>, NumberError> {
    parse_f64(bytes).or_else(|error| {
        let Parsed { value, length } = odd_float(&bytes[..word_length(bytes)], error)?;
        Ok(Parsed { value: f64::from(value), length })
    })
}

#[cold]
fn odd_float(word: &[u8], error: NumberError) -> Result<Parsed<f32>, NumberError> {
    let name = word.strip_prefix(b"-").or(word.strip_prefix(b"+")).unwrap_or(word).to_ascii_lowercase();
    let negative = word.starts_with(b"-");
    let infinity = if negative { f32::NEG_INFINITY } else { f32::INFINITY };
    let value = match name.as_slice() {
        _ if error == NumberError::Overflow => infinity,
        b"inf" | b"infinity" => infinity,
        name if name.starts_with(b"nan") => f32::NAN,
        _ => return Err(error),
    };
    Ok(Parsed { value, length: word.len() })
}

/// An integer; also accepted with a decimal point, as some exporters write it.
#[inline]
fn parse_whole(bytes: &[u8]) -> Result<Parsed<i64>, NumberError> {
    match parse_i32(bytes) {
        Ok(Parsed { value, length }) => Ok(Parsed { value: i64::from(value), length }),
        Err(error) => odd_whole(&bytes[..word_length(bytes)], error),
    }
}

#[cold]
fn odd_whole(word: &[u8], error: NumberError) -> Result<Parsed<i64>, NumberError> {
    let text = std::str::from_utf8(word).map_err(|_| error)?;
    let value = match (text.parse::<i64>(), text.parse::<f64>()) {
        (Ok(value), _) => value,
        (Err(_), Ok(value)) if value.fract() == 0.0 => value as i64,
        _ => return Err(error),
    };
    Ok(Parsed { value, length: word.len() })
}

impl<'a> Numbers<'a> for Ascii<'_, 'a> {
    const ORDER: Option<ByteOrder> = None;

    #[inline]
    fn stream(&mut self) -> &mut Stream<'a> {
        self.0
    }

    #[inline]
    fn float(&mut self, _: Scalar, element: &str) -> Result<f32, PlyError> {
        self.word(element, "a number", parse_any_f32)
    }

    #[inline]
    fn double(&mut self, _: Scalar, element: &str) -> Result<f64, PlyError> {
        self.word(element, "a number", parse_any_f64)
    }

    #[inline]
    fn integer(&mut self, _: Scalar, element: &str) -> Result<i64, PlyError> {
        self.word(element, "a whole number", parse_whole)
    }

    fn skip(&mut self, ty: Scalar, count: u64, element: &str) -> Result<(), PlyError> {
        for _ in 0..count {
            self.float(ty, element)?;
        }
        Ok(())
    }

    #[inline]
    fn place(&mut self) -> Place {
        Place::Line(self.0.line)
    }

    fn size(_: Scalar) -> u64 {
        // A digit and a blank.
        2
    }
}

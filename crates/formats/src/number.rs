//! Fast parsing of decimal numbers from bytes.
//!
//! A number with at most 19 digits and a power of ten up to 22 is the nearest f64 after one operation [Clinger 1990].
//! An f32 is rounded from it, except for the midpoint of two f32, where double rounding could be wrong. All other
//! numbers take the slow, exact path of the standard library. Every result is therefore the nearest f32 or f64.

use std::str::FromStr;

/// Errors of parsing a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NumberError {
    /// Not a number.
    Malformed,
    /// Too large to be represented.
    Overflow,
}

/// A value at the start of some bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parsed<T> {
    /// The value.
    pub value: T,
    /// Number of its bytes.
    pub length: usize,
}

const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

/// True for bytes that end a number or a word.
#[inline]
pub fn is_delimiter(byte: u8) -> bool {
    matches!(byte, b' ' | b'\n' | b'\r' | b'\t' | b'[' | b']' | b'"' | b'#')
}

/// Reads the number at the start of `bytes`. It ends at a delimiter.
#[inline]
pub fn parse_f32(bytes: &[u8]) -> Result<Parsed<f32>, NumberError> {
    let Parsed { value, length } = scan(bytes)?;
    if let Some(value) = value {
        // The midpoint of two f32 has exactly this tail; midpoints of f32 subnormals have it at other positions.
        let is_middle = value.to_bits() & 0x1fff_ffff == 0x1000_0000;
        if !is_middle && (value == 0.0 || (1e-37..1e38).contains(&value.abs())) {
            return Ok(Parsed { value: value as f32, length });
        }
    }
    slow::<f32>(&bytes[..length]).map(|value| Parsed { value, length })
}

/// As [`parse_f32`] in f64 precision, within the range of f32.
#[inline]
pub fn parse_f64(bytes: &[u8]) -> Result<Parsed<f64>, NumberError> {
    let Parsed { value, length } = scan(bytes)?;
    let value = match value {
        Some(value) => value,
        None => slow::<f64>(&bytes[..length])?,
    };
    if (value as f32).is_finite() { Ok(Parsed { value, length }) } else { Err(NumberError::Overflow) }
}

/// The number at the start of `bytes`; `None` unless it is the nearest f64 after one operation.
#[inline]
fn scan(bytes: &[u8]) -> Result<Parsed<Option<f64>>, NumberError> {
    let mut i = 0;
    let negative = bytes.first() == Some(&b'-');
    if negative || bytes.first() == Some(&b'+') {
        i = 1;
    }
    let mut mantissa = 0_u64;
    let first_digit = i;
    while let Some(digit) = digit_at(bytes, i) {
        mantissa = mantissa.wrapping_mul(10).wrapping_add(digit);
        i += 1;
    }
    let mut digits = i - first_digit;
    let mut exponent = 0_i32;
    if bytes.get(i) == Some(&b'.') {
        i += 1;
        let fraction = i;
        while let Some(digit) = digit_at(bytes, i) {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(digit);
            i += 1;
        }
        digits += i - fraction;
        exponent = -((i - fraction).min(100_000) as i32);
    }
    if digits == 0 {
        return Err(NumberError::Malformed);
    }
    if let Some(b'e' | b'E') = bytes.get(i) {
        let power = parse_exponent(&bytes[i + 1..])?;
        exponent = exponent.saturating_add(power.value);
        i += 1 + power.length;
    }
    if bytes.get(i).is_some_and(|&b| !is_delimiter(b)) {
        return Err(NumberError::Malformed);
    }
    if digits <= 19 && mantissa < 1 << 53 && exponent.unsigned_abs() <= 22 {
        let power = POWERS[exponent.unsigned_abs() as usize];
        let value = if exponent < 0 { mantissa as f64 / power } else { mantissa as f64 * power };
        return Ok(Parsed { value: Some(if negative { -value } else { value }), length: i });
    }
    Ok(Parsed { value: None, length: i })
}

#[inline]
fn digit_at(bytes: &[u8], i: usize) -> Option<u64> {
    let digit = bytes.get(i)?.wrapping_sub(b'0');
    (digit <= 9).then_some(u64::from(digit))
}

fn parse_exponent(bytes: &[u8]) -> Result<Parsed<i32>, NumberError> {
    let negative = bytes.first() == Some(&b'-');
    let start = usize::from(negative || bytes.first() == Some(&b'+'));
    let mut i = start;
    let mut power = 0_i32;
    while let Some(digit) = digit_at(bytes, i) {
        power = (power * 10 + digit as i32).min(100_000);
        i += 1;
    }
    if i == start {
        return Err(NumberError::Malformed);
    }
    Ok(Parsed { value: if negative { -power } else { power }, length: i })
}

#[cold]
fn slow<T: FromStr + Copy + Into<f64>>(text: &[u8]) -> Result<T, NumberError> {
    let value: T = std::str::from_utf8(text).ok().and_then(|t| t.parse().ok()).ok_or(NumberError::Malformed)?;
    if value.into().is_finite() { Ok(value) } else { Err(NumberError::Overflow) }
}

/// Reads the integer at the start of `bytes`. It ends at a delimiter.
#[inline]
pub fn parse_i32(bytes: &[u8]) -> Result<Parsed<i32>, NumberError> {
    let negative = bytes.first() == Some(&b'-');
    let start = usize::from(negative || bytes.first() == Some(&b'+'));
    let mut i = start;
    let mut value = 0_i64;
    while let Some(digit) = digit_at(bytes, i) {
        value = (value * 10 + digit as i64).min(1 << 40);
        i += 1;
    }
    if i == start || bytes.get(i).is_some_and(|&b| !is_delimiter(b)) {
        return Err(NumberError::Malformed);
    }
    let value = if negative { -value } else { value };
    i32::try_from(value).map(|value| Parsed { value, length: i }).map_err(|_| NumberError::Overflow)
}

/// The numbers of a text file, separated by blanks or commas, with comments after `#`.
pub fn numbers_of_text(text: &str) -> Result<Vec<f32>, String> {
    let words = text.lines().flat_map(|line| line.split('#').next().unwrap_or("").split([' ', '\t', '\r', ',']));
    let number = |word: &str| match parse_f32(word.as_bytes()) {
        Ok(Parsed { value, length }) if length == word.len() => Ok(value),
        _ => Err(format!("`{}` is no number", word.chars().take(40).collect::<String>())),
    };
    words.filter(|word| !word.is_empty()).map(number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn odd_spellings_have_their_values() {
        for text in [
            "0",
            "-0",
            "+1",
            ".5",
            "5.",
            "1e3",
            "1E-3",
            "-1.5e+2",
            "16777217",
            "1e-45",
            "3.4028235e38",
            "0.1",
            "00012",
            "1.00000000000000000000000000001",
            "123456789012345678901234567890",
            "8388609.5",
            "1e-400",
        ] {
            let expected: f32 = text.parse().unwrap();
            let Parsed { value, length } = parse_f32(text.as_bytes()).unwrap();
            assert_eq!(value.to_bits(), expected.to_bits(), "{text}");
            assert_eq!(length, text.len());
        }
        for text in ["", "-", ".", "e5", "1e", "1e+", "1x", "1.2.3", "nan", "inf", "--1", "0x10", "1,2"] {
            assert_eq!(parse_f32(text.as_bytes()), Err(NumberError::Malformed), "{text}");
        }
        assert_eq!(parse_f32(b"1e39"), Err(NumberError::Overflow));
        assert_eq!(parse_f32(b"1e999999999999"), Err(NumberError::Overflow));
    }

    #[test]
    fn whole_numbers_are_range_checked() {
        assert_eq!(parse_i32(b"-2147483648]"), Ok(Parsed { value: i32::MIN, length: 11 }));
        assert_eq!(parse_i32(b"2147483648"), Err(NumberError::Overflow));
        assert_eq!(parse_i32(b"99999999999999999999999999"), Err(NumberError::Overflow));
        assert_eq!(parse_i32(b"1.5"), Err(NumberError::Malformed));
        assert_eq!(parse_i32(b"-"), Err(NumberError::Malformed));
    }

    proptest! {
        #[test]
        fn every_f32_survives_its_shortest_spelling(bits: u32) {
            let value = f32::from_bits(bits);
            prop_assume!(value.is_finite());
            for text in [format!("{value}"), format!("{value:e}"), format!("{:.9e}", f64::from(value))] {
                let parsed = parse_f32(text.as_bytes()).unwrap().value;
                prop_assert_eq!(parsed.to_bits(), value.to_bits(), "{}", text);
            }
        }

        #[test]
        fn decimals_agree_with_the_standard_library(mantissa: u64, exponent in -60_i32..45) {
            let text = format!("{mantissa}e{exponent}");
            let expected: f32 = text.parse().unwrap();
            match parse_f32(text.as_bytes()) {
                Ok(Parsed { value, .. }) => {
                    prop_assert_eq!(value.to_bits(), expected.to_bits());
                    let value = parse_f64(text.as_bytes()).unwrap().value;
                    prop_assert_eq!(value.to_bits(), text.parse::<f64>().unwrap().to_bits());
                }
                Err(error) => {
                    prop_assert!(error == NumberError::Overflow && expected.is_infinite());
                    prop_assert_eq!(parse_f64(text.as_bytes()), Err(error));
                }
            }
        }

        #[test]
        fn short_decimals_agree_with_the_standard_library(digits in 0_u32..100_000_000, point in 0_usize..9) {
            let mut text = format!("{digits:08}");
            text.insert(point.min(text.len()), '.');
            let expected: f32 = text.parse().unwrap();
            prop_assert_eq!(parse_f32(text.as_bytes()).unwrap().value.to_bits(), expected.to_bits());
            let expected: f64 = text.parse().unwrap();
            prop_assert_eq!(parse_f64(text.as_bytes()).unwrap().value.to_bits(), expected.to_bits());
        }

        #[test]
        fn random_bytes_do_not_panic(bytes in proptest::collection::vec(any::<u8>(), 0..40)) {
            let _ = (parse_f32(&bytes), parse_f64(&bytes), parse_i32(&bytes));
        }
    }
}

//! Values of settings: kinds, ranges, and notation.

use std::fmt;

/// The value of a setting. [`fmt::Display`] writes the notation that [`Kind::parse`] reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// One of a list of names.
    Name(&'static str),
    /// A name with a number, such as `floor:0.01`.
    Graded(&'static str, f32),
    /// A whole number.
    Integer(u64),
    /// A number.
    Real(f32),
    /// Two numbers.
    Pair([f32; 2]),
}

impl Value {
    /// The name.
    pub fn name(&self) -> Option<&'static str> {
        match self {
            Value::Name(name) | Value::Graded(name, _) => Some(name),
            Value::Integer(_) | Value::Real(_) | Value::Pair(_) => None,
        }
    }

    /// The whole number.
    pub fn integer(&self) -> Option<u64> {
        match self {
            Value::Integer(n) => Some(*n),
            Value::Name(_) | Value::Graded(..) | Value::Real(_) | Value::Pair(_) => None,
        }
    }

    /// The number; for a graded name, its grade.
    pub fn real(&self) -> Option<f32> {
        match self {
            Value::Real(x) | Value::Graded(_, x) => Some(*x),
            Value::Name(_) | Value::Integer(_) | Value::Pair(_) => None,
        }
    }

    /// The two numbers.
    pub fn pair(&self) -> Option<[f32; 2]> {
        match self {
            Value::Pair(pair) => Some(*pair),
            Value::Name(_) | Value::Graded(..) | Value::Integer(_) | Value::Real(_) => None,
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Name(name) => f.write_str(name),
            Value::Graded(name, grade) => write!(f, "{name}:{grade}"),
            Value::Integer(n) => write!(f, "{n}"),
            Value::Real(x) => write!(f, "{x}"),
            Value::Pair([a, b]) => write!(f, "{a},{b}"),
        }
    }
}

/// Numbers between two bounds. The upper bound may be infinite, and is then not included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The lower bound.
    pub min: f32,
    /// True if it belongs to the interval.
    pub has_min: bool,
    /// The upper bound.
    pub max: f32,
    /// True if it belongs to the interval.
    pub has_max: bool,
}

impl Interval {
    /// Above 0.
    pub const POSITIVE: Interval = Interval { min: 0.0, has_min: false, max: f32::INFINITY, has_max: false };

    /// Both bounds belong to it.
    pub const fn closed(min: f32, max: f32) -> Interval {
        Interval { min, has_min: true, max, has_max: true }
    }

    /// Neither bound belongs to it.
    pub const fn open(min: f32, max: f32) -> Interval {
        Interval { min, has_min: false, max, has_max: false }
    }

    /// The upper bound belongs to it.
    pub const fn above(min: f32, max: f32) -> Interval {
        Interval { min, has_min: false, max, has_max: true }
    }

    /// True if `x` is in the interval; false for NaN.
    pub fn contains(&self, x: f32) -> bool {
        let above = x > self.min || self.has_min && x == self.min;
        above && (x < self.max || self.has_max && x == self.max)
    }
}

impl fmt::Display for Interval {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Interval { min, max, .. } = self;
        match (self.has_min, self.has_max) {
            (false, false) if *self == Interval::POSITIVE => f.write_str("positive"),
            (true, true) => write!(f, "from {min} to {max}"),
            (true, false) => write!(f, "at least {min} and below {max}"),
            (false, true) => write!(f, "above {min} and up to {max}"),
            (false, false) => write!(f, "above {min} and below {max}"),
        }
    }
}

/// Integers between two bounds, both included. The maximum of the type is not written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Integers {
    /// The lower bound.
    pub min: u64,
    /// The upper bound.
    pub max: u64,
}

impl Integers {
    /// All numbers of 32 bits.
    pub const ALL: Integers = Integers { min: 0, max: u32::MAX as u64 };

    /// True if the upper bound is the maximum of the type.
    fn is_open(&self) -> bool {
        self.max >= u64::from(u32::MAX)
    }

    /// True if `n` lies between the bounds.
    pub fn contains(&self, n: i64) -> bool {
        u64::try_from(n).is_ok_and(|n| (self.min..=self.max).contains(&n))
    }
}

impl fmt::Display for Integers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Integers { min, max } = self;
        if self.is_open() { write!(f, "at least {min}") } else { write!(f, "from {min} to {max}") }
    }
}

/// The kind of values of a setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// One of `names`. Scene files may also use pbrt's synonyms for them.
    Choice {
        /// Names that are written.
        names: &'static [&'static str],
        /// Names that are read as well, with their meaning.
        synonyms: &'static [(&'static str, &'static str)],
    },
    /// A whole number, or a word in place of one.
    Integer {
        /// Its range.
        range: Integers,
        /// The words.
        words: &'static [&'static str],
    },
    /// A number, or a word in place of one.
    Real {
        /// Its range.
        range: Interval,
        /// The words.
        words: &'static [&'static str],
    },
    /// A positive number, such as 0.02, which may be written as a percentage, 2%; or a word in place of one.
    Percentage {
        /// The words.
        words: &'static [&'static str],
    },
    /// Two numbers separated by a comma, the smaller one first.
    Pair {
        /// The range of both.
        range: Interval,
        /// Their unit.
        unit: &'static str,
    },
    /// A name on its own, or one of those followed by a colon and a number.
    Graded {
        /// The name without a number.
        plain: &'static str,
        /// The others.
        graded: &'static [&'static str],
        /// The range of the number.
        range: Interval,
        /// The number where none is written.
        default: f32,
    },
    /// A number of bytes, optionally with a unit.
    Bytes,
}

impl Kind {
    /// Reads a value from text.
    ///
    /// Returns `Err` with the expected values if the text is invalid.
    pub fn parse(&self, text: &str) -> Result<Value, String> {
        let value = match self {
            Kind::Choice { names, .. } => named(names, text),
            Kind::Integer { range, words } => named(words, text).or_else(|| {
                let n = text.parse::<i64>().ok().filter(|&n| range.contains(n))?;
                Some(Value::Integer(n.unsigned_abs()))
            }),
            Kind::Real { range, words } => named(words, text).or_else(|| Some(Value::Real(real_in(range, text)?))),
            Kind::Percentage { words } => named(words, text).or_else(|| Some(Value::Real(part(text)?))),
            Kind::Pair { range, .. } => text.split_once(',').and_then(|(a, b)| {
                let pair = [real_in(range, a)?, real_in(range, b)?];
                (pair[0] <= pair[1]).then_some(Value::Pair(pair))
            }),
            Kind::Graded { plain, graded, range, default } => {
                let (name, grade) = text.split_once(':').map_or((text, None), |(name, grade)| (name, Some(grade)));
                match named(graded, name) {
                    Some(Value::Name(name)) => {
                        let grade = grade.map_or(Some(*default), |grade| real_in(range, grade));
                        grade.map(|grade| Value::Graded(name, grade))
                    }
                    _ => (text == *plain).then_some(Value::Name(plain)),
                }
            }
            Kind::Bytes => bytes(text).map(Value::Integer),
        };
        value.ok_or_else(|| match self {
            // Only mentioned here, as it is not a sensible limit
            Kind::Integer { range, .. } if range.is_open() && text.parse().is_ok_and(|n: u64| n > range.max) => {
                format!("expected a whole number from {} to {}", range.min, range.max)
            }
            _ => format!("expected {self}"),
        })
    }
}

/// The expected values, for messages.
impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Kind::Choice { names, .. } => write!(f, "one of {}", names.join(", ")),
            Kind::Integer { range, words } => write!(f, "a whole number {range}{}", or(words)),
            Kind::Real { range, words } if *range == Interval::POSITIVE => write!(f, "a positive number{}", or(words)),
            Kind::Real { range, words } => write!(f, "a number {range}{}", or(words)),
            Kind::Percentage { words } => write!(f, "a positive number such as 0.02, or 2%{}", or(words)),
            Kind::Pair { range, unit } => {
                write!(f, "two {range} numbers of {unit} separated by a comma, the smaller one first")
            }
            Kind::Graded { plain, graded, range, .. } => {
                let graded: Vec<String> = graded.iter().map(|name| format!("{name}:E")).collect();
                write!(f, "{plain}, {}, E being {range}", graded.join(" or "))
            }
            Kind::Bytes => f.write_str("a number of bytes, such as 4000000, 800M or 4G"),
        }
    }
}

/// `, or` a list of words.
fn or(words: &[&str]) -> String {
    match words {
        [] => String::new(),
        [word] => format!(", or {word}"),
        [first @ .., last] => format!(", {}, or {last}", first.join(", ")),
    }
}

fn named(names: &[&'static str], text: &str) -> Option<Value> {
    names.iter().find(|&&name| name == text).map(|name| Value::Name(name))
}

fn real_in(range: &Interval, text: &str) -> Option<f32> {
    text.trim().parse().ok().filter(|&x| range.contains(x))
}

/// A positive number, possibly as a percentage.
fn part(text: &str) -> Option<f32> {
    let percent = text.trim().strip_suffix('%');
    let part = percent.map_or_else(|| text.trim().parse().ok(), |n| Some(n.trim().parse::<f32>().ok()? / 100.0));
    part.filter(|part| Interval::POSITIVE.contains(*part))
}

fn bytes(text: &str) -> Option<u64> {
    let (digits, shift) = match text.trim_end_matches(['B', 'b', 'i']) {
        t if t.ends_with(['k', 'K']) => (&t[..t.len() - 1], 10),
        t if t.ends_with(['m', 'M']) => (&t[..t.len() - 1], 20),
        t if t.ends_with(['g', 'G']) => (&t[..t.len() - 1], 30),
        t => (t, 0),
    };
    let bytes = digits.trim().parse::<f64>().ok()? * f64::from(1_u32 << shift);
    (1.0..1e18).contains(&bytes).then_some(bytes as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_units() {
        assert_eq!(Kind::Bytes.parse("1234"), Ok(Value::Integer(1234)));
        assert_eq!(Kind::Bytes.parse("800M"), Ok(Value::Integer(800 << 20)));
        assert_eq!(Kind::Bytes.parse("1.5GiB"), Ok(Value::Integer(3 << 29)));
        for wrong in ["", "G", "-1", "0", "1e30", "lots"] {
            assert!(Kind::Bytes.parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn parts_are_numbers_or_percentages() {
        let kind = Kind::Percentage { words: &["off"] };
        for text in ["0.02", "2%", "2 %"] {
            assert_eq!(kind.parse(text), Ok(Value::Real(0.02)), "{text}");
        }
        assert_eq!(kind.parse("off"), Ok(Value::Name("off")));
        for wrong in ["", "%", "0%", "-2%", "2%%", "inf%"] {
            assert_eq!(kind.parse(wrong), Err("expected a positive number such as 0.02, or 2%, or off".to_owned()));
        }
    }

    #[test]
    fn graded_names_have_a_number_or_the_default() {
        let range = Interval::above(0.0, 1.0);
        let kind = Kind::Graded { plain: "none", graded: &["floor", "cut-off"], range, default: 0.01 };
        assert_eq!(kind.parse("none"), Ok(Value::Name("none")));
        assert_eq!(kind.parse("floor:0.2"), Ok(Value::Graded("floor", 0.2)));
        assert_eq!(kind.parse("cut-off"), Ok(Value::Graded("cut-off", 0.01)));
        for wrong in ["floor:0", "floor:2", "cut-off:", "most", "none:1", ""] {
            let expected = "expected none, floor:E or cut-off:E, E being above 0 and up to 1";
            assert_eq!(kind.parse(wrong), Err(expected.to_owned()), "{wrong}");
        }
    }

    #[test]
    fn numbers_that_are_too_large_to_be_stored_are_told_the_largest() {
        let integer = Kind::Integer { range: Integers { min: 1, ..Integers::ALL }, words: &[] };
        assert_eq!(integer.parse("4294967295"), Ok(Value::Integer(4_294_967_295)));
        assert_eq!(integer.parse("4294967296"), Err("expected a whole number from 1 to 4294967295".to_owned()));
        assert_eq!(integer.parse("0"), Err("expected a whole number at least 1".to_owned()));
    }

    #[test]
    fn ranges_hold_their_bounds_or_not_and_say_so() {
        let integer = Kind::Integer { range: Integers { min: 1, max: 4096 }, words: &["auto", "optimal"] };
        assert_eq!(integer.parse("optimal"), Ok(Value::Name("optimal")));
        assert_eq!((integer.parse("1"), integer.parse("4096")), (Ok(Value::Integer(1)), Ok(Value::Integer(4096))));
        for wrong in ["0", "4097", "-1", "1.5", "Auto", ""] {
            let expected = "expected a whole number from 1 to 4096, auto, or optimal";
            assert_eq!(integer.parse(wrong), Err(expected.to_owned()), "{wrong}");
        }
        let real = |range| Kind::Real { range, words: &[] };
        for (range, inside, outside, text) in [
            (Interval::open(0.0, 1.0), "0.5", ["0", "1"], "above 0 and below 1"),
            (Interval::above(0.0, 1.0), "1", ["0", "1.01"], "above 0 and up to 1"),
            (Interval::closed(0.0, 0.95), "0", ["-0.1", "0.96"], "from 0 to 0.95"),
            (Interval::POSITIVE, "1e30", ["0", "inf"], "positive"),
        ] {
            assert!(real(range).parse(inside).is_ok(), "{range}");
            assert!(outside.iter().chain(&["nan"]).all(|text| real(range).parse(text).is_err()), "{range}");
            assert_eq!(range.to_string(), text);
        }
    }

    #[test]
    fn pairs_ascend() {
        let pair = Kind::Pair { range: Interval::POSITIVE, unit: "pixels" };
        assert_eq!(pair.parse("2, 2"), Ok(Value::Pair([2.0, 2.0])));
        for wrong in ["3,2", "0,2", "3", "3,4,5", "3,x", "2,inf"] {
            assert!(pair.parse(wrong).is_err(), "{wrong}");
        }
    }
}

//! JSON as one array of values of 16 bytes, for documents of 10⁵ nodes: `serde_json::Value` takes some 700 bytes for an
//! object of two members.
//!
//! Children of an array or an object are contiguous, so that an element is accessed by its index.

use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use std::collections::HashMap;
use std::fmt;
use std::ops::Range;

/// A parsed text.
#[derive(Debug)]
pub struct Json {
    root: Value,
    /// Children of all arrays and objects.
    values: Vec<Value>,
    /// Names of members, each once.
    names: Vec<String>,
    /// All strings, concatenated.
    text: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Null,
    /// 0 or 1.
    Flag,
    /// A non-negative integer.
    Whole,
    /// Bits of an f64.
    Number,
    /// Range of `Json::text`.
    Text,
    /// Range of `Json::values`.
    Array,
    /// Range of `Json::values`.
    Object,
}

/// A value, with its name if it is a member of an object.
#[derive(Clone, Copy, Debug)]
pub(super) struct Value {
    /// A number, or a range: first index in the upper half, length in the lower half.
    bits: u64,
    /// Index into `Json::names`.
    name: u32,
    kind: Kind,
}

impl Value {
    fn new(kind: Kind, bits: u64) -> Self {
        Value { bits, name: 0, kind }
    }

    fn range(self) -> Range<usize> {
        let first = (self.bits >> 32) as usize;
        first..first + self.bits as u32 as usize
    }

    pub(super) fn is_array(self) -> bool {
        self.kind == Kind::Array
    }

    pub(super) fn is_object(self) -> bool {
        self.kind == Kind::Object
    }

    pub(super) fn flag(self) -> Option<bool> {
        (self.kind == Kind::Flag).then_some(self.bits == 1)
    }

    pub(super) fn whole(self) -> Option<u64> {
        (self.kind == Kind::Whole).then_some(self.bits)
    }

    pub(super) fn number(self) -> Option<f64> {
        match self.kind {
            Kind::Whole => Some(self.bits as f64),
            Kind::Number => Some(f64::from_bits(self.bits)),
            Kind::Null | Kind::Flag | Kind::Text | Kind::Array | Kind::Object => None,
        }
    }
}

impl Json {
    /// Parses a text.
    pub fn parse(text: &[u8]) -> serde_json::Result<Self> {
        let root = Value::new(Kind::Null, 0);
        let json = Json { root, values: Vec::new(), names: Vec::new(), text: String::new() };
        let mut builder = Builder { json, ids: HashMap::new(), open: Vec::new() };
        let mut deserializer = serde_json::Deserializer::from_slice(text);
        let root = builder.deserialize(&mut deserializer)?;
        deserializer.end()?;
        Ok(Json { root, ..builder.json })
    }

    pub(super) fn root(&self) -> Value {
        self.root
    }

    pub(super) fn text(&self, value: Value) -> Option<&str> {
        (value.kind == Kind::Text).then(|| &self.text[value.range()])
    }

    /// Elements of an array; empty for other values.
    pub(super) fn elements(&self, value: Value) -> &[Value] {
        if value.is_array() { &self.values[value.range()] } else { &[] }
    }

    /// Members of an object with their names; empty for other values.
    pub(super) fn members(&self, value: Value) -> impl DoubleEndedIterator<Item = (&str, Value)> {
        let members = if value.is_object() { &self.values[value.range()] } else { &[] };
        members.iter().map(|&member| {
            #[cfg(test)]
            count_work();
            (self.names[member.name as usize].as_str(), member)
        })
    }

    /// A member of an object; the last one with this name.
    pub(super) fn member(&self, value: Value, name: &str) -> Option<Value> {
        self.members(value).rev().find_map(|(other, member)| (other == name).then_some(member))
    }
}

#[cfg(test)]
thread_local! {
    /// Number of accesses to values and members: the work of reading a document.
    pub(super) static WORK: std::cell::Cell<u64> = const { std::cell::Cell::new(0) };
}

#[cfg(test)]
pub(super) fn count_work() {
    WORK.set(WORK.get() + 1);
}

/// State of the parser.
struct Builder {
    json: Json,
    /// Indices of names.
    ids: HashMap<String, u32>,
    /// Children so far of the open arrays and objects.
    open: Vec<Value>,
}

impl Builder {
    /// Closes an array or an object whose children start at `first` in `open`.
    fn close<E: Error>(&mut self, kind: Kind, first: usize) -> Result<Value, E> {
        let range = range(self.json.values.len(), self.open.len() - first)?;
        self.json.values.extend(self.open.drain(first..));
        Ok(Value::new(kind, range))
    }
}

fn range<E: Error>(first: usize, length: usize) -> Result<u64, E> {
    let half = |n: usize| u32::try_from(n).map_err(|_| E::custom("more than 2^32 values or bytes of text"));
    Ok(u64::from(half(first)?) << 32 | u64::from(half(length)?))
}

impl<'de> DeserializeSeed<'de> for &mut Builder {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for &mut Builder {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::new(Kind::Null, 0))
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(Value::new(Kind::Flag, u64::from(value)))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(Value::new(Kind::Whole, value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(Value::new(Kind::Number, (value as f64).to_bits()))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Value, E> {
        Ok(Value::new(Kind::Number, value.to_bits()))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Value, E> {
        let range = range(self.json.text.len(), text.len())?;
        self.json.text.push_str(text);
        Ok(Value::new(Kind::Text, range))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<Value, A::Error> {
        let first = self.open.len();
        while let Some(element) = elements.next_element_seed(&mut *self)? {
            self.open.push(element);
        }
        self.close(Kind::Array, first)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> Result<Value, A::Error> {
        let first = self.open.len();
        while let Some(name) = members.next_key_seed(NameOf(self))? {
            let member = members.next_value_seed(&mut *self)?;
            self.open.push(Value { name, ..member });
        }
        self.close(Kind::Object, first)
    }
}

/// Reads the name of a member as its index.
struct NameOf<'a>(&'a mut Builder);

impl<'de> DeserializeSeed<'de> for NameOf<'_> {
    type Value = u32;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<u32, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl<'de> Visitor<'de> for NameOf<'_> {
    type Value = u32;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the name of a member")
    }

    fn visit_str<E>(self, name: &str) -> Result<u32, E> {
        let Builder { json, ids, .. } = self.0;
        if let Some(&id) = ids.get(name) {
            return Ok(id);
        }
        // Fewer than the bytes of the text, which are below 2³²
        let id = json.names.len() as u32;
        json.names.push(name.to_owned());
        ids.insert(name.to_owned(), id);
        Ok(id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_those_of_serde_json_and_take_16_bytes() {
        fn agree(json: &Json, value: Value, expected: &serde_json::Value) {
            assert_eq!(value.flag(), expected.as_bool());
            assert_eq!((value.whole(), value.number()), (expected.as_u64(), expected.as_f64()));
            assert_eq!(json.text(value), expected.as_str());
            assert_eq!((value.is_array(), value.is_object()), (expected.is_array(), expected.is_object()));
            let elements = expected.as_array().map_or(&[][..], Vec::as_slice);
            assert_eq!(json.elements(value).len(), elements.len());
            json.elements(value).iter().zip(elements).for_each(|(value, expected)| agree(json, *value, expected));
            assert!(value.is_object() || json.members(value).next().is_none());
            for (name, expected) in expected.as_object().into_iter().flatten() {
                agree(json, json.member(value, name).unwrap(), expected);
            }
        }
        let text = r#" {"a": [1, -2, 2.5e3, 18446744073709551615, 1e300, [], {}], "b": {"c": "x\n\u00e9", "a": null},
            "c": true, "twice": 1, "twice": {"a": "", "d": [[false]]}} "#;
        let json = Json::parse(text.as_bytes()).unwrap();
        agree(&json, json.root(), &serde_json::from_str(text).unwrap());
        assert_eq!(size_of::<Value>(), 16);
    }

    #[test]
    fn errors_are_those_of_serde_json() {
        for text in ["", "{", "[1,]", "{\"a\" 1}", "1 2", "\"\\x\"", "nul", &"[".repeat(200)] {
            let expected = serde_json::from_str::<serde_json::Value>(text).unwrap_err().to_string();
            assert_eq!(Json::parse(text.as_bytes()).unwrap_err().to_string(), expected, "{text}");
        }
    }
}

//! A path in the JSON and its value, if there is one. The text of the path is only made for messages.

use super::json::{Json, Value};
use std::fmt::Write;

/// A format error with its position.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GltfError {
    /// Path in the JSON, or byte of the container.
    pub place: String,
    /// One sentence without a full stop.
    pub message: String,
}

impl std::fmt::Display for GltfError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.place.is_empty() { f.write_str(&self.message) } else { write!(f, "{}: {}", self.place, self.message) }
    }
}

impl std::error::Error for GltfError {}

/// Maximum number of steps stored: the path to the numbers of a texture's transform has nine.
const STEPS: usize = 12;

/// A step from a value to one of its children.
#[derive(Clone, Copy, Debug)]
enum Step<'a> {
    Member(&'a str),
    Element(usize),
}

/// A path in the JSON; the default has no value.
#[derive(Clone, Copy, Debug)]
pub struct Place<'a> {
    found: Option<(&'a Json, Value)>,
    steps: [Step<'a>; STEPS],
    /// Number of steps; steps beyond [`STEPS`] are missing in the path.
    depth: usize,
}

impl Default for Place<'_> {
    fn default() -> Self {
        Place { found: None, steps: [Step::Element(0); STEPS], depth: 0 }
    }
}

impl<'a> Place<'a> {
    /// The root.
    pub fn root(json: &'a Json) -> Self {
        Place { found: Some((json, json.root())), ..Place::default() }
    }

    /// The path as text, such as `meshes[0].primitives[1]`.
    pub fn path(&self) -> String {
        let mut path = String::new();
        for step in &self.steps[..self.depth.min(STEPS)] {
            let dot = if path.is_empty() { "" } else { "." };
            let written = match step {
                Step::Member(name) => write!(path, "{dot}{name}"),
                Step::Element(index) => write!(path, "[{index}]"),
            };
            written.expect("strings can be written to");
        }
        path
    }

    fn to(&self, step: Step<'a>, value: Option<Value>) -> Place<'a> {
        #[cfg(test)]
        super::json::count_work();
        let mut place = Place { found: self.found.and_then(|(json, _)| Some((json, value?))), ..*self };
        if let Some(slot) = place.steps.get_mut(self.depth) {
            *slot = step;
        }
        place.depth += 1;
        place
    }

    /// A member of an object.
    #[must_use]
    pub fn key(&self, key: &'a str) -> Place<'a> {
        self.to(Step::Member(key), self.found.and_then(|(json, value)| json.member(value, key)))
    }

    /// An extension.
    #[must_use]
    pub fn extension(&self, name: &'a str) -> Place<'a> {
        self.key("extensions").key(name)
    }

    fn elements(&self) -> &'a [Value] {
        self.found.map_or(&[], |(json, value)| json.elements(value))
    }

    /// An element of an array.
    #[must_use]
    pub fn item(&self, index: usize) -> Place<'a> {
        self.to(Step::Element(index), self.elements().get(index).copied())
    }

    /// Number of elements of an array; 0 for other values.
    pub fn len(&self) -> usize {
        self.elements().len()
    }

    /// True if it is not an array, or has no elements.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All elements of an array.
    pub fn items(&self) -> impl DoubleEndedIterator<Item = Place<'a>> + ExactSizeIterator + use<'a> {
        let place = *self;
        self.elements().iter().enumerate().map(move |(i, value)| place.to(Step::Element(i), Some(*value)))
    }

    /// All members of an object, with their names.
    pub fn members(&self) -> impl Iterator<Item = (&'a str, Place<'a>)> + use<'a> {
        let place = *self;
        let members = self.found.map(|(json, value)| json.members(value));
        members.into_iter().flatten().map(move |(name, value)| (name, place.to(Step::Member(name), Some(value))))
    }

    /// An error at this place.
    pub fn error(&self, message: impl Into<String>) -> GltfError {
        GltfError { place: self.path(), message: message.into() }
    }

    /// True if there is a value.
    pub fn exists(&self) -> bool {
        self.found.is_some()
    }

    fn value(&self) -> Option<Value> {
        self.found.map(|(_, value)| value)
    }

    /// A finite number.
    pub fn number(&self) -> Option<f32> {
        self.double().map(|v| v as f32)
    }

    /// As [`Self::number`] in f64 precision, within the range of f32.
    pub fn double(&self) -> Option<f64> {
        self.value()?.number().filter(|v| (*v as f32).is_finite())
    }

    /// A non-negative integer, which may be written with a zero fraction.
    pub fn index(&self) -> Option<usize> {
        // Floats represent integers exactly up to 2⁵³
        let whole = |v: f64| (v >= 0.0 && v.fract() == 0.0 && v < 9e15).then_some(v as u64);
        let value = self.value()?;
        usize::try_from(value.whole().or_else(|| value.number().and_then(whole))?).ok()
    }

    /// Text.
    pub fn text(&self) -> Option<&'a str> {
        self.found.and_then(|(json, value)| json.text(value))
    }

    /// A Boolean.
    pub fn flag(&self) -> Option<bool> {
        self.value()?.flag()
    }

    /// True if it exists and is true.
    pub fn is_true(&self) -> bool {
        self.flag().unwrap_or(false)
    }

    /// True for an array.
    pub fn is_array(&self) -> bool {
        self.value().is_some_and(Value::is_array)
    }

    /// True for an object.
    pub fn is_object(&self) -> bool {
        self.value().is_some_and(Value::is_object)
    }

    /// An array of `N` numbers.
    pub fn numbers<const N: usize>(&self) -> Option<[f32; N]> {
        self.doubles().map(|numbers| numbers.map(|v| v as f32))
    }

    /// As [`Self::numbers`] in f64 precision, within the range of f32.
    pub fn doubles<const N: usize>(&self) -> Option<[f64; N]> {
        if self.len() != N {
            return None;
        }
        let mut numbers = [0.0; N];
        for (number, item) in numbers.iter_mut().zip(self.items()) {
            *number = item.double()?;
        }
        Some(numbers)
    }
}

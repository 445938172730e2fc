//! A place in the JSON: its value, if it has one, and its path for messages.

use serde_json::Value;

/// What is wrong, and where.
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

/// A place in the JSON; by default, none where anything is.
#[derive(Clone, Debug, Default)]
pub struct Place<'a> {
    value: Option<&'a Value>,
    /// Such as `meshes[0].primitives[1]`.
    pub path: String,
}

impl<'a> Place<'a> {
    /// The whole.
    pub fn root(value: &'a Value) -> Self {
        Place { value: Some(value), path: String::new() }
    }

    /// A member of an object.
    #[must_use]
    pub fn key(&self, key: &str) -> Place<'a> {
        let path = if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) };
        Place { value: self.value.and_then(|v| v.get(key)), path }
    }

    /// An extension.
    #[must_use]
    pub fn extension(&self, name: &str) -> Place<'a> {
        self.key("extensions").key(name)
    }

    /// An element of an array.
    #[must_use]
    pub fn item(&self, index: usize) -> Place<'a> {
        Place { value: self.value.and_then(|v| v.get(index)), path: format!("{}[{index}]", self.path) }
    }

    /// All elements of an array.
    pub fn items(&self) -> Vec<Place<'a>> {
        let count = self.value.and_then(Value::as_array).map_or(0, Vec::len);
        (0..count).map(|i| self.item(i)).collect()
    }

    /// Names of the members of an object.
    pub fn names(&self) -> Vec<&'a str> {
        self.value.and_then(Value::as_object).map_or_else(Vec::new, |o| o.keys().map(String::as_str).collect())
    }

    /// An error at this place.
    pub fn error(&self, message: impl Into<String>) -> GltfError {
        GltfError { place: self.path.clone(), message: message.into() }
    }

    /// True if there is something.
    pub fn exists(&self) -> bool {
        self.value.is_some()
    }

    /// A finite number.
    pub fn number(&self) -> Option<f32> {
        self.double().map(|v| v as f32)
    }

    /// As [`Self::number`] with the precision of f64, in the range of f32.
    pub fn double(&self) -> Option<f64> {
        self.value.and_then(Value::as_f64).filter(|v| (*v as f32).is_finite())
    }

    /// An integer that is not negative, which may be written with a fraction of 0.
    pub fn index(&self) -> Option<usize> {
        // Integers of floats are exact up to 2⁵³
        let whole = |v: f64| (v >= 0.0 && v.fract() == 0.0 && v < 9e15).then_some(v as u64);
        let value = self.value.and_then(|v| v.as_u64().or_else(|| v.as_f64().and_then(whole)));
        value.and_then(|v| usize::try_from(v).ok())
    }

    /// Text.
    pub fn text(&self) -> Option<&'a str> {
        self.value.and_then(Value::as_str)
    }

    /// True or false.
    pub fn flag(&self) -> Option<bool> {
        self.value.and_then(Value::as_bool)
    }

    /// True if it is there and true.
    pub fn is_true(&self) -> bool {
        self.flag().unwrap_or(false)
    }

    /// True for an array.
    pub fn is_array(&self) -> bool {
        self.value.is_some_and(Value::is_array)
    }

    /// True for an object.
    pub fn is_object(&self) -> bool {
        self.value.is_some_and(Value::is_object)
    }

    /// An array of numbers, as many as asked for.
    pub fn numbers<const N: usize>(&self) -> Option<[f32; N]> {
        self.doubles().map(|numbers| numbers.map(|v| v as f32))
    }

    /// As [`Self::numbers`] with the precision of f64, in the range of f32.
    pub fn doubles<const N: usize>(&self) -> Option<[f64; N]> {
        let items = self.items();
        if items.len() != N {
            return None;
        }
        let mut numbers = [0.0; N];
        for (number, item) in numbers.iter_mut().zip(&items) {
            *number = item.double()?;
        }
        Some(numbers)
    }
}

//! Accessors: arrays of numbers in buffers, dense or sparse.

use super::{Document, GltfError, Place};
use std::collections::HashMap;

/// Maximum number of elements of an accessor without a buffer view, whose elements are zero.
const MAX_ZEROS: usize = 1 << 24;

/// Type of a component.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(code: usize) -> Option<Self> {
        Some(match code {
            5120 => Component::I8,
            5121 => Component::U8,
            5122 => Component::I16,
            5123 => Component::U16,
            5125 => Component::U32,
            5126 => Component::F32,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Component::I8 | Component::U8 => 1,
            Component::I16 | Component::U16 => 2,
            Component::U32 | Component::F32 => 4,
        }
    }

    fn read(self, b: &[u8]) -> f64 {
        match self {
            Component::I8 => f64::from(b[0] as i8),
            Component::U8 => f64::from(b[0]),
            Component::I16 => f64::from(i16::from_le_bytes([b[0], b[1]])),
            Component::U16 => f64::from(u16::from_le_bytes([b[0], b[1]])),
            Component::U32 => f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            Component::F32 => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        }
    }

    /// The divisor that normalises integers.
    fn divisor(self) -> f64 {
        match self {
            Component::I8 => 127.0,
            Component::U8 => 255.0,
            Component::I16 => 32767.0,
            Component::U16 => 65535.0,
            Component::U32 => f64::from(u32::MAX),
            Component::F32 => 1.0,
        }
    }
}

/// Numbers of an accessor, component by component.
#[derive(Clone, Debug, Default)]
pub struct Numbers {
    /// Components of an element.
    pub width: usize,
    /// All components.
    pub values: Vec<f64>,
}

impl Numbers {
    /// Number of elements.
    pub fn count(&self) -> usize {
        self.values.len() / self.width.max(1)
    }

    /// All components of all elements.
    pub fn values(&self) -> Vec<f32> {
        self.values.iter().map(|&v| v as f32).collect()
    }

    /// Elements of `N` components; missing components are `fill`.
    pub fn elements<const N: usize>(&self, fill: f32) -> Vec<[f32; N]> {
        let element = |e: &[f64]| std::array::from_fn(|i| e.get(i).map_or(fill, |&v| v as f32));
        self.values.chunks_exact(self.width.max(1)).map(element).collect()
    }
}

fn width_of(kind: &str) -> Option<usize> {
    Some(match kind {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" | "MAT2" => 4,
        "MAT3" => 9,
        "MAT4" => 16,
        _ => return None,
    })
}

/// Elements in a buffer view.
#[derive(Clone, Copy, Debug)]
struct Elements<'a> {
    /// Bytes from the first element on.
    bytes: &'a [u8],
    stride: usize,
    component: Component,
    width: usize,
    normalized: bool,
}

impl Elements<'_> {
    fn read(&self, index: usize) -> impl Iterator<Item = f64> {
        let Elements { bytes, stride, component, width, normalized } = *self;
        (0..width).map(move |c| {
            let value = component.read(&bytes[index * stride + c * component.bytes()..]);
            if normalized { (value / component.divisor()).max(-1.0) } else { value }
        })
    }
}

/// An accessor whose elements are verified to be in their buffer views. Elements are read on demand, since primitives
/// may share an accessor with more vertices.
#[derive(Debug)]
pub struct Accessor<'a> {
    count: usize,
    width: usize,
    /// Dense elements; `None` for zeros.
    elements: Option<Elements<'a>>,
    sparse: Option<Sparse<'a>>,
}

/// Elements that replace others.
#[derive(Debug)]
struct Sparse<'a> {
    /// Position in `values` by element index.
    positions: HashMap<usize, usize>,
    values: Elements<'a>,
}

impl Accessor<'_> {
    /// Number of elements.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Components of an element.
    pub fn width(&self) -> usize {
        self.width
    }

    /// The numbers of the elements with these indices, which must be below [`Self::count`].
    pub fn numbers(&self, indices: impl ExactSizeIterator<Item = usize>) -> Numbers {
        let mut values = Vec::with_capacity(indices.len() * self.width);
        for index in indices {
            let replaced = self.sparse.as_ref().and_then(|s| Some(s.values.read(*s.positions.get(&index)?)));
            match (replaced, &self.elements) {
                (Some(element), _) => values.extend(element),
                (None, Some(elements)) => values.extend(elements.read(index)),
                (None, None) => values.extend(std::iter::repeat_n(0.0, self.width)),
            }
        }
        Numbers { width: self.width, values }
    }
}

/// Numbers of an accessor, or of a part of it.
#[derive(Clone, Copy)]
struct Layout {
    component: Component,
    width: usize,
    count: usize,
    normalized: bool,
}

impl Document {
    /// The numbers of an accessor; normalised integers are −1..1.
    pub fn accessor(&self, index: usize) -> Result<Numbers, GltfError> {
        let accessor = self.open(index)?;
        Ok(accessor.numbers(0..accessor.count))
    }

    /// An accessor before reading; normalised integers are −1..1.
    pub fn open(&self, index: usize) -> Result<Accessor<'_>, GltfError> {
        let place = self.root().key("accessors").item(index);
        let component = place.key("componentType").index().and_then(Component::of);
        let width = place.key("type").text().and_then(width_of);
        let (Some(component), Some(width), Some(count)) = (component, width, place.key("count").index()) else {
            return Err(place.error("has no valid type or count"));
        };
        let layout = Layout { component, width, count, normalized: place.key("normalized").is_true() };
        let elements = match place.key("bufferView").index() {
            Some(_) => Some(self.elements(&place, &layout)?),
            None if count > MAX_ZEROS => return Err(place.error(format!("{count} elements have no bytes"))),
            None => None,
        };
        let sparse = Some(place.key("sparse")).filter(Place::exists);
        let sparse = sparse.map(|sparse| self.sparse(&sparse, &layout)).transpose()?;
        Ok(Accessor { count, width, elements, sparse })
    }

    fn elements(&self, place: &Place<'_>, layout: &Layout) -> Result<Elements<'_>, GltfError> {
        let Some(view) = place.key("bufferView").index() else { return Err(place.error("has no buffer view")) };
        let bytes = self.view(view)?;
        let Layout { component, width, count, normalized } = *layout;
        let size = component.bytes() * width;
        let stride = self.root().key("bufferViews").item(view).key("byteStride").index().unwrap_or(size).max(1);
        let offset = place.key("byteOffset").index().unwrap_or(0);
        let length = count.checked_sub(1).map_or(Some(0), |n| n.checked_mul(stride)?.checked_add(size));
        let end = length.and_then(|length| offset.checked_add(length)).filter(|&end| end <= bytes.len());
        let Some(end) = end.filter(|_| stride >= component.bytes()) else {
            let have = bytes.len();
            let message = format!("{count} elements from byte {offset} on are not in the buffer view of {have} bytes");
            return Err(place.error(message));
        };
        Ok(Elements { bytes: &bytes[offset..end], stride, component, width, normalized })
    }

    fn sparse(&self, sparse: &Place<'_>, layout: &Layout) -> Result<Sparse<'_>, GltfError> {
        let count = sparse.key("count").index().unwrap_or(0);
        let place = sparse.key("indices");
        let Some(component) = place.key("componentType").index().and_then(Component::of) else {
            return Err(place.error("has no valid type"));
        };
        let indices = self.elements(&place, &Layout { component, width: 1, count, normalized: false })?;
        let values = self.elements(&sparse.key("values"), &Layout { count, ..*layout })?;
        let mut positions = HashMap::with_capacity(count);
        for nth in 0..count {
            let index = indices.read(nth).next().unwrap_or_default();
            if index >= layout.count as f64 {
                return Err(place.error(format!("element {index} is not there")));
            }
            positions.insert(index as usize, nth);
        }
        Ok(Sparse { positions, values })
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Document, GltfError};
    use base64::Engine;
    use std::path::Path;

    /// A document with one accessor, whose buffer has views of 12 bytes and of 4.
    fn document(json: &str, bytes: [u8; 16]) -> Result<Document, GltfError> {
        let data = base64::engine::general_purpose::STANDARD.encode(bytes);
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"accessors":[{json}],
            "bufferViews":[{{"buffer":0,"byteLength":12}},{{"buffer":0,"byteOffset":12,"byteLength":4}}],
            "buffers":[{{"byteLength":16,"uri":"data:application/octet-stream;base64,{data}"}}]}}"#
        );
        Document::parse(text.as_bytes(), Path::new(""), &[]).map_err(|errors| errors[0].clone())
    }

    fn accessor(json: &str, bytes: [u8; 16]) -> Result<Vec<f64>, GltfError> {
        document(json, bytes)?.accessor(0).map(|numbers| numbers.values)
    }

    const BYTES: [u8; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 255, 2, 0, 128, 9];

    #[test]
    fn integers_are_read_normalised_or_not() {
        let of = |rest: &str| {
            let json =
                format!(r#"{{"bufferView":0,"componentType":5120,"count":2,"type":"VEC2","byteOffset":8{rest}}}"#);
            accessor(&json, BYTES).unwrap()
        };
        assert_eq!(of(""), [8.0, 9.0, 10.0, -1.0]);
        assert_eq!(of(r#","normalized":true"#), [8.0 / 127.0, 9.0 / 127.0, 10.0 / 127.0, -1.0 / 127.0]);
    }

    #[test]
    fn sparse_elements_replace_those_of_the_view_or_zeros() {
        let sparse = r#""sparse":{"count":1,"indices":{"bufferView":1,"componentType":5121},
            "values":{"bufferView":0,"byteOffset":4}}"#;
        let of = |view: &str| format!(r#"{{{view}"componentType":5121,"count":3,"type":"VEC2",{sparse}}}"#);
        assert_eq!(accessor(&of(""), BYTES).unwrap(), [0.0, 0.0, 0.0, 0.0, 4.0, 5.0]);
        assert_eq!(accessor(&of(r#""bufferView":0,"#), BYTES).unwrap(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        let mut outside = BYTES;
        outside[12] = 3;
        let error = accessor(&of(""), outside).unwrap_err();
        assert_eq!(error.to_string(), "accessors[0].sparse.indices: element 3 is not there");
    }

    #[test]
    fn elements_are_read_alone_as_among_all() {
        let sparse = r#""sparse":{"count":2,"indices":{"bufferView":1,"componentType":5121},
            "values":{"bufferView":0,"byteOffset":4}}"#;
        let json = format!(r#"{{"bufferView":0,"componentType":5121,"count":4,"type":"VEC2",{sparse}}}"#);
        let document = document(&json, BYTES).unwrap();
        let (accessor, all) = (document.open(0).unwrap(), document.accessor(0).unwrap());
        assert_eq!(all.values, [6.0, 7.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        for (index, element) in all.values.chunks(2).enumerate() {
            assert_eq!(accessor.numbers([index].into_iter()).values, element);
        }
    }

    #[test]
    fn what_lies_outside_of_its_view_is_refused_before_it_is_allocated() {
        for (count, view) in [(u64::MAX, r#""bufferView":0,"#), (7, r#""bufferView":0,"#), (1 << 60, "")] {
            let json = format!(r#"{{{view}"componentType":5121,"count":{count},"type":"VEC2"}}"#);
            assert_eq!(accessor(&json, BYTES).unwrap_err().place, "accessors[0]", "{count}");
        }
    }
}

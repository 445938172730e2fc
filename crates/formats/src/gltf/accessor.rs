//! Accessors: arrays of numbers in buffers, dense or sparse.

use super::{Document, GltfError, Place};

/// Greatest number of elements of an accessor without bytes of its own, which are zeros.
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

    /// The value, and the divisor that makes an integer at most 1.
    fn read(self, b: &[u8]) -> (f64, f64) {
        match self {
            Component::I8 => (f64::from(b[0] as i8), 127.0),
            Component::U8 => (f64::from(b[0]), 255.0),
            Component::I16 => (f64::from(i16::from_le_bytes([b[0], b[1]])), 32767.0),
            Component::U16 => (f64::from(u16::from_le_bytes([b[0], b[1]])), 65535.0),
            Component::U32 => (f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])), f64::from(u32::MAX)),
            Component::F32 => (f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])), 1.0),
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

    /// Elements of `N` components; what an element lacks is `fill`.
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

/// `count` elements of some bytes.
struct Layout {
    component: Component,
    width: usize,
    count: usize,
    normalized: bool,
}

impl Document {
    /// The numbers of an accessor; normalised integers are −1..1.
    pub fn accessor(&self, index: usize) -> Result<Numbers, GltfError> {
        let place = self.root().key("accessors").item(index);
        let component = place.key("componentType").index().and_then(Component::of);
        let width = place.key("type").text().and_then(width_of);
        let (Some(component), Some(width), Some(count)) = (component, width, place.key("count").index()) else {
            return Err(place.error("has no valid type or count"));
        };
        let layout = Layout { component, width, count, normalized: place.key("normalized").is_true() };
        let mut values = match place.key("bufferView").index() {
            Some(_) => self.read(&place, &layout)?,
            None if count > MAX_ZEROS => return Err(place.error(format!("{count} elements have no bytes"))),
            None => vec![0.0; count * width],
        };
        let sparse = place.key("sparse");
        if sparse.exists() {
            self.replace(&sparse, &layout, &mut values)?;
        }
        Ok(Numbers { width, values })
    }

    fn read(&self, place: &Place<'_>, layout: &Layout) -> Result<Vec<f64>, GltfError> {
        let Some(view) = place.key("bufferView").index() else { return Err(place.error("has no buffer view")) };
        let bytes = self.view(view)?;
        let size = layout.component.bytes() * layout.width;
        let stride = self.root().key("bufferViews").item(view).key("byteStride").index().unwrap_or(size).max(1);
        let offset = place.key("byteOffset").index().unwrap_or(0);
        let length = layout.count.checked_sub(1).map_or(Some(0), |n| n.checked_mul(stride)?.checked_add(size));
        let end = length.and_then(|length| offset.checked_add(length)).filter(|&end| end <= bytes.len());
        if end.is_none() || stride < layout.component.bytes() {
            let (count, have) = (layout.count, bytes.len());
            let message = format!("{count} elements from byte {offset} on are not in the buffer view of {have} bytes");
            return Err(place.error(message));
        }
        let mut values = Vec::with_capacity(layout.count * layout.width);
        for i in 0..layout.count {
            for c in 0..layout.width {
                let at = offset + i * stride + c * layout.component.bytes();
                let (value, divisor) = layout.component.read(&bytes[at..]);
                values.push(if layout.normalized { (value / divisor).max(-1.0) } else { value });
            }
        }
        Ok(values)
    }

    fn replace(&self, sparse: &Place<'_>, layout: &Layout, values: &mut [f64]) -> Result<(), GltfError> {
        let count = sparse.key("count").index().unwrap_or(0);
        let place = sparse.key("indices");
        let Some(component) = place.key("componentType").index().and_then(Component::of) else {
            return Err(place.error("has no valid type"));
        };
        let indices = self.read(&place, &Layout { component, width: 1, count, normalized: false })?;
        let new = self.read(&sparse.key("values"), &Layout { count, ..*layout })?;
        for (index, element) in indices.iter().zip(new.chunks_exact(layout.width)) {
            let at = *index as usize * layout.width;
            match values.get_mut(at..at + layout.width) {
                Some(old) => old.copy_from_slice(element),
                None => return Err(place.error(format!("element {index} is not there"))),
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Document, GltfError};
    use base64::Engine;
    use std::path::Path;

    /// A document of one accessor, whose buffer has views of 12 bytes and of 4.
    fn accessor(json: &str, bytes: [u8; 16]) -> Result<Vec<f64>, GltfError> {
        let data = base64::engine::general_purpose::STANDARD.encode(bytes);
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"accessors":[{json}],
            "bufferViews":[{{"buffer":0,"byteLength":12}},{{"buffer":0,"byteOffset":12,"byteLength":4}}],
            "buffers":[{{"byteLength":16,"uri":"data:application/octet-stream;base64,{data}"}}]}}"#
        );
        let document = Document::parse(text.as_bytes(), Path::new(""), &[]).map_err(|errors| errors[0].clone())?;
        document.accessor(0).map(|numbers| numbers.values)
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
    fn what_lies_outside_of_its_view_is_refused_before_it_is_allocated() {
        for (count, view) in [(u64::MAX, r#""bufferView":0,"#), (7, r#""bufferView":0,"#), (1 << 60, "")] {
            let json = format!(r#"{{{view}"componentType":5121,"count":{count},"type":"VEC2"}}"#);
            assert_eq!(accessor(&json, BYTES).unwrap_err().place, "accessors[0]", "{count}");
        }
    }
}

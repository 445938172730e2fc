//! Radiance pictures (`.hdr`): orientation and exposure, which OpenImageIO does not apply.
//!
//! The header gives one of eight pixel orders. The first axis is the direction from line to line, the second the
//! direction within a line; `-Y` goes down and `+X` to the right, so `-Y height +X width` means rows from the top.
//! `EXPOSURE` and `COLORCORR` are factors that were applied to the radiance, once per occurrence [Ward 1991, "File
//! formats" of the Radiance manual].

use std::fs::File;
use std::io::Read;
use std::ops::Range;
use std::path::Path;

/// Maximum bytes of a header.
const MAX_HEADER: u64 = 1 << 16;

/// Pixel order and factors of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Storage {
    /// True if lines are columns.
    pub is_by_columns: bool,
    /// True if x runs from right to left.
    from_right: bool,
    /// True if y runs from bottom to top.
    from_bottom: bool,
    /// Factors that were applied to red, green and blue.
    factors: [f32; 3],
}

impl Storage {
    /// The storage of a picture that has to be converted; `None` for all other files.
    pub(super) fn of(path: &Path) -> Option<Self> {
        let mut head = Vec::new();
        let mut file = File::open(path).ok()?;
        file.by_ref().take(2).read_to_end(&mut head).ok()?;
        if head != b"#?" {
            return None;
        }
        file.take(MAX_HEADER).read_to_end(&mut head).ok()?;
        Storage::parse(&head).filter(|storage| *storage != Storage::default())
    }

    fn parse(head: &[u8]) -> Option<Self> {
        let mut lines = head.split(|&byte| byte == b'\n').map(|line| String::from_utf8_lossy(line));
        let mut factors = [1.0; 3];
        for line in lines.by_ref().take_while(|line| !line.is_empty()) {
            let Some((name, value)) = line.split_once('=') else { continue };
            let numbers: Vec<f32> = value.split_whitespace().map_while(|number| number.parse().ok()).collect();
            let applied = match (name, &numbers[..]) {
                ("EXPOSURE", [exposure]) => [*exposure; 3],
                ("COLORCORR", [r, g, b]) => [*r, *g, *b],
                _ => continue,
            };
            // Some programs write 0 for unknown factors
            if applied.iter().all(|factor| *factor > 0.0 && factor.is_finite()) {
                factors = std::array::from_fn(|c| factors[c] * applied[c]);
            }
        }
        let resolution = lines.next()?;
        let words: Vec<&str> = resolution.split_whitespace().collect();
        let [first, _, second, _] = words[..] else { return None };
        let is_by_columns = first.ends_with('X');
        let (x, y) = if is_by_columns { (first, second) } else { (second, first) };
        Some(Storage { is_by_columns, from_right: x == "-X", from_bottom: y == "+Y", factors })
    }

    /// Radiance, row by row from the top, of a range of channels. `stored` are RGB pixels in `count` lines of `length`
    /// pixels.
    pub(super) fn arranged(&self, stored: &[f32], [length, count]: [usize; 2], channels: Range<usize>) -> Vec<f32> {
        let [width, height] = if self.is_by_columns { [count, length] } else { [length, count] };
        let pixel = |i: usize| {
            let (x, y) = (i % width, i / width);
            let x = if self.from_right { width - 1 - x } else { x };
            let y = if self.from_bottom { height - 1 - y } else { y };
            let at = if self.is_by_columns { x * length + y } else { y * length + x };
            channels.clone().map(move |c| stored[3 * at + c] / self.factors[c])
        };
        (0..width * height).flat_map(pixel).collect()
    }
}

impl Default for Storage {
    /// Rows from the top, without factors.
    fn default() -> Self {
        Storage { is_by_columns: false, from_right: false, from_bottom: false, factors: [1.0; 3] }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{ReadLimits, read_headers, read_image};

    /// A picture of 3 × 2 pixels whose red is 1 + x and whose green is 1 + y, in the given pixel order.
    fn picture(header: &str, [first, second]: [&str; 2]) -> Vec<u8> {
        let size = |axis: &str| if axis.ends_with('X') { 3 } else { 2 };
        let mut file = format!("#?RADIANCE\n{header}FORMAT=32-bit_rle_rgbe\n\n");
        file += &format!("{first} {} {second} {}\n", size(first), size(second));
        let mut file = file.into_bytes();
        for i in 0..size(first) {
            for j in 0..size(second) {
                let (x, y) = if first.ends_with('X') { ((first, i), (second, j)) } else { ((second, j), (first, i)) };
                let x = if x.0 == "+X" { x.1 } else { 2 - x.1 };
                let y = if y.0 == "-Y" { y.1 } else { 1 - y.1 };
                // With the exponent 136, values equal the bytes
                file.extend([1 + x as u8, 1 + y as u8, 7, 136]);
            }
        }
        file
    }

    #[test]
    fn all_eight_orders_of_pixels_are_the_same_picture() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.hdr");
        let expected: Vec<f32> = (0..6).flat_map(|i| [1.0 + (i % 3) as f32, 1.0 + (i / 3) as f32, 7.0]).collect();
        for y in ["-Y", "+Y"] {
            for x in ["+X", "-X"] {
                for axes in [[y, x], [x, y]] {
                    std::fs::write(&path, picture("", axes)).unwrap();
                    let read = read_image(&path, &ReadLimits::default()).unwrap();
                    assert_eq!((read.image.width, read.image.height), (3, 2), "{axes:?}");
                    assert_eq!(read.window.full_size, [3, 2], "{axes:?}");
                    assert_eq!(read.image.data, expected, "{axes:?}");
                    assert_eq!(read_headers(&path).unwrap()[0].size, [3, 2], "{axes:?}");
                }
            }
        }
    }

    #[test]
    fn factors_that_were_applied_to_radiance_are_undone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.hdr");
        let first_pixel = |header: &str| {
            std::fs::write(&path, picture(header, ["-Y", "+X"])).unwrap();
            let data = read_image(&path, &ReadLimits::default()).unwrap().image.data;
            [data[0], data[1], data[2]]
        };
        assert_eq!(first_pixel("EXPOSURE=2\npfilt -x 64\nEXPOSURE= 0.25\n"), [2.0, 2.0, 14.0]);
        assert_eq!(first_pixel("COLORCORR= 0.5 1 2\nEXPOSURE=1.0\n"), [2.0, 1.0, 3.5]);
        assert_eq!(first_pixel("EXPOSURE=0\nEXPOSURE=none\nCOLORCORR=1 2\n"), [1.0, 1.0, 7.0]);
    }
}

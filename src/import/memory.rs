//! The memory that a scene takes, predicted from sizes in headers before its files are read. Bytes per item were
//! measured ([docs/measurements/scale](../../../docs/measurements/scale/README.md)).

use crate::imaging::oiio::{image_texels, library_bytes};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Bytes of a primitive in Embree, and in addition while its acceleration structure is built.
const EMBREE: u64 = 57;
const BUILD: u64 = 62;
/// Bytes of an emitting primitive: its light, its part of the light tree, and its copy in the ray tracer of emitters.
const LIGHT: u64 = 430;
/// Bytes of an instance.
const INSTANCE: u64 = 400;
/// Bytes of a pixel of the image, and of a thread that renders it.
const PIXEL: u64 = 64;
const THREAD: u64 = 8 << 20;
/// Number of parts that a refusal lists.
const LISTED: usize = 10;

/// A limit of the memory of the process.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MemoryLimit {
    /// Bytes.
    pub bytes: u64,
    /// Its source, as the end of "more than the … that": "--memory-limit allows".
    pub origin: String,
}

/// The memory that a process takes and that parts of a scene will take.
#[derive(Clone, Debug, Default)]
pub struct MemoryAccount {
    parts: Vec<Part>,
    /// Bytes that were taken at the beginning, and bytes of libraries that were not loaded yet.
    taken: [u64; 2],
    /// Bytes that the image will take, up to settings that are not known yet.
    image: u64,
}

#[derive(Clone, Debug)]
struct Part {
    name: String,
    bytes: u64,
}

/// A shape that will be built.
pub struct ShapeSize {
    /// Name of its part of the account; shapes without a name are one part together.
    pub name: Option<String>,
    /// Bytes of its arrays that are not in memory yet.
    pub bytes: u64,
    /// Number of triangles, patches or curves.
    pub primitives: u64,
    /// True if they emit.
    pub emits: bool,
    /// The group of its acceleration structure.
    pub group: Option<usize>,
}

impl MemoryAccount {
    /// An account without parts, and with the memory that is taken now.
    pub fn now() -> Self {
        MemoryAccount { taken: [resident(), library_bytes()], ..MemoryAccount::default() }
    }

    /// Adds a part.
    pub fn add(&mut self, name: impl Into<String>, bytes: u64) {
        if bytes > 0 {
            self.parts.push(Part { name: name.into(), bytes });
        }
    }

    /// Adds shapes and instances, with their acceleration structures and lights.
    pub fn add_geometry(&mut self, shapes: impl Iterator<Item = ShapeSize>, groups: usize, instances: usize) {
        let mut per_group = vec![0_u64; groups + 1];
        let (mut unnamed, mut emitting) = (0_u64, 0_u64);
        for ShapeSize { name, bytes, primitives, emits, group } in shapes {
            let in_group = &mut per_group[group.map_or(groups, |group| group.min(groups))];
            *in_group = in_group.saturating_add(primitives);
            emitting = emitting.saturating_add(if emits { primitives } else { 0 });
            let bytes = bytes.saturating_add(primitives.saturating_mul(EMBREE));
            match name {
                Some(name) => self.add(name, bytes),
                None => unnamed = unnamed.saturating_add(bytes),
            }
        }
        let largest = per_group.into_iter().max().unwrap_or(0);
        self.add("shapes in scene files", unnamed);
        self.add("building the largest acceleration structure", largest.saturating_mul(BUILD));
        self.add(format!("{emitting} emitting primitives and the light tree"), emitting.saturating_mul(LIGHT));
        self.add(format!("{instances} instances"), instances as u64 * INSTANCE);
    }

    /// Leaves room for an image.
    pub fn reserve_image(&mut self, pixels: usize) {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        self.image = pixels as u64 * PIXEL + threads as u64 * THREAD;
    }

    /// Total without the image.
    pub fn bytes(&self) -> u64 {
        self.parts.iter().fold(self.taken.iter().sum(), |sum, part| sum.saturating_add(part.bytes))
    }

    /// Bytes that are left of a limit, beside the image.
    pub fn left(&self, limit: &MemoryLimit) -> u64 {
        limit.bytes.saturating_sub(self.image).saturating_sub(self.bytes())
    }

    /// An error message with the largest parts if the scene exceeds the limit.
    pub fn refusal(&self, limit: &MemoryLimit) -> Option<String> {
        let needed = self.bytes();
        if needed <= limit.bytes {
            return None;
        }

        // The largest parts
        let mut parts = self.parts.clone();
        let taken = ["in memory already", "image libraries"].into_iter().zip(self.taken);
        parts.extend(taken.map(|(name, bytes)| Part { name: name.to_owned(), bytes }));
        parts.sort_by_key(|part| std::cmp::Reverse(part.bytes));

        // The message
        let mut text = format!(
            "the scene would need about {} ({needed} bytes), more than the {} that {}. Its largest parts:",
            size(needed),
            size(limit.bytes),
            limit.origin
        );
        for Part { name, bytes } in parts.iter().filter(|part| part.bytes > 0).take(LISTED) {
            let _ = write!(text, "\n  {:>10}  {name}", size(*bytes));
        }
        Some(text)
    }
}

/// Bytes of an image that lights the scene: its radiance, read and as stored, and its distribution. An unreadable image
/// counts as 0; reading it reports the error.
pub fn light_image_bytes(path: &Path) -> u64 {
    const TEXEL: u64 = 28;
    image_texels(path).map_or(0, |texels| texels.saturating_mul(TEXEL))
}

/// Formats bytes as MiB or GiB.
pub fn size(bytes: u64) -> String {
    let (unit, shift) = if bytes < 1 << 30 { ("MiB", 20) } else { ("GiB", 30) };
    format!("{:.1} {unit}", bytes as f64 / f64::from(1 << shift))
}

/// Resident memory of this process (bytes); 0 if unknown.
pub fn resident() -> u64 {
    of_process("VmRSS:")
}

/// Peak resident memory of this process (bytes); 0 if unknown.
pub fn peak_resident() -> u64 {
    of_process("VmHWM:")
}

fn of_process(name: &str) -> u64 {
    fs::read_to_string("/proc/self/status").ok().and_then(|text| kibibytes(&text, name)).unwrap_or(0)
}

/// The value (bytes) of a line such as `MemAvailable:  123 kB` of a file in `/proc`.
pub fn kibibytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    Some(line.split_whitespace().next()?.parse::<u64>().ok()? * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_lists_the_largest_parts_first() {
        let mut account = MemoryAccount::default();
        (1..=20).for_each(|i| account.add(format!("file {i}"), i << 40));
        let shape = ShapeSize { name: None, bytes: 0, primitives: 1 << 40, emits: true, group: None };
        account.add_geometry([shape].into_iter(), 0, 3);
        let limit = |bytes| MemoryLimit { bytes, origin: "--memory-limit allows".to_owned() };
        let text = account.refusal(&limit(1 << 40)).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 1 + LISTED, "{text}");
        assert!(lines[0].contains("more than the 1024.0 GiB that --memory-limit allows"), "{text}");
        let expected = ["emitting", "building the largest", "shapes in scene files", "20480.0 GiB  file 20", "file 19"];
        assert!(lines[1..].iter().zip(expected).all(|(line, part)| line.contains(part)), "{text}");
        assert_eq!(account.refusal(&limit(u64::MAX)), None);
        assert_eq!(account.left(&limit(1 << 40)), 0);
    }
}

//! The memory that a scene takes, predicted from sizes in headers before its files are read. Bytes per item were
//! measured ([docs/measurements/scale](../../../docs/measurements/scale/README.md)).

use crate::imaging::oiio::library_bytes;
use std::fmt::Write as _;
use std::fs;

/// Bytes of a primitive in Embree, and in addition while its acceleration structure is built.
const EMBREE: u64 = 57;
const BUILD: u64 = 62;
/// Bytes of an emitting primitive: its light, its part of the light tree, and its copy in the ray tracer of emitters.
const LIGHT: u64 = 430;
/// Bytes of an instance.
const INSTANCE: u64 = 400;
/// Bytes of a place of a cluster beside its description, which takes more than Embree later.
const PLACE: u64 = 112;
/// Bytes of an instance of curves in a cluster while the hierarchy of curves is built.
const CURVES: u64 = 230;
/// Bytes per pixel with one sample: radiance, squared radiance, counts.
pub const IMAGE: f64 = 38.0;
/// Bytes per pixel of albedo, normal, depth and indices.
pub const FEATURES: f64 = 17.0;
/// Bytes per pixel of replicas: exact sums and counts, averaged over all pixels.
pub const REPLICAS: f64 = 4.0;
/// Bytes per pixel of a tile besides its sums.
pub const TILE: f64 = 2.0;
/// Bytes of a thread with its batches.
pub const THREAD: u64 = 8 << 20;
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

/// Bytes of the content of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FileSize {
    /// In memory.
    pub kept: u64,
    /// In addition while the file is read.
    pub loading: u64,
}

/// The memory that a process takes and that parts of a scene will take.
#[derive(Clone, Debug, Default)]
pub struct MemoryAccount {
    parts: Vec<Part>,
    /// Bytes of each file in addition while it is read.
    loading: Vec<u64>,
    /// Bytes of building the largest acceleration structure.
    build: u64,
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

    /// Adds the content of a file.
    pub fn add_file(&mut self, name: impl Into<String>, FileSize { kept, loading }: FileSize) {
        self.add(name, kept);
        self.loading.push(loading);
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
        self.build = largest.saturating_mul(BUILD);
        self.add(format!("{emitting} emitting primitives and the light tree"), emitting.saturating_mul(LIGHT));
        self.add(format!("{instances} instances"), instances as u64 * INSTANCE);
    }

    /// Adds places and members of clusters, and the instances with curves that they stand for.
    pub fn add_clusters(&mut self, places: u64, members: u64, with_curves: u64) {
        self.add(format!("{places} places of clusters"), places.saturating_mul(PLACE));
        self.add(format!("{members} members of clusters"), members.saturating_mul(INSTANCE));
        self.add(format!("{with_curves} instances of curves in clusters"), with_curves.saturating_mul(CURVES));
    }

    /// Leaves room for an image.
    pub fn reserve_image(&mut self, pixels: usize) {
        let bytes = pixels as f64 * (IMAGE + FEATURES + REPLICAS + TILE);
        self.image = bytes as u64 + rayon::current_num_threads() as u64 * THREAD;
    }

    /// The largest need that ends before the image is rendered: files being read, one per thread, or Embree's build.
    fn temporary(&self) -> Part {
        let mut loading = self.loading.clone();
        loading.sort_unstable_by_key(|&bytes| std::cmp::Reverse(bytes));
        let at_once = loading.iter().take(rayon::current_num_threads()).fold(0, |sum: u64, &n| sum.saturating_add(n));
        if at_once > self.build {
            Part { name: "files while they are read".to_owned(), bytes: at_once }
        } else {
            Part { name: "building the largest acceleration structure".to_owned(), bytes: self.build }
        }
    }

    /// Bytes that remain in memory, without the image.
    fn kept(&self) -> u64 {
        self.parts.iter().fold(self.taken.iter().sum(), |sum, part| sum.saturating_add(part.bytes))
    }

    /// Maximum bytes while the scene is loaded.
    pub fn bytes(&self) -> u64 {
        self.kept().saturating_add(self.temporary().bytes)
    }

    /// Bytes that are left of a limit, beside the image.
    pub fn left(&self, limit: &MemoryLimit) -> u64 {
        limit.bytes.saturating_sub(self.kept()).saturating_sub(self.image.max(self.temporary().bytes))
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
        parts.push(self.temporary());
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

    #[test]
    fn files_that_are_read_at_once_count_in_the_limit() {
        let mut account = MemoryAccount::default();
        (0..1000).for_each(|_| account.add_file("image", FileSize { kept: 1 << 20, loading: 1 << 30 }));
        let threads = rayon::current_num_threads() as u64;
        assert_eq!(account.bytes(), (1000 << 20) + threads * (1 << 30));
        let limit = MemoryLimit { bytes: 1 << 20, origin: String::new() };
        assert!(account.refusal(&limit).is_some_and(|text| text.contains("files while they are read")));
    }
}

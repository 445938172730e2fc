//! All parts of an image file, in a form that can be written again: additions to a file preserve the rest.

use super::file::ImageError;
use super::image::Image;
use super::oiio::{Input, MetaValue, Part, ReadLimits, Storage, read_failure, read_headers, read_part};
use std::path::Path;

/// Lossless compressions.
const LOSSLESS: [&str; 5] = ["none", "rle", "zips", "zip", "piz"];
/// Metadata about the storage of a file, which OpenImageIO writes anew.
const OF_STORAGE: [&str; 4] = ["compression", "name", "type", "textureformat"];
/// Prefixes of further metadata about storage.
const OF_STORAGE_PREFIXES: [&str; 2] = ["oiio:", "openexr:"];

/// A part of a file.
#[derive(Clone, Debug)]
pub struct FilePart {
    /// The name of the part; empty if it has none.
    pub name: String,
    /// Its pixels.
    pub image: Image,
    /// Storage type of each channel. Integers of more than 8 bits become floats.
    pub storage: Vec<Storage>,
    /// Metadata: texts, numbers and matrices.
    pub metadata: Vec<(String, MetaValue)>,
    /// Column and row of the first pixel in the full image.
    pub origin: [usize; 2],
    /// Size of the full image.
    pub full: [usize; 2],
    compression: String,
}

impl FilePart {
    /// A new part with the same window and compression.
    pub fn beside(&self, name: &str, channels: &[&str], data: Vec<f32>, storage: Storage) -> Self {
        let channels: Vec<String> = channels.iter().map(|&c| c.to_owned()).collect();
        FilePart {
            name: name.to_owned(),
            storage: vec![storage; channels.len()],
            image: Image { width: self.image.width, height: self.image.height, channels, data },
            metadata: Vec::new(),
            ..self.clone_without_pixels()
        }
    }

    fn clone_without_pixels(&self) -> Self {
        FilePart {
            name: self.name.clone(),
            image: Image::default(),
            storage: Vec::new(),
            metadata: self.metadata.clone(),
            compression: self.compression.clone(),
            ..*self
        }
    }

    /// Removes the channels for which `keep` is false.
    pub fn retain_channels(&mut self, keep: impl Fn(&str) -> bool) {
        let kept: Vec<bool> = self.image.channels.iter().map(|name| keep(name)).collect();
        if kept.iter().all(|k| *k) {
            return;
        }
        let stride = self.image.channels.len();
        let mut index = 0;
        self.image.data.retain(|_| {
            index += 1;
            kept[(index - 1) % stride]
        });
        let of = |i: &mut usize| {
            *i += 1;
            kept[*i - 1]
        };
        let (mut i, mut j) = (0, 0);
        self.image.channels.retain(|_| of(&mut i));
        self.storage.retain(|_| of(&mut j));
    }

    /// Adds the channels of another part of the same size.
    pub fn append(&mut self, other: FilePart) {
        let [a, b] = [&self.image, &other.image].map(|image| (image.channels.len().max(1), &image.data));
        let pixels = a.1.chunks_exact(a.0).zip(b.1.chunks_exact(b.0));
        self.image.data = pixels.flat_map(|(a, b)| a.iter().chain(b).copied()).collect();
        self.image.channels.extend(other.image.channels);
        self.storage.extend(other.storage);
    }

    /// Converts to a part that can be written. A lossy compression of the file is replaced by `zip`, to lose no more
    /// bits.
    pub fn into_part(self) -> Part {
        let compression = if LOSSLESS.contains(&self.compression.as_str()) { &self.compression } else { "zip" };
        let Image { width, height, channels, data } = self.image;
        let names = channels.clone();
        let mut part = Part::linear(width, height, channels, data).compressed_by(compression);
        for storage in [Storage::Half, Storage::Bytes] {
            let stored = names.iter().zip(&self.storage).filter(|(_, s)| **s == storage);
            let stored: Vec<&str> = stored.map(|(name, _)| name.as_str()).collect();
            part = part.channels_stored_as(&stored, storage);
        }
        if !self.name.is_empty() {
            part = part.named(&self.name);
        }
        let part = part.with_window(self.origin, self.full);
        self.metadata.into_iter().fold(part, |part, (name, value)| part.with_value(&name, value))
    }
}

/// Reads all parts of an image.
pub fn read_file_parts(path: &Path, limits: &ReadLimits) -> Result<Vec<FilePart>, ImageError> {
    let headers = read_headers(path)?;
    let count = headers.len();
    let part_of = |(index, header): (usize, super::file::PartHeader)| {
        let read = read_part(path, index, limits)?;
        let input = Input::open(path, i32::try_from(index).unwrap_or(i32::MAX))?;
        let failed = |failure| read_failure(path, failure);
        let is_of_storage = |name: &str| {
            OF_STORAGE.iter().any(|n| n.eq_ignore_ascii_case(name))
                || OF_STORAGE_PREFIXES.iter().any(|prefix| name.starts_with(prefix))
        };
        let mut metadata = input.values().map_err(failed)?;
        metadata.retain(|(name, _)| !is_of_storage(name));
        let window = read.window;
        let outside = || ImageError::Unreadable {
            path: path.to_owned(),
            reason: "has pixels to the left of the full image, or above it, which cannot be written".to_owned(),
        };
        let origin = |a: usize| {
            let offset = i64::from(window.origin[a]) - i64::from(window.full_origin[a]);
            usize::try_from(offset).map_err(|_| outside())
        };
        let whole = [read.image.width, read.image.height];
        Ok(FilePart {
            // The only part of a file needs no name
            name: if count > 1 { header.name } else { String::new() },
            storage: input.storage().map_err(failed)?,
            metadata,
            origin: [origin(0)?, origin(1)?],
            full: if window.full_size.contains(&0) { whole } else { window.full_size },
            compression: read.metadata.get("compression").cloned().unwrap_or_default(),
            image: read.image,
        })
    };
    headers.into_iter().enumerate().map(part_of).collect()
}

#[cfg(test)]
mod tests {
    use super::super::oiio::{read_image, write_image};
    use super::*;

    fn names(names: &[&str]) -> Vec<String> {
        names.iter().map(|&n| n.to_owned()).collect()
    }

    /// Two parts with metadata of all types and several storage types.
    fn written(path: &Path) -> [Part; 2] {
        let data: Vec<f32> = (0..24).map(|i| i as f32 * 0.37 - 2.0).collect();
        let first = Part::linear(3, 2, names(&["R", "G", "B", "depth.Z"]), data.clone());
        let first = first.channels_stored_as(&["R", "G", "B"], Storage::Half).with_window([1, 2], [10, 8]);
        let first = first.named("beauty").compressed_by("zips");
        let first = first.with_metadata(vec![("lumiris:spp".to_owned(), "16".to_owned())]);
        let first = first.with_value("renderTime", MetaValue::Number(1.5)).with_value("count", MetaValue::Integer(7));
        let matrix = std::array::from_fn(|i| i as f32);
        let first = first.with_value("worldToCamera", MetaValue::Matrix(matrix));
        let second = Part::linear(3, 2, names(&["albedo.R", "albedo.G"]), data[..12].to_vec()).named("albedo");
        let second = second.with_window([1, 2], [10, 8]);
        write_image(path, &[first.clone(), second.clone()]).unwrap();
        [first, second]
    }

    #[test]
    fn a_file_that_is_read_and_written_again_is_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a.exr", "b.exr"].map(|name| folder.path().join(name));
        written(&a);
        let parts = read_file_parts(&a, &ReadLimits::default()).unwrap();
        write_image(&b, &parts.into_iter().map(FilePart::into_part).collect::<Vec<_>>()).unwrap();
        assert!(std::fs::read(&a).unwrap() == std::fs::read(&b).unwrap());
    }

    #[test]
    fn channels_can_be_left_out_and_added() {
        // Write a file, remove all channels but one and add another
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a.exr", "b.exr"].map(|name| folder.path().join(name));
        written(&a);
        let mut parts = read_file_parts(&a, &ReadLimits::default()).unwrap();
        parts.truncate(1);
        let mut part = parts.remove(0);
        part.name.clear();
        let depth = part.image.channel("depth.Z").unwrap();
        let expected: Vec<f32> = (0..6).map(|i| part.image.get(i % 3, i / 3, depth)).collect();
        part.retain_channels(|name| name == "depth.Z");
        part.append(part.beside("", &["more.X"], vec![0.5; 6], Storage::Float));

        // Compare
        write_image(&b, &[part.into_part()]).unwrap();
        let read = read_image(&b, &ReadLimits::default()).unwrap();
        assert_eq!(read.window.origin, [1, 2]);
        let values = |name: &str| {
            let channel = read.image.channel(name).unwrap();
            (0..6).map(|i| read.image.get(i % 3, i / 3, channel)).collect::<Vec<f32>>()
        };
        assert_eq!((values("depth.Z"), values("more.X")), (expected, vec![0.5; 6]));
        assert_eq!(read.image.channels.len(), 2);
    }
}

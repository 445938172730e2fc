//! The fingerprint of a scene: a hash of the contents of all its files, independent of their location.
//! `render/parts/header.rs` compares it.

use lumiris_formats::source::SourceMap;
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap};
use std::fs::File;
use std::io::{self, Read};
use std::path::PathBuf;

/// A file that cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("cannot read {}: {error}", path.display())]
pub struct UnreadableFile {
    /// The file.
    pub path: PathBuf,
    /// The reason.
    pub error: io::Error,
}

/// Length and hash of a file.
#[derive(Clone, Copy)]
struct Hashed {
    bytes: u64,
    crc: u32,
}

/// The files of a scene.
#[derive(Clone, Debug, Default)]
pub struct SceneFiles {
    /// Hash of the texts.
    texts: u64,
    /// Meshes, volumes, images and spectra, in the order of the texts.
    others: Vec<PathBuf>,
}

impl SceneFiles {
    /// The texts that were read, and the files they name.
    pub(super) fn new(sources: &SourceMap, others: Vec<PathBuf>) -> Self {
        let texts = sources.texts().map(|text| Hashed { bytes: text.len() as u64, crc: crc32fast::hash(text) });
        SceneFiles { texts: combined(texts), others }
    }

    /// The hash of all files; reads those that are not text.
    pub fn fingerprint(&self) -> Result<u64, UnreadableFile> {
        let mut paths = self.others.clone();
        paths.dedup();
        // Each file is read once, even if several shapes use it
        let distinct: BTreeSet<&PathBuf> = paths.iter().collect();
        let hashes: HashMap<&PathBuf, Hashed> = distinct
            .into_par_iter()
            .map(|path| Ok((path, hash_of(path).map_err(|error| UnreadableFile { path: path.clone(), error })?)))
            .collect::<Result<_, _>>()?;
        let texts = Hashed { bytes: self.texts, crc: 0 };
        Ok(combined([texts].into_iter().chain(paths.iter().map(|path| hashes[path]))))
    }
}

fn hash_of(path: &PathBuf) -> io::Result<Hashed> {
    let mut file = File::open(path)?;
    let (mut hasher, mut bytes) = (crc32fast::Hasher::new(), 0);
    let mut buffer = vec![0; 1 << 20];
    loop {
        match file.read(&mut buffer) {
            Ok(0) => return Ok(Hashed { bytes, crc: hasher.finalize() }),
            Ok(count) => {
                hasher.update(&buffer[..count]);
                bytes += count as u64;
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}

/// FNV-1a over the words of all hashes.
fn combined(hashes: impl Iterator<Item = Hashed>) -> u64 {
    let words = hashes.flat_map(|hash| [hash.bytes, u64::from(hash.crc)]);
    let bytes = words.flat_map(u64::to_le_bytes);
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3))
}

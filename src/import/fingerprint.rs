//! The fingerprint of a scene: a hash of the contents of all its files, independent of their location.

use lumiris_formats::source::SourceMap;
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap};
use std::fs::File;
use std::io::{self, Read};
use std::path::PathBuf;

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
        let texts = sources.texts().map(|bytes| (bytes.len() as u64, crc32fast::hash(bytes)));
        SceneFiles { texts: combined(texts), others }
    }

    /// The hash of all files; reads those that are not text.
    pub fn fingerprint(&self) -> Result<u64, (PathBuf, io::Error)> {
        let mut paths = self.others.clone();
        paths.dedup();
        // Each file is read once, even if several shapes use it
        let distinct: BTreeSet<&PathBuf> = paths.iter().collect();
        let hashes: HashMap<&PathBuf, (u64, u32)> = distinct
            .into_par_iter()
            .map(|path| Ok((path, hash_of(path).map_err(|error| (path.clone(), error))?)))
            .collect::<Result<_, _>>()?;
        Ok(combined([(self.texts, 0)].into_iter().chain(paths.iter().map(|path| hashes[path]))))
    }
}

/// Length and hash of a file.
fn hash_of(path: &PathBuf) -> io::Result<(u64, u32)> {
    let mut file = File::open(path)?;
    let (mut hasher, mut len) = (crc32fast::Hasher::new(), 0);
    let mut buffer = vec![0; 1 << 20];
    loop {
        match file.read(&mut buffer) {
            Ok(0) => return Ok((len, hasher.finalize())),
            Ok(count) => {
                hasher.update(&buffer[..count]);
                len += count as u64;
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}

/// FNV-1a over the words of all pairs.
fn combined(pairs: impl Iterator<Item = (u64, u32)>) -> u64 {
    let words = pairs.flat_map(|(len, hash)| [len, u64::from(hash)]);
    let bytes = words.flat_map(u64::to_le_bytes);
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3))
}

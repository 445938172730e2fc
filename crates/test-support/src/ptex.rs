//! Writes Ptex files for tests, from the description of the format and not from its reader.

use flate2::Compression;
use flate2::write::ZlibEncoder;
use half::f16;
use std::io::Write;

/// How the texels of a face are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PtexEncoding {
    /// As the mean that all faces have. Texels are equal.
    Mean,
    /// As one texel in the level. Texels are equal.
    Constant,
    /// Compressed.
    Compressed,
    /// Differences, compressed.
    Differences,
    /// In tiles of these logarithms of columns and rows, by turns compressed and of differences.
    Tiled([u8; 2]),
}

/// A face to write.
#[derive(Clone, Debug)]
pub struct PtexFaceSpec {
    /// Logarithms of columns and rows.
    pub log2: [u8; 2],
    /// What the file says in their place, if it lies.
    pub claimed: Option<[u8; 2]>,
    /// Numbers of the faces beyond the edges, −1 for none, and their edges.
    pub neighbors: [(u32, u8); 4],
    /// True for a part of a face that is no quadrilateral.
    pub is_subface: bool,
    /// How it is stored.
    pub encoding: PtexEncoding,
    /// Row by row from the lower left, channels interleaved; of integers as fractions of the largest.
    pub texels: Vec<f32>,
}

impl PtexFaceSpec {
    /// A face without neighbours, compressed.
    pub fn new(log2: [u8; 2], texels: Vec<f32>) -> Self {
        PtexFaceSpec {
            log2,
            claimed: None,
            neighbors: [(u32::MAX, 0); 4],
            is_subface: false,
            encoding: PtexEncoding::Compressed,
            texels,
        }
    }
}

/// A file to write.
#[derive(Clone, Debug)]
pub struct PtexSpec {
    /// Code of the type of numbers: 0 bytes, 1 words, 2 halves, 3 floats.
    pub ty: u32,
    /// Channels.
    pub channels: u16,
    /// Faces.
    pub faces: Vec<PtexFaceSpec>,
}

fn zipped(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).expect("memory takes all");
    encoder.finish().expect("memory takes all")
}

impl PtexSpec {
    fn number(&self, value: f32) -> Vec<u8> {
        match self.ty {
            0 => vec![(value * 255.0).round() as u8],
            1 => ((value * 65535.0).round() as u16).to_le_bytes().to_vec(),
            2 => f16::from_f32(value).to_le_bytes().to_vec(),
            _ => value.to_le_bytes().to_vec(),
        }
    }

    /// The texels of a rectangle of a face, channel by channel.
    fn planar(&self, face: &PtexFaceSpec, [x, y]: [usize; 2], [width, height]: [usize; 2]) -> Vec<u8> {
        let (channels, columns) = (usize::from(self.channels), 1 << face.log2[0]);
        let rows =
            |c: usize| (y..y + height).flat_map(move |y| (x..x + width).map(move |x| (y * columns + x) * channels + c));
        (0..channels).flat_map(rows).flat_map(|i| self.number(face.texels[i])).collect()
    }

    fn differences(&self, planar: &[u8]) -> Vec<u8> {
        let mut last = 0_u16;
        match self.ty {
            0 => planar.iter().map(|&b| b.wrapping_sub(std::mem::replace(&mut last, b.into()) as u8)).collect(),
            1 => {
                let words = planar.chunks_exact(2).map(|w| u16::from_le_bytes([w[0], w[1]]));
                words.flat_map(|w| w.wrapping_sub(std::mem::replace(&mut last, w)).to_le_bytes()).collect()
            }
            _ => planar.to_vec(),
        }
    }

    /// The word for a block in a list of sizes, and the block.
    fn block(
        &self,
        face: &PtexFaceSpec,
        first: [usize; 2],
        size: [usize; 2],
        encoding: PtexEncoding,
    ) -> (u32, Vec<u8>) {
        let planar = self.planar(face, first, size);
        let (code, block) = match encoding {
            PtexEncoding::Mean => (0, Vec::new()),
            PtexEncoding::Constant => (0, self.planar(face, first, [1, 1])),
            PtexEncoding::Compressed => (1, zipped(&planar)),
            PtexEncoding::Differences => (2, zipped(&self.differences(&planar))),
            PtexEncoding::Tiled(log2) => {
                let [width, height] = log2.map(|log2| 1 << log2);
                let corners =
                    (0..size[1]).step_by(height).flat_map(|y| (0..size[0]).step_by(width).map(move |x| [x, y]));
                let by_turns = [PtexEncoding::Compressed, PtexEncoding::Differences];
                let tiles =
                    corners.enumerate().map(|(i, first)| self.block(face, first, [width, height], by_turns[i % 2]));
                let (words, tiles): (Vec<u32>, Vec<Vec<u8>>) = tiles.unzip();
                let head = zipped(&words.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>());
                (3, [&log2[..], &(head.len() as u32).to_le_bytes(), &head, &tiles.concat()].concat())
            }
        };
        (code << 30 | block.len() as u32, block)
    }
}

/// The bytes of a file.
pub fn ptex_file(spec: &PtexSpec) -> Vec<u8> {
    let mut infos = Vec::new();
    let mut means: Vec<Vec<u8>> = vec![Vec::new(); spec.channels.into()];
    let (mut words, mut blocks) = (Vec::new(), Vec::new());
    for face in &spec.faces {
        let edges = face.neighbors.iter().enumerate().fold(0, |edges, (i, n)| edges | n.1 << (2 * i));
        let flags = u8::from(face.encoding == PtexEncoding::Mean) | u8::from(face.is_subface) << 3;
        let [columns, rows] = face.claimed.unwrap_or(face.log2);
        infos.extend([columns, rows, edges, flags]);
        infos.extend(face.neighbors.iter().flat_map(|n| n.0.to_le_bytes()));
        for (c, means) in means.iter_mut().enumerate() {
            let channel = face.texels.iter().skip(c).step_by(spec.channels.into());
            let count = face.texels.len() / usize::from(spec.channels);
            means.extend(spec.number(channel.sum::<f32>() / count as f32));
        }
        let (word, block) = spec.block(face, [0, 0], face.log2.map(|log2| 1 << log2), face.encoding);
        words.extend(word.to_le_bytes());
        blocks.extend(block);
    }
    let (infos, means, words) = (zipped(&infos), zipped(&means.concat()), zipped(&words));
    let level_size = (words.len() + blocks.len()) as u64;

    let mut file = b"Ptex".to_vec();
    let u32s = |file: &mut Vec<u8>, values: &[u32]| values.iter().for_each(|v| file.extend(v.to_le_bytes()));
    let count = spec.faces.len() as u32;
    u32s(&mut file, &[1, 1, spec.ty, u32::MAX]);
    file.extend([spec.channels, 1].iter().flat_map(|v| v.to_le_bytes()));
    u32s(&mut file, &[count, 40, infos.len() as u32, means.len() as u32, 16, 4]);
    file.extend(level_size.to_le_bytes());
    u32s(&mut file, &[0; 2]);
    // Borders and metadata: none
    file.extend([0; 40]);
    file.extend(infos);
    file.extend(means);
    file.extend(level_size.to_le_bytes());
    u32s(&mut file, &[words.len() as u32, count]);
    file.extend(words);
    file.extend(blocks);
    file
}

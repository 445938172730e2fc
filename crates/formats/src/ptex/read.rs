//! Reads files and bytes.

use super::blocks::{self, BlockHeader, Blocks, Encoding, NumberType, inflate};
use super::error::PtexError;
use super::file::{Neighbor, PtexFace, PtexFile, PtexSize, PtexTexels};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Maximum log₂ of the number of texels along an edge of a face.
const MOST_LOG2: u8 = 16;

/// Maximum expansion of texels relative to the file, more than image compression achieves; small files may expand to
/// [`LEAST_ROOM`]. Files that claim more are damaged.
const MOST_EXPANSION: usize = 4096;
const LEAST_ROOM: usize = 1 << 26;

/// Reads a file.
pub fn read_ptex(path: &Path) -> Result<PtexFile, PtexError> {
    let bytes = std::fs::read(path).map_err(|reason| PtexError::Unreadable { path: path.to_owned(), reason })?;
    parse_ptex(&bytes).map_err(|error| match error {
        PtexError::Wrong { byte, message, .. } => PtexError::Wrong { path: path.to_owned(), byte, message },
        PtexError::Unreadable { .. } => error,
    })
}

/// The size of the content of a file, from the sizes of its faces. Faces that only their texels tell to be constant
/// count in full.
pub fn ptex_size(path: &Path) -> Result<PtexSize, PtexError> {
    let unreadable = |reason| PtexError::Unreadable { path: path.to_owned(), reason };
    let mut file = File::open(path).map_err(unreadable)?;
    let file_bytes = file.metadata().map_err(unreadable)?.len();
    let mut start = |bytes: u64| {
        let mut head = Vec::new();
        let read = Read::by_ref(&mut file).take(bytes).read_to_end(&mut head);
        read.map(|_| head).map_err(unreadable)
    };

    // The header, and the list of faces
    let header = Header::read(&mut Blocks::new(&start(HEADER)?, 0))?;
    start(header.extension_size as u64)?;
    let infos = inflate(&start(header.faces_size as u64)?, header.faces.checked_mul(FACE_BYTES), 0)?;

    // Their texels
    let (mut all, mut room) = (0_u64, usize::MAX);
    for info in infos.chunks_exact(FACE_BYTES) {
        let is_constant = info[3] & FLAG_CONSTANT != 0;
        let log2 = header.size(info, is_constant, &mut room).map_err(|what| PtexError::wrong(0, what))?;
        all += if is_constant { 1 } else { 1 << (log2[0] + log2[1]) };
    }
    let number = if header.ty == NumberType::U8 { 1 } else { size_of::<f32>() as u64 };
    let texels = all.saturating_mul(header.kept_channels() as u64 * number);
    Ok(PtexSize { file: file_bytes, texels, faces: (header.faces * size_of::<PtexFace>()) as u64 })
}

/// Bytes of the header, and of a face in the list.
const HEADER: u64 = 64;
const FACE_BYTES: usize = 20;

/// The content of the header.
struct Header {
    ty: NumberType,
    /// Channels in the file.
    channels: usize,
    faces: usize,
    extension_size: usize,
    faces_size: usize,
    means_size: usize,
    levels_size: usize,
}

impl Header {
    fn read(blocks: &mut Blocks<'_>) -> Result<Self, PtexError> {
        if blocks.take(4, "the header")? != b"Ptex" {
            return Err(PtexError::wrong(0, "this is no Ptex file"));
        }
        let version = blocks.u32()?;
        if version != 1 {
            return Err(PtexError::wrong(4, format!("version {version} is unknown; 1 is read")));
        }
        match blocks.u32()? {
            0 => {
                return Err(PtexError::wrong(
                    8,
                    "textures of triangles are not rendered, only those of quadrilaterals",
                ));
            }
            1 => {}
            other => return Err(PtexError::wrong(8, format!("there is no type of mesh {other}"))),
        }
        let ty = blocks.u32()?;
        let ty =
            NumberType::from_code(ty).ok_or_else(|| PtexError::wrong(12, format!("there is no type of data {ty}")))?;
        let _alpha = blocks.u32()?;
        let channels = usize::from(blocks.u16()?);
        let levels = blocks.u16()?;
        let faces = blocks.u32()? as usize;
        if channels == 0 || levels == 0 || faces == 0 {
            let message = format!("{channels} channels, {levels} levels and {faces} faces are no texture");
            return Err(PtexError::wrong(20, message));
        }
        let [extension_size, faces_size, means_size, levels_size] = blocks.sizes()?;
        let _minor_version = blocks.u32()?;
        // The total size of all levels, and of metadata
        blocks.take(16, "the header")?;
        Ok(Header { ty, channels, faces, extension_size, faces_size, means_size, levels_size })
    }

    /// Channels that are kept.
    fn kept_channels(&self) -> usize {
        if self.channels >= 3 { 3 } else { 1 }
    }

    /// Size of a texel (bytes).
    fn texel_bytes(&self) -> usize {
        self.channels * self.ty.size()
    }

    /// Appends the mean of a face; means are planar by channel.
    fn mean(&self, means: &[u8], face: usize, out: &mut Vec<u8>) {
        let size = self.ty.size();
        let channels = means.chunks_exact(self.faces * size);
        channels.for_each(|channel| out.extend_from_slice(&channel[face * size..][..size]));
    }

    /// log₂ of the columns and rows of a face, whose texels must fit into `room` (bytes).
    ///
    /// Returns `Err` with a message if they are invalid.
    fn size(&self, info: &[u8], is_constant: bool, room: &mut usize) -> Result<[u8; 2], String> {
        let log2 = [info[0], info[1]];
        let bytes = match log2.iter().all(|&log2| log2 <= MOST_LOG2) {
            true if is_constant => self.texel_bytes(),
            true => self.texel_bytes() << (log2[0] + log2[1]),
            false => usize::MAX,
        };
        *room = room.checked_sub(bytes).ok_or_else(|| format!("has 2^{} × 2^{} texels", log2[0], log2[1]))?;
        Ok(log2)
    }
}

/// Reads the bytes of a file.
pub fn parse_ptex(bytes: &[u8]) -> Result<PtexFile, PtexError> {
    let mut blocks = Blocks::new(bytes, 0);
    let header = Header::read(&mut blocks)?;
    let extension = blocks.take(header.extension_size, "the extended header")?;
    // Border modes and metadata, then the size of edits
    if extension.get(24..32).is_some_and(|edits| edits.iter().any(|&b| b != 0)) {
        let message = "edits that were added to the file are not read; `ptxutil -c` makes it whole";
        return Err(PtexError::wrong(64 + 24, message));
    }

    let at = blocks.at();
    let infos = inflate(blocks.take(header.faces_size, "the faces")?, header.faces.checked_mul(FACE_BYTES), at)?;
    let at = blocks.at();
    let means_bytes = header.faces.checked_mul(header.texel_bytes());
    let means = inflate(blocks.take(header.means_size, "the means of the faces")?, means_bytes, at)?;
    let at = blocks.at();
    let mut levels = Blocks::new(blocks.take(header.levels_size, "the sizes of the levels")?, at);
    let _level_size = levels.take(8, "the size of a level")?;
    let level_header_size = levels.u32()? as usize;
    let level_faces = levels.u32()? as usize;
    if level_faces != header.faces {
        return Err(PtexError::wrong(at, format!("level 0 has {level_faces} of {} faces", header.faces)));
    }
    let at = blocks.at();
    let sizes = inflate(blocks.take(level_header_size, "the sizes of textures")?, header.faces.checked_mul(4), at)?;

    let mut out = Interleaved::new(&header);
    let mut faces = Vec::with_capacity(header.faces);
    let mut planar = Vec::new();
    let mut room = bytes.len().saturating_mul(MOST_EXPANSION).max(LEAST_ROOM);
    for (number, (info, size)) in infos.chunks_exact(FACE_BYTES).zip(sizes.chunks_exact(4)).enumerate() {
        let at = blocks.at();
        let BlockHeader { encoding, size } = BlockHeader::of(u32::from_le_bytes([size[0], size[1], size[2], size[3]]));
        let block = blocks.take(size, "the texture of a face")?;
        planar.clear();
        let is_mean = info[3] & FLAG_CONSTANT != 0;
        let is_constant = is_mean || matches!(encoding, Encoding::Constant);
        let log2 = header.size(info, is_constant, &mut room).map_err(|what| {
            PtexError::wrong(at, format!("face {number} {what}, in a file of {} bytes", bytes.len()))
        })?;
        if is_mean {
            header.mean(&means, number, &mut planar);
        } else {
            let stored = if is_constant { [0, 0] } else { log2 };
            blocks::read_texels(block, encoding, stored, (header.channels, header.ty), &mut planar, at)?;
        }
        faces.push(PtexFace { first: out.texels(), log2, is_constant, neighbors: neighbors(info, &infos) });
        out.push(&planar);
    }
    Ok(PtexFile { faces, channels: out.channels, texels: out.values })
}

/// Flags of a face.
const FLAG_CONSTANT: u8 = 1;
const FLAG_SUBFACE: u8 = 8;

/// The neighbours of a face, except neighbours of half or twice its size: subfaces of non-quadrilateral faces beside
/// whole ones.
fn neighbors(info: &[u8], infos: &[u8]) -> [Option<Neighbor>; 4] {
    std::array::from_fn(|side| {
        let id = &info[4 + 4 * side..][..4];
        let face = u32::from_le_bytes([id[0], id[1], id[2], id[3]]);
        let start = (face as usize).checked_mul(info.len())?;
        let other = infos.get(start..start.checked_add(info.len())?)?;
        let is_alike = (other[3] ^ info[3]) & FLAG_SUBFACE == 0;
        is_alike.then_some(Neighbor { face, edge: info[2] >> (2 * side) & 3 })
    })
}

/// Texels with selected channels.
struct Interleaved {
    ty: NumberType,
    /// Channels in the file.
    of: usize,
    /// Channels that are kept.
    channels: usize,
    values: PtexTexels,
}

impl Interleaved {
    fn new(header: &Header) -> Self {
        let values =
            if header.ty == NumberType::U8 { PtexTexels::Bytes(Vec::new()) } else { PtexTexels::Floats(Vec::new()) };
        Interleaved { ty: header.ty, of: header.channels, channels: header.kept_channels(), values }
    }

    /// Number of texels.
    fn texels(&self) -> usize {
        let numbers = match &self.values {
            PtexTexels::Bytes(v) => v.len(),
            PtexTexels::Floats(v) => v.len(),
        };
        numbers / self.channels
    }

    /// Adds texels that are planar by channel.
    fn push(&mut self, planar: &[u8]) {
        let size = self.ty.size();
        let count = planar.len() / (self.of * size);
        for texel in 0..count {
            for channel in 0..self.channels {
                let at = (channel * count + texel) * size;
                match &mut self.values {
                    PtexTexels::Bytes(values) => values.push(planar[at]),
                    PtexTexels::Floats(values) => values.push(self.ty.number(&planar[at..at + size])),
                }
            }
        }
    }
}

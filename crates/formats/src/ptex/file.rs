//! The content of a file.

/// Faces and their texels.
#[derive(Clone, Debug, PartialEq)]
pub struct PtexFile {
    /// Faces, in the order of their numbers.
    pub faces: Vec<PtexFace>,
    /// Channels of a texel: three if the file has three or more, else one.
    pub channels: usize,
    /// Texels of all faces, face by face.
    pub texels: PtexTexels,
}

/// Bytes of a file and of its content.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PtexSize {
    /// The file.
    pub file: u64,
    /// Texels of all faces.
    pub texels: u64,
    /// Descriptions of all faces.
    pub faces: u64,
}

/// Texel values, channels interleaved.
#[derive(Clone, Debug, PartialEq)]
pub enum PtexTexels {
    /// Multiples of 1/255.
    Bytes(Vec<u8>),
    /// Numbers; integers of 16 bits are divided by 65535.
    Floats(Vec<f32>),
}

/// A face of the mesh. Its texels are in row order, from (u, v) = (0, 0); a face of constant colour has one texel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PtexFace {
    /// Index of its first texel.
    pub first: usize,
    /// Binary logarithms of the numbers of columns and rows.
    pub log2: [u8; 2],
    /// True if a single texel stands for all.
    pub is_constant: bool,
    /// Neighbours at its edges v = 0, u = 1, v = 1, u = 0.
    pub neighbors: [Option<Neighbor>; 4],
}

/// An adjacent face, which is joined along one of its own edges, in the reverse direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Neighbor {
    /// Number of the face.
    pub face: u32,
    /// Its edge, in the order of [`PtexFace::neighbors`].
    pub edge: u8,
}

//! Blocks of passes of the progressive form: 0 | 1 | 2, 3 | 4 … 7 | 8 … 15 | …
//!
//! β is constant within a block and fitted to all earlier blocks. The estimate is unbiased only if the samples of a
//! block are independent of earlier blocks, so each block is randomised separately. Lengths are powers of two, so that
//! each block can be a whole net of a Sobol' sequence.

/// Passes that share coefficients.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// Number of earlier blocks.
    pub index: u32,
    /// Its first pass, which is also the number of passes that its coefficients are fitted to.
    pub first: u32,
    /// Number of its passes.
    pub len: u32,
}

/// The block of pass (sample of a pixel) `sample`.
#[inline]
pub fn block_of(sample: u32) -> Block {
    let index = u32::BITS - sample.leading_zeros();
    let first = if sample == 0 { 0 } else { 1 << (index - 1) };
    Block { index, first, len: first.max(1) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_double_and_cover_every_pass_once() {
        let mut next = 0;
        for sample in 0..70 {
            let block = block_of(sample);
            if sample == next {
                assert_eq!(block.first, sample);
                next += block.len;
            }
            assert!((block.first..block.first + block.len).contains(&sample), "{sample} {block:?}");
        }
        let indices: Vec<u32> = (0..9).map(|s| block_of(s).index).collect();
        assert_eq!(indices, [0, 1, 2, 2, 3, 3, 3, 3, 4]);
        assert_eq!(block_of(u32::MAX), Block { index: 32, first: 1 << 31, len: 1 << 31 });
    }
}

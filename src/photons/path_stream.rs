//! Random numbers of the paths of photons and importons, and the size of their batches. The paths are traced by `walk`.
//!
//! Photon path t is a point of a scrambled Sobol' sequence over path space [Keller 1998, ch. 3; Burley 2020]. The
//! sequence has 2¹⁶ points. Each block of 2¹⁶ photon paths is scrambled independently.

use lumiris_numbers::math::hash::pcg4d;
use lumiris_numbers::samplers::{SampleStream, SamplerKind};

/// Number of photon paths that are traced together.
pub(crate) const BATCH: u64 = 4096;
/// log₂ of the points of a sequence.
const SEQUENCE_BITS: u32 = 16;

/// Random-number domains of a photon path.
pub(crate) mod domain {
    pub(crate) const LIGHT: u32 = 0;
    pub(crate) const EMISSION: u32 = 1;
    pub(crate) const TIME: u32 = 2;
}

/// Random numbers of a photon path.
pub(crate) fn path_stream(seed: u32, path: u64) -> SampleStream {
    let block = path >> SEQUENCE_BITS;
    let [block_seed, key, ..] = pcg4d([seed, block as u32, (block >> 32) as u32, 0x7068_6f74]);
    let index = (path & ((1 << SEQUENCE_BITS) - 1)) as u32;
    SampleStream::new(SamplerKind::Sobol, [0, 0], index, block_seed).domain(key)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_of_different_blocks_differ() {
        let draw = |t| path_stream(3, t).domain(domain::EMISSION).draw::<4>();
        for t in [0, 1, 4464, 65_535] {
            for block in 1..50 {
                assert_ne!(draw(t), draw(t + block * 65_536), "{t} {block}");
            }
        }
        assert_ne!(draw(70_000), draw(4464));
        assert_ne!(draw(7), path_stream(4, 7).domain(domain::EMISSION).draw::<4>());
    }

    #[test]
    fn every_block_is_stratified() {
        for block in 0..4_u64 {
            let mut counts = [0; 256];
            for t in 0..1024 {
                let [u, v, ..] = path_stream(3, block << 16 | t).domain(domain::EMISSION).draw::<4>();
                counts[(u * 16.0) as usize * 16 + (v * 16.0) as usize] += 1;
            }
            assert!(counts.iter().all(|&c| c == 4), "block {block}");
        }
    }
}

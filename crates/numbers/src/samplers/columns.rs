//! Sample streams of a batch in columns, for kernels that draw the numbers of all of them.

use super::kind::SamplerKind;
use super::net::Net;
use super::stream::{Kind, SampleStream};
use std::ops::Range;

/// The sequence of the streams of a batch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StreamKind {
    /// Independent numbers. The three words are the key.
    Independent,
    /// Points of an Owen-scrambled Sobol' sequence. The first two words are the key; the third has the index of the
    /// point in its lower half, and above it x and y of the pixel in its block, one byte each.
    #[default]
    Sobol,
    /// The same, with blue-noise errors within blocks of pixels.
    SobolBlueNoise,
}

/// Streams of the same kind in columns.
#[derive(Clone, Debug, Default)]
pub struct StreamColumns {
    kind: StreamKind,
    words: [Vec<u32>; 3],
}

impl StreamColumns {
    /// Number of streams.
    pub fn len(&self) -> usize {
        self.words[0].len()
    }

    /// True if there are no streams.
    pub fn is_empty(&self) -> bool {
        self.words[0].is_empty()
    }

    /// Removes all streams.
    pub fn clear(&mut self) {
        self.words.iter_mut().for_each(Vec::clear);
    }

    /// The sequence of all streams.
    pub fn kind(&self) -> StreamKind {
        self.kind
    }

    /// The words of all streams; see [`StreamKind`].
    pub fn words(&self) -> [&[u32]; 3] {
        self.words.each_ref().map(|column| &column[..])
    }

    /// The same, mutable.
    pub fn words_mut(&mut self) -> [&mut [u32]; 3] {
        self.words.each_mut().map(|column| &mut column[..])
    }

    /// Stream `i`.
    #[inline]
    pub fn get(&self, i: usize) -> SampleStream {
        let words = self.words.each_ref().map(|column| column[i]);
        let net = || Net::of_words(words);
        SampleStream(match self.kind {
            StreamKind::Independent => Kind::Independent { key: words },
            StreamKind::Sobol => Kind::Sobol(net()),
            StreamKind::SobolBlueNoise => Kind::SobolBlueNoise(net()),
        })
    }

    /// Adds streams. All streams must be of the same kind.
    pub fn extend<'a>(&mut self, streams: impl ExactSizeIterator<Item = &'a SampleStream>) {
        let first = self.len();
        let len = first + streams.len();
        self.words.iter_mut().for_each(|column| column.resize(len, 0));
        let [a, b, c] = self.words.each_mut().map(|column| &mut column[first..]);
        for (((a, b), c), stream) in a.iter_mut().zip(b).zip(c).zip(streams) {
            let (kind, words) = match &stream.0 {
                Kind::Independent { key } => (StreamKind::Independent, *key),
                Kind::Sobol(net) => (StreamKind::Sobol, net.words()),
                Kind::SobolBlueNoise(net) => (StreamKind::SobolBlueNoise, net.words()),
            };
            self.kind = kind;
            [*a, *b, *c] = words;
        }
    }

    /// Adds the root streams of some samples of a pixel, see [`SampleStream::new`]. The hash of a net is computed once.
    pub fn push_samples(&mut self, kind: SamplerKind, pixel: [u32; 2], samples: Range<u32>, seed: u32) {
        let mut start = samples.start;
        while start < samples.end {
            self.extend([SampleStream::new(kind, pixel, start, seed)].iter());
            let end = match kind {
                SamplerKind::Independent | SamplerKind::Stratified => start + 1,
                // The index of a point has 16 bits
                SamplerKind::Sobol | SamplerKind::SobolBlueNoise => (start | 0xffff).saturating_add(1).min(samples.end),
            };

            // Streams that differ in the index
            let [a, b, place] = self.words.each_ref().map(|column| column.last().copied().unwrap_or_default());
            let len = self.len() + (end - start) as usize - 1;
            self.words[0].resize(len, a);
            self.words[1].resize(len, b);
            self.words[2].extend((start + 1..end).map(|sample| place & 0xffff_0000 | sample & 0xffff));
            start = end;
        }
    }

    /// Replaces all streams by the streams `rows` of `from`.
    #[inline]
    pub fn gather(&mut self, from: &StreamColumns, rows: &[u32]) {
        self.clear();
        self.kind = from.kind;
        for (to, from) in self.words.iter_mut().zip(&from.words) {
            to.extend(rows.iter().map(|&row| from[row as usize]));
        }
    }

    /// Replaces all streams by those of `from`.
    #[inline]
    pub fn copy_from(&mut self, from: &StreamColumns) {
        self.clear();
        self.kind = from.kind;
        self.words.iter_mut().zip(&from.words).for_each(|(to, from)| to.extend_from_slice(from));
    }
}

impl Net {
    #[inline]
    pub(super) fn words(&self) -> [u32; 3] {
        let [x, y] = self.pixel.map(u32::from);
        [self.key[0], self.key[1], u32::from(self.index) | x << 16 | y << 24]
    }

    #[inline]
    fn of_words([a, b, place]: [u32; 3]) -> Self {
        Net { key: [a, b], index: place as u16, pixel: [(place >> 16) as u8, (place >> 24) as u8] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use strum::IntoEnumIterator;

    #[test]
    fn samples_of_a_pixel_have_the_streams_of_each_by_itself() {
        for kind in SamplerKind::iter() {
            for samples in [0..0, 5..6, 7..90, 65_500..65_600, u32::MAX - 9..u32::MAX] {
                let mut columns = StreamColumns::default();
                columns.push_samples(kind, [70, 9], samples.clone(), 3);
                assert_eq!(columns.len(), samples.len());
                for (i, sample) in samples.enumerate() {
                    let stream = SampleStream::new(kind, [70, 9], sample, 3);
                    assert_eq!(columns.get(i).domain(6).draw::<4>(), stream.domain(6).draw::<4>(), "{kind:?} {sample}");
                }
            }
        }
    }
}

//! The same domain of successive streams.
//!
//! Hashes depend on the pixel or its block, but not on the sample. Successive streams mostly belong to samples of one
//! pixel and share the hashes, which are computed once.

use super::{Kind, Net, SampleStream};

/// The hash of a domain, and the hash of its parent.
#[derive(Clone, Copy, Debug)]
struct Hashed {
    outer: [u32; 2],
    domain: u32,
    inner: [u32; 2],
}

impl Hashed {
    fn new(net: &Net, domain: u32) -> Self {
        Hashed { outer: net.key, domain, inner: net.domain(domain).key }
    }

    #[inline]
    fn update(&mut self, net: &Net, domain: u32) -> [u32; 2] {
        if self.outer != net.key || self.domain != domain {
            *self = Hashed::new(net, domain);
        }
        self.inner
    }
}

/// [`SampleStream::domain`] with the same key, for successive streams.
#[derive(Clone, Copy, Debug)]
pub struct Domain {
    key: u32,
    last: Hashed,
}

impl Domain {
    /// For this key.
    pub fn new(key: u32) -> Self {
        Domain { key, last: Hashed::new(&Net { key: [0; 2], index: 0, pixel: [0; 2] }, key) }
    }

    /// The domain below a stream.
    #[inline]
    pub fn of(&mut self, stream: &SampleStream) -> SampleStream {
        SampleStream(match &stream.0 {
            Kind::Independent { .. } => return stream.domain(self.key),
            Kind::Sobol(net) => Kind::Sobol(self.of_net(net)),
            Kind::SobolBlueNoise(net) => Kind::SobolBlueNoise(self.of_net(net)),
        })
    }

    #[inline]
    fn of_net(&mut self, net: &Net) -> Net {
        Net { key: self.last.update(net, self.key), ..*net }
    }
}

/// [`SampleStream::split`] with the same key, for successive streams.
#[derive(Clone, Copy, Debug)]
pub struct Split {
    domain: Domain,
    count: u32,
    index: u32,
    last: Hashed,
}

impl Split {
    /// Point `index` of `count` points of the domain `key`.
    pub fn new(key: u32, count: u32, index: u32) -> Self {
        let domain = Domain::new(key);
        Split { domain, count, index, last: Hashed::new(&Net { key: [0; 2], index: 0, pixel: [0; 2] }, 0) }
    }

    /// The point of a stream.
    #[inline]
    pub fn of(&mut self, stream: &SampleStream) -> SampleStream {
        SampleStream(match &stream.0 {
            Kind::Independent { .. } => return stream.split(self.domain.key, self.count, self.index),
            Kind::Sobol(net) => Kind::Sobol(self.of_net(net)),
            Kind::SobolBlueNoise(net) => Kind::SobolBlueNoise(self.of_net(net)),
        })
    }

    #[inline]
    fn of_net(&mut self, net: &Net) -> Net {
        let all = u32::from(net.index).wrapping_mul(self.count).wrapping_add(self.index);
        let of_domain = self.domain.of_net(net);
        Net { key: self.last.update(&of_domain, all >> 16), index: all as u16, ..of_domain }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samplers::SamplerKind;
    use strum::IntoEnumIterator;

    #[test]
    fn domains_and_points_of_streams_in_a_row_are_those_of_each_by_itself() {
        for kind in SamplerKind::iter() {
            let (mut domain, mut split) = (Domain::new(7), Split::new(3, 5, 4));
            // Alternating pixels, so that hashes are reused and replaced; samples on both sides of the end of an index
            for (pixel, sample) in [(3, 1), (3, 2), (3, 20_000), (40, 1), (40, 65_535), (40, 65_536), (3, 2), (0, 0)] {
                let stream = SampleStream::new(kind, [pixel, 9], sample, 11);
                assert_eq!(domain.of(&stream).draw::<4>(), stream.domain(7).draw::<4>(), "{kind:?} {pixel} {sample}");
                assert_eq!(
                    split.of(&stream).draw::<4>(),
                    stream.split(3, 5, 4).draw::<4>(),
                    "{kind:?} {pixel} {sample}"
                );
            }
        }
    }
}

//! Sums as bytes for the files of `render/parts`, little-endian, without zero bytes at both ends of a number.
//! With a few hundred samples per pixel, a film takes about half of its memory.
//!
//! A number begins with a byte: its five lower bits are the number of the following bytes, its three upper bits the
//! number of pairs of zero bytes below them. A signed number is doubled, and odd if negative.

use super::accumulator::{PixelAccumulator, RadianceAccumulator};
use super::fixed_sums::{FixedSum, SquareSum, UnitSum};
use super::light_layers::PixelLight;
use super::replicas::ReplicaAccumulator;

/// Appends numbers to a byte vector.
#[derive(Debug, Default)]
pub struct Encoder {
    /// The bytes so far.
    pub bytes: Vec<u8>,
}

impl Encoder {
    /// A 32-bit number in four bytes.
    pub fn word(&mut self, value: u32) {
        self.bytes.extend(value.to_le_bytes());
    }

    /// A compressed integer.
    #[inline]
    pub fn count(&mut self, value: u32) {
        self.number(&value.to_le_bytes());
    }

    /// A compressed sum.
    #[inline]
    pub fn fixed(&mut self, sum: &FixedSum) {
        let bits = sum.bits();
        self.number(&((bits << 1) ^ (bits >> 127)).to_le_bytes());
    }

    #[inline]
    fn unit(&mut self, sum: &UnitSum) {
        let bits = sum.bits();
        self.number(&((bits << 1) ^ (bits >> 63)).to_le_bytes());
    }

    #[inline]
    fn square(&mut self, sum: &SquareSum) {
        let mut bytes = [0; 24];
        bytes.chunks_exact_mut(8).zip(sum.bits()).for_each(|(to, limb)| to.copy_from_slice(&limb.to_le_bytes()));
        self.number(&bytes);
    }

    #[inline]
    fn number(&mut self, bytes: &[u8]) {
        let end = bytes.iter().rposition(|&b| b != 0).map_or(0, |last| last + 1);
        let zeros = bytes[..end].iter().position(|&b| b != 0).unwrap_or(0);
        let pairs = (zeros / 2).min(7);
        let digits = &bytes[2 * pairs..end];
        self.bytes.push(digits.len() as u8 | (pairs as u8) << 5);
        self.bytes.extend_from_slice(digits);
    }

    fn radiance(&mut self, sums: &RadianceAccumulator) {
        self.count(sums.count);
        self.count(sums.invalid);
        sums.radiance.iter().for_each(|sum| self.fixed(sum));
    }

    /// The sums of a pixel. Features follow if the number of hits is not 0.
    pub fn pixel(&mut self, sums: &PixelAccumulator) {
        self.radiance(&sums.radiance);
        sums.squares.iter().for_each(|sum| self.square(sum));
        self.count(sums.hits);
        if sums.hits > 0 {
            sums.albedo.iter().chain(&sums.normal).for_each(|sum| self.unit(sum));
            self.fixed(&sums.depth);
            [sums.first_hit, sums.material, sums.object].into_iter().for_each(|n| self.count(n));
        }
        self.count(sums.records);
    }

    /// The pixels of a layer that have light, in order.
    pub fn light(&mut self, pixels: &[PixelLight]) {
        self.count(pixels.len() as u32);
        for PixelLight { pixel, sums } in pixels {
            self.count(*pixel);
            sums.iter().for_each(|sum| self.fixed(sum));
        }
    }

    /// The sums of a replica.
    pub fn replica(&mut self, replica: &ReplicaAccumulator) {
        self.count(replica.pixel);
        self.radiance(&replica.sums);
        replica.squares.iter().for_each(|sum| self.square(sum));
    }

    /// Floats in four bytes each.
    pub fn floats(&mut self, values: &[f32]) {
        self.word(values.len() as u32);
        values.iter().for_each(|value| self.word(value.to_bits()));
    }
}

/// Reads the numbers of an [`Encoder`]. Returns `None` if the bytes end too early or are invalid.
#[derive(Debug)]
pub struct Decoder<'a> {
    bytes: &'a [u8],
}

impl<'a> Decoder<'a> {
    /// A decoder at the first byte.
    pub fn new(bytes: &'a [u8]) -> Self {
        Decoder { bytes }
    }

    /// True if all bytes are read.
    pub fn is_at_end(&self) -> bool {
        self.bytes.is_empty()
    }

    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (head, tail) = self.bytes.split_at_checked(count)?;
        self.bytes = tail;
        Some(head)
    }

    /// A 32-bit number.
    pub fn word(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(self.take(4)?.try_into().ok()?))
    }

    fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        let head = self.take(1)?[0];
        let (len, zeros) = (usize::from(head & 31), 2 * usize::from(head >> 5));
        let digits = self.take(len)?;
        let mut bytes = [0; N];
        bytes.get_mut(zeros..zeros + len)?.copy_from_slice(digits);
        Some(bytes)
    }

    /// A compressed integer.
    pub fn count(&mut self) -> Option<u32> {
        self.number().map(u32::from_le_bytes)
    }

    /// A compressed sum.
    pub fn fixed(&mut self) -> Option<FixedSum> {
        let doubled = u128::from_le_bytes(self.number()?);
        Some(FixedSum::from_bits((doubled >> 1) as i128 ^ -((doubled & 1) as i128)))
    }

    /// The pixels of a layer that have light, in order; a tile has `area` pixels.
    pub fn light(&mut self, area: usize) -> Option<Vec<PixelLight>> {
        let count = self.count().filter(|&count| count as usize <= area)?;
        let mut pixel =
            || Some(PixelLight { pixel: self.count()?, sums: [self.fixed()?, self.fixed()?, self.fixed()?] });
        let pixels = (0..count).map(|_| pixel()).collect::<Option<Vec<_>>>()?;
        let is_in_order = pixels.windows(2).all(|pair| pair[0].pixel < pair[1].pixel);
        (is_in_order && pixels.last().is_none_or(|last| (last.pixel as usize) < area)).then_some(pixels)
    }

    fn unit(&mut self) -> Option<UnitSum> {
        let doubled = u64::from_le_bytes(self.number()?);
        Some(UnitSum::from_bits((doubled >> 1) as i64 ^ -((doubled & 1) as i64)))
    }

    fn square(&mut self) -> Option<SquareSum> {
        let bytes: [u8; 24] = self.number()?;
        let limb = |i: usize| std::array::from_fn(|k| bytes[8 * i + k]);
        Some(SquareSum::from_bits([0, 1, 2].map(|i| u64::from_le_bytes(limb(i)))))
    }

    fn three<T>(&mut self, mut read: impl FnMut(&mut Self) -> Option<T>) -> Option<[T; 3]> {
        Some([read(self)?, read(self)?, read(self)?])
    }

    fn radiance(&mut self) -> Option<RadianceAccumulator> {
        let (count, invalid) = (self.count()?, self.count()?);
        Some(RadianceAccumulator { count, invalid, radiance: self.three(Self::fixed)? })
    }

    /// The sums of a pixel.
    pub fn pixel(&mut self) -> Option<PixelAccumulator> {
        let radiance = self.radiance()?;
        let squares = self.three(Self::square)?;
        let hits = self.count()?;
        let mut sums = PixelAccumulator { radiance, squares, hits, ..PixelAccumulator::default() };
        if hits > 0 {
            (sums.albedo, sums.normal) = (self.three(Self::unit)?, self.three(Self::unit)?);
            sums.depth = self.fixed()?;
            [sums.first_hit, sums.material, sums.object] = self.three(Self::count)?;
        }
        sums.records = self.count()?;
        Some(sums)
    }

    /// The sums of a replica.
    pub fn replica(&mut self) -> Option<ReplicaAccumulator> {
        Some(ReplicaAccumulator { pixel: self.count()?, sums: self.radiance()?, squares: self.three(Self::square)? })
    }

    /// Floats.
    pub fn floats(&mut self) -> Option<Vec<f32>> {
        let len = self.word()? as usize;
        let bytes = self.take(len.checked_mul(4)?)?;
        Some(bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::random::{RngExt, pcg32};

    fn sums(seed: u32) -> PixelAccumulator {
        let mut s = pcg32([seed, 1, 9]);
        let mut number = |limit: f32| {
            let x: f32 = s.random();
            // Zeros, negative numbers, and numbers of different magnitudes
            if x < 0.2 { 0.0 } else { (x - 0.6).signum() * limit.powf(x) }
        };
        let mut sums = PixelAccumulator::default();
        for c in 0..3 {
            sums.radiance.radiance[c].add(number(1e11));
            sums.squares[c].add_square(number(1e11));
            sums.albedo[c].add(number(4.0));
            sums.normal[c].add(number(1e-3));
        }
        sums.depth.add(number(1e5));
        (sums.radiance.count, sums.hits) = (u32::MAX >> (seed % 32), 1 + seed);
        (sums.first_hit, sums.material, sums.object, sums.records) = (seed, 2, 3, seed % 2);
        sums
    }

    #[test]
    fn what_is_written_is_read() {
        let mut encoder = Encoder::default();
        let pixels: Vec<PixelAccumulator> = (0..200).map(sums).chain([PixelAccumulator::default()]).collect();
        pixels.iter().for_each(|p| encoder.pixel(p));
        let replica = ReplicaAccumulator { pixel: 70_000, sums: pixels[9].radiance, squares: pixels[8].squares };
        encoder.replica(&replica);
        encoder.floats(&[1.0, f32::NAN, -0.0]);
        let extremes = [i128::MIN, i128::MAX, -1, 1, 1 << 120].map(FixedSum::from_bits);
        extremes.iter().for_each(|sum| encoder.fixed(sum));

        let mut decoder = Decoder::new(&encoder.bytes);
        pixels.iter().for_each(|p| assert_eq!(decoder.pixel().unwrap(), *p));
        assert_eq!(decoder.replica(), Some(replica));
        let bits: Vec<u32> = decoder.floats().unwrap().iter().map(|v| v.to_bits()).collect();
        assert_eq!(bits, [1.0, f32::NAN, -0.0].map(f32::to_bits));
        extremes.iter().for_each(|sum| assert_eq!(decoder.fixed().unwrap(), *sum));
        assert!(decoder.is_at_end());
    }

    #[test]
    fn bytes_that_end_early_or_mean_nothing_are_refused() {
        let mut encoder = Encoder::default();
        encoder.pixel(&sums(5));
        for end in 0..encoder.bytes.len() {
            assert_eq!(Decoder::new(&encoder.bytes[..end]).pixel(), None);
        }
        // An integer of more than four bytes; more floats than bytes
        assert_eq!(Decoder::new(&[5, 1, 1, 1, 1, 1]).count(), None);
        assert_eq!(Decoder::new(&[1 | 3 << 5, 1]).count(), None);
        assert_eq!(Decoder::new(&[0xff; 64]).floats(), None);
    }
}

//! Lossless compression of the exact sums of the pixels of a tile.
//!
//! Neighbouring pixels have sums of similar magnitude, with similar numbers of leading zeros. If their samples are f32
//! numbers of similar exponents, they have similar numbers of trailing zeros as well. So each sum of
//! [`PixelAccumulator`] is a column: its minimum, the number of common trailing zero bits, and the remainder of each
//! value, in the bytes of the largest remainder. A column of equal numbers has no remainders.
//!
//! A tile is unpacked while samples are added to it, and packed again afterwards.

use super::accumulator::PixelAccumulator;
use super::fixed_sums::{FixedSum, SquareSum, UnitSum};
use std::ops::Range;

/// Padding after the last column (bytes), since values are read eight or sixteen bytes at a time.
pub(super) const PADDING: usize = 16;
/// Granularity of allocations (bytes), so that data can grow a little in place.
const GRANULE: usize = 256;
/// Maximum number of binary digits of squares without common zeros. Larger squares are stored in full.
const SQUARE_DIGITS: u32 = 126;
/// Number of zeros that marks squares stored in full.
const IN_FULL: u8 = u8::MAX;

/// Packed sums of a tile; see the module. Pixels without samples take no memory.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PackedSums {
    len: usize,
    bytes: Vec<u8>,
}

impl PackedSums {
    /// `len` pixels without samples.
    pub fn new(len: usize) -> Self {
        PackedSums { len, bytes: Vec::new() }
    }

    /// Packs pixels.
    pub fn of(sums: &[PixelAccumulator]) -> Self {
        let mut packed = PackedSums::new(sums.len());
        packed.set(sums, &mut Vec::new());
        packed
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.len
    }

    /// True if there are no pixels.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Bytes of memory.
    pub fn bytes(&self) -> usize {
        self.bytes.capacity()
    }

    /// Replaces all pixels; `scratch` is a shared buffer.
    pub fn set(&mut self, sums: &[PixelAccumulator], scratch: &mut Vec<u8>) {
        scratch.clear();
        pack(sums, scratch);
        self.len = sums.len();
        replace(&mut self.bytes, scratch);
    }

    /// Reads some pixels. `out` must have the length of `pixels`.
    pub fn read(&self, pixels: Range<usize>, out: &mut [PixelAccumulator]) {
        if self.bytes.is_empty() {
            out.fill(PixelAccumulator::default());
        } else {
            unpack(&mut Reader { bytes: &self.bytes, len: self.len, pixels, at: 0 }, out);
        }
    }

    /// All pixels.
    pub fn unpacked(&self) -> Vec<PixelAccumulator> {
        let mut all = vec![PixelAccumulator::default(); self.len];
        self.read(0..self.len, &mut all);
        all
    }
}

/// Replaces stored bytes, without much excess capacity.
pub(super) fn replace(bytes: &mut Vec<u8>, new: &[u8]) {
    if bytes.capacity() < new.len() || bytes.capacity() > new.len() + 2 * GRANULE {
        // Free the old memory first, so that it can be reused
        *bytes = Vec::new();
        bytes.reserve_exact(new.len().next_multiple_of(GRANULE.min(new.len())));
    }
    bytes.clear();
    bytes.extend_from_slice(new);
}

/// Packed rows of sums. Initial zeros take no memory.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PackedRows {
    rows: usize,
    columns: usize,
    bytes: Vec<u8>,
}

impl PackedRows {
    /// Rows of zeros.
    pub fn new(rows: usize, columns: usize) -> Self {
        PackedRows { rows, columns, bytes: Vec::new() }
    }

    /// Number of sums.
    pub fn len(&self) -> usize {
        self.rows * self.columns
    }

    /// True if there are no sums.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Replaces all sums, row by row; `scratch` is a shared buffer.
    pub fn set(&mut self, sums: &[FixedSum], scratch: &mut Vec<u8>) {
        scratch.clear();
        let rows: Vec<&[FixedSum]> = sums.chunks_exact(self.columns.max(1)).collect();
        (0..self.columns).for_each(|c| pack_column(&rows, |row| row[c].bits(), scratch));
        scratch.extend([0; PADDING]);
        replace(&mut self.bytes, scratch);
    }

    /// All sums, row by row.
    pub fn unpacked(&self) -> Vec<FixedSum> {
        let mut all = vec![FixedSum::default(); self.len()];
        if !self.bytes.is_empty() {
            let mut reader = Reader { bytes: &self.bytes, len: self.rows, pixels: 0..self.rows, at: 0 };
            for c in 0..self.columns {
                reader.column(|row, bits| all[row * self.columns + c] = FixedSum::from_bits(bits));
            }
        }
        all
    }
}

/// The columns of integers, in storage order.
macro_rules! whole_numbers {
    ($each:ident) => {
        $each!(radiance.count);
        $each!(radiance.invalid);
        $each!(hits);
        $each!(first_hit);
        $each!(material);
        $each!(object);
        $each!(records);
    };
}

fn pack(sums: &[PixelAccumulator], out: &mut Vec<u8>) {
    macro_rules! each {
        ($($field:ident).+) => { pack_narrow(sums, |s| i64::from(s.$($field).+), out) };
    }
    whole_numbers!(each);
    for c in 0..3 {
        pack_column(sums, |s| s.radiance.radiance[c].bits(), out);
        pack_squares(sums, |s| s.squares[c].bits(), out);
        pack_narrow(sums, |s| s.albedo[c].bits(), out);
        pack_narrow(sums, |s| s.normal[c].bits(), out);
    }
    pack_column(sums, |s| s.depth.bits(), out);
    out.extend([0; PADDING]);
}

fn unpack(reader: &mut Reader<'_>, out: &mut [PixelAccumulator]) {
    macro_rules! each {
        ($($field:ident).+) => { reader.narrow(|i, v| out[i].$($field).+ = v as u32) };
    }
    whole_numbers!(each);
    for c in 0..3 {
        reader.column(|i, v| out[i].radiance.radiance[c] = FixedSum::from_bits(v));
        reader.squares(|i, v| out[i].squares[c] = SquareSum::from_bits(v));
        reader.narrow(|i, v| out[i].albedo[c] = UnitSum::from_bits(v));
        reader.narrow(|i, v| out[i].normal[c] = UnitSum::from_bits(v));
    }
    reader.column(|i, v| out[i].depth = FixedSum::from_bits(v));
}

/// Declares a function that appends a column of integers of a type: number of common trailing zeros, bytes per value,
/// bytes of the minimum, minimum, and remainders.
macro_rules! packer {
    ($name:ident, $number:ty, $unsigned:ty) => {
        #[inline(always)]
        pub(super) fn $name<T>(sums: &[T], value: impl Fn(&T) -> $number, out: &mut Vec<u8>) {
            let (mut least, mut greatest, mut digits) = (<$number>::MAX, <$number>::MIN, 0);
            for v in sums.iter().map(&value) {
                (least, greatest, digits) = (least.min(v), greatest.max(v), digits | v);
            }

            // Header
            let range = greatest.wrapping_sub(least) as $unsigned;
            let zeros = if range == 0 { 0 } else { digits.trailing_zeros() };
            let width = bytes_of((range >> zeros).into());
            // A negative minimum takes all 16 bytes
            let least_wide = i128::from(least);
            let head = bytes_of(least_wide as u128);
            out.extend([zeros as u8, width as u8, head as u8]);
            out.extend_from_slice(&least_wide.to_le_bytes()[..head]);

            let mut at = out.len();
            let end = at + width * sums.len();
            out.resize(end + PADDING, 0);
            let rest = |s: &T| value(s).wrapping_sub(least) as $unsigned >> zeros;
            match width {
                0 => {}
                1..=8 => sums.iter().for_each(|s| {
                    out[at..at + 8].copy_from_slice(&(rest(s) as u64).to_le_bytes());
                    at += width;
                }),
                _ => sums.iter().for_each(|s| {
                    out[at..at + 16].copy_from_slice(&u128::from(rest(s)).to_le_bytes());
                    at += width;
                }),
            }
            out.truncate(end);
        }
    };
}

packer!(pack_narrow, i64, u64);
packer!(pack_column, i128, u128);

/// Appends a column of squares: the number of common trailing zeros, and a column of the remaining digits.
#[inline(always)]
fn pack_squares(sums: &[PixelAccumulator], value: impl Fn(&PixelAccumulator) -> [u64; 3], out: &mut Vec<u8>) {
    let mut digits = [0; 3];
    for v in sums.iter().map(&value) {
        digits.iter_mut().zip(v).for_each(|(all, limb)| *all |= limb);
    }
    let [low, middle, high] = digits;
    let below = u128::from(low) | u128::from(middle) << 64;
    let above = u128::from(middle) | u128::from(high) << 64;
    let zeros = if below == 0 { 128 + high.trailing_zeros().min(63) } else { below.trailing_zeros() };
    let end = if above == 0 { 64 - low.leading_zeros() } else { 192 - above.leading_zeros() };
    if end.saturating_sub(zeros) <= SQUARE_DIGITS {
        out.push(zeros as u8);
        pack_column(sums, |s| without_zeros(value(s), zeros) as i128, out);
    } else {
        out.push(IN_FULL);
        sums.iter().flat_map(value).for_each(|limb| out.extend(limb.to_le_bytes()));
    }
}

/// The lower 128 bits of a number shifted right by `zeros` < 192.
#[inline(always)]
fn without_zeros([low, middle, high]: [u64; 3], zeros: u32) -> u128 {
    let below = u128::from(low) | u128::from(middle) << 64;
    match zeros {
        0 => below,
        1..128 => below >> zeros | u128::from(high) << (128 - zeros),
        _ => u128::from(high >> (zeros - 128)),
    }
}

/// The inverse of [`without_zeros`].
#[inline(always)]
fn with_zeros(rest: u128, zeros: u32) -> [u64; 3] {
    match zeros {
        0..64 => {
            let below = rest << zeros;
            let high = if zeros == 0 { 0 } else { (rest >> (128 - zeros)) as u64 };
            [below as u64, (below >> 64) as u64, high]
        }
        64..128 => {
            let above = rest << (zeros - 64);
            [0, above as u64, (above >> 64) as u64]
        }
        _ => [0, 0, (rest as u64) << (zeros - 128)],
    }
}

/// Number of bytes of a number.
fn bytes_of(v: u128) -> usize {
    (128 - v.leading_zeros()).div_ceil(8) as usize
}

/// Reads consecutive columns.
pub(super) struct Reader<'a> {
    pub(super) bytes: &'a [u8],
    /// Number of values of a column.
    pub(super) len: usize,
    /// Range of values to read.
    pub(super) pixels: Range<usize>,
    pub(super) at: usize,
}

/// Header of a column.
struct ColumnHead {
    /// Number of common trailing zeros.
    zeros: usize,
    /// Bytes per value.
    width: usize,
    /// Minimum.
    least: i128,
    /// Position of the first value.
    start: usize,
}

impl Reader<'_> {
    fn byte(&mut self) -> usize {
        self.at += 1;
        self.bytes[self.at - 1].into()
    }

    /// Reads the header of a column, and continues after the column.
    fn head(&mut self) -> ColumnHead {
        let (zeros, width, head) = (self.byte(), self.byte(), self.byte());
        let mut least = [0; 16];
        least[..head].copy_from_slice(&self.bytes[self.at..self.at + head]);
        let start = self.at + head + width * self.pixels.start;
        self.at += head + width * self.len;
        ColumnHead { zeros, width, least: i128::from_le_bytes(least), start }
    }

    /// Passes the values of a column of 64-bit numbers to `set`.
    #[inline(always)]
    fn narrow(&mut self, mut set: impl FnMut(usize, i64)) {
        let ColumnHead { zeros, width, least, start } = self.head();
        let least = least as i64;
        if width == 0 {
            return (0..self.pixels.len()).for_each(|i| set(i, least));
        }
        let mask = u64::MAX >> (64 - 8 * width);
        for i in 0..self.pixels.len() {
            set(i, least.wrapping_add(((self.word(start + i * width) & mask) << zeros) as i64));
        }
    }

    /// Passes the values of a column of 128-bit numbers to `set`.
    #[inline(always)]
    pub(super) fn column(&mut self, mut set: impl FnMut(usize, i128)) {
        let ColumnHead { zeros, width, least, start } = self.head();
        let count = self.pixels.len();
        let value = |rest: u128| least.wrapping_add((rest << zeros) as i128);

        // Minimum plus remainder, by the bytes per value
        match width {
            0 => (0..count).for_each(|i| set(i, least)),
            1..=8 => {
                let mask = u64::MAX >> (64 - 8 * width);
                (0..count).for_each(|i| set(i, value((self.word(start + i * width) & mask).into())));
            }
            _ => {
                let mask = u128::MAX >> (128 - 8 * width);
                for i in 0..count {
                    let at = start + i * width;
                    let number = u128::from(self.word(at)) | u128::from(self.word(at + 8)) << 64;
                    set(i, value(number & mask));
                }
            }
        }
    }

    /// Eight bytes at a position.
    #[inline(always)]
    fn word(&self, at: usize) -> u64 {
        self.bytes[at..].first_chunk().map_or(0, |bytes| u64::from_le_bytes(*bytes))
    }

    /// Passes the values of a column of squares to `set`.
    #[inline(always)]
    fn squares(&mut self, mut set: impl FnMut(usize, [u64; 3])) {
        let zeros = self.byte();
        if zeros != usize::from(IN_FULL) {
            return self.column(|i, rest| set(i, with_zeros(rest as u128, zeros as u32)));
        }
        let limbs = self.bytes[self.at..].as_chunks::<8>().0;
        for (i, pixel) in self.pixels.clone().enumerate() {
            set(i, [0, 1, 2].map(|k| u64::from_le_bytes(limbs[3 * pixel + k])));
        }
        self.at += 24 * self.len;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Features, PixelSample};
    use lumiris_numbers::math::{Rgb, Vec3};
    use lumiris_test_support::random::{RngExt, pcg32};

    /// Pixels with samples of many magnitudes, or of similar ones.
    fn pixels(seed: u32, count: usize, range: f32) -> Vec<PixelAccumulator> {
        // Up to 8 samples per pixel, some without features
        let mut s = pcg32([seed, 4, 2]);
        let pixel = |_| {
            let mut sums = PixelAccumulator::default();
            for i in 0..s.random::<u32>() % 9 {
                let [a, b, c, d] = s.random::<[f32; 4]>();
                let value = (b - 0.2).signum() * (range * (a - 0.5)).exp2();
                let features = Features {
                    albedo: Rgb::new(a, b, c),
                    normal: Vec3::new(a - 0.5, b - 0.5, c),
                    depth: 100.0 * d,
                    material: i,
                    object: 1000 * i,
                };
                let radiance = Rgb::new(value, value * c, d);
                sums.add(
                    i,
                    &PixelSample { radiance, features: (c < 0.7).then_some(features), ..PixelSample::default() },
                );
            }
            sums.records = s.random::<u32>() >> 30;
            sums
        };
        (0..count).map(pixel).collect()
    }

    #[test]
    fn what_is_packed_is_unpacked_in_whole_and_in_part() {
        for (seed, range) in [(1, 1.0), (2, 10.0), (3, 40.0), (4, 76.0)] {
            for count in [1, 7, 256] {
                let all = pixels(seed, count, range);
                let packed = PackedSums::of(&all);
                assert!(packed.unpacked() == all, "{seed} {count}");
                let part = count / 3..count - count / 4;
                let mut some = vec![all[0]; part.len()];
                packed.read(part.clone(), &mut some);
                assert!(some == all[part], "{seed} {count}");
            }
        }
        assert_eq!(PackedSums::new(3).unpacked(), [PixelAccumulator::default(); 3]);
        assert_eq!(PackedSums::new(3).bytes(), 0);
    }

    #[test]
    fn extremes_are_kept() {
        let mut sums = vec![PixelAccumulator::default(); 5];
        let squares = [[u64::MAX; 3], [1, 0, 0], [0, 0, 1 << 63], [0, 1 << 20, 0], [0; 3]];
        for (i, sums) in sums.iter_mut().enumerate() {
            let fixed = [i128::MIN, i128::MAX, -1, 1, 1 << 120][i];
            sums.radiance.radiance =
                [FixedSum::from_bits(fixed), FixedSum::from_bits(-8), FixedSum::from_bits(fixed / 9)];
            sums.depth = FixedSum::from_bits(16 * i as i128);
            sums.albedo[1] = UnitSum::from_bits([i64::MIN, i64::MAX, 0, 1, -1][i]);
            sums.squares =
                [squares[i], squares[i].map(|v| v & 0xff00), [0, 0, squares[i][2] & 0xf0]].map(SquareSum::from_bits);
            (sums.radiance.count, sums.first_hit) = (u32::MAX - i as u32, u32::MAX >> i);
        }
        for len in 1..=5 {
            for start in 0..=5 - len {
                assert!(PackedSums::of(&sums[start..start + len]).unpacked() == sums[start..start + len]);
            }
        }
    }

    #[test]
    fn rows_are_kept() {
        let mut s = pcg32([8, 4, 2]);
        for (rows, columns) in [(1, 1), (256, 7), (300, 3)] {
            let bits = |shift: u32, bits: u128| FixedSum::from_bits((bits >> shift) as i128);
            let sums: Vec<FixedSum> =
                (0..rows * columns).map(|i| bits(20 * (i % columns) as u32 % 128, s.random())).collect();
            let mut packed = PackedRows::new(rows, columns);
            assert!(packed.unpacked().iter().all(|sum| *sum == FixedSum::default()));
            packed.set(&sums, &mut Vec::new());
            assert!(packed.unpacked() == sums, "{rows} {columns}");
        }
    }

    #[test]
    fn squares_lose_and_regain_their_zeros() {
        for zeros in 0..192 {
            let digits = if zeros < 66 { SQUARE_DIGITS } else { 192 - zeros };
            for rest in [1, u128::MAX >> (128 - digits)] {
                assert_eq!(without_zeros(with_zeros(rest, zeros), zeros), rest, "{zeros}");
            }
        }
    }

    #[test]
    fn pixels_alike_take_a_fraction_of_the_memory() {
        let packed = PackedSums::of(&pixels(5, 256, 4.0));
        let bytes = packed.bytes() / 256;
        // Radiance 5 each, squares 8 each, features 4 each, counts
        assert!(bytes < 85, "{bytes} of 216");
        let mut sums = packed.unpacked();
        sums.iter_mut().for_each(|s| (s.albedo, s.normal, s.squares) = Default::default());
        let mut less = packed.clone();
        less.set(&sums, &mut Vec::new());
        assert!(less.bytes() < packed.bytes() / 2, "memory is given back");
    }
}

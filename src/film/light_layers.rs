//! Light-group layers of a tile: exact sums of the radiance of the pixels that a group lights.
//!
//! A layer has the samples of the image, so their numbers are not stored again. A layer without light takes no memory.
//! Any other is a block: a bit per pixel that tells if there is light, then the columns of these pixels as in
//! [`super::packed`].

use super::fixed_sums::{FixedSum, LIMIT};
use super::packed::{PADDING, Reader, pack_column, replace};
use lumiris_numbers::math::Rgb;
use std::ops::Range;

/// Σ radiance of a pixel.
pub type LightSums = [FixedSum; 3];

/// The radiance of a layer in a sample.
#[derive(Clone, Copy, Debug)]
pub struct LayerSample {
    /// Index of the pixel.
    pub pixel: u32,
    /// Radiance.
    pub radiance: Rgb,
}

/// The sums of a layer in a pixel.
#[derive(Clone, Copy, Debug)]
pub struct PixelLight {
    /// Index of the pixel.
    pub pixel: u32,
    /// Sums of the radiance.
    pub sums: LightSums,
}

impl PixelLight {
    fn black(pixel: usize) -> Self {
        PixelLight { pixel: pixel as u32, sums: LightSums::default() }
    }
}

/// Packed layers of a tile; see the module.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PackedLayers {
    /// Number of pixels.
    pixels: usize,
    /// The block of each layer; empty without light.
    blocks: Vec<Vec<u8>>,
}

/// Buffers to change layers with.
#[derive(Debug, Default)]
pub struct LayerScratch {
    sums: Vec<LightSums>,
    lit: Vec<LightSums>,
    bytes: Vec<u8>,
}

impl PackedLayers {
    /// `count` layers of `pixels` pixels without light.
    pub fn new(count: usize, pixels: usize) -> Self {
        PackedLayers { pixels, blocks: vec![Vec::new(); count] }
    }

    /// Number of layers.
    pub fn len(&self) -> usize {
        self.blocks.len()
    }

    /// True if there are no layers.
    pub fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    /// Bytes of memory.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.blocks[..]) + self.blocks.iter().map(Vec::capacity).sum::<usize>()
    }

    /// Adds the radiance of samples. Radiance that is not finite, or beyond [`LIMIT`], counts as black.
    pub fn add(&mut self, layer: usize, samples: &[LayerSample], scratch: &mut LayerScratch) {
        self.change(layer, scratch, |sums| {
            for &LayerSample { pixel, radiance } in samples {
                let channels = radiance.to_array();
                // False for NaN
                if channels.iter().all(|value| value.abs() < LIMIT) {
                    sums[pixel as usize].iter_mut().zip(channels).for_each(|(sum, value)| sum.add(value));
                }
            }
        });
    }

    /// Adds the sums of some pixels.
    pub fn merge(&mut self, layer: usize, pixels: &[PixelLight], scratch: &mut LayerScratch) {
        self.change(layer, scratch, |sums| {
            for PixelLight { pixel, sums: more } in pixels {
                sums[*pixel as usize].iter_mut().zip(more).for_each(|(sum, more)| sum.merge(more));
            }
        });
    }

    /// Changes the sums of a layer.
    fn change(&mut self, layer: usize, scratch: &mut LayerScratch, change: impl FnOnce(&mut [LightSums])) {
        let LayerScratch { sums, lit, bytes } = scratch;
        sums.resize(self.pixels, LightSums::default());
        self.read(layer, 0..self.pixels, sums);
        change(sums);

        // Pack the pixels with light
        bytes.clear();
        bytes.resize(mask_bytes(self.pixels), 0);
        lit.clear();
        for (pixel, sums) in sums.iter().enumerate().filter(|(_, sums)| **sums != LightSums::default()) {
            bytes[pixel / 8] |= 1 << (pixel % 8);
            lit.push(*sums);
        }
        if lit.is_empty() {
            self.blocks[layer] = Vec::new();
            return;
        }
        (0..3).for_each(|c| pack_column(lit, |sums| sums[c].bits(), bytes));
        bytes.extend([0; PADDING]);
        replace(&mut self.blocks[layer], bytes);
    }

    /// Reads some pixels of a layer. `out` must have the length of `pixels`.
    pub fn read(&self, layer: usize, pixels: Range<usize>, out: &mut [LightSums]) {
        out.fill(LightSums::default());
        let start = pixels.start;
        self.lit(layer, pixels).into_iter().for_each(|lit| out[lit.pixel as usize - start] = lit.sums);
    }

    /// Those of the given pixels that have light in a layer, in order.
    pub fn lit(&self, layer: usize, pixels: Range<usize>) -> Vec<PixelLight> {
        // Their bits
        let block = &self.blocks[layer];
        let Some((mask, _)) = block.split_at_checked(mask_bytes(self.pixels)).filter(|_| !block.is_empty()) else {
            return Vec::new();
        };
        let is_lit = |pixel: &usize| mask[pixel / 8] >> (pixel % 8) & 1 == 1;
        let mut lit = Vec::with_capacity(pixels.len());
        lit.extend(pixels.clone().filter(is_lit).map(PixelLight::black));

        // Their sums
        let count: usize = mask.iter().map(|bits| bits.count_ones() as usize).sum();
        let first = (0..pixels.start).filter(is_lit).count();
        let mut reader = Reader { bytes: block, len: count, pixels: first..first + lit.len(), at: mask.len() };
        (0..3).for_each(|c| reader.column(|i, bits| lit[i].sums[c] = FixedSum::from_bits(bits)));
        lit
    }
}

/// Bytes of a bit per pixel.
fn mask_bytes(pixels: usize) -> usize {
    pixels.div_ceil(8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::accumulator::RadianceAccumulator;
    use lumiris_test_support::random::{RngExt, pcg32};

    #[test]
    fn sparse_layers_have_the_sums_of_dense_ones() {
        let (count, pixels, mut s) = (5, 200, pcg32([6, 1, 1]));
        let mut layers = PackedLayers::new(count, pixels);
        let mut dense = vec![vec![RadianceAccumulator::default(); pixels]; count];
        let mut scratch = LayerScratch::default();
        for _ in 0..40 {
            // Few or many pixels; negative, huge and invalid values
            let layer = s.random::<u32>() as usize % count;
            let mut value = || match s.random::<u32>() % 40 {
                0 => [f32::NAN, f32::INFINITY, 5e11, -5e11, 1e-45][s.random::<u32>() as usize % 5],
                _ => (s.random::<f32>() - 0.3) * (30.0 * (s.random::<f32>() - 0.5)).exp2(),
            };
            let values: Vec<Rgb> = (0..300).map(|_| Rgb::new(value(), value(), value())).collect();
            let samples = values.into_iter().take(1 + s.random::<u32>() as usize % 300);
            let samples: Vec<_> =
                samples.map(|radiance| LayerSample { pixel: s.random::<u32>() % pixels as u32, radiance }).collect();
            samples.iter().for_each(|sample| {
                dense[layer][sample.pixel as usize].add(sample.radiance);
            });
            layers.add(layer, &samples, &mut scratch);

            // Read a part of them
            let part = s.random::<u32>() as usize % 100..100 + s.random::<u32>() as usize % 101;
            for (layer, dense) in dense.iter().enumerate() {
                let mut sums = vec![[FixedSum::from_bits(7); 3]; part.len()];
                layers.read(layer, part.clone(), &mut sums);
                assert!(sums.iter().zip(&dense[part.clone()]).all(|(sums, dense)| *sums == dense.radiance));
            }
        }

        // Merge them with themselves
        let mut merged = layers.clone();
        for (layer, dense) in dense.iter_mut().enumerate() {
            merged.merge(layer, &layers.lit(layer, 0..pixels), &mut scratch);
            let mut sums = vec![LightSums::default(); pixels];
            merged.read(layer, 0..pixels, &mut sums);
            dense.iter_mut().for_each(|sums| sums.merge(&sums.clone()));
            assert!(sums.iter().zip(&*dense).all(|(sums, dense)| *sums == dense.radiance));
        }
    }

    #[test]
    fn layers_without_light_have_no_block() {
        let mut layers = PackedLayers::new(100, 256);
        let least = layers.bytes();
        assert!(least <= 100 * 256 / 8, "{least} bytes");
        let mut scratch = LayerScratch::default();
        let light = Rgb::splat(0.5);
        let at_9 = |radiance| LayerSample { pixel: 9, radiance };
        layers.add(3, &[at_9(Rgb::BLACK), at_9(Rgb::splat(f32::NAN))], &mut scratch);
        layers.add(5, &[at_9(light), at_9(light * -1.0)], &mut scratch);
        assert_eq!(layers, PackedLayers::new(100, 256));
        layers.add(7, &[at_9(light)], &mut scratch);
        assert!(layers.bytes() < least + 200);
        assert!((0..100).all(|layer| layers.lit(layer, 0..256).len() == usize::from(layer == 7)));
    }
}

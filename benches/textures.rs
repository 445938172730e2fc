//! Time per lookup of an image texture (ns): at random points, independent or each dependent on the last value, and at
//! points of neighbouring pixels.
//!
//! `cargo bench --bench textures -- [part of a name]`
#![allow(clippy::print_stdout, missing_docs)]

use lumiris::imaging::{ColorEncoding, Filter, Image, MipMap, Wrap};
use lumiris_numbers::math::Vec2;
use lumiris_test_support::random::{RngExt, pcg32};
use std::hint::black_box;
use std::time::Instant;

/// Lookups per measurement: few enough that most measurements are not interrupted.
const LOOKUPS: usize = 2048;
/// Number of measurements.
const RUNS: usize = 201;

/// An 8-bit image in which neighbouring bytes differ.
fn image(size: [usize; 2], channels: &[&str]) -> Image {
    let mut image = Image::new(size[0], size[1], channels);
    image.data.iter_mut().enumerate().for_each(|(i, v)| *v = (i * 31 % 251) as f32 / 255.0);
    image
}

/// Median time of a lookup (ns). If `is_dependent`, each point depends on the last value.
fn time(map: &MipMap, points: &[Vec2], width: Vec2, is_dependent: bool) -> f64 {
    let mut times: Vec<f64> = points
        .chunks_exact(LOOKUPS)
        .map(|points| {
            let (mut sum, mut last) = (0.0, 0.0);
            let start = Instant::now();
            for &st in points {
                let value = map.lookup(if is_dependent { st + last * 1e-30 } else { st }, width);
                last = value.r;
                sum += value.g;
            }
            black_box(sum);
            start.elapsed().as_secs_f64() * 1e9 / LOOKUPS as f64
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn main() {
    // Random points
    let wanted = std::env::args().skip(1).find(|a| !a.starts_with('-')).unwrap_or_default();
    let mut stream = pcg32([1, 2, 3]);
    let random: Vec<Vec2> = (0..LOOKUPS * RUNS).map(|_| Vec2::from(stream.random::<[f32; 2]>())).collect();
    let rgb: &[&str] = &["R", "G", "B"];

    // Sizes and filters
    for (size, channels) in [([4096; 2], rgb), ([1600, 1200], rgb), ([512; 2], rgb), ([4096; 2], &["Y"])] {
        let image = image(size, channels);
        let texel = 1.0 / Vec2::new(size[0] as f32, size[1] as f32);
        let pixel = |i: usize| (Vec2::new((i % 64) as f32, (i / 64 % 64) as f32) + 0.3) * 0.9 * texel;
        let coherent: Vec<Vec2> = (0..LOOKUPS * RUNS).map(pixel).collect();
        let repeated: Vec<Vec2> = random.iter().map(|&st| st * 4.0).collect();
        for (filter, width) in [(Filter::Bilinear, 0.0), (Filter::Trilinear, 3.0)] {
            let name = format!("{}×{} {} {filter:?}", size[0], size[1], channels.concat());
            if !name.contains(&wanted) {
                continue;
            }
            let map = MipMap::new(&image, Wrap::Repeat, filter, ColorEncoding::Srgb);
            let time = |points: &[Vec2], is_dependent| time(&map, points, width * texel, is_dependent);
            let (all, repeats, apart, near) =
                (time(&random, false), time(&repeated, false), time(&random, true), time(&coherent, false));
            println!(
                "{name:24} random {all:6.1} ns, repeated 4 × 4 {repeats:6.1} ns, one after the other {apart:6.1} ns, \
                 neighbours {near:6.1} ns"
            );
        }
    }
}

//! Gradient noise [Perlin 2002] over integer hashes, and sums of its octaves. Period-free, deterministic, in −1..1.

use lumiris_numbers::math::Vec3;

/// A hash of a lattice point.
#[inline]
fn hash(x: i32, y: i32, z: i32, seed: u32) -> u32 {
    let mut h = seed
        ^ (x as u32).wrapping_mul(0x8da6_b343)
        ^ (y as u32).wrapping_mul(0xd816_3841)
        ^ (z as u32).wrapping_mul(0xcb1a_b31f);
    h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
    h = (h ^ (h >> 12)).wrapping_mul(0x297a_2d39);
    h ^ (h >> 15)
}

/// The inner product of `v` with one of the twelve edge directions of a cube.
#[inline]
fn gradient(hash: u32, v: Vec3) -> f32 {
    let h = hash & 15;
    let a = if h < 8 { v.x } else { v.y };
    let b = match h {
        0..4 => v.y,
        12 | 14 => v.x,
        _ => v.z,
    };
    (if h & 1 == 0 { a } else { -a }) + (if h & 2 == 0 { b } else { -b })
}

/// Gradient noise: continuous to the second derivative, 0 at lattice points.
pub fn noise(p: Vec3, seed: u32) -> f32 {
    // `floor` is a library call without SSE 4.1.
    let floor = |x: f32| x as i32 - i32::from(x < 0.0);
    let (x, y, z) = (floor(p.x), floor(p.y), floor(p.z));
    let f = p - Vec3::new(x as f32, y as f32, z as f32);
    let w = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let corner = |i: i32, j: i32, k: i32| {
        let offset = Vec3::new(i as f32, j as f32, k as f32);
        gradient(hash(x.wrapping_add(i), y.wrapping_add(j), z.wrapping_add(k), seed), f - offset)
    };
    let lerp = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let edge = |j, k| lerp(corner(0, j, k), corner(1, j, k), w.x);
    lerp(lerp(edge(0, 0), edge(1, 0), w.y), lerp(edge(0, 1), edge(1, 1), w.y), w.z)
}

/// Σ 2⁻ⁱ noise(2ⁱ p) over `octaves`, divided by Σ 2⁻ⁱ.
pub fn fractal(p: Vec3, octaves: u32, seed: u32) -> f32 {
    octave_sum(p, octaves, seed, |n| n)
}

/// Like [`fractal`], of 1 − 2|noise|: sharp crests.
pub fn ridged(p: Vec3, octaves: u32, seed: u32) -> f32 {
    octave_sum(p, octaves, seed, |n| 1.0 - 2.0 * n.abs())
}

fn octave_sum(p: Vec3, octaves: u32, seed: u32, shape: impl Fn(f32) -> f32) -> f32 {
    let (mut sum, mut weights, mut weight, mut q) = (0.0, 0.0, 1.0, p);
    for octave in 0..octaves {
        sum += weight * shape(noise(q, seed.wrapping_add(octave)));
        weights += weight;
        weight *= 0.5;
        // An offset separates the lattice points of the octaves, where they vanish.
        q = q * 2.0 + Vec3::new(17.31, 5.77, 11.93);
    }
    sum / weights
}

/// 0 below `a`, 1 above `b`, the cubic Hermite polynomial between.
#[inline]
pub fn smoothstep(a: f32, b: f32, x: f32) -> f32 {
    let t = ((x - a) / (b - a)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::random::{RngExt, pcg32};

    #[test]
    fn noise_is_bounded_continuous_and_of_mean_zero() {
        let mut stream = pcg32([4, 5, 6]);
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..20_000 {
            let p = Vec3::new(stream.random::<f32>(), stream.random::<f32>(), stream.random::<f32>()) * 60.0 - 30.0;
            let n = noise(p, 7);
            assert!(n.abs() <= 1.0 && ridged(p, 4, 1).abs() <= 1.0 && fractal(p, 4, 1).abs() <= 1.0);
            assert!((noise(p + Vec3::splat(1e-4), 7) - n).abs() < 2e-3);
            (sum, squares) = (sum + f64::from(n), squares + f64::from(n * n));
        }
        assert!((sum / 2e4).abs() < 0.01 && squares / 2e4 > 0.02);
        assert_eq!(noise(Vec3::new(3.0, -4.0, 5.0), 7), 0.0);
    }
}

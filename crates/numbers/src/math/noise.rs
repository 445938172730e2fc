//! Gradient noise in three dimensions [Perlin 2002], with the permutation of that paper, so that clouds match other
//! renderers.

use super::scalar::floor;
use super::{DVec3, Vec3};

/// A permutation of 0..=255.
const PERMUTATION: [u8; 256] = [
    151, 160, 137, 91, 90, 15, 131, 13, 201, 95, 96, 53, 194, 233, 7, 225, 140, 36, 103, 30, 69, 142, 8, 99, 37, 240,
    21, 10, 23, 190, 6, 148, 247, 120, 234, 75, 0, 26, 197, 62, 94, 252, 219, 203, 117, 35, 11, 32, 57, 177, 33, 88,
    237, 149, 56, 87, 174, 20, 125, 136, 171, 168, 68, 175, 74, 165, 71, 134, 139, 48, 27, 166, 77, 146, 158, 231, 83,
    111, 229, 122, 60, 211, 133, 230, 220, 105, 92, 41, 55, 46, 245, 40, 244, 102, 143, 54, 65, 25, 63, 161, 1, 216,
    80, 73, 209, 76, 132, 187, 208, 89, 18, 169, 200, 196, 135, 130, 116, 188, 159, 86, 164, 100, 109, 198, 173, 186,
    3, 64, 52, 217, 226, 250, 124, 123, 5, 202, 38, 147, 118, 126, 255, 82, 85, 212, 207, 206, 59, 227, 47, 16, 58, 17,
    182, 189, 28, 42, 223, 183, 170, 213, 119, 248, 152, 2, 44, 154, 163, 70, 221, 153, 101, 155, 167, 43, 172, 9, 129,
    22, 39, 253, 19, 98, 108, 110, 79, 113, 224, 232, 178, 185, 112, 104, 218, 246, 97, 228, 251, 34, 242, 193, 238,
    210, 144, 12, 191, 179, 162, 241, 81, 51, 145, 235, 249, 14, 239, 107, 49, 192, 214, 31, 181, 199, 106, 157, 184,
    84, 204, 176, 115, 121, 50, 45, 127, 4, 150, 254, 138, 236, 205, 93, 222, 114, 67, 29, 24, 72, 243, 141, 128, 195,
    78, 66, 215, 61, 156, 180,
];

/// Step of the differences of [`gradient`].
const DELTA: f32 = 0.01;

#[inline]
fn permuted(i: usize) -> usize {
    usize::from(PERMUTATION[i & 255])
}

/// Gradients at lattice corners: to the middles of the edges of a cube, four of them twice.
const GRADIENTS: [[f32; 3]; 16] = [
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
    [1.0, -1.0, 0.0],
    [-1.0, -1.0, 0.0],
    [1.0, 0.0, 1.0],
    [-1.0, 0.0, 1.0],
    [1.0, 0.0, -1.0],
    [-1.0, 0.0, -1.0],
    [0.0, 1.0, 1.0],
    [0.0, -1.0, 1.0],
    [0.0, 1.0, -1.0],
    [0.0, -1.0, -1.0],
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
    [0.0, 1.0, -1.0],
    [0.0, -1.0, -1.0],
];

/// ⌊x⌋ and the rest.
struct Split {
    /// ⌊x⌋ modulo 256.
    cell: usize,
    rest: f32,
}

impl Split {
    #[inline]
    fn new(x: f64) -> Self {
        let base = floor(x);
        Split { cell: (base as i64 & 255) as usize, rest: (x - base) as f32 }
    }
}

/// Noise of frequency 1 in about −1..1; it is 0 at all integer points.
pub fn noise(p: DVec3) -> f32 {
    let [x, y, z] = [p.x, p.y, p.z].map(Split::new);
    let f = Vec3::new(x.rest, y.rest, z.rest);
    // The dot product of the gradient at a lattice corner and the offset from it
    let at = |dx: usize, dy: usize, dz: usize| {
        let hash = permuted(permuted(permuted(x.cell + dx) + y.cell + dy) + z.cell + dz) & 15;
        Vec3::from_array(GRADIENTS[hash]).dot(f - Vec3::new(dx as f32, dy as f32, dz as f32))
    };
    let w = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let lerp = |t: f32, a: f32, b: f32| a + t * (b - a);
    let plane = |dz: usize| {
        let rows = [0, 1].map(|dy| lerp(w.x, at(0, dy, dz), at(1, dy, dz)));
        lerp(w.y, rows[0], rows[1])
    };
    lerp(w.z, plane(0), plane(1))
}

/// The gradient of [`noise`], by differences.
pub fn gradient(p: DVec3) -> Vec3 {
    let here = noise(p);
    let along = |axis: DVec3| noise(p + axis * f64::from(DELTA)) - here;
    Vec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z)) / DELTA
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradients_follow_the_bits_of_the_hash() {
        for (hash, gradient) in GRADIENTS.iter().enumerate() {
            // The rule of the paper, in the paper's names
            let dot = |x: f32, y: f32, z: f32| {
                let u = if hash < 8 || hash == 12 || hash == 13 { x } else { y };
                let v = if hash < 4 || hash == 12 || hash == 13 { y } else { z };
                (if hash & 1 == 0 { u } else { -u }) + if hash & 2 == 0 { v } else { -v }
            };
            assert_eq!(*gradient, [dot(1.0, 0.0, 0.0), dot(0.0, 1.0, 0.0), dot(0.0, 0.0, 1.0)], "{hash}");
        }
        assert_eq!((noise(DVec3::splat(1e19)), noise(DVec3::splat(-1e300))), (0.0, 0.0));
    }

    #[test]
    fn noise_is_continuous_vanishes_on_the_lattice_and_has_no_bias() {
        let mut seen = [false; 256];
        PERMUTATION.iter().for_each(|&i| seen[usize::from(i)] = true);
        assert!(seen.iter().all(|&s| s), "a permutation");
        let (mut sum, mut greatest) = (0.0, 0.0_f32);
        for i in 0..40_000 {
            let p = DVec3::new(f64::from(i) * 0.137 - 900.0, f64::from(i) * 0.071, f64::from(i) * 0.0913 - 7.0);
            assert_eq!(noise(p.floor()), 0.0);
            let (a, b) = (noise(p), noise(p + DVec3::splat(1e-3)));
            assert!((a - b).abs() < 1e-2, "{p} {a} {b}");
            sum += a;
            greatest = greatest.max(a.abs());
        }
        assert!((sum / 40_000.0).abs() < 0.02 && (0.6..1.1).contains(&greatest), "{sum} {greatest}");
    }
}

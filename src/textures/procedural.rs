//! Procedural textures of pbrt-v4: sums of noise, marble, and polka dots. They are point sampled: all octaves are
//! evaluated at any pixel size, and the samples of a pixel average them.

use super::context::TextureContext;
use super::mapping::Mapping2d;
use lumiris_numbers::math::noise::noise;
use lumiris_numbers::math::{DAffine3, DVec3, Rgb, Vec2};
use std::f64::consts::TAU;

/// Ratio of frequencies of successive octaves. Slightly below 2, so that the lattices have no points in common.
const LACUNARITY: f32 = 1.99;
/// Mean of an octave of |noise|.
const MEAN_OF_NOISE: f32 = 0.2;

/// Sums of noise over octaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Octaves {
    /// Number of octaves.
    pub count: u32,
    /// Amplitude of an octave relative to the one before.
    pub roughness: f32,
}

/// Noise functions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NoiseKind {
    /// Fractional Brownian motion.
    Fbm(Octaves),
    /// Turbulence: octaves of |noise|.
    Wrinkled(Octaves),
    /// Waves that are higher where the wind is stronger.
    Windy,
}

/// A float texture of noise.
#[derive(Clone, Copy, Debug)]
pub struct NoiseTexture {
    /// Kind.
    pub kind: NoiseKind,
    /// World to texture space.
    pub texture_from_world: DAffine3,
}

/// Marble: bands across y, displaced by noise.
#[derive(Clone, Copy, Debug)]
pub struct Marble {
    /// Noise.
    pub octaves: Octaves,
    /// Factor of coordinates.
    pub scale: f32,
    /// Factor of the noise.
    pub variation: f32,
    /// World to texture space.
    pub texture_from_world: DAffine3,
}

/// Disks at random positions in half of the unit cells.
#[derive(Clone, Copy, Debug)]
pub struct Dots {
    /// Cells.
    pub mapping: Mapping2d,
}

/// Bilinear interpolation between the corners of the unit square.
#[derive(Clone, Copy, Debug)]
pub struct Bilerp<T> {
    /// The square.
    pub mapping: Mapping2d,
    /// Values at (0, 0), (1, 0), (0, 1) and (1, 1).
    pub corners: [T; 4],
}

impl Octaves {
    fn sum(&self, p: DVec3, of: impl Fn(f32) -> f32) -> f32 {
        let (mut sum, mut frequency, mut amplitude) = (0.0, 1.0, 1.0);
        for _ in 0..self.count {
            sum += amplitude * of(noise(p * f64::from(frequency)));
            frequency *= LACUNARITY;
            amplitude *= self.roughness;
        }
        sum
    }

    /// Fractional Brownian motion at a point.
    pub fn fbm(&self, p: DVec3) -> f32 {
        self.sum(p, |noise| noise)
    }

    /// Turbulence at a point. The mean of the next octave is added, as in pbrt.
    pub fn turbulence(&self, p: DVec3) -> f32 {
        let next_amplitude = (0..self.count).fold(1.0, |amplitude, _| amplitude * self.roughness);
        self.sum(p, f32::abs) + next_amplitude * MEAN_OF_NOISE
    }
}

impl NoiseTexture {
    /// The value at a point.
    pub fn value(&self, ctx: &TextureContext) -> f32 {
        let p = self.texture_from_world.transform_point3(ctx.p);
        match self.kind {
            NoiseKind::Fbm(octaves) => octaves.fbm(p),
            NoiseKind::Wrinkled(octaves) => octaves.turbulence(p),
            NoiseKind::Windy => {
                let octaves = |count| Octaves { count, roughness: 0.5 };
                octaves(3).fbm(p * 0.1).abs() * octaves(6).fbm(p)
            }
        }
    }
}

/// Control points of the colour spline of marble, Rec.709.
const MARBLE: [[f32; 3]; 9] = [
    [0.58, 0.58, 0.6],
    [0.58, 0.58, 0.6],
    [0.58, 0.58, 0.6],
    [0.5, 0.5, 0.5],
    [0.6, 0.59, 0.58],
    [0.58, 0.58, 0.6],
    [0.58, 0.58, 0.6],
    [0.2, 0.2, 0.33],
    [0.58, 0.58, 0.6],
];
/// Factor of the spline's colours.
const MARBLE_BRIGHTNESS: f32 = 1.5;

impl Marble {
    /// The colour at a point.
    pub fn color(&self, ctx: &TextureContext) -> Rgb {
        let p = self.texture_from_world.transform_point3(ctx.p) * f64::from(self.scale);
        // Without whole periods of the sine, f32 resolves the phase
        let band = ((p.y + f64::from(self.variation * self.octaves.fbm(p))) % TAU) as f32;
        // Six cubic Bézier curves, each over four successive points
        let segments = (MARBLE.len() - 3) as f32;
        let t = (0.5 + 0.5 * band.sin()) * segments;
        let first = t.floor().clamp(0.0, segments - 1.0);
        let t = t - first;
        let s = 1.0 - t;
        let weights = [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t];
        let color = |c: usize| (0..4).map(|k| weights[k] * MARBLE[first as usize + k][c]).sum::<f32>();
        Rgb::new(color(0), color(1), color(2)) * MARBLE_BRIGHTNESS
    }
}

/// Radius of a dot.
const DOT_RADIUS: f32 = 0.35;

impl Dots {
    /// True inside a dot.
    pub fn is_inside(&self, ctx: &TextureContext) -> bool {
        let st = self.mapping.st(ctx);
        let cell = (st + 0.5).floor();
        let noise_at = |dx: f64, dy: f64| noise(DVec3::new(cell.x + dx, cell.y + dy, 0.5));
        if noise_at(0.5, 0.5) <= 0.0 {
            return false;
        }
        let shift = Vec2::new(noise_at(1.5, 2.8), noise_at(4.5, 9.8)) * (0.5 - DOT_RADIUS);
        ((st - cell).as_vec2() - shift).length_squared() < DOT_RADIUS * DOT_RADIUS
    }
}

impl<T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f32, Output = T>> Bilerp<T> {
    /// The value at a point.
    pub fn value(&self, ctx: &TextureContext) -> T {
        let Vec2 { x, y } = self.mapping.st(ctx).as_vec2();
        let [a, b, c, d] = self.corners;
        (a * (1.0 - x) + b * x) * (1.0 - y) + (c * (1.0 - x) + d * x) * y
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_numbers::math::Vec3;

    fn at(p: Vec3) -> TextureContext {
        let uv = p.truncate();
        TextureContext {
            uv,
            uv_width: Vec2::ZERO,
            uv1: Vec2::ZERO,
            color: [1.0; 4],
            face: 0,
            p: p.as_dvec3(),
            n: Vec3::Z,
        }
    }

    fn points() -> impl Iterator<Item = Vec3> {
        (0..20_000_u16).map(|i| Vec3::new(f32::from(i) * 0.137, f32::from(i) * 0.0713 - 40.0, f32::from(i) * 0.0391))
    }

    #[test]
    fn one_octave_is_noise_and_more_add_less_and_less() {
        let octaves = |count| Octaves { count, roughness: 0.5 };
        let mut mean = 0.0;
        for p in points() {
            let p = p.as_dvec3();
            assert_eq!(octaves(1).fbm(p), noise(p));
            assert_eq!(octaves(0).fbm(p), 0.0);
            let (few, many) = (octaves(4).fbm(p), octaves(9).fbm(p));
            assert!((few - many).abs() < 0.13, "the rest is at most 1/16 + 1/32 + …: {few} {many}");
            assert!(
                (octaves(2).turbulence(p) - noise(p).abs() - 0.5 * noise(p * f64::from(LACUNARITY)).abs() - 0.05).abs()
                    < 1e-6
            );
            mean += octaves(1).turbulence(p) - 0.1;
        }
        // The mean that replaces omitted octaves
        assert!((mean / 20_000.0 - MEAN_OF_NOISE).abs() < 0.06, "{}", mean / 20_000.0);
    }

    #[test]
    fn marble_has_the_colours_of_its_spline() {
        let octaves = Octaves { count: 8, roughness: 0.5 };
        let marble = |variation| Marble { octaves, scale: 1.0, variation, texture_from_world: DAffine3::IDENTITY };
        // The sine is −1 and 1, and 0, which is the first point of the fourth curve
        let of = |y: f32| marble(0.0).color(&at(Vec3::Y * y)).to_array();
        let half = std::f32::consts::FRAC_PI_2;
        for (y, expected) in [(-half, MARBLE[0]), (half, MARBLE[8]), (0.0, MARBLE[3])] {
            let off = of(y).iter().zip(expected).map(|(a, b)| (a - 1.5 * b).abs()).fold(0.0, f32::max);
            assert!(off < 1e-5, "{y}: {:?}", of(y));
        }
        let differs = points().filter(|p| marble(0.2).color(&at(*p)) != marble(0.0).color(&at(*p))).count();
        assert!(differs > 19_000, "{differs}");
    }

    #[test]
    fn dots_fill_some_cells_and_stay_within_them() {
        let dots = Dots { mapping: Mapping2d::default() };
        let n = 40;
        let (mut inside, mut full) = (0, 0);
        for cell in 0..400 {
            let corner = Vec2::new((cell % 20) as f32 - 10.5, (cell / 20) as f32 - 10.5);
            let place = |k: i32| corner + Vec2::new((k % n) as f32 + 0.5, (k / n) as f32 + 0.5) / n as f32;
            let hits = (0..n * n).filter(|&k| dots.is_inside(&at(place(k).extend(0.0)))).count();
            inside += hits;
            full += usize::from(hits > 0);
        }
        let area = inside as f32 / full as f32 / (n * n) as f32;
        assert!((area - std::f32::consts::PI * DOT_RADIUS * DOT_RADIUS).abs() < 0.004, "whole disks: {area}");
        assert!((100..300).contains(&full), "{full} of 400 cells");
    }

    #[test]
    fn corners_of_squares_have_their_values() {
        let texture = Bilerp { mapping: Mapping2d::default(), corners: [1.0, 2.0, 3.0, 8.0] };
        let value = |x, y| texture.value(&at(Vec3::new(x, y, 0.0)));
        assert_eq!([value(0.0, 0.0), value(1.0, 0.0), value(0.0, 1.0), value(1.0, 1.0)], [1.0, 2.0, 3.0, 8.0]);
        assert_eq!(value(0.5, 0.5), 3.5);
    }
}

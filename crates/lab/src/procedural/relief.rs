//! Carved reliefs: heights above the surface of a solid, as functions of the position on it.

use super::gradient_noise::{fractal, noise, ridged, smoothstep};
use lumiris_numbers::math::Vec3;
use std::f32::consts::{PI, TAU};

/// A position on a solid.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    /// The point.
    pub p: Vec3,
    /// Angle around the axis, −π..π; 0 is the back of an animal.
    pub angle: f32,
    /// Coordinate along the axis: in radii for strokes, z for solids of revolution.
    pub along: f32,
    /// Radius.
    pub radius: f32,
}

/// The kind of relief.
#[derive(Clone, Copy, Debug)]
pub enum Relief {
    /// Overlapping scales, and plates on the belly.
    Scales {
        /// Scales around the body.
        around: f32,
        /// Height over the radius of the body.
        height: f32,
    },
    /// Rings across, as on horns.
    Rings {
        /// Rings per radius of length.
        frequency: f32,
        /// Height (units of space).
        height: f32,
    },
    /// Grooves along, as of hair.
    Strands {
        /// Grooves around.
        around: f32,
        /// Height (units of space).
        height: f32,
    },
    /// Bumps of skin.
    Skin {
        /// Height (units of space).
        height: f32,
    },
    /// The bands of the pedestal.
    Pedestal,
    /// The shaft between the coils, and its capital.
    Shaft,
    /// Rock.
    Rock {
        /// Height (units of space).
        height: f32,
    },
}

/// Largest height of scales (units of space).
const SCALE_LIMIT: f32 = 0.019;
/// Height of the weathering of all stone (units of space).
const WEATHER: f32 = 0.0022;

impl Relief {
    /// Bound of |[`height`](Self::height)|.
    pub fn amplitude(&self) -> f32 {
        WEATHER
            + match *self {
                Relief::Scales { .. } => SCALE_LIMIT,
                Relief::Rings { height, .. } | Relief::Strands { height, .. } => height,
                Relief::Skin { height } | Relief::Rock { height } => height,
                Relief::Pedestal => 0.03,
                Relief::Shaft => 0.018,
            }
    }

    /// Height of the carved surface above the solid.
    pub fn height(&self, spot: &Spot) -> f32 {
        let limit = self.amplitude() - WEATHER;
        let carved = match *self {
            Relief::Scales { around, height } => (scaly(spot, around) * height * spot.radius).min(SCALE_LIMIT),
            Relief::Rings { frequency, height } => height * ring(spot.along * frequency),
            Relief::Strands { around, height } => {
                let twist = 0.35 * spot.along + 0.8 * fractal(spot.p * 9.0, 2, 31);
                height * (around * (spot.angle + twist)).sin()
            }
            Relief::Skin { height } => height * ridged(spot.p * 38.0, 3, 11),
            Relief::Pedestal => pedestal(spot),
            Relief::Shaft => shaft(spot),
            Relief::Rock { height } => height * ridged(spot.p * 4.5, 5, 5),
        };
        carved.clamp(-limit, limit) + weathering(spot.p)
    }
}

/// Pits, and the unevenness of worked stone.
fn weathering(p: Vec3) -> f32 {
    let uneven = fractal(p * 26.0, 2, 77);
    let pits = smoothstep(0.4, 0.65, noise(p * 60.0, 99));
    WEATHER * (0.6 * uneven - 0.4 * pits)
}

/// Teeth that rise slowly and fall fast: 0..1 with period 1.
fn ring(x: f32) -> f32 {
    let t = x - x.floor();
    smoothstep(0.0, 0.2, t) * (1.0 - smoothstep(0.2, 1.0, t) * 0.9)
}

/// Scales in staggered rows whose free ends lie over the next row, plates where the belly is: 0..1.
fn scaly(spot: &Spot, around: f32) -> f32 {
    let row = -spot.along * around / (TAU * 0.8);
    let column = spot.angle * around / TAU;
    let belly = smoothstep(2.25, 2.4, spot.angle.abs());
    let mut height = 0.0_f32;
    if belly < 1.0 {
        for back in 0..3 {
            let number = row.floor() - back as f32;
            height = height.max(scale(row - number, column - 0.5 * number.rem_euclid(2.0)));
        }
    }
    if belly > 0.0 {
        let plate = row * 0.55;
        let t = plate - plate.floor();
        let ledge = (0.35 + 0.5 * t) * smoothstep(0.0, 0.16, 1.0 - t);
        height += (ledge - height) * belly;
    }
    // A groove parts plates and scales.
    height * (1.0 - 0.8 * smoothstep(0.12, 0.0, (spot.angle.abs() - 2.33).abs()))
}

/// One scale: `y` from its root in rows, `x` across in scales.
fn scale(y: f32, x: f32) -> f32 {
    let x = 2.0 * (x - x.round());
    let to_tip = 1.0 - 0.55 * x * x - y / 2.1;
    if to_tip <= 0.0 {
        return 0.0;
    }
    let keel = 0.22 * (1.0 - x.abs()).max(0.0);
    let rim = 0.12 * smoothstep(0.22, 0.12, to_tip);
    (0.1 + 0.62 * y / 2.1 + keel + rim) * smoothstep(0.0, 0.09, to_tip)
}

/// Relative position in `low..high`, if inside.
fn within(x: f32, low: f32, high: f32) -> Option<f32> {
    (low..high).contains(&x).then(|| (x - low) / (high - low))
}

/// A wreath of `count` petals; `t` runs from their roots to their tips: 0..1.
fn petals(angle: f32, count: f32, t: f32) -> f32 {
    let one = |shift: f32, length: f32| {
        let x = angle * count / TAU + shift;
        let x = 2.0 * (x - x.round()).abs();
        let width = (1.0 - (t / length).powi(3)).max(0.0) * (0.55 + 0.45 * (t * PI).sin().max(0.0));
        let inside = width - x;
        if inside <= 0.0 {
            return 0.0;
        }
        // A rim, a hollow with a second petal in it, and a rib
        let rim = smoothstep(0.0, 0.06, inside) - 0.45 * smoothstep(0.1, 0.2, inside);
        let inner = 0.45 * smoothstep(0.3, 0.42, inside);
        let rib = 0.2 * smoothstep(0.1, 0.02, x) * smoothstep(0.3, 0.5, inside);
        rim + inner + rib
    };
    (0.62 + 0.38 * t) * one(0.0, 0.98).max(0.55 * one(0.5, 1.0))
}

/// Half balls in a row: 0..1.
fn beads(angle: f32, count: f32, t: f32, aspect: f32) -> f32 {
    let x = angle * count / TAU;
    let (x, y) = (2.0 * (x - x.round()), 2.0 * t - 1.0);
    (1.0 - x * x - aspect * y * y).max(0.0).sqrt()
}

/// A key pattern, one bit for each square of a period.
const KEY: [u16; 9] = [
    0b1111_1111_1111,
    0b0000_0000_0001,
    0b0111_1111_1101,
    0b0100_0000_0101,
    0b0101_1111_0101,
    0b0101_0001_0101,
    0b0101_1101_0101,
    0b0100_0001_0101,
    0b1111_1111_0111,
];
/// Squares of the key pattern across its period.
const KEY_WIDTH: f32 = 12.0;

/// The key pattern, softened at the borders of squares: 0..1.
fn key(x: f32, t: f32) -> f32 {
    let (u, v) = ((x - x.floor()) * KEY_WIDTH - 0.5, t * KEY.len() as f32 - 0.5);
    let bit = |i: f32, j: f32| {
        if j < 0.0 || j >= KEY.len() as f32 {
            return 0.0;
        }
        f32::from(KEY[j as usize] >> (i.rem_euclid(KEY_WIDTH) as u16) & 1)
    };
    let (i, j) = (u.floor(), v.floor());
    let (fx, fy) = (smoothstep(0.3, 0.7, u - i), smoothstep(0.3, 0.7, v - j));
    let low = bit(i, j) + (bit(i + 1.0, j) - bit(i, j)) * fx;
    let high = bit(i, j + 1.0) + (bit(i + 1.0, j + 1.0) - bit(i, j + 1.0)) * fx;
    low + (high - low) * fy
}

/// The bands of the pedestal by height; [`super::dragon`] has its profile.
fn pedestal(spot: &Spot) -> f32 {
    // Petals on the upper face; the lower face is plain
    let (a, z) = (spot.angle, spot.along);
    if z > 0.445 {
        return within(spot.radius, 0.6, 0.9).map_or(0.0, |t| 0.02 * petals(a, 36.0, t));
    }
    if spot.radius < 0.5 {
        return 0.0;
    }

    // Key pattern, petals, beads and petals, from bottom to top
    if let Some(t) = within(z, 0.02, 0.1) {
        return 0.008 * key(a * 36.0 / TAU, t);
    }
    if let Some(t) = within(z, 0.125, 0.265) {
        return 0.028 * petals(a, 24.0, 1.0 - t);
    }
    if let Some(t) = within(z, 0.272, 0.302) {
        return 0.013 * beads(a, 96.0, t, 1.0);
    }
    if let Some(t) = within(z, 0.31, 0.43) {
        return 0.028 * petals(a + 0.13, 24.0, t);
    }
    0.0
}

/// A net of lozenges with a flower in each, between plain mouldings; petals on the capital.
fn shaft(spot: &Spot) -> f32 {
    if let Some(t) = within(spot.along, 2.125, 2.262) {
        return 0.016 * petals(spot.angle, 18.0, t);
    }
    if !(0.6..2.01).contains(&spot.along) {
        return 0.0;
    }
    let (u, v) = (spot.angle * 12.0 / TAU, spot.along * 5.6);
    let (p, q) = (u + v, u - v);
    let (fp, fq) = (p - p.round(), q - q.round());
    let to_edge = 0.5 - fp.abs().max(fq.abs());
    let bars = smoothstep(0.085, 0.05, to_edge) - 0.5 * smoothstep(0.03, 0.01, to_edge);
    let r = fp.hypot(fq);
    let turn = fq.atan2(fp);
    let petal = 0.3 + 0.09 * (6.0 * turn).cos();
    let flower = smoothstep(0.0, 0.05, petal - r) * (0.55 + 0.8 * r - 0.25 * smoothstep(0.5, 1.0, (6.0 * turn).cos()));
    let eye = (1.0 - (r / 0.1).powi(2)).max(0.0).sqrt();
    0.016 * (bars.max(flower).max(eye) - 0.3)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::random::{RngExt, pcg32};

    #[test]
    fn carvings_keep_their_bounds_and_have_no_seam() {
        let all = [
            Relief::Scales { around: 18.0, height: 0.1 },
            Relief::Rings { frequency: 2.0, height: 0.01 },
            Relief::Strands { around: 7.0, height: 0.01 },
            Relief::Skin { height: 0.01 },
            Relief::Pedestal,
            Relief::Shaft,
            Relief::Rock { height: 0.05 },
        ];

        // Bounds, and equal heights at both ends of the angle
        let mut stream = pcg32([1, 2, 3]);
        for relief in all {
            let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
            for _ in 0..1500 {
                let [z, u] = stream.random::<[f32; 2]>();
                let p = Vec3::new(stream.random::<f32>(), stream.random::<f32>(), z);
                let spot = Spot { p, angle: TAU * u - PI, along: z, radius: 0.7 };
                let h = relief.height(&spot);
                assert!(h.abs() <= relief.amplitude(), "{relief:?} {h}");
                (low, high) = (low.min(h), high.max(h));
                let at = |angle| relief.height(&Spot { angle, ..spot });
                assert!((at(PI) - at(-PI)).abs() < 1e-4, "{relief:?}");
            }
            assert!(high - low > 0.3 * relief.amplitude(), "{relief:?} is flat");
        }
    }
}

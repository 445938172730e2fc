//! Elementary functions of single samples and of vectors: a fixed order of additions and multiplications, so that both
//! are bit-identical.

use super::number::Number;
use super::v3::V3;
use std::f32::consts::{FRAC_PI_4, LN_2, LOG2_E, SQRT_2, TAU};

/// Sine and cosine of an angle.
#[derive(Clone, Copy, Debug)]
pub struct SinCos<N> {
    /// The sine.
    pub sin: N,
    /// The cosine.
    pub cos: N,
}

/// sin x and cos x for |x| ≤ π/4, by Chebyshev interpolation; errors below 2⁻²⁴.
#[inline(always)]
pub fn sin_cos_eighth<N: Number>(x: N) -> SinCos<N> {
    let x2 = x * x;
    let sin = ((x2 * -1.951_528_96e-4 + 8.332_161_3e-3) * x2 - 1.666_665_46e-1) * x2 * x + x;
    let cos = ((x2 * 2.443_315_71e-5 - 1.388_731_63e-3) * x2 + 4.166_664_57e-2) * x2 * x2 - x2 * 0.5 + 1.0;
    SinCos { sin, cos }
}

/// sin 2πt and cos 2πt for 0 ≤ t ≤ 1; errors below 2⁻²³.
#[inline(always)]
pub fn sin_cos_turn<N: Number>(t: N) -> SinCos<N> {
    // The nearest quarter turn, and the exact remainder.
    let quarters = (t * 4.0).nearest();
    let SinCos { sin, cos } = sin_cos_eighth((t - quarters * 0.25) * TAU);
    let (half, later) = (t.constant(0.5), t.constant(2.5));
    let from_half = (quarters - 2.0).magnitude();
    let is_odd = from_half.above(half) & t.constant(1.5).above(from_half);
    let (s, c) = (N::choose(is_odd, cos, sin), N::choose(is_odd, sin, cos));
    let is_second_half = quarters.above(t.constant(1.5)) & t.constant(3.5).above(quarters);
    let is_far_side = quarters.above(half) & later.above(quarters);
    SinCos { sin: N::choose(is_second_half, -s, s), cos: N::choose(is_far_side, -c, c) }
}

/// tan π/8.
const TAN_PI_8: f32 = 0.414_213_57;

/// atan(short/long) for 0 ≤ short ≤ long, by Chebyshev interpolation about 0 and about π/4; errors below 2⁻²². 0 where
/// both are 0.
#[inline(always)]
pub fn arctangent<N: Number>(short: N, long: N) -> N {
    let (zero, eighth) = (short.constant(0.0), short.constant(FRAC_PI_4));
    let is_steep = short.above(long * TAN_PI_8);
    let ratio = N::choose(is_steep, short - long, short) / N::choose(is_steep, short + long, long);
    let x = ratio.or_zero(long.above(zero));
    let x2 = x * x;
    let series = (((x2 * 7.902_579e-2 - 1.382_444_7e-1) * x2 + 1.997_187_9e-1) * x2 - 3.333_275_7e-1) * x2 * x + x;
    series + N::choose(is_steep, eighth, zero)
}

/// e^x for x ≤ 88, by the series about the nearest power of two; relative errors below 2⁻²², 0 up to e⁻⁸⁶.
#[inline(always)]
pub fn exp<N: Number>(x: N) -> N {
    let bounded = x.greater(x.constant(-87.0)).lesser(x.constant(88.0));
    let powers = (bounded * LOG2_E).nearest();
    // ln 2 as a sum of two numbers, the first with few digits.
    let r = bounded - powers * 0.693_359_375 + powers * 2.121_944_4e-4;
    let series =
        (((((r * (1.0 / 720.0) + 1.0 / 120.0) * r + 1.0 / 24.0) * r + 1.0 / 6.0) * r + 0.5) * r + 1.0) * r + 1.0;
    (series * powers.power_of_two()).or_zero(x.above(x.constant(-86.0)))
}

/// ln x for normal x > 0, by the area tangent series; errors below 2⁻²² of the larger of ln x and 1.
#[inline(always)]
pub fn ln<N: Number>(x: N) -> N {
    let (exponent, m) = (x.exponent(), x.significand());
    let is_large = m.above(x.constant(SQRT_2));
    let (m, exponent) = (N::choose(is_large, m * 0.5, m), N::choose(is_large, exponent + 1.0, exponent));
    let s = (m - 1.0) / (m + 1.0);
    let s2 = s * s;
    let series = (((s2 * (2.0 / 9.0) + 2.0 / 7.0) * s2 + 2.0 / 5.0) * s2 + 2.0 / 3.0) * s2 * s + s * 2.0;
    exponent * LN_2 + series
}

/// x^y for 0 ≤ x ≤ 1 and y > 0.
#[inline(always)]
pub fn power_of_fraction<N: Number>(x: N, y: N) -> N {
    let least = x.constant(f32::MIN_POSITIVE);
    exp(ln(x.greater(least)) * y).or_zero(x.above(x.constant(0.0)))
}

/// Maps the square 0..1 to the disk [Shirley and Chiu 1997].
#[inline(always)]
pub fn concentric_disk<N: Number>(u: [N; 2]) -> (N, N) {
    let (x, y) = (u[0] * 2.0 - 1.0, u[1] * 2.0 - 1.0);
    let zero = x.constant(0.0);
    let is_x = x.magnitude().above(y.magnitude());
    let (radius, other) = (N::choose(is_x, x, y), N::choose(is_x, y, x));
    let ratio = (other / radius).or_zero(radius.magnitude().above(zero));
    let SinCos { sin, cos } = sin_cos_eighth(ratio * FRAC_PI_4);
    (radius * N::choose(is_x, cos, sin), radius * N::choose(is_x, sin, cos))
}

/// A cosine-weighted direction of the upper hemisphere.
#[inline(always)]
pub fn cosine_hemisphere<N: Number>(u: [N; 2]) -> V3<N> {
    let (x, y) = concentric_disk(u);
    V3 { x, y, z: (x.constant(1.0) - x * x - y * y).safe_root() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::warp;

    #[test]
    fn functions_are_those_of_the_library() {
        for i in 0..=10_000 {
            let t = i as f32 / 10_000.0;
            let (SinCos { sin, cos }, x) = (sin_cos_turn(t), f64::from(t) * std::f64::consts::TAU);
            assert!((f64::from(sin) - x.sin()).abs() < 2e-7 && (f64::from(cos) - x.cos()).abs() < 2e-7, "{t}");
            let x = t * 173.0 - 85.5;
            assert!((f64::from(exp(x)) / f64::from(x).exp() - 1.0).abs() < 3e-7, "{x}");
            let x = exp(x);
            assert!((f64::from(ln(x)) - f64::from(x).ln()).abs() < 3e-7 * f64::from(x.ln().abs().max(1.0)), "{x}");
            let power = power_of_fraction(t, 0.37);
            assert!((power - t.powf(0.37)).abs() < 1e-6, "{t}");
            for (short, long) in [(t, 1.0), (0.3 * t, 0.3)] {
                assert!(
                    (f64::from(arctangent(short, long)) - f64::from(short).atan2(f64::from(long))).abs() < 2e-7,
                    "{t}"
                );
            }
            let (a, b) = (cosine_hemisphere([t, 0.3]), warp::sample_cosine_hemisphere([t, 0.3]));
            assert!((glam::Vec3::from(a) - b).length() < 1e-5, "{t}");
        }
        assert_eq!(arctangent(0.0, 0.0), 0.0);
        assert_eq!((exp(-90.0), power_of_fraction(0.0, 0.5), power_of_fraction(1.0, 0.5)), (0.0, 0.0, 1.0));
    }
}

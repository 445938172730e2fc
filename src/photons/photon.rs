//! A photon in 28 bytes: power, position, direction, and last scattering event.
//!
//! | bits | content |
//! |---|---|
//! | 3 × 32 | position |
//! | 28 + 28 | direction and normal, by [`lumiris_numbers::math::octahedral`]: within 2.7·10⁻⁴ rad |
//! | 8 + 3 × 12 | power: an exponent for all channels and their mantissas, as in [Ward 1991] with more bits: within 0.025 % of the largest |
//! | 2 + 26 | origin, light |

use crate::lights::LightId;
use lumiris_numbers::math::octahedral::{PACKED_BITS, pack_unit, unpack_unit};
use lumiris_numbers::math::{Rgb, Vec3};

/// Bits of a channel's mantissa.
const MANTISSA_BITS: u32 = 12;
/// Bits of a light's id.
const LIGHT_BITS: u32 = 26;
/// Stands for all lights whose id does not fit.
const NO_LIGHT: u32 = (1 << LIGHT_BITS) - 1;

/// The last scattering event of a photon. Interface materials do not count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// Straight from a light.
    Primary(LightId),
    /// The last scattering event was by a Lambertian lobe.
    Diffuse,
    /// The last scattering event was by any other lobe: a caustic.
    Caustic,
}

impl Origin {
    const PRIMARY: u32 = 0;
    const DIFFUSE: u32 = 1;
    const CAUSTIC: u32 = 2;

    fn pack(self) -> u32 {
        match self {
            Origin::Primary(light) => Self::PRIMARY | light.min(NO_LIGHT) << 2,
            Origin::Diffuse => Self::DIFFUSE | NO_LIGHT << 2,
            Origin::Caustic => Self::CAUSTIC | NO_LIGHT << 2,
        }
    }
}

/// A photon at its arrival.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Photon {
    p: [f32; 3],
    /// Direction; upper four bits: lower half of the exponent.
    wi: u32,
    /// Normal; upper four bits: upper half of the exponent.
    n: u32,
    /// Red, green, and the upper 8 bits of blue.
    rgb: u32,
    /// The lower 4 bits of blue, and the origin.
    rest: u32,
}

const _: () = assert!(size_of::<Photon>() == 28);

impl Photon {
    /// A photon at `p` that came from the direction `wi` (unit, away from the surface). `n`: geometric normal of the
    /// surface on the side of `wi`, unit. `power` (W) is not negative; NaN counts as 0.
    #[inline]
    pub fn new(p: Vec3, wi: Vec3, n: Vec3, power: Rgb, origin: Origin) -> Self {
        let PackedPower { exponent, mantissas: [r, g, b] } = pack_power(power);
        Photon {
            p: p.to_array(),
            wi: pack_unit(wi) | exponent << PACKED_BITS,
            n: pack_unit(n) | exponent >> 4 << PACKED_BITS,
            rgb: r | g << MANTISSA_BITS | b >> 4 << (2 * MANTISSA_BITS),
            rest: (b & 15) | origin.pack() << 4,
        }
    }

    /// Position of arrival.
    #[inline]
    pub fn p(&self) -> Vec3 {
        Vec3::from_array(self.p)
    }

    /// Direction towards its origin: unit, away from the surface.
    #[inline]
    pub fn wi(&self) -> Vec3 {
        unpack_unit(self.wi)
    }

    /// Geometric normal of its surface, unit, on the side of [`wi`](Self::wi).
    #[inline]
    pub fn n(&self) -> Vec3 {
        unpack_unit(self.n)
    }

    /// Its power (W).
    #[inline]
    pub fn power(&self) -> Rgb {
        let exponent = self.wi >> PACKED_BITS | self.n >> PACKED_BITS << 4;
        let mask = (1 << MANTISSA_BITS) - 1;
        let blue = self.rgb >> (2 * MANTISSA_BITS) << 4 | self.rest & 15;
        unpack_power(exponent, [self.rgb & mask, self.rgb >> MANTISSA_BITS & mask, blue])
    }

    /// Scales the power by `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f32) -> Self {
        let PackedPower { exponent, mantissas: [r, g, b] } = pack_power(self.power() * factor);
        let mask = (1 << PACKED_BITS) - 1;
        Photon {
            p: self.p,
            wi: self.wi & mask | exponent << PACKED_BITS,
            n: self.n & mask | exponent >> 4 << PACKED_BITS,
            rgb: r | g << MANTISSA_BITS | b >> 4 << (2 * MANTISSA_BITS),
            rest: (b & 15) | self.rest & !15,
        }
    }

    /// The light, for photons straight from a light. Ids from 2²⁶ − 1 on are not stored.
    #[inline]
    pub fn light(&self) -> Option<LightId> {
        let (kind, light) = (self.rest >> 4 & 3, self.rest >> 6);
        (kind == Origin::PRIMARY && light != NO_LIGHT).then_some(light)
    }

    /// True if it came straight from a light.
    #[inline]
    pub fn is_primary(&self) -> bool {
        self.rest >> 4 & 3 == Origin::PRIMARY
    }

    /// True if the last scattering event was by a non-Lambertian lobe.
    #[inline]
    pub fn is_caustic(&self) -> bool {
        self.rest >> 4 & 3 == Origin::CAUSTIC
    }
}

/// 2^e for |e| < 1000.
#[inline]
fn power_of_two(e: i32) -> f64 {
    f64::from_bits(((1023 + e) as u64) << 52)
}

/// A power with a common exponent: the f32 exponent of the largest channel.
struct PackedPower {
    exponent: u32,
    mantissas: [u32; 3],
}

/// Packs a power; powers below the smallest normal number are 0.
#[inline]
fn pack_power(power: Rgb) -> PackedPower {
    let power = power.map(|c| c.clamp(0.0, f32::MAX)).to_array().map(|c| if c.is_nan() { 0.0 } else { c });
    let largest = power[0].max(power[1]).max(power[2]);
    let exponent = largest.to_bits() >> 23;
    if exponent == 0 {
        return PackedPower { exponent: 0, mantissas: [0; 3] };
    }
    // largest is in [2^(e − 1), 2^e), e = exponent − 126; values that round up to 2^e are clamped
    let scale = power_of_two(MANTISSA_BITS as i32 + 126 - exponent as i32);
    let mantissa = |c: f32| ((f64::from(c) * scale + 0.5) as u32).min((1 << MANTISSA_BITS) - 1);
    PackedPower { exponent, mantissas: power.map(mantissa) }
}

#[inline]
fn unpack_power(exponent: u32, mantissas: [u32; 3]) -> Rgb {
    let scale = power_of_two(exponent as i32 - 126 - MANTISSA_BITS as i32);
    Rgb::from_array(mantissas.map(|m| (f64::from(m) * scale) as f32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_numbers::math::octahedral::MAX_ERROR;
    use lumiris_numbers::math::warp::sample_uniform_sphere;
    use lumiris_test_support::random::{RngExt, pcg32};

    #[test]
    fn a_photon_comes_back_as_it_was() {
        let mut stream = pcg32([2, 8, 1]);
        for i in 0..20_000 {
            let p = sample_uniform_sphere(stream.random::<[f32; 2]>()) * 1e3 * stream.random::<f32>();
            let (wi, n) = (
                sample_uniform_sphere(stream.random::<[f32; 2]>()),
                sample_uniform_sphere(stream.random::<[f32; 2]>()),
            );
            let size = 2.0_f32.powf(240.0 * stream.random::<f32>() - 120.0);
            let power = Rgb::new(stream.random::<f32>(), stream.random::<f32>(), stream.random::<f32>()) * size;
            let light = (stream.random::<f32>() * NO_LIGHT as f32) as u32;
            let origin = [Origin::Primary(light.min(NO_LIGHT - 1)), Origin::Diffuse, Origin::Caustic][i % 3];
            let photon = Photon::new(p, wi, n, power, origin);
            assert_eq!(photon.p(), p);
            assert!((photon.wi() - wi).length() < MAX_ERROR && (photon.n() - n).length() < MAX_ERROR);
            let near = |a: Rgb, b: Rgb, bound: f32| {
                (0..3).all(|c| (a[c] - b[c]).abs() <= bound * b.max_component().max(f32::MIN_POSITIVE))
            };
            assert!(near(photon.power(), power, 2.5e-4), "{:?} {power:?}", photon.power());
            assert_eq!(photon.is_primary(), i % 3 == 0);
            assert_eq!(photon.is_caustic(), i % 3 == 2);
            assert_eq!(photon.light(), (i % 3 == 0).then(|| light.min(NO_LIGHT - 1)));
            let scaled = photon.scaled(0.37);
            assert!(near(scaled.power(), power * 0.37, 5e-4));
            assert_eq!((scaled.p(), scaled.wi(), scaled.n()), (photon.p(), photon.wi(), photon.n()));
            assert_eq!((scaled.light(), scaled.is_caustic()), (photon.light(), photon.is_caustic()));
        }
    }

    #[test]
    fn rounding_of_power_has_no_drift() {
        let mut stream = pcg32([2, 8, 2]);
        let (mut sum, mut expected) = (0.0_f64, 0.0_f64);
        for _ in 0..100_000 {
            let power = Rgb::new(1.0 + stream.random::<f32>(), stream.random::<f32>(), stream.random::<f32>());
            let back = Photon::new(Vec3::ZERO, Vec3::Z, Vec3::Z, power, Origin::Diffuse).power();
            sum += f64::from(back.average());
            expected += f64::from(power.average());
        }
        // Errors are at most 2⁻¹² and independent: 6σ of the sum is below 6·2⁻¹²·√10⁵ = 0.46
        assert!((sum - expected).abs() < 0.46, "{sum} {expected}");
    }

    #[test]
    fn powers_at_the_ends_of_the_range_are_kept_or_zero() {
        let back = |power| Photon::new(Vec3::ZERO, Vec3::Z, Vec3::Z, power, Origin::Diffuse).power();
        assert_eq!(back(Rgb::BLACK), Rgb::BLACK);
        assert_eq!(back(Rgb::splat(f32::NAN)), Rgb::BLACK);
        assert_eq!(back(Rgb::new(-1.0, 0.0, 2.0)), Rgb::new(0.0, 0.0, 2.0));
        assert!(back(Rgb::splat(f32::INFINITY)).is_finite());
        assert!((back(Rgb::splat(f32::MAX)).r / f32::MAX - 1.0).abs() < 2.5e-4);
        assert!((back(Rgb::splat(2e-38)).r / 2e-38 - 1.0).abs() < 2.5e-4);
        // A black photon can be scaled
        let black = Photon::new(Vec3::ZERO, Vec3::Z, Vec3::Z, Rgb::BLACK, Origin::Primary(7));
        assert_eq!((black.scaled(1e9).power(), black.light()), (Rgb::BLACK, Some(7)));
    }

    #[test]
    fn a_light_without_room_is_not_told_but_the_photon_stays_primary() {
        let photon = Photon::new(Vec3::ZERO, Vec3::Z, Vec3::Z, Rgb::WHITE, Origin::Primary(u32::MAX));
        assert!(photon.is_primary() && photon.light().is_none());
    }
}

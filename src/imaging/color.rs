//! Transfer functions between stored and linear values.

/// Linear value of an sRGB-encoded one [IEC 61966-2-1]. Values outside 0..1 continue the curve, odd about 0.
#[inline]
pub fn srgb_to_linear(v: f32) -> f32 {
    let a = v.abs();
    let linear = if a <= 0.040_45 { a / 12.92 } else { ((a + 0.055) / 1.055).powf(2.4) };
    linear.copysign(v)
}

/// sRGB encoding of a linear value. Values outside 0..1 continue the curve, odd about 0.
#[inline]
pub fn linear_to_srgb(v: f32) -> f32 {
    let a = v.abs();
    let encoded = if a <= 0.003_130_8 { a * 12.92 } else { 1.055 * a.powf(1.0 / 2.4) - 0.055 };
    encoded.copysign(v)
}

/// Encoding of the stored values of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ColorEncoding {
    /// Stored values are linear.
    #[default]
    Linear,
    /// Stored values are sRGB-encoded.
    Srgb,
    /// linear = stored^gamma.
    Gamma(f32),
}

impl ColorEncoding {
    /// Linear value of a stored one.
    #[inline]
    pub fn to_linear(self, v: f32) -> f32 {
        match self {
            ColorEncoding::Linear => v,
            ColorEncoding::Srgb => srgb_to_linear(v),
            ColorEncoding::Gamma(gamma) => v.max(0.0).powf(gamma),
        }
    }

    /// Linear values of the 256 possible bytes.
    pub fn byte_table(self) -> [f32; 256] {
        std::array::from_fn(|i| self.to_linear(i as f32 / 255.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_round_trips_and_has_its_known_middle() {
        assert!((srgb_to_linear(0.5) - 0.214_041).abs() < 1e-6);
        for i in -100..=400 {
            let v = i as f32 / 200.0;
            assert!((srgb_to_linear(linear_to_srgb(v)) - v).abs() < 2e-6, "{v}");
        }
    }

    #[test]
    fn encodings_fix_black_and_white() {
        for e in [ColorEncoding::Linear, ColorEncoding::Srgb, ColorEncoding::Gamma(2.2)] {
            let table = e.byte_table();
            assert!(table[0] == 0.0 && (table[255] - 1.0).abs() < 1e-6);
            assert!(table.windows(2).all(|w| w[0] < w[1]));
        }
        assert!((ColorEncoding::Gamma(2.0).to_linear(0.5) - 0.25).abs() < 1e-7);
    }
}

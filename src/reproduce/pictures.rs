//! Pictures for a page: tone-mapped radiance, and values as colours.

use crate::imaging::color::linear_to_srgb;
use crate::imaging::oiio::{ImageError, Part, write_image};
use std::path::Path;

/// Colours at equal distances of a scale.
pub type Stops = &'static [[u8; 3]];

/// From nothing to much: black, violet, red, orange, yellow, white.
pub const HEAT: Stops = &[[0, 0, 4], [66, 10, 104], [147, 38, 103], [221, 81, 58], [252, 165, 10], [252, 255, 164]];
/// From one extreme to the other: red, grey, green.
pub const RED_GREEN: Stops = &[[165, 0, 38], [215, 80, 60], [225, 220, 215], [70, 160, 90], [0, 95, 45]];

/// A logarithmic scale of colours.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    stops: Stops,
    low: f64,
    high: f64,
}

impl Scale {
    /// From `low` to `high`, both positive; made wider if they are not apart.
    pub fn new(stops: Stops, low: f64, high: f64) -> Self {
        let low = if low > 0.0 && low.is_finite() { low } else { 1e-12 };
        let high = if high > low * 1.0001 && high.is_finite() { high } else { low * 10.0 };
        Scale { stops, low, high }
    }

    /// A scale for values of many orders: its top is the value that one in a thousand exceeds, and it spans four decades.
    pub fn of_values<'a>(stops: Stops, values: impl IntoIterator<Item = &'a f64>) -> Self {
        let mut sorted: Vec<f64> = values.into_iter().copied().filter(|v| *v > 0.0 && v.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let high = sorted.get(sorted.len().saturating_sub(1 + sorted.len() / 1000)).copied().unwrap_or(1.0);
        Scale::new(stops, high * 1e-4, high)
    }

    /// The colour of a value, 0..255 per channel.
    pub fn color(&self, value: f64) -> [f64; 3] {
        let t = ((value.max(self.low) / self.low).ln() / (self.high / self.low).ln()).clamp(0.0, 1.0);
        let t = if t.is_nan() { 0.0 } else { t } * (self.stops.len() - 1) as f64;
        let i = (t as usize).min(self.stops.len() - 2);
        let (a, b, f) = (self.stops[i], self.stops[i + 1], t - i as f64);
        std::array::from_fn(|c| f64::from(a[c]) * (1.0 - f) + f64::from(b[c]) * f)
    }

    /// The scale as a CSS background.
    pub fn css(&self) -> String {
        let stops: Vec<String> = self.stops.iter().map(|[r, g, b]| format!("rgb({r},{g},{b})")).collect();
        format!("linear-gradient(to right,{})", stops.join(","))
    }

    /// Values at `count` equal distances of the scale.
    pub fn ticks(&self, count: usize) -> Vec<String> {
        let at = |i: usize| self.low * (self.high / self.low).powf(i as f64 / (count - 1) as f64);
        (0..count).map(|i| significant(at(i))).collect()
    }
}

/// A number with three significant digits.
pub fn significant(v: f64) -> String {
    let magnitude = v.abs();
    if magnitude == 0.0 || !v.is_finite() {
        format!("{v}")
    } else if !(1e-3..1e6).contains(&magnitude) {
        format!("{v:.2e}")
    } else {
        let digits = (2 - magnitude.log10().floor() as i32).max(0) as usize;
        format!("{v:.digits$}")
    }
}

/// Values for a display, RGB interleaved, row-major from the top left.
#[derive(Clone, Debug)]
pub struct Picture {
    width: usize,
    height: usize,
    data: Vec<f32>,
}

impl Picture {
    /// Radiance times `gain`, through the sRGB curve.
    pub fn tone_mapped(size: [u32; 2], radiance: &[[f32; 3]], gain: f32) -> Self {
        let encode = |v: f32| linear_to_srgb((v * gain).clamp(0.0, 1.0));
        Picture {
            width: size[0] as usize,
            height: size[1] as usize,
            data: radiance.iter().flat_map(|p| p.map(encode)).collect(),
        }
    }

    /// Values as they are shown, RGB interleaved.
    pub fn from_display(size: [u32; 2], data: Vec<f32>) -> Self {
        Picture { width: size[0] as usize, height: size[1] as usize, data }
    }

    /// Values as colours of a scale.
    pub fn colored(size: [u32; 2], values: &[f64], scale: &Scale) -> Self {
        let data = values.iter().flat_map(|&v| scale.color(v).map(|c| (c / 255.0) as f32)).collect();
        Picture { width: size[0] as usize, height: size[1] as usize, data }
    }

    /// Writes `name`.png into `folder` and says what the file is called.
    pub fn write(self, folder: &Path, name: &str) -> Result<String, ImageError> {
        let file = format!("{name}.png");
        let channels = ["R", "G", "B"].map(str::to_owned).to_vec();
        write_image(&folder.join(&file), &[Part::display(self.width, self.height, channels, self.data)])?;
        Ok(file)
    }
}

/// The gain that maps the value which one pixel in twenty exceeds to 0.8.
pub fn gain(radiance: &[[f32; 3]]) -> f32 {
    let mut maxima: Vec<f32> = radiance.iter().map(|p| p[0].max(p[1]).max(p[2])).filter(|v| *v > 0.0).collect();
    maxima.sort_by(f32::total_cmp);
    match maxima.get(maxima.len() * 19 / 20) {
        Some(&v) if v.is_finite() => 0.8 / v,
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scale_ends_where_its_colours_do_and_survives_odd_values() {
        let scale = Scale::new(HEAT, 1e-4, 1.0);
        assert_eq!(scale.color(1e-9), HEAT[0].map(f64::from));
        assert_eq!(scale.color(5.0), HEAT[5].map(f64::from));
        assert_eq!(scale.color(f64::NAN), HEAT[0].map(f64::from));
        assert!(scale.color(0.01)[0] > scale.color(0.001)[0]);
        for (low, high) in [(0.0, 0.0), (1.0, 1.0), (f64::NAN, 1.0), (1.0, f64::INFINITY)] {
            assert!(Scale::new(HEAT, low, high).color(1.0).iter().all(|c| c.is_finite()));
        }
        assert_eq!(Scale::new(HEAT, 0.01, 100.0).ticks(5), ["0.0100", "0.100", "1.00", "10.0", "100"]);
    }

    #[test]
    fn numbers_have_three_digits() {
        let texts = [0.0, 0.1234, 12.345, 1234.5, 1.234e-7, -0.5].map(significant);
        assert_eq!(texts, ["0", "0.123", "12.3", "1234", "1.23e-7", "-0.500"]);
    }
}

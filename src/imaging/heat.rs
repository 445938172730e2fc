//! Colour scales for values, and formatting of numbers.

/// Colours at equal intervals of a scale.
pub type Stops = &'static [[u8; 3]];

/// From low to high: black, violet, red, orange, yellow, white.
pub const HEAT: Stops = &[[0, 0, 4], [66, 10, 104], [147, 38, 103], [221, 81, 58], [252, 165, 10], [252, 255, 164]];
/// Diverging: red, grey, green.
pub const RED_GREEN: Stops = &[[165, 0, 38], [215, 80, 60], [225, 220, 215], [70, 160, 90], [0, 95, 45]];

/// Diverging: light blue, blue, nearly black, red, orange.
pub const BLUE_RED: Stops = &[[130, 210, 255], [38, 96, 190], [20, 20, 24], [190, 58, 38], [255, 190, 110]];

/// A logarithmic scale of colours.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    stops: Stops,
    low: f64,
    high: f64,
}

impl Scale {
    /// From `low` to `high`, both positive. Widened if `high` is not above `low`.
    pub fn new(stops: Stops, low: f64, high: f64) -> Self {
        let low = if low > 0.0 && low.is_finite() { low } else { 1e-12 };
        let high = if high > low * 1.0001 && high.is_finite() { high } else { low * 10.0 };
        Scale { stops, low, high }
    }

    /// A scale for values over many orders of magnitude: from 10⁻⁴ of the 99.9th percentile to that percentile.
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

    /// Labels of `count` values at equal intervals of the scale.
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

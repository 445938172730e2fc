//! Line charts with two logarithmic axes, as SVG.

use super::images::significant;
use minijinja::HtmlEscape;
use std::fmt::Write;

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 300.0;
const LEFT: f64 = 70.0;
const BOTTOM: f64 = 45.0;
const RIGHT: f64 = 150.0;
const TOP: f64 = 12.0;
const COLORS: [&str; 6] = ["#1d4ed8", "#b42318", "#15803d", "#a16207", "#7e22ce", "#0f766e"];

/// Curves; both axes are logarithmic.
#[derive(Clone, Debug)]
pub struct Chart {
    x: String,
    y: String,
    curves: Vec<Curve>,
}

#[derive(Clone, Debug)]
struct Curve {
    name: String,
    points: Vec<[f64; 2]>,
}

/// A logarithmic axis.
struct Axis {
    low: f64,
    high: f64,
}

impl Axis {
    fn new(values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
        if low.is_finite() { Axis { low: low / 1.15, high: high * 1.15 } } else { Axis { low: 1.0, high: 10.0 } }
    }

    fn at(&self, v: f64) -> f64 {
        (v / self.low).ln() / (self.high / self.low).ln()
    }

    /// Values 1, 2, 5 times a power of ten within the range; only powers if there are many.
    fn ticks(&self) -> Vec<f64> {
        let decades = self.low.log10().floor() as i32..=self.high.log10().ceil() as i32;
        let of = |steps: &[f64]| -> Vec<f64> {
            let all = decades.clone().flat_map(|d| steps.iter().map(move |s| s * 10_f64.powi(d)));
            all.filter(|v| (self.low..=self.high).contains(v)).collect()
        };
        let fine = of(&[1.0, 2.0, 5.0]);
        if fine.len() > 9 { of(&[1.0]) } else { fine }
    }
}

impl Chart {
    /// Axes without curves.
    pub fn new(x: &str, y: &str) -> Self {
        Chart { x: x.to_owned(), y: y.to_owned(), curves: Vec::new() }
    }

    /// Adds a curve; points that are not positive are omitted.
    #[must_use]
    pub fn with(mut self, name: &str, points: Vec<[f64; 2]>) -> Self {
        let points = points.into_iter().filter(|p| p.iter().all(|v| *v > 0.0 && v.is_finite())).collect();
        self.curves.push(Curve { name: name.to_owned(), points });
        self
    }

    /// The chart as an SVG element.
    pub fn svg(&self) -> String {
        let points = || self.curves.iter().flat_map(|c| c.points.iter());
        let (ax, ay) = (Axis::new(points().map(|p| p[0])), Axis::new(points().map(|p| p[1])));
        let px = |v: f64| LEFT + ax.at(v) * (WIDTH - LEFT - RIGHT);
        let py = |v: f64| HEIGHT - BOTTOM - ay.at(v) * (HEIGHT - TOP - BOTTOM);
        let mut out = format!(
            "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" font-size=\"11\" role=\"img\">"
        );

        // Axes
        let (x1, y1) = (WIDTH - RIGHT, HEIGHT - BOTTOM);
        for v in ax.ticks() {
            let (x, label) = (px(v), significant(v));
            let label = if label.contains('.') { label.trim_end_matches('0').trim_end_matches('.') } else { &label };
            let _ = write!(out, "<path d=\"M{x:.1} {TOP}V{y1}\" stroke=\"#e4e4e7\"/>");
            let _ = write!(out, "<text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{label}</text>", y1 + 15.0);
        }
        for v in ay.ticks() {
            let y = py(v);
            let _ = write!(out, "<path d=\"M{LEFT} {y:.1}H{x1}\" stroke=\"#e4e4e7\"/>");
            let (x, y, label) = (LEFT - 6.0, y + 4.0, significant(v));
            let _ = write!(out, "<text x=\"{x}\" y=\"{y:.1}\" text-anchor=\"end\">{label}</text>");
        }
        let middle = (LEFT + x1) / 2.0;
        let (x, y) = (escape(&self.x), escape(&self.y));
        let _ = write!(out, "<text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\">{x}</text>", HEIGHT - 8.0);
        let middle = (TOP + y1) / 2.0;
        let _ = write!(out, "<text transform=\"translate(14 {middle}) rotate(-90)\" text-anchor=\"middle\">{y}</text>");

        // Curves and their names
        for (i, (curve, color)) in self.curves.iter().zip(COLORS.iter().cycle()).enumerate() {
            let line: Vec<String> = curve.points.iter().map(|p| format!("{:.1},{:.1}", px(p[0]), py(p[1]))).collect();
            let _ = write!(
                out,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1.6\"/>",
                line.join(" ")
            );
            for p in &curve.points {
                let _ =
                    write!(out, "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"2.6\" fill=\"{color}\"/>", px(p[0]), py(p[1]));
            }
            let (x, y) = (x1 + 12.0, TOP + 14.0 + 17.0 * i as f64);
            let _ = write!(out, "<circle cx=\"{x}\" cy=\"{}\" r=\"4\" fill=\"{color}\"/>", y - 4.0);
            let _ = write!(out, "<text x=\"{}\" y=\"{y}\">{}</text>", x + 9.0, escape(&curve.name));
        }
        out + "</svg>"
    }
}

/// Escapes HTML special characters.
fn escape(text: &str) -> String {
    HtmlEscape(text).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_lie_inside_and_odd_ones_are_left_out() {
        let points = vec![[1.0, 1e-5], [10.0, 3e-3], [0.0, 1.0], [5.0, f64::NAN], [100.0, -1.0]];
        let svg = Chart::new("x & y", "y").with("a<b", points).svg();
        // Two points and the symbol beside the name.
        assert_eq!(svg.matches("<circle").count(), 3);
        assert!(svg.contains("x &amp; y") && svg.contains("a&lt;b") && !svg.contains("NaN") && !svg.contains("inf"));
        assert!(!Chart::new("x", "y").svg().contains("NaN"));
    }
}

//! Integrals of colours with steps of visibility, with values and variances by quadrature, and runs of estimators on
//! them.

use crate::random::{Pcg32, RngExt, pcg32};
use lumiris_numbers::estimators::ris::Draw;
use lumiris_numbers::estimators::ris::sample_counts::Moments;
use lumiris_numbers::estimators::stats::Welford;
use lumiris_numbers::math::luminance;

/// An integral over a line or a square of f = colour · visibility; the target q̂ is the luminance of the colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Integral {
    /// x in 0..1 with p = ½ + x; visible in 0.15..0.4 and 0.55..0.95.
    Line,
    /// (x, y) in the unit square with p = 1; visible inside a circle of radius 0.9 about the origin.
    Square,
}

/// All integrals.
pub const ALL: [Integral; 2] = [Integral::Line, Integral::Square];

/// Numbers of points of the quadratures, per axis.
const LINE_POINTS: usize = 400_000;
const SQUARE_POINTS: usize = 1_500;

impl Integral {
    /// A point of density p from two uniform numbers; the second coordinate of a line is 0.
    pub fn sample(self, u: [f64; 2]) -> [f64; 2] {
        match self {
            Integral::Line => [(0.25 + 2.0 * u[0]).sqrt() - 0.5, 0.0],
            Integral::Square => u,
        }
    }

    /// Density p at a point.
    pub fn pdf(self, x: [f64; 2]) -> f64 {
        match self {
            Integral::Line => 0.5 + x[0],
            Integral::Square => 1.0,
        }
    }

    /// The colour, by channel.
    pub fn colour(self, [x, y]: [f64; 2]) -> [f64; 3] {
        match self {
            Integral::Line => [0.1 + 8.0 * x * (1.0 - x), 0.3 + 6.0 * x * x, 2.2 - 2.0 * x],
            Integral::Square => [0.2 + 3.0 * x * y, 0.1 + 4.0 * (x - 0.3) * (x - 0.3), 0.2 + 2.0 * y * y * y * y],
        }
    }

    /// 1 where the point is visible, else 0.
    pub fn visibility(self, [x, y]: [f64; 2]) -> f64 {
        match self {
            Integral::Line => f64::from(u8::from((0.15..0.4).contains(&x) || (0.55..0.95).contains(&x))),
            Integral::Square => f64::from(u8::from(x * x + y * y < 0.81)),
        }
    }

    /// The integrand: colour times visibility, by channel.
    pub fn f(self, x: [f64; 2]) -> [f64; 3] {
        let v = self.visibility(x);
        self.colour(x).map(|c| c * v)
    }

    /// The target q̂, luminance of the colour.
    pub fn target(self, x: [f64; 2]) -> f64 {
        luminance(self.colour(x))
    }

    /// Mean over uniform numbers `begin..end` of the first axis of `g(x)`, by the midpoint rule.
    pub fn mean_between<const K: usize>(self, begin: f64, end: f64, g: impl Fn([f64; 2]) -> [f64; K]) -> [f64; K] {
        let [nx, ny] = match self {
            Integral::Line => [LINE_POINTS, 1],
            Integral::Square => [SQUARE_POINTS, SQUARE_POINTS],
        };
        let mut sum = [0.0; K];
        for i in 0..nx {
            let u = begin + (end - begin) * (i as f64 + 0.5) / nx as f64;
            for j in 0..ny {
                let value = g(self.sample([u, (j as f64 + 0.5) / ny as f64]));
                (0..K).for_each(|k| sum[k] += value[k]);
            }
        }
        sum.map(|s| s / (nx * ny) as f64)
    }

    /// ∫f and [`Moments`] of proposals that are confined to uniform numbers `begin..end` (p is the density there).
    pub fn moments_between(self, begin: f64, end: f64) -> ([f64; 3], Moments) {
        let width = end - begin;
        let m = self.mean_between(begin, end, |x| {
            let (f, p, q_hat) = (self.f(x), self.pdf(x) / width, self.target(x));
            let f_over_p = f.map(|f| f / p);
            let square = f_over_p.map(|f| f * f);
            let a = f.map(|f| f * f / (q_hat * p));
            let [r, g, b] = f_over_p;
            [r, g, b, a[0], a[1], a[2], square[0], square[1], square[2], q_hat / p]
        });
        let value = [m[0], m[1], m[2]];
        let moments =
            Moments { e1: value.map(|f| f * f), e2: [m[3] * m[9], m[4] * m[9], m[5] * m[9]], e3: [m[6], m[7], m[8]] };
        (value, moments)
    }

    /// ∫f and the moments of proposals over the whole domain.
    pub fn moments(self) -> ([f64; 3], Moments) {
        self.moments_between(0.0, 1.0)
    }
}

/// M proposals of one run.
#[derive(Default)]
pub struct Proposals {
    /// f·r by channel.
    pub contributions: Vec<[f32; 3]>,
    /// q̂·r.
    pub weights: Vec<f32>,
    /// Colour times r, by channel.
    pub unshadowed: Vec<[f32; 3]>,
    /// Visibility, 0 or 1.
    pub visibilities: Vec<f32>,
}

impl Proposals {
    /// Removes all proposals.
    pub fn clear(&mut self) {
        self.contributions.clear();
        self.weights.clear();
        self.unshadowed.clear();
        self.visibilities.clear();
    }

    /// Adds the proposal x with factor r.
    pub fn push(&mut self, integral: Integral, x: [f64; 2], r: f64) {
        self.contributions.push(integral.f(x).map(|f| (f * r) as f32));
        self.weights.push((integral.target(x) * r) as f32);
        self.unshadowed.push(integral.colour(x).map(|c| (c * r) as f32));
        self.visibilities.push(integral.visibility(x) as f32);
    }

    /// M independent proposals of density p with r = 1/(M p).
    pub fn independent(&mut self, integral: Integral, m: usize, stream: &mut Pcg32) {
        self.clear();
        for _ in 0..m {
            let x = integral.sample(stream.random::<[f32; 2]>().map(f64::from));
            self.push(integral, x, 1.0 / (m as f64 * integral.pdf(x)));
        }
    }

    /// As [`Proposals::independent`], but in M equal strata of the first axis, in order.
    pub fn jittered(&mut self, integral: Integral, m: usize, stream: &mut Pcg32) {
        self.clear();
        for k in 0..m {
            let [u, v] = stream.random::<[f32; 2]>().map(f64::from);
            let x = integral.sample([(k as f64 + u) / m as f64, v]);
            self.push(integral, x, 1.0 / (m as f64 * integral.pdf(x)));
        }
    }

    /// Σ scale·c.
    pub fn estimate(&self, draws: &[Draw]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for d in draws {
            let c = self.contributions[d.index as usize];
            (0..3).for_each(|i| sum[i] += f64::from(d.scale * c[i]));
        }
        sum
    }
}

/// Moments of `runs` estimates per channel.
pub fn run(runs: usize, key: [u32; 3], mut estimate: impl FnMut(&mut Pcg32) -> [f64; 3]) -> [Welford; 3] {
    let mut stream = pcg32(key);
    let mut channels = [Welford::new(); 3];
    for _ in 0..runs {
        let e = estimate(&mut stream);
        (0..3).for_each(|i| channels[i].add(e[i]));
    }
    channels
}

/// Uniform numbers in all places of `u`.
pub fn fill(u: &mut [f32], stream: &mut Pcg32) {
    u.iter_mut().for_each(|u| *u = stream.random::<f32>());
}

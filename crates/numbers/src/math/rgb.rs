//! Linear Rec.709 colour.

use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, Index, Mul, MulAssign, Sub};

/// Contributions of red, green and blue to the relative luminance: the Y row of the Rec.709 matrix [ITU-R BT.709].
const WEIGHTS: [f64; 3] = [0.212_671, 0.715_160, 0.072_169];

/// Contributions of red, green and blue to the luminance of a colour.
pub const LUMINANCE: [f32; 3] = [WEIGHTS[0] as f32, WEIGHTS[1] as f32, WEIGHTS[2] as f32];

/// Relative luminance of f64 sums and means.
#[inline]
pub fn luminance([r, g, b]: [f64; 3]) -> f64 {
    WEIGHTS[0] * r + WEIGHTS[1] * g + WEIGHTS[2] * b
}

/// Linear Rec.709 (sRGB primaries, D65 white) triple: radiance, reflectance or weight.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Rgb {
    /// Red.
    pub r: f32,
    /// Green.
    pub g: f32,
    /// Blue.
    pub b: f32,
}

impl Rgb {
    /// (0, 0, 0).
    pub const BLACK: Rgb = Rgb::new(0.0, 0.0, 0.0);
    /// (1, 1, 1).
    pub const WHITE: Rgb = Rgb::new(1.0, 1.0, 1.0);

    /// From three components.
    #[inline]
    pub const fn new(r: f32, g: f32, b: f32) -> Self {
        Rgb { r, g, b }
    }

    /// The grey (v, v, v).
    #[inline]
    pub const fn splat(v: f32) -> Self {
        Rgb::new(v, v, v)
    }

    /// The components as an array.
    #[inline]
    pub const fn to_array(self) -> [f32; 3] {
        [self.r, self.g, self.b]
    }

    /// From an array of components.
    #[inline]
    pub const fn from_array(c: [f32; 3]) -> Self {
        Rgb::new(c[0], c[1], c[2])
    }

    /// Relative luminance.
    #[inline]
    pub fn luminance(self) -> f32 {
        LUMINANCE[0] * self.r + LUMINANCE[1] * self.g + LUMINANCE[2] * self.b
    }

    /// The largest component.
    #[inline]
    pub fn max_component(self) -> f32 {
        self.r.max(self.g).max(self.b)
    }

    /// The mean of the components.
    #[inline]
    pub fn average(self) -> f32 {
        (self.r + self.g + self.b) * (1.0 / 3.0)
    }

    /// True if all components are exactly 0.
    #[inline]
    pub fn is_black(self) -> bool {
        self.r == 0.0 && self.g == 0.0 && self.b == 0.0
    }

    /// True if no component is NaN or infinite.
    #[inline]
    pub fn is_finite(self) -> bool {
        self.r.is_finite() && self.g.is_finite() && self.b.is_finite()
    }

    /// Applies `f` to each component.
    #[inline]
    pub fn map(self, f: impl Fn(f32) -> f32) -> Self {
        Rgb::new(f(self.r), f(self.g), f(self.b))
    }

    /// Each component clamped to `[lo, hi]`.
    #[inline]
    pub fn clamp(self, lo: f32, hi: f32) -> Self {
        self.map(|c| c.clamp(lo, hi))
    }

    /// `self·(1 − t) + other·t`.
    #[inline]
    pub fn lerp(self, other: Rgb, t: f32) -> Self {
        self * (1.0 - t) + other * t
    }

    /// Componentwise square root.
    #[inline]
    pub fn sqrt(self) -> Self {
        self.map(f32::sqrt)
    }

    /// Componentwise exponential.
    #[inline]
    pub fn exp(self) -> Self {
        self.map(f32::exp)
    }
}

impl Add for Rgb {
    type Output = Rgb;
    #[inline]
    fn add(self, o: Rgb) -> Rgb {
        Rgb::new(self.r + o.r, self.g + o.g, self.b + o.b)
    }
}

impl AddAssign for Rgb {
    #[inline]
    fn add_assign(&mut self, o: Rgb) {
        *self = *self + o;
    }
}

impl Sub for Rgb {
    type Output = Rgb;
    #[inline]
    fn sub(self, o: Rgb) -> Rgb {
        Rgb::new(self.r - o.r, self.g - o.g, self.b - o.b)
    }
}

impl Mul for Rgb {
    type Output = Rgb;
    #[inline]
    fn mul(self, o: Rgb) -> Rgb {
        Rgb::new(self.r * o.r, self.g * o.g, self.b * o.b)
    }
}

impl MulAssign for Rgb {
    #[inline]
    fn mul_assign(&mut self, o: Rgb) {
        *self = *self * o;
    }
}

impl Mul<f32> for Rgb {
    type Output = Rgb;
    #[inline]
    fn mul(self, s: f32) -> Rgb {
        Rgb::new(self.r * s, self.g * s, self.b * s)
    }
}

impl Mul<Rgb> for f32 {
    type Output = Rgb;
    #[inline]
    fn mul(self, c: Rgb) -> Rgb {
        c * self
    }
}

impl MulAssign<f32> for Rgb {
    #[inline]
    fn mul_assign(&mut self, s: f32) {
        *self = *self * s;
    }
}

impl Div<f32> for Rgb {
    type Output = Rgb;
    #[inline]
    fn div(self, s: f32) -> Rgb {
        Rgb::new(self.r / s, self.g / s, self.b / s)
    }
}

impl Div for Rgb {
    type Output = Rgb;
    #[inline]
    fn div(self, o: Rgb) -> Rgb {
        Rgb::new(self.r / o.r, self.g / o.g, self.b / o.b)
    }
}

impl Sum for Rgb {
    fn sum<I: Iterator<Item = Rgb>>(iter: I) -> Rgb {
        iter.fold(Rgb::BLACK, |a, b| a + b)
    }
}

impl Index<usize> for Rgb {
    type Output = f32;
    #[inline]
    fn index(&self, channel: usize) -> &f32 {
        match channel {
            0 => &self.r,
            1 => &self.g,
            _ => &self.b,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn luminance_of_white_is_one() {
        assert!((Rgb::WHITE.luminance() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn arithmetic_is_by_components() {
        let (a, b) = (Rgb::new(1.0, 4.0, 9.0), Rgb::new(2.0, 8.0, 3.0));
        assert_eq!(a + b, Rgb::new(3.0, 12.0, 12.0));
        assert_eq!(a - b, Rgb::new(-1.0, -4.0, 6.0));
        assert_eq!(a * b, Rgb::new(2.0, 32.0, 27.0));
        assert_eq!(a / b, Rgb::new(0.5, 0.5, 3.0));
        assert_eq!((a * 2.0, 2.0 * a, a / 2.0), (a + a, a + a, Rgb::new(0.5, 2.0, 4.5)));
        let mut sum = a;
        sum += b;
        sum *= b;
        sum *= 0.5;
        assert_eq!(sum, Rgb::new(3.0, 48.0, 18.0));
        assert_eq!([a, b, b].into_iter().sum::<Rgb>(), Rgb::new(5.0, 20.0, 15.0));
        assert_eq!((a[0], a[1], a[2]), (1.0, 4.0, 9.0));
        assert_eq!((a.to_array(), Rgb::from_array([1.0, 4.0, 9.0])), ([1.0, 4.0, 9.0], a));
    }

    #[test]
    fn functions_of_a_colour_have_known_values() {
        let a = Rgb::new(1.0, 4.0, 9.0);
        assert_eq!((a.sqrt(), Rgb::splat(1.0).exp()), (Rgb::new(1.0, 2.0, 3.0), Rgb::splat(1.0_f32.exp())));
        assert_eq!((a.clamp(2.0, 5.0), a.map(|c| c + 1.0)), (Rgb::new(2.0, 4.0, 5.0), Rgb::new(2.0, 5.0, 10.0)));
        assert_eq!(a.lerp(Rgb::WHITE, 0.25), Rgb::new(1.0, 3.25, 7.0));
        assert!((a.average() - 14.0 / 3.0).abs() < 1e-6);
        for turned in [a, Rgb::new(9.0, 1.0, 4.0), Rgb::new(4.0, 9.0, 1.0)] {
            assert_eq!(turned.max_component(), 9.0);
        }
        // A luminance computed from the weights
        let y = 0.212_671 + 4.0 * 0.715_160 + 9.0 * 0.072_169;
        assert!((a.luminance() - y as f32).abs() < 1e-6 && (luminance([1.0, 4.0, 9.0]) - y).abs() < 1e-12);
    }

    #[test]
    fn black_and_finite_ask_every_component() {
        assert!(Rgb::BLACK.is_black() && Rgb::WHITE.is_finite());
        for axis in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Rgb::from_array) {
            assert!(!axis.is_black());
            assert!(!axis.map(|c| if c == 1.0 { f32::INFINITY } else { c }).is_finite());
            assert!(!axis.map(|c| if c == 1.0 { f32::NAN } else { c }).is_finite());
        }
    }
}

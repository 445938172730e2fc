//! Linear Rec.709 colours to smooth spectra.
//!
//! Of the many spectra with a given colour under D65, pbrt-v4 uses the one in the family [Jakob and Hanika 2019]
//!
//! ```text
//! s(λ) = S(c0·λ² + c1·λ + c2),   S(x) = 1/2 + x / (2·sqrt(1 + x²)),
//! ```
//!
//! which is between 0 and 1 and has three coefficients for three channels. They are computed by damped Gauss-Newton
//! steps on the difference in CIELAB, whose cube roots keep dark channels as accurate as bright ones. The continuation
//! path starts at the grey of the largest channel, where the solution has a closed form, and is a straight line to the
//! colour. Steep spectra of saturated colours are therefore approached through flatter ones.

use super::spectra::{LAMBDA_MAX, LAMBDA_MIN, Spectrum, d65_observer, rec709_matrix};
use glam::{DMat3, DVec3};
use lumiris_numbers::math::Rgb;

/// Continuation steps from grey to the colour.
const CONTINUATION_STEPS: u32 = 16;
/// Gauss-Newton steps per continuation step.
const NEWTON_STEPS: u32 = 30;
/// Squared difference in CIELAB that ends the iteration: far below the effect of rounding to f32.
const TOLERANCE: f64 = 1e-12;

/// The spectrum between 0 and 1 with the colour `rgb` (each channel in 0..=1) under D65 (dimensionless) [Jakob and
/// Hanika 2019].
///
/// Equal channels give a constant. If no such spectrum has the colour, the result has the smallest difference in
/// CIELAB.
pub fn sigmoid_spectrum(rgb: Rgb) -> Spectrum {
    scaled_sigmoid(rgb, 1.0)
}

/// The spectrum of a non-negative quantity without upper bound, such as an index of refraction, given as a colour:
/// m·s(λ), where m is twice the largest channel and s has the colour `rgb / m` (unit of `rgb`) [Pharr et al. 2023,
/// §4.6].
pub fn unbounded_spectrum(rgb: Rgb) -> Spectrum {
    let scale = 2.0 * rgb.max_component();
    if scale > 0.0 && scale.is_finite() {
        scaled_sigmoid(rgb.map(|c| c / scale), scale)
    } else {
        Spectrum::constant(0.0)
    }
}

fn scaled_sigmoid(rgb: Rgb, scale: f32) -> Spectrum {
    if rgb.r == rgb.g && rgb.g == rgb.b {
        return Spectrum::constant(rgb.r.clamp(0.0, 1.0) * scale);
    }
    let coefficients = fit(DVec3::from_array(rgb.to_array().map(f64::from)));
    let value = |l: u32| (sigmoid(coefficients.dot(powers(l))) * f64::from(scale)) as f32;
    Spectrum::per_nm(value)
}

fn sigmoid(x: f64) -> f64 {
    0.5 + 0.5 * x / (1.0 + x * x).sqrt()
}

fn sigmoid_derivative(x: f64) -> f64 {
    let y = 1.0 + x * x;
    0.5 / (y * y.sqrt())
}

/// The x for which `sigmoid(x) = value`.
fn inverse_sigmoid(value: f64) -> f64 {
    (value - 0.5) / (value * (1.0 - value)).sqrt()
}

/// t², t, 1, where t is linear from -1 to 1 over the integration range: the polynomials are the same as in λ, and the
/// equations are well conditioned.
fn powers(lambda: u32) -> DVec3 {
    let (first, last) = (f64::from(LAMBDA_MIN), f64::from(LAMBDA_MAX));
    let t = (2.0 * f64::from(lambda) - first - last) / (last - first);
    DVec3::new(t * t, t, 1.0)
}

/// (6/29)³ and below, the cube root of CIELAB is linear.
const DELTA: f64 = 6.0 / 29.0;

/// Converts CIE XYZ relative to the white of the colour space, by component, to CIELAB.
fn cielab(relative: DVec3) -> DVec3 {
    let cube_root = |t: f64| {
        if t > DELTA * DELTA * DELTA { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    };
    let [x, y, z] = relative.to_array().map(cube_root);
    DVec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
}

/// Derivative of [`cielab`].
fn cielab_derivative(relative: DVec3) -> DMat3 {
    let slope = |t: f64| {
        let root = if t > DELTA * DELTA * DELTA { t.cbrt() } else { DELTA };
        1.0 / (3.0 * root * root)
    };
    let [x, y, z] = relative.to_array().map(slope);
    let columns = [[0.0, 500.0, 0.0], [116.0, -500.0, 200.0], [0.0, 0.0, -200.0]].map(DVec3::from_array);
    DMat3::from_cols(columns[0] * x, columns[1] * y, columns[2] * z)
}

/// Evaluates the colour of a spectrum and its derivatives by the coefficients.
struct Fit {
    /// (x̄, ȳ, z̄)·D65 per nm, relative to the white.
    weights: Vec<DVec3>,
    /// t², t, 1 per nm.
    powers: Vec<DVec3>,
    /// Linear Rec.709 to XYZ relative to the white.
    relative_from_rgb: DMat3,
}

impl Fit {
    fn new() -> Self {
        let weights: Vec<DVec3> = d65_observer().map(DVec3::from_array).collect();
        let white: DVec3 = weights.iter().sum();
        let xyz_from_rgb = DMat3::from_cols_array_2d(&rec709_matrix()).transpose().inverse();
        Fit {
            weights: weights.into_iter().map(|w| w / white).collect(),
            powers: (LAMBDA_MIN..=LAMBDA_MAX).map(powers).collect(),
            relative_from_rgb: DMat3::from_diagonal(white.recip()) * xyz_from_rgb,
        }
    }

    /// Difference to `target` in CIELAB.
    fn residual(&self, c: DVec3, target: DVec3) -> DVec3 {
        let shown: DVec3 = self.weights.iter().zip(&self.powers).map(|(w, p)| *w * sigmoid(c.dot(*p))).sum();
        cielab(shown) - target
    }

    /// Derivative of [`Fit::residual`] by the coefficients.
    fn jacobian(&self, c: DVec3) -> DMat3 {
        let (mut shown, mut derivative) = (DVec3::ZERO, DMat3::ZERO);
        for (w, p) in self.weights.iter().zip(&self.powers) {
            let x = c.dot(*p);
            shown += *w * sigmoid(x);
            let slope = *w * sigmoid_derivative(x);
            derivative += DMat3::from_cols(slope * p.x, slope * p.y, slope * p.z);
        }
        cielab_derivative(shown) * derivative
    }

    /// Levenberg-Marquardt iteration from `c` to the coefficients with the colour `rgb`.
    fn solve(&self, mut c: DVec3, rgb: DVec3) -> DVec3 {
        let target = cielab(self.relative_from_rgb * rgb);
        let mut residual = self.residual(c, target);
        let mut damping = 1e-6;
        for _ in 0..NEWTON_STEPS {
            if residual.length_squared() < TOLERANCE {
                break;
            }
            let j = self.jacobian(c);
            let (normal, gradient) = (j.transpose() * j, j.transpose() * residual);
            let diagonal = DVec3::new(normal.x_axis.x, normal.y_axis.y, normal.z_axis.z);
            // Increase the damping until the step reduces the difference.
            let better = (0..12).find_map(|_| {
                let damped = normal + DMat3::from_diagonal(diagonal * damping);
                let next = c - damped.inverse() * gradient;
                let next_residual = self.residual(next, target);
                let improves = next.is_finite() && next_residual.length_squared() < residual.length_squared();
                damping = if improves { (damping * 0.1).max(1e-12) } else { damping * 10.0 };
                improves.then_some((next, next_residual))
            });
            match better {
                Some(step) => (c, residual) = step,
                None => break,
            }
        }
        c
    }
}

/// Coefficients of t², t, 1 for a colour that is not grey.
fn fit(rgb: DVec3) -> DVec3 {
    let fit = Fit::new();
    let grey = rgb.max_element().clamp(0.01, 0.99);
    let mut c = DVec3::new(0.0, 0.0, inverse_sigmoid(grey));
    for step in 1..=CONTINUATION_STEPS {
        let t = f64::from(step) / f64::from(CONTINUATION_STEPS);
        c = fit.solve(c, DVec3::splat(grey).lerp(rgb, t));
    }
    c
}

#[cfg(test)]
mod tests {
    use super::super::spectra::{Conductor, conductor_rgb, fresnel_conductor, to_rgb};
    use super::*;

    /// The colour of the product of D65 and `f` in a spectral renderer.
    fn shown(f: impl Fn(f32) -> f64) -> [f64; 3] {
        let sum = (LAMBDA_MIN..=LAMBDA_MAX)
            .zip(d65_observer())
            .map(|(l, w)| DVec3::from_array(w) * f(l as f32))
            .fold(DVec3::ZERO, |a, b| a + b);
        to_rgb(sum.to_array())
    }

    fn shown_by(s: &Spectrum) -> [f64; 3] {
        shown(|l| f64::from(s.at(l)))
    }

    fn values(s: &Spectrum) -> Vec<f32> {
        (LAMBDA_MIN..=LAMBDA_MAX).map(|l| s.at(l as f32)).collect()
    }

    fn worst(a: [f64; 3], b: Rgb) -> f64 {
        (0..3).map(|c| (a[c] - f64::from(b[c])).abs()).fold(0.0, f64::max)
    }

    /// Dark, bright, saturated and nearly white colours.
    fn colors() -> impl Iterator<Item = Rgb> {
        const LEVELS: [f32; 9] = [0.0, 0.001, 0.02, 0.1, 0.3, 0.6, 0.9, 0.99, 1.0];
        let pairs = || LEVELS.into_iter().flat_map(|g| LEVELS.into_iter().map(move |b| (g, b)));
        LEVELS.into_iter().flat_map(move |r| pairs().map(move |(g, b)| Rgb::new(r, g, b)))
    }

    /// Relative difference between RGB and spectral rendering.
    fn relative(by_channels: [f64; 3], by_spectra: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|c| by_channels[c] / by_spectra[c] - 1.0)
    }

    fn assert_near(found: [f64; 3], expected: [f64; 3], tolerance: f64) {
        assert!((0..3).all(|c| (found[c] - expected[c]).abs() <= tolerance), "{found:?} is not {expected:?}");
    }

    #[test]
    fn spectra_show_their_colours() {
        for rgb in colors() {
            let error = worst(shown_by(&sigmoid_spectrum(rgb)), rgb);
            assert!(error < 1e-4, "{rgb:?} is shown with an error of {error}");
        }
    }

    #[test]
    fn spectra_are_smooth_and_lie_between_zero_and_one() {
        for rgb in colors() {
            let v = values(&sigmoid_spectrum(rgb));
            assert!(v.iter().all(|s| (0.0..=1.0).contains(s)), "{rgb:?}");
            // A parabola has one extremum, and the sigmoid keeps it.
            let slopes: Vec<f32> = v.windows(2).map(|w| w[1] - w[0]).filter(|d| d.abs() > 1e-6).collect();
            let turns = slopes.windows(2).filter(|w| (w[0] > 0.0) != (w[1] > 0.0)).count();
            assert!(turns <= 1, "{rgb:?} turns {turns} times");
        }
        let pale = values(&sigmoid_spectrum(Rgb::new(0.6, 0.5, 0.4)));
        assert!(pale.windows(2).all(|w| (w[1] - w[0]).abs() < 0.004));
    }

    #[test]
    fn greys_are_constant() {
        for grey in [0.0, 0.25, 0.5, 1.0] {
            assert_eq!(sigmoid_spectrum(Rgb::splat(grey)), Spectrum::constant(grey));
        }
        assert_eq!(unbounded_spectrum(Rgb::splat(3.0)), Spectrum::constant(3.0));
        assert_eq!(unbounded_spectrum(Rgb::BLACK), Spectrum::constant(0.0));
    }

    #[test]
    fn unbounded_spectra_show_their_colours_and_stay_below_twice_the_largest_channel() {
        for rgb in [[3.9, 2.5, 2.1], [0.2, 0.92, 1.1], [9.2, 0.0, 4.8], [17.0, 12.0, 4.0]].map(Rgb::from_array) {
            let s = unbounded_spectrum(rgb);
            assert!(worst(shown_by(&s), rgb) < 1e-4 * f64::from(rgb.max_component()));
            assert!(values(&s).iter().all(|&v| (0.0..=2.0 * rgb.max_component()).contains(&v)));
        }
    }

    // Produces the numbers of docs/measurements/spectral-differences.md.

    const LIGHT: [f64; 3] = [17.0, 12.0, 4.0];

    /// Relative difference of interreflection between RGB and spectral rendering.
    fn lit_wall(wall: [f64; 3]) -> [f64; 3] {
        let light = unbounded_spectrum(Rgb::from_array(LIGHT.map(|c| c as f32)));
        let s = sigmoid_spectrum(Rgb::from_array(wall.map(|c| c as f32)));
        relative([0, 1, 2].map(|c| LIGHT[c] * wall[c]), shown(|l| f64::from(light.at(l)) * f64::from(s.at(l))))
    }

    #[test]
    fn a_red_wall_under_a_yellow_light_is_brighter_by_channels_than_by_spectra() {
        assert_near(lit_wall([0.63, 0.065, 0.05]), [0.0983, 0.0333, 2.4051], 2e-4);
        assert_near(lit_wall([0.14, 0.45, 0.091]), [-0.1925, 0.0233, 0.8465], 2e-4);
        assert_near(lit_wall([0.725, 0.71, 0.68]), [0.0020, 0.0009, 0.0077], 2e-4);
    }

    #[test]
    fn saturated_colours_differ_once_they_multiply_themselves() {
        const BALL: [f64; 3] = [0.243_117, 0.059_106, 0.000_849];
        /// Diffuse internal reflectance of a dielectric surface of index 1.5.
        const INSIDE: f64 = 0.596;
        let s = sigmoid_spectrum(Rgb::from_array(BALL.map(|c| c as f32)));
        let both = |f: fn(f64) -> f64| (BALL.map(f), shown(|l| f(f64::from(s.at(l)))));
        for (f, red_and_green, blue) in [
            ((|r| r * (1.0 - INSIDE) / (1.0 - INSIDE * r)) as fn(f64) -> f64, [0.0256, 0.0032], 1.31e-5),
            (|r| r * r, [0.1797, 0.0520], -1.23e-3),
        ] {
            let (by_channels, by_spectra) = both(f);
            let found = relative(by_channels, by_spectra);
            assert_near([found[0], found[1], 0.0], [red_and_green[0], red_and_green[1], 0.0], 2e-4);
            assert!((by_spectra[2] / blue - 1.0).abs() < 0.01, "{by_spectra:?}");
        }
    }

    #[test]
    fn fresnel_by_channels_makes_copper_too_dark_in_red() {
        let (eta, k) = ([0.200_438, 0.924_033, 1.102_212], [3.912_949, 2.452_848, 2.142_188]);
        let curve = |rgb: [f64; 3]| unbounded_spectrum(Rgb::from_array(rgb.map(|c| c as f32)));
        let (eta_curve, k_curve) = (curve(eta), curve(k));
        for (cos, expected) in [(1.0, [-0.0303, -0.0072, -0.0054]), (0.5, [-0.0195, -0.0061, -0.0029])] {
            let by_spectra = shown(|l| fresnel_conductor(cos, f64::from(eta_curve.at(l)), f64::from(k_curve.at(l))));
            let by_channels = [0, 1, 2].map(|c| fresnel_conductor(cos, eta[c], k[c]));
            assert_near(relative(by_channels, by_spectra), expected, 2e-4);
        }
    }

    #[test]
    fn fitted_copper_is_within_one_percent_of_its_spectra_at_all_angles() {
        let curve = |rgb: [f32; 3]| unbounded_spectrum(Rgb::from_array(rgb));
        let (eta_curve, k_curve) = (curve([0.200_438, 0.924_033, 1.102_212]), curve([3.912_949, 2.452_848, 2.142_188]));
        let Conductor { eta, k } = conductor_rgb(&eta_curve, &k_curve);
        for degrees in (0..=85).step_by(5) {
            let cos = f64::from(degrees).to_radians().cos();
            let by_spectra = shown(|l| fresnel_conductor(cos, f64::from(eta_curve.at(l)), f64::from(k_curve.at(l))));
            let by_channels = [0, 1, 2].map(|c| fresnel_conductor(cos, f64::from(eta[c]), f64::from(k[c])));
            assert_near(relative(by_channels, by_spectra), [0.0; 3], 0.01);
        }
    }
}

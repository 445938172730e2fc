//! Warps of the unit square, each with its pdf and its inverse, side by side.

use super::{safe_sqrt, sqr};
use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, FRAC_PI_4, PI, TAU};

/// Uniform over the unit disk by the concentric map [Shirley and Chiu 1997], which preserves neighbourhoods.
#[inline]
pub fn sample_uniform_disk_concentric(u: [f32; 2]) -> Vec2 {
    let (x, y) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    if x == 0.0 && y == 0.0 {
        return Vec2::ZERO;
    }
    let (radius, theta) =
        if x.abs() > y.abs() { (x, FRAC_PI_4 * (y / x)) } else { (y, FRAC_PI_2 - FRAC_PI_4 * (x / y)) };
    let (sin, cos) = theta.sin_cos();
    Vec2::new(radius * cos, radius * sin)
}

/// Density of [`sample_uniform_disk_concentric`] per unit area.
#[inline]
pub fn pdf_uniform_disk_concentric() -> f32 {
    FRAC_1_PI
}

/// Inverse of [`sample_uniform_disk_concentric`].
#[inline]
pub fn invert_uniform_disk_concentric(p: Vec2) -> [f32; 2] {
    let mut phi = p.y.atan2(p.x);
    let radius = p.length();
    if phi < -FRAC_PI_4 {
        phi += TAU;
    }
    let (a, b) = if phi < FRAC_PI_4 {
        (radius, phi * radius / FRAC_PI_4)
    } else if phi < 3.0 * FRAC_PI_4 {
        (-(phi - FRAC_PI_2) * radius / FRAC_PI_4, radius)
    } else if phi < 5.0 * FRAC_PI_4 {
        (-radius, (phi - PI) * -radius / FRAC_PI_4)
    } else {
        ((phi - 3.0 * FRAC_PI_2) * radius / FRAC_PI_4, -radius)
    };
    [(a + 1.0) * 0.5, (b + 1.0) * 0.5]
}

/// Cosine-weighted about +z on the upper hemisphere, by Malley's method.
#[inline]
pub fn sample_cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let d = sample_uniform_disk_concentric(u);
    d.extend(safe_sqrt(1.0 - d.length_squared()))
}

/// Density of [`sample_cosine_hemisphere`] per steradian; 0 below the horizon.
#[inline]
pub fn pdf_cosine_hemisphere(w: Vec3) -> f32 {
    w.z.max(0.0) * FRAC_1_PI
}

/// Inverse of [`sample_cosine_hemisphere`].
#[inline]
pub fn invert_cosine_hemisphere(w: Vec3) -> [f32; 2] {
    invert_uniform_disk_concentric(w.truncate())
}

/// Uniform on the upper hemisphere.
#[inline]
pub fn sample_uniform_hemisphere(u: [f32; 2]) -> Vec3 {
    direction(u[0], TAU * u[1])
}

/// Density of [`sample_uniform_hemisphere`] per steradian.
#[inline]
pub fn pdf_uniform_hemisphere(w: Vec3) -> f32 {
    if w.z >= 0.0 { 0.5 * FRAC_1_PI } else { 0.0 }
}

/// Inverse of [`sample_uniform_hemisphere`].
#[inline]
pub fn invert_uniform_hemisphere(w: Vec3) -> [f32; 2] {
    [w.z, azimuth(w) / TAU]
}

/// Uniform on the sphere.
#[inline]
pub fn sample_uniform_sphere(u: [f32; 2]) -> Vec3 {
    direction(1.0 - 2.0 * u[0], TAU * u[1])
}

/// Density of [`sample_uniform_sphere`] per steradian.
#[inline]
pub fn pdf_uniform_sphere() -> f32 {
    0.25 * FRAC_1_PI
}

/// Inverse of [`sample_uniform_sphere`].
#[inline]
pub fn invert_uniform_sphere(w: Vec3) -> [f32; 2] {
    [(1.0 - w.z) * 0.5, azimuth(w) / TAU]
}

/// Barycentric coordinates (b0, b1) uniform over a triangle, by the low-distortion map of [Heitz 2019].
#[inline]
pub fn sample_uniform_triangle(u: [f32; 2]) -> [f32; 2] {
    if u[0] < u[1] {
        let b0 = u[0] * 0.5;
        [b0, u[1] - b0]
    } else {
        let b1 = u[1] * 0.5;
        [u[0] - b1, b1]
    }
}

/// Inverse of [`sample_uniform_triangle`].
#[inline]
pub fn invert_uniform_triangle(b: [f32; 2]) -> [f32; 2] {
    if b[0] > b[1] { [b[0] + b[1], 2.0 * b[1]] } else { [2.0 * b[0], b[1] + b[0]] }
}

/// Inverse of the CDF of the tent of half-width `radius` about 0.
#[inline]
pub fn sample_tent(u: f32, radius: f32) -> f32 {
    if u < 0.5 { radius * ((2.0 * u).sqrt() - 1.0) } else { radius * (1.0 - (2.0 - 2.0 * u).sqrt()) }
}

/// Density of [`sample_tent`] per unit length.
#[inline]
pub fn pdf_tent(x: f32, radius: f32) -> f32 {
    (1.0 - x.abs() / radius).max(0.0) / radius
}

/// Inverse of [`sample_tent`].
#[inline]
pub fn invert_tent(x: f32, radius: f32) -> f32 {
    let y = x / radius;
    if y < 0.0 { 0.5 * sqr(1.0 + y) } else { 1.0 - 0.5 * sqr(1.0 - y) }
}

/// The unit vector of polar cosine `cos_theta` and azimuth `phi`.
#[inline]
pub fn direction(cos_theta: f32, phi: f32) -> Vec3 {
    let sin_theta = safe_sqrt(1.0 - sqr(cos_theta));
    let (sin_phi, cos_phi) = phi.sin_cos();
    Vec3::new(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta)
}

/// Azimuth of `w` in [0, 2π).
#[inline]
pub fn azimuth(w: Vec3) -> f32 {
    let phi = w.y.atan2(w.x);
    if phi < 0.0 { phi + TAU } else { phi }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::random::{RngExt, pcg32};

    fn grid() -> impl Iterator<Item = [f32; 2]> {
        (0..17).flat_map(|i| (0..17).map(move |j| [(i as f32 + 0.43) / 17.0, (j as f32 + 0.71) / 17.0]))
    }

    fn assert_inverts(name: &str, round_trip: impl Fn([f32; 2]) -> [f32; 2]) {
        for u in grid() {
            let v = round_trip(u);
            let error = (u[0] - v[0]).abs().max((u[1] - v[1]).abs());
            assert!(error < 2e-4, "{name}: {u:?} -> {v:?}");
        }
    }

    #[test]
    fn inverses_undo_the_warps() {
        assert_inverts("disk", |u| invert_uniform_disk_concentric(sample_uniform_disk_concentric(u)));
        assert_inverts("cosine", |u| invert_cosine_hemisphere(sample_cosine_hemisphere(u)));
        assert_inverts("hemisphere", |u| invert_uniform_hemisphere(sample_uniform_hemisphere(u)));
        assert_inverts("sphere", |u| invert_uniform_sphere(sample_uniform_sphere(u)));
        assert_inverts("triangle", |u| invert_uniform_triangle(sample_uniform_triangle(u)));
        assert_inverts("tent", |u| [invert_tent(sample_tent(u[0], 1.5), 1.5), u[1]]);
    }

    const SAMPLES: usize = 400_000;
    const CELLS: usize = 24;

    /// Uniform numbers, two at a time.
    fn numbers() -> impl Iterator<Item = [f32; 2]> {
        let mut stream = pcg32([17, 4, 99]);
        (0..SAMPLES).map(move |_| stream.random::<[f32; 2]>())
    }

    /// χ² test over the cells of a square of parameters, with the density integrated over each cell. Five tests at
    /// 10⁻⁴.
    fn assert_density(place: impl Fn([f32; 2]) -> [f64; 2], density: impl Fn(f64, f64) -> f64) {
        let mut observed = vec![0.0; CELLS * CELLS];
        for u in numbers() {
            let [x, y] = place(u).map(|v| ((v * CELLS as f64) as usize).min(CELLS - 1));
            observed[y * CELLS + x] += 1.0;
        }
        const FINE: usize = 16;
        let step = 1.0 / (CELLS * FINE) as f64;
        let expected: Vec<f64> = (0..CELLS * CELLS)
            .map(|cell| {
                let (x0, y0) = ((cell % CELLS * FINE) as f64, (cell / CELLS * FINE) as f64);
                let fine = (0..FINE * FINE)
                    .map(|i| density((x0 + (i % FINE) as f64 + 0.5) * step, (y0 + (i / FINE) as f64 + 0.5) * step));
                fine.sum::<f64>() * step * step * SAMPLES as f64
            })
            .collect();
        lumiris_test_support::assert_chi_squared(&observed, &expected, 1e-4);
    }

    /// Parameters ((cos θ + 1)/2, φ/2π) of a direction: a steradian is 1/4π of the square.
    fn assert_direction_density(sample: impl Fn([f32; 2]) -> Vec3, pdf: impl Fn(Vec3) -> f32) {
        let place = |u| {
            let w = sample(u);
            [f64::from(w.z + 1.0) * 0.5, f64::from(azimuth(w) / TAU)]
        };
        let density = |x: f64, y: f64| {
            let w = direction((2.0 * x - 1.0) as f32, TAU * y as f32);
            f64::from(pdf(w)) * 4.0 * std::f64::consts::PI
        };
        assert_density(place, density);
    }

    #[test]
    fn directions_have_their_densities() {
        assert_direction_density(sample_cosine_hemisphere, pdf_cosine_hemisphere);
        assert_direction_density(sample_uniform_hemisphere, pdf_uniform_hemisphere);
        assert_direction_density(sample_uniform_sphere, |_| pdf_uniform_sphere());
    }

    #[test]
    fn disk_triangle_and_tent_have_their_densities() {
        // Parameters (r², φ/2π) of the disk: a unit of area is 1/π of the square.
        let disk = |u| {
            let p = sample_uniform_disk_concentric(u);
            [f64::from(p.length_squared()), f64::from(azimuth(p.extend(0.0)) / TAU)]
        };
        assert_density(disk, |_, _| f64::from(pdf_uniform_disk_concentric()) * std::f64::consts::PI);

        // Parameters (b0/(1 − b1), b1) of the triangle, whose Jacobian is 1 − b1; the uniform density in (b0, b1) is 2.
        let triangle = |u| {
            let [b0, b1] = sample_uniform_triangle(u).map(f64::from);
            [b0 / (1.0 - b1), b1]
        };
        assert_density(triangle, |_, y| 2.0 * (1.0 - y));

        let tent = |u: [f32; 2]| [f64::from(sample_tent(u[0], 1.5) / 3.0 + 0.5), f64::from(u[1])];
        assert_density(tent, |x, _| 3.0 * f64::from(pdf_tent((x as f32 - 0.5) * 3.0, 1.5)));
    }
}

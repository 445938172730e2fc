//! A stratified hemisphere, its irradiance, and the derivatives of the irradiance by position and normal
//! [Ward and Heckbert 1992; Křivánek et al. 2008].
//!
//! M × N cells (M rings of polar angle θ, N sectors of azimuth φ) have the equal projected solid angle π/(MN), with one
//! direction each. L_jk and r_jk are the radiance and distance of cell (j, k). u_k is the tangent at the middle of the
//! sector, v_k the tangent perpendicular to it. The indices − and + stand for the lower and upper bounds of a cell:
//!
//! E    = π/(MN) Σ L_jk
//!
//! ∇r E = Σ_k v_k 2 sin(π/N) Σ_j L_jk ∫_{θ−}^{θ+} sin²θ dθ
//!
//! ∇t E = Σ_k [ u_k (2π/N) Σ_{j≥1} sin θ_j− cos²θ_j− (L_jk − L_{j−1,k}) / min(r_jk, r_{j−1,k})
//!            + v_k− Σ_j (sin θ_j+ − sin θ_j−) (L_jk − L_{j,k−1}) / min(r_jk, r_{j,k−1}) ]
//!
//! ∇r is the integral of L (n × ω) dω with L constant in each cell. The source has the sum of tan θ_jk L_jk instead,
//! whose variance is unbounded. ∇t is the movement of the boundaries between cells, at the nearer of the two surfaces,
//! as the point moves. Both are tangential: E(x, n) ≈ E + (x − x_i)·∇t E + (n_i × n)·∇r E.

use lumiris_numbers::math::{Frame, Rgb, Vec3, safe_sqrt};
use std::f32::consts::{PI, TAU};

/// The cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cells {
    /// Rings (M).
    pub rings: u32,
    /// Sectors (N).
    pub sectors: u32,
}

/// Irradiance about a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Irradiance {
    /// E.
    pub e: Rgb,
    /// ∇t E of each channel (per unit length).
    pub translation: [Vec3; 3],
    /// ∇r E of each channel (per radian).
    pub rotation: [Vec3; 3],
}

impl Irradiance {
    /// The sum of two contributions.
    #[must_use]
    pub fn plus(&self, other: &Irradiance) -> Irradiance {
        Irradiance {
            e: self.e + other.e,
            translation: std::array::from_fn(|c| self.translation[c] + other.translation[c]),
            rotation: std::array::from_fn(|c| self.rotation[c] + other.rotation[c]),
        }
    }

    /// Adds `scale` times `direction` to the gradient of each channel.
    pub fn add_gradient(gradient: &mut [Vec3; 3], direction: Vec3, scale: Rgb) {
        for (c, g) in gradient.iter_mut().enumerate() {
            *g += direction * scale[c];
        }
    }

    /// True if all numbers are finite.
    pub fn is_finite(&self) -> bool {
        self.e.is_finite() && self.translation.iter().chain(&self.rotation).all(|v| v.is_finite())
    }
}

impl Cells {
    /// About `samples` cells (at least 8), nearly as wide as they are high: N ≈ πM.
    pub fn new(samples: u32) -> Self {
        let samples = samples.max(8) as f32;
        let rings = (samples / PI).sqrt().round().max(2.0);
        Cells { rings: rings as u32, sectors: (samples / rings).round().max(4.0) as u32 }
    }

    /// Number of cells.
    pub fn count(self) -> u32 {
        self.rings * self.sectors
    }

    /// A direction in cell `i`, cosine-weighted, by two uniform numbers. Local frame.
    pub fn direction(self, i: u32, u: [f32; 2]) -> Vec3 {
        let (ring, sector) = (i / self.sectors, i % self.sectors);
        let sin2 = (ring as f32 + u[0]) / self.rings as f32;
        let (sin, cos) = (safe_sqrt(sin2), safe_sqrt(1.0 - sin2));
        let (sin_phi, cos_phi) = self.azimuth(sector as f32 + u[1]).sin_cos();
        Vec3::new(sin * cos_phi, sin * sin_phi, cos)
    }

    fn azimuth(self, sector: f32) -> f32 {
        TAU * sector / self.sectors as f32
    }

    /// [sin θ, cos θ] at the lower bound of a ring.
    fn bound(self, ring: u32) -> [f32; 2] {
        let sin2 = ring as f32 / self.rings as f32;
        [sin2.sqrt(), safe_sqrt(1.0 - sin2)]
    }

    /// Irradiance and its gradients in world space, from the radiance `l` and the distance `r` of each cell. The
    /// distance is infinite if the ray hits nothing.
    pub fn irradiance(self, frame: &Frame, l: &[Rgb], r: &[f32]) -> Irradiance {
        let mut sum = Irradiance::default();
        let at = |ring: u32, sector: u32| (ring * self.sectors + sector) as usize;
        let weight = PI / self.count() as f32;
        for sector in 0..self.sectors {
            let middle = self.azimuth(sector as f32 + 0.5);
            let lower = self.azimuth(sector as f32);
            let u = frame.to_world(Vec3::new(middle.cos(), middle.sin(), 0.0));
            let v = frame.to_world(Vec3::new(-middle.sin(), middle.cos(), 0.0));
            let v_lower = frame.to_world(Vec3::new(-lower.sin(), lower.cos(), 0.0));
            let before = (sector + self.sectors - 1) % self.sectors;
            let chord = 2.0 * (PI / self.sectors as f32).sin();
            let mut of_sector = Rgb::BLACK;
            for ring in 0..self.rings {
                let i = at(ring, sector);
                let ([sin, cos], [sin_upper, cos_upper]) = (self.bound(ring), self.bound(ring + 1));
                of_sector += l[i];

                // ∫ sin² θ dθ = (θ − sin θ cos θ)/2
                let area = |sin: f32, cos: f32| 0.5 * (sin.atan2(cos) - sin * cos);
                let turned = chord * (area(sin_upper, cos_upper) - area(sin, cos));
                Irradiance::add_gradient(&mut sum.rotation, v, l[i] * turned);

                // Bounds to the ring below and to the sector before
                let moved = |j: usize, rate: f32| (l[i] - l[j]) * (rate / r[i].min(r[j]));
                if ring > 0 {
                    let rate = TAU / self.sectors as f32 * sin * cos * cos;
                    Irradiance::add_gradient(&mut sum.translation, u, moved(at(ring - 1, sector), rate));
                }
                let rate = sin_upper - sin;
                Irradiance::add_gradient(&mut sum.translation, v_lower, moved(at(ring, before), rate));
            }
            sum.e += of_sector * weight;
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FINE: Cells = Cells { rings: 96, sectors: 300 };

    /// Irradiance at `p` with the normal `n` from the plane z = 1, by rays through the cell centres.
    fn under_plane(cells: Cells, p: Vec3, n: Vec3, l: impl Fn(Vec3) -> Rgb) -> Irradiance {
        let frame = Frame::from_z(n);
        let (mut radiance, mut distance) = (Vec::new(), Vec::new());
        for i in 0..cells.count() {
            let w = frame.to_world(cells.direction(i, [0.5, 0.5]));
            let t = if w.z > 0.0 { (1.0 - p.z) / w.z } else { f32::INFINITY };
            radiance.push(if t.is_finite() { l(p + w * t) } else { Rgb::BLACK });
            distance.push(t);
        }
        cells.irradiance(&frame, &radiance, &distance)
    }

    fn pattern(q: Vec3) -> Rgb {
        let far = (-0.5 * q.truncate().length_squared()).exp();
        Rgb::new(far, far * (1.0 + (2.0 * q.x).sin()), far / (1.0 + (12.0 * (q.x - 0.3)).exp()))
    }

    #[test]
    fn a_uniform_hemisphere_has_irradiance_pi_and_no_gradient() {
        for cells in [Cells::new(1), Cells::new(64), Cells::new(1000), FINE] {
            let n = cells.count() as usize;
            let frame = Frame::from_z(Vec3::new(0.3, -0.4, 0.5).normalize());
            let i = cells.irradiance(&frame, &vec![Rgb::WHITE; n], &vec![1.0; n]);
            assert!((i.e.r - PI).abs() < 1e-3, "{cells:?} {}", i.e.r);
            assert!(i.translation[0].length() < 1e-3 && i.rotation[0].length() < 1e-3, "{cells:?} {i:?}");
        }
    }

    #[test]
    fn cells_are_about_as_many_as_asked_for_and_directions_fill_them() {
        for samples in [8, 64, 100, 256, 1000, 4096] {
            let cells = Cells::new(samples);
            assert!(cells.count().abs_diff(samples) <= cells.rings, "{samples} {cells:?}");
            // Mean of cos θ of a cosine-weighted direction is 2/3
            let sum: f32 = (0..cells.count()).map(|i| cells.direction(i, [0.5, 0.25]).z).sum();
            assert!((sum / cells.count() as f32 - 2.0 / 3.0).abs() < 0.02, "{cells:?}");
        }
    }

    #[test]
    fn gradients_are_finite_differences_of_irradiance() {
        let (p, h) = (Vec3::new(0.2, -0.1, 0.0), 0.02);
        let n = Vec3::new(0.1, 0.2, 1.0).normalize();
        let here = under_plane(FINE, p, n, pattern);
        let frame = Frame::from_z(n);
        for t in [frame.x, frame.y, (frame.x - frame.y).normalize()] {
            // E at both sides
            let moved = |s: f32| under_plane(FINE, p + t * s, n, pattern).e;
            let turned = |s: f32| under_plane(FINE, p, (n + t * s).normalize(), pattern).e;
            for c in 0..3 {
                let scale = 0.03 * here.translation[c].length();
                let expected = (moved(h)[c] - moved(-h)[c]) / (2.0 * h);
                let found = here.translation[c].dot(t);
                assert!((found - expected).abs() < scale, "translation {c} {t}: {found}, not {expected}");

                let expected = (turned(h)[c] - turned(-h)[c]) / (2.0 * h);
                let found = here.rotation[c].dot(n.cross(t));
                let scale = 0.03 * here.rotation[c].length();
                assert!((found - expected).abs() < scale, "rotation {c} {t}: {found}, not {expected}");
            }
        }
    }

    #[test]
    fn gradients_of_few_cells_are_near_those_of_many() {
        let (p, n) = (Vec3::new(0.2, -0.1, 0.0), Vec3::Z);
        let few = under_plane(Cells::new(256), p, n, pattern);
        let many = under_plane(FINE, p, n, pattern);
        for c in 0..2 {
            let limit = 0.15 * many.translation[c].length();
            assert!((few.translation[c] - many.translation[c]).length() < limit, "{few:?} {many:?}");
            let limit = 0.1 * many.rotation[c].length();
            assert!((few.rotation[c] - many.rotation[c]).length() < limit, "{few:?} {many:?}");
        }
    }
}

//! A homogeneous medium, in closed form.

use super::flight::{End, Flight, Segment};
use lumiris_numbers::math::{Rgb, Vec3};

/// A homogeneous medium.
#[derive(Clone, Copy, Debug)]
pub struct Homogeneous {
    /// Absorption (1/m).
    pub sigma_a: Rgb,
    /// Scattering (1/m).
    pub sigma_s: Rgb,
    /// Emitted radiance.
    pub le: Rgb,
    /// Asymmetry of the phase function.
    pub g: f32,
}

/// exp(−σd), where σ = 0 is no attenuation even over an infinite distance.
#[inline]
fn attenuation(sigma: f32, distance: f32) -> f32 {
    if sigma > 0.0 { (-sigma * distance).exp() } else { 1.0 }
}

impl Homogeneous {
    /// True if it emits light.
    pub fn is_emissive(&self) -> bool {
        !(self.le * self.sigma_a).is_black()
    }

    /// T over a distance (m), which may be infinite.
    #[inline]
    pub fn transmittance(&self, distance: f32) -> Rgb {
        (self.sigma_a + self.sigma_s).map(|sigma| attenuation(sigma, distance))
    }

    /// Emission along a segment towards its origin: ∫ T σ_a L_e = L_e σ_a/σ_t (1 − T).
    fn emitted(&self, transmittance: Rgb) -> Rgb {
        let sigma_t = self.sigma_a + self.sigma_s;
        let of = |c: usize| {
            let share = if sigma_t[c] > 0.0 { self.sigma_a[c] / sigma_t[c] } else { 0.0 };
            self.le[c] * share * (1.0 - transmittance[c])
        };
        Rgb::new(of(0), of(1), of(2))
    }

    /// A flight along a segment of a path of throughput `beta`.
    ///
    /// The distance follows σ_c exp(−σ_c t), where σ_c is σ_t of a channel that `u[1]` chooses in proportion to |β_c|.
    /// The density p is the sum over the channels (one-sample balance heuristic), so no channel gets a weight above
    /// 1/|β_c| relative to all. A medium without scattering is always passed.
    ///
    /// If `focus` returns a point of a light, half of the scattered flights get an equiangular distance about that
    /// point instead [Kulla and Fajardo 2012]. With P the probability of scattering, the density of distances is then
    /// (p + P·p_e)/2. Flights that pass are unchanged.
    #[inline]
    pub fn fly(&self, segment: &Segment, beta: Rgb, u: [f32; 4], focus: impl FnOnce() -> Option<Vec3>) -> Flight {
        let length = segment.length;
        let through = self.transmittance(length);

        // Choose a channel
        let emitted = if self.is_emissive() { self.emitted(through) } else { Rgb::BLACK };
        let p = beta.map(f32::abs);
        let sum = p.r + p.g + p.b;
        if self.sigma_s.is_black() || !(sum > 0.0 && sum.is_finite()) {
            return Flight { emitted, end: End::Through { weight: through } };
        }
        let p = (p / sum).to_array();
        let sigma_t = self.sigma_a + self.sigma_s;
        let channel = if u[1] < p[0] {
            0
        } else if u[1] < p[0] + p[1] || p[2] == 0.0 {
            1
        } else {
            2
        };
        let mean = |values: Rgb| p[0] * values.r + p[1] * values.g + p[2] * values.b;

        // Sample the distance in that channel
        let t = if sigma_t[channel] > 0.0 { -(-u[0]).ln_1p() / sigma_t[channel] } else { f32::INFINITY };
        if !(t < length) {
            let weight = through / mean(through);
            let weight = if weight.is_finite() { weight } else { Rgb::BLACK };
            return Flight { emitted, end: End::Through { weight } };
        }

        // Replace it by an equiangular distance
        let equiangular = focus().and_then(|focus| Equiangular::new(segment, focus));
        let t = match &equiangular {
            Some(equiangular) if u[2] < 0.5 => equiangular.sample(u[3]),
            Some(_) | None => t,
        };

        // Balance heuristic over the channels and the two techniques
        let here = self.transmittance(t);
        let density = match &equiangular {
            Some(equiangular) => 0.5 * (mean(sigma_t * here) + mean(Rgb::WHITE - through) * equiangular.pdf(t)),
            None => mean(sigma_t * here),
        };
        let weight = self.sigma_s * here / density;
        let weight = if weight.is_finite() { weight } else { Rgb::BLACK };
        Flight { emitted, end: End::Scattered { t, weight } }
    }
}

/// Distances along a segment with a uniform angle at a point.
#[derive(Clone, Copy, Debug)]
struct Equiangular {
    /// Distance of the segment's origin from the foot of the perpendicular, along the segment (m).
    before: f32,
    /// Distance of the point from the line (m).
    beside: f32,
    /// Angles of the ends from the perpendicular.
    angles: [f32; 2],
    length: f32,
}

/// Minimum distance from the line, relative to the distance of the foot of the perpendicular. Any positive value is
/// unbiased; 0 has no density.
const LEAST_BESIDE: f32 = 1e-3;

impl Equiangular {
    /// `None` if the segment has no extent.
    fn new(segment: &Segment, focus: Vec3) -> Option<Self> {
        let to_focus = focus - segment.o;
        let before = to_focus.dot(segment.d);
        let beside = (to_focus - segment.d * before).length().max(LEAST_BESIDE * before.abs());
        let angles = [-before, segment.length - before].map(|x| x.atan2(beside));
        let is_valid = beside > 0.0 && beside.is_finite() && angles[1] > angles[0];
        is_valid.then_some(Equiangular { before, beside, angles, length: segment.length })
    }

    /// A distance from the origin (m).
    fn sample(&self, u: f32) -> f32 {
        let angle = self.angles[0] + u * (self.angles[1] - self.angles[0]);
        (self.before + self.beside * angle.tan()).clamp(0.0, self.length.min(f32::MAX))
    }

    /// Density of [`Self::sample`] (1/m).
    fn pdf(&self, t: f32) -> f32 {
        let x = t - self.before;
        self.beside / ((self.angles[1] - self.angles[0]) * (self.beside * self.beside + x * x))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_numbers::estimators::stats::{Welford, chi_squared_test, sidak, z_test};
    use lumiris_test_support::random::{RngExt, pcg32};

    #[test]
    fn equiangular_distances_follow_their_density_by_chi_squared() {
        let cases = [(1.0, 0.5, 3.0), (-0.5, 0.2, 2.0), (4.0, 1.0, 3.0), (1.0, 0.0, 2.0), (0.7, 0.3, f32::INFINITY)];
        let significance = sidak(0.01, cases.len());
        for (k, (before, beside, length)) in cases.into_iter().enumerate() {
            let segment = Segment { o: Vec3::ZERO, d: Vec3::X, length };
            let equiangular = Equiangular::new(&segment, Vec3::new(before, beside, 0.0)).unwrap();
            let mut stream = pcg32([k as u32, 2, 5]);
            // Histogram of the distance; the last bin is unbounded
            let end = if length.is_finite() { f64::from(length) } else { 5.0 };
            let (bins, count) = (50, 400_000);
            let mut observed = vec![0.0; bins + 1];
            for _ in 0..count {
                let t = equiangular.sample(stream.random::<f32>());
                observed[((f64::from(t) / end * bins as f64) as usize).min(bins)] += 1.0;
            }
            let steps = 20_000;
            let of = |bin: usize| {
                let step = end / (bins * steps) as f64;
                let t = |i: usize| ((bin * steps + i) as f64 + 0.5) * step;
                (0..steps).map(|i| f64::from(equiangular.pdf(t(i) as f32)) * step).sum::<f64>()
            };
            let mut expected: Vec<f64> = (0..bins).map(|bin| of(bin) * f64::from(count)).collect();
            let rest = (f64::from(count) - expected.iter().sum::<f64>()).max(0.0);
            expected.push(rest);
            if length.is_finite() {
                // Rounding may put a distance at the end
                expected[bins - 1] += expected[bins];
                observed[bins - 1] += observed[bins];
                expected.truncate(bins);
                observed.truncate(bins);
            }
            let chi = chi_squared_test(&observed, &expected, significance);
            assert!(!chi.rejected, "{k}: {chi:?}");
        }
    }

    /// E[w; passes] = T and E[w; scatters] = σ_s/σ_t (1 − T) per channel, with and without a focus: 2 × 3 × 2 × 3 tests
    /// at a level of 10⁻⁵ each.
    #[test]
    fn weights_of_flights_have_the_expectations_of_transport() {
        let medium =
            Homogeneous { sigma_a: Rgb::new(0.1, 0.3, 0.0), sigma_s: Rgb::new(0.5, 0.1, 2.0), le: Rgb::BLACK, g: 0.0 };
        for (k, beta) in [Rgb::WHITE, Rgb::new(0.1, 2.0, 0.6), Rgb::new(1.0, 0.3, -0.2)].into_iter().enumerate() {
            for focus in [None, Some(Vec3::new(0.6, 0.3, 0.0))] {
                let segment = Segment { o: Vec3::ZERO, d: Vec3::X, length: 1.5 };
                let (mut passed, mut scattered) = ([Welford::new(); 3], [Welford::new(); 3]);
                let mut stream = pcg32([k as u32, 4, 4]);
                for _ in 0..400_000 {
                    let u = std::array::from_fn(|_| stream.random::<f32>());
                    let [mut w, mut s] = [Rgb::BLACK; 2];
                    match medium.fly(&segment, beta, u, || focus).end {
                        End::Through { weight } => w = weight,
                        End::Scattered { t, weight } => {
                            assert!((0.0..=1.5).contains(&t));
                            s = weight;
                        }
                    }
                    for c in 0..3 {
                        passed[c].add(f64::from(w[c]));
                        scattered[c].add(f64::from(s[c]));
                    }
                }
                let t = medium.transmittance(1.5);
                for c in 0..3 {
                    let albedo = medium.sigma_s[c] / (medium.sigma_s[c] + medium.sigma_a[c]);
                    for (found, expected) in [(&passed[c], t[c]), (&scattered[c], albedo * (1.0 - t[c]))] {
                        let z = z_test(found.mean(), f64::from(expected), found.standard_error());
                        assert!(z.p_value > 1e-5, "{beta:?} {focus:?} {c}: {found:?}, not {expected}");
                    }
                }
            }
        }
    }
}

//! Settings of photon maps.

/// Photon maps [Jensen 1996; Keller and Wald 2000].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotonMapSettings {
    /// Approximate number of photons in the global map; of a progressive map, in each pass.
    pub photons: u32,
    /// q: the fraction of the photon paths that also fill the global map; all of them fill the caustic map.
    pub caustic_ratio: f32,
    /// The storage rule of photons.
    pub storage: PhotonStorage,
    /// Photons per estimate (k).
    pub nearest: u32,
    /// Final-gather rays per diffuse vertex; 0 visualises the global map directly.
    pub gather: u32,
    /// Fraction of the final-gather rays that are guided by photons.
    pub guide: f32,
    /// New photons and smaller radii for every sample; `None` for a single map.
    pub progressive: Option<ProgressiveSettings>,
    /// Photon paths of the visibility cache, which any integrator can use; `None`: by the number of lights.
    pub visibility_photons: Option<u32>,
    /// Maximum memory of the maps (bytes).
    pub memory: u64,
    /// Maximum number of photon paths per map.
    pub paths: u64,
}

impl Default for PhotonMapSettings {
    fn default() -> Self {
        PhotonMapSettings {
            photons: 200_000,
            caustic_ratio: 0.2,
            storage: PhotonStorage::All,
            nearest: 50,
            gather: 4,
            guide: 0.0,
            progressive: None,
            visibility_photons: None,
            memory: 4 << 30,
            paths: 1 << 30,
        }
    }
}

/// The storage rule of photons [Keller and Wald 2000, §2].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PhotonStorage {
    /// All photons.
    All,
    /// With the probability p(x) of visual importance, but at least this. Unbiased.
    Floor(f32),
    /// With probability p(x), or none if p(x) is below this. Biased.
    CutOff(f32),
}

/// Settings of progressive photon mapping. Radii: r²ᵢ₊₁ = r²ᵢ·(i + α)/(i + 1) [Knaus and Zwicker 2011, Eq. 15].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProgressiveSettings {
    /// α, above 0 and below 1: near 0, variance decreases slowly and bias fast.
    pub alpha: f32,
    /// Radius of the first pass (m); `None`: the distance of the `nearest` photons at camera hits.
    pub radius: Option<f32>,
}

impl Default for ProgressiveSettings {
    fn default() -> Self {
        ProgressiveSettings { alpha: 0.5, radius: None }
    }
}

impl ProgressiveSettings {
    /// The ratio of the radius in pass `pass`, counted from 0, to the first radius.
    pub fn factor(&self, pass: u32) -> f32 {
        let alpha = f64::from(self.alpha);
        let squares = (1..=pass).map(|i| (f64::from(i) - 1.0 + alpha) / f64::from(i));
        squares.product::<f64>().sqrt() as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_fall_with_the_power_alpha_less_one_of_the_passes() {
        for alpha in [0.3, 0.5, 2.0 / 3.0, 0.9] {
            let progressive = ProgressiveSettings { alpha, radius: None };
            assert_eq!(progressive.factor(0), 1.0);
            let area = |pass| f64::from(progressive.factor(pass)).powi(2);
            let slope = (area(10_000) / area(100)).ln() / 100.0_f64.ln();
            assert!((slope - f64::from(alpha - 1.0)).abs() < 2e-3, "{alpha}: {slope}");
        }
    }
}

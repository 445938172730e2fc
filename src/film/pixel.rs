//! The samples of a pixel, and their sums as floating-point numbers.

use lumiris_numbers::math::{Rgb, Vec3};

/// The result of one camera sample.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelSample {
    /// Radiance times the filter weight.
    pub radiance: Rgb,
    /// Added to the mean of a replica, but not to the spread of its samples: the difference of the light paths that it
    /// shares with its pixel ([`replicas`](super::replicas)).
    pub offset: Rgb,
    /// Features of the first surface; `None` if the ray hits nothing.
    pub features: Option<Features>,
}

/// The features recorded by samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FeatureSet {
    /// None.
    None,
    /// All but the albedo, whose estimation may be slow.
    NoAlbedo,
    /// All.
    #[default]
    All,
}

/// Features of the first surface hit by a camera ray.
#[derive(Clone, Copy, Debug, Default)]
pub struct Features {
    /// Albedo estimate.
    pub albedo: Rgb,
    /// Shading normal, world space, towards the viewer.
    pub normal: Vec3,
    /// Distance from the camera along the ray.
    pub depth: f32,
    /// Material index.
    pub material: u32,
    /// Geometry index.
    pub object: u32,
}

/// Sums over the samples of a pixel, as floating-point numbers.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelSums {
    /// Number of samples.
    pub count: u64,
    /// Σ radiance.
    pub radiance: [f64; 3],
    /// Σ radiance², per channel.
    pub radiance_squared: [f64; 3],
    /// Number of samples that hit a surface.
    pub hits: u64,
    /// Σ albedo.
    pub albedo: [f64; 3],
    /// Σ normal.
    pub normal: [f64; 3],
    /// Σ depth of the samples that hit a surface.
    pub depth: f64,
    /// Material index of the first sample (by index) that hit a surface, plus one; 0 if there is none.
    pub material: u32,
    /// Geometry index of that sample, plus one; 0 if there is none.
    pub object: u32,
    /// Samples with a radiance that is not finite, or beyond [`LIMIT`](super::fixed_sums::LIMIT). They count as black.
    pub invalid: u64,
    /// Records of the irradiance cache requested by this pixel.
    pub records: u32,
}

impl PixelSums {
    /// Mean radiance; black without samples.
    pub fn mean(&self) -> [f64; 3] {
        self.radiance.map(|s| s / self.count.max(1) as f64)
    }

    /// Variance of the mean per channel, from the spread of the samples, if they are independent. 0 with fewer than two
    /// samples. See [`Film::read_rows_with_variances`](super::Film::read_rows_with_variances) for dependent samples.
    pub fn variance_of_mean(&self) -> [f64; 3] {
        if self.count < 2 {
            return [0.0; 3];
        }
        let n = self.count as f64;
        std::array::from_fn(|c| {
            let mean = self.radiance[c] / n;
            ((self.radiance_squared[c] / n - mean * mean).max(0.0)) / (n - 1.0)
        })
    }

    /// Subtracts `off` from the mean. The spread of the samples remains.
    pub(super) fn subtract(&mut self, off: [f32; 3]) {
        let count = self.count.max(1) as f64;
        for ((sum, squares), off) in self.radiance.iter_mut().zip(&mut self.radiance_squared).zip(off) {
            let before = *sum;
            *sum -= count * f64::from(off);
            *squares += (*sum * *sum - before * before) / count;
        }
    }
}

//! The available metrics.

use strum::{EnumString, IntoStaticStr, VariantNames};

/// A metric that can be requested.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "lowercase")]
pub enum Metric {
    /// Mean squared error.
    Mse,
    /// Root of the mean squared error.
    Rmse,
    /// Mean of squared errors relative to the squared reference.
    RelMse,
    /// Mean squared error relative to the mean square of the reference.
    Nmse,
    /// Peak signal-to-noise ratio.
    Psnr,
    /// ꟻLIP at one exposure.
    Flip,
    /// ꟻLIP over all exposures.
    HdrFlip,
    /// Luminance error in units of visual thresholds.
    Tvi,
    /// Mean difference.
    Bias,
    /// Tests against the variances.
    Z,
}

impl Metric {
    /// All metrics, in the order of tables.
    pub const ALL: [Metric; 10] = [
        Metric::Mse,
        Metric::Rmse,
        Metric::RelMse,
        Metric::Nmse,
        Metric::Psnr,
        Metric::Flip,
        Metric::HdrFlip,
        Metric::Tvi,
        Metric::Bias,
        Metric::Z,
    ];
}

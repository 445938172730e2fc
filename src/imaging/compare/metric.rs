//! The available metrics.

use strum::{EnumString, IntoStaticStr, VariantNames};

/// A metric that can be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "lowercase")]
pub enum Metric {
    /// Mean squared error.
    Mse,
    /// Its root.
    Rmse,
    /// Mean of squared errors relative to the squared reference.
    RelMse,
    /// Mean squared error relative to the mean square of the reference.
    Nmse,
    /// Peak signal-to-noise ratio.
    Psnr,
    /// ꟻLIP on a display.
    Flip,
    /// ꟻLIP over all exposures.
    HdrFlip,
    /// Error in thresholds of vision.
    Tvi,
    /// Mean difference.
    Bias,
    /// Tests against the variances.
    Z,
}

impl Metric {
    /// All, in the order of tables.
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

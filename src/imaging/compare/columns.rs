//! Metrics by name: table columns, JSON entries, and the limits of `--fail-above` and `--fail-below`.

use super::metric::Metric;
use super::scores::Scores;
use crate::imaging::heat::significant;
use std::collections::BTreeSet;
use strum::IntoStaticStr;

/// Direction of improvement of a metric.
#[derive(Clone, Copy, Debug, PartialEq, Eq, IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
pub enum Better {
    /// Small values are better.
    Lower,
    /// Large values are better.
    Higher,
    /// No order: a bias within its interval is as good as any other.
    #[strum(serialize = "none")]
    Neither,
}

/// A number computed for each image.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    /// Name on the command line and in JSON.
    pub key: &'static str,
    /// Heading of the table column.
    pub title: &'static str,
    /// Description.
    pub help: &'static str,
    /// The metric of the column. Columns without a metric are always computed, and shown if not 0.
    pub metric: Option<Metric>,
    /// Direction of improvement.
    pub better: Better,
    /// The number, if it was computed.
    pub value: fn(&Scores) -> Option<f64>,
    /// Formatting in tables.
    pub text: fn(f64) -> String,
}

const PLAIN: Column = Column {
    key: "",
    title: "",
    help: "",
    metric: Some(Metric::Mse),
    better: Better::Lower,
    value: |_| None,
    text: significant,
};

fn percent(v: f64) -> String {
    format!("{} %", significant(100.0 * v))
}

fn signed(v: f64) -> String {
    format!("{}{}", if v > 0.0 { "+" } else { "" }, significant(v))
}

fn decibels(v: f64) -> String {
    if v.is_finite() { format!("{v:.2}") } else { significant(v) }
}

/// All columns, in the order of tables.
pub const COLUMNS: [Column; 17] = [
    Column { key: "mse", title: "MSE", help: "mean squared error", value: |s| Some(s.differences.mse), ..PLAIN },
    Column {
        key: "rmse",
        title: "RMSE",
        help: "root of the mean squared error",
        metric: Some(Metric::Rmse),
        value: |s| Some(s.differences.rmse()),
        ..PLAIN
    },
    Column {
        key: "relmse",
        title: "relMSE",
        help: "mean of squared errors over the squared reference plus ε",
        metric: Some(Metric::RelMse),
        value: |s| Some(s.differences.relmse),
        ..PLAIN
    },
    Column {
        key: "nmse",
        title: "nMSE",
        help: "mean squared error over the mean square of the reference",
        metric: Some(Metric::Nmse),
        value: |s| Some(s.differences.nmse),
        ..PLAIN
    },
    Column {
        key: "psnr",
        title: "PSNR",
        help: "peak signal-to-noise ratio (dB)",
        metric: Some(Metric::Psnr),
        better: Better::Higher,
        value: |s| Some(s.psnr),
        text: decibels,
    },
    Column {
        key: "flip",
        title: "FLIP",
        help: "mean of LDR-FLIP at the exposure told",
        metric: Some(Metric::Flip),
        value: |s| s.flip,
        ..PLAIN
    },
    Column {
        key: "hdrflip",
        title: "HDR-FLIP",
        help: "mean of the greatest FLIP over all exposures",
        metric: Some(Metric::HdrFlip),
        value: |s| s.hdr_flip,
        ..PLAIN
    },
    Column {
        key: "tvi",
        title: "tvi",
        help: "root mean square error of luminance in thresholds of vision (Fan et al. 2006, eq. 12)",
        metric: Some(Metric::Tvi),
        value: |s| s.tvi,
        ..PLAIN
    },
    Column {
        key: "bias",
        title: "bias",
        help: "mean difference",
        metric: Some(Metric::Bias),
        better: Better::Neither,
        value: |s| s.bias.map(|b| b.mean),
        text: signed,
    },
    Column {
        key: "bias_ci95",
        title: "± 95 %",
        help: "half the width of the bias's 95 % confidence interval",
        metric: Some(Metric::Bias),
        better: Better::Neither,
        value: |s| s.bias.map(|b| b.half_width()),
        ..PLAIN
    },
    Column {
        key: "bias_z",
        title: "bias/σ",
        help: "bias in its standard errors",
        metric: Some(Metric::Bias),
        better: Better::Neither,
        value: |s| s.bias.map(|b| b.z()),
        text: signed,
    },
    Column {
        key: "z",
        title: "|z| > 3",
        help: "share of values more than three standard deviations off (0.27 % expected)",
        metric: Some(Metric::Z),
        better: Better::Neither,
        value: |s| s.significance.map(|z| z.beyond),
        text: percent,
    },
    Column {
        key: "z_max",
        title: "max |z|",
        help: "the largest deviation in standard deviations",
        metric: Some(Metric::Z),
        better: Better::Neither,
        value: |s| s.significance.map(|z| z.max_z),
        ..PLAIN
    },
    Column {
        key: "z_p",
        title: "p(max)",
        help: "probability of a largest |z| at least that large (Šidák); below 0.01 says: not noise",
        metric: Some(Metric::Z),
        better: Better::Neither,
        value: |s| s.significance.map(|z| z.family_p),
        ..PLAIN
    },
    Column {
        key: "chi2",
        title: "χ²/n",
        help: "mean of z², 1 expected",
        metric: Some(Metric::Z),
        better: Better::Neither,
        value: |s| s.significance.map(|z| z.mean_square),
        ..PLAIN
    },
    Column {
        key: "chi2_p",
        title: "p(χ²)",
        help: "probability of a χ² at least that large; below 0.01 says: not noise",
        metric: Some(Metric::Z),
        better: Better::Neither,
        value: |s| s.significance.map(|z| z.chi_squared_p),
        ..PLAIN
    },
    Column {
        key: "nonfinite",
        title: "NaN, inf",
        help: "pixels that are not finite: they take no part in anything else",
        metric: None,
        value: |s| Some(s.differences.nonfinite as f64),
        text: |v| format!("{v}"),
        ..PLAIN
    },
];

/// The columns of a table of `scores`: selected metrics that some image has, and counts other than 0.
pub fn shown_columns(metrics: &BTreeSet<Metric>, scores: &[&Scores]) -> Vec<&'static Column> {
    let is_shown = |c: &&Column| match c.metric {
        Some(metric) => metrics.contains(&metric) && scores.iter().any(|s| (c.value)(s).is_some()),
        None => scores.iter().any(|s| (c.value)(s).is_some_and(|v| v != 0.0)),
    };
    COLUMNS.iter().filter(is_shown).collect()
}

/// The column with the name `key`.
pub fn column(key: &str) -> Option<&'static Column> {
    COLUMNS.iter().find(|c| c.key.eq_ignore_ascii_case(key))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_metric_has_a_column_and_every_column_its_own_name() {
        for metric in Metric::ALL {
            assert!(COLUMNS.iter().any(|c| c.metric == Some(metric)), "{metric:?}");
        }
        for (i, c) in COLUMNS.iter().enumerate() {
            assert!(!c.key.is_empty() && !c.title.is_empty() && !c.help.is_empty());
            assert!(COLUMNS[..i].iter().all(|other| other.key != c.key), "{}", c.key);
            assert_eq!(column(&c.key.to_ascii_uppercase()).unwrap().key, c.key);
        }
        assert!(column("ssim").is_none());
    }

    #[test]
    fn numbers_are_written_as_their_columns_need() {
        let text = |key: &str, v: f64| (column(key).unwrap().text)(v);
        assert_eq!(text("z", 0.0027), "0.270 %");
        assert_eq!(
            (text("bias", 0.5), text("bias", -0.5), text("bias", 0.0)),
            ("+0.500".into(), "-0.500".into(), "0".into())
        );
        assert_eq!((text("psnr", 31.2345), text("psnr", f64::INFINITY)), ("31.23".into(), "inf".into()));
    }
}

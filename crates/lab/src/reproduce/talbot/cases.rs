//! The cases of the comparison: figures of the paper and of the thesis that compare methods.

use super::scenes::Which;
use lumiris::settings::SampleCounts;

/// A figure that compares methods.
pub(super) struct Case {
    pub id: &'static str,
    pub title: &'static str,
    pub intro: &'static str,
    pub scene: Which,
    /// Camera rays per pixel.
    pub primary: u32,
    /// Shadow rays of the baseline per camera ray.
    pub samples: u32,
    /// M and N of the paper.
    pub printed: Option<SampleCounts>,
    pub kind: Kind,
}

/// The comparison and its target.
#[derive(Clone, Copy)]
pub(super) enum Kind {
    /// Resampling compared with light sampling: reduction of variance in the paper, and target (percent), for the
    /// judged resampling.
    Reduction { paper: f64, target: f64, judged: Judged },
    /// Kinds of stratification of resampling, compared with none.
    Stratification,
}

/// The M and N that a verdict refers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Judged {
    /// Equal halves of the time for proposals and for samples, stratified.
    EqualHalves,
    /// The M and N of the paper, without stratification. If a proposal costs as much as a sample, equal halves of the
    /// time give M = N, without resampling.
    Printed,
}

impl Case {
    pub(super) const PAPER_4: Case = Case {
        id: "paper-figure-4",
        title: "Paper, figure 4: an environment and two area lights",
        intro: "Direct light with 20 camera rays per pixel: light sampling with 20 shadow rays at each, against resampling with M/N = T2/T1.",
        scene: Which::Both,
        primary: 20,
        samples: 20,
        printed: Some(SampleCounts { samples: 11, proposals: 168 }),
        kind: Kind::Reduction { paper: 70.0, target: 80.0, judged: Judged::EqualHalves },
    };
    pub(super) const PAPER_4_LIGHTS: Case = Case {
        id: "paper-figure-4-lights",
        title: "Paper, figure 4 without the environment: two area lights",
        intro: "The same with the two area lights alone, where most of the variance is that of visibility.",
        scene: Which::Lights,
        printed: Some(SampleCounts { samples: 11, proposals: 168 }),
        kind: Kind::Reduction { paper: 10.0, target: 30.0, judged: Judged::EqualHalves },
        ..Case::PAPER_4
    };
    pub(super) const THESIS_53: Case = Case {
        id: "thesis-figure-5.3",
        title: "Thesis, figure 5.3: an environment alone",
        intro: "Direct light with 10 camera rays per pixel: light sampling with 100 shadow rays at each, against resampling.",
        scene: Which::Environment,
        primary: 10,
        samples: 100,
        printed: Some(SampleCounts { samples: 64, proposals: 229 }),
        kind: Kind::Reduction { paper: 33.0, target: 45.0, judged: Judged::Printed },
    };
    pub(super) const THESIS_54: Case = Case {
        id: "thesis-figure-5.4",
        title: "Thesis, figure 5.4: stratification",
        intro: "Resampling without any stratification, with stratified proposals, and with strata of samples on top of these. \
                The thesis stratifies proposals by Latin hypercubes; here they are well distributed along a curve through all lights.",
        scene: Which::Both,
        primary: 1,
        samples: 32,
        printed: None,
        kind: Kind::Stratification,
    };
}

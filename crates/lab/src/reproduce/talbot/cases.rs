//! The cases of the comparison: figures of the paper and of the thesis that hold methods against each other.

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
    /// Shadow rays of the baseline at each.
    pub samples: u32,
    /// M and N of the paper.
    pub printed: Option<SampleCounts>,
    pub kind: Kind,
}

/// What is compared, and with what outcome.
#[derive(Clone, Copy)]
pub(super) enum Kind {
    /// Resampling against light sampling: reduction of variance in the paper, and to be reached here (percent), by the
    /// resampling that is judged.
    Reduction { paper: f64, target: f64, judged: Judged },
    /// Ways to stratify resampling against none.
    Stratification,
}

/// Which M and N a verdict is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Judged {
    /// Equal halves of the time for proposals and for samples, stratified.
    EqualHalves,
    /// Those of the paper, without stratification: where a proposal costs what a sample does, equal halves of the time
    /// are M = N, which resamples nothing.
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

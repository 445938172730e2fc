//! How many samples of each technique a vertex has.

use crate::bsdfs::Bsdf;
use crate::direct::Estimator;
use crate::direct::candidates::SampleAllocation;
use crate::direct::estimators::mc::{self, Mc};
use crate::direct::estimators::mis::Mis;
use crate::direct::estimators::ocv::Ocv;
use crate::settings::OcvForm;
use lumiris_numbers::estimators::mis::Heuristic;
use lumiris_numbers::samplers::SampleStream;

/// The samples of light and of BSDF sampling at the vertices of a batch, which are all traced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Techniques {
    samples: Samples,
    /// Weights of the techniques.
    pub heuristic: Heuristic,
    /// The only BSDF sample is the next segment of the path, which finds the emitter.
    by_path: bool,
    /// Control variates are determined as well.
    pub has_controls: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Samples {
    Mc(Mc),
    Mis(Mis),
}

impl Techniques {
    /// Those of an estimator, at vertices where paths may continue; `None` if it selects among its samples, or is fitted to
    /// them.
    pub fn of(estimator: &Estimator, continues: bool) -> Option<Self> {
        let (samples, has_controls) = match *estimator {
            // A single technique has the weight 1 by any heuristic
            Estimator::Mc(mc) => {
                return Some(Techniques {
                    samples: Samples::Mc(mc),
                    heuristic: Heuristic::Balance,
                    by_path: false,
                    has_controls: false,
                });
            }
            Estimator::Mis(mis) => (mis, false),
            Estimator::Ocv(Ocv { mis, form: OcvForm::Pixels }) => (mis, true),
            Estimator::Ocv(_)
            | Estimator::Ris(_)
            | Estimator::OptimalMis(_)
            | Estimator::Correlated(_)
            | Estimator::Contributing(_) => return None,
        };
        let by_path = continues && !has_controls && samples.has_one_bsdf_sample(samples.samples);
        Some(Techniques { samples: Samples::Mis(samples), heuristic: samples.heuristic, by_path, has_controls })
    }

    /// True if the path continues by the only BSDF sample of a vertex, unless its BSDF can only be evaluated. The sample
    /// counts in the weights of light samples, and is not drawn here.
    #[inline]
    pub fn are_by_path(&self) -> bool {
        self.by_path
    }

    /// Number of light samples beside that BSDF sample.
    pub fn light_samples(&self) -> f32 {
        self.usual().n_light
    }

    /// True if BSDF samples count for specular lobes only.
    pub(super) fn is_light_alone(&self) -> bool {
        matches!(self.samples, Samples::Mc(_))
    }

    /// True if a single sample draws its technique.
    pub(super) fn are_drawn(&self) -> bool {
        matches!(self.samples, Samples::Mis(Mis { samples: 1, .. }))
    }

    /// Numbers of samples where they do not depend on the BSDF.
    pub(super) fn usual(&self) -> SampleAllocation {
        match self.samples {
            Samples::Mc(mc) => SampleAllocation::fixed(mc.samples, 0),
            Samples::Mis(Mis { samples: 0 | 1, .. }) => SampleAllocation::fixed(0, 0),
            Samples::Mis(mis) => {
                let bsdf = mis.bsdf_samples(mis.samples);
                SampleAllocation::fixed(mis.samples - bsdf, bsdf).drawn_by_path(self.by_path)
            }
        }
    }

    /// Numbers of samples at a vertex of this BSDF, with the random numbers of its direct light.
    pub(super) fn allocation(&self, bsdf: &Bsdf<'_>, stream: &SampleStream) -> SampleAllocation {
        match self.samples {
            Samples::Mc(mc) => mc::allocation(mc.samples, bsdf),
            Samples::Mis(_) if self.by_path && !bsdf.has_non_specular() => {
                SampleAllocation::fixed(0, 1).drawn_by_path(true)
            }
            Samples::Mis(_) if self.by_path && !bsdf.is_only_evaluated() => self.usual(),
            Samples::Mis(mis) => mis.allocation(mis.samples, bsdf, stream),
        }
    }
}

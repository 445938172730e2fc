//! Number of samples per technique at a vertex.

use crate::bsdfs::Bsdf;
use crate::direct::Estimator;
use crate::direct::candidates::SampleAllocation;
use crate::direct::estimators::mc::{self, Mc};
use crate::direct::estimators::mis::Mis;
use crate::direct::estimators::ocv::Ocv;
use crate::settings::OcvForm;
use lumiris_numbers::estimators::heuristics::Heuristic;
use lumiris_numbers::samplers::SampleStream;

/// Light and BSDF samples at the vertices of a batch, for estimators that trace all samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Techniques {
    samples: Samples,
    /// Weights of the techniques.
    pub heuristic: Heuristic,
    /// True if the only BSDF sample is the next segment of the path, which hits the emitter.
    by_path: bool,
    /// True if control variates are computed as well.
    pub has_controls: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Samples {
    Mc(Mc),
    Mis(Mis),
}

impl Techniques {
    /// The techniques of an estimator. `continues` is true if paths may continue from the vertices. Returns `None` for
    /// estimators that select among their samples or are fitted to them.
    pub fn of(estimator: &Estimator, continues: bool) -> Option<Self> {
        let (samples, has_controls) = match *estimator {
            // A single technique has the weight 1 with any heuristic
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

    /// True if the only BSDF sample of a vertex is the next path segment, unless the BSDF can only be evaluated. The
    /// sample counts in the weights of light samples, and is not drawn here.
    #[inline]
    pub fn are_by_path(&self) -> bool {
        self.by_path
    }

    /// Number of light samples at most vertices.
    pub fn light_samples(&self) -> f32 {
        self.usual().n_light
    }

    /// True if BSDF samples count for specular lobes only.
    pub(super) fn is_light_alone(&self) -> bool {
        matches!(self.samples, Samples::Mc(_))
    }

    /// True if the technique of a single sample is chosen at random.
    pub(super) fn are_drawn(&self) -> bool {
        matches!(self.samples, Samples::Mis(Mis { samples: 1, .. }))
    }

    /// The allocation at most vertices, where it does not depend on the BSDF.
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

    /// The allocation at a vertex with this BSDF; `stream` has the random numbers of direct light.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdfs::microfacet::TrowbridgeReitz;
    use crate::bsdfs::{Dielectric, Diffuse};
    use lumiris_numbers::math::Rgb;
    use lumiris_numbers::samplers::SamplerKind;

    #[test]
    fn the_bsdf_sample_is_left_to_the_path_and_specular_bsdfs_get_no_light_samples() {
        let diffuse = Bsdf::Diffuse(Diffuse { reflectance: Rgb::WHITE });
        let distribution = TrowbridgeReitz::new(0.0, 0.0);
        let mirror = Bsdf::Dielectric(Dielectric { eta: 1.5, distribution });
        let stream = SampleStream::new(SamplerKind::Sobol, [0, 0], 0, 1);
        let mis = Estimator::Mis(Mis { samples: 4, heuristic: Heuristic::Power, bsdf_fraction: 0.25 });
        let draws = |estimator: &Estimator, continues: bool, bsdf: &Bsdf<'_>| {
            let allocation = Techniques::of(estimator, continues).unwrap().allocation(bsdf, &stream);
            let SampleAllocation { light_draws, bsdf_draws, n_light, n_bsdf } = allocation;
            ([light_draws, bsdf_draws], [n_light, n_bsdf])
        };

        // The expected numbers include the sample that the path draws
        assert_eq!(draws(&mis, true, &diffuse), ([3, 0], [3.0, 1.0]));
        assert_eq!(draws(&mis, false, &diffuse), ([3, 1], [3.0, 1.0]));
        assert_eq!(draws(&mis, true, &mirror), ([0, 0], [0.0, 1.0]));
        assert_eq!(draws(&mis, false, &mirror), ([0, 4], [0.0, 4.0]));
        let mc = Estimator::Mc(Mc { samples: 4 });
        assert_eq!(draws(&mc, true, &diffuse), ([4, 0], [4.0, 0.0]));
        assert_eq!(draws(&mc, true, &mirror), ([0, 4], [0.0, 4.0]));
    }
}

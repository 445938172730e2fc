//! A one-line description of the rendering, in plain words.

use super::image_settings::Settings;
use super::integrator::{EstimatorKind, IntegratorKind, SampleCounts};
use super::sampling::Allocation;

impl Settings {
    /// The estimator of direct light, path sharing, and the sample distribution, in one line. It depends only on the
    /// settings, so that an image's metadata give the same line.
    pub fn summary(&self) -> String {
        let i = &self.integrator;
        let mut parts = vec![format!("direct light: {}", self.direct_light())];
        let is_path = i.kind == IntegratorKind::Path && i.depth() > 1;
        if let Some(edge) = i.path_reuse.filter(|edge| is_path && *edge > 1) {
            parts.push(format!("paths shared by {edge} × {edge} pixels"));
        }
        if is_path && i.light_paths.is_some_and(|n| n > 0.0) {
            parts.push("caustics by light paths".to_owned());
        }
        match self.allocation() {
            Allocation::Adaptive => parts.push("adaptive sampling".to_owned()),
            Allocation::Auto | Allocation::Uniform => {}
        }
        parts.join("; ")
    }

    fn direct_light(&self) -> String {
        // Samples at the first vertex
        let i = &self.integrator;
        let [first, later] = [0, 1].map(|vertex| i.sample_counts_at(vertex));
        let SampleCounts { samples, proposals } = first;
        let count = |n: u32| if n == 1 { "1 sample".to_owned() } else { format!("{n} samples") };
        let at_first = match i.estimator {
            EstimatorKind::Auto | EstimatorKind::Mis => format!("{} (MIS)", count(samples)),
            EstimatorKind::Mc => format!("{} of lights", count(samples)),
            EstimatorKind::Ris => format!("{samples} of {proposals} proposals (RIS)"),
            EstimatorKind::Ocv => format!("{} (control variates)", count(samples)),
            EstimatorKind::OptimalMis => format!("{} (optimal MIS)", count(samples)),
            EstimatorKind::Correlated => format!("{} (correlated sampling)", count(samples)),
            EstimatorKind::Contributing => {
                let others = i.contributing.noncontributing_samples();
                format!("{} of contributing lights, {others} of others", count(samples))
            }
        };

        // Samples at later vertices
        if i.depth() > 1 && later.samples != samples {
            format!("{at_first}, {} at later vertices", later.samples)
        } else {
            at_first
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{IntegratorSettings, SamplingSettings};

    #[test]
    fn the_line_names_everything_that_is_chosen_and_nothing_else() {
        let mut s = Settings::default();
        s.integrator = s.integrator.of_kind(IntegratorKind::Direct);
        (s.integrator.estimator, s.integrator.samples) = (EstimatorKind::Mis, Some(8));
        assert_eq!(s.summary(), "direct light: 8 samples (MIS)");
        s.sampling.allocation = Allocation::Adaptive;
        s.integrator.path_reuse = Some(4);
        assert_eq!(s.summary(), "direct light: 8 samples (MIS); adaptive sampling", "direct light shares no paths");
        let path = IntegratorSettings {
            samples: Some(4),
            later_samples: Some(3),
            path_reuse: Some(6),
            light_paths: Some(0.25),
            ..s.integrator.of_kind(IntegratorKind::Path)
        };
        let of_path = Settings { integrator: path, sampling: SamplingSettings { spp: 64, ..s.sampling } };
        assert_eq!(
            of_path.summary(),
            "direct light: 4 samples (MIS), 3 at later vertices; paths shared by 6 × 6 pixels; caustics by light paths; adaptive sampling"
        );
    }
}

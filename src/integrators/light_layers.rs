//! What the samples of a batch find of each light group.
//!
//! Every contribution to a sample is of one light: what a path meets, and what a light sample or a BSDF sample brings. Only
//! directions that meet nothing are of all infinite lights together; their light is divided by what each of them sends.

use crate::accel::Hit;
use crate::direct::Estimator;
use crate::lights::{LightId, LightSampling};
use crate::scene::RenderJob;
use crate::settings::IntegratorKind;
use lumiris_numbers::math::{Rgb, Vec3};

/// Names of the layers by lights that a rendering has.
pub fn names(job: &RenderJob) -> &[String] {
    if is_wanted(job) && obstacle(job).is_none() { job.lights.layers.names() } else { &[] }
}

/// Number of these layers.
pub fn count(job: &RenderJob) -> usize {
    names(job).len()
}

/// True if lights name groups, and the settings ask for their layers.
pub fn is_wanted(job: &RenderJob) -> bool {
    job.settings().integrator.light_groups && !job.lights.layers.names().is_empty()
}

/// Why contributions cannot be told apart by lights; `None` if they can.
pub fn obstacle(job: &RenderJob) -> Option<&'static str> {
    let settings = &job.settings().integrator;
    let of_paths = matches!(settings.kind, IntegratorKind::Direct | IntegratorKind::Path);
    let has_sums = match Estimator::at_vertex(settings, 0) {
        Estimator::Mc(_) | Estimator::Mis(_) | Estimator::Contributing(_) => true,
        Estimator::Ris(ris) => !ris.has_control(),
        Estimator::Ocv(_) | Estimator::OptimalMis(_) | Estimator::Correlated(_) => false,
    };
    let reasons = [
        (!of_paths, "the integrators direct and path have them"),
        (job.world.scene.media.is_emissive(), "what media send out is of no light"),
        (!has_sums, "the estimators mc, mis, ris and contributing have them, without control variates"),
    ];
    reasons.into_iter().find(|(holds, _)| *holds).map(|(_, reason)| reason)
}

/// The light of each layer that the samples of a batch find.
#[derive(Debug, Default)]
pub(super) struct LayerSums {
    /// Number of layers; 0: none are kept.
    pub(super) layers: usize,
    /// By sample, then by layer.
    sums: Vec<Rgb>,
}

impl LayerSums {
    /// Begins a batch of samples.
    pub(super) fn begin(&mut self, samples: usize) {
        self.sums.clear();
        self.sums.resize(samples * self.layers, Rgb::BLACK);
    }

    /// True if there are any.
    #[inline]
    pub(super) fn are_kept(&self) -> bool {
        self.layers > 0
    }

    /// By sample, then by layer.
    pub(super) fn sums(&mut self) -> &mut [Rgb] {
        &mut self.sums
    }

    /// Adds what a sample has of a light at the point `p`. `wi` is the direction to it, unit.
    #[inline]
    pub(super) fn add(
        &mut self,
        lights: &LightSampling,
        sample: u32,
        (light, p, wi): (LightId, Vec3, Vec3),
        value: Rgb,
    ) {
        if !self.are_kept() {
            return;
        }
        if lights.infinite.len() > 1 && lights.infinite.contains(&light) {
            return self.add_infinite(lights, sample, (p, wi), value);
        }
        self.sums[sample as usize * self.layers + lights.layers.of(light)] += value;
    }

    /// Adds what a sample has of the emission of a surface.
    #[inline]
    pub(super) fn add_emission(&mut self, job: &RenderJob, sample: u32, hit: &Hit, value: Rgb) {
        if !self.are_kept() || value.is_black() {
            return;
        }
        if let Some(light) = job.lights.light_of(hit.geometry, hit.primitive) {
            self.sums[sample as usize * self.layers + job.lights.layers.of(light)] += value;
        }
    }

    /// Adds what a sample has of all infinite lights together, at `p` from the direction `wi`.
    #[inline]
    pub(super) fn add_infinite(&mut self, lights: &LightSampling, sample: u32, (p, wi): (Vec3, Vec3), value: Rgb) {
        if !self.are_kept() {
            return;
        }
        let of_sample = &mut self.sums[sample as usize * self.layers..][..self.layers];
        if let [light] = lights.infinite[..] {
            of_sample[lights.layers.of(light)] += value;
            return;
        }
        let whole = lights.le(p, wi);
        for &light in &lights.infinite {
            let le = lights.lights[light as usize].le(p, wi);
            let share = |c: usize| if whole[c] == 0.0 { 0.0 } else { value[c] * (le[c] / whole[c]) };
            of_sample[lights.layers.of(light)] += Rgb::new(share(0), share(1), share(2));
        }
    }
}

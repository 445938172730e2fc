//! The mixture of densities of the samples of a point, and the component densities of each sample.
//!
//! A sample is a direction with the emitter point in that direction, or with none. The components are the lobes of the
//! BSDF and the groups of lights. Their densities h_j have known integrals I_j: the probability of a lobe or of a group
//! within its technique. So p_α = (n_L/N) Σ_groups h_j + (n_B/N) Σ_lobes h_j, and the columns r_j = h_j/p_α have the
//! exact expectation I_j under the mixture. This has two requirements:
//!
//! * The density of BSDF sampling, which stops at the first emitter, is zero for a light sample hidden by another
//!   emitter.
//! * A *zero-valued* sample, whose unshadowed integrand is zero, belongs only to the component that drew it, as if
//!   every component had one such location. Its other densities need not be computed.

use super::candidates::{Candidate, SampleAllocation};
use super::domain;
use super::light_samples::light_candidate;
use super::point::ShadingPoint;
use crate::bsdfs::MAX_LOBES;
use crate::lights::SampleOfLight;
use crate::lights::mixture_groups::MAX_GROUPS;
use crate::scene::RenderJob;
use lumiris_numbers::estimators::ocv::MAX_COMPONENTS;
use lumiris_numbers::math::Vec3;

/// Tolerance for an expected number of samples that should be an integer.
const COUNT_ROUNDING: f32 = 1e-3;

/// The columns of a sample.
pub type Columns = [f32; MAX_COMPONENTS];

/// The non-zero columns of a sample.
#[derive(Clone, Copy, Debug, Default)]
pub struct NonZeroColumns {
    count: usize,
    columns: [(usize, f32); MAX_LOBES + 1],
}

impl NonZeroColumns {
    /// Components with their r_j.
    #[inline]
    pub fn as_slice(&self) -> &[(usize, f32)] {
        &self.columns[..self.count]
    }
}

/// The mixture of the samples of a point, and counts of samples without contribution.
#[derive(Clone, Copy, Debug)]
pub struct Mixture {
    /// I_j: lobes, then groups.
    pub integrals: Columns,
    /// Zero-valued samples by the component that drew them.
    pub zero_valued: [u32; MAX_COMPONENTS],
    /// Failed light samples: no light could be chosen.
    pub failed: u32,
    /// N.
    pub n: f32,
    n_light: f32,
    n_bsdf: f32,
    lobes: usize,
}

impl Mixture {
    /// The mixture at a point; groups are chosen with probabilities `pmfs`.
    fn new(job: &RenderJob, point: &ShadingPoint<'_>, allocation: &SampleAllocation, pmfs: &[f32; MAX_GROUPS]) -> Self {
        let lobes = job.lobes();
        let mut integrals = [0.0; MAX_COMPONENTS];
        if allocation.n_bsdf > 0.0 {
            integrals[0] = if lobes == MAX_LOBES { point.bsdf.first_lobe(point.wo) } else { 1.0 };
            if lobes == MAX_LOBES {
                integrals[1] = 1.0 - integrals[0];
            }
        }
        if allocation.n_light > 0.0 {
            for (integral, pmf) in integrals[lobes..].iter_mut().zip(pmfs) {
                *integral = *pmf;
            }
        }
        let n = allocation.n_light + allocation.n_bsdf;
        let (n_light, n_bsdf) = (allocation.n_light, allocation.n_bsdf);
        Mixture { integrals, zero_valued: [0; MAX_COMPONENTS], failed: 0, n, n_light, n_bsdf, lobes }
    }

    /// The lobe that a BSDF sample with the random number `uc` is drawn from.
    #[inline]
    pub fn lobe(&self, uc: f32) -> usize {
        usize::from(self.lobes == MAX_LOBES && uc >= self.integrals[0])
    }

    /// Density of the first lobe in the direction `wi`; `pdf` is the density of all lobes.
    #[inline]
    pub(super) fn p_lobe(&self, point: &ShadingPoint<'_>, wi: Vec3, pdf: f32) -> f32 {
        if self.lobes == MAX_LOBES && pdf > 0.0 { point.bsdf.pdf_first_lobe(point.wo, wi, pdf) } else { pdf }
    }

    /// The component of a group of lights.
    #[inline]
    pub fn component(&self, group: usize) -> usize {
        self.lobes + group
    }

    /// The candidate of a light sample of a group. Counts zero-valued samples.
    fn candidate(
        &mut self,
        job: &RenderJob,
        index: u32,
        point: &ShadingPoint<'_>,
        allocation: &SampleAllocation,
        group: usize,
        drawn: Option<SampleOfLight>,
    ) -> Option<Candidate> {
        let candidate = drawn.and_then(|drawn| {
            let c = light_candidate(job, index, point, allocation, drawn)?;
            Some(Candidate { group: group as u8, p_lobe: self.p_lobe(point, drawn.sample.wi, c.p_bsdf), ..c })
        });
        if candidate.is_none() {
            self.zero_valued[self.component(group)] += 1;
        }
        candidate
    }

    /// The non-zero r_j of a sample. None if the sum of the densities is zero or not finite.
    #[inline]
    pub fn columns(&self, c: &Candidate) -> NonZeroColumns {
        let scale = self.n / (c.n_light * c.p_light + c.n_bsdf * c.p_bsdf);
        let mut found = NonZeroColumns::default();
        if !(scale.is_finite() && scale > 0.0) {
            return found;
        }
        let group = self.component(usize::from(c.group));
        for (component, h) in [(0, c.p_lobe), (1, c.p_bsdf - c.p_lobe), (group, c.p_light)] {
            if h > 0.0 {
                found.columns[found.count] = (component, h * scale);
                found.count += 1;
            }
        }
        found
    }

    /// r_j of a zero-valued sample of component j; the other columns are 0.
    #[inline]
    pub fn zero_column(&self, component: usize) -> f32 {
        self.n / if component < self.lobes { self.n_bsdf } else { self.n_light }
    }
}

/// Draws the light samples of a point separately for each group of lights. A group gets N times its probability,
/// rounded by one random number for all groups. Returns the mixture at the point.
pub(super) fn draw_groups(
    job: &RenderJob,
    index: u32,
    point: &ShadingPoint<'_>,
    allocation: &SampleAllocation,
    records: &mut Vec<Candidate>,
) -> Mixture {
    // Mixture
    let lights = &job.lights;
    let ctx = point.light_ctx();
    let n = allocation.light_draws;
    let pmfs = if allocation.n_light > 0.0 { lights.groups.pmfs(&lights.sampler, &ctx) } else { [0.0; MAX_GROUPS] };
    let mut mixture = Mixture::new(job, point, allocation, &pmfs);

    // Systematic sampling: sample i is at (i + u)/N, and belongs to the group whose interval of cumulative probability
    // contains it
    let [u] = point.stream.domain(domain::GROUPS).draw::<1>();
    let (mut first, mut sum) = (0, 0.0);
    for (group, &pmf) in pmfs[..lights.groups.len()].iter().enumerate().filter(|(_, pmf)| **pmf > 0.0) {
        sum += f64::from(pmf) * f64::from(n);
        let end = ((sum - f64::from(u)).ceil() as u32).clamp(first, n);
        // The count is independent of u, so that the samples of a pixel are points of one set
        let count = ((pmf * n as f32 - COUNT_ROUNDING).ceil() as u32).max(end - first);
        for i in 0..end - first {
            let stream = point.stream.split(domain::GROUP + group as u32, count, i);
            let [u0, u1, u_choice] = stream.draw::<3>();
            let drawn = lights.sample_group(&ctx, group, pmf, u_choice, [u0, u1]);
            records.extend(mixture.candidate(job, index, point, allocation, group, drawn));
        }
        first = end;
    }
    mixture.failed = n - first;
    mixture
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::direct::candidates::SampledBy;
    use lumiris_numbers::math::{Ray, Rgb};

    /// Two lobes, and two groups of lights with 3 light samples.
    fn mixture() -> Mixture {
        let mut integrals = [0.0; MAX_COMPONENTS];
        integrals[..4].copy_from_slice(&[0.25, 0.75, 0.5, 0.5]);
        let zero_valued = [0; MAX_COMPONENTS];
        Mixture { integrals, zero_valued, failed: 0, n: 4.0, n_light: 3.0, n_bsdf: 1.0, lobes: MAX_LOBES }
    }

    #[test]
    fn columns_weighted_by_their_shares_sum_to_one() {
        let mixture = mixture();
        assert_eq!([mixture.lobe(0.2), mixture.lobe(0.3), mixture.component(1)], [0, 1, 3]);
        let candidate = |p_light, p_bsdf, p_lobe| Candidate {
            point: 0,
            sampled_by: SampledBy::Light,
            f: Rgb::WHITE,
            li: Rgb::WHITE,
            light: 0,
            p_light,
            p_bsdf,
            n_light: 3.0,
            n_bsdf: 1.0,
            p_lobe,
            group: 1,
            segment: Ray { o: Vec3::ZERO, d: Vec3::Z, t_max: 1.0, time: 0.0 },
        };

        // (n_B/N) Σ_lobes r_j + (n_L/N) Σ_groups r_j = 1
        for (p_light, p_bsdf, p_lobe, components) in
            [(0.5, 2.0, 0.5, &[0, 1, 3][..]), (0.5, 2.0, 2.0, &[0, 3]), (0.0, 2.0, 0.0, &[1]), (0.5, 0.0, 0.0, &[3])]
        {
            let columns = mixture.columns(&candidate(p_light, p_bsdf, p_lobe));
            let share = |component: usize| if component < MAX_LOBES { 0.25 } else { 0.75 };
            let sum: f32 = columns.as_slice().iter().map(|&(component, r)| share(component) * r).sum();
            assert!((sum - 1.0).abs() < 1e-6, "{columns:?}");
            let found: Vec<usize> = columns.as_slice().iter().map(|(component, _)| *component).collect();
            assert_eq!(found, components);
        }
        assert!(mixture.columns(&candidate(0.0, 0.0, 0.0)).as_slice().is_empty());
        assert_eq!([0, 3].map(|component| mixture.zero_column(component)), [4.0, 4.0 / 3.0]);
    }
}

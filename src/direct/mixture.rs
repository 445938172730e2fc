//! The mixture of densities from which a point's samples are drawn, and the densities of its components at each sample.
//!
//! A sample is a direction together with the point on an emitter that it refers to, or with none. The components are
//! the lobes of the BSDF and the groups of lights, with densities h_j whose integrals I_j are known: the probability of
//! a lobe or of a group within its technique. So p_α = (n_L/N) Σ_groups h_j + (n_B/N) Σ_lobes h_j, and the columns r_j
//! = h_j/p_α have expectation I_j under the mixture, exactly. This requires that
//!
//! * the density of BSDF sampling, which stops at the first emitter, is zero for a light sample that another emitter
//!   hides;
//! * a *zero-valued* sample, whose unshadowed integrand is zero, belongs only to the component that drew it, as if
//!   every component had one such location of its own: its other densities need not be computed.

use super::point::ShadingPoint;
use super::propose::{Candidate, SampleAllocation};
use crate::bsdfs::MAX_LOBES;
use crate::lights::groups::MAX_GROUPS;
use crate::scene::RenderJob;
use lumiris_numbers::estimators::ocv::MAX_COMPONENTS;
use lumiris_numbers::math::Vec3;

/// The columns of a sample.
pub type Columns = [f32; MAX_COMPONENTS];

/// What the samples of a point have in common: the mixture, and counts of samples without contribution.
#[derive(Clone, Copy, Debug)]
pub struct Mixture {
    /// I_j: lobes, then groups.
    pub integrals: Columns,
    /// Zero-valued samples by the component that drew them.
    pub zero_valued: [u32; MAX_COMPONENTS],
    /// Failed light samples, for which there was no light to choose.
    pub failed: u32,
    /// N.
    n: f32,
    n_light: f32,
    n_bsdf: f32,
    lobes: usize,
}

impl Mixture {
    /// The mixture at a point where groups are chosen with probabilities `pmfs`.
    pub(super) fn new(
        job: &RenderJob,
        point: &ShadingPoint<'_>,
        allocation: &SampleAllocation,
        pmfs: &[f32; MAX_GROUPS],
    ) -> Self {
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

    /// The lobe from which a BSDF sample with random number `uc` is drawn.
    #[inline]
    pub fn lobe(&self, uc: f32) -> usize {
        usize::from(self.lobes == MAX_LOBES && uc >= self.integrals[0])
    }

    /// Density of the first lobe in the direction `wi`, given that of all lobes, `pdf`.
    #[inline]
    pub(super) fn p_lobe(&self, point: &ShadingPoint<'_>, wi: Vec3, pdf: f32) -> f32 {
        if self.lobes == MAX_LOBES && pdf > 0.0 { point.bsdf.pdf_first_lobe(point.wo, wi, pdf) } else { pdf }
    }

    /// The component of a group of lights.
    #[inline]
    pub fn component(&self, group: usize) -> usize {
        self.lobes + group
    }

    /// N.
    #[inline]
    pub fn samples(&self) -> f32 {
        self.n
    }

    /// r_j of a sample, by component, of those that are not 0; none if its densities cannot be divided. How many there
    /// are, and they.
    #[inline]
    pub fn columns(&self, c: &Candidate) -> (usize, [(usize, f32); MAX_LOBES + 1]) {
        let scale = self.n / (c.n_light * c.p_light + c.n_bsdf * c.p_bsdf);
        let (mut count, mut columns) = (0, [(0, 0.0); MAX_LOBES + 1]);
        if !(scale.is_finite() && scale > 0.0) {
            return (count, columns);
        }
        let group = self.component(usize::from(c.group));
        for (component, h) in [(0, c.p_lobe), (1, c.p_bsdf - c.p_lobe), (group, c.p_light)] {
            if h > 0.0 {
                columns[count] = (component, h * scale);
                count += 1;
            }
        }
        (count, columns)
    }

    /// r_j of a zero-valued sample of component j; the other columns are 0.
    #[inline]
    pub fn zero_column(&self, component: usize) -> f32 {
        self.n / if component < self.lobes { self.n_bsdf } else { self.n_light }
    }
}

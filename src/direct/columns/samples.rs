//! Columns of samples: one sample of a technique for each vertex, and shadow segments.

use crate::accel::RayBatch;
use crate::direct::vertices::{BsdfSamples, Surface};
use crate::lights::sample_columns::LightSamples;
use lumiris_lanes::columns::{Column, Columns3, reserve, select_rows};
use lumiris_lanes::level;
use lumiris_lanes::vertex::{self as kernels, Ends, Rays};

/// Samples of one technique, one for each vertex.
#[derive(Debug, Default)]
pub(super) struct SampleColumns {
    pub(super) u: [Column; 3],
    /// Incident light: the directions of either technique, with their radiance, the density of light sampling, and the
    /// points on the lights.
    pub(super) incident: LightSamples,
    /// Values of the BSDF, and the density of BSDF sampling. The density of a technique is 0 if there is no sample. The
    /// density of the other technique is 0 if only this one can sample the direction.
    pub(super) bsdf: BsdfSamples,
    /// Contributions.
    pub(super) c: Columns3,
    /// Rays.
    pub(super) o: Columns3,
    pub(super) d: Columns3,
    pub(super) t_max: Column,
}

impl SampleColumns {
    /// Extends the columns to at least `len`.
    pub(super) fn reserve(&mut self, len: usize) {
        let SampleColumns { u: [u0, u1, u2], incident, bsdf, c, o, d, t_max } = self;
        incident.reserve(len);
        bsdf.reserve(len);
        [c, o, d].into_iter().for_each(|c| c.reserve(len));
        reserve(&mut [u0, u1, u2, t_max], len);
    }

    /// True if the unshadowed integrand f·|cos θ|·L of sample `i` is not zero, regardless of its weight. `by_light`
    /// selects the density of light sampling or of BSDF sampling.
    #[inline]
    pub(super) fn has_integrand(&self, i: usize, by_light: bool) -> bool {
        let p = if by_light { self.incident.pdf[i] } else { self.bsdf.pdf[i] };
        (p > 0.0) & !(self.bsdf.f_cos.rgb(i) * self.incident.li.rgb(i)).is_black()
    }

    /// Removes the light sample or the BSDF sample of a vertex.
    #[inline]
    pub(super) fn leave_out(&mut self, i: usize, by_light: bool) {
        let p = if by_light { &mut self.incident.pdf } else { &mut self.bsdf.pdf };
        p[i] = 0.0;
    }

    /// Computes the ray origins at the first `len` vertices, in the directions of the samples.
    pub(super) fn make_origins(&mut self, from: &Surface, len: usize) {
        kernels::origins(level(), &from.ends(len), self.incident.wi.get(len), &mut self.o.get_mut(len));
    }

    /// Computes the segments from the first `len` vertices to the ends of the samples.
    pub(super) fn make_segments(&mut self, from: &Surface, len: usize) {
        let SampleColumns { incident, o, d, t_max, .. } = self;
        let to = Ends { p: incident.p.get(len), p_error: incident.p_error.get(len), n: incident.n.get(len) };
        let mut rays = Rays { o: o.get_mut(len), d: d.get_mut(len), t_max: &mut t_max[..len] };
        kernels::segments(level(), &from.ends(len), incident.wi.get(len), &to, &incident.is_far[..len], &mut rays);
    }
}

/// Shadow segments of the samples.
#[derive(Debug, Default)]
pub(super) struct TracedSegments {
    /// Rows of their vertices.
    pub(super) rows: Vec<u32>,
    pub(super) rays: RayBatch,
    pub(super) occluded: Vec<bool>,
    /// See [`Self::mask`].
    mask: Vec<u32>,
    /// Indices of the segments that may pass surfaces or media.
    pub(super) crossing: Vec<u32>,
    /// Copies of some of the segments, and their occlusion.
    pub(super) some_rays: RayBatch,
    pub(super) some_occluded: Vec<bool>,
}

impl TracedSegments {
    /// Collects the segments of the first `n` rows for which `is_traced` is true; `time` is a column.
    pub(super) fn gather(
        &mut self,
        n: usize,
        is_traced: impl Fn(usize) -> bool,
        samples: &SampleColumns,
        time: &[f32],
    ) {
        select_rows(n, is_traced, &mut self.rows);
        self.rays.gather_rows(samples.o.get(n), samples.d.get(n), Some(&samples.t_max[..n]), time, &self.rows);
    }

    /// The mask of the first `n` rows: all bits at those with an unoccluded segment, else 0.
    pub(super) fn mask(&mut self, n: usize) -> &[u32] {
        self.mask.clear();
        self.mask.resize(n, 0);
        for (&row, &is_occluded) in self.rows.iter().zip(&self.occluded) {
            self.mask[row as usize] = u32::from(is_occluded).wrapping_sub(1);
        }
        &self.mask
    }

    /// Rows of the unoccluded segments.
    pub(super) fn visible(&self) -> impl Iterator<Item = usize> {
        self.rows.iter().zip(&self.occluded).filter(|(_, occluded)| !**occluded).map(|(&i, _)| i as usize)
    }
}

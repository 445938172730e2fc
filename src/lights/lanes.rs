//! Many samples of one light at one point, as structure of arrays.

use super::{Light, LightCtx};

/// Directions to one light. All slices have the same length.
#[derive(Debug)]
pub struct LightLanes<'a> {
    /// Unit directions to the light, by component.
    pub wi: [&'a mut [f32]; 3],
    /// Radiance that arrives if nothing is between, by channel. For delta lights it is the weight of the delta.
    pub li: [&'a mut [f32]; 3],
    /// Density per steradian; 1 for delta lights; 0 where there is no sample.
    pub pdf: &'a mut [f32],
}

impl Light {
    /// [`sample_li`](Self::sample_li) for each pair of numbers `u[0][i]`, `u[1][i]`. The results are those of single
    /// samples up to rounding.
    pub fn sample_li_lanes(&self, ctx: &LightCtx, u: [&[f32]; 2], out: &mut LightLanes<'_>) {
        for i in 0..out.pdf.len() {
            let Some(s) = self.sample_li(ctx, [u[0][i], u[1][i]]) else {
                out.pdf[i] = 0.0;
                continue;
            };
            for c in 0..3 {
                out.wi[c][i] = s.wi[c];
                out.li[c][i] = s.li[c];
            }
            out.pdf[i] = s.pdf;
        }
    }
}

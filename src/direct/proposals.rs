//! T1 of resampling: many light samples of a shading point at once, as a structure of arrays, with the target and the
//! weight of each.
//!
//! Proposals lie along one curve that visits all lights in turn and fills each of them: positions in [0, 1) choose a
//! light by inversion, and what remains of a position is a point on a Hilbert curve over the light's sample space.
//! Stratified positions are thus stratified over the lights and over each light [He and Owen 2016], and consecutive
//! proposals are neighbours on a light, as stratified resampling requires [Talbot 2005, §4.5.2, heuristic 2].
//!
//! A proposal keeps only q̂, r = w/(m·p) and q̂·r. The few that are drawn are sampled again, one at a time.

use super::ShadingPoint;
use super::propose::Candidate;
use crate::lights::{LightId, LightLanes, LightRun};
use crate::scene::RenderJob;
use crate::settings::{ProposalPoints, Target};
use lumiris_lanes::combine;
use lumiris_lanes::curve;
use lumiris_numbers::estimators::mis::Heuristic;
use lumiris_numbers::estimators::ris::weight;
use lumiris_numbers::math::hash::pcg4d;

/// Seed of the positions.
const POSITIONS: u32 = 0x517c_c1b7;

/// Proposals of several shading points.
#[derive(Debug, Default)]
pub struct Proposals {
    points: Vec<PointProposals>,
    light: Vec<LightId>,
    pmf: Vec<f32>,
    u: [Vec<f32>; 2],
    wi: [Vec<f32>; 3],
    li: [Vec<f32>; 3],
    f_cos: [Vec<f32>; 3],
    p_light: Vec<f32>,
    p_bsdf: Vec<f32>,
    /// Their targets.
    pub p_hat: Vec<f32>,
    /// Of each, the factor r of its f in the estimate over all proposals; 1/(M·p) for a single technique.
    pub r: Vec<f32>,
    /// The weight p_hat·r of each.
    pub weight: Vec<f32>,
    positions: Vec<u32>,
    jitter: Vec<u32>,
    runs: Vec<LightRun>,
}

/// The range of a point's proposals: light samples, then BSDF samples.
#[derive(Clone, Copy, Debug)]
pub struct PointProposals {
    /// First proposal.
    pub start: usize,
    /// First BSDF sample.
    pub bsdf_start: usize,
    /// End.
    pub end: usize,
}

/// Expected numbers of proposals per technique at a point, and how they are weighted.
#[derive(Clone, Copy, Debug)]
pub struct Techniques {
    /// Expected number of light samples.
    pub n_light: f32,
    /// Expected number of BSDF samples.
    pub n_bsdf: f32,
    /// Weights.
    pub heuristic: Heuristic,
    /// Target.
    pub target: Target,
}

impl Proposals {
    /// Removes all.
    pub fn clear(&mut self) {
        self.points.clear();
    }

    /// Number of proposals.
    pub fn count(&self) -> usize {
        self.points.last().map_or(0, |p| p.end)
    }

    /// The points to which the proposals belong.
    pub fn points(&self) -> &[PointProposals] {
        &self.points
    }

    /// Light and sample on it: id, probability of the choice, random numbers.
    pub fn light_sample(&self, proposal: usize) -> (LightId, f32, [f32; 2]) {
        (self.light[proposal], self.pmf[proposal], [self.u[0][proposal], self.u[1][proposal]])
    }

    /// Makes room for `len` proposals, keeping existing ones.
    fn grow(&mut self, len: usize) {
        if self.light.len() < len {
            let len = len.next_power_of_two();
            self.light.resize(len, 0);
            self.arrays().for_each(|array| array.resize(len, 0.0));
        }
    }

    fn arrays(&mut self) -> impl Iterator<Item = &mut Vec<f32>> {
        let scalars =
            [&mut self.pmf, &mut self.p_light, &mut self.p_bsdf, &mut self.p_hat, &mut self.r, &mut self.weight];
        let vectors = self.u.iter_mut().chain(&mut self.wi).chain(&mut self.li).chain(&mut self.f_cos);
        scalars.into_iter().chain(vectors)
    }

    /// Adds a point with `light_draws` light samples and the given BSDF samples. `phi` is a uniform number, well
    /// distributed over the samples of a pixel.
    pub fn add(
        &mut self,
        job: &RenderJob,
        point: &ShadingPoint<'_>,
        techniques: &Techniques,
        (light_draws, positions, phi): (u32, ProposalPoints, f32),
        bsdf_samples: &[Candidate],
    ) {
        let start = self.count();
        let bsdf_start = start + light_draws as usize;
        let end = bsdf_start + bsdf_samples.len();
        self.grow(end);
        self.points.push(PointProposals { start, bsdf_start, end });
        if light_draws > 0 {
            self.place(positions, phi, light_draws);
            self.sample_lights(job, point, start, bsdf_start);
            self.weigh_lights(job, point, techniques, start, bsdf_start);
        }
        let contributing = job.lights.contributing_lights(&point.light_ctx());
        for (i, c) in (bsdf_start..end).zip(bsdf_samples) {
            let cos = || point.bsdf.cos(c.segment.d.normalize());
            self.p_hat[i] = match techniques.target {
                Target::Fgl => c.f.luminance(),
                Target::Visibility => c.f.luminance() * contributing.visibility(c.light),
                // The cosine of a delta is part of its weight
                Target::Gv | Target::Gvl if c.drawn.is_delta() => c.f.luminance(),
                Target::Gv => cos(),
                Target::Gvl => cos() * c.li.luminance(),
            };
            self.r[i] = c.factor(techniques.heuristic);
            self.weight[i] = weight(self.p_hat[i], self.r[i]);
        }
    }

    /// Positions along the curve, ascending.
    fn place(&mut self, points: ProposalPoints, phi: f32, count: u32) {
        let phi = (f64::from(phi) * 4_294_967_296.0) as u32;
        self.positions.resize(count as usize, 0);
        self.jitter.resize(count as usize, 0);
        match points {
            ProposalPoints::Stratified => {
                curve::strata(phi, POSITIONS, count, &mut self.positions, &mut self.jitter);
            }
            ProposalPoints::Independent => {
                for (i, (position, jitter)) in self.positions.iter_mut().zip(&mut self.jitter).enumerate() {
                    [*position, *jitter, _, _] = pcg4d([phi, i as u32, POSITIONS, 0]);
                }
                self.positions.sort_unstable();
            }
        }
    }

    /// Lights at the positions, and directions to them.
    fn sample_lights(&mut self, job: &RenderJob, point: &ShadingPoint<'_>, start: usize, end: usize) {
        let lights = &job.lights;
        let ctx = point.light_ctx();
        lights.sampler.runs(&ctx, &self.positions, &mut self.runs);
        self.p_light[start..end].fill(0.0);

        for run in &self.runs {
            let [first, last] = run.places.map(|p| p as usize);
            let (from, to) = (start + first, start + last);
            for position in &mut self.positions[first..last] {
                *position = run.within(*position);
            }
            let [u0, u1] = &mut self.u;
            curve::hilbert_points(
                &self.positions[first..last],
                &self.jitter[first..last],
                &mut u0[from..to],
                &mut u1[from..to],
            );
            let mut lanes = LightLanes {
                wi: self.wi.each_mut().map(|a| &mut a[from..to]),
                li: self.li.each_mut().map(|a| &mut a[from..to]),
                pdf: &mut self.p_light[from..to],
            };
            let light = &lights.lights[run.light as usize];
            light.sample_li_lanes(&ctx, [&u0[from..to], &u1[from..to]], &mut lanes);
            lanes.pdf.iter_mut().for_each(|pdf| *pdf *= run.pmf);
            self.light[from..to].fill(run.light);
            self.pmf[from..to].fill(run.pmf);

            // Infinite lights overlap: a direction belongs to all of them together
            if lights.infinite.len() > 1 && lights.infinite.contains(&run.light) {
                for i in from..to {
                    if !(self.p_light[i] > 0.0) {
                        continue;
                    }
                    let wi = self.wi.each_ref().map(|a| a[i]).into();
                    let li = lights.le(wi);
                    self.li.iter_mut().enumerate().for_each(|(c, a)| a[i] = li[c]);
                    self.p_light[i] = lights.pdf_infinite(&ctx, wi);
                }
            }
        }
    }

    /// Targets and weights of light samples.
    fn weigh_lights(
        &mut self,
        job: &RenderJob,
        point: &ShadingPoint<'_>,
        techniques: &Techniques,
        start: usize,
        end: usize,
    ) {
        // Failed samples keep a direction that can be evaluated
        let wi = self.wi.each_ref().map(|a| &a[start..end]);
        let f_cos = self.f_cos.each_mut().map(|a| &mut a[start..end]);
        match techniques.target {
            Target::Fgl | Target::Visibility => {
                point.bsdf.eval_lanes(point.wo, wi, f_cos, &mut self.p_bsdf[start..end])
            }
            Target::Gv | Target::Gvl => {
                for i in start..end {
                    let wi = self.wi.each_ref().map(|a| a[i]).into();
                    self.p_bsdf[i] = point.bsdf.pdf(point.wo, wi);
                    self.f_cos.iter_mut().for_each(|a| a[i] = point.bsdf.cos(wi));
                }
            }
        }
        for run in self.runs.iter().filter(|run| job.lights.lights[run.light as usize].is_delta()) {
            self.p_bsdf[start + run.places[0] as usize..start + run.places[1] as usize].fill(0.0);
        }
        let proposals = combine::Proposals {
            f_cos: self.f_cos.each_ref().map(|a| &a[start..end]),
            li: self.li.each_ref().map(|a| &a[start..end]),
            p: &self.p_light[start..end],
            p_other: &self.p_bsdf[start..end],
            m: techniques.n_light,
            m_other: techniques.n_bsdf,
            heuristic: techniques.heuristic,
        };
        let mut out = combine::Weights {
            q_hat: &mut self.p_hat[start..end],
            r: &mut self.r[start..end],
            w: &mut self.weight[start..end],
        };
        combine::combine(lumiris_lanes::level(), &proposals, &mut out);
        match techniques.target {
            Target::Fgl | Target::Gvl => {}
            Target::Gv => {
                for i in start..end {
                    self.p_hat[i] = self.f_cos[0][i];
                    self.weight[i] = weight(self.p_hat[i], self.r[i]);
                }
            }
            Target::Visibility => {
                let contributing = job.lights.contributing_lights(&point.light_ctx());
                for run in &self.runs {
                    let visibility = contributing.visibility(run.light);
                    let places = start + run.places[0] as usize..start + run.places[1] as usize;
                    self.p_hat[places.clone()].iter_mut().for_each(|p_hat| *p_hat *= visibility);
                    self.weight[places].iter_mut().for_each(|weight| *weight *= visibility);
                }
            }
        }
    }
}

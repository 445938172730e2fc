//! T1 of resampling: many light samples of a shading point at once, in columns, with their targets and weights.
//!
//! Proposals lie along one curve that visits all lights and fills each of them. A position in [0, 1) chooses a light by
//! inversion; its remainder is a point on a Hilbert curve over the sample space of the light. Stratified positions are
//! thus stratified over the lights and over each light [He and Owen 2016]. Consecutive proposals are neighbours on a
//! light, as stratified resampling requires [Talbot 2005, §4.5.2, heuristic 2].
//!
//! All light samples of a chunk of points are made together, sorted by light, and kept, so that selected samples are
//! not sampled again.

use super::candidates::Candidate;
use super::point::ShadingPoint;
use crate::lights::sample_columns::{ChosenLight, LightSamples, NO_LIGHT, Scratch};
use crate::lights::{LightRun, SampleOfLight};
use crate::scene::RenderJob;
use crate::settings::{ProposalPoints, Target};
use lumiris_lanes::columns::{Column, Columns3, padded};
use lumiris_lanes::lane::LANES;
use lumiris_lanes::{hilbert, ris_weights};
use lumiris_numbers::estimators::heuristics::Heuristic;
use lumiris_numbers::estimators::ris::control::{ControlSum, doubt};
use lumiris_numbers::estimators::ris::weight;
use lumiris_numbers::math::Rgb;
use lumiris_numbers::math::hash::pcg4d;

/// Seed of the positions.
const POSITIONS: u32 = 0x517c_c1b7;

/// Proposals of several shading points.
#[derive(Debug, Default)]
pub struct ProposalColumns {
    points: Vec<PointProposals>,
    /// Light and probability of its choice; [`NO_LIGHT`] for BSDF samples.
    chosen: Vec<ChosenLight>,
    u: [Column; 2],
    /// Positions of the shading points.
    p: Columns3,
    samples: LightSamples,
    scratch: Scratch,
    f_cos: [Vec<f32>; 3],
    p_bsdf: Vec<f32>,
    /// Target density of each proposal (unnormalised).
    pub q_hat: Vec<f32>,
    /// Factor r of f in the estimate over all proposals; 1/(M·p) for a single technique.
    pub r: Vec<f32>,
    /// Resampling weight q_hat·r of each proposal.
    pub weight: Vec<f32>,
    /// V̂ of each proposal, for targets with learned visibility.
    pub visibility: Vec<f32>,
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

/// Expected numbers of proposals per technique at a point, MIS heuristic and target.
#[derive(Clone, Copy, Debug)]
pub struct ProposalTechniques {
    /// Expected number of light samples.
    pub n_light: f32,
    /// Expected number of BSDF samples.
    pub n_bsdf: f32,
    /// Weights.
    pub heuristic: Heuristic,
    /// Target.
    pub target: Target,
}

/// The light samples of a point.
#[derive(Clone, Copy, Debug)]
pub struct LightProposals {
    /// Number of samples.
    pub draws: u32,
    /// Their distribution over the lights.
    pub points: ProposalPoints,
    /// Uniform number, well distributed over the samples of a pixel.
    pub phi: f32,
}

impl ProposalColumns {
    /// Removes all proposals.
    pub fn clear(&mut self) {
        self.points.clear();
    }

    /// Number of proposals.
    pub fn count(&self) -> usize {
        self.points.last().map_or(0, |p| p.end)
    }

    /// The ranges of proposals by point.
    pub fn points(&self) -> &[PointProposals] {
        &self.points
    }

    /// A light sample; `None` if it failed.
    pub fn light_sample(&self, proposal: usize) -> Option<SampleOfLight> {
        let sample = self.samples.get(proposal, self.p.vec3(proposal))?;
        Some(SampleOfLight { light: self.chosen[proposal].light, sample })
    }

    /// The candidate of a light sample of `point`, see [`Candidate::of_light`]; `None` if it failed or its integrand is
    /// zero.
    pub(super) fn candidate(
        &self,
        proposal: usize,
        index: u32,
        point: &ShadingPoint<'_>,
        target: Target,
    ) -> Option<Candidate> {
        let drawn = self.light_sample(proposal)?;
        let sample = &drawn.sample;
        let f_cos = if target.has_visibility() {
            point.bsdf.f(point.wo, sample.wi) * point.bsdf.cos(sample.wi)
        } else {
            Rgb::from_array(self.f_cos.each_ref().map(|column| column[proposal]))
        };
        let f = f_cos * sample.li;
        (!f.is_black()).then(|| Candidate::of_light(index, f, &drawn, point.light_segment(sample)))
    }

    /// Σ c·V̂ over the proposals of a point; `bsdf_samples` are its BSDF samples.
    pub fn control(&self, range: PointProposals, bsdf_samples: &[Candidate]) -> ControlSum {
        let PointProposals { start, bsdf_start, end } = range;
        let mut control = ControlSum::default();
        // A proposal without weight is never drawn, and has no part in either sum
        for i in (start..bsdf_start).filter(|&i| self.weight[i] > 0.0) {
            let f_cos = self.f_cos.each_ref().map(|a| a[i]);
            control.propose(Rgb::from_array(f_cos) * self.samples.li.rgb(i) * self.r[i], self.visibility[i]);
        }
        for (i, c) in (bsdf_start..end).zip(bsdf_samples).filter(|(i, _)| self.weight[*i] > 0.0) {
            control.propose(c.f * self.r[i], self.visibility[i]);
        }
        control
    }

    /// Reserves memory for `len` proposals, keeping existing ones.
    fn grow(&mut self, len: usize) {
        self.chosen.resize(len, ChosenLight::NONE);
        if self.r.len() < len {
            let len = len.next_power_of_two().max(LANES);
            self.p.reserve(len);
            self.samples.reserve(len);
            let scalars = [&mut self.p_bsdf, &mut self.q_hat, &mut self.r, &mut self.weight, &mut self.visibility];
            scalars.into_iter().chain(&mut self.u).chain(&mut self.f_cos).for_each(|array| array.resize(len, 0.0));
        }
    }

    /// Adds a point with the given BSDF samples and light samples; [`evaluate`](Self::evaluate) completes the light
    /// samples.
    pub fn add(
        &mut self,
        job: &RenderJob,
        point: &ShadingPoint<'_>,
        techniques: &ProposalTechniques,
        light: LightProposals,
        bsdf_samples: &[Candidate],
    ) {
        // Light samples: positions and lights
        let start = self.count();
        let bsdf_start = start + light.draws as usize;
        let end = bsdf_start + bsdf_samples.len();
        self.grow(end);
        self.points.push(PointProposals { start, bsdf_start, end });
        self.chosen[start..end].fill(ChosenLight::NONE);
        if light.draws > 0 {
            self.place(light);
            self.choose_lights(job, point, start, bsdf_start);
        }

        // BSDF samples: targets and weights
        let ctx = point.light_ctx();
        let contributing = job.lights.contributing_lights(&ctx);
        for (i, c) in (bsdf_start..end).zip(bsdf_samples) {
            let cos = || point.bsdf.cos(c.segment.d.normalize());
            self.q_hat[i] = match techniques.target {
                Target::Fgl => c.f.luminance(),
                Target::Visibility | Target::VisibilityControl => {
                    self.visibility[i] = job.lights.visibility(&ctx, &contributing, c.light);
                    c.f.luminance() * factor(techniques.target, self.visibility[i])
                }
                // The cosine of a delta sample is part of its weight
                Target::Gv | Target::Gvl if c.sampled_by.is_delta() => c.f.luminance(),
                Target::Gv => cos(),
                Target::Gvl => cos() * c.li.luminance(),
            };
            self.r[i] = c.factor(techniques.heuristic);
            self.weight[i] = weight(self.q_hat[i], self.r[i]);
        }
    }

    /// Sets the positions along the curve, in ascending order.
    fn place(&mut self, LightProposals { draws: count, points, phi }: LightProposals) {
        let phi = (f64::from(phi) * 4_294_967_296.0) as u32;
        self.positions.resize(count as usize, 0);
        self.jitter.resize(count as usize, 0);
        match points {
            ProposalPoints::Stratified => {
                hilbert::strata(phi, POSITIONS, count, &mut self.positions, &mut self.jitter);
            }
            ProposalPoints::Independent => {
                for (i, (position, jitter)) in self.positions.iter_mut().zip(&mut self.jitter).enumerate() {
                    [*position, *jitter, _, _] = pcg4d([phi, i as u32, POSITIONS, 0]);
                }
                self.positions.sort_unstable();
            }
        }
    }

    /// Sets the lights at the positions, and the sample points on them.
    fn choose_lights(&mut self, job: &RenderJob, point: &ShadingPoint<'_>, start: usize, end: usize) {
        job.lights.sampler.runs(&point.light_ctx(), &self.positions, &mut self.runs);
        for run in &self.runs {
            let [first, last] = run.range.map(|p| p as usize);
            let (from, to) = (start + first, start + last);
            for position in &mut self.positions[first..last] {
                *position = run.within(*position);
            }
            self.chosen[from..to].fill(ChosenLight { light: run.light, pmf: run.pmf });
        }
        let [u0, u1] = &mut self.u;
        hilbert::hilbert_points(&self.positions, &self.jitter, &mut u0[start..end], &mut u1[start..end]);
        (start..end).for_each(|i| self.p.set(i, point.p));
    }

    /// Computes directions, targets and weights of the light samples of all `points`, which were added in this order.
    pub fn evaluate(
        &mut self,
        job: &RenderJob,
        points: &[ShadingPoint<'_>],
        techniques: impl Fn(&ShadingPoint<'_>) -> ProposalTechniques,
    ) {
        let n = self.count();
        self.samples.reserve(padded(n));
        let [u0, u1] = &self.u;
        job.lights.sample_chosen(&self.chosen[..n], &self.p, [u0, u1], &mut self.scratch, &mut self.samples);
        for (index, point) in points.iter().enumerate() {
            let PointProposals { start, bsdf_start: end, .. } = self.points[index];
            if end > start {
                job.lights.unite_infinite(start..end, |_| point.light_ctx(), &mut self.samples);
                self.weigh_lights(job, point, &techniques(point), start, end);
            }
        }
    }

    /// Computes targets and weights of light samples.
    fn weigh_lights(
        &mut self,
        job: &RenderJob,
        point: &ShadingPoint<'_>,
        techniques: &ProposalTechniques,
        start: usize,
        end: usize,
    ) {
        self.evaluate_bsdf(point, techniques.target, start, end);

        // Weights, by targets without visibility
        let LightSamples { li, pdf, is_delta, .. } = &self.samples;
        for (p_bsdf, is_delta) in self.p_bsdf[start..end].iter_mut().zip(&is_delta[start..end]) {
            *p_bsdf = if *is_delta { 0.0 } else { *p_bsdf };
        }
        let proposals = ris_weights::Proposals {
            f_cos: self.f_cos.each_ref().map(|a| &a[start..end]),
            li: li.get(end).map(|c| &c[start..]),
            p: &pdf[start..end],
            p_other: &self.p_bsdf[start..end],
            m: techniques.n_light,
            m_other: techniques.n_bsdf,
            heuristic: techniques.heuristic,
        };
        let mut out = ris_weights::Weights {
            q_hat: &mut self.q_hat[start..end],
            r: &mut self.r[start..end],
            w: &mut self.weight[start..end],
        };
        ris_weights::weigh(lumiris_lanes::level(), &proposals, &mut out);
        self.adapt_weights(job, point, techniques.target, start, end);
    }

    /// Computes values and densities of the BSDF for light samples; targets without the BSDF use its cosine only.
    fn evaluate_bsdf(&mut self, point: &ShadingPoint<'_>, target: Target, start: usize, end: usize) {
        // Failed samples keep a direction that can be evaluated
        let wi = self.samples.wi.get(end).map(|c| &c[start..]);
        let f_cos = self.f_cos.each_mut().map(|a| &mut a[start..end]);
        match target {
            Target::Fgl | Target::Visibility | Target::VisibilityControl => {
                point.bsdf.eval_lanes(point.wo, wi, f_cos, &mut self.p_bsdf[start..end])
            }
            Target::Gv | Target::Gvl => {
                for i in start..end {
                    let wi = self.samples.wi.vec3(i);
                    self.p_bsdf[i] = point.bsdf.pdf(point.wo, wi);
                    self.f_cos.iter_mut().for_each(|a| a[i] = point.bsdf.cos(wi));
                }
            }
        }
    }

    /// Adapts the weights of light samples to the target.
    fn adapt_weights(&mut self, job: &RenderJob, point: &ShadingPoint<'_>, target: Target, start: usize, end: usize) {
        match target {
            Target::Fgl | Target::Gvl => {}
            // The cosine alone
            Target::Gv => {
                for i in start..end {
                    self.q_hat[i] = self.f_cos[0][i];
                    self.weight[i] = weight(self.q_hat[i], self.r[i]);
                }
            }
            Target::Visibility | Target::VisibilityControl => {
                let ctx = point.light_ctx();
                let contributing = job.lights.contributing_lights(&ctx);
                // The samples of a light are consecutive
                let (mut last, mut visibility, mut factor_of_last) = (NO_LIGHT, 0.0, 0.0);
                for i in start..end {
                    let light = self.chosen[i].light;
                    if last != light {
                        visibility = job.lights.visibility(&ctx, &contributing, light);
                        (last, factor_of_last) = (light, factor(target, visibility));
                    }
                    self.visibility[i] = visibility;
                    self.q_hat[i] *= factor_of_last;
                    self.weight[i] *= factor_of_last;
                }
            }
        }
    }
}

/// Factor of the target for the estimated visibility `v`.
#[inline]
fn factor(target: Target, v: f32) -> f32 {
    if target == Target::VisibilityControl { doubt(v) } else { v.sqrt() }
}

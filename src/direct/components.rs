//! Estimates that measure samples against the components of their mixture: `ocv` and `optimal-mis`.
//!
//! After T2, the samples of a point become sums of normal equations in the columns c_j = h_j/p_α − I_j, whose expectation
//! is 0, and in y = f·V/p_α. The estimate is ȳ − Σ_j β_j c̄_j [Fan et al. 2006, Eq. 7]; forms differ in what β is fitted to.

use super::ShadePoint;
use super::mixture::Mixture;
use super::propose::{Candidates, Drawn};
use super::visibility::{Segments, is_traced};
use crate::accel::RayBatch;
use crate::estimators::ocv::forms::{Outcome, PAPER_LAMBDA};
use crate::estimators::ocv::{self, Form, MAX_COMPONENTS, NormalEquations, Penalty};
use crate::math::Rgb;
use crate::scene::{EstimatorKind, IntegratorSettings, OptimalForm, Split, World};

/// Domain below the stream of a shading point: half h of its samples uses `HALF + h`.
const HALF: u32 = 32;

/// Penalty of `optimal-mis`, which is none but for what keeps the system of a light that is hardly ever chosen regular.
const OPTIMAL_PENALTY: Penalty = Penalty { ridge: 0.01, ..Penalty::NONE };

/// Fits that estimates take part in: sums so far, and coefficients for those to come.
///
/// An estimate uses the coefficients of its fit and adds its samples to the sums; [`Self::solve`] begins a new block with
/// coefficients that are fitted to all sums. What is estimated after that must be independent of what was before.
#[derive(Clone, Debug)]
pub struct Fits {
    equations: NormalEquations,
    penalty: Penalty,
    sums: Vec<f32>,
    beta: Vec<f32>,
}

impl Default for Fits {
    fn default() -> Self {
        let (equations, penalty) = (NormalEquations::new(0), Penalty::default());
        Fits { equations, penalty, sums: Vec::new(), beta: Vec::new() }
    }
}

impl Fits {
    /// `count` fits without samples for the mixtures of a world; none if its estimates do not use fits.
    pub fn new(world: &World, settings: &IntegratorSettings, count: usize) -> Self {
        if !settings.is_progressive() {
            return Fits::default();
        }
        let equations = NormalEquations::new(world.components());
        let penalty = penalty(settings);
        Fits {
            equations,
            penalty,
            sums: vec![0.0; count * equations.len()],
            beta: vec![0.0; count * 3 * equations.components()],
        }
    }

    /// True if there are none: estimates are then those without coefficients.
    pub fn is_empty(&self) -> bool {
        self.sums.is_empty()
    }

    /// Begins a block. Returns the number of fits whose system has no solution; their estimates are those of MIS.
    pub fn solve(&mut self) -> u64 {
        let betas = self.beta.chunks_mut((3 * self.equations.components()).max(1));
        let fits = self.sums.chunks(self.equations.len().max(1)).zip(betas);
        fits.map(|(sums, beta)| u64::from(self.equations.solve(sums, self.penalty, beta).is_err())).sum()
    }

    fn beta(&self, fit: u32) -> &[f32] {
        let len = 3 * self.equations.components();
        &self.beta[fit as usize * len..][..len]
    }

    fn add(&mut self, fit: u32, sums: &[f32]) {
        let len = self.equations.len();
        self.equations.merge(&mut self.sums[fit as usize * len..][..len], sums);
    }
}

/// The penalty of the fits.
fn penalty(settings: &IntegratorSettings) -> Penalty {
    if settings.estimator == EstimatorKind::OptimalMis { OPTIMAL_PENALTY } else { Penalty::default() }
}

/// The stage's buffers.
#[derive(Debug, Default)]
pub struct Components {
    is_free: Vec<bool>,
    hidden: RayBatch,
    hidden_of: Vec<u32>,
    is_hidden: Vec<bool>,
    sums: Vec<f32>,
    /// Systems that were to be solved.
    pub systems: u64,
    /// Those without solution, whose estimates are those of MIS.
    pub ill_conditioned: u64,
    /// Rays traced among emitters to find out what hides behind one.
    pub emitter_rays: u64,
}

/// Both halves of every point's samples, as points with random numbers of their own, one after the other.
pub(super) fn halves<'a>(points: &[ShadePoint<'a>]) -> Vec<ShadePoint<'a>> {
    let half = |point: &ShadePoint<'a>, h: u32| {
        let samples = (point.split.samples + 1 - h) / 2;
        let split = Split { samples, proposals: samples };
        ShadePoint { split, stream: point.stream.domain(HALF + h), ..*point }
    };
    points.iter().flat_map(|p| [half(p, 0), half(p, 1)]).collect()
}

impl Components {
    /// The estimates of all points from their traced candidates; `out[i]` belongs to `points[i]`, or to both halves of a point,
    /// `points[2i]` and `points[2i + 1]`, where the form has halves.
    pub(super) fn resolve(
        &mut self,
        world: &World,
        settings: &IntegratorSettings,
        points: &[ShadePoint<'_>],
        (candidates, contributions, segments): (&mut Candidates, &[Rgb], &Segments),
        fits: &mut Fits,
        out: &mut [Rgb],
    ) {
        (self.systems, self.ill_conditioned) = (0, 0);
        self.find_hidden(world, candidates, contributions, segments);
        let equations = NormalEquations::new(world.components());
        let is_paper = settings.estimator == EstimatorKind::Ocv && settings.ocv.form == Form::Paper;
        self.gather(equations, is_paper, candidates, contributions);

        let form = match (settings.estimator, settings.optimal_mis) {
            (EstimatorKind::OptimalMis, OptimalForm::Direct) => Form::Regression,
            (EstimatorKind::OptimalMis, OptimalForm::Progressive) => Form::Progressive,
            _ => settings.ocv.form,
        };
        let len = equations.len();
        let sums = |i: usize| &self.sums[i * len..][..len];
        for (i, out) in out.iter_mut().enumerate() {
            let outcome = match form {
                Form::Progressive if fits.is_empty() => {
                    Outcome { estimate: equations.mean(sums(i)), ill_conditioned: 0 }
                }
                Form::Progressive => {
                    let estimate = equations.estimate(sums(i), fits.beta(points[i].fit));
                    fits.add(points[i].fit, sums(i));
                    Outcome { estimate, ill_conditioned: 0 }
                }
                Form::Crossfit => ocv::crossfit(equations, [sums(2 * i), sums(2 * i + 1)], penalty(settings)),
                Form::Regression => ocv::regression(equations, sums(i), penalty(settings)),
                Form::Paper => {
                    let present =
                        candidates.mixtures[i].integrals.map(|integral| if integral > 0.0 { 1.0 } else { 0.0 });
                    ocv::paper(equations, sums(i), &present, PAPER_LAMBDA)
                }
            };
            self.systems += match form {
                Form::Progressive => 0,
                Form::Regression | Form::Paper => 1,
                Form::Crossfit => 2,
            };
            self.ill_conditioned += u64::from(outcome.ill_conditioned);
            let [r, g, b] = outcome.estimate;
            *out = Rgb::new(r, g, b);
        }
    }

    /// Finds which samples are free, and takes the density of BSDF sampling from those that an emitter hides.
    fn find_hidden(&mut self, world: &World, candidates: &mut Candidates, contributions: &[Rgb], segments: &Segments) {
        self.is_free.clear();
        self.hidden.clear();
        self.hidden_of.clear();
        let mut occluded = segments.occluded().iter();
        for (i, (c, contribution)) in candidates.records.iter().zip(contributions).enumerate() {
            let is_free = is_traced(contribution) && occluded.next() == Some(&false);
            self.is_free.push(is_free);
            if !is_free && c.drawn == Drawn::Light && c.p_bsdf > 0.0 && world.emitters_hide() {
                self.hidden.push(&c.segment);
                self.hidden_of.push(i as u32);
            }
        }
        self.emitter_rays = self.hidden.len() as u64;
        world.occluded_by_emitters(&self.hidden, &mut self.is_hidden);
        for (&i, _) in self.hidden_of.iter().zip(&self.is_hidden).filter(|(_, is_hidden)| **is_hidden) {
            let c = &mut candidates.records[i as usize];
            (c.p_bsdf, c.p_lobe) = (0.0, 0.0);
        }
    }

    /// Sums of the normal equations of each point; of columns r_j/I_j that are not centred for the form of the paper.
    fn gather(&mut self, equations: NormalEquations, is_paper: bool, candidates: &Candidates, contributions: &[Rgb]) {
        let (m, len) = (equations.components(), equations.len());
        self.sums.clear();
        self.sums.resize(candidates.mixtures.len() * len, 0.0);
        let finish = |mixture: &Mixture, mut columns: [f32; MAX_COMPONENTS]| {
            for (column, integral) in columns.iter_mut().zip(mixture.integrals) {
                if !is_paper {
                    *column -= integral;
                } else if integral > 0.0 {
                    *column /= integral;
                }
            }
            columns
        };
        for ((c, contribution), &is_free) in candidates.records.iter().zip(contributions).zip(&self.is_free) {
            let mixture = &candidates.mixtures[c.point as usize];
            let y = if is_free { *contribution * mixture.samples() } else { Rgb::BLACK };
            let columns = finish(mixture, mixture.columns(c).unwrap_or([0.0; MAX_COMPONENTS]));
            equations.add(&mut self.sums[c.point as usize * len..][..len], &columns[..m], y.to_array());
        }
        for (mixture, sums) in candidates.mixtures.iter().zip(self.sums.chunks_mut(len)) {
            for (component, &count) in mixture.dark[..m].iter().enumerate().filter(|(_, count)| **count > 0) {
                let mut columns = [0.0; MAX_COMPONENTS];
                columns[component] = mixture.dark_column(component);
                let columns = finish(mixture, columns);
                (0..count).for_each(|_| equations.add(sums, &columns[..m], [0.0; 3]));
            }
            let columns = finish(mixture, [0.0; MAX_COMPONENTS]);
            (0..mixture.void).for_each(|_| equations.add(sums, &columns[..m], [0.0; 3]));
        }
    }
}

//! The compared methods, with three kinds of sampling: stratified in each estimate separately, as in the paper;
//! stratified over all camera rays of a pixel; independent. Every light is chosen with equal probability, as in the
//! paper; `mis` and progressive `ocv` are also measured with the light tree, the default of the renderer.

use super::super::method::{Method, Points};
use lumiris::lights::LightSamplerKind;
use lumiris::settings::{OcvForm, OptimalForm, SampleCounts, Strata};
use lumiris_numbers::estimators::heuristics::Heuristic;

/// Roles of the methods, in this order for each kind of sampling.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// The baseline: mis with the balance heuristic.
    Balance,
    Power,
    /// The method of the target.
    Progressive,
    Paper,
    Optimal,
    OptimalDirect,
    Correlated,
    /// A single technique.
    Light,
    /// `ris` at the time of the baseline.
    Ris,
    /// `ocv`, progressive, at the time of the baseline.
    EqualTime,
}

/// All roles.
pub(super) const ROLES: [Role; 10] = [
    Role::Balance,
    Role::Power,
    Role::Progressive,
    Role::Paper,
    Role::Optimal,
    Role::OptimalDirect,
    Role::Correlated,
    Role::Light,
    Role::Ris,
    Role::EqualTime,
];

/// Roles that are also measured with the light tree.
const PAIR: [Role; 2] = [Role::Balance, Role::Progressive];

/// A kind of sampling, with a light sampler.
#[derive(Clone, Copy, Debug)]
pub(super) struct Way {
    /// Name on the page.
    pub name: &'static str,
    pub points: Points,
    pub lights: LightSamplerKind,
    /// The methods measured.
    pub roles: &'static [Role],
}

const fn alike(name: &'static str, points: Points) -> Way {
    Way { name, points, lights: LightSamplerKind::Uniform, roles: &ROLES }
}

const fn by_tree(name: &'static str, points: Points) -> Way {
    Way { name, points, lights: LightSamplerKind::Tree, roles: &PAIR }
}

/// All kinds of sampling.
pub(super) const WAYS: [Way; 6] = [
    alike("stratified in each estimate", Points::PerEstimate),
    alike("stratified over all rays", Points::PerPixel),
    alike("independent", Points::Independent),
    by_tree("stratified in each estimate, lights by the tree", Points::PerEstimate),
    by_tree("stratified over all rays, lights by the tree", Points::PerPixel),
    by_tree("independent, lights by the tree", Points::Independent),
];

/// Number of kinds of sampling with all methods; they come first.
pub(super) const FULL_WAYS: usize = 3;

/// Numbers of samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Numbers {
    /// Samples per estimate.
    pub samples: u32,
    /// Samples of `ocv` that take as long as `mis` with `samples`.
    pub equal_time: u32,
    /// Sample counts of `ris` that take as long.
    pub ris: SampleCounts,
}

impl Role {
    /// Name on the page.
    pub(super) fn name(self) -> &'static str {
        match self {
            Role::Balance => "mis, balance heuristic",
            Role::Power => "mis, power heuristic",
            Role::Progressive => "ocv, progressive",
            Role::Paper => "ocv, paper",
            Role::Optimal => "optimal-mis, progressive",
            Role::OptimalDirect => "optimal-mis, direct",
            Role::Correlated => "correlated, BSDF sampling",
            Role::Light => "mc, light sampling alone",
            Role::Ris => "ris in the time of mis",
            Role::EqualTime => "ocv, progressive, in the time of mis",
        }
    }

    /// False if the expectation may differ from the reference.
    pub(super) fn is_unbiased(self) -> bool {
        match self {
            Role::Paper | Role::OptimalDirect | Role::Correlated => false,
            Role::Balance
            | Role::Power
            | Role::Progressive
            | Role::Optimal
            | Role::Light
            | Role::Ris
            | Role::EqualTime => true,
        }
    }

    /// The method, stratified over all rays, with equal probability for every light.
    pub(super) fn method(self, n: Numbers) -> Method {
        let method = match self {
            Role::Balance => Method::mis(n.samples).weighted(Heuristic::Balance),
            Role::Power => Method::mis(n.samples).weighted(Heuristic::Power),
            Role::Progressive => Method::ocv(OcvForm::Progressive, n.samples),
            Role::Paper => Method::ocv(OcvForm::Paper, n.samples),
            Role::Optimal => Method::optimal_mis(OptimalForm::Progressive, n.samples),
            Role::OptimalDirect => Method::optimal_mis(OptimalForm::Direct, n.samples),
            Role::Correlated => Method::correlated(n.samples),
            Role::Light => Method::mc(n.samples),
            Role::Ris => Method::ris(n.ris.proposals, n.ris.samples).strata(Strata::Systematic),
            Role::EqualTime => Method::ocv(OcvForm::Progressive, n.equal_time),
        };
        method.lights_by(LightSamplerKind::Uniform).stratified()
    }

    /// Its index among all methods; `way` is one of [`WAYS`] for which it is measured.
    pub(super) fn place(self, way: usize) -> usize {
        let before: usize = WAYS[..way].iter().map(|w| w.roles.len()).sum();
        let own = WAYS[way].roles.iter().position(|&r| r == self);
        before + own.expect("only roles that take part are asked for")
    }
}

/// All methods, in the order of [`Role::place`].
pub(super) fn methods(n: Numbers) -> Vec<Method> {
    let of = |way: &Way, role: Role| {
        let method = Method { points: way.points, light_sampler: way.lights, ..role.method(n) };
        let is_independent = way.points == Points::Independent;
        if is_independent { method.strata(Strata::None) } else { method }
    };
    WAYS.iter().flat_map(|way| way.roles.iter().map(move |&role| of(way, role))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_role_finds_its_method() {
        let n = Numbers { samples: 64, equal_time: 60, ris: SampleCounts { samples: 16, proposals: 99 } };
        let all = methods(n);
        assert_eq!(all.len(), FULL_WAYS * ROLES.len() + (WAYS.len() - FULL_WAYS) * PAIR.len());
        for (k, way) in WAYS.iter().enumerate() {
            for role in way.roles {
                let expected = role.method(n);
                let found = all[role.place(k)];
                assert_eq!((found.points, found.light_sampler), (way.points, way.lights));
                assert_eq!((found.estimator, found.form), (expected.estimator, expected.form));
                assert_eq!((found.samples, found.proposals), (expected.samples, expected.proposals));
            }
        }
    }

    #[test]
    fn methods_of_a_way_draw_samples_alike() {
        let n = Numbers { samples: 64, equal_time: 60, ris: SampleCounts { samples: 16, proposals: 99 } };
        let all = methods(n);
        for k in 0..WAYS.len() {
            let of = |role: Role| all[role.place(k)];
            let [mis, ocv] = PAIR.map(of);
            let like_mis = Method { estimator: mis.estimator, heuristic: mis.heuristic, ..ocv };
            assert_eq!(like_mis, mis, "they differ in the estimator alone: {}", WAYS[k].name);
        }
    }
}

//! The methods that are held against each other, with three ways to draw samples: stratified in each estimate by itself, as
//! the paper has them; stratified over all camera rays of a pixel; independent.

use super::super::method::Method;
use lumiris::settings::{OptimalForm, Split, Strata};
use lumiris_numbers::estimators::mis::Heuristic;
use lumiris_numbers::estimators::ocv::Form;

/// Who takes part, in this order with each of the ways to draw samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// What all are compared with: mis with the balance heuristic.
    Balance,
    Power,
    /// What the target is about.
    Progressive,
    Crossfit,
    Regression,
    Paper,
    Optimal,
    OptimalDirect,
    Correlated,
    /// One technique alone.
    Light,
    /// `ris` in the time of the baseline.
    Ris,
    /// `ocv`, progressive, in the time of the baseline.
    EqualTime,
}

/// All of them.
pub const ROLES: [Role; 12] = [
    Role::Balance,
    Role::Power,
    Role::Progressive,
    Role::Crossfit,
    Role::Regression,
    Role::Paper,
    Role::Optimal,
    Role::OptimalDirect,
    Role::Correlated,
    Role::Light,
    Role::Ris,
    Role::EqualTime,
];

/// Names of the ways to draw samples.
pub const WAYS: [&str; 3] = ["stratified in each estimate", "stratified over all rays", "independent"];

/// Numbers of samples.
#[derive(Clone, Copy, Debug)]
pub struct Numbers {
    /// Samples per estimate.
    pub samples: u32,
    /// Those of `ocv` that take as long as `mis` with the former.
    pub equal_time: u32,
    /// Those of `ris` that do.
    pub ris: Split,
}

impl Role {
    /// Name on the page.
    pub fn name(self) -> &'static str {
        match self {
            Role::Balance => "mis, balance heuristic",
            Role::Power => "mis, power heuristic",
            Role::Progressive => "ocv, progressive",
            Role::Crossfit => "ocv, crossfit",
            Role::Regression => "ocv, regression",
            Role::Paper => "ocv, paper",
            Role::Optimal => "optimal-mis, progressive",
            Role::OptimalDirect => "optimal-mis, direct",
            Role::Correlated => "correlated, BSDF sampling",
            Role::Light => "mc, light sampling alone",
            Role::Ris => "ris in the time of mis",
            Role::EqualTime => "ocv, progressive, in the time of mis",
        }
    }

    /// False if the expectation may differ from the truth.
    pub fn is_unbiased(self) -> bool {
        match self {
            Role::Regression | Role::Paper | Role::OptimalDirect | Role::Correlated => false,
            Role::Balance
            | Role::Power
            | Role::Progressive
            | Role::Crossfit
            | Role::Optimal
            | Role::Light
            | Role::Ris
            | Role::EqualTime => true,
        }
    }

    /// The method, stratified over all rays.
    pub fn method(self, n: Numbers) -> Method {
        let method = match self {
            Role::Balance => Method::mis(n.samples).weighted(Heuristic::Balance),
            Role::Power => Method::mis(n.samples).weighted(Heuristic::Power),
            Role::Progressive => Method::ocv(Form::Progressive, n.samples),
            Role::Crossfit => Method::ocv(Form::Crossfit, n.samples),
            Role::Regression => Method::ocv(Form::Regression, n.samples),
            Role::Paper => Method::ocv(Form::Paper, n.samples),
            Role::Optimal => Method::optimal_mis(OptimalForm::Progressive, n.samples),
            Role::OptimalDirect => Method::optimal_mis(OptimalForm::Direct, n.samples),
            Role::Correlated => Method::correlated(n.samples),
            Role::Light => Method::mc(n.samples),
            Role::Ris => Method::ris(n.ris.proposals, n.ris.samples).strata(Strata::Systematic),
            Role::EqualTime => Method::ocv(Form::Progressive, n.equal_time),
        };
        method.stratified()
    }

    /// Its place among all methods; `way` is one of [`WAYS`].
    pub fn place(self, way: usize) -> usize {
        way * ROLES.len() + self as usize
    }
}

/// All methods, in the order of [`Role::place`]. What learns from earlier rays of the pixel cannot have them apart; it
/// stratifies over the rays of a block.
pub fn methods(n: Numbers) -> Vec<Method> {
    let way = |way: usize, role: Role| {
        let method = role.method(n);
        match (way, role) {
            (0, Role::Progressive | Role::Optimal | Role::EqualTime) | (1, _) => method,
            (0, _) => method.apart(),
            _ => Method { stratified: false, strata: Strata::None, ..method },
        }
    };
    (0..WAYS.len()).flat_map(|k| ROLES.map(|role| way(k, role))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_role_finds_its_method() {
        let n = Numbers { samples: 64, equal_time: 60, ris: Split { samples: 16, proposals: 99 } };
        let all = methods(n);
        assert_eq!(all.len(), WAYS.len() * ROLES.len());
        for role in ROLES {
            assert_eq!(all[role.place(1)], role.method(n));
            assert_eq!(Method { apart: false, ..all[role.place(0)] }, role.method(n));
            let independent = all[role.place(2)];
            assert!(!independent.stratified && independent.samples == role.method(n).samples);
        }
    }
}

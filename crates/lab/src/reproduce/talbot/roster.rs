//! The compared methods and their roles.

use super::super::method::Method;
use super::cases::{Case, Judged, Kind};
use lumiris::settings::{SampleCounts, Strata};

/// A method with its name on the page.
#[derive(Clone, Debug)]
pub(super) struct Named {
    pub name: String,
    pub method: Method,
}

/// Proposals of the rendering that measures the variance of visibility alone.
const MANY: u32 = 96;

/// Indices of the methods of [`roster`].
pub(super) struct Roles {
    /// The baseline.
    pub base: usize,
    /// The method of the target.
    pub judged: usize,
    /// Fully stratified resampling, with M and N for equal halves of the time.
    pub equal_halves: usize,
    /// Resampling without stratification.
    pub plain: usize,
    /// Light sampling with well distributed points, if measured.
    pub base_stratified: Option<usize>,
    /// One sample of many proposals.
    pub visibility: usize,
}

/// The methods of a case.
pub(super) struct Roster {
    pub methods: Vec<Named>,
    pub roles: Roles,
}

/// The methods of a case, with M and N of equal halves of the time.
pub(super) fn roster(case: &Case, sample_counts: SampleCounts) -> Roster {
    // Resampling methods
    let SampleCounts { samples: n, proposals: m } = sample_counts;
    let named = |name: &str, method: Method| Named { name: name.to_owned(), method };
    let ris = Method::ris(m, n);
    let plain = named("ris, no stratification", ris);
    let points = named("ris + stratified proposals", ris.stratified());
    let systematic =
        named("ris + stratified proposals + systematic samples", ris.stratified().strata(Strata::Systematic));
    let visibility = named("ris, one sample of many proposals", Method::ris(MANY, 1));

    // The list of the case; roles are indices into it
    match case.kind {
        Kind::Reduction { judged, .. } => {
            let mut list = vec![
                named("mc", Method::mc(case.samples)),
                named("mc + stratified samples", Method::mc(case.samples).stratified()),
                named("mis", Method::mis(case.samples)),
                named("mis + stratified samples", Method::mis(case.samples).stratified()),
                plain,
                points,
                systematic,
                visibility,
            ];
            if let Some(s) = case.printed {
                list.push(named(
                    "ris with the paper's M and N, no stratification",
                    Method::ris(s.proposals, s.samples),
                ));
            }
            let judged = match judged {
                Judged::EqualHalves => 6,
                Judged::Printed => list.len() - 1,
            };
            let roles = Roles { base: 0, judged, equal_halves: 6, plain: 4, base_stratified: Some(1), visibility: 7 };
            Roster { methods: list, roles }
        }
        Kind::Stratification => {
            let strata = |s: Strata| ris.stratified().strata(s);
            let list = vec![
                plain,
                points,
                named("ris + stratified proposals + equal-proposals strata", strata(Strata::Proposals)),
                named("ris + stratified proposals + equal-weights strata", strata(Strata::Weights)),
                systematic,
                visibility,
            ];
            let roles = Roles { base: 0, judged: 4, equal_halves: 4, plain: 0, base_stratified: None, visibility: 5 };
            Roster { methods: list, roles }
        }
    }
}

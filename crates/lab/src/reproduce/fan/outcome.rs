//! Measurements of a case of direct light.

use super::super::measure::{Estimate, Measured};
use super::cases::Case;
use super::growth::Growth;
use super::roster::{Numbers, Role};
use super::truth::{Errors, Truth};

/// All measurements of a case.
pub(super) struct Outcome<'a> {
    pub case: &'a Case,
    pub facts: [usize; 2],
    pub size: [u32; 2],
    pub numbers: Numbers,
    pub measured: Vec<Measured>,
    pub truth: Truth,
    pub errors: Vec<Errors>,
    /// Measurements of [`SHOWN`](super::cases::SHOWN) with antialiasing, for each of
    /// [`SHOWN_WAYS`](super::cases::SHOWN_WAYS).
    pub antialiased: Vec<Vec<Measured>>,
    pub antialiased_truth: Truth,
    pub growth: Growth,
}

impl Outcome<'_> {
    /// A method with one sampling, and the baseline with the same.
    pub(super) fn pair(&self, role: Role, way: usize) -> [&Measured; 2] {
        [role, Role::Balance].map(|r| &self.measured[r.place(way)])
    }

    /// Their errors.
    pub(super) fn errors(&self, role: Role, way: usize) -> [&Errors; 2] {
        [role, Role::Balance].map(|r| &self.errors[r.place(way)])
    }

    /// The ratio of both errors.
    pub(super) fn relative(&self, role: Role, way: usize) -> Estimate {
        let [e, base] = self.errors(role, way);
        e.relative(base)
    }

    /// Errors of the antialiased images, for one of [`SHOWN_WAYS`](super::cases::SHOWN_WAYS), relative to their own
    /// reference.
    pub(super) fn antialiased_errors(&self, shown: usize) -> Vec<Errors> {
        self.antialiased[shown].iter().map(|m| self.antialiased_truth.errors(m)).collect()
    }
}

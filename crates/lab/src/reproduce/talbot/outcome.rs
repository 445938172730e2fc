//! Measurements of a case of the comparison.

use super::super::calibrate::Calibration;
use super::super::measure::Measured;
use super::cases::Case;
use super::classes::Classes;
use super::roster::{Named, Roles};

/// All measurements of a case.
pub(super) struct Outcome<'a> {
    pub case: &'a Case,
    pub stage_facts: [usize; 2],
    pub size: [u32; 2],
    pub calibration: Calibration,
    pub methods: Vec<Named>,
    pub roles: Roles,
    pub measured: Vec<Measured>,
    pub reference: Vec<[f64; 3]>,
    pub classes: Classes,
    /// The baseline, the judged method, and the baseline with stratified samples if there is one, with antialiasing.
    pub antialiased: Vec<Measured>,
}

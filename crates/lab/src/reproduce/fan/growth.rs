//! The error of progressive `ocv` relative to `mis` as a function of the number of camera rays: its coefficients come
//! from earlier rays.

use super::super::ReproduceError;
use super::super::measure::{Estimate, Stage, View, turns};
use super::cases::{Case, LONG, LONG_TURNS};
use super::roster::{FULL_WAYS, Numbers, Role, methods};
use super::setup::Setup;
use super::truth::Truth;

/// Numbers of camera rays: normal and quick.
const RAYS: [&[u32]; 2] = [&[1, 2, 4, 8, 16], &[1, 4, 16]];
/// Turns of each.
const TURNS: u32 = 4;
const FIRST_TURN: u32 = 3_000_000;
/// Reduction factor of the image's edges.
const SHRINK: u32 = 2;
/// The compared methods.
const PAIR: [Role; 2] = [Role::Balance, Role::Progressive];

/// Camera rays, and ratio of the error of progressive `ocv` to `mis`, for each sampling.
pub(super) struct Growth(pub [Vec<(u32, Estimate)>; FULL_WAYS]);

/// Equivalent number of camera rays per pixel of the whole image.
pub(super) fn cost(quick: bool) -> f64 {
    let rays: u32 = RAYS[usize::from(quick)].iter().sum();
    f64::from(TURNS * rays * (PAIR.len() * FULL_WAYS) as u32 + LONG.0 * LONG.1) / f64::from(SHRINK * SHRINK)
}

/// Measures it on a smaller image.
pub(super) fn measure(
    setup: &Setup<'_>,
    case: &Case,
    numbers: Numbers,
    size: [u32; 2],
) -> Result<Growth, ReproduceError> {
    // The reference
    let small = size.map(|s| (s / SHRINK).max(8));
    let mut stage = Stage::load(&setup.scenes.join(case.file), small, setup.options.threads)?;
    let list = methods(numbers);
    let range = LONG_TURNS..LONG_TURNS + LONG.1;
    let long = turns(&mut stage, &[list[Role::Balance.place(1)]], View::Centres, LONG.0, range, setup.observer)?;
    let truth = Truth::new(&long[0]);

    // Errors by the number of camera rays
    let chosen: Vec<_> = (0..FULL_WAYS).flat_map(|way| PAIR.map(|r| list[r.place(way)])).collect();
    let mut curves = [const { Vec::new() }; FULL_WAYS];
    for (k, &rays) in RAYS[usize::from(setup.options.quick)].iter().enumerate() {
        let first = FIRST_TURN + k as u32 * TURNS;
        let all = turns(&mut stage, &chosen, View::Centres, rays, first..first + TURNS, setup.observer)?;
        for (way, curve) in curves.iter_mut().enumerate() {
            let [base, ocv] = [0, 1].map(|i| truth.errors(&all[PAIR.len() * way + i]));
            curve.push((rays, ocv.relative(&base)));
        }
    }
    Ok(Growth(curves))
}

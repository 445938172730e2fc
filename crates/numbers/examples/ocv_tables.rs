//! Bias and variance of optimizing control variates on integrals with known values: the tables of
//! `docs/measurements/ocv/README.md`.
//!
//! `cargo run --release --example ocv_tables -- [forms|first|later|shared]`
#![allow(clippy::print_stdout)]

#[allow(dead_code)]
#[path = "../tests/estimators_1d/mixtures.rs"]
mod mixtures;

use lumiris_numbers::estimators::ocv::{Form, Matrix, System};
use lumiris_numbers::estimators::optimal_mis;
use lumiris_numbers::estimators::stats::Welford;
use lumiris_test_support::random::{Pcg32, pcg32};
use mixtures::{Mixture, PROPER, Sampler};

fn main() {
    let parts: [(&str, fn()); 4] =
        [("forms", forms), ("first", first_passes), ("later", later_passes), ("shared", shared_sums)];
    let wanted = std::env::args().nth(1);
    for (name, part) in parts {
        if wanted.as_deref().is_none_or(|w| w == name) {
            part();
        }
    }
}

/// Moments of the first channel of K estimates, over `runs` runs.
fn moments<const K: usize>(runs: usize, key: u32, mut run: impl FnMut(&mut Pcg32) -> [f32; K]) -> [Welford; K] {
    let (mut stream, mut welford) = (pcg32([40, key, 0]), [Welford::new(); K]);
    for _ in 0..runs {
        welford.iter_mut().zip(run(&mut stream)).for_each(|(w, e)| w.add(f64::from(e)));
    }
    welford
}

/// The first channel of the estimate of a form. `system` determines the coefficients from the same `rows` of sums of
/// r_j.
fn estimate(form: Form, system: System, sampler: &Sampler, rows: &[f32]) -> f32 {
    let equations = sampler.equations;
    let (mut sums, mut beta) = (rows.to_vec(), vec![0.0; form.rows() * equations.coefficients()]);
    sums.chunks_exact_mut(equations.len()).for_each(|row| form.finish(equations, row, &sampler.integrals));
    equations.solve(system, &sums, &mut beta);
    form.estimate(equations, &sums, &beta, &sampler.integrals)[0]
}

/// Bias and variance of each form on the same samples.
fn forms() {
    println!("## Bias (% of the value) and variance over that of MIS\n");
    println!(
        "| integral | N | samples | paper | regression | regression, λ = 1 | optimal MIS, direct | crossfit, against MIS of N |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for (mixture, n) in
        [Mixture::Table, Mixture::Occluded, Mixture::Colour].into_iter().flat_map(|m| [8, 16, 64].map(|n| (m, n)))
    {
        for stratified in [false, true] {
            let (whole, half) = (Sampler::new(mixture, n, stratified), Sampler::new(mixture, n / 2, stratified));
            let equations = whole.equations;
            let (mut all, mut halves) = (vec![0.0; equations.len()], vec![0.0; 2 * equations.len()]);
            let w = moments(400_000, n, |stream| {
                all.fill(0.0);
                halves.fill(0.0);
                whole.add(1, stream, &mut all);
                halves.chunks_exact_mut(equations.len()).for_each(|row| half.add(1, stream, row));
                let of = |form: Form| estimate(form, form.system(), &whole, &all);
                [
                    equations.mean(&all)[0],
                    of(Form::Paper),
                    estimate(Form::Regression, System::LEAST_SQUARES, &whole, &all),
                    of(Form::Regression),
                    optimal_mis::direct(equations, &all, &whole.integrals).estimate[0],
                    estimate(Form::Crossfit, Form::Crossfit.system(), &half, &halves),
                ]
            });
            let value = mixture.value()[0];
            let cell = |k: usize| {
                let bias = 100.0 * (w[k].mean() / value - 1.0);
                let error = 100.0 * w[k].standard_error() / value;
                format!("{bias:+.2} ± {error:.2}, {:.2}", w[k].variance() / w[0].variance())
            };
            let samples = if stratified { "stratified" } else { "independent" };
            println!(
                "| {mixture:?} | {n} | {samples} | {} | {} | {} | {} | {} |",
                cell(1),
                cell(2),
                cell(3),
                cell(4),
                cell(5)
            );
        }
    }
}

/// Estimates of MIS and of the progressive form over the first `passes` passes, with one system.
fn progressive(sampler: &Sampler, passes: u32, system: System, stream: &mut Pcg32) -> [[f32; 3]; 2] {
    let equations = sampler.equations;
    let (mut all, mut sums) = (vec![0.0; equations.len()], vec![0.0; equations.len()]);
    let (mut beta, mut total) = (vec![0.0; equations.coefficients()], [[0.0; 3]; 2]);
    for len in Sampler::blocks(passes) {
        sampler.block(Form::Progressive, len, stream, &mut sums);
        let block = [equations.mean(&sums), equations.estimate(&sums, &beta)];
        for (total, block) in total.iter_mut().zip(block) {
            (0..3).for_each(|i| total[i] += block[i] * len as f32 / passes as f32);
        }
        equations.merge(&mut all, &sums);
        equations.solve(system, &all, &mut beta);
    }
    total
}

fn ratio(sampler: &Sampler, passes: u32, system: System, runs: usize) -> f64 {
    let mut worst = 0.0_f64;
    for i in 0..3 {
        let w = moments(runs, passes, |stream| progressive(sampler, passes, system, stream).map(|e| e[i]));
        worst = worst.max(w[1].variance() / w[0].variance());
        if sampler.mixture != Mixture::Colour {
            break;
        }
    }
    worst
}

/// Ratio of the variance of the mean of the first four passes to MIS, for several systems.
fn first_passes() {
    let ridge = |ridge| System { matrix: Matrix::KnownMeans, ridge, shrink: 0.0 };
    let systems = [
        ("λ = 1", ridge(1.0)),
        ("λ = 4", ridge(4.0)),
        ("λ = 16", ridge(16.0)),
        ("λ = 4, sample means", System { matrix: Matrix::SampleMeans, ..ridge(4.0) }),
        ("λ = 1, κ = 1", System { shrink: 1.0, ..ridge(1.0) }),
        ("**λ = 4, κ = 1**", System::OTHER_SAMPLES),
        ("λ = 4, κ = 2", System { shrink: 2.0, ..ridge(4.0) }),
    ];
    for stratified in [false, true] {
        let samples = if stratified { "stratified" } else { "independent" };
        println!("\n## Mean of the first four passes, {samples} samples, worst channel: variance over that of MIS\n");
        println!("| integral | N | {} |", systems.map(|p| p.0).join(" | "));
        println!("|---|---|{}", "---|".repeat(systems.len()));
        for mixture in PROPER {
            for n in [3, 8, 16, 64] {
                let sampler = Sampler::new(mixture, n, stratified);
                let cells = systems.map(|p| format!("{:.3}", ratio(&sampler, 4, p.1, 10_000)));
                println!("| {mixture:?} | {n} | {} |", cells.join(" | "));
            }
        }
    }
}

/// Ratio of the variance of all passes so far to MIS.
fn later_passes() {
    println!("\n## Variance of the mean of all passes over that of MIS\n");
    println!("| integral | N | samples | 2 | 4 | 8 | 16 | 64 passes |\n|---|---|---|---|---|---|---|---|");
    for mixture in [Mixture::Table, Mixture::Occluded, Mixture::Peak, Mixture::Colour, Mixture::Many] {
        for n in [3, 8, 16] {
            for stratified in [false, true] {
                let sampler = Sampler::new(mixture, n, stratified);
                let cells = [2, 4, 8, 16, 64].map(|p| {
                    format!("{:.2}", ratio(&sampler, p, System::OTHER_SAMPLES, if p > 16 { 2_000 } else { 5_000 }))
                });
                let samples = if stratified { "stratified" } else { "independent" };
                println!("| {mixture:?} | {n} | {samples} | {} |", cells.join(" | "));
            }
        }
    }
}

/// Variance of the mean of four passes, with sums of `pixels` pixels whose occluders differ by up to `spread`, shared
/// or separate.
fn shared_sums() {
    println!("\n## Sums shared by pixels, mean of the first four passes: variance over that of MIS\n");
    println!(
        "| N | pixels | none | all alike | occluder moves by 0.02 | by 0.05 | by 0.1 |\n|---|---|---|---|---|---|---|"
    );
    for n in [3, 8, 16, 64] {
        for pixels in [4_usize, 9] {
            let cells =
                [(1, 1e-9), (pixels, 1e-9), (pixels, 0.02), (pixels, 0.05), (pixels, 0.1)].map(|(pixels, spread)| {
                    let samplers: Vec<Sampler> = (0..pixels)
                        .map(|k| {
                            let shift = spread * (k as f64 + 1.0 - pixels as f64) / pixels as f64;
                            Sampler { shift, ..Sampler::new(Mixture::Table, n, true) }
                        })
                        .collect();
                    let equations = samplers[0].equations;
                    let row = || vec![0.0; equations.len()];
                    let (mut all, mut rows) = (row(), vec![row(); pixels]);
                    let mut beta = vec![0.0; equations.coefficients()];
                    let w = moments(6_000, n, |stream| {
                        all.fill(0.0);
                        beta.fill(0.0);
                        let mut total = [0.0; 2];
                        for len in Sampler::blocks(4) {
                            for (sampler, row) in samplers.iter().zip(&mut rows) {
                                sampler.block(Form::Progressive, len, stream, row);
                            }
                            // The last pixel is measured; its occluder is at the end of the range.
                            let last = &rows[pixels - 1];
                            total[0] += equations.mean(last)[0] * len as f32 / 4.0;
                            total[1] += equations.estimate(last, &beta)[0] * len as f32 / 4.0;
                            rows.iter().for_each(|row| equations.merge(&mut all, row));
                            equations.solve(System::OTHER_SAMPLES, &all, &mut beta);
                        }
                        total
                    });
                    format!("{:.3}", w[1].variance() / w[0].variance())
                });
            println!("| {n} | {pixels} | {} |", cells.join(" | "));
        }
    }
}

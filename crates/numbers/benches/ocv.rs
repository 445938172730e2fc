//! Time per shading point of optimizing control variates (ns): sums over its samples, and the system, for many points
//! at a time and for one.
//!
//! `cargo bench --bench ocv`
#![allow(clippy::print_stdout, missing_docs)]

use lumiris_numbers::estimators::ocv::{Form, NormalEquations};
use lumiris_test_support::random::{RngExt, pcg32};
use std::hint::black_box;
use std::time::Instant;

const POINTS: usize = 4096;
const RUNS: u32 = 9;

/// The minimum over several runs of all points, in nanoseconds per point.
fn time(mut run: impl FnMut()) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..RUNS {
        let start = Instant::now();
        run();
        best = best.min(start.elapsed().as_secs_f64());
    }
    best * 1e9 / POINTS as f64
}

fn main() {
    for m in [3, 5, 8] {
        for n in [8, 64] {
            let equations = NormalEquations::new(m);
            let mut stream = pcg32([m as u32, n as u32, 1]);
            let samples: Vec<[f32; 3]> = (0..n).map(|_| [0; 3].map(|_| stream.random::<f32>())).collect();
            let columns: Vec<(usize, f32)> = (0..m * n).map(|i| (i % m, 2.0 * stream.random::<f32>() - 1.0)).collect();
            let mut sums = vec![0.0; POINTS * equations.len()];
            let add = time(|| {
                for row in sums.chunks_exact_mut(equations.len()) {
                    row.fill(0.0);
                    for (columns, y) in black_box(&columns).chunks_exact(m).zip(&samples) {
                        equations.add_sparse(row, columns, *y);
                    }
                }
            });

            let mut beta = vec![0.0; POINTS * equations.coefficients()];
            let system = Form::Progressive.system();
            let many = time(|| {
                black_box(equations.solve(system, black_box(&sums), &mut beta));
            });
            let single = time(|| {
                for (row, beta) in
                    black_box(&sums).chunks_exact(equations.len()).zip(beta.chunks_exact_mut(equations.coefficients()))
                {
                    black_box(equations.solve(system, row, beta));
                }
            });
            println!("m = {m}, N = {n:2}: add {add:7.1} ns, solve {many:7.1} ns, one point at a time {single:7.1} ns");
        }
    }
}

//! Nanoseconds per shading point of optimizing control variates: sums over its samples, and the system, eight points at a
//! time and one.
//!
//! `cargo bench --bench ocv`
#![allow(clippy::print_stdout, missing_docs)]

use lumiris_lanes::ocv::{Matrix, System, solve};
use lumiris_numbers::estimators::ocv::{NormalEquations, Penalty};
use lumiris_numbers::math::hash::HashStream;
use std::hint::black_box;
use std::time::Instant;

const POINTS: usize = 4096;
const RUNS: u32 = 9;

/// Best of several runs over all points, in nanoseconds per point.
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
            let mut stream = HashStream::new([m as u32, n as u32, 1]);
            let samples: Vec<[f32; 3]> = (0..n).map(|_| [0; 3].map(|_| stream.next_f32())).collect();
            let columns: Vec<f32> = (0..m * n).map(|_| 2.0 * stream.next_f32() - 1.0).collect();
            let mut sums = vec![0.0; POINTS * equations.len()];
            let add = time(|| {
                for row in sums.chunks_exact_mut(equations.len()) {
                    row.fill(0.0);
                    for (columns, y) in black_box(&columns).chunks_exact(m).zip(&samples) {
                        equations.add(row, columns, *y);
                    }
                }
            });

            let mut beta = vec![0.0; POINTS * equations.coefficients()];
            let Penalty { ridge, shrink, .. } = Penalty::default();
            let system = System { columns: m, matrix: Matrix::KnownMeans, ridge, shrink };
            let lanes = time(|| {
                black_box(solve(&system, black_box(&sums), &mut beta));
            });
            let single = time(|| {
                for (row, beta) in
                    black_box(&sums).chunks_exact(equations.len()).zip(beta.chunks_exact_mut(equations.coefficients()))
                {
                    black_box(equations.solve(row, Penalty::default(), beta)).expect("the samples are finite");
                }
            });
            println!("m = {m}, N = {n:2}: add {add:7.1} ns, solve {lanes:7.1} ns, one point at a time {single:7.1} ns");
        }
    }
}

//! Tests of `lumiris_lanes::ocv`.

use super::support::LENGTHS;
use lumiris_lanes::ocv::*;
use lumiris_numbers::math::hash::HashStream;

/// Sums of `n` samples of each of `points`.
fn sums(system: &System, points: usize, n: usize) -> Vec<f32> {
    let (m, len) = (system.columns, system.len());
    let [mixed, means, values] = offsets(m);
    let (mut sums, mut stream) = (vec![0.0; points * len], HashStream::new([m as u32, n as u32, 3]));
    for row in sums.chunks_exact_mut(len) {
        for _ in 0..n {
            let c: Vec<f32> = (0..m).map(|_| 2.0 * stream.next_f32() - 1.0).collect();
            let y: [f32; 3] = std::array::from_fn(|i| 1.0 + c[i % m] + stream.next_f32());
            let mut at = 0;
            for j in 0..m {
                (0..=j).for_each(|k| row[at + k] += c[j] * c[k]);
                at += j + 1;
                (0..3).for_each(|i| row[mixed + 3 * j + i] += c[j] * y[i]);
                row[means + j] += c[j];
            }
            (0..3).for_each(|i| row[values + i] += y[i]);
            (0..3).for_each(|i| row[values + 3 + i] += y[i] * y[i]);
            row[values + 6] += 1.0;
        }
    }
    sums
}

#[test]
fn solutions_do_not_depend_on_what_is_solved_beside_and_what_is_not_finite_is_counted() {
    for columns in [1, 3, 5, 8] {
        for matrix in [Matrix::KnownMeans, Matrix::SampleMeans, Matrix::Intercept] {
            for points in LENGTHS {
                let system = System { columns, matrix, ridge: 1.5, shrink: 1.0 };
                let mut sums = sums(&system, points, 7);
                let spoilt = (points > 2) as usize;
                if spoilt > 0 {
                    sums[2 * system.len() + offsets(columns)[2]] = f32::NAN;
                }
                let width = 3 * columns;
                let mut beta = vec![1.0; points * width];
                assert_eq!(solve(&system, &sums, &mut beta), spoilt, "{columns} {matrix:?} {points}");
                assert!(beta.iter().all(|b| b.is_finite()));
                for (row, beta) in sums.chunks_exact(system.len()).zip(beta.chunks_exact(width)) {
                    let mut alone = vec![1.0; width];
                    solve(&system, row, &mut alone);
                    assert_eq!(alone, beta, "{columns} {matrix:?} {points}");
                }
            }
        }
    }
}

#[test]
fn points_without_samples_and_without_columns_have_no_coefficients() {
    let system = System { columns: 3, matrix: Matrix::SampleMeans, ridge: 0.0, shrink: 0.0 };
    let mut beta = vec![7.0; 9 * 9];
    assert_eq!(solve(&system, &vec![0.0; 9 * system.len()], &mut beta), 0);
    assert!(beta.iter().all(|b| *b == 0.0));
    let none = System { columns: 0, ..system };
    assert_eq!(solve(&none, &[0.0; 7], &mut []), 0);
}

//! Tests of `lumiris_lanes::sums`.

use crate::support::levels;
use lumiris_lanes::sums::{HIGH, LIMITS, MOST, QUANTA, Sums, TERM, Term, sums};
use lumiris_test_support::random::{RngExt, pcg32};

struct Row([f32; TERM]);

impl Term for Row {
    fn numbers(&self) -> [f32; TERM] {
        self.0
    }
}

/// Terms of magnitudes from 2⁻⁴⁰ of the limits up to the limits.
fn rows(count: usize) -> Vec<Row> {
    let mut s = pcg32([5, 6, 7]);
    let mut number = |limit: f64| ((s.random::<f32>() - 0.5) * (-40.0 * s.random::<f32>()).exp2()) * limit as f32;
    let limit = |i: usize| LIMITS[[0, 0, 0, 1, 2, 2, 2, 2, 2, 2, 2, 2][i]];
    (0..count).map(|_| Row(std::array::from_fn(|i| number(limit(i))))).collect()
}

#[test]
fn sums_of_all_levels_are_those_of_whole_numbers() {
    let quanta = |x: f64, digits: i32| {
        let x = x * 2.0_f64.powi(digits);
        // Larger numbers are whole
        if x.abs() < 2.0_f64.powi(51) { (x + 0.5_f64.copysign(x)).trunc() as i128 } else { x as i128 }
    };
    for count in [0, 1, 2, 7, 64, MOST] {
        let rows = rows(count);
        let all: Vec<Option<Sums>> = levels().into_iter().map(|level| sums(level, &rows)).collect();
        let Sums { numbers, squares, others } = all[0].unwrap();
        assert!(all.iter().all(|sums| *sums == all[0]), "{count}");
        let both = |[high, low]: [f64; 2], digits: i32| ((high as i128) << digits) + low as i128;
        for c in 0..4 {
            let sum = |value: &dyn Fn(&Row) -> i128| rows.iter().map(value).sum::<i128>();
            let expected = sum(&|row| quanta(row.0[c].into(), -QUANTA[0]));
            assert_eq!(both([numbers[0][c], numbers[1][c]], HIGH[0] - QUANTA[0]), expected, "{count} {c}");
            for half in 0..2 {
                let expected = sum(&|row| quanta(row.0[4 + 4 * half + c].into(), -QUANTA[2]));
                assert_eq!(others[half][c] as i128, expected, "{count} {c}");
            }
            if c < 3 {
                let expected = sum(&|row| quanta(f64::from(row.0[c]).powi(2), -QUANTA[1]));
                assert_eq!(both([squares[0][c], squares[1][c]], HIGH[1] - QUANTA[1]), expected, "{count} {c}");
            }
        }
    }
}

#[test]
fn what_may_not_be_exact_is_left_to_others() {
    for level in levels() {
        assert!(sums(level, &rows(MOST)).is_some() && sums(level, &rows(MOST + 1)).is_none());
        for (i, value) in
            [(0, 64.0), (2, f32::NAN), (3, 1.1e9), (1, f32::INFINITY), (4, 4.0), (10, -5.0), (6, f32::NAN)]
        {
            for at in 0..8 {
                let mut rows = rows(8);
                rows[at].0[i] = value;
                assert!(sums(level, &rows).is_none(), "{value} {i} {at}");
            }
        }
    }
}

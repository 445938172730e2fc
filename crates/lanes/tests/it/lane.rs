//! Tests of `lumiris_lanes::lane`.

use super::support::assert_same_bits;
use fearless_simd::dispatch;
use fearless_simd::{Simd, prelude::*};
use lumiris_lanes::lane::*;
use lumiris_lanes::wide::*;
use lumiris_numbers::math::elementary::SinCos;

#[inline(always)]
fn run<S: Simd>(simd: S, t: &[f32], [s, c, qs, qc]: [&mut [f32]; 4]) {
    for i in (0..t.len()).step_by(LANES) {
        let i = begin(i, t.len());
        let v = load(simd, t, i);
        let SinCos { sin, cos } = sin_cos_turns(v);
        store(sin, s, i);
        store(cos, c, i);
        let SinCos { sin, cos } = sin_cos_quadrant(v.min(1.0).max(-1.0));
        store(sin, qs, i);
        store(cos, qc, i);
    }
}

#[test]
fn sines_and_cosines_are_accurate_and_the_same_at_all_levels() {
    for n in [8, 9, 31, 4000] {
        let t: Vec<f32> = (0..n).map(|i| i as f32 / 1000.0 - 1.5).collect();
        assert_same_bits::<4>(n, |level, out| {
            let [s, c, qs, qc] = out;
            dispatch!(level, simd => run(simd, &t, [&mut *s, &mut *c, &mut *qs, &mut *qc]));
            for i in 0..n {
                let (sin, cos) = (f64::from(t[i]) * std::f64::consts::TAU).sin_cos();
                assert!((f64::from(s[i]) - sin).abs() < 1.3e-7 && (f64::from(c[i]) - cos).abs() < 1.3e-7, "{}", t[i]);
                let a = f64::from(t[i].clamp(-1.0, 1.0));
                let (sin, cos) = ((a + 1.0) * std::f64::consts::FRAC_PI_4).sin_cos();
                assert!((f64::from(qs[i]) - sin).abs() < 2e-7 && (f64::from(qc[i]) - cos).abs() < 2e-7, "{}", t[i]);
            }
        });
    }
}

#[inline(always)]
fn run_exp<S: Simd>(simd: S, x: &[f32], out: &mut [f32]) {
    for i in (0..x.len()).step_by(LANES) {
        let i = begin(i, x.len());
        store(exp(load(simd, x, i)), out, i);
    }
}

#[test]
fn exponentials_are_accurate_and_the_same_at_all_levels() {
    let x: Vec<f32> = (0..4000).map(|i| i as f32 * -0.0231).chain([f32::NEG_INFINITY, f32::NAN]).collect();
    assert_same_bits::<1>(x.len(), |level, [out]| {
        dispatch!(level, simd => run_exp(simd, &x, &mut *out));
        for i in 0..4000 {
            let expected = f64::from(x[i]).exp();
            assert!((f64::from(out[i]) - expected).abs() <= 2.4e-7 * expected || x[i] < -85.9 && out[i] == 0.0);
        }
        assert!(out[4000] == 0.0 && out[4001] == 0.0);
    });
}

//! Tests of `lumiris_lanes::hilbert`.

use lumiris_lanes::hilbert::*;
use lumiris_numbers::math::hash::pcg4d;
use lumiris_test_support::assert_chi_squared;

#[test]
fn lanes_give_the_bits_of_the_scalar_twins() {
    // Strata
    for (case, m) in [1, 2, 3, 7, 8, 15, 16, 17, 100, 128, 255, 256, 1000, 65535, 65536].into_iter().enumerate() {
        let [phi, seed, ..] = pcg4d([case as u32, 1, 2, 3]);
        let mut a = [vec![0; m], vec![0; m]];
        let mut b = a.clone();
        let [out, jitter] = &mut a;
        strata(phi, seed, m as u32, out, jitter);
        let [out, jitter] = &mut b;
        strata_scalar(phi, seed, m as u32, out, jitter);
        assert_eq!(a, b);

        // Points on the curve
        let t: Vec<u32> = (0..m as u32).map(|i| pcg4d([i, 5, case as u32, 7])[0]).collect();
        let mut c = [vec![0.0; m], vec![0.0; m]];
        let mut d = c.clone();
        let [u0, u1] = &mut c;
        hilbert_points(&t, &a[1], u0, u1);
        let [u0, u1] = &mut d;
        hilbert_points_scalar(&t, &a[1], u0, u1);
        assert_eq!(c, d);
    }
}

#[test]
fn the_curve_visits_every_cell_and_steps_to_neighbours() {
    let mut seen = vec![false; 1 << 16];
    for i in 0..1_u32 << 16 {
        let [x, y] = hilbert_cell(i << 16);
        let cell = (y >> 8 << 8 | x >> 8) as usize;
        assert!(!std::mem::replace(&mut seen[cell], true));
    }
    for i in 0..100_000 {
        let t = pcg4d([i, 1, 2, 3])[0].min(u32::MAX - 1);
        let (a, b) = (hilbert_cell(t), hilbert_cell(t + 1));
        assert_eq!(a[0].abs_diff(b[0]) + a[1].abs_diff(b[1]), 1, "{t}");
    }
    assert_eq!((hilbert_cell(0), hilbert_cell(u32::MAX)), ([0, 0], [0xffff, 0]));
}

#[test]
fn jitter_completes_the_coordinates() {
    let (mut u0, mut u1) = ([0.0], [0.0]);
    hilbert_points(&[u32::MAX], &[0xabcd_12ff], &mut u0, &mut u1);
    assert_eq!((u0[0] * 16_777_216.0, u1[0] * 16_777_216.0), (16_777_215.0, 18.0));
}

#[test]
fn strata_hold_one_position_each_and_the_samples_of_a_pixel_stratify_each() {
    // The positions of all samples by stratum
    let m = 12_u32;
    let samples = 64_u32;
    let mut rows: Vec<Vec<u32>> = vec![Vec::new(); m as usize];
    for s in 0..samples {
        let phi = (s << 26) | (pcg4d([s, 3, 3, 3])[0] >> 6);
        let (mut out, mut jitter) = (vec![0; m as usize], vec![0; m as usize]);
        strata(phi, 77, m, &mut out, &mut jitter);
        for (i, &t) in out.iter().enumerate() {
            let place = u64::from(t) * u64::from(m);
            assert!(place + u64::from(m) > (i as u64) << 32 && place < (i as u64 + 1) << 32);
            let xi = place.saturating_sub((i as u64) << 32);
            rows[i].push(((xi + u64::from(m) / 2) >> 26).min(63) as u32);
        }
    }

    // All values of the samples are different in each stratum
    for row in &mut rows {
        row.sort_unstable();
        assert_eq!(*row, (0..samples).collect::<Vec<_>>());
    }
}

#[test]
fn positions_within_strata_are_uniform_and_independent_by_chi_squared() {
    let m = 16_u32;
    let (mut pairs, mut jitters) = (vec![0.0; 64], vec![0.0; 64]);
    let count = 20_000;
    for s in 0..count {
        let [phi, seed, ..] = pcg4d([s, 9, 9, 9]);
        let (mut out, mut jitter) = (vec![0; 16], vec![0; 16]);
        strata(phi, seed, m, &mut out, &mut jitter);
        let xi = |i: usize| (out[i] << 4) >> 29;
        pairs[(xi(3) * 8 + xi(11)) as usize] += 1.0;
        jitters[((jitter[5] & 7) * 8 + (jitter[5] >> 8 & 7)) as usize] += 1.0;
    }
    for observed in [&pairs, &jitters] {
        assert_chi_squared(observed, &[f64::from(count) / 64.0; 64], 1e-4);
    }
}

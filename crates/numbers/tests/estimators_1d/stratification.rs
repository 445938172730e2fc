//! Strata compared with none, and methods to choose strata of equal weights.

use lumiris_numbers::estimators::ris::sample_counts::length;
use lumiris_numbers::estimators::ris::{strata, stratified, with_replacement};
use lumiris_numbers::estimators::stats::Welford;
use lumiris_test_support::integrals::{ALL, Integral, Proposals, fill, run};
use lumiris_test_support::random::pcg32;

const RUNS: usize = 100_000;
const M: usize = 24;
const N: usize = 6;

fn total_variance(channels: &[Welford; 3]) -> f64 {
    length([0, 1, 2].map(|i| channels[i].variance()))
}

#[test]
fn stratified_with_a_stratum_per_proposal_is_plain_monte_carlo_bit_for_bit() {
    let mut stream = pcg32([6, 0, 0]);
    let (mut p, mut draws, mut ends, mut u) = (Proposals::default(), Vec::new(), Vec::new(), [0.0; 2 * M]);
    for _ in 0..20_000 {
        for integral in ALL {
            p.independent(integral, M, &mut stream);
            fill(&mut u, &mut stream);
            let plain = p.contributions.iter().fold([0.0_f32; 3], |s, c| [s[0] + c[0], s[1] + c[1], s[2] + c[2]]);
            for weights in [false, true] {
                if weights {
                    strata::equal_weights(&p.weights, M, &u[M..], &mut ends);
                } else {
                    strata::equal_proposals(M, M, &mut ends);
                }
                stratified(&p.weights, &ends, &u[..M], &mut draws);
                let mut sum = [0.0_f32; 3];
                for d in &draws {
                    (0..3).for_each(|i| sum[i] += d.scale * p.contributions[d.index as usize][i]);
                }
                assert_eq!(sum.map(f32::to_bits), plain.map(f32::to_bits));
            }
        }
    }
}

/// Method that makes the strata of a run.
type Strata = fn(&[f32], &[f32], &mut Vec<u32>);

fn variance(integral: Integral, jittered: bool, key: u32, make: Option<Strata>) -> f64 {
    let (mut p, mut draws, mut ends, mut u) = (Proposals::default(), Vec::new(), Vec::new(), [0.0; 2 * M]);
    let channels = run(RUNS, [7, key, integral as u32], |stream| {
        if jittered {
            p.jittered(integral, M, stream);
        } else {
            p.independent(integral, M, stream);
        }
        fill(&mut u, stream);
        match make {
            Some(make) => {
                make(&p.weights, &u[M..], &mut ends);
                stratified(&p.weights, &ends, &u[..ends.len()], &mut draws);
            }
            None => with_replacement(&p.weights, &u[..N], &mut draws),
        }
        p.estimate(&draws)
    });
    total_variance(&channels)
}

/// The greedy strata with a fixed target Σw/N, as in the thesis; `complement` uses the complement of the printed
/// probability. Strata beyond N are merged into the last.
fn fixed_target(weights: &[f32], u: &[f32], complement: bool, ends: &mut Vec<u32>) {
    ends.clear();
    let target = weights.iter().sum::<f32>() / N as f32;
    let mut total = 0.0;
    for (j, &w) in weights.iter().enumerate() {
        if total + w > target && total > 0.0 && ends.len() + 1 < N {
            let printed = (total + w - target) / w;
            let probability = if complement { 1.0 - printed } else { printed };
            if u[ends.len()] >= probability {
                ends.push(j as u32);
                total = 0.0;
            }
        }
        total += w;
    }
    ends.push(weights.len() as u32);
}

#[test]
fn strata_lower_the_variance_but_not_with_the_printed_probability() {
    for integral in ALL {
        for jittered in [false, true] {
            let of = |key, make| variance(integral, jittered, key, make);
            let none = of(0, None);
            let proposals = of(1, Some(|w, _, ends| strata::equal_proposals(w.len(), N, ends)));
            let weights = of(2, Some(|w, u, ends| strata::equal_weights(w, N, u, ends)));
            let printed = of(3, Some(|w, u, ends| fixed_target(w, u, false, ends)));
            let complement = of(4, Some(|w, u, ends| fixed_target(w, u, true, ends)));
            assert!(proposals < none && weights < none, "{integral:?} {jittered}");
            assert!(weights < 1.02 * complement && complement < 0.5 * printed, "{integral:?} {jittered}");
        }
    }
}

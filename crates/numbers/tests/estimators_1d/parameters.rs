//! The optimal numbers of proposals and samples.

use super::level;
use lumiris_numbers::estimators::ris::sample_counts::{
    Costs, Moments, MomentsEstimate, Variances, clamp_ratio, counts, counts_of_sets, length, optimal_ratio,
};
use lumiris_numbers::estimators::ris::{strata, stratified, with_replacement};
use lumiris_numbers::estimators::stats::{Welford, z_test};
use lumiris_test_support::integrals::{ALL, Integral, Proposals, fill, run};
use lumiris_test_support::random::RngExt;

const COSTS: Costs = Costs { t1: 1.0, t2: 40.0 };
const TIME: f64 = 400.0;

/// Measured length of the variance of RIS at a ratio K, with M and N rounded in each run.
fn measured(integral: Integral, ratio: f64, key: u32) -> f64 {
    let (mut p, mut draws, mut u) = (Proposals::default(), Vec::new(), Vec::new());
    let channels = run(80_000, [8, integral as u32, key], |stream| {
        let c = counts(ratio, COSTS, TIME, stream.random::<[f32; 2]>());
        p.independent(integral, c.m as usize, stream);
        u.resize(c.n as usize, 0.0);
        fill(&mut u, stream);
        with_replacement(&p.weights, &u, &mut draws);
        p.estimate(&draws)
    });
    length([0, 1, 2].map(|i| channels[i].variance()))
}

#[test]
fn the_optimal_ratio_beats_half_and_double_and_the_robust_one_is_at_most_twice_as_bad() {
    for integral in ALL {
        let (_, moments) = integral.moments();
        let k = optimal_ratio(COSTS, moments.variances(), TIME);
        let robust = COSTS.robust_ratio();
        assert!(k > 2.0, "a ratio that can be halved: {k}");
        let [best, half, double, robust] = [k, k / 2.0, k * 2.0, robust].map(|k| measured(integral, k, k as u32));
        assert!(best < half && best < double && robust < 2.0 * best, "{integral:?}: {best} {half} {double} {robust}");
    }
}

#[test]
fn the_optimal_ratio_is_a_minimum_and_the_robust_ratio_at_most_doubles_it() {
    let variance = |k: f64, costs: Costs, v: Variances, time: f64| {
        let k = clamp_ratio(k, costs, time);
        let n = time / (k * costs.t1 + costs.t2);
        v.of_estimate(k * n, n)
    };
    let mut worst: f64 = 0.0;
    for t2 in [0.1, 1.0, 3.0, 30.0, 300.0] {
        for samples in [0.0, 1e-3, 0.1, 0.5, 1.0, 3.0] {
            for time in [2.0, 10.0, 100.0, 1e5] {
                let (costs, v) = (Costs { t1: 1.0, t2 }, Variances { proposals: 1.0, samples });
                let time = time * (1.0 + t2);
                let k = optimal_ratio(costs, v, time);
                let best = variance(k, costs, v, time);
                for factor in [0.5, 0.9, 0.99, 1.01, 1.1, 2.0] {
                    let other = variance(clamp_ratio(k, costs, time) * factor, costs, v, time);
                    assert!(
                        best <= other * (1.0 + 1e-12),
                        "{costs:?} {v:?} {time}: {best} at {k}, {other} at {factor}"
                    );
                }
                if samples <= v.proposals {
                    worst = worst.max(variance(costs.robust_ratio(), costs, v, time) / best);
                }
            }
        }
    }
    assert!(worst > 1.5 && worst <= 2.0, "{worst}");
}

/// A single channel: the lengths of e3 − e2 and e2 − e1 do not add up to the length of their sum if a channel has e3 <
/// e2.
fn one_channel(e: Moments, i: usize) -> Moments {
    let one = |e: [f64; 3]| [e[i], 0.0, 0.0];
    Moments { e1: one(e.e1), e2: one(e.e2), e3: one(e.e3) }
}

#[test]
fn the_optimal_set_size_is_a_minimum_of_the_variance() {
    let mut sizes = Vec::new();
    for integral in ALL {
        let (_, moments) = integral.moments();
        for i in [0, 1] {
            let moments = one_channel(moments, i);
            let variance = |m: f64| moments.variance_of_sets(m, TIME / (m * COSTS.t1 + COSTS.t2))[0];
            let m = moments.optimal_set_size(COSTS);
            sizes.push(m);
            for factor in [0.5, 0.9, 0.99, 1.01, 1.1, 2.0].into_iter().filter(|factor| factor * m >= 1.0 || m > 1.0) {
                assert!(variance(m) < variance(factor * m), "{integral:?}, channel {i}: {m} {factor}");
            }
        }
    }
    // If the target fits a channel worse than p does, one proposal is optimal; both cases occur.
    assert!(sizes.contains(&1.0) && sizes.iter().any(|&m| m > 2.0), "{sizes:?}");
}

#[test]
fn the_optimal_set_size_beats_a_quarter_and_four_times_when_measured() {
    const TIME: f64 = 1_200.0;
    let (_, moments) = Integral::Line.moments();
    let size = one_channel(moments, 1).optimal_set_size(COSTS);
    let [best, quarter, four] = [size, size / 4.0, size * 4.0].map(|size| {
        let (mut p, mut draws, mut ends, mut u) = (Proposals::default(), Vec::new(), Vec::new(), Vec::new());
        let channels = run(40_000, [9, 0, (size * 100.0) as u32], |stream| {
            let c = counts_of_sets(size, COSTS, TIME, stream.random::<[f32; 2]>());
            p.independent(Integral::Line, (c.m * c.n) as usize, stream);
            u.resize(c.n as usize, 0.0);
            fill(&mut u, stream);
            strata::equal_proposals(p.weights.len(), c.n as usize, &mut ends);
            stratified(&p.weights, &ends, &u, &mut draws);
            p.estimate(&draws)
        });
        channels[1].variance()
    });
    assert!(1.02 * best < quarter && 1.02 * best < four, "size {size}: {best}, quarter {quarter}, four {four}");
}

#[test]
fn moments_from_small_sets_are_unbiased_and_add_up() {
    for integral in ALL {
        let (_, exact) = integral.moments();
        let mut p = Proposals::default();
        let mut means = [[Welford::new(); 3]; 3];
        let mut all = MomentsEstimate::new();
        run(200_000, [10, integral as u32, 0], |stream| {
            p.independent(integral, 4, stream);
            let mut set = MomentsEstimate::new();
            set.add_set(&p.contributions, &p.weights);
            let m = set.moments().unwrap();
            for i in 0..3 {
                means[0][i].add(m.e1[i]);
                means[1][i].add(m.e2[i]);
                means[2][i].add(m.e3[i]);
            }
            all.merge(&set);
            [0.0; 3]
        });
        let merged = all.moments().unwrap();
        for (k, (exact, merged)) in
            [exact.e1, exact.e2, exact.e3].into_iter().zip([merged.e1, merged.e2, merged.e3]).enumerate()
        {
            for i in 0..3 {
                let z = z_test(means[k][i].mean(), exact[i], means[k][i].standard_error());
                assert!(z.p_value > level(), "{integral:?}: e{} of channel {i}: {z:?}", k + 1);
                assert!((merged[i] / exact[i] - 1.0).abs() < 0.01, "e{}: {} {}", k + 1, merged[i], exact[i]);
            }
        }
        let (v, w) = (exact.variances(), merged.variances());
        assert!(
            (v.proposals / w.proposals - 1.0).abs() < 0.02 && (v.samples / w.samples - 1.0).abs() < 0.02,
            "{v:?} {w:?}"
        );
    }
}

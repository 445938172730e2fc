//! Optimizing control variates and its relatives: bias, variance, scale, and what happens where something is missing.

use super::integrals::run;
use super::mixtures::{DEGENERATE, Density, Mixture, PROPER, Sampler};
use super::{assert_means, assert_variances, level};
use lumiris_numbers::estimators::mis::{Heuristic, Technique};
use lumiris_numbers::estimators::ocv::{Penalty, crossfit, paper, regression};
use lumiris_numbers::estimators::stats::{Welford, z_test};
use lumiris_numbers::estimators::{correlated, optimal_mis};
use lumiris_numbers::math::hash::HashStream;

use lumiris_lanes::ocv::{Matrix, System, solve};

/// Numbers of samples of a pass.
const NUMBERS: [u32; 4] = [3, 8, 16, 64];

/// Passes in a row, each with the coefficients of the one before: uncorrelated estimates, since each has the expectation
/// ∫f whatever its coefficients are.
fn chain(sampler: &Sampler, runs: usize, key: u32) -> [Welford; 3] {
    let equations = sampler.equations;
    let (mut sums, mut beta) = (vec![0.0; equations.len()], vec![0.0; equations.coefficients()]);
    run(runs, [21, key, sampler.mixture as u32], |stream| {
        sampler.block(1, stream, &mut sums);
        let estimate = equations.estimate(&sums, &beta);
        equations.solve(&sums, Penalty::default(), &mut beta).expect("all samples are finite");
        estimate.map(f64::from)
    })
}

/// Estimates of the first `passes` passes: MIS, and the progressive form.
fn passes(sampler: &Sampler, passes: u32, stream: &mut HashStream) -> [[f64; 3]; 2] {
    let equations = sampler.equations;
    let (mut all, mut sums) = (vec![0.0; equations.len()], vec![0.0; equations.len()]);
    let mut beta = vec![0.0; equations.coefficients()];
    let mut total = [[0.0; 3]; 2];
    for len in Sampler::blocks(passes) {
        sampler.block(len, stream, &mut sums);
        let block = [equations.mean(&sums), equations.estimate(&sums, &beta)];
        for (total, block) in total.iter_mut().zip(block) {
            (0..3).for_each(|i| total[i] += f64::from(block[i]) * f64::from(len) / f64::from(passes));
        }
        equations.merge(&mut all, &sums);
        equations.solve(&all, Penalty::default(), &mut beta).expect("all samples are finite");
    }
    total
}

/// Variances of both of [`passes`], by channel.
fn variances(sampler: &Sampler, count: u32, runs: usize) -> [[f64; 3]; 2] {
    let mut welford = [[Welford::new(); 3]; 2];
    let mut stream = HashStream::new([22, count, sampler.mixture as u32]);
    for _ in 0..runs {
        for (welford, estimate) in welford.iter_mut().zip(passes(sampler, count, &mut stream)) {
            welford.iter_mut().zip(estimate).for_each(|(w, e)| w.add(e));
        }
    }
    welford.map(|form| form.map(|w| w.variance()))
}

/// Runs of a test, fewer where samples are many or it is no integral of the first rank.
fn runs_of(mixture: Mixture) -> usize {
    if mixture == Mixture::Table { 1_000_000 } else { 30_000 }
}

fn each_sampler(mixtures: &[Mixture], numbers: &[u32], mut test: impl FnMut(&Sampler, &str, [f64; 3])) {
    for &mixture in mixtures {
        let value = mixture.value();
        for &n in numbers {
            for stratified in [false, true] {
                let name = format!("{mixture:?}, N = {n}{}", if stratified { ", stratified" } else { "" });
                test(&Sampler::new(mixture, n, stratified), &name, value);
            }
        }
    }
}

#[test]
fn the_progressive_form_is_unbiased() {
    each_sampler(&PROPER, &NUMBERS, |sampler, name, value| {
        assert_means(name, &chain(sampler, runs_of(sampler.mixture), 0), value);
    });
}

#[test]
fn estimates_without_lights_with_too_many_components_and_of_nothing_are_finite_and_unbiased() {
    each_sampler(&DEGENERATE, &[1, 2, 3, 8], |sampler, name, value| {
        // A single sample may have a component that nothing else can take the place of.
        if sampler.counts[0] > 0 {
            let channels = chain(sampler, 50_000, 1);
            assert!(channels.iter().all(|w| w.mean().is_finite() && w.variance().is_finite()), "{name}: {channels:?}");
            assert_means(name, &channels, value);
        }
    });
}

#[test]
fn the_crossfit_form_is_unbiased() {
    let crossfit_runs = |sampler: &Sampler, runs| {
        let equations = sampler.equations;
        let mut halves = [vec![0.0; equations.len()], vec![0.0; equations.len()]];
        run(runs, [23, 0, sampler.mixture as u32], |stream| {
            halves.iter_mut().for_each(|half| sampler.block(1, stream, half));
            crossfit(equations, [&halves[0], &halves[1]], Penalty::default()).estimate.map(f64::from)
        })
    };
    // Halves of N = 8, 16, 64.
    each_sampler(&PROPER, &[4, 8, 32], |sampler, name, value| {
        assert_means(name, &crossfit_runs(sampler, runs_of(sampler.mixture)), value);
    });
}

#[test]
fn coefficients_of_the_same_samples_are_biased_in_both_other_forms() {
    // What the tests above would see if a block were fitted to itself.
    let sampler = Sampler::new(Mixture::Table, 8, false);
    let equations = sampler.equations;
    let value = Mixture::Table.value();
    let mut sums = vec![0.0; equations.len()];
    let regressed = run(300_000, [24, 0, 0], |stream| {
        sampler.block(1, stream, &mut sums);
        regression(equations, &sums, Penalty::NONE).estimate.map(f64::from)
    });
    let printed = run(300_000, [24, 1, 0], |stream| {
        sums.fill(0.0);
        sampler.add(1, 0.0, stream, &mut sums);
        paper(equations, &sums, &[1.0; 3], 1.0).estimate.map(f64::from)
    });
    for w in [&regressed[0], &printed[0]] {
        assert!(z_test(w.mean(), value[0], w.standard_error()).p_value < level(), "{} {}", w.mean(), value[0]);
    }
}

#[test]
fn four_passes_have_at_most_the_variance_of_mis() {
    each_sampler(&PROPER, &NUMBERS, |sampler, name, _| {
        let runs = if sampler.mixture == Mixture::Optimal { 60_000 } else { 12_000 };
        let [mis, ocv] = variances(sampler, 4, runs);
        // Where strata leave next to nothing of the variance, coefficients that were fitted to the samples one by one may
        // multiply it: what they add is small against the variance without strata.
        let loose = if sampler.is_stratified {
            variances(&Sampler::new(sampler.mixture, sampler.n, false), 4, 4_000)[0]
        } else {
            [0.0; 3]
        };
        for i in 0..3 {
            assert!(ocv[i] <= 1.02 * mis[i] + 0.05 * loose[i], "{name}, channel {i}: {} of MIS", ocv[i] / mis[i]);
        }
        if sampler.mixture == Mixture::Occluded {
            assert!(ocv[0] <= 0.75 * mis[0], "{name}: {} of MIS", ocv[0] / mis[0]);
        }
    });
}

/// Variance of the pass that follows `passes` over that of MIS.
fn ratio_after(sampler: &Sampler, passes: u32, runs: usize) -> f64 {
    let equations = sampler.equations;
    let (mut all, mut sums) = (vec![0.0; equations.len()], vec![0.0; equations.len()]);
    let mut beta = vec![0.0; equations.coefficients()];
    let mut stream = HashStream::new([25, passes, sampler.mixture as u32]);
    let (mut mis, mut ocv) = (Welford::new(), Welford::new());
    for _ in 0..runs {
        all.fill(0.0);
        for len in Sampler::blocks(passes) {
            sampler.add(len, 1.0, &mut stream, &mut all);
        }
        equations.solve(&all, Penalty::default(), &mut beta).expect("all samples are finite");
        sampler.block(1, &mut stream, &mut sums);
        mis.add(f64::from(equations.mean(&sums)[0]));
        ocv.add(f64::from(equations.estimate(&sums, &beta)[0]));
    }
    ocv.variance() / mis.variance()
}

#[test]
fn after_four_passes_the_variance_is_three_quarters_of_that_of_mis() {
    // The optimum for N = 3 is 0.77: it has one sample of each component.
    for n in [8, 16, 64] {
        let ratio = ratio_after(&Sampler::new(Mixture::Table, n, false), 4, 12_000);
        assert!(ratio <= 0.75, "N = {n}: {ratio}");
    }
    let ratio = ratio_after(&Sampler::new(Mixture::Occluded, 3, false), 4, 12_000);
    assert!(ratio <= 0.75, "N = 3: {ratio}");
}

#[test]
fn scaling_the_integrand_scales_the_estimate() {
    let estimates = |scale: f64| {
        let sampler = Sampler { scale, ..Sampler::new(Mixture::Colour, 8, true) };
        let mut stream = HashStream::new([26, 0, 0]);
        (0..200).map(|_| passes(&sampler, 16, &mut stream)[1]).collect::<Vec<_>>()
    };
    let one = estimates(1.0);
    for (scale, tolerance) in [(1e-6, 1e-4), (1e6, 1e-4), (2.0_f64.powi(-20), 0.0), (2.0_f64.powi(20), 0.0)] {
        for (one, scaled) in one.iter().flatten().zip(estimates(scale).iter().flatten()) {
            assert!((scaled - scale * one).abs() <= tolerance * (scale * one).abs(), "{scale}: {one} {scaled}");
        }
    }
}

#[test]
fn progressive_optimal_mis_is_unbiased() {
    each_sampler(&PROPER[..6], &[3, 8, 16], |sampler, name, value| {
        let equations = sampler.equations;
        let mut sums = vec![0.0; equations.len()];
        let mut alpha = vec![0.0; equations.coefficients()];
        // The integrals of columns that are left out are 0.
        let integrals: Vec<f32> = sampler.counts.iter().map(|&n| f32::from(u8::from(n > 0))).collect();
        let channels = run(100_000, [27, 0, sampler.mixture as u32], |stream| {
            sums.fill(0.0);
            sampler.add(1, 0.0, stream, &mut sums);
            let estimate = optimal_mis::estimate(equations, &sums, &integrals, &alpha);
            // Too few samples leave the balance heuristic.
            let _ = optimal_mis::coefficients(equations, &sums, &mut alpha);
            estimate.map(f64::from)
        });
        assert_means(name, &channels, value);
    });
}

#[test]
fn mixtures_of_whole_numbers_are_unbiased_with_every_heuristic() {
    for heuristic in [Heuristic::Balance, Heuristic::Power, Heuristic::Maximum] {
        each_sampler(&[Mixture::Colour, Mixture::Many], &[5, 16], |sampler, name, value| {
            let channels = run(60_000, [28, heuristic as u32, sampler.mixture as u32], |stream| {
                let mut sum = [0.0; 3];
                sampler.points(1, stream, |point| {
                    let techniques: Vec<Technique> = (0..sampler.counts.len())
                        .map(|j| Technique { n: sampler.counts[j] as f32, p: point.pdfs[j] as f32 })
                        .collect();
                    let n_p = f64::from(sampler.counts[point.component]) * point.pdfs[point.component];
                    let weight = f64::from(heuristic.weight_of(point.component, &techniques)) / n_p;
                    let f = sampler.mixture.f(point.x);
                    (0..3).for_each(|i| sum[i] += f[i] * weight);
                });
                sum
            });
            assert_means(&format!("{}: {name}", <&str>::from(heuristic)), &channels, value);
        });
    }
}

#[test]
fn correlated_sampling_has_the_variance_of_theory_and_no_bias_where_halves_are_fitted_to_each_other() {
    // The lobe samples; the control is what would be reflected without the occluder.
    let (density, mixture) = (Density::Tent, Mixture::Table);
    let value = mixture.value();
    let unshadowed = |x: f64| mixture.unshadowed(x);
    const POINTS: u32 = 400_000;
    let mut moments = [0.0; 5];
    for k in 0..POINTS {
        let x = density.sample((f64::from(k) + 0.5) / f64::from(POINTS));
        let (y, g) = (mixture.f(x)[0] / density.pdf(x), unshadowed(x) / density.pdf(x));
        for (m, v) in moments.iter_mut().zip([y, y * y, g, g * g, g * y]) {
            *m += v / f64::from(POINTS);
        }
    }
    let [y, yy, g, gg, gy] = moments;
    let (variance, lambda) = (yy - y * y - (gy - g * y).powi(2) / (gg - g * g), (gy - g * y) / (gg - g * g));

    const HALF: u32 = 32;
    let fill = |stream: &mut HashStream, sums: &mut [f32; correlated::SUMS]| {
        sums.fill(0.0);
        for _ in 0..HALF {
            let x = density.sample(f64::from(stream.next_f32()));
            let p = density.pdf(x);
            let control = (unshadowed(x) / p - g) as f32;
            correlated::add(sums, [control, 0.5 * control, control], mixture.f(x).map(|f| (f / p) as f32));
        }
    };
    let mut halves = [[0.0; correlated::SUMS]; 2];
    let fixed = run(100_000, [29, 0, 0], |stream| {
        fill(stream, &mut halves[0]);
        let lambda = lambda as f32;
        correlated::estimate(&halves[0], [lambda, 2.0 * lambda, lambda]).map(f64::from)
    });
    assert_means("correlated, fixed", &fixed, value);
    assert_variances("correlated, fixed", &fixed, [variance / f64::from(HALF); 3]);
    let fitted = run(100_000, [29, 1, 0], |stream| {
        halves.iter_mut().for_each(|half| fill(stream, half));
        correlated::crossfit([&halves[0], &halves[1]]).map(f64::from)
    });
    assert_means("correlated, crossfit", &fitted, value);
    // A coefficient of n samples costs one part in n.
    let ratio = fitted[0].variance() / (variance / f64::from(2 * HALF));
    assert!((0.98..1.1).contains(&ratio), "{ratio}");
}

#[test]
fn systems_of_many_points_have_the_solutions_of_each() {
    let same = Penalty { ridge: 1e-3, ..Penalty::SAME_SAMPLES };
    for penalty in [Penalty::default(), Penalty::SAME_SAMPLES, same] {
        for mixture in [Mixture::Table, Mixture::Colour, Mixture::Many, Mixture::Useless, Mixture::Zero] {
            for n in [3, 8, 64] {
                let sampler = Sampler::new(mixture, n, true);
                let (equations, mut stream) = (sampler.equations, HashStream::new([30, n, 0]));
                let mut rows = vec![0.0; 21 * equations.len()];
                rows.chunks_exact_mut(equations.len()).for_each(|row| sampler.block(1, &mut stream, row));
                let matrix = if penalty.known_means { Matrix::KnownMeans } else { Matrix::SampleMeans };
                let Penalty { ridge, shrink, .. } = penalty;
                let system = System { columns: equations.components(), matrix, ridge, shrink };
                assert_eq!(system.len(), equations.len());
                let width = equations.coefficients();
                let (mut all, mut one) = (vec![7.0; 21 * width], vec![0.0; width]);
                assert_eq!(solve(&system, &rows, &mut all), 0);
                for (row, all) in rows.chunks_exact(equations.len()).zip(all.chunks_exact(width)) {
                    equations.solve(row, penalty, &mut one).expect("all samples are finite");
                    let (a, b) = (equations.estimate(row, all), equations.estimate(row, &one));
                    for (a, b) in a.iter().zip(b) {
                        assert!((a - b).abs() <= 2e-3 * (1.0 + b.abs()), "{mixture:?} {n} {penalty:?}: {a} {b}");
                    }
                }
            }
        }
    }
}

#[test]
fn systems_with_an_intercept_are_those_of_the_paper() {
    let sampler = Sampler::new(Mixture::Colour, 16, false);
    let (equations, mut stream) = (sampler.equations, HashStream::new([31, 0, 0]));
    let mut rows = vec![0.0; 11 * equations.len()];
    rows.chunks_exact_mut(equations.len()).for_each(|row| sampler.add(1, 0.0, &mut stream, row));
    let mut beta = vec![0.0; 11 * equations.coefficients()];
    let system = System { columns: 4, matrix: Matrix::Intercept, ridge: 1.0, shrink: 0.0 };
    assert_eq!(solve(&system, &rows, &mut beta), 0);
    for (row, beta) in rows.chunks_exact(equations.len()).zip(beta.chunks_exact(equations.coefficients())) {
        let expected = paper(equations, row, &[1.0; 4], 1.0).estimate;
        for (i, expected) in expected.into_iter().enumerate() {
            let got: f32 = (0..4).map(|j| beta[3 * j + i]).sum();
            assert!((got - expected).abs() < 1e-4 * (1.0 + expected.abs()), "{got} {expected}");
        }
    }
}

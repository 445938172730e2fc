//! Optimizing control variates and related estimators: bias, variance, scaling, and degenerate cases.

use super::mixtures::{DEGENERATE, Density, Mixture, PROPER, Sampler};
use super::{assert_means, assert_variances, level, oracle};
use lumiris_numbers::estimators::heuristics::{Heuristic, Technique};
use lumiris_numbers::estimators::ocv::{Form, System};
use lumiris_numbers::estimators::stats::{Welford, z_test};
use lumiris_numbers::estimators::{correlated, optimal_mis};
use lumiris_test_support::integrals::run;
use lumiris_test_support::random::{Pcg32, RngExt, pcg32};

const PROGRESSIVE: Form = Form::Progressive;

/// Numbers of samples of a pass.
const NUMBERS: [u32; 4] = [3, 8, 16, 64];

/// Number of runs whose systems are solved together, as the renderer does for batches of points.
const BATCH: usize = 16;

/// Successive passes, each with the coefficients of the previous one. The estimates are uncorrelated, since each has
/// the expectation ∫f for any coefficients. [`BATCH`] rows of passes alternate.
fn chain(sampler: &Sampler, runs: usize, key: u32) -> [Welford; 3] {
    let equations = sampler.equations;
    let (len, width) = (equations.len(), equations.coefficients());
    let (mut sums, mut beta) = (vec![0.0; BATCH * len], vec![0.0; BATCH * width]);
    let mut next = 0;
    run(runs, [21, key, sampler.mixture as u32], |stream| {
        let row = next;
        next = (next + 1) % BATCH;
        let own = &mut sums[row * len..][..len];
        sampler.block(PROGRESSIVE, 1, stream, own);
        let estimate = equations.estimate(own, &beta[row * width..][..width]);
        if next == 0 {
            assert_eq!(equations.solve(PROGRESSIVE.system(), &sums, &mut beta), 0, "all samples are finite");
        }
        estimate.map(f64::from)
    })
}

/// Estimates of the first `passes` passes: MIS, and the progressive form.
fn passes(sampler: &Sampler, passes: u32, stream: &mut Pcg32) -> [[f64; 3]; 2] {
    let equations = sampler.equations;
    let (mut all, mut sums) = (vec![0.0; equations.len()], vec![0.0; equations.len()]);
    let mut beta = vec![0.0; equations.coefficients()];
    let mut total = [[0.0; 3]; 2];
    for len in Sampler::blocks(passes) {
        sampler.block(PROGRESSIVE, len, stream, &mut sums);
        let block = [equations.mean(&sums), equations.estimate(&sums, &beta)];
        for (total, block) in total.iter_mut().zip(block) {
            (0..3).for_each(|i| total[i] += f64::from(block[i]) * f64::from(len) / f64::from(passes));
        }
        equations.merge(&mut all, &sums);
        assert_eq!(equations.solve(PROGRESSIVE.system(), &all, &mut beta), 0, "all samples are finite");
    }
    total
}

/// Variances of both of [`passes`], by channel.
fn variances(sampler: &Sampler, count: u32, runs: usize) -> [[f64; 3]; 2] {
    let mut welford = [[Welford::new(); 3]; 2];
    let mut stream = pcg32([22, count, sampler.mixture as u32]);
    for _ in 0..runs {
        for (welford, estimate) in welford.iter_mut().zip(passes(sampler, count, &mut stream)) {
            welford.iter_mut().zip(estimate).for_each(|(w, e)| w.add(e));
        }
    }
    welford.map(|form| form.map(|w| w.variance()))
}

/// Variance of the progressive form of [`passes`] by channel. It is the mean, over fitted coefficients, of the exact
/// variance Var(ȳ − Σ β_j c̄_j) of each block with given coefficients, since blocks are uncorrelated.
fn predicted_variances(sampler: &Sampler, passes: u32, runs: usize) -> [Welford; 3] {
    let equations = sampler.equations;
    let blocks: Vec<_> = Sampler::blocks(passes).map(|len| (len, sampler.covariances(len))).collect();
    let (mut all, mut sums) = (vec![0.0; equations.len()], vec![0.0; equations.len()]);
    let mut beta = vec![0.0; equations.coefficients()];
    run(runs, [32, passes, sampler.mixture as u32], |stream| {
        all.fill(0.0);
        beta.fill(0.0);
        let mut variances = [0.0; 3];
        for (len, covariances) in &blocks {
            let share = f64::from(*len) / f64::from(passes);
            for (i, variance) in variances.iter_mut().enumerate() {
                let column = |j: usize| -f64::from(beta[3 * j + i]);
                for j in 0..equations.components() {
                    let with_others: f64 =
                        (0..equations.components()).map(|k| column(k) * covariances[3 + j][3 + k]).sum();
                    *variance += share * share * column(j) * (2.0 * covariances[i][3 + j] + with_others);
                }
                *variance += share * share * covariances[i][i];
            }
            sampler.block(PROGRESSIVE, *len, stream, &mut sums);
            equations.merge(&mut all, &sums);
            equations.solve(PROGRESSIVE.system(), &all, &mut beta);
        }
        variances
    })
}

/// Runs of a test of the mean: 600,000 with 3 samples of [`Mixture::Table`], and the same total number of samples for
/// runs with more, which gives about the same standard error; a tenth of it for other integrals.
fn runs_of(sampler: &Sampler) -> usize {
    let samples = if sampler.mixture == Mixture::Table { 1_800_000 } else { 180_000 };
    samples / sampler.n as usize
}

/// Runs of a test of the variance. Means of many samples are nearly normal, so fewer runs determine their variance.
fn runs_of_a_variance(sampler: &Sampler) -> usize {
    if sampler.n <= 8 { 10_000 } else { 3_400 }
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
        assert_means(name, &chain(sampler, runs_of(sampler), 0), value);
    });
}

#[test]
fn estimates_without_lights_with_too_many_components_and_of_nothing_are_finite_and_unbiased() {
    each_sampler(&DEGENERATE, &[1, 2, 3, 8], |sampler, name, value| {
        // A single sample may have a component that no other can replace.
        if sampler.counts[0] > 0 {
            let channels = chain(sampler, 50_000, 1);
            assert!(channels.iter().all(|w| w.mean().is_finite() && w.variance().is_finite()), "{name}: {channels:?}");
            assert_means(name, &channels, value);
        }
    });
}

/// Estimates of a form with coefficients from the same samples.
fn form_runs(form: Form, sampler: &Sampler, runs: usize) -> [Welford; 3] {
    let equations = sampler.equations;
    let (len, width) = (form.rows() * equations.len(), form.rows() * equations.coefficients());
    let (mut sums, mut beta) = (vec![0.0; BATCH * len], vec![0.0; BATCH * width]);
    let mut left = 0;
    run(runs, [23, form as u32, sampler.mixture as u32], |stream| {
        if left == 0 {
            sums.chunks_exact_mut(equations.len()).for_each(|row| sampler.block(form, 1, stream, row));
            equations.solve(form.system(), &sums, &mut beta);
            left = BATCH;
        }
        left -= 1;
        form.estimate(equations, &sums[left * len..][..len], &beta[left * width..][..width], &sampler.integrals)
            .map(f64::from)
    })
}

#[test]
fn the_crossfit_form_is_unbiased() {
    // Halves of N = 8, 16, 64.
    each_sampler(&PROPER, &[4, 8, 32], |sampler, name, value| {
        assert_means(name, &form_runs(Form::Crossfit, sampler, runs_of(sampler) / 2), value);
    });
}

#[test]
fn coefficients_of_the_same_samples_are_biased_in_both_other_forms() {
    // The effect that the tests above would detect if a block were fitted to itself.
    let sampler = Sampler::new(Mixture::Table, 8, false);
    let value = Mixture::Table.value();
    for form in [Form::Regression, Form::Paper] {
        let [w, ..] = form_runs(form, &sampler, 300_000);
        assert!(
            z_test(w.mean(), value[0], w.standard_error()).p_value < level(),
            "{form:?}: {} {}",
            w.mean(),
            value[0]
        );
    }
}

#[test]
fn four_passes_of_independent_samples_have_at_most_the_variance_of_mis() {
    for (mixture, n) in PROPER.into_iter().flat_map(|mixture| NUMBERS.map(|n| (mixture, n))) {
        let sampler = Sampler::new(mixture, n, false);
        let runs = runs_of_a_variance(&sampler) * if mixture == Mixture::Optimal { 5 } else { 1 };
        let [mis, ocv] = variances(&sampler, 4, runs);
        for i in 0..3 {
            assert!(ocv[i] <= 1.02 * mis[i], "{mixture:?}, N = {n}, channel {i}: {} of MIS", ocv[i] / mis[i]);
        }
        if mixture == Mixture::Occluded {
            assert!(ocv[0] <= 0.75 * mis[0], "N = {n}: {} of MIS", ocv[0] / mis[0]);
        }
    }
}

#[test]
fn four_passes_have_the_variance_of_their_blocks_and_coefficients() {
    // Strata leave little variance, and coefficients fitted to individual samples may multiply it. The test compares
    // with the exact variance of the estimate, with the variance within strata by quadrature.
    const PASSES: u32 = 4;
    each_sampler(&PROPER, &NUMBERS, |sampler, name, value| {
        let predicted = predicted_variances(sampler, PASSES, runs_of_a_variance(sampler) / 4);
        let mut squares = [Welford::new(); 3];
        let mut stream = pcg32([33, sampler.n, sampler.mixture as u32]);
        for _ in 0..runs_of_a_variance(sampler) {
            let [_, estimate] = passes(sampler, PASSES, &mut stream);
            (0..3).for_each(|i| squares[i].add((estimate[i] - value[i]).powi(2)));
        }
        for (i, (measured, expected)) in squares.iter().zip(&predicted).enumerate() {
            let error = measured.standard_error().hypot(expected.standard_error());
            assert!(error < 0.06 * expected.mean(), "{name}, channel {i}: a third more variance is found, ± {error}");
            let z = z_test(measured.mean(), expected.mean(), error);
            assert!(z.p_value > level(), "{name}, channel {i}: {} is not {}", measured.mean(), expected.mean());
        }
    });
}

/// Ratio of the variance of the pass after `passes` to MIS.
fn ratio_after(sampler: &Sampler, passes: u32, runs: usize) -> f64 {
    let equations = sampler.equations;
    let (mut all, mut sums) = (vec![0.0; equations.len()], vec![0.0; equations.len()]);
    let mut beta = vec![0.0; equations.coefficients()];
    let mut stream = pcg32([25, passes, sampler.mixture as u32]);
    let (mut mis, mut ocv) = (Welford::new(), Welford::new());
    for _ in 0..runs {
        all.fill(0.0);
        for len in Sampler::blocks(passes) {
            sampler.block(PROGRESSIVE, len, &mut stream, &mut sums);
            equations.merge(&mut all, &sums);
        }
        assert_eq!(equations.solve(PROGRESSIVE.system(), &all, &mut beta), 0, "all samples are finite");
        sampler.block(PROGRESSIVE, 1, &mut stream, &mut sums);
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
        let mut stream = pcg32([26, 0, 0]);
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
        let channels = run(runs_of(sampler), [27, 0, sampler.mixture as u32], |stream| {
            sums.fill(0.0);
            sampler.add(1, stream, &mut sums);
            let estimate = optimal_mis::estimate(equations, &sums, &sampler.integrals, &alpha);
            // With too few samples the result is the balance heuristic.
            let _ = optimal_mis::coefficients(equations, &sums, &mut alpha);
            estimate.map(f64::from)
        });
        assert_means(name, &channels, value);
    });
}

#[test]
fn two_techniques_are_unbiased_with_every_heuristic() {
    for heuristic in [Heuristic::Balance, Heuristic::Power, Heuristic::Maximum] {
        each_sampler(&[Mixture::Peak, Mixture::OneLight], &[5, 16], |sampler, name, value| {
            let channels = run(60_000, [28, heuristic as u32, sampler.mixture as u32], |stream| {
                let mut sum = [0.0; 3];
                sampler.points(1, stream, |point| {
                    let technique = |j: usize| Technique { n: sampler.counts[j] as f32, p: point.pdfs[j] as f32 };
                    let own = point.component;
                    let factor = f64::from(heuristic.factor(technique(own), technique(1 - own)));
                    let f = sampler.mixture.f(point.x);
                    (0..3).for_each(|i| sum[i] += f[i] * factor);
                });
                sum
            });
            assert_means(&format!("{}: {name}", <&str>::from(heuristic)), &channels, value);
        });
    }
}

#[test]
fn correlated_sampling_has_the_variance_of_theory_and_no_bias_where_halves_are_fitted_to_each_other() {
    // Samples of the lobe; the control is the unoccluded reflection.
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
    let fill = |stream: &mut Pcg32, sums: &mut [f32; correlated::SUMS]| {
        sums.fill(0.0);
        for _ in 0..HALF {
            let x = density.sample(f64::from(stream.random::<f32>()));
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
    // Each coefficient fitted to n samples costs a fraction 1/n.
    let ratio = fitted[0].variance() / (variance / f64::from(2 * HALF));
    assert!((0.98..1.1).contains(&ratio), "{ratio}");
}

#[test]
fn solutions_in_lanes_are_those_of_the_oracle() {
    let nearly_none = System { ridge: 1e-3, ..System::SAME_SAMPLES };
    for system in [System::OTHER_SAMPLES, System::SAME_SAMPLES, nearly_none, System::PAPER] {
        for mixture in [Mixture::Table, Mixture::Colour, Mixture::Many, Mixture::Useless, Mixture::Zero] {
            for n in [3, 8, 64] {
                let sampler = Sampler::new(mixture, n, true);
                let form = if system == System::PAPER { Form::Paper } else { PROGRESSIVE };
                let (equations, mut stream) = (sampler.equations, pcg32([30, n, 0]));
                let mut rows = vec![0.0; 21 * equations.len()];
                rows.chunks_exact_mut(equations.len()).for_each(|row| sampler.block(form, 1, &mut stream, row));
                let width = equations.coefficients();
                let mut all = vec![7.0; 21 * width];
                equations.solve(system, &rows, &mut all);
                for (row, beta) in rows.chunks_exact(equations.len()).zip(all.chunks_exact(width)) {
                    let expected: Vec<f32> = oracle::solve(equations, system, row).iter().map(|b| *b as f32).collect();
                    let of = |beta: &[f32]| form.estimate(equations, row, beta, &sampler.integrals);
                    for (a, b) in of(beta).iter().zip(of(&expected)) {
                        assert!((a - b).abs() <= 2e-3 * (1.0 + b.abs()), "{mixture:?} {n} {system:?}: {a} {b}");
                    }
                }
            }
        }
    }
}

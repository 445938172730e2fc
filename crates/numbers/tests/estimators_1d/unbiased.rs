//! Means and variances of the drawing methods.

use super::baselines::{defensive_choice, defensive_pdf};
use super::{assert_means, assert_variances};
use lumiris_numbers::estimators::mc;
use lumiris_numbers::estimators::ris::control::{ControlSum, doubt};
use lumiris_numbers::estimators::ris::{strata, stratified, systematic, with_replacement};
use lumiris_numbers::estimators::stats::Welford;
use lumiris_numbers::math::Rgb;
use lumiris_test_support::integrals::{ALL, Integral, Proposals, fill, run};
use lumiris_test_support::random::{Pcg32, RngExt};

const RUNS: usize = 1_000_000;
const M: usize = 12;
const N: usize = 3;

#[test]
fn with_replacement_has_the_variance_of_thesis_equation_4_2() {
    for integral in ALL {
        let (value, moments) = integral.moments();
        let (m, n) = (M as f64, N as f64);
        let expected = std::array::from_fn(|i| {
            (moments.e3[i] - moments.e1[i]) / m + (1.0 - 1.0 / m) * (moments.e2[i] - moments.e1[i]) / n
        });
        let (mut p, mut draws, mut u) = (Proposals::default(), Vec::new(), [0.0; N]);
        let channels = run(RUNS, [1, integral as u32, 0], |stream| {
            p.independent(integral, M, stream);
            fill(&mut u, stream);
            with_replacement(&p.weights, &u, &mut draws);
            p.estimate(&draws)
        });
        assert_means("with replacement", &channels, value);
        assert_variances("with replacement", &channels, expected);
    }
}

#[test]
fn independent_sets_have_the_variance_of_paper_equation_2() {
    for integral in ALL {
        let (value, moments) = integral.moments();
        let (mut p, mut draws, mut ends, mut u) = (Proposals::default(), Vec::new(), Vec::new(), [0.0; N]);
        let channels = run(RUNS, [2, integral as u32, 0], |stream| {
            p.independent(integral, M, stream);
            fill(&mut u, stream);
            strata::equal_proposals(M, N, &mut ends);
            stratified(&p.weights, &ends, &u, &mut draws);
            p.estimate(&draws)
        });
        assert_means("independent sets", &channels, value);
        assert_variances("independent sets", &channels, moments.variance_of_sets((M / N) as f64, N as f64));
    }
}

#[test]
fn stratified_draws_have_the_variance_of_thesis_equation_4_6() {
    // Four strata of the domain with different numbers of proposals, and one draw from each.
    const SIZES: [u32; 4] = [1, 2, 5, 3];
    for integral in ALL {
        let (mut value, mut expected) = ([0.0; 3], [0.0; 3]);
        for (k, &m) in SIZES.iter().enumerate() {
            let (v, e) = integral.moments_between(k as f64 / 4.0, (k + 1) as f64 / 4.0);
            let m = f64::from(m);
            for i in 0..3 {
                value[i] += v[i];
                expected[i] += (e.e3[i] - e.e1[i]) / m + (1.0 - 1.0 / m) * (e.e2[i] - e.e1[i]);
            }
        }
        let (mut p, mut draws, mut u) = (Proposals::default(), Vec::new(), [0.0; 4]);
        let ends = [1, 3, 8, 11];
        let channels = run(RUNS, [3, integral as u32, 0], |stream| {
            p.clear();
            for (k, &m) in SIZES.iter().enumerate() {
                for _ in 0..m {
                    let [a, b] = stream.random::<[f32; 2]>().map(f64::from);
                    let x = integral.sample([(k as f64 + a) / 4.0, b]);
                    p.push(integral, x, 1.0 / (f64::from(m) * 4.0 * integral.pdf(x)));
                }
            }
            fill(&mut u, stream);
            stratified(&p.weights, &ends, &u, &mut draws);
            p.estimate(&draws)
        });
        assert_means("stratified", &channels, value);
        assert_variances("stratified", &channels, expected);
    }
}

/// One estimate of `integral` by a drawing method.
type Estimate = fn(Integral, &mut Pcg32, &mut Proposals) -> [f64; 3];

fn systematic_estimate(integral: Integral, stream: &mut Pcg32, p: &mut Proposals) -> [f64; 3] {
    let mut draws = Vec::new();
    p.independent(integral, M, stream);
    systematic(&p.weights, N as u32, stream.random::<f32>(), &mut draws);
    p.estimate(&draws)
}

fn jittered_systematic_estimate(integral: Integral, stream: &mut Pcg32, p: &mut Proposals) -> [f64; 3] {
    let mut draws = Vec::new();
    p.jittered(integral, M, stream);
    systematic(&p.weights, N as u32, stream.random::<f32>(), &mut draws);
    p.estimate(&draws)
}

fn equal_weights_estimate(integral: Integral, stream: &mut Pcg32, p: &mut Proposals) -> [f64; 3] {
    let (mut draws, mut ends, mut u) = (Vec::new(), Vec::new(), [0.0; 2 * N]);
    p.independent(integral, M, stream);
    fill(&mut u, stream);
    strata::equal_weights(&p.weights, N, &u[N..], &mut ends);
    stratified(&p.weights, &ends, &u[..ends.len()], &mut draws);
    p.estimate(&draws)
}

fn single_draw_estimate(integral: Integral, stream: &mut Pcg32, p: &mut Proposals) -> [f64; 3] {
    let mut draws = Vec::new();
    p.independent(integral, 2, stream);
    with_replacement(&p.weights, &[stream.random::<f32>()], &mut draws);
    p.estimate(&draws)
}

fn plain_estimate(integral: Integral, stream: &mut Pcg32, _: &mut Proposals) -> [f64; 3] {
    let x = integral.sample(stream.random::<[f32; 2]>().map(f64::from));
    let factor = f64::from(mc::factor(1.0, integral.pdf(x) as f32));
    integral.f(x).map(|f| f * factor)
}

fn defensive_estimate(integral: Integral, stream: &mut Pcg32, _: &mut Proposals) -> [f64; 3] {
    // p₁ = 2 on the lower half of the first axis misses half of f; p₀ = p.
    const ALPHA: f32 = 0.3;
    let [u, v] = stream.random::<[f32; 2]>();
    let (safe, u) = defensive_choice(ALPHA, u);
    let u = [f64::from(u), f64::from(v)];
    let x = if safe { integral.sample(u) } else { [0.5 * u[0], integral.sample(u)[1]] };
    let p1 = if x[0] < 0.5 { 2.0 } else { 0.0 };
    let pdf = f64::from(defensive_pdf(ALPHA, integral.pdf(x) as f32, p1));
    integral.f(x).map(|f| f / pdf)
}

#[test]
fn every_other_way_of_drawing_is_unbiased() {
    let estimates: [(&str, Estimate); 6] = [
        ("systematic", systematic_estimate),
        ("systematic, jittered proposals", jittered_systematic_estimate),
        ("equal weights", equal_weights_estimate),
        ("one of two", single_draw_estimate),
        ("plain", plain_estimate),
        ("defensive mixture", defensive_estimate),
    ];
    for integral in ALL {
        let (value, _) = integral.moments();
        for (k, (name, estimate)) in estimates.iter().enumerate() {
            let mut p = Proposals::default();
            let channels = run(RUNS, [4, integral as u32, k as u32], |stream| estimate(integral, stream, &mut p));
            assert_means(name, &channels, value);
        }
    }
}

/// Estimates V̂ of the visibility at a point.
type Guess = fn(Integral, [f64; 2]) -> f64;

fn nearly_right(integral: Integral, x: [f64; 2]) -> f64 {
    0.9 * integral.visibility(x) + 0.05
}

/// Correct where it is 0 or 1, uncertain elsewhere.
fn blurred(integral: Integral, [x, y]: [f64; 2]) -> f64 {
    (-4..=4).map(|k| integral.visibility([(x + 0.01 * f64::from(k)).clamp(0.0, 1.0), y])).sum::<f64>() / 9.0
}

fn constant(_: Integral, _: [f64; 2]) -> f64 {
    0.3
}

fn opposite(integral: Integral, x: [f64; 2]) -> f64 {
    1.0 - integral.visibility(x)
}

/// Runs of `n` draws from the proposals, with V̂ by `guess` as a control variate; without `guess`, with the weights of
/// the unshadowed colour.
fn controlled_runs(integral: Integral, n: usize, guess: Option<Guess>, runs: usize) -> [Welford; 3] {
    let (mut p, mut draws) = (Proposals::default(), Vec::new());
    run(runs, [4, integral as u32, n as u32], |stream| {
        p.clear();
        let mut guesses = Vec::new();
        for _ in 0..M {
            let x = integral.sample(stream.random::<[f32; 2]>().map(f64::from));
            p.push(integral, x, 1.0 / (M as f64 * integral.pdf(x)));
            guesses.push(guess.map_or(0.0, |guess| guess(integral, x) as f32));
        }
        let mut control = ControlSum::default();
        if guess.is_some() {
            p.weights.iter_mut().zip(&guesses).for_each(|(w, &v)| *w *= doubt(v));
            p.unshadowed.iter().zip(&guesses).for_each(|(&c, &v)| control.propose(Rgb::from_array(c), v));
        }
        systematic(&p.weights, n as u32, stream.random::<f32>(), &mut draws);
        for draw in &draws {
            let j = draw.index as usize;
            control.draw(Rgb::from_array(p.unshadowed[j]) * draw.scale, guesses[j]);
        }
        let (seen, control) = (p.estimate(&draws), control.sum().to_array());
        [0, 1, 2].map(|c| seen[c] + f64::from(control[c]))
    })
}

#[test]
fn visibility_as_a_control_variate_is_unbiased_whatever_it_is() {
    for integral in ALL {
        let (value, _) = integral.moments();
        for (name, guess) in [
            ("nearly right", nearly_right as Guess),
            ("blurred", blurred),
            ("constant", constant),
            ("opposite", opposite),
        ] {
            for n in [1, N] {
                let channels = controlled_runs(integral, n, Some(guess), RUNS);
                assert_means(&format!("{name}, N = {n}"), &channels, value);
            }
        }
    }
}

#[test]
fn visibility_that_is_known_leaves_the_noise_of_the_proposals() {
    for integral in ALL {
        let variances = |guess| controlled_runs(integral, 1, guess, 100_000).map(|w| w.variance());
        let plain = variances(None);
        for (guess, most) in [(nearly_right as Guess, 0.5), (blurred, 0.7)] {
            for (v, plain) in variances(Some(guess)).iter().zip(plain) {
                assert!(*v < most * plain, "{integral:?}: {v} {plain}");
            }
        }
    }
}

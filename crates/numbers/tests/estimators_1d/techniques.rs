//! Several techniques, on proposals and on samples.

use super::integrals::{Integral, Proposals, fill, run};
use super::{assert_means, level};
use lumiris_numbers::estimators::mis::{Heuristic, Technique};
use lumiris_numbers::estimators::ris::techniques::{proposal_factor, sample_weight};
use lumiris_numbers::estimators::ris::{systematic, with_replacement};
use lumiris_numbers::estimators::stats::z_test;
use lumiris_numbers::math::hash::HashStream;

const RUNS: usize = 500_000;
const HEURISTICS: [Heuristic; 3] = [Heuristic::Balance, Heuristic::Power, Heuristic::Maximum];
const LINE: Integral = Integral::Line;
/// Proposals of each technique.
const NUMBERS: [u32; 3] = [5, 2, 1];

/// Techniques on the line: ½ + x, 1, and 2 on the lower half.
fn sample(technique: usize, u: f64) -> [f64; 2] {
    match technique {
        0 => LINE.sample([u, 0.0]),
        1 => [u, 0.0],
        _ => [0.5 * u, 0.0],
    }
}

fn techniques(x: [f64; 2]) -> [Technique; 3] {
    let densities = [LINE.pdf(x) as f32, 1.0, if x[0] < 0.5 { 2.0 } else { 0.0 }];
    [0, 1, 2].map(|i| Technique { n: NUMBERS[i] as f32, p: densities[i] })
}

/// Proposals of all techniques, with the factor that `factor` gives technique i.
fn propose(p: &mut Proposals, stream: &mut HashStream, factor: impl Fn(usize, &[Technique; 3]) -> f64) {
    p.clear();
    for (i, &m) in NUMBERS.iter().enumerate() {
        for _ in 0..m {
            let x = sample(i, f64::from(stream.next_f32()));
            p.push(LINE, x, factor(i, &techniques(x)));
        }
    }
}

#[test]
fn mis_on_proposals_is_unbiased() {
    let (value, _) = LINE.moments();
    for heuristic in HEURISTICS {
        let (mut p, mut draws) = (Proposals::default(), Vec::new());
        let channels = run(RUNS, [11, heuristic as u32, 0], |stream| {
            propose(&mut p, stream, |i, t| f64::from(proposal_factor(heuristic, i, t)));
            systematic(&p.weights, 2, stream.next_f32(), &mut draws);
            p.estimate(&draws)
        });
        assert_means(heuristic.into(), &channels, value);
    }
}

#[test]
fn the_printed_weight_of_proposals_without_their_number_is_biased() {
    let (value, _) = LINE.moments();
    let (mut p, mut draws) = (Proposals::default(), Vec::new());
    let channels = run(RUNS, [12, 0, 0], |stream| {
        let total = f64::from(NUMBERS.iter().sum::<u32>());
        propose(&mut p, stream, |i, t| f64::from(Heuristic::Balance.weight_of(i, t)) / (total * f64::from(t[i].p)));
        systematic(&p.weights, 2, stream.next_f32(), &mut draws);
        p.estimate(&draws)
    });
    for (w, value) in channels.iter().zip(value) {
        assert!(z_test(w.mean(), value, w.standard_error()).p_value < level(), "{} {value}", w.mean());
    }
}

#[test]
fn mis_on_samples_is_unbiased() {
    // Two targets that each resemble f in another place, with sets of 4 and 6 proposals and 1 and 2 draws.
    let targets = |x: [f64; 2]| [0.1 + x[0] * x[0], if x[0] < 0.6 { 2.0 - x[0] } else { 0.0 }];
    const SETS: [(usize, usize); 2] = [(4, 1), (6, 2)];
    let (value, _) = LINE.moments();
    for heuristic in HEURISTICS {
        let (mut weights, mut points, mut draws) = (Vec::new(), Vec::new(), Vec::new());
        let channels = run(RUNS, [13, heuristic as u32, 0], |stream| {
            let mut sum = [0.0; 3];
            for (k, (m, n)) in SETS.into_iter().enumerate() {
                points.clear();
                points.extend((0..m).map(|_| sample(k, f64::from(stream.next_f32()))));
                let pdf = |x: [f64; 2]| f64::from(techniques(x)[k].p) * m as f64;
                weights.clear();
                weights.extend(points.iter().map(|&x| (targets(x)[k] / pdf(x)) as f32));
                let mut u = [0.0; 2];
                fill(&mut u[..n], stream);
                with_replacement(&weights, &u[..n], &mut draws);
                for d in &draws {
                    let x = points[d.index as usize];
                    let q_hat = targets(x);
                    let all = [0, 1].map(|i| Technique { n: SETS[i].1 as f32, p: q_hat[i] as f32 });
                    let scale = f64::from(d.scale * sample_weight(heuristic, k, &all)) / pdf(x);
                    let f = LINE.f(x);
                    (0..3).for_each(|i| sum[i] += scale * f[i]);
                }
            }
            sum
        });
        assert_means(heuristic.into(), &channels, value);
    }
}

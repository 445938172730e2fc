//! Two techniques, on samples. On proposals they are weighted in lanes, and tested there.

use super::assert_means;
use lumiris_numbers::estimators::heuristics::{Heuristic, Technique};
use lumiris_numbers::estimators::ris::with_replacement;
use lumiris_test_support::integrals::{Integral, fill, run};
use lumiris_test_support::random::RngExt;

const RUNS: usize = 500_000;
const HEURISTICS: [Heuristic; 3] = [Heuristic::Balance, Heuristic::Power, Heuristic::Maximum];
const LINE: Integral = Integral::Line;
#[test]
fn mis_on_samples_is_unbiased() {
    // Two targets that resemble f in different regions, with sets of 4 and 6 proposals and 1 and 2 draws.
    let targets = |x: [f64; 2]| [0.1 + x[0] * x[0], if x[0] < 0.6 { 2.0 - x[0] } else { 0.0 }];
    const SETS: [(usize, usize); 2] = [(4, 1), (6, 2)];
    // Densities ½ + x and 1 of the proposals
    let pdfs = |x: [f64; 2]| [LINE.pdf(x), 1.0];
    let propose = |k: usize, u: f64| if k == 0 { LINE.sample([u, 0.0]) } else { [u, 0.0] };
    let (value, _) = LINE.moments();
    for heuristic in HEURISTICS {
        let (mut weights, mut points, mut draws) = (Vec::new(), Vec::new(), Vec::new());
        let channels = run(RUNS, [13, heuristic as u32, 0], |stream| {
            let mut sum = [0.0; 3];
            for (k, (m, n)) in SETS.into_iter().enumerate() {
                points.clear();
                points.extend((0..m).map(|_| propose(k, f64::from(stream.random::<f32>()))));
                let pdf = |x: [f64; 2]| pdfs(x)[k] * m as f64;
                weights.clear();
                weights.extend(points.iter().map(|&x| (targets(x)[k] / pdf(x)) as f32));
                let mut u = [0.0; 2];
                fill(&mut u[..n], stream);
                with_replacement(&weights, &u[..n], &mut draws);
                for d in &draws {
                    let x = points[d.index as usize];
                    let q_hat = targets(x);
                    let set = |i: usize| Technique { n: SETS[i].1 as f32, p: q_hat[i] as f32 };
                    let scale = f64::from(d.scale * heuristic.weight(set(k), set(1 - k))) / pdf(x);
                    let f = LINE.f(x);
                    (0..3).for_each(|i| sum[i] += scale * f[i]);
                }
            }
            sum
        });
        assert_means(heuristic.into(), &channels, value);
    }
}

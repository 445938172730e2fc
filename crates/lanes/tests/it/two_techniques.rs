//! Proposals of two techniques weighted by [`lumiris_lanes::ris_weights`], for an integral with a known value.

use lumiris_lanes::ris_weights;
use lumiris_numbers::estimators::heuristics::Heuristic;
use lumiris_numbers::estimators::ris::systematic;
use lumiris_numbers::estimators::stats::{Welford, sidak, z_test};
use lumiris_test_support::integrals::{Integral, run};
use lumiris_test_support::random::{Pcg32, RngExt};

const RUNS: usize = 500_000;
const HEURISTICS: [Heuristic; 3] = [Heuristic::Balance, Heuristic::Power, Heuristic::Maximum];
const LINE: Integral = Integral::Line;
/// Number of proposals of each technique.
const NUMBERS: [u32; 2] = [5, 3];

/// Significance level of each hypothesis; together they reject true hypotheses with a probability of 1 %.
fn level() -> f64 {
    sidak(0.01, 12)
}

/// Techniques on the line, with the densities ½ + x, and 2 on the lower half.
fn sample(technique: usize, u: f64) -> [f64; 2] {
    match technique {
        0 => LINE.sample([u, 0.0]),
        _ => [0.5 * u, 0.0],
    }
}

fn densities(x: [f64; 2]) -> [f32; 2] {
    [LINE.pdf(x) as f32, if x[0] < 0.5 { 2.0 } else { 0.0 }]
}

/// Proposals of both techniques in columns, the first technique first.
#[derive(Default)]
struct Table {
    x: Vec<[f64; 2]>,
    colour: [Vec<f32>; 3],
    p: [Vec<f32>; 2],
    q_hat: Vec<f32>,
    r: Vec<f32>,
    weight: Vec<f32>,
}

impl Table {
    /// Draws the proposals of both techniques.
    fn draw(&mut self, stream: &mut Pcg32) {
        self.x.clear();
        self.colour.iter_mut().chain(&mut self.p).for_each(Vec::clear);
        for (i, &m) in NUMBERS.iter().enumerate() {
            for _ in 0..m {
                let x = sample(i, f64::from(stream.random::<f32>()));
                self.x.push(x);
                self.colour.iter_mut().zip(LINE.colour(x)).for_each(|(column, c)| column.push(c as f32));
                self.p.iter_mut().zip(densities(x)).for_each(|(column, p)| column.push(p));
            }
        }
        [&mut self.q_hat, &mut self.r, &mut self.weight].into_iter().for_each(|v| v.resize(self.x.len(), 0.0));
    }

    /// q̂, r and w of all proposals. The techniques are weighted by the expected numbers `m`.
    fn weigh(&mut self, heuristic: Heuristic, m: [f32; 2]) {
        // Each technique's proposals need the density of the other technique
        let ones = [1.0; (NUMBERS[0] + NUMBERS[1]) as usize];
        let first = NUMBERS[0] as usize;
        for (own, range) in [(0, 0..first), (1, first..self.x.len())] {
            let proposals = ris_weights::Proposals {
                f_cos: self.colour.each_ref().map(|c| &c[range.clone()]),
                li: [&ones[range.clone()]; 3],
                p: &self.p[own][range.clone()],
                p_other: &self.p[1 - own][range.clone()],
                m: m[own],
                m_other: m[1 - own],
                heuristic,
            };
            let mut out = ris_weights::Weights {
                q_hat: &mut self.q_hat[range.clone()],
                r: &mut self.r[range.clone()],
                w: &mut self.weight[range.clone()],
            };
            ris_weights::weigh(lumiris_lanes::level(), &proposals, &mut out);
        }
    }
}

/// Estimates from two of the proposals of each run. The techniques are weighted by the expected numbers `m`.
fn estimates(heuristic: Heuristic, key: u32, m: [f32; 2]) -> [Welford; 3] {
    let (mut table, mut draws) = (Table::default(), Vec::new());
    run(RUNS, [key, heuristic as u32, 0], |stream| {
        table.draw(stream);
        table.weigh(heuristic, m);
        systematic(&table.weight, 2, stream.random::<f32>(), &mut draws);
        let mut sum = [0.0; 3];
        for draw in &draws {
            let i = draw.index as usize;
            let factor = f64::from(draw.scale * table.r[i]);
            let f = LINE.f(table.x[i]);
            (0..3).for_each(|c| sum[c] += factor * f[c]);
        }
        sum
    })
}

#[test]
fn mis_on_proposals_is_unbiased() {
    let (value, _) = LINE.moments();
    for heuristic in HEURISTICS {
        let channels = estimates(heuristic, 11, NUMBERS.map(|n| n as f32));
        for (w, value) in channels.iter().zip(value) {
            let z = z_test(w.mean(), value, w.standard_error());
            assert!(z.p_value > level(), "{heuristic:?}: {} is not {value}: {z:?}", w.mean());
        }
    }
}

#[test]
fn weights_by_wrong_numbers_of_proposals_are_biased() {
    let (value, _) = LINE.moments();
    let mean = NUMBERS.iter().sum::<u32>() as f32 / 2.0;
    for (w, value) in estimates(Heuristic::Balance, 12, [mean; 2]).iter().zip(value) {
        assert!(z_test(w.mean(), value, w.standard_error()).p_value < level(), "{} {value}", w.mean());
    }
}

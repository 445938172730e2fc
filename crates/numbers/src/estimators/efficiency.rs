//! How many samples are most efficient: a model of cost and variance of a path by its numbers of samples.
//!
//! A camera sample costs a + Σ_k b_k n_k, where n_k samples are drawn at vertices of kind k (first and later ones), and has
//! the variance A + Σ_k B_k/n_k^p_k: A is that of the camera sample and the path, the rest what samples of lights and their
//! visibility add. Efficiency is the inverse of the product. With one kind of independent samples (p = 1) it is greatest for
//! n² = (a B)/(A b), as in the choice of M and N of resampling [Talbot 2005, §4.3]. Samples that are points of a net have
//! p > 1, up to 3 where what they integrate is smooth [Owen 1997].

/// Kinds of vertices: the first of a path, and all later ones.
pub const KINDS: usize = 2;

/// What was measured with some numbers of samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// n_k.
    pub samples: [f64; KINDS],
    /// Cost of a camera sample.
    pub cost: f64,
    /// Variance of a camera sample.
    pub variance: f64,
}

/// Cost a + Σ b_k n_k and variance A + Σ B_k/n_k^p_k of a camera sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// a, then b_k.
    pub cost: [f64; 1 + KINDS],
    /// A, then B_k.
    pub variance: [f64; 1 + KINDS],
    /// p_k.
    pub powers: [f64; KINDS],
}

impl Model {
    /// The model through `base`, and through one measurement for each kind that has more samples of this kind only; `None`
    /// for kinds that do not occur, which then have no part. What noise makes negative is taken as 0. The `powers` are given,
    /// but if there is one kind alone and more of it leaves less of the variance than these explain.
    pub fn fit(base: &Measured, more: [Option<Measured>; KINDS], powers: [f64; KINDS]) -> Model {
        let mut model = Model { cost: [base.cost, 0.0, 0.0], variance: [base.variance, 0.0, 0.0], powers };
        for (k, more) in more.iter().enumerate() {
            let Some(more) = more else { continue };
            let (n0, n1) = (base.samples[k], more.samples[k]);
            let left = [n0, n1].map(|n| n.powf(-powers[k]));
            let b = ((more.cost - base.cost) / (n1 - n0)).max(0.0);
            let v = ((base.variance - more.variance) / (left[0] - left[1])).max(0.0);
            model.cost[1 + k] = b;
            model.variance[1 + k] = v;
            model.cost[0] -= b * n0;
            model.variance[0] -= v * left[0];
        }
        // What a camera sample costs, and how it varies, without any light sample is not nothing
        model.cost[0] = model.cost[0].max(FLOOR * base.cost);
        let least = FLOOR * base.variance;
        if let ([Some(more), None], true) = (more, model.variance[0] < least) {
            let ratio = more.samples[0] / base.samples[0];
            let variances = (base.variance - least) / (more.variance - least).max(f64::MIN_POSITIVE);
            model.powers[0] = (variances.ln() / ratio.ln()).clamp(powers[0], MAX_POWER);
            model.variance[1] = (base.variance - least) * base.samples[0].powf(model.powers[0]);
        }
        model.variance[0] = model.variance[0].max(least);
        model
    }

    /// Cost of a camera sample.
    pub fn cost(&self, samples: [f64; KINDS]) -> f64 {
        self.cost[0] + samples.iter().zip(&self.cost[1..]).map(|(n, b)| n * b).sum::<f64>()
    }

    /// Variance of a camera sample.
    pub fn variance(&self, samples: [f64; KINDS]) -> f64 {
        let of_light = (0..KINDS).map(|k| self.variance[1 + k] / samples[k].powf(self.powers[k]));
        self.variance[0] + of_light.sum::<f64>()
    }

    /// 1/(variance × cost).
    pub fn efficiency(&self, samples: [f64; KINDS]) -> f64 {
        1.0 / (self.variance(samples) * self.cost(samples))
    }

    /// The cheapest numbers among `choices` of each kind of which the efficiency is at least `share` of the greatest. Near
    /// its maximum efficiency hardly depends on numbers, and the maximum of a model that was measured is uncertain.
    pub fn best(&self, choices: [&[u32]; KINDS], share: f64) -> [u32; KINDS] {
        let all = || choices[0].iter().flat_map(|&first| choices[1].iter().map(move |&later| [first, later]));
        let efficiency = |n: &[u32; KINDS]| self.efficiency(n.map(f64::from));
        let greatest = all().map(|n| efficiency(&n)).fold(f64::NEG_INFINITY, f64::max);
        let cost = |n: &[u32; KINDS]| self.cost(n.map(f64::from));
        let good = all().filter(|n| efficiency(n) >= share * greatest);
        good.min_by(|a, b| cost(a).total_cmp(&cost(b))).unwrap_or([1; KINDS])
    }
}

/// Smallest share of what was measured that remains without light samples: a model that noise leaves with less would ask
/// for numbers beyond all measure.
const FLOOR: f64 = 0.02;
/// Greatest power that is fitted: edges of shadows leave nets little more, and noise may show any.
const MAX_POWER: f64 = 1.75;

#[cfg(test)]
mod tests {
    use super::*;

    const TRUTH: Model = Model { cost: [100.0, 10.0, 40.0], variance: [2.0, 5.0, 0.5], powers: [1.0; KINDS] };

    fn measured(samples: [f64; KINDS]) -> Measured {
        Measured { samples, cost: TRUTH.cost(samples), variance: TRUTH.variance(samples) }
    }

    #[test]
    fn a_model_is_recovered_from_three_measurements() {
        let model =
            Model::fit(&measured([1.0, 1.0]), [[7.0, 1.0], [1.0, 7.0]].map(|n| Some(measured(n))), [1.0; KINDS]);
        for (found, truth) in model.cost.iter().chain(&model.variance).zip(TRUTH.cost.iter().chain(&TRUTH.variance)) {
            assert!((found / truth - 1.0).abs() < 1e-12, "{model:?}");
        }
    }

    #[test]
    fn what_nets_gain_is_a_power() {
        let net = Model { cost: [100.0, 10.0, 0.0], variance: [0.02, 0.98, 0.0], powers: [1.5, 1.0] };
        let at = |n: f64| Measured { samples: [n, 1.0], cost: net.cost([n, 1.0]), variance: net.variance([n, 1.0]) };
        let model = Model::fit(&at(1.0), [Some(at(16.0)), None], [1.0; KINDS]);
        assert!((model.powers[0] - 1.5).abs() < 1e-9, "{model:?}");
        assert!((model.variance([64.0, 1.0]) / net.variance([64.0, 1.0]) - 1.0).abs() < 1e-9, "{model:?}");
        // Less than nothing is noise
        let none = Measured { variance: 0.0, ..at(16.0) };
        assert_eq!(Model::fit(&at(1.0), [Some(none), None], [1.0; KINDS]).powers, [MAX_POWER, 1.0]);
    }

    #[test]
    fn the_best_numbers_are_those_of_the_closed_form() {
        let direct = Model { cost: [90.0, 10.0, 0.0], variance: [1.0, 16.0, 0.0], ..TRUTH };
        // n² = (90 · 16)/(1 · 10) = 144
        let choices: Vec<u32> = (1..=64).collect();
        assert_eq!(direct.best([&choices, &[1]], 1.0), [12, 1]);
        let found = TRUTH.best([&choices, &choices], 1.0);
        let best = TRUTH.efficiency(found.map(f64::from));
        for first in &choices {
            for later in &choices {
                assert!(TRUTH.efficiency([*first, *later].map(f64::from)) <= best);
            }
        }
    }

    #[test]
    fn nearly_the_best_may_be_cheaper() {
        let choices: Vec<u32> = (1..=64).collect();
        let best = TRUTH.best([&choices, &choices], 1.0).map(f64::from);
        let least = |share: f64| share * TRUTH.efficiency(best);
        let mut before = best;
        for share in [0.98, 0.9, 0.7] {
            let near = TRUTH.best([&choices, &choices], share).map(f64::from);
            assert!(TRUTH.efficiency(near) >= least(share), "{share}: {near:?}");
            assert!(TRUTH.cost(near) <= TRUTH.cost(before), "{share}: {near:?} {before:?}");
            for first in &choices {
                for later in &choices {
                    let n = [*first, *later].map(f64::from);
                    assert!(TRUTH.efficiency(n) < least(share) || TRUTH.cost(n) >= TRUTH.cost(near), "{share}: {n:?}");
                }
            }
            before = near;
        }
        assert!(TRUTH.cost(before) < 0.9 * TRUTH.cost(best), "{before:?} {best:?}");
    }

    #[test]
    fn noise_gives_no_negative_parts() {
        let base = Measured { samples: [1.0, 1.0], cost: 10.0, variance: 1.0 };
        let worse = Measured { samples: [7.0, 1.0], cost: 9.0, variance: 1.2 };
        let all = Measured { samples: [1.0, 7.0], cost: 100.0, variance: 0.01 };
        let model = Model::fit(&base, [Some(worse), Some(all)], [1.0; KINDS]);
        assert_eq!((model.cost[1], model.variance[1]), (0.0, 0.0));
        assert!(model.cost[0] > 0.0 && model.variance[0] > 0.0, "{model:?}");
        assert_eq!(Model::fit(&base, [None, None], [1.0; KINDS]).cost([5.0, 5.0]), 10.0);
    }
}

//! Optimal numbers of samples: a model of the cost and variance of a path as functions of its sample counts.
//!
//! A camera sample costs a + Σ_k b_k n_k, with n_k samples of kind k: light samples at the first vertex and at later
//! ones, and BSDF samples. Its variance is A + Σ_k B_k/n_k^p_k. A is the variance of the camera sample and the path;
//! the other terms are the variance of the samples of kind k, including visibility. Efficiency is the inverse of cost
//! times variance. For one kind of independent samples (p = 1) its maximum is at n² = (a B)/(A b), as in the choice of
//! M and N of resampling [Talbot 2005, §4.3]. Samples that are points of a net have p > 1, up to 3 for smooth
//! integrands [Owen 1997].

/// Kinds of samples: light samples at the first vertex of a path, light samples at all later vertices, and BSDF samples
/// at the first vertex.
pub const KINDS: usize = 3;

/// A measurement with given sample counts.
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
    /// The model through `base`, and through one measurement for each kind with more samples of this kind only; `None`
    /// for kinds that do not occur, whose terms are 0. Terms that noise makes negative are set to 0. The `powers` are
    /// given. Exception: without later vertices, the power of light samples is fitted if more of them leave less
    /// variance than independent samples would.
    pub fn fit(base: &Measured, more: [Option<Measured>; KINDS], powers: [f64; KINDS]) -> Model {
        let only = |a: f64| std::array::from_fn(|k| if k == 0 { a } else { 0.0 });
        let mut model = Model { cost: only(base.cost), variance: only(base.variance), powers };
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
        // Cost and variance of a camera sample without any light sample are positive
        model.cost[0] = model.cost[0].max(FLOOR * base.cost);
        let least = FLOOR * base.variance;
        let of_light = model.variance[1] * base.samples[0].powf(-powers[0]);
        if let ([Some(more), None, _], true) = (more, powers[0] <= 1.0 && base.variance - of_light < least) {
            // The BSDF term is kept, unless noise makes it exceed the measured variance
            let of_bsdf = (model.variance[3] * base.samples[2].powf(-powers[2])).min(0.5 * more.variance);
            model.variance[3] = of_bsdf * base.samples[2].powf(powers[2]);
            let rest = least + of_bsdf;
            let ratio = more.samples[0] / base.samples[0];
            let variances = (base.variance - rest) / (more.variance - rest).max(f64::MIN_POSITIVE);
            model.powers[0] = (variances.ln() / ratio.ln()).clamp(powers[0], MAX_POWER);
            model.variance[1] = (base.variance - rest) * base.samples[0].powf(model.powers[0]);
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

    /// The cheapest combination of `choices` of each kind that `are_allowed` together and has at least the fraction
    /// `share` of the maximum efficiency. Near its maximum the efficiency is nearly constant, and the maximum of a
    /// measured model is uncertain.
    pub fn best(
        &self,
        choices: [&[u32]; KINDS],
        share: f64,
        are_allowed: impl Fn(&[u32; KINDS]) -> bool,
    ) -> [u32; KINDS] {
        let later = |first: u32| choices[1].iter().map(move |&later| [first, later]);
        let all = || {
            let lights = choices[0].iter().flat_map(move |&first| later(first));
            let numbers =
                lights.flat_map(move |[first, later]| choices[2].iter().map(move |&bsdf| [first, later, bsdf]));
            numbers.filter(&are_allowed)
        };
        let efficiency = |n: &[u32; KINDS]| self.efficiency(n.map(f64::from));
        let greatest = all().map(|n| efficiency(&n)).fold(f64::NEG_INFINITY, f64::max);
        let cost = |n: &[u32; KINDS]| self.cost(n.map(f64::from));
        let good = all().filter(|n| efficiency(n) >= share * greatest);
        good.min_by(|a, b| cost(a).total_cmp(&cost(b))).unwrap_or([1; KINDS])
    }
}

/// Minimum fraction of the measured cost and variance that remains without light samples: a smaller remainder, caused
/// by noise, would ask for excessive sample counts.
const FLOOR: f64 = 0.02;
/// Maximum fitted power: shadow edges reduce the benefit of nets to little more, and noise may suggest any.
const MAX_POWER: f64 = 1.75;

#[cfg(test)]
mod tests {
    use super::*;

    const TRUTH: Model =
        Model { cost: [100.0, 10.0, 40.0, 20.0], variance: [2.0, 5.0, 0.5, 3.0], powers: [1.0; KINDS] };

    fn measured(samples: [f64; KINDS]) -> Measured {
        Measured { samples, cost: TRUTH.cost(samples), variance: TRUTH.variance(samples) }
    }

    #[test]
    fn a_model_is_recovered_from_four_measurements() {
        let more = [[7.0, 1.0, 1.0], [1.0, 7.0, 1.0], [1.0, 1.0, 4.0]];
        let model = Model::fit(&measured([1.0; KINDS]), more.map(|n| Some(measured(n))), [1.0; KINDS]);
        for (found, truth) in model.cost.iter().chain(&model.variance).zip(TRUTH.cost.iter().chain(&TRUTH.variance)) {
            assert!((found / truth - 1.0).abs() < 1e-12, "{model:?}");
        }
    }

    #[test]
    fn what_nets_gain_is_a_power() {
        let net = Model { cost: [100.0, 10.0, 0.0, 0.0], variance: [0.02, 0.98, 0.0, 0.0], powers: [1.5, 1.0, 1.0] };
        let at = |n: f64| {
            let samples = [n, 1.0, 1.0];
            Measured { samples, cost: net.cost(samples), variance: net.variance(samples) }
        };
        let model = Model::fit(&at(1.0), [Some(at(16.0)), None, None], [1.0; KINDS]);
        assert!((model.powers[0] - 1.5).abs() < 1e-9, "{model:?}");
        assert!((model.variance([64.0, 1.0, 1.0]) / net.variance([64.0, 1.0, 1.0]) - 1.0).abs() < 1e-9, "{model:?}");
        // A negative term is noise
        let none = Measured { variance: 0.0, ..at(16.0) };
        assert_eq!(Model::fit(&at(1.0), [Some(none), None, None], [1.0; KINDS]).powers, [MAX_POWER, 1.0, 1.0]);
        // BSDF samples, which are only a part of the rest, keep their term
        let both = Model { variance: [0.02, 0.9, 0.0, 0.02], ..net };
        let at = |samples| Measured { samples, cost: both.cost(samples), variance: both.variance(samples) };
        let more = [Some(at([16.0, 1.0, 1.0])), None, Some(at([1.0, 1.0, 4.0]))];
        let model = Model::fit(&at([1.0; KINDS]), more, [1.0; KINDS]);
        for samples in [[16.0, 1.0, 1.0], [1.0, 1.0, 4.0], [4.0, 1.0, 2.0]] {
            assert!((model.variance(samples) / both.variance(samples) - 1.0).abs() < 0.05, "{samples:?} {model:?}");
        }
        // If BSDF samples cause nearly all variance, noise must not attribute the rest to light samples
        let noisy = |samples, variance| Measured { variance, ..at(samples) };
        let more = [Some(noisy([16.0, 1.0, 1.0], 0.98)), None, Some(noisy([1.0, 1.0, 4.0], 0.24))];
        let model = Model::fit(&noisy([1.0; KINDS], 1.0), more, [1.0; KINDS]);
        assert_eq!(model.powers, [1.0; KINDS]);
        assert!(model.variance([16.0, 1.0, 1.0]) > 0.95 && model.variance([1.0, 1.0, 4.0]) < 0.35, "{model:?}");
    }

    #[test]
    fn the_best_numbers_are_those_of_the_closed_form() {
        let direct = Model { cost: [90.0, 10.0, 0.0, 0.0], variance: [1.0, 16.0, 0.0, 0.0], ..TRUTH };
        // n² = (90 · 16)/(1 · 10) = 144
        let choices: Vec<u32> = (1..=64).collect();
        assert_eq!(direct.best([&choices, &[1], &[1]], 1.0, |_| true), [12, 1, 1]);
        assert_eq!(direct.best([&choices, &[1], &[1]], 1.0, |n| n[0] < 10), [9, 1, 1]);
        let choices = &choices[..16];
        let found = TRUTH.best([choices; KINDS], 1.0, |_| true);
        assert!(found.iter().all(|n| *n < 16) && found[0] > 1 && found[2] > 1, "{found:?}");
        let best = TRUTH.efficiency(found.map(f64::from));
        for k in 0..KINDS {
            for n in choices {
                let mut other = found;
                other[k] = *n;
                assert!(TRUTH.efficiency(other.map(f64::from)) <= best);
            }
        }
    }

    #[test]
    fn nearly_the_best_may_be_cheaper() {
        let choices: Vec<u32> = (1..=16).collect();
        let best = TRUTH.best([&choices; KINDS], 1.0, |_| true).map(f64::from);
        let least = |share: f64| share * TRUTH.efficiency(best);
        let mut before = best;
        for share in [0.98, 0.9, 0.7] {
            let near = TRUTH.best([&choices; KINDS], share, |_| true).map(f64::from);
            assert!(TRUTH.efficiency(near) >= least(share), "{share}: {near:?}");
            assert!(TRUTH.cost(near) <= TRUTH.cost(before), "{share}: {near:?} {before:?}");
            for first in &choices {
                for later in &choices {
                    let n = [f64::from(*first), f64::from(*later), near[2]];
                    assert!(TRUTH.efficiency(n) < least(share) || TRUTH.cost(n) >= TRUTH.cost(near), "{share}: {n:?}");
                }
            }
            before = near;
        }
        assert!(TRUTH.cost(before) < 0.9 * TRUTH.cost(best), "{before:?} {best:?}");
    }

    #[test]
    fn noise_gives_no_negative_parts() {
        let base = Measured { samples: [1.0; KINDS], cost: 10.0, variance: 1.0 };
        let worse = Measured { samples: [7.0, 1.0, 1.0], cost: 9.0, variance: 1.2 };
        let all = Measured { samples: [1.0, 7.0, 1.0], cost: 100.0, variance: 0.01 };
        let model = Model::fit(&base, [Some(worse), Some(all), None], [1.0; KINDS]);
        assert_eq!((model.cost[1], model.variance[1]), (0.0, 0.0));
        assert!(model.cost[0] > 0.0 && model.variance[0] > 0.0, "{model:?}");
        assert_eq!(Model::fit(&base, [None; KINDS], [1.0; KINDS]).cost([5.0; KINDS]), 10.0);
    }
}

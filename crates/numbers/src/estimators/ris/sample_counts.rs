//! Sample counts: the numbers of proposals M and samples N with the least variance in a given time.
//!
//! Symbols: T time to spend; T1 time of a proposal, T2 of a sample (tracing its ray); K = M/N;
//! V(f/p) = [`Variances::proposals`], V(f/q) = [`Variances::samples`] with q = q̂/∫q̂.
//!
//! N draws from M common proposals cost M T1 + N T2 and have the variance V(f/p)/M + (1 − 1/M) V(f/q)/N (thesis 4.2).
//! Its minimum is at
//!
//! K = (T2/T1) √[ (V(f/p) T/T2 − V(f/q)) / (V(f/q) T/T1 − V(f/q)) ]  (thesis 4.3),
//!
//! K̄ = T2/T1 (thesis 4.4), with equal time for proposals and samples, needs no variances. It at most doubles the
//! variance if V(f/q) ≤ V(f/p); if the target is worse than p and M is small, the factor can be larger (2.4 was
//! measured). N independent sets of M proposals cost N (M T1 + T2) and have the variance [(e3 − e2)/M + (e2 − e1)]/N
//! (paper 2), with the minimum at M = √[ |e3 − e2| T2 / (|e2 − e1| T1) ] (paper 3), with
//!
//! e1 = E(f/p)²,  e2 = E(f²/(q̂p)) E(q̂/p),  e3 = E(f²/p²);  V(f/p) = e3 − e1,  V(f/q) = e2 − e1.
//!
//! A colour has three variances, which are replaced by the length of the vector (l² norm), as in the paper. This is
//! exact for one channel and approximate for three: lengths of sums are shorter than sums of lengths, most of all in
//! (paper 3) if a channel that q̂ fits worse than p has e3 < e2.

/// Time of a proposal and of a sample (s). Only their ratios to each other and to the available time matter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    /// T1: generate a proposal and compute its weight (s).
    pub t1: f64,
    /// T2: draw a sample and evaluate it (s).
    pub t2: f64,
}

impl Costs {
    /// K̄ = T2/T1 [Talbot 2005, Eq. 4.4; Talbot et al. 2005, Eq. 4]; 1 if the ratio is undefined.
    pub fn robust_ratio(self) -> f64 {
        let ratio = self.t2 / self.t1;
        if ratio >= 0.0 { ratio } else { 1.0 }
    }
}

/// Variances of one proposal's f/p and of one ideal sample's f/q, as one number each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variances {
    /// V(f/p).
    pub proposals: f64,
    /// V(f/q).
    pub samples: f64,
}

impl Variances {
    /// l² norms of the variances of a colour.
    pub fn from_rgb(proposals: [f64; 3], samples: [f64; 3]) -> Self {
        Variances { proposals: length(proposals), samples: length(samples) }
    }

    /// V(f/p)/M + (1 − 1/M) V(f/q)/N of N draws with replacement from M proposals [Talbot 2005, Eq. 4.2].
    pub fn of_estimate(self, m: f64, n: f64) -> f64 {
        self.proposals / m + (1.0 - 1.0 / m) * self.samples / n
    }
}

/// l² norm of a vector.
pub fn length(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Numbers of proposals and samples, each at least 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts {
    /// Proposals, at least as many as samples ([`counts`]), or proposals per set ([`counts_of_sets`]).
    pub m: u32,
    /// Samples, or sets of one sample each.
    pub n: u32,
}

/// Upper bound of the numbers, so that they fit and are exact in f32.
const MAX_COUNT: f64 = 16_777_216.0;

/// Optimal K = M/N for `time` seconds, before clamping [Talbot 2005, Eq. 4.3]: infinite if V(f/q) = 0 (one sample
/// suffices), 0 if there should not be more proposals than samples, K̄ if nothing varies.
pub fn optimal_ratio(costs: Costs, variances: Variances, time: f64) -> f64 {
    let robust = costs.robust_ratio();
    let gain = variances.proposals * time / costs.t2 - variances.samples;
    let loss = variances.samples * time / costs.t1 - variances.samples;
    if gain <= 0.0 && loss <= 0.0 {
        return robust;
    }
    let ratio = robust * (gain.max(0.0) / loss.max(0.0)).sqrt();
    if ratio.is_nan() { robust } else { ratio }
}

/// M and N for a ratio K = M/N and `time` seconds [Talbot 2005, Section 4.3]:
/// K̃ = max(min(K, (T − T2)/T1), 1), N = ⌊T/(K̃ T1 + T2) + u₀⌋, M = ⌊N K̃ + u₁⌋.
///
/// The expectations are N = T/(K̃ T1 + T2) and M = K̃ N, so the expected time is T. If T < T1 + T2, both are 1. The
/// thesis uses one random number for both roundings, which makes them dependent; two random numbers keep both
/// expectations.
pub fn counts(ratio: f64, costs: Costs, time: f64, u: [f32; 2]) -> Counts {
    let ratio = clamp_ratio(ratio, costs, time);
    let n = round(time / (ratio * costs.t1 + costs.t2), u[0]);
    Counts { m: round(f64::from(n) * ratio, u[1]).max(n), n }
}

/// K̃ = max(min(K, (T − T2)/T1), 1): there is time for at least one sample, and there are no more samples than
/// proposals.
pub fn clamp_ratio(ratio: f64, costs: Costs, time: f64) -> f64 {
    let max = (time - costs.t2) / costs.t1;
    ratio.min(max).clamp(1.0, MAX_COUNT)
}

/// ⌊x + u⌋, whose expectation over u is x; between 1 and 2²⁴.
fn round(x: f64, u: f32) -> u32 {
    (x + f64::from(u)).clamp(1.0, MAX_COUNT) as u32
}

/// e1, e2 and e3 of a colour [Talbot et al. 2005, Eq. 2].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// E(f/p)².
    pub e1: [f64; 3],
    /// E(f²/(q̂p)) E(q̂/p).
    pub e2: [f64; 3],
    /// E(f²/p²).
    pub e3: [f64; 3],
}

impl Moments {
    /// V(f/p) = e3 − e1 and V(f/q) = e2 − e1, as lengths.
    pub fn variances(&self) -> Variances {
        Variances::from_rgb(difference(self.e3, self.e1), difference(self.e2, self.e1))
    }

    /// Variance of N independent sets of M proposals per channel [Talbot et al. 2005, Eq. 2].
    pub fn variance_of_sets(&self, m: f64, n: f64) -> [f64; 3] {
        let (by_m, by_n) = (difference(self.e3, self.e2), difference(self.e2, self.e1));
        std::array::from_fn(|i| (by_m[i] / m + by_n[i]) / n)
    }

    /// Optimal M of independent sets, before clamping [Talbot et al. 2005, Eq. 3]: infinite if V(f/q) = 0, and K̄ if
    /// nothing varies. 1 if a second proposal increases the length of the variance (q̂ fits f worse than p does), which
    /// the length |e3 − e2| does not show.
    pub fn optimal_set_size(&self, costs: Costs) -> f64 {
        // Half of −d|V|²/dM at M = 1.
        let (by_m, variance) = (difference(self.e3, self.e2), difference(self.e3, self.e1));
        if by_m.iter().zip(variance).map(|(d, v)| d * v).sum::<f64>() < 0.0 {
            return 1.0;
        }
        let by_m = length(by_m);
        let by_n = length(difference(self.e2, self.e1));
        let size = (by_m * costs.t2 / (by_n * costs.t1)).sqrt();
        if size.is_nan() { costs.robust_ratio() } else { size }
    }
}

fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

/// Size M and number N of independent sets for `time` seconds [Talbot et al. 2005, Section 4.2]: M ≥ 1, N = T/(M T1 +
/// T2) ≥ 1, and again M = (T/N − T2)/T1 with this N; rounded stochastically by `u`.
pub fn counts_of_sets(size: f64, costs: Costs, time: f64, u: [f32; 2]) -> Counts {
    let size = size.clamp(1.0, MAX_COUNT);
    let n = (time / (size * costs.t1 + costs.t2)).clamp(1.0, MAX_COUNT);
    let size = ((time / n - costs.t2) / costs.t1).clamp(1.0, MAX_COUNT);
    Counts { m: round(size, u[1]), n: round(n, u[0]) }
}

/// Running estimate of [`Moments`] from proposals with fully evaluated f. Several can be merged.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MomentsEstimate {
    count: u64,
    /// Σ f/p, Σ (f/p)², Σ f²/(q̂p) and Σ (f²/(q̂p))(q̂/p) = Σ (f/p)² where q̂ > 0, per channel.
    f: [f64; 3],
    f2: [f64; 3],
    a: [f64; 3],
    /// Σ q̂/p.
    w: f64,
}

impl MomentsEstimate {
    /// No proposals yet.
    pub const fn new() -> Self {
        MomentsEstimate { count: 0, f: [0.0; 3], f2: [0.0; 3], a: [0.0; 3], w: 0.0 }
    }

    /// Adds one proposal by f/p = c_j M (per channel) and q̂/p = w_j M. f must be 0 where the weight is 0, since the
    /// proposal could never be drawn; it counts as 0 then.
    pub fn add(&mut self, f_over_p: [f64; 3], q_hat_over_p: f64) {
        self.count += 1;
        if !(q_hat_over_p > 0.0) {
            return;
        }
        self.w += q_hat_over_p;
        for (i, f) in f_over_p.into_iter().enumerate() {
            self.f[i] += f;
            self.f2[i] += f * f;
            self.a[i] += f * f / q_hat_over_p;
        }
    }

    /// Adds the M proposals of one set: contributions c_j and weights w_j.
    pub fn add_set(&mut self, contributions: &[[f32; 3]], weights: &[f32]) {
        let m = weights.len() as f64;
        for (c, &w) in contributions.iter().zip(weights) {
            self.add(c.map(|c| f64::from(c) * m), f64::from(w) * m);
        }
    }

    /// Adds the proposals of `other`.
    pub fn merge(&mut self, other: &MomentsEstimate) {
        self.count += other.count;
        self.w += other.w;
        for i in 0..3 {
            self.f[i] += other.f[i];
            self.f2[i] += other.f2[i];
            self.a[i] += other.a[i];
        }
    }

    /// Number of proposals.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The moments, unbiased: products of means are estimated over pairs of different proposals, E(X)E(Y) ≈ (ΣX ΣY −
    /// ΣXY)/(n(n − 1)). `None` with fewer than two proposals.
    pub fn moments(&self) -> Option<Moments> {
        if self.count < 2 {
            return None;
        }
        let n = self.count as f64;
        let pairs = n * (n - 1.0);
        Some(Moments {
            e1: std::array::from_fn(|i| (self.f[i] * self.f[i] - self.f2[i]) / pairs),
            e2: std::array::from_fn(|i| (self.a[i] * self.w - self.f2[i]) / pairs),
            e3: std::array::from_fn(|i| self.f2[i] / n),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const COSTS: Costs = Costs { t1: 1.0, t2: 4.0 };

    #[test]
    fn extremes_ask_for_one_sample_or_for_as_many_as_proposals() {
        let ratio = |proposals, samples| optimal_ratio(COSTS, Variances { proposals, samples }, 100.0);
        assert_eq!(ratio(1.0, 0.0), f64::INFINITY);
        assert_eq!(counts(ratio(1.0, 0.0), COSTS, 100.0, [0.5; 2]), Counts { m: 96, n: 1 });
        assert_eq!(ratio(0.0, 1.0), 0.0);
        assert_eq!(counts(ratio(0.0, 1.0), COSTS, 100.0, [0.5; 2]), Counts { m: 20, n: 20 });
        assert_eq!(ratio(0.0, 0.0), 4.0);
        assert_eq!(Moments::default().optimal_set_size(COSTS), 4.0);
        let free = Costs { t1: 0.0, t2: 1.0 };
        assert_eq!(counts(free.robust_ratio(), free, 3.0, [0.0; 2]), Counts { m: 1 << 24, n: 3 });
        let nothing = Costs { t1: 0.0, t2: 0.0 };
        assert_eq!(nothing.robust_ratio(), 1.0);
    }

    #[test]
    fn moments_of_a_constant_have_no_variance_and_too_few_proposals_none() {
        let mut estimate = MomentsEstimate::new();
        assert_eq!(estimate.moments(), None);
        for _ in 0..5 {
            estimate.add([2.0, 1.0, 0.5], 4.0);
        }
        let m = estimate.moments().unwrap_or_default();
        assert_eq!((m.e1, m.e2, m.e3), ([4.0, 1.0, 0.25], [4.0, 1.0, 0.25], [4.0, 1.0, 0.25]));
        estimate.add([f64::NAN; 3], 0.0);
        assert_eq!(estimate.count(), 6);
        assert!(estimate.moments().is_some_and(|m| m.e3[0].is_finite()));
    }

    proptest! {
        #[test]
        fn counts_keep_their_expectation_and_order(
            ratio in 0.0_f64..100.0, t2 in 0.01_f64..100.0, time in 0.1_f64..1e4, u in 0.0_f32..1.0,
        ) {
            let costs = Costs { t1: 1.0, t2 };
            const GRID: u32 = 400;
            let (mut n, mut m) = (0.0, 0.0);
            for k in 0..GRID {
                let c = counts(ratio, costs, time, [u, (k as f32 + 0.5) / GRID as f32]);
                prop_assert!(c.m >= c.n && c.n >= 1);
                m += f64::from(c.m) / f64::from(GRID) / f64::from(c.n);
                n += f64::from(counts(ratio, costs, time, [(k as f32 + 0.5) / GRID as f32, u]).n) / f64::from(GRID);
            }
            let ratio = clamp_ratio(ratio, costs, time);
            prop_assert!((m - ratio).abs() < 2.0 / f64::from(GRID) + 1e-4 * ratio, "{} {}", m, ratio);
            let expected = (time / (ratio + t2)).max(1.0);
            prop_assert!((n - expected).abs() < 2.0 / f64::from(GRID) + 1e-4 * expected, "{} {}", n, expected);
        }

        #[test]
        fn counts_of_sets_spend_the_time(size in 0.0_f64..1e3, t2 in 0.01_f64..100.0, time in 0.1_f64..1e4) {
            let costs = Costs { t1: 1.0, t2 };
            const GRID: u32 = 400;
            let mut spent = 0.0;
            for k in 0..GRID {
                // Sufficiently independent: all pairs of a 20 × 20 grid.
                let u = [(k % 20) as f32 / 20.0 + 0.025, (k / 20) as f32 / 20.0 + 0.025];
                let c = counts_of_sets(size, costs, time, u);
                prop_assert!(c.m >= 1 && c.n >= 1);
                spent += f64::from(c.n) * (f64::from(c.m) + t2) / f64::from(GRID);
            }
            let expected = time.max(1.0 + t2);
            prop_assert!((spent / expected - 1.0).abs() < 0.06, "{} {}", spent, expected);
        }
    }
}

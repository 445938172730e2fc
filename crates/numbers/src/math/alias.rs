//! Sampling a discrete distribution in constant time: the alias method [Walker 1977; Vose 1991].
//!
//! Bin i stores a threshold qᵢ and an alias aᵢ. A uniform number picks a bin; its remainder picks i (below qᵢ) or aᵢ.

use super::ONE_MINUS_EPSILON;

/// A choice made by [`AliasTable::sample`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiscreteSample {
    /// The chosen index.
    pub index: usize,
    /// Probability of the choice.
    pub pmf: f32,
    /// A new uniform in [0, 1), independent of `index`. With n entries it has about 24 − log₂ n random bits.
    pub u: f32,
}

#[derive(Clone, Copy, Debug)]
struct Bin {
    threshold: f32,
    alias: u32,
}

/// A discrete distribution over `0..len`, proportional to weights.
#[derive(Clone, Debug, Default)]
pub struct AliasTable {
    bins: Vec<Bin>,
    pmf: Vec<f32>,
}

impl AliasTable {
    /// The table of `weights`. Weights that are negative or not finite count as 0. If all are 0, nothing can be
    /// sampled.
    pub fn new(weights: &[f32]) -> Self {
        let weight = |w: f32| if w.is_finite() { f64::from(w).max(0.0) } else { 0.0 };
        let sum: f64 = weights.iter().map(|&w| weight(w)).sum();
        if sum <= 0.0 {
            return AliasTable { bins: Vec::new(), pmf: vec![0.0; weights.len()] };
        }
        let pmf: Vec<f32> = weights.iter().map(|&w| (weight(w) / sum) as f32).collect();

        // Mean weight 1: bins below it are filled up from bins above it.
        let scale = weights.len() as f64 / sum;
        let mut scaled: Vec<f64> = weights.iter().map(|&w| weight(w) * scale).collect();
        let (mut under, mut over): (Vec<u32>, Vec<u32>) =
            (0..weights.len() as u32).partition(|&i| scaled[i as usize] < 1.0);
        let mut bins = vec![Bin { threshold: 1.0, alias: 0 }; weights.len()];
        while let (Some(&small), Some(&large)) = (under.last(), over.last()) {
            under.pop();
            bins[small as usize] = Bin { threshold: scaled[small as usize] as f32, alias: large };
            scaled[large as usize] -= 1.0 - scaled[small as usize];
            if scaled[large as usize] < 1.0 {
                over.pop();
                under.push(large);
            }
        }

        // Rounding leaves bins of weight 1; an impossible entry among them must remain impossible.
        let likeliest = (0..pmf.len()).fold(0, |best, i| if pmf[i] > pmf[best] { i } else { best }) as u32;
        for i in under.into_iter().chain(over) {
            let possible = pmf[i as usize] > 0.0;
            bins[i as usize] = Bin { threshold: if possible { 1.0 } else { 0.0 }, alias: likeliest };
        }
        AliasTable { bins, pmf }
    }

    /// Number of entries.
    #[inline]
    pub fn len(&self) -> usize {
        self.pmf.len()
    }

    /// True if there is no entry.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.pmf.is_empty()
    }

    /// Chooses an entry with probability [`pmf`](Self::pmf) by `u` in [0, 1); `None` if all weights are 0.
    #[inline]
    pub fn sample(&self, u: f32) -> Option<DiscreteSample> {
        if self.bins.is_empty() {
            return None;
        }
        let x = u * self.bins.len() as f32;
        let i = (x as usize).min(self.bins.len() - 1);
        let remainder = (x - i as f32).min(ONE_MINUS_EPSILON);
        let Bin { threshold, alias } = self.bins[i];
        let (index, u) = if remainder < threshold {
            (i, remainder / threshold)
        } else {
            (alias as usize, (remainder - threshold) / (1.0 - threshold))
        };
        Some(DiscreteSample { index, pmf: self.pmf[index], u: u.min(ONE_MINUS_EPSILON) })
    }

    /// Probability of entry `index`; 0 if there is no such entry.
    #[inline]
    pub fn pmf(&self, index: usize) -> f32 {
        self.pmf.get(index).copied().unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris_test_support::assert_chi_squared;
    use lumiris_test_support::random::{RngExt, pcg32};

    #[test]
    fn frequencies_follow_the_weights_and_remapped_numbers_are_uniform() {
        let cases: [&[f32]; 4] =
            [&[1.0], &[0.0, 3.0, 0.0], &[1.0, 2.0, 3.0, 4.0, 0.0, 90.0], &[1e-20, 2e-20, 0.0, 5e-21]];
        for (case, weights) in cases.into_iter().enumerate() {
            let table = AliasTable::new(weights);
            let total: f64 = weights.iter().map(|&w| f64::from(w)).sum();
            let mut stream = pcg32([7, case as u32, 0]);
            let count = 200_000;
            let mut observed = vec![0.0; weights.len() * 8];
            for _ in 0..count {
                let s = table.sample(stream.random::<f32>()).unwrap();
                assert_eq!(s.pmf, table.pmf(s.index));
                assert!(s.pmf > 0.0 && (0.0..1.0).contains(&s.u));
                observed[s.index * 8 + (s.u * 8.0) as usize] += 1.0;
            }
            let expected: Vec<f64> =
                (0..observed.len()).map(|i| f64::from(weights[i / 8]) / total / 8.0 * f64::from(count)).collect();
            assert_chi_squared(&observed, &expected, 1e-4);
        }
    }

    #[test]
    fn impossible_entries_are_never_chosen_and_empty_tables_choose_nothing() {
        let weights: Vec<f32> = (0..1000).map(|i| if i % 3 == 0 { 0.1 + i as f32 * 0.37 } else { 0.0 }).collect();
        let table = AliasTable::new(&weights);
        for i in 0..100_000 {
            assert_eq!(table.sample(i as f32 / 100_000.0).unwrap().index % 3, 0);
        }
        assert!(((0..1000).map(|i| f64::from(table.pmf(i))).sum::<f64>() - 1.0).abs() < 1e-5);
        assert_eq!(table.sample(ONE_MINUS_EPSILON).map(|s| s.pmf > 0.0), Some(true));
        assert_eq!(AliasTable::new(&[]).sample(0.5), None);
        assert_eq!(AliasTable::new(&[0.0, f32::NAN, -1.0, f32::INFINITY]).sample(0.5), None);
    }
}

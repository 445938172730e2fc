//! Discrete choice by inversion of running sums of weights: S_i = w_0 + … + w_i.
//!
//! The sums of a table may be normalised or not, and are kept in whatever type suits their owner: f64 where many
//! weights are summed, f32 for a few at a point, whole numbers where things are counted. A table is a slice, so that it
//! can be a part of a longer one.

/// A type of running sums.
pub trait RunningSum: Copy {
    /// The type in which sums are compared and subtracted.
    type Number: Copy + Default + PartialOrd + std::ops::Sub<Output = Self::Number>;

    /// Converts the sum to that type.
    fn number(self) -> Self::Number;
}

impl RunningSum for f64 {
    type Number = f64;

    #[inline(always)]
    fn number(self) -> f64 {
        self
    }
}

impl RunningSum for f32 {
    type Number = f32;

    #[inline(always)]
    fn number(self) -> f32 {
        self
    }
}

impl RunningSum for u32 {
    type Number = f32;

    #[inline(always)]
    fn number(self) -> f32 {
        self as f32
    }
}

/// The first index whose sum exceeds `x`, so that indices without weight are never chosen; `sums.len()` if there is
/// none.
#[inline]
pub fn find<S: RunningSum>(sums: &[S], x: S::Number) -> usize {
    sums.partition_point(|sum| sum.number() <= x)
}

/// As [`find`], for `count` computed sums; `sum(i)` must not decrease.
pub fn find_computed<N: PartialOrd>(count: usize, sum: impl Fn(usize) -> N, x: N) -> usize {
    let (mut low, mut high) = (0, count);
    while low < high {
        let middle = low.midpoint(high);
        if sum(middle) <= x { low = middle + 1 } else { high = middle }
    }
    low
}

/// The sum of the weights before index `i`.
#[inline]
pub fn sum_before<S: RunningSum>(sums: &[S], i: usize) -> S::Number {
    if i == 0 { S::Number::default() } else { sums[i - 1].number() }
}

/// The weight of index `i` including rounding: the probability with which [`find`] chooses it, in units of the sums.
#[inline]
pub fn weight<S: RunningSum>(sums: &[S], i: usize) -> S::Number {
    sums[i].number() - sum_before(sums, i)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_place_is_found_for_the_part_of_the_sum_that_is_its_weight() {
        let counts = [0_u32, 3, 3, 10, 10];
        let found: Vec<usize> = (0..11).map(|x| find(&counts, x as f32)).collect();
        assert_eq!(found, [1, 1, 1, 3, 3, 3, 3, 3, 3, 3, 5]);
        assert!((0..11).all(|x| find_computed(5, |i| counts[i], x) == found[x as usize]));
        assert_eq!([0, 1, 2, 3, 4].map(|i| weight(&counts, i)), [0.0, 3.0, 0.0, 7.0, 0.0]);
        assert_eq!([0, 1, 3].map(|i| sum_before(&counts, i)), [0.0, 0.0, 3.0]);
    }

    #[test]
    fn sums_of_all_types_are_inverted_alike() {
        let (wide, narrow) = ([0.25_f64, 0.5, 1.0], [0.25_f32, 0.5, 1.0]);
        for x in [0.0, 0.249, 0.25, 0.75, 1.0] {
            assert_eq!(find(&wide, x), find(&narrow, x as f32));
        }
        assert_eq!((find::<f64>(&[], 0.0), weight(&wide, 2), weight(&narrow, 2)), (0, 0.5, 0.5));
    }
}

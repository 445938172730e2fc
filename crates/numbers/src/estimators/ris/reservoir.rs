//! Reservoir sampling: one item of a weighted stream of unknown length, in one pass [Chao 1982]. Item j replaces the
//! kept item with the probability w_j/(w_0 + … + w_j), so that the final item is chosen in proportion to its weight.

/// The state of a reservoir.
#[derive(Clone, Copy, Debug)]
pub struct Reservoir<T> {
    kept: Option<T>,
    sum: f64,
    /// One random number serves all choices: it is remapped to be uniform again after each.
    u: f64,
}

impl<T> Reservoir<T> {
    /// An empty reservoir; `u` is a uniform number in [0, 1).
    #[inline]
    pub fn new(u: f32) -> Self {
        Reservoir { kept: None, sum: 0.0, u: f64::from(u) }
    }

    /// Offers an item. Items whose weight is not positive and finite are ignored.
    #[inline]
    pub fn offer(&mut self, thing: T, weight: f32) {
        let weight = f64::from(weight);
        if !(weight > 0.0 && weight.is_finite()) {
            return;
        }
        self.sum += weight;
        let p_take = weight / self.sum;
        if self.u < p_take {
            self.kept = Some(thing);
            self.u /= p_take;
        } else {
            self.u = (self.u - p_take) / (1.0 - p_take);
        }
    }

    /// The sum of all weights.
    #[inline]
    pub fn sum(&self) -> f64 {
        self.sum
    }

    /// The kept item; `None` if there was no weight.
    #[inline]
    pub fn into_kept(self) -> Option<T> {
        self.kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn things_are_kept_for_the_part_of_the_numbers_that_is_their_weight() {
        const GRID: u16 = 10_000;
        let weights = [0.0, 3.0, f32::NAN, 1.0, f32::INFINITY, 4.0, -1.0];
        let mut counts = [0_u32; 7];
        for k in 0..GRID {
            let mut reservoir = Reservoir::new((f32::from(k) + 0.5) / f32::from(GRID));
            weights.iter().enumerate().for_each(|(i, &w)| reservoir.offer(i, w));
            assert_eq!(reservoir.sum(), 8.0);
            let i = reservoir.into_kept().expect("three have weight");
            counts[i] += 1;
        }
        // An item may be chosen in several intervals, whose ends may round either way
        for (count, weight) in counts.into_iter().zip([0.0, 3.0, 0.0, 1.0, 0.0, 4.0, 0.0]) {
            assert!((f64::from(count) - weight / 8.0 * f64::from(GRID)).abs() <= 4.0, "{counts:?}");
        }
    }

    #[test]
    fn nothing_is_kept_of_a_stream_without_weight() {
        let mut reservoir = Reservoir::new(0.5);
        assert!(reservoir.into_kept().is_none());
        reservoir.offer((), 0.0);
        assert!(reservoir.into_kept().is_none());
    }
}

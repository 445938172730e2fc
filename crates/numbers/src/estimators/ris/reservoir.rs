//! One of a stream of weighted things whose number is not known before, in one pass [Chao 1982]: thing j takes the
//! place of what is kept with the probability w_j/(w_0 + … + w_j), so that each is kept in the end with its part of the
//! whole weight.

/// What is kept of a stream.
#[derive(Clone, Copy, Debug)]
pub struct Reservoir<T> {
    kept: Option<T>,
    sum: f64,
    /// One number serves for all choices: what is left of it after each is uniform again.
    u: f64,
}

impl<T> Reservoir<T> {
    /// Nothing is kept yet; `u` is a uniform number in [0, 1).
    #[inline]
    pub fn new(u: f32) -> Self {
        Reservoir { kept: None, sum: 0.0, u: f64::from(u) }
    }

    /// Offers a thing. One whose weight is not positive and finite is passed over.
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

    /// What is kept, and the sum of all weights; `None` if nothing had weight.
    #[inline]
    pub fn into_kept(self) -> Option<(T, f64)> {
        Some((self.kept?, self.sum))
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
            let (i, sum) = reservoir.into_kept().expect("three have weight");
            assert_eq!(sum, 8.0);
            counts[i] += 1;
        }
        // A thing has an interval for each time that it may be taken, whose ends may round either way
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

//! Choices of several lights at the same point by a [`LightTree`](super::LightTree): what they have in common.

/// Probabilities at the top of a light tree for one point, as far as they have been needed; NaN otherwise.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Turns([f32; Self::COUNT]);

impl Turns {
    /// Inner nodes of four levels, and one number more.
    pub const COUNT: usize = 16;
    /// Nothing is known.
    pub const NONE: Turns = Turns([f32::NAN; Self::COUNT]);
    /// The number of what is no node: the probability of the lights beside the tree.
    pub const BESIDE: usize = 0;

    /// The probability of this `number`, by `determine` where it is not known; that of any number beyond the last is not
    /// kept.
    #[inline]
    pub fn probability(&mut self, number: usize, determine: impl FnOnce() -> f32) -> f32 {
        match self.0.get_mut(number) {
            Some(known) => {
                if known.is_nan() {
                    *known = determine();
                }
                *known
            }
            None => determine(),
        }
    }
}

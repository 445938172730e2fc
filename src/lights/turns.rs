//! Choices of several lights at the same point by a [`LightTree`](super::LightTree): what they have in common.

/// Probabilities at the top of a light tree for one of many points, as far as they are known.
#[derive(Clone, Copy, Debug)]
pub struct Turns<'a> {
    /// A column for each number.
    columns: &'a [f32],
    len: usize,
    point: usize,
}

impl<'a> Turns<'a> {
    /// Inner nodes of four levels, and one number more.
    pub const COUNT: usize = 16;
    /// The number of what is no node: the probability of the lights beside the tree.
    pub const BESIDE: usize = 0;
    /// Nothing is known.
    pub const NONE: Turns<'static> = Turns { columns: &[], len: 0, point: 0 };

    /// Those of a point, by [`Self::COUNT`] columns of the length `len`, or by none.
    #[inline]
    pub fn new(columns: &'a [f32], len: usize, point: usize) -> Self {
        Turns { columns, len, point }
    }

    /// The probability of this `number`, by `determine` where it is not known.
    #[inline]
    pub fn probability(&self, number: usize, determine: impl FnOnce() -> f32) -> f32 {
        self.columns.get(number * self.len + self.point).copied().unwrap_or_else(determine)
    }
}

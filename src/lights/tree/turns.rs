//! Probabilities shared by several choices of lights at the same point in a light tree ([`super::light_tree`]).

/// Precomputed probabilities at the top of a light tree for one of many points; may be empty.
#[derive(Clone, Copy, Debug)]
pub struct Turns<'a> {
    /// One column per node number.
    columns: &'a [f32],
    len: usize,
    point: usize,
}

impl<'a> Turns<'a> {
    /// Number of columns: the inner nodes of four levels, and [`Self::BESIDE`].
    pub const COUNT: usize = 16;
    /// Index that stands for lights beside the tree.
    pub const BESIDE: usize = 0;
    /// No precomputed probabilities.
    pub const NONE: Turns<'static> = Turns { columns: &[], len: 0, point: 0 };

    /// The probabilities of a point, in [`Self::COUNT`] columns of length `len`, or none.
    #[inline]
    pub fn new(columns: &'a [f32], len: usize, point: usize) -> Self {
        Turns { columns, len, point }
    }

    /// The probability of the node `number`; computed by `determine` if it is not precomputed.
    #[inline]
    pub fn probability(&self, number: usize, determine: impl FnOnce() -> f32) -> f32 {
        self.columns.get(number * self.len + self.point).copied().unwrap_or_else(determine)
    }
}

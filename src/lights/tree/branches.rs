//! Probabilities of the branches at the top of a light tree at one point, shared by several choices of lights.

/// Number of columns: the inner nodes of four levels by heap index, and [`OUTSIDE_TREE`].
pub(super) const COLUMNS: usize = 16;
/// Column of the probability of the infinite lights, which are not in the tree; no node has this heap index.
pub(super) const OUTSIDE_TREE: usize = 0;

/// Precomputed branch probabilities at one point; may be empty.
#[derive(Clone, Copy, Debug)]
pub struct Branches<'a> {
    /// One column per heap index: the probability of the left child.
    columns: &'a [f32],
    len: usize,
    point: usize,
}

impl<'a> Branches<'a> {
    /// The probabilities of a point, in [`COLUMNS`] columns of length `len`.
    #[inline]
    pub(super) fn new(columns: &'a [f32], len: usize, point: usize) -> Self {
        Branches { columns, len, point }
    }

    /// No precomputed probabilities.
    pub const NONE: Branches<'static> = Branches { columns: &[], len: 0, point: 0 };

    /// Probability of the left child of a node, or of the infinite lights for [`OUTSIDE_TREE`]; calls `compute` if it
    /// is not precomputed.
    #[inline]
    pub(in crate::lights) fn probability(&self, heap_index: usize, compute: impl FnOnce() -> f32) -> f32 {
        self.columns.get(heap_index * self.len + self.point).copied().unwrap_or_else(compute)
    }

    /// Probability of the infinite lights; calls `compute` if it is not precomputed.
    #[inline]
    pub(in crate::lights) fn infinite_probability(&self, compute: impl FnOnce() -> f32) -> f32 {
        self.probability(OUTSIDE_TREE, compute)
    }
}

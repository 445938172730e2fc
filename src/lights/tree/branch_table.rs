//! Probabilities of the branches at the top of a light tree, computed for many points at once.

use super::branches::{Branches, COLUMNS, OUTSIDE_TREE};
use super::tree_choice::TreeChoice;
use lumiris_lanes::columns::{Column, reserve};
use lumiris_lanes::level;
use lumiris_lanes::light_tree::{Receivers, first_probabilities, importances};

/// Precomputed branch probabilities of many points.
#[derive(Debug, Default)]
pub struct BranchTable {
    /// The columns of [`Branches`].
    columns: Column,
    /// Length of each column; 0 if nothing is computed.
    len: usize,
}

impl BranchTable {
    /// Discards all probabilities.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// Computes the probabilities at the points `at`.
    pub fn compute(&mut self, choice: &TreeChoice, at: &Receivers<'_>) {
        let len = at.p[0].len();
        self.len = len;
        reserve(&mut [&mut self.columns], COLUMNS * len);

        // Infinite lights
        let outside = &mut self.columns[OUTSIDE_TREE * len..][..len];
        match choice.tree.root() {
            Some(root) if !choice.infinite.is_empty() => {
                importances(level(), root, at, outside);
                let fraction = choice.infinite_fraction();
                outside.iter_mut().for_each(|p| *p = if *p > 0.0 { fraction } else { 1.0 });
            }
            _ => outside.fill(if choice.infinite.is_empty() { 0.0 } else { 1.0 }),
        }

        // Nodes
        for (heap_index, children) in choice.tree.top_branches() {
            first_probabilities(level(), children, at, &mut self.columns[heap_index * len..][..len]);
        }
    }

    /// The probabilities at point `i`.
    #[inline]
    pub fn at(&self, i: usize) -> Branches<'_> {
        if self.len == 0 { Branches::NONE } else { Branches::new(&self.columns[..COLUMNS * self.len], self.len, i) }
    }
}

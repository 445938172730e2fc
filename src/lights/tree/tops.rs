//! Probabilities of the top nodes of a light tree, for many points at once.

use super::tree_choice::TreeChoice;
use super::turns::Turns;
use lumiris_lanes::columns::{Column, reserve};
use lumiris_lanes::level;
use lumiris_lanes::light_tree::{Receivers, first_probabilities, importances};

/// Precomputed probabilities of many points.
#[derive(Debug, Default)]
pub struct Tops {
    /// The columns of [`Turns`].
    columns: Column,
    /// Length of each column; 0 if nothing is computed.
    len: usize,
}

impl Tops {
    /// Discards all probabilities.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// Computes the probabilities of the points `at`.
    pub fn determine(&mut self, choice: &TreeChoice, at: &Receivers<'_>) {
        let len = at.p[0].len();
        self.len = len;
        reserve(&mut [&mut self.columns], Turns::COUNT * len);
        let beside = &mut self.columns[Turns::BESIDE * len..][..len];
        match choice.tree.root() {
            Some(root) if !choice.infinite.is_empty() => {
                importances(level(), root, at, beside);
                let fraction = choice.infinite_fraction();
                beside.iter_mut().for_each(|p| *p = if *p > 0.0 { fraction } else { 1.0 });
            }
            _ => beside.fill(if choice.infinite.is_empty() { 0.0 } else { 1.0 }),
        }
        for (number, children) in choice.tree.tops() {
            first_probabilities(level(), children, at, &mut self.columns[number * len..][..len]);
        }
    }

    /// The probabilities of point `i`.
    #[inline]
    pub fn of(&self, i: usize) -> Turns<'_> {
        if self.len == 0 { Turns::NONE } else { Turns::new(&self.columns[..Turns::COUNT * self.len], self.len, i) }
    }
}

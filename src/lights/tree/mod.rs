//! The light tree: [`light_tree`] of nodes (`node`) made by `build`; [`tree_choice`] adds the infinite lights, and
//! yields a [`sampled_light`]. [`branches`] are precomputed probabilities at
//! the top of the tree, [`branch_table`] computes them for many points.

pub mod branch_table;
pub mod branches;
mod build;
pub mod light_tree;
pub(super) mod node;
pub mod sampled_light;
pub mod tree_choice;

#[cfg(test)]
mod glossy_lobe_tests;

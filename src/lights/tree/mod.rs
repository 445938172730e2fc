//! The light tree: [`light_tree`] of nodes (`node`) made by `build`; [`tree_choice`] adds the infinite lights, and
//! yields a [`sampled_light`]. [`turns`] are probabilities of the top nodes; [`tops`] computes them for many points.

mod build;
pub mod light_tree;
pub(super) mod node;
pub mod sampled_light;
pub mod tops;
pub mod tree_choice;
pub mod turns;

#[cfg(test)]
mod glossy_lobe_tests;

//! The light tree: [`light_tree`] of nodes (`node`) made by `build`; [`tree_choice`] adds the infinite lights, and
//! yields a [`sampled_light`]. `descents` choose for many points at once.

mod build;
pub(super) mod descents;
pub mod light_tree;
pub(super) mod node;
pub mod sampled_light;
pub mod tree_choice;

#[cfg(test)]
mod glossy_lobe_tests;

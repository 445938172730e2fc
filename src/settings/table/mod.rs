//! The table of settings: one row each, grouped as in the help of the command line.
//!
//! A new setting is a field of [`Settings`](super::Settings) and a row here. `setting` has the columns, one file
//! each the groups, `rows` all of them, and `removed` the settings of earlier versions.

#[macro_use]
mod setting;

mod cache;
mod direct;
mod photons;
mod removed;
mod rows;
mod transport;

pub use removed::Removed;
pub use rows::{GROUPS, rows};
pub(crate) use setting::joined;
pub use setting::{Applies, Directive, Group, RESEARCH, Setting};

//! The program from outside; one binary, a module per subject.
#![allow(clippy::unwrap_used)]

mod browser;
mod checkpoints;
mod cli;
mod compare;
mod farm;
mod parts;
mod plan;
mod reproduce;

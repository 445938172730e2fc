//! The program from outside; one binary, a module per subject.
#![allow(clippy::unwrap_used)]

mod browser;
mod checkpoints;
mod cli;
mod compare;
mod denoise;
mod farm;
mod frames;
mod gltf;
mod interrupt;
mod island;
mod light_groups;
mod looks;
mod lost_output;
mod memory;
mod messages;
mod noise;
mod outputs;
mod parts;
mod program;
mod reproduce;
mod shell;
mod textures;
mod watch;

//! The command-line program.

mod commands;
mod compare;

use std::process::ExitCode;

fn main() -> ExitCode {
    commands::run()
}

//! The command-line program.

mod commands;
mod compare;
mod watch;

use std::process::ExitCode;

fn main() -> ExitCode {
    commands::run()
}

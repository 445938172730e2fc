//! The command-line program.

mod commands;
mod compare;
mod watch;

use lumiris::huge_pages::HugePages;
use std::process::ExitCode;

#[global_allocator]
static MEMORY: HugePages = HugePages;

fn main() -> ExitCode {
    commands::run()
}

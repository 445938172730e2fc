//! The command-line program. Commands are in `commands`, the page of a comparison in `compare`, the viewers'
//! connections in `watch`.

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

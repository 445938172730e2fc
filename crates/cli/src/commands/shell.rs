//! `lumiris completions` and `lumiris man`: shell completions and manual pages.

use super::progress;
use anyhow::Context;
use clap::{Args, Command};
use clap_complete::Shell;
use std::path::PathBuf;
use std::process::ExitCode;

/// `lumiris completions`
#[derive(Args, Clone, Debug)]
pub(super) struct CompletionsArgs {
    /// Shell
    #[arg(value_enum)]
    shell: Shell,
}

/// `lumiris man`
#[derive(Args, Clone, Debug)]
pub(super) struct ManArgs {
    /// Folder for a page of the program and one page per subcommand; it is created if it does not exist
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
}

/// Prints the completions of `program`.
pub(super) fn completions(args: &CompletionsArgs, mut program: Command) -> anyhow::Result<ExitCode> {
    let name = program.get_name().to_owned();
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut program, name, &mut script);
    progress::print(String::from_utf8_lossy(&script).trim_end())?;
    Ok(ExitCode::SUCCESS)
}

/// Writes the manual pages of `program`.
pub(super) fn man(args: &ManArgs, program: Command) -> anyhow::Result<ExitCode> {
    let folder = &args.output;
    std::fs::create_dir_all(folder)
        .and_then(|()| clap_mangen::generate_to(program, folder))
        .with_context(|| format!("cannot write manual pages to {}", folder.display()))?;
    Ok(ExitCode::SUCCESS)
}

//! The subcommands and their exit codes.

use super::usage_error::UsageError;
use super::{
    args, bench, compare, crosscheck, denoise, farm, frames, generate, info, interrupt, maketx, merge, progress,
    render, reproduce, shell, short_help,
};
use clap::{CommandFactory, Parser, Subcommand};
use std::io::{self, Write};
use std::process::ExitCode;
use std::time::Instant;

/// Offline CPU renderer for lighting integrals that are hard to sample.
#[derive(Debug, Parser)]
#[command(name = "lumiris", version, max_term_width = 110)]
pub(super) struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Render a scene
    #[command(mut_args(short_help::with_example))]
    Render(Box<args::RenderArgs>),
    /// Merge the parts of an image that were rendered with render --part
    Merge(merge::MergeArgs),
    /// Render the parts of an image on the nodes of a cluster
    Farm(farm::FarmArgs),
    /// Denoise an image with Open Image Denoise, guided by its layers
    Denoise(denoise::DenoiseFileArgs),
    /// Convert images to tiled textures with all levels, which are read by tiles
    Maketx(maketx::MaketxArgs),
    /// Compare images with a reference, by metrics and on an HTML page
    Compare(compare::CompareArgs),
    /// Compare Embree with the pure-Rust BVH, ray by ray and image by image
    Crosscheck(crosscheck::CrosscheckArgs),
    /// Measure the stages of the renderer
    #[command(allow_missing_positional = true)]
    Bench(bench::BenchArgs),
    /// List the contents, memory and unsupported features of a scene, or the layers and settings of an image or a part
    Info(info::InfoArgs),
    /// Reproduce the figures of a paper by rendering and measuring, as an HTML page
    Reproduce(reproduce::ReproduceArgs),
    /// Generate a statue, a sky, an island, or the scenes of talbot, fan and keller-wald
    Generate(generate::GenerateArgs),
    /// Print the completions of a shell
    Completions(shell::CompletionsArgs),
    /// Write manual pages
    Man(shell::ManArgs),
}

/// Parses the command line, runs the command, and returns the exit code.
pub(crate) fn run() -> ExitCode {
    // Parse
    let start = Instant::now();
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return code_of(answer(&error)),
    };

    // Run the command; from here on, signals end it
    let result = interrupt::watch().and_then(|()| match &cli.command {
        Command::Render(args) => match &args.frames {
            Some(list) => frames::run(args, list),
            None => render::run(args, start),
        },
        Command::Merge(args) => merge::run(args),
        Command::Denoise(args) => denoise::run(args),
        Command::Farm(args) => farm::run(args),
        Command::Maketx(args) => maketx::run(args),
        Command::Compare(args) => compare::run(args),
        Command::Crosscheck(args) => crosscheck::run(args),
        Command::Bench(args) => bench::run(args),
        Command::Info(args) => info::run(args),
        Command::Reproduce(args) => reproduce::run(args),
        Command::Generate(args) => generate::run(args),
        Command::Completions(args) => shell::completions(args, Cli::command()),
        Command::Man(args) => shell::man(args, Cli::command()),
    });
    code_of(result)
}

/// Prints help, the version, or the usage error.
fn answer(error: &clap::Error) -> anyhow::Result<ExitCode> {
    let printed = progress::printed(error.print().and_then(|()| io::stdout().flush()));
    // If standard error fails, the exit code still reports wrong usage
    printed.or_else(|failed| if error.use_stderr() { Ok(()) } else { Err(failed) })?;
    Ok(ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2)))
}

fn code_of(result: anyhow::Result<ExitCode>) -> ExitCode {
    match result {
        Ok(code) => code,
        Err(error) => {
            progress::say(&format!("lumiris: {error:#}"));
            ExitCode::from(if error.is::<UsageError>() { 2 } else { 3 })
        }
    }
}

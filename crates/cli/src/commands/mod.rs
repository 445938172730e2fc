//! The command line: one file per subcommand.
//!
//! Exit codes: 0 success, 1 a check failed (`crosscheck` found a disagreement, `compare` a number beyond a limit),
//! 2 wrong usage, 3 bad input or failed output, 130 stopped by Ctrl-C, SIGTERM or SIGHUP: a rendering has written the image
//! so far. A reader of the standard output that has closed its pipe ends nothing: the command finishes, with the code that it
//! has anyway.

mod args;
mod bench;
mod bench_efficiency;
mod bench_references;
mod compare;
mod crosscheck;
mod denoise;
mod denoise_args;
mod exr;
mod farm;
mod farm_scripts;
mod frame_list;
mod frames;
mod generate;
mod info;
mod info_file;
mod interrupt;
mod laps;
mod libraries;
mod look;
mod memory;
mod merge;
mod named;
mod output_options;
mod part_args;
mod parts;
mod pictures;
mod plan;
mod plan_file;
mod progress;
mod render;
mod report;
mod reproduce;
mod rescue;
mod settings;
mod settings_args;
mod shell;
mod trials;
mod typed_options;
mod watch_args;

use clap::{CommandFactory, Parser, Subcommand};
use std::io::{self, Write};
use std::process::ExitCode;
use std::time::Instant;

/// Offline CPU renderer for lighting integrals that are hard to sample.
#[derive(Debug, Parser)]
#[command(name = "lumiris", version, max_term_width = 110)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Render a scene
    #[command(mut_args(args::in_short_help))]
    Render(Box<args::RenderArgs>),
    /// Measure what the settings of a scene leave open, and store the choices for render --plan
    Plan(plan::PlanArgs),
    /// Merge parts of an image, rendered with render --part, to the image
    Merge(merge::MergeArgs),
    /// Render the parts of an image on the nodes of a cluster
    Farm(farm::FarmArgs),
    /// Denoise an image with its layers by Open Image Denoise
    Denoise(denoise::DenoiseFileArgs),
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
    /// Generate a statue, a sky, or the scenes of talbot, fan and keller-wald
    Generate(generate::GenerateArgs),
    /// Print the completions of a shell
    Completions(shell::CompletionsArgs),
    /// Write manual pages
    Man(shell::ManArgs),
}

/// Options that contradict each other.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct UsageError(String);

/// Parses the command line, runs the command, and returns the exit code.
pub(crate) fn run() -> ExitCode {
    let start = Instant::now();
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return code_of(answer(&error)),
    };
    let result = interrupt::watch().and_then(|()| match &cli.command {
        Command::Render(args) => match &args.frames {
            Some(list) => frames::run(args, list),
            None => render::run(args, start),
        },
        Command::Plan(args) => plan::run(args),
        Command::Merge(args) => merge::run(args),
        Command::Denoise(args) => denoise::run(args),
        Command::Farm(args) => farm::run(args),
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

/// Prints help, the version, or what is wrong with the command line.
fn answer(error: &clap::Error) -> anyhow::Result<ExitCode> {
    let printed = progress::printed(error.print().and_then(|()| io::stdout().flush()));
    // Without standard error, the exit code still tells of wrong usage
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

//! `lumiris reproduce`

use super::{interrupt, progress};
use crate::compare::check_page;
use clap::{Args, ValueEnum};
use lumiris_lab::reproduce::{Observer, Options, ReproduceError, fan, keller_wald, talbot};
use std::path::PathBuf;
use std::process::ExitCode;

/// `lumiris reproduce`
#[derive(Args, Clone, Debug)]
pub(super) struct ReproduceArgs {
    /// Paper
    paper: Paper,
    /// Output folder for the page (index.html), its images, and all numbers
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    /// Take at most 2 minutes on two cores instead of 20
    #[arg(long)]
    quick: bool,
    /// Threads [default: all cores]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u32).range(1..=4096))]
    threads: Option<u32>,
    /// Maximum image edge in pixels; smaller if time is short [default: 400, quick 160 (talbot) or 128 (fan,
    /// keller-wald)]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: Option<u32>,
    /// Folder with scenes to use instead of the generated ones, with the same names: statue-env.pbrt,
    /// statue-lights.pbrt and statue-env-lights.pbrt (talbot); checkers.pbrt, statue.pbrt, room.pbrt and box.pbrt
    /// (fan); rooms.pbrt, rooms-10000.pbrt, ring.pbrt, ring-indirect.pbrt and slit.pbrt (keller-wald)
    #[arg(long, value_name = "DIR")]
    scenes: Option<PathBuf>,
    /// Print no progress, only errors
    #[arg(short, long)]
    quiet: bool,
}

/// A paper whose figures can be reproduced.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Paper {
    /// Resampled importance sampling: Talbot, Cline and Egbert 2005, and Talbot's thesis
    Talbot,
    /// Optimizing control variates: Fan, Chenney, Hu, Tsui and Lai 2006
    Fan,
    /// Importance sampling for photon maps: Keller and Wald 2000
    KellerWald,
}

pub(super) fn run(args: &ReproduceArgs) -> anyhow::Result<ExitCode> {
    // Options
    check_page(&args.out)?;
    let options = Options {
        out: args.out.clone(),
        scenes: args.scenes.clone(),
        quick: args.quick,
        threads: args.threads.map(|t| t as usize),
        size: args.size,
        command: std::env::args().collect::<Vec<_>>().join(" "),
    };
    let say = |text: &str| {
        if !args.quiet {
            progress::say(text);
        }
    };

    // Render and measure
    let observer = Observer { say: &say, stop: interrupt::stop() };
    let page = match args.paper {
        Paper::Talbot => talbot::run(&options, observer),
        Paper::Fan => fan::run(&options, observer),
        Paper::KellerWald => keller_wald::run(&options, observer),
    };

    // Report the page
    match page {
        Ok(page) => {
            progress::print(&page.display().to_string())?;
            Ok(ExitCode::SUCCESS)
        }
        Err(ReproduceError::Stopped) => Ok(ExitCode::from(interrupt::INTERRUPTED)),
        Err(error) => Err(error.into()),
    }
}

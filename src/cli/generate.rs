//! `lumiris generate`

use super::progress;
use crate::procedural::ply::write_ply;
use crate::procedural::statue::{DEFAULT_DETAIL, StatueOptions, statue};
use anyhow::Context;
use clap::{Args, Subcommand};
use std::path::PathBuf;
use std::process::ExitCode;

/// `lumiris generate`
#[derive(Args, Clone, Debug)]
pub struct GenerateArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Clone, Debug, Subcommand)]
enum What {
    /// A finely carved statue, as a PLY mesh
    Statue(StatueArgs),
}

#[derive(Args, Clone, Debug)]
struct StatueArgs {
    /// File to write
    #[arg(short, long, default_value = "statue.ply")]
    output: PathBuf,
    /// Grid cells along the height (8 to 4096); the number of triangles grows with the square
    #[arg(long, default_value_t = DEFAULT_DETAIL)]
    detail: u32,
    /// Leave out the vertex normals
    #[arg(long)]
    flat: bool,
}

pub fn run(args: &GenerateArgs) -> anyhow::Result<ExitCode> {
    match &args.what {
        What::Statue(args) => make_statue(args)?,
    }
    Ok(ExitCode::SUCCESS)
}

fn make_statue(args: &StatueArgs) -> anyhow::Result<()> {
    let mesh = statue(&StatueOptions { detail: args.detail, normals: !args.flat }).map_err(anyhow::Error::msg)?;
    write_ply(&args.output, &mesh).with_context(|| format!("cannot write {}", args.output.display()))?;
    progress::say(&format!("{}: {} triangles", args.output.display(), mesh.triangle_count()));
    Ok(())
}

//! Options of parts and checkpoints.

use super::named::named;
use clap::Args;
use std::path::{Path, PathBuf};
use strum::{EnumString, IntoStaticStr, VariantNames};

/// File type of parts.
pub(super) const PART_TYPE: &str = "part";
/// Default time between checkpoints (s).
const CHECKPOINT_SECONDS: f64 = 60.0;
/// Largest time limit (s), in effect none.
pub(super) const LONGEST: f64 = 1e9;

/// Division of an image into parts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub(super) enum PartBy {
    /// A share of the samples of every pixel.
    #[default]
    Samples,
    /// All samples of a share of the pixels.
    Tiles,
}

/// Options of parts and checkpoints.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Parts and checkpoints")]
pub(super) struct PartArgs {
    /// Render the I-th of N parts of the image, for `lumiris merge`; the output is FILE.part
    #[arg(long, value_name = "I/N", value_parser = parse_part)]
    pub part: Option<[u32; 2]>,
    /// Content of a part. `samples`: a share of the samples of every pixel. `tiles`: all samples of a share of the
    /// pixels [default: samples]
    #[arg(long, value_name = "WHAT", requires = "part", value_parser = named::<PartBy>())]
    pub part_by: Option<PartBy>,
    /// Index of the first sample of every pixel [default: 0]
    #[arg(long, value_name = "A")]
    pub samples_from: Option<u32>,
    /// Index after the last sample of every pixel. May exceed --spp, which still determines texture footprints and
    /// pilots [default: --spp]
    #[arg(long, value_name = "B", value_parser = clap::value_parser!(u32).range(1..))]
    pub samples_to: Option<u32>,
    /// Store the state needed to resume, at this interval [default: 60 s] and at the end
    #[arg(long, value_name = "FILE[,SECONDS]", value_parser = parse_checkpoint)]
    pub checkpoint: Option<CheckpointArg>,
    /// Resume from a checkpoint or an unfinished part, with its settings; --spp may ask for more samples. If
    /// --checkpoint names the same file and it does not exist yet, start from the beginning
    #[arg(long, value_name = "FILE")]
    pub resume: Option<PathBuf>,
}

impl PartArgs {
    /// True unless the whole image is requested.
    pub(super) fn is_partial(&self) -> bool {
        self.part.is_some() || self.samples_from.is_some() || self.samples_to.is_some()
    }

    pub(super) fn is_by_tiles(&self) -> bool {
        self.part_by == Some(PartBy::Tiles)
    }
}

/// A file for checkpoints, and the time between them (s).
#[derive(Clone, Debug)]
pub(super) struct CheckpointArg {
    pub path: PathBuf,
    pub seconds: f64,
}

fn parse_part(text: &str) -> Result<[u32; 2], String> {
    let parsed = text.split_once('/').and_then(|(i, n)| Some([i.trim().parse().ok()?, n.trim().parse().ok()?]));
    match parsed {
        Some([i, n]) if 1 <= i && i <= n => Ok([i, n]),
        _ => Err("expected I/N with 1 <= I <= N, such as 3/8".to_owned()),
    }
}

fn parse_checkpoint(text: &str) -> Result<CheckpointArg, String> {
    let with_seconds = text.rsplit_once(',').and_then(|(path, seconds)| Some((path, seconds.trim().parse().ok()?)));
    match with_seconds {
        Some((path, seconds)) if seconds > 0.0 && f64::is_finite(seconds) && !path.is_empty() => {
            Ok(CheckpointArg { path: PathBuf::from(path), seconds: seconds.min(LONGEST) })
        }
        Some(_) => Err("expected FILE or FILE,SECONDS with a positive number of seconds".to_owned()),
        None => Ok(CheckpointArg { path: PathBuf::from(text), seconds: CHECKPOINT_SECONDS }),
    }
}

/// True if the name is a part's.
pub(super) fn is_part(path: &Path) -> bool {
    extension(path) == PART_TYPE
}

/// The extension of a file name, in lower case.
pub(super) fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

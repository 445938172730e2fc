//! The command line: one file per subcommand; `cli` chooses one. `args`, `*_args` and `output_options` have the
//! options; `settings` loads scenes; `pictures`, `exr` and `parts` write results; `progress` prints; `interrupt`
//! handles signals.
//!
//! Exit codes. A closed pipe at the standard output is no error.
//! * 0: success
//! * 1: a check failed: `crosscheck` found a disagreement, or `compare` a number beyond a limit
//! * 2: wrong usage
//! * 3: bad input or failed output
//! * 130: stopped by Ctrl-C, SIGTERM or SIGHUP; the image so far is written

mod args;
mod bench;
mod bench_efficiency;
mod bench_references;
mod cli;
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
mod maketx;
mod memory;
mod merge;
mod named;
mod output_options;
mod part_args;
mod parts;
mod pictures;
mod progress;
mod render;
mod report;
mod reproduce;
mod rescue;
mod settings;
mod settings_args;
mod shell;
mod short_help;
mod typed_options;
mod usage_error;
mod watch_args;

pub(crate) use cli::run;
use usage_error::UsageError;

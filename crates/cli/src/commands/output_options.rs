//! Options that apply to some file formats only. Warns if none of the outputs uses a given option.

use super::part_args::{extension, is_part};
use super::progress::say_once;
use clap::parser::ValueSource;
use clap::{ArgMatches, Args, Command};
use std::path::{Path, PathBuf};

/// File formats to which an option applies.
#[derive(Clone, Copy, Debug)]
enum Files {
    Exr,
    ExrAndParts,
    Display,
}

/// The options, with underscores in their names.
const OPTIONS: [(&str, Files); 11] = [
    ("aov", Files::ExrAndParts),
    ("cryptomatte", Files::Exr),
    ("exr_type", Files::Exr),
    ("exr_compression", Files::Exr),
    ("exr_parts", Files::Exr),
    ("exposure", Files::Display),
    ("view_transform", Files::Display),
    ("ocio_display", Files::Display),
    ("ocio_view", Files::Display),
    ("ocio_looks", Files::Display),
    ("ocio_input", Files::Display),
];

/// The format-specific options on the command line. Adds no options of its own.
#[derive(Clone, Debug, Default)]
pub(super) struct OutputOptions(Vec<(&'static str, Files)>);

impl OutputOptions {
    /// Warns of options that apply to none of the outputs.
    pub(super) fn check(&self, outputs: &[PathBuf]) {
        let is_exr = |path: &Path| extension(path) == "exr";
        for (name, files) in &self.0 {
            let is_for = |path: &PathBuf| match files {
                Files::Exr => is_exr(path),
                Files::ExrAndParts => is_exr(path) || is_part(path),
                Files::Display => !is_exr(path) && !is_part(path),
            };
            if !outputs.iter().any(is_for) {
                let names = match files {
                    Files::Exr => "EXR files",
                    Files::ExrAndParts => "EXR files and parts",
                    Files::Display => "PNG, JPEG, TIFF and TGA files",
                };
                let option = name.replace('_', "-");
                say_once(&format!("warning: --{option} has no effect on these outputs: it is for {names}"));
            }
        }
    }
}

impl Args for OutputOptions {
    fn augment_args(command: Command) -> Command {
        command
    }

    fn augment_args_for_update(command: Command) -> Command {
        command
    }
}

impl clap::FromArgMatches for OutputOptions {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let is_given = |name: &str| {
            let is_there = matches.try_contains_id(name).is_ok_and(|is_there| is_there);
            is_there && matches.value_source(name) == Some(ValueSource::CommandLine)
        };
        // `--aov none` saves time for every format
        let saves_time = |name: &str| {
            let mut values = matches.get_raw(name).into_iter().flatten();
            name == "aov" && values.all(|value| value == "none")
        };
        Ok(OutputOptions(OPTIONS.into_iter().filter(|(name, _)| is_given(name) && !saves_time(name)).collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

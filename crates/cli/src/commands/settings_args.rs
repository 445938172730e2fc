//! The options for settings: one per row of [`lumiris::settings::table`]. For example, the row of `--estimator` is in
//! `settings/table/direct.rs`; its macro `row!` makes `set`, which writes the value into the settings.

use clap::builder::{PossibleValuesParser, TypedValueParser, ValueParser};
use clap::{Arg, ArgMatches, Args, Command, FromArgMatches};
use lumiris::settings::table::{GROUPS, Group, RESEARCH, Setting, rows};
use lumiris::settings::value::{Integers, Kind, Value};
use lumiris::settings::{Given, Settings};

/// The settings given as options, in table order.
#[derive(Clone, Debug, Default)]
pub(super) struct SettingsArgs {
    typed: Vec<(&'static Setting, Value)>,
}

impl SettingsArgs {
    /// True if the option is given.
    pub(super) fn has(&self, flag: &str) -> bool {
        self.typed.iter().any(|(row, _)| row.flag == flag)
    }

    /// The integer value of an option.
    pub(super) fn count(&self, flag: &str) -> Option<u32> {
        let (_, value) = self.typed.iter().find(|(row, _)| row.flag == flag)?;
        value.integer().and_then(|n| u32::try_from(n).ok())
    }

    /// The given settings, with their text for messages.
    pub(super) fn given(&self) -> Given {
        let mut given = Given::default();
        self.typed.iter().for_each(|(row, value)| given.add(row, *value, format!("--{} {value}", row.flag)));
        given
    }

    /// Parses options that are not on the program's command line.
    pub(super) fn parse<'a>(words: impl Iterator<Item = &'a str>) -> Result<Self, String> {
        let command = Self::augment_args(Command::new("settings").no_binary_name(true).disable_help_flag(true));
        let matches = command.try_get_matches_from(words.map(str::to_owned)).map_err(|e| e.to_string())?;
        Self::from_arg_matches(&matches).map_err(|e| e.to_string())
    }

    /// Applies the options to `settings`.
    pub(super) fn apply(&self, settings: &mut Settings) {
        for (row, value) in &self.typed {
            (row.set)(settings, *value).expect("the parser of a setting accepts only values of its kind");
        }
    }
}

impl Args for SettingsArgs {
    fn augment_args(command: Command) -> Command {
        let options = GROUPS.iter().flat_map(|group| {
            let rows = group.rows.iter().filter(|row| row.is_option);
            rows.map(|row| option(row, group.title == RESEARCH).help_heading(heading(group)))
        });
        command.args(options)
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for SettingsArgs {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let mut args = SettingsArgs::default();
        args.update_from_arg_matches(matches)?;
        Ok(args)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        let typed = |row: &'static Setting| Some((row, *matches.get_one::<Value>(row.flag)?));
        self.typed.extend(rows().filter(|row| row.is_option).filter_map(typed));
        Ok(())
    }
}

/// Heading of the first group, with a remark on the defaults of all groups.
const FIRST_HEADING: &str =
    "Light transport (the default of this and of all settings below is the file's, or the one that is stated)";

/// Heading of a group.
fn heading(group: &Group) -> &'static str {
    let is_first = GROUPS.first().is_some_and(|first| first.title == group.title);
    if is_first { FIRST_HEADING } else { group.title }
}

/// The option of a setting. Options for research name the settings to which they apply.
fn option(row: &'static Setting, is_research: bool) -> Arg {
    let option = Arg::new(row.flag).long(row.flag).aliases(row.aliases).value_name(row.value_name);
    let option = option.help(help(row, is_research)).value_parser(parser(row.kind));
    match row.bare {
        Some(value) => option.num_args(0..=1).default_missing_value(value),
        None => option,
    }
}

/// Help text of an option, with range and default.
fn help(row: &Setting, is_research: bool) -> String {
    let range = match row.kind {
        Kind::Integer { range: Integers::ALL, .. } => String::new(),
        Kind::Integer { range, .. } => format!("{range}; "),
        Kind::Real { range, .. } => format!("{range}; "),
        // Their values are listed, or part of the help text
        Kind::Choice { .. } | Kind::Percentage { .. } | Kind::Pair { .. } | Kind::Graded { .. } | Kind::Bytes => {
            String::new()
        }
    };
    let condition = row.applies.condition();
    let whom = condition
        .strip_prefix("it is for ")
        .filter(|_| is_research)
        .map_or(String::new(), |whom| format!("for {whom}; "));
    format!("{} [{whom}{range}default: {}]", row.help, row.default_text())
}

fn parser(kind: Kind) -> ValueParser {
    match kind {
        Kind::Choice { names, .. } => PossibleValuesParser::new(names).try_map(move |name| kind.parse(&name)).into(),
        Kind::Integer { .. }
        | Kind::Real { .. }
        | Kind::Percentage { .. }
        | Kind::Pair { .. }
        | Kind::Graded { .. }
        | Kind::Bytes => ValueParser::new(move |text: &str| kind.parse(text)),
    }
}

#[cfg(test)]
mod tests;

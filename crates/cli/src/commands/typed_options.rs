//! Options in their typed form, for command lines in scripts.

use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Args, Command, FromArgMatches};

/// A group of options.
#[derive(Clone, Debug)]
pub(super) struct AsTyped<A> {
    /// Parsed options.
    pub(super) args: A,
    /// Typed options: names without dashes, and values if they have any.
    typed: Typed,
}

impl<A> AsTyped<A> {
    /// The options as words of a command line, without the omitted names.
    pub(super) fn words_without(&self, omitted: &[&str]) -> Vec<String> {
        let kept = self.typed.iter().filter(|(name, _)| !omitted.contains(&name.as_str()));
        kept.map(|(name, value)| match value {
            // A single word, because values may start with a dash
            Some(value) => format!("--{name}={value}"),
            None => format!("--{name}"),
        })
        .collect()
    }
}

/// Names and values of options.
type Typed = Vec<(String, Option<String>)>;

/// The typed form of an option; `None` if it was not given.
fn typed(arg: &Arg, matches: &ArgMatches) -> Option<Result<Typed, clap::Error>> {
    let (id, name) = (arg.get_id().as_str(), arg.get_long()?);
    if matches.value_source(id) != Some(ValueSource::CommandLine) {
        return None;
    }
    if !arg.get_action().takes_values() {
        return Some(Ok(vec![(name.to_owned(), None)]));
    }
    let not_text = || clap::Error::raw(clap::error::ErrorKind::InvalidUtf8, format!("--{name}: not in UTF-8\n"));
    let values = matches.get_raw(id)?.map(|value| Some((name.to_owned(), Some(value.to_str()?.to_owned()))));
    Some(values.collect::<Option<Vec<_>>>().ok_or_else(not_text))
}

impl<A: Args> Args for AsTyped<A> {
    fn augment_args(command: Command) -> Command {
        A::augment_args(command)
    }

    fn augment_args_for_update(command: Command) -> Command {
        A::augment_args_for_update(command)
    }
}

impl<A: Args> FromArgMatches for AsTyped<A> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let known = A::augment_args(Command::new("options"));
        let lists: Vec<_> = known.get_arguments().filter_map(|arg| typed(arg, matches)).collect::<Result<_, _>>()?;
        Ok(AsTyped { args: A::from_arg_matches(matches)?, typed: lists.concat() })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

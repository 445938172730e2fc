//! Checks shared by the files of all directives.

use lumiris_formats::diagnostic::{Diagnostics, did_you_mean};
use lumiris_formats::pbrt::params::ParamSet;
use lumiris_formats::source::Span;
use std::path::Path;

/// The name of a file; as in pbrt, an empty name counts as absent.
pub(super) fn file_name<'p>(p: &'p ParamSet, key: &'static str, d: &mut Diagnostics) -> Option<&'p str> {
    p.string(key, d).filter(|name| !name.is_empty())
}

/// A positive number, or the default after an error.
pub(super) fn positive(p: &ParamSet, key: &'static str, default: f32, d: &mut Diagnostics) -> f32 {
    match p.float(key, d) {
        Some(x) if x > 0.0 && x.is_finite() => x,
        Some(x) => {
            d.error(p.span_of(key), format!("{key} must be positive, not {x}"));
            default
        }
        None => default,
    }
}

/// A file, and the source position of its name.
pub(super) struct FilePlace<'a> {
    pub path: &'a Path,
    pub span: Span,
}

/// The files that could be read, in order. Others are reported: as missing if `unreadable` returns a reason of the
/// operating system.
pub(super) fn readable<'a, T, E: ToString>(
    loaded: Vec<Result<T, E>>,
    places: impl Iterator<Item = FilePlace<'a>>,
    d: &mut Diagnostics,
    unreadable: impl Fn(&E) -> Option<String>,
) -> Vec<T> {
    let report = |(loaded, FilePlace { path, span }): (Result<T, E>, FilePlace<'_>)| {
        let error = match loaded {
            Ok(content) => return Some(content),
            Err(error) => error,
        };

        // Unreadable files are missing; all others have invalid content
        match unreadable(&error) {
            Some(reason) => d.missing_file(path, reason, Some(span)),
            None => {
                d.error(span, error.to_string());
            }
        }
        None
    };
    loaded.into_iter().zip(places).filter_map(report).collect()
}

/// An error about an unknown name, with similar names.
pub fn unknown(name: &str, span: Span, what: &str, known: &[&str], d: &mut Diagnostics) {
    let help = match did_you_mean(name, known.iter().copied()) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("one of {}", known.join(", ")),
    };
    d.error(span, format!("unknown {what} `{name}`")).help(help);
}

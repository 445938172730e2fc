//! The table of settings as keyword arguments: command-line names with underscores.

use lumiris::settings::Settings;
use lumiris::settings::table::{GROUPS, Setting, rows};
use lumiris::settings::value::{Kind, Value};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Settings with their values, in table order.
pub(crate) type Given = Vec<(&'static Setting, Value)>;

/// The keyword for a command-line name.
fn keyword(flag: &str) -> String {
    flag.replace('-', "_")
}

/// Parses keyword arguments whose values are texts as on the command line.
pub(crate) fn parse(given: &[(String, String)]) -> PyResult<Given> {
    let is_called = |row: &Setting, name: &str| row.aliases.iter().chain([&row.flag]).any(|f| keyword(f) == name);
    if let Some((name, _)) = given.iter().find(|(name, _)| !rows().any(|row| is_called(row, name))) {
        return Err(PyTypeError::new_err(format!("there is no setting `{name}`")));
    }
    let parse = |row: &'static Setting, name: &str, text: &str| {
        match (text, row.bare) {
            ("True", Some(bare)) => row.kind.parse(bare),
            (text, _) => row.kind.parse(text),
        }
        .map(|value| (row, value))
        .map_err(|expected| PyValueError::new_err(format!("{name}: {expected}, but found `{text}`")))
    };
    rows()
        .flat_map(|row| given.iter().filter(|(name, _)| is_called(row, name)).map(move |given| (row, given)))
        .map(|(row, (name, text))| parse(row, name, text))
        .collect()
}

/// The settings with their text for messages.
pub(crate) fn named(given: &Given) -> lumiris::settings::Given {
    let mut named = lumiris::settings::Given::default();
    given.iter().for_each(|(row, value)| named.add(row, *value, format!("{}={value}", keyword(row.flag))));
    named
}

/// Applies all values.
pub(crate) fn apply(given: &Given, settings: &mut Settings) {
    for (row, value) in given {
        (row.set)(settings, *value).expect("the parser of a setting accepts only values of its kind");
    }
}

/// All settings by keyword: help, default, group, allowed values as text, and allowed names.
#[pyfunction]
pub(crate) fn settings(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    // Names and kind of numbers; then the row's texts
    let table = PyDict::new(py);
    for group in GROUPS {
        for row in group.rows {
            let (names, numbers): (Vec<&str>, Option<&str>) = match row.kind {
                Kind::Choice { names, .. } => (names.to_vec(), None),
                Kind::Integer { words, .. } => (words.to_vec(), Some("int")),
                Kind::Real { words, .. } | Kind::Percentage { words } => (words.to_vec(), Some("float")),
                Kind::Pair { .. } => (Vec::new(), Some("pair")),
                Kind::Graded { plain, graded, .. } => {
                    ([plain].into_iter().chain(graded.iter().copied()).collect(), Some("graded"))
                }
                Kind::Bytes => (Vec::new(), Some("bytes")),
            };
            let entry = PyDict::new(py);
            entry.set_item("group", group.title)?;
            entry.set_item("help", row.help)?;
            entry.set_item("default", row.default_text())?;
            entry.set_item("values", row.kind.to_string())?;
            entry.set_item("names", names)?;
            entry.set_item("numbers", numbers)?;
            entry.set_item("has_bare", row.bare.is_some())?;
            entry.set_item("key", row.key)?;
            entry.set_item("aliases", row.aliases.iter().map(|a| keyword(a)).collect::<Vec<_>>())?;
            table.set_item(keyword(row.flag), entry)?;
        }
    }
    Ok(table)
}

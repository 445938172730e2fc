//! All rows of the table, and their values in the settings of an image.

use super::setting::{Group, Setting};
use super::{cache, direct, photons, transport};
use crate::settings::{Settings, Value};

/// All settings. Values are set in this order, so settings that others depend on come first.
pub const GROUPS: &[Group] = &[
    transport::TRANSPORT,
    transport::SAMPLING,
    direct::DIRECT,
    direct::RIS,
    direct::CONTROL_VARIATES,
    cache::IRRADIANCE_CACHE,
    photons::PHOTONS,
];

/// All settings in order.
pub fn rows() -> impl Iterator<Item = &'static Setting> {
    GROUPS.iter().flat_map(|group| group.rows)
}

impl Settings {
    /// Every setting that affects the image, by its name in metadata, with the choices of the renderer.
    pub fn recorded(&self) -> impl Iterator<Item = (&'static str, Value)> {
        let rows = rows().filter(|row| row.is_recorded && row.applies.to(self));
        rows.filter_map(|row| Some((row.key, (row.resolved.unwrap_or(row.get))(self)?)))
    }

    /// The settings that differ from the default, with their values.
    pub fn changed(&self) -> impl Iterator<Item = (&'static Setting, Value)> {
        let default = Settings::default();
        let is_changed = move |row: &&Setting| (row.get)(self) != (row.get)(&default);
        rows().filter(is_changed).filter_map(|row| Some((row, (row.get)(self)?)))
    }
}

#[cfg(test)]
mod tests {
    use super::super::removed::Removed;
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn no_two_settings_share_a_name() {
        let mut flags = HashSet::new();
        let mut parameters = HashSet::new();
        let mut keys = HashSet::new();
        for row in rows() {
            let all = row.aliases.iter().chain([&row.flag]);
            assert!(all.copied().all(|flag| !flag.is_empty() && flags.insert(flag)), "--{}", row.flag);
            let all = row.parameters.iter().chain(row.old_parameters.iter().map(|(_, old)| old));
            assert!(all.copied().all(|name| parameters.insert((row.directive as u8, name))), "{}", row.flag);
            assert!(row.old_parameters.iter().all(|(name, _)| row.parameters.contains(name)), "{}", row.flag);
            assert!(!row.key.is_empty() && keys.insert(row.key), "{}", row.flag);
            assert!(Removed::of_key(row.key).is_none(), "{}", row.flag);
            assert!(Removed::of(row.directive).all(|old| !row.parameters.contains(&old.parameter)), "{}", row.flag);
        }
    }

    #[test]
    fn defaults_are_values_of_their_kind_and_setting_them_changes_nothing() {
        for row in rows() {
            let mut settings = Settings::default();
            if let Some(value) = (row.get)(&settings) {
                assert_eq!(row.kind.parse(&value.to_string()), Ok(value), "{}", row.flag);
                row.set_text(&mut settings, &value.to_string()).unwrap();
                assert_eq!(settings, Settings::default(), "{}", row.flag);
            }
            assert!(!row.default_text().is_empty(), "{}: help does not state the default", row.flag);
            assert!(!row.help.is_empty() && !row.help.ends_with('.'), "{}: {}", row.flag, row.help);
        }
        assert_eq!(Settings::default().changed().count(), 0);
    }
}

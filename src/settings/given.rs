//! Settings that are given explicitly, on the command line, in a scene file or in Python, and the settings among them
//! without effect on an image.

use super::image_settings::Settings;
use super::table::Setting;
use super::value::Value;

/// Explicit settings, each with its last value.
#[derive(Clone, Debug, Default)]
pub struct Given(Vec<GivenSetting>);

#[derive(Clone, Debug)]
struct GivenSetting {
    row: &'static Setting,
    value: Value,
    /// As the user wrote it.
    text: String,
}

impl Given {
    /// Adds a setting, which replaces an earlier value. `text` is the setting with its value in messages, such as
    /// `--estimator ocv`.
    pub fn add(&mut self, row: &'static Setting, value: Value, text: String) {
        self.0.retain(|given| given.row.flag != row.flag);
        self.0.push(GivenSetting { row, value, text });
    }

    /// Adds later settings.
    pub fn extend(&mut self, later: Given) {
        later.0.into_iter().for_each(|given| self.add(given.row, given.value, given.text));
    }

    /// Returns a sentence for each setting without effect on an image. `asked` are its settings before completion and
    /// checks by the renderer; `used` are the settings of the rendering. Settings that are overridden, by another
    /// setting or by a part that is continued, are left out.
    pub fn without_effect(&self, asked: &Settings, used: &Settings) -> Vec<String> {
        let in_force = self.0.iter().filter(|given| (given.row.get)(asked) == Some(given.value));
        in_force.filter_map(|given| given.without_effect(asked, used)).collect()
    }
}

impl GivenSetting {
    fn without_effect(&self, asked: &Settings, used: &Settings) -> Option<String> {
        let Self { row, value, text } = self;
        if !row.applies.to(asked) && !row.applies.to(used) {
            return Some(format!("{text} has no effect on this image: {}", row.applies.condition()));
        }
        let in_use = (row.resolved.unwrap_or(row.get))(used)?;
        let is_another = row.applies.to(used) && value.name() != Some("auto") && in_use != *value;
        is_another.then(|| format!("{text} has no effect on this image: {in_use} is used"))
    }
}

#[cfg(test)]
mod tests {
    use super::super::table::rows;
    use super::super::value::Kind;
    use super::super::{EstimatorKind, IntegratorKind};
    use super::*;
    use strum::VariantNames;

    fn of(flag: &str, value: &str) -> (Given, &'static Setting, Value) {
        let row = rows().find(|row| row.flag == flag).unwrap();
        let value = row.kind.parse(value).unwrap();
        let mut given = Given::default();
        given.add(row, value, format!("--{flag} {value}"));
        (given, row, value)
    }

    /// Test values of a kind: all names, and the ends of a range.
    fn values(kind: &Kind) -> Vec<Value> {
        let texts: Vec<String> = match kind {
            Kind::Choice { names, .. } => names.iter().map(ToString::to_string).collect(),
            Kind::Integer { range, words } => {
                let ends = [range.min, range.max.min(u64::from(u32::MAX))].map(|n| n.to_string());
                words.iter().map(ToString::to_string).chain(ends).collect()
            }
            Kind::Real { words, .. } | Kind::Percentage { words } => {
                words.iter().map(ToString::to_string).chain(["0.5".to_owned()]).collect()
            }
            Kind::Pair { .. } => vec!["1.5,20".to_owned()],
            Kind::Graded { plain, graded, .. } => {
                [plain.to_string()].into_iter().chain(graded.iter().map(|name| format!("{name}:0.3"))).collect()
            }
            Kind::Bytes => vec!["800M".to_owned()],
        };
        texts.iter().map(|text| kind.parse(text).unwrap()).collect()
    }

    /// Metadata record all settings that the image depends on. If a value of a setting is recorded as given, or left to
    /// the renderer, it has an effect. Otherwise exactly one message names it.
    #[test]
    fn every_value_of_every_setting_is_recorded_or_said_to_have_no_effect() {
        let mut counts = [0, 0];
        for (integrator, estimator) in
            IntegratorKind::VARIANTS.iter().flat_map(|i| EstimatorKind::VARIANTS.iter().map(move |e| (i, e)))
        {
            for row in rows().filter(|row| !["integrator", "estimator"].contains(&row.flag)) {
                for value in values(&row.kind) {
                    let mut settings = Settings::default();
                    settings.integrator = settings.integrator.of_kind(integrator.parse().unwrap());
                    settings.integrator.estimator = estimator.parse().unwrap();
                    (row.set)(&mut settings, value).unwrap();
                    let recorded = settings.recorded().find(|(key, _)| *key == row.key);
                    let is_hidden = !row.is_recorded && row.applies.to(&settings);
                    let has_effect =
                        is_hidden || recorded.is_some_and(|(_, used)| used == value || value.name() == Some("auto"));
                    let (given, ..) = of(row.flag, &value.to_string());
                    let said = given.without_effect(&settings, &settings);
                    let context = format!("--{} {value} with {integrator} and {estimator}: {said:?}", row.flag);
                    assert_eq!(said.len(), usize::from(!has_effect), "{context}");
                    assert!(said.iter().all(|line| line.starts_with(&format!("--{} ", row.flag))), "{context}");
                    counts[said.len()] += 1;
                }
            }
        }
        assert!(counts.iter().all(|&n| n > 500), "{counts:?}");
    }

    #[test]
    fn what_is_not_used_as_given_is_said_with_what_is_used() {
        let line = |change: fn(&mut Settings), use_instead: fn(&mut Settings), flag: &str, value: &str| {
            let (given, row, value) = of(flag, value);
            let mut asked = Settings::default();
            change(&mut asked);
            (row.set)(&mut asked, value).unwrap();
            let mut used = asked;
            use_instead(&mut used);
            given.without_effect(&asked, &used)
        };
        let direct = |s: &mut Settings| s.integrator = s.integrator.of_kind(IntegratorKind::Direct);
        assert_eq!(line(direct, |_| (), "max-depth", "7"), ["--max-depth 7 has no effect on this image: 1 is used"]);
        assert_eq!(line(direct, |_| (), "max-depth", "0"), [""; 0]);
        let mis = |s: &mut Settings| s.integrator.estimator = EstimatorKind::Mis;
        assert_eq!(line(|_| (), mis, "estimator", "ocv"), ["--estimator ocv has no effect on this image: mis is used"]);
        assert_eq!(line(|_| (), mis, "estimator", "auto"), [""; 0]);
        // Requests fewer proposals than samples
        let ris = |s: &mut Settings| {
            (s.integrator.estimator, s.integrator.samples) = (EstimatorKind::Ris, Some(8));
        };
        assert_eq!(line(ris, |_| (), "proposals", "2"), ["--proposals 2 has no effect on this image: 8 is used"]);
        let photons = |s: &mut Settings| s.integrator = s.integrator.of_kind(IntegratorKind::PhotonMap);
        let uniform = ["--allocation adaptive has no effect on this image: uniform is used"];
        assert_eq!(line(photons, |_| (), "allocation", "adaptive"), uniform);
        assert_eq!(line(|_| (), |_| (), "allocation", "adaptive"), [""; 0]);
    }

    #[test]
    fn the_last_value_counts_and_what_is_overridden_is_not_said() {
        let (mut given, ..) = of("proposals", "16");
        given.extend(of("proposals", "32").0);
        let mut settings = Settings::default();
        assert_eq!(given.without_effect(&settings, &settings), [""; 0], "neither is in force");
        of("proposals", "32").1.set_text(&mut settings, "32").unwrap();
        settings.integrator.estimator = EstimatorKind::Mis;
        let said = given.without_effect(&settings, &settings);
        assert_eq!(said, ["--proposals 32 has no effect on this image: it is for the estimator ris"]);
    }
}

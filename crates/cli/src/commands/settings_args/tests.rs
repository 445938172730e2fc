//! Promise of the table: metadata that are repeated on the command line or in a scene file yield the original settings.

use super::*;
use lumiris::import::{LoadOptions, load};
use lumiris::settings::table::{Applies, Directive};
use lumiris::settings::{Cached, EstimatorKind, IntegratorKind};
use lumiris_numbers::samplers::SamplerKind;
use strum::VariantNames;

fn settings_of(options: &[String]) -> Result<Settings, clap::Error> {
    let command = SettingsArgs::augment_args(Command::new("test").no_binary_name(true));
    let args = SettingsArgs::from_arg_matches(&command.try_get_matches_from(options)?)?;
    let mut settings = Settings::default();
    args.apply(&mut settings);
    Ok(settings)
}

fn settings_of_scene(head: &str) -> Settings {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.pbrt");
    std::fs::write(&path, format!("{head}\nWorldBegin\nShape \"sphere\"\n")).unwrap();
    let loaded = load(&path, &LoadOptions::default()).unwrap_or_else(|report| panic!("{head}\n{report}"));
    loaded.settings
}

/// Test values of a kind: numbers in its range, and all names and words.
fn values(kind: &Kind) -> Vec<Value> {
    // One text per variant
    let texts: Vec<String> = match kind {
        Kind::Choice { names, .. } => names.iter().map(ToString::to_string).collect(),
        Kind::Integer { range, words } => {
            let numbers = [range.min, range.min + 3, range.max.min(i32::MAX as u64)].map(|n| n.to_string());
            words.iter().map(ToString::to_string).chain(numbers).collect()
        }
        Kind::Real { range, words } => {
            let numbers = [0.1, 0.3, 0.7].map(|t| (range.min + t * (range.max.min(5.0) - range.min)).to_string());
            words.iter().map(ToString::to_string).chain(numbers).collect()
        }
        Kind::Percentage { words } => {
            words.iter().map(ToString::to_string).chain(["0.013".to_owned(), "2.5%".to_owned()]).collect()
        }
        Kind::Pair { .. } => vec!["1.7,23.4".to_owned(), "0.25,1000".to_owned()],
        Kind::Graded { plain, graded, .. } => {
            [plain.to_string()].into_iter().chain(graded.iter().map(|name| format!("{name}:0.3"))).collect()
        }
        Kind::Bytes => vec!["800M".to_owned(), "123456".to_owned()],
    };
    texts.iter().map(|text| kind.parse(text).unwrap()).collect()
}

/// Settings to which `row` applies.
fn where_it_applies(row: &Setting) -> Settings {
    for kind in IntegratorKind::VARIANTS {
        for estimator in EstimatorKind::VARIANTS {
            let mut settings = Settings::default();
            settings.integrator.kind = kind.parse().unwrap();
            settings.integrator.estimator = estimator.parse().unwrap();
            settings.integrator.cache.cached = Cached::All;
            if row.applies.to(&settings) {
                return settings;
            }
        }
    }
    panic!("--{} applies to no image", row.flag)
}

/// `settings` with the automatic choices made explicit.
fn resolved(mut settings: Settings) -> Settings {
    for row in rows() {
        if let Some(value) = row.resolved.filter(|_| row.applies.to(&settings)).and_then(|resolved| resolved(&settings))
        {
            (row.set)(&mut settings, value).unwrap();
        }
    }
    settings
}

/// Every value of every setting, with other settings to which it applies.
fn cases() -> impl Iterator<Item = (&'static Setting, Settings)> {
    rows().flat_map(|row| {
        values(&row.kind).into_iter().map(move |value| {
            let mut settings = where_it_applies(row);
            (row.set)(&mut settings, value).unwrap();
            assert_eq!((row.get)(&settings), Some(value), "--{}", row.flag);
            (row, resolved(settings))
        })
    })
}

/// Scene-file parameters that set `value`.
fn parameters(row: &Setting, value: Value) -> String {
    let key = row.parameters[0];
    match (value, row.parameters) {
        (Value::Name(name), _) => format!(" \"string {key}\" \"{name}\""),
        (Value::Graded(name, grade), [_, second]) => format!(" \"string {key}\" \"{name}\" \"float {second}\" {grade}"),
        (Value::Integer(n), _) if row.kind == Kind::Bytes => format!(" \"string {key}\" \"{n}\""),
        (Value::Integer(n), _) => format!(" \"integer {key}\" {n}"),
        (Value::Real(x), _) => format!(" \"float {key}\" {x}"),
        (Value::Pair([a, b]), [_, second]) => format!(" \"float {key}\" {a} \"float {second}\" {b}"),
        (Value::Pair([a, b]), _) => format!(" \"float {key}\" [ {a} {b} ]"),
        (Value::Graded(..), _) => panic!("{key} has no parameter for the grade"),
    }
}

#[test]
fn metadata_given_back_on_the_command_line_are_the_same_settings() {
    for (row, settings) in cases().filter(|(row, _)| row.is_option) {
        let all = settings.recorded().filter_map(|(key, value)| Some((rows().find(|row| row.key == key)?, value)));
        let all = all.filter(|(row, _)| row.is_option);
        let unrecorded = (!row.is_recorded).then(|| (row, (row.get)(&settings).unwrap()));
        let options: Vec<String> =
            all.chain(unrecorded).map(|(row, value)| format!("--{}={value}", row.flag)).collect();
        let again = settings_of(&options).unwrap();
        let expected = of_rows(settings, |row| row.is_option);
        assert_eq!(again, expected, "--{}: {options:?}", row.flag);
    }
}

#[test]
fn metadata_written_into_a_scene_file_are_the_same_settings() {
    for (row, settings) in cases() {
        // In scene files, `stratified` is pbrt's sampler
        if settings.sampling.sampler == SamplerKind::Stratified {
            continue;
        }
        let [mut integrator, mut sampler] = [String::new(), String::new()];
        let unrecorded = (!row.is_recorded).then(|| (row.key, (row.get)(&settings).unwrap()));
        for (key, value) in settings.recorded().chain(unrecorded) {
            let row = rows().find(|row| row.key == key).unwrap();
            let directive = match row.directive {
                Directive::Integrator => &mut integrator,
                Directive::Sampler => &mut sampler,
            };
            *directive += &if row.parameters.is_empty() { format!("\"{value}\"") } else { parameters(row, value) };
        }
        let head = format!("Integrator {integrator}\nSampler {sampler}");
        let again = settings_of_scene(&head);
        assert_eq!(again, of_rows(settings, |_| true), "--{}: {head}", row.flag);
    }
}

#[test]
fn old_names_mean_what_they_meant() {
    let mut names = 0;
    // Options and their aliases
    for (row, settings) in cases() {
        let Some(value) = (row.get)(&settings) else { continue };
        for alias in row.aliases.iter().filter(|_| row.is_option) {
            let [old, new] = [alias, &row.flag].map(|flag| settings_of(&[format!("--{flag}={value}")]).unwrap());
            assert_eq!(old, new, "--{alias}={value}");
            names += 1;
        }

        // Parameters and their old names
        for (name, old) in row.old_parameters {
            let present = parameters(row, value);
            let head = |text: &str| match row.directive {
                Directive::Integrator => format!("Integrator \"path\" {text}"),
                Directive::Sampler => format!("Sampler \"zsobol\" {text}"),
            };
            let former = present.replace(&format!(" {name}\""), &format!(" {old}\""));
            assert_eq!(settings_of_scene(&head(&former)), settings_of_scene(&head(&present)), "{former}");
            names += usize::from(former != present);
        }
    }
    assert!(names > 20, "{names}");
}

/// Settings of the selected rows that apply to the image. All others have their defaults.
fn of_rows(settings: Settings, is_one: fn(&Setting) -> bool) -> Settings {
    let mut recorded = Settings::default();
    for row in rows().filter(|row| is_one(row) && row.applies.to(&settings)) {
        if let Some(value) = (row.get)(&settings) {
            (row.set)(&mut recorded, value).unwrap();
        }
    }
    recorded
}

#[test]
fn help_has_the_range_and_the_default_of_every_setting_under_its_heading() {
    // The section of each heading
    let mut command = SettingsArgs::augment_args(Command::new("test"));
    let text = command.render_long_help().to_string();
    for group in GROUPS {
        let part = text.split(&format!("{}:", heading(group))).nth(1).unwrap_or_else(|| panic!("{}", group.title));

        // Default and range of each option in it
        for row in group.rows.iter().filter(|row| row.is_option) {
            let option =
                part.split(&format!("\n      --{} ", row.flag)).nth(1).unwrap_or_else(|| panic!("--{}", row.flag));
            let option = option.split("\n      --").next().unwrap_or_default();
            let option = option.split_whitespace().collect::<Vec<_>>().join(" ");
            assert!(option.contains(&format!("default: {}", row.default_text())), "{option}");
            match row.kind {
                Kind::Choice { names, .. } => assert!(names.iter().all(|name| option.contains(name)), "{option}"),
                Kind::Real { range, .. } => assert!(option.contains(&range.to_string()), "{option}"),
                Kind::Integer { range, .. } if range == Integers::ALL => {}
                Kind::Integer { range, .. } => assert!(option.contains(&range.to_string()), "{option}"),
                Kind::Percentage { .. } | Kind::Pair { .. } | Kind::Graded { .. } | Kind::Bytes => {}
            }
        }
    }
}

#[test]
fn options_out_of_range_are_errors_that_say_what_is_expected() {
    for (option, message) in [
        ("--samples=0", "expected a whole number from 1 to 4096, or auto"),
        ("--progressive=1", "expected a number above 0 and below 1, or off"),
        ("--cache-radius=5,2", "two positive numbers of pixels separated by a comma, the smaller one first"),
        ("--importance=floor:2", "expected none, floor:E or cut-off:E, E being above 0 and up to 1"),
        ("--estimator=magic", "possible values: auto, mc, mis, ris"),
    ] {
        let error = settings_of(&[option.to_owned()]).unwrap_err().to_string();
        assert!(error.contains(message), "{option}: {error}");
    }
    assert_eq!(settings_of(&["--progressive".to_owned()]).unwrap().integrator.photons.progressive.unwrap().alpha, 0.5);
}

#[test]
fn a_setting_applies_to_some_images_and_not_to_all_unless_it_says_so() {
    for row in rows() {
        let always = matches!(row.applies, Applies::Always);
        let by_default =
            ["roulette-depth", "heuristic", "later-samples", "path-reuse", "light-paths", "infinite-fraction"]
                .contains(&row.flag);
        assert!(always || by_default || !row.applies.to(&Settings::default()), "--{}", row.flag);
        where_it_applies(row);
    }
}

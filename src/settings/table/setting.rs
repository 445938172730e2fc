//! A setting: the columns of the table, and shorthands for rows.

use crate::settings::value::{Integers, Kind, Value};
use crate::settings::{EstimatorKind, IntegratorKind, Settings};

/// A setting that is a field of [`Settings`], by its key, its values and the field: `named` of an enumeration, `count`
/// and `real`; `open_…` if the renderer chooses where there is none, `count_or` a word.
macro_rules! row {
    (named($key:literal, $of:ty, $($field:ident).+)) => {
        Setting {
            get: |s| Some($crate::settings::value::Value::Name(s.$($field).+.into())),
            set: |s, v| v.named().map(|x| s.$($field).+ = x),
            ..Setting::of($key, "NAME", $crate::settings::table::setting::choice(<$of as strum::VariantNames>::VARIANTS))
        }
    };
    (count($key:literal, $min:expr, $max:expr, $($field:ident).+)) => {
        Setting {
            get: |s| Some($crate::settings::value::Value::Integer(s.$($field).+.into())),
            set: |s, v| v.count().map(|n| s.$($field).+ = n),
            ..Setting::of($key, "N", $crate::settings::table::setting::integer($min, $max))
        }
    };
    (open_count($key:literal, $min:expr, $max:expr, $($field:ident).+)) => {
        Setting {
            get: |s| s.$($field).+.map(|n| $crate::settings::value::Value::Integer(n.into())),
            set: |s, v| v.count().map(|n| s.$($field).+ = Some(n)),
            ..Setting::of($key, "N", $crate::settings::table::setting::integer($min, $max))
        }
    };
    (count_or($word:literal, $key:literal, $min:expr, $max:expr, $($field:ident).+)) => {
        Setting {
            get: |s| Some(s.$($field).+.map_or($crate::settings::value::Value::Name($word), |n| $crate::settings::value::Value::Integer(n.into()))),
            set: |s, v| {
                s.$($field).+ = if v.name().is_some() { None } else { Some(v.count()?) };
                Some(())
            },
            ..Setting::of($key, "N", $crate::settings::value::Kind::Integer { range: $crate::settings::value::Integers { min: $min, max: $max }, words: &[$word] })
        }
    };
    (real($key:literal, $range:expr, $($field:ident).+)) => {
        Setting {
            get: |s| Some($crate::settings::value::Value::Real(s.$($field).+)),
            set: |s, v| v.real().map(|x| s.$($field).+ = x),
            ..Setting::of($key, "X", $crate::settings::value::Kind::Real { range: $range, words: &[] })
        }
    };
    (open_real($key:literal, $range:expr, $($field:ident).+)) => {
        Setting {
            get: |s| s.$($field).+.map($crate::settings::value::Value::Real),
            set: |s, v| v.real().map(|x| s.$($field).+ = Some(x)),
            ..Setting::of($key, "X", $crate::settings::value::Kind::Real { range: $range, words: &[] })
        }
    };
}

/// A setting.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// Name on the command line, without `--`.
    pub flag: &'static str,
    /// Former names on the command line, which are still accepted.
    pub aliases: &'static [&'static str],
    /// Placeholder of the value in help.
    pub value_name: &'static str,
    /// Value of the option if none is given, where that is allowed.
    pub bare: Option<&'static str>,
    /// The scene-file directive of its parameters.
    pub directive: Directive,
    /// Parameters of the directive that make up the value; empty if the value is the name of the directive itself.
    pub parameters: &'static [&'static str],
    /// Former names of parameters, which are still read: the present name and the old one.
    pub old_parameters: &'static [(&'static str, &'static str)],
    /// Name in metadata.
    pub key: &'static str,
    /// Values.
    pub kind: Kind,
    /// A sentence or two for the command line.
    pub help: &'static str,
    /// The default as help states it; `""` for the value in [`Settings::default`].
    pub default: &'static str,
    /// The images that it affects.
    pub applies: Applies,
    /// False if it is only available in scene files and Python, without a command-line option.
    pub is_option: bool,
    /// False if it cannot affect an image, but only prevent its rendering.
    pub is_recorded: bool,
    /// The value; `None` if the renderer chooses it and no name stands for that.
    pub get: fn(&Settings) -> Option<Value>,
    /// The value including the renderer's choice, if that follows from the settings alone.
    pub resolved: Option<fn(&Settings) -> Option<Value>>,
    /// Sets a value of `kind`; `None` if it is of another kind.
    pub set: fn(&mut Settings, Value) -> Option<()>,
}

/// The directive of scene files to which a setting belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Directive {
    /// `Integrator`
    Integrator,
    /// `Sampler`
    Sampler,
}

/// Images that a setting affects.
#[derive(Clone, Copy, Debug)]
pub enum Applies {
    /// All.
    Always,
    /// Images with one of these estimators of direct light.
    Estimators(&'static [EstimatorKind]),
    /// Images with one of these integrators.
    Integrators(&'static [IntegratorKind]),
    /// Images whose settings satisfy the condition, and the condition in words.
    If(fn(&Settings) -> bool, &'static str),
}

impl Applies {
    /// True if it affects an image with these settings.
    pub fn to(&self, settings: &Settings) -> bool {
        match self {
            Applies::Always => true,
            Applies::Estimators(list) => list.contains(&settings.integrator.estimator),
            Applies::Integrators(list) => list.contains(&settings.integrator.kind),
            Applies::If(is_so, _) => is_so(settings),
        }
    }

    /// Describes the images, as the end of a sentence.
    pub fn condition(&self) -> String {
        let list = |kind: &str, names: Vec<&str>| {
            let plural = if names.len() > 1 { "s" } else { "" };
            format!("it is for the {kind}{plural} {}", joined(&names))
        };
        match self {
            Applies::Always => "it is for all".to_owned(),
            Applies::Estimators(kinds) => list("estimator", kinds.iter().map(|&kind| kind.into()).collect()),
            Applies::Integrators(kinds) => list("integrator", kinds.iter().map(|&kind| kind.into()).collect()),
            Applies::If(_, condition) => format!("it is for {condition}"),
        }
    }
}

/// Names in a sentence: `a, b and c`.
pub(crate) fn joined(names: &[&str]) -> String {
    match names {
        [first @ .., last] if !first.is_empty() => format!("{} and {last}", first.join(", ")),
        names => names.concat(),
    }
}

/// Title of the groups that serve research.
pub const RESEARCH: &str = "Research";

/// Settings under one heading.
#[derive(Clone, Copy, Debug)]
pub struct Group {
    /// The heading.
    pub title: &'static str,
    /// Its settings.
    pub rows: &'static [Setting],
}

impl Setting {
    /// Sets the value from its text.
    ///
    /// Returns `Err` with the expected values if the text is invalid.
    pub fn set_text(&self, settings: &mut Settings, text: &str) -> Result<(), String> {
        let value = self.kind.parse(text)?;
        (self.set)(settings, value).ok_or_else(|| format!("expected {}", self.kind))
    }

    /// The default as help states it.
    pub fn default_text(&self) -> String {
        let value = || (self.get)(&Settings::default()).map_or_else(String::new, |value| value.to_string());
        if self.default.is_empty() { value() } else { self.default.to_owned() }
    }

    /// Defaults of the fields that rows leave out.
    pub(super) const BASE: Setting = Setting {
        flag: "",
        aliases: &[],
        value_name: "NAME",
        bare: None,
        directive: Directive::Integrator,
        parameters: &[],
        old_parameters: &[],
        key: "",
        kind: Kind::Bytes,
        help: "",
        default: "",
        applies: Applies::Always,
        is_option: true,
        is_recorded: true,
        get: |_| None,
        resolved: None,
        set: |_, _| None,
    };

    /// With this key, name of values and kind.
    pub(super) const fn of(key: &'static str, value_name: &'static str, kind: Kind) -> Setting {
        Setting { key, value_name, kind, ..Setting::BASE }
    }
}

/// A choice of these names.
pub(super) const fn choice(names: &'static [&'static str]) -> Kind {
    Kind::Choice { names, synonyms: &[] }
}

/// A whole number in a range.
pub(super) const fn integer(min: u64, max: u64) -> Kind {
    Kind::Integer { range: Integers { min, max }, words: &[] }
}

/// Maximum number of samples and proposals per estimate.
pub(super) const MAX_SAMPLES: u64 = 4096;
/// Largest number of 32 bits.
pub(super) const MAX_U32: u64 = u32::MAX as u64;

impl Value {
    /// The integer, as 32 bits.
    pub(super) fn count(&self) -> Option<u32> {
        self.integer().and_then(|n| u32::try_from(n).ok())
    }

    /// The member of an enumeration with this name.
    pub(super) fn named<T: std::str::FromStr>(&self) -> Option<T> {
        self.name()?.parse().ok()
    }
}

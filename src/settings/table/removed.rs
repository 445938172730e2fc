//! Settings of earlier versions that no longer exist. Scene files and plans may still contain them: they are ignored
//! with a message.

use super::setting::Directive;

/// A setting that no longer exists.
#[derive(Clone, Copy, Debug)]
pub struct Removed {
    /// Directive of scene files whose parameter it was.
    pub directive: Directive,
    /// Its parameter.
    pub parameter: &'static str,
    /// Its name in metadata.
    pub key: &'static str,
    /// The behaviour without it, as the end of a sentence.
    pub instead: &'static str,
}

/// All removed settings.
const REMOVED: &[Removed] = &[
    Removed {
        directive: Directive::Integrator,
        parameter: "roulette",
        key: "roulette",
        instead: "the throughput of a path decides whether it ends",
    },
    Removed {
        directive: Directive::Integrator,
        parameter: "controlvariates",
        key: "control_variates",
        instead: "the estimator ocv always has its control variates",
    },
    Removed {
        directive: Directive::Integrator,
        parameter: "stagetimes",
        key: "stage_times",
        instead: "proposal counts do not depend on measured times",
    },
    Removed {
        directive: Directive::Integrator,
        parameter: "correlated",
        key: "correlated",
        instead: "the estimator correlated weights its two estimates from the same samples",
    },
];

impl Removed {
    /// Removed settings of a directive.
    pub fn of(directive: Directive) -> impl Iterator<Item = &'static Removed> {
        REMOVED.iter().filter(move |removed| removed.directive == directive)
    }

    /// The removed setting with this name in metadata.
    pub fn of_key(key: &str) -> Option<&'static Removed> {
        REMOVED.iter().find(|removed| removed.key == key)
    }

    /// A sentence about the setting, which is called `name` in the input.
    pub fn note(&self, name: &str) -> String {
        format!("the setting `{name}` no longer exists and is ignored: {}", self.instead)
    }
}

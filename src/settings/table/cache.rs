//! The irradiance cache.

use super::{Applies, Group, MAX_SAMPLES, Setting, choice, integer};
use crate::settings::value::{Interval, Kind, Value};
use crate::settings::{Cached, IntegratorKind};
use strum::VariantNames;

const CACHE: Applies = Applies::Integrators(&[IntegratorKind::IrradianceCache]);

/// Records and what they hold.
pub(super) const IRRADIANCE_CACHE: Group = Group {
    title: "Irradiance cache (--integrator irradiance-cache)",
    rows: &[
        Setting {
            flag: "cached",
            parameters: &["cached"],
            key: "cached",
            kind: choice(Cached::VARIANTS),
            help: "What records hold: indirect light only, or direct light as well",
            applies: CACHE,
            get: |s| Some(Value::Name(s.integrator.cache.cached.into())),
            set: |s, v| v.named().map(|cached| s.integrator.cache.cached = cached),
            ..Setting::BASE
        },
        Setting {
            flag: "cache-error",
            value_name: "KAPPA",
            parameters: &["cacheerror"],
            key: "cache_error",
            kind: Kind::Real { range: Interval::open(0.0, 1.0), words: &[] },
            help: "Maximum error of a record: it is used up to this fraction of the mean distance to the surfaces it \
                   sees",
            applies: CACHE,
            get: |s| Some(Value::Real(s.integrator.cache.error)),
            set: |s, v| v.real().map(|error| s.integrator.cache.error = error),
            ..Setting::BASE
        },
        Setting {
            flag: "cache-radius",
            value_name: "MIN,MAX",
            parameters: &["cacheminradius", "cachemaxradius"],
            key: "cache_radius",
            kind: Kind::Pair { range: Interval::POSITIVE, ascends: true, unit: "pixels" },
            help: "Minimum and maximum radius of a record, in pixels",
            applies: CACHE,
            get: |s| Some(Value::Pair(s.integrator.cache.radius)),
            set: |s, v| v.pair().map(|radius| s.integrator.cache.radius = radius),
            ..Setting::BASE
        },
        Setting {
            flag: "cache-samples",
            value_name: "N",
            parameters: &["cachesamples"],
            key: "cache_samples",
            kind: integer(8, 65_536),
            help: "Directions per record in which indirect light is sampled",
            applies: CACHE,
            get: |s| Some(Value::Integer(s.integrator.cache.samples.into())),
            set: |s, v| v.count().map(|n| s.integrator.cache.samples = n),
            ..Setting::BASE
        },
        Setting {
            flag: "cache-passes",
            is_option: false,
            value_name: "N",
            parameters: &["cachepasses"],
            key: "cache_passes",
            kind: integer(1, MAX_SAMPLES),
            help: "Estimates of direct light per record, with `--cached all`",
            applies: Applies::If(
                |s| CACHE.to(s) && s.integrator.cache.cached == Cached::All,
                "the integrator irradiance-cache with --cached all",
            ),
            get: |s| Some(Value::Integer(s.integrator.cache.passes.into())),
            set: |s, v| v.count().map(|n| s.integrator.cache.passes = n),
            ..Setting::BASE
        },
    ],
};

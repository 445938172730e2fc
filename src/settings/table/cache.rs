//! The irradiance cache.

use super::setting::{Applies, Group, MAX_SAMPLES, Setting};
use crate::settings::value::{Interval, Kind, Value};
use crate::settings::{Cached, IntegratorKind};

const CACHE: Applies = Applies::Integrators(&[IntegratorKind::IrradianceCache]);

/// The irradiance cache and its records.
pub(super) const IRRADIANCE_CACHE: Group = Group {
    title: "Irradiance cache (--integrator irradiance-cache)",
    rows: &[
        Setting {
            flag: "cached",
            parameters: &["cached"],
            help: "Light stored in records: indirect only, or direct as well",
            applies: CACHE,
            ..row!(named("cached", Cached, integrator.cache.cached))
        },
        Setting {
            flag: "cache-error",
            value_name: "KAPPA",
            parameters: &["cacheerror"],
            help: "Maximum error of a record: it is used up to this fraction of the mean distance to the surfaces visible \
                   from it",
            applies: CACHE,
            ..row!(real("cache_error", Interval::open(0.0, 1.0), integrator.cache.error))
        },
        Setting {
            flag: "cache-radius",
            value_name: "MIN,MAX",
            parameters: &["cacheminradius", "cachemaxradius"],
            key: "cache_radius",
            kind: Kind::Pair { range: Interval::POSITIVE, unit: "pixels" },
            help: "Minimum and maximum radius of a record, in pixels",
            applies: CACHE,
            get: |s| Some(Value::Pair(s.integrator.cache.radius)),
            set: |s, v| v.pair().map(|radius| s.integrator.cache.radius = radius),
            ..Setting::BASE
        },
        Setting {
            flag: "cache-samples",
            parameters: &["cachesamples"],
            help: "Directions per record in which indirect light is sampled",
            applies: CACHE,
            ..row!(count("cache_samples", 8, 65_536, integrator.cache.samples))
        },
        Setting {
            flag: "cache-passes",
            is_option: false,
            parameters: &["cachepasses"],
            help: "Estimates of direct light per record, with `--cached all`",
            applies: Applies::If(
                |s| CACHE.to(s) && s.integrator.cache.cached == Cached::All,
                "the integrator irradiance-cache with --cached all",
            ),
            ..row!(count("cache_passes", 1, MAX_SAMPLES, integrator.cache.passes))
        },
    ],
};

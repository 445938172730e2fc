//! Photon maps, and the photons of the visibility cache.

use super::setting::{Applies, Group, MAX_SAMPLES, MAX_U32, Setting};
use crate::settings::value::{Integers, Interval, Kind, Value};
use crate::settings::{IntegratorKind, PhotonStorage, ProgressiveSettings};

const MAPS: Applies = Applies::Integrators(&[IntegratorKind::PhotonMap]);

/// Photons.
pub(super) const PHOTONS: Group = Group {
    title: "Photon maps (--integrator photon-map) and the visibility cache",
    rows: &[
        Setting {
            flag: "photons",
            parameters: &["photons"],
            help: "Approximate number of photons stored in the global map; of a progressive map, in each pass",
            applies: MAPS,
            ..row!(count("photons", 1, MAX_U32, integrator.photons.photons))
        },
        Setting {
            flag: "caustic-ratio",
            is_option: false,
            value_name: "Q",
            parameters: &["causticratio"],
            help: "Fraction q of the photon paths that also fill the global map; all of them fill the caustic map",
            applies: MAPS,
            ..row!(real("caustic_ratio", Interval::above(0.0, 1.0), integrator.photons.caustic_ratio))
        },
        Setting {
            flag: "importance",
            value_name: "WHICH",
            parameters: &["importance", "minimportance"],
            old_parameters: &[("minimportance", "leastimportance")],
            key: "importance",
            kind: Kind::Graded {
                plain: "none",
                graded: &["floor", "cut-off"],
                range: Interval::above(0.0, 1.0),
                default: 0.01,
            },
            help: "Store photons by visual importance: none; floor:E (with the probability p(x), but at least E); or \
                   cut-off:E (biased: not at all where p(x) is below E)",
            applies: MAPS,
            get: |s| {
                Some(match s.integrator.photons.storage {
                    PhotonStorage::All => Value::Name("none"),
                    PhotonStorage::Floor(min) => Value::Graded("floor", min),
                    PhotonStorage::CutOff(min) => Value::Graded("cut-off", min),
                })
            },
            set: |s, v| {
                s.integrator.photons.storage = match v.name()? {
                    "floor" => PhotonStorage::Floor(v.real()?),
                    "cut-off" => PhotonStorage::CutOff(v.real()?),
                    _ => PhotonStorage::All,
                };
                Some(())
            },
            ..Setting::BASE
        },
        Setting {
            flag: "nearest",
            is_option: false,
            value_name: "K",
            parameters: &["nearest"],
            help: "Photons per density estimate",
            applies: MAPS,
            ..row!(count("nearest", 2, 100_000, integrator.photons.nearest))
        },
        Setting {
            flag: "gather",
            value_name: "G",
            parameters: &["gather"],
            help: "Final-gather rays per diffuse vertex; 0 visualises the global map directly",
            applies: MAPS,
            ..row!(count("gather", 0, MAX_SAMPLES, integrator.photons.gather))
        },
        Setting {
            flag: "gather-guide",
            is_option: false,
            value_name: "FRACTION",
            parameters: &["gatherguide"],
            // Not all: there may be no photons from where light comes
            help: "Fraction of the final-gather rays that are guided by photons",
            applies: MAPS,
            ..row!(real("gather_guide", Interval::closed(0.0, 0.95), integrator.photons.guide))
        },
        Setting {
            flag: "progressive",
            value_name: "ALPHA",
            bare: Some("0.5"),
            parameters: &["alpha"],
            key: "progressive",
            kind: Kind::Real { range: Interval::open(0.0, 1.0), words: &["off"] },
            help: "Progressive photon mapping: new photons and smaller radii in every pass, so that the image \
                   converges. r² decreases as the power ALPHA - 1 of the number of passes; `off` overrides a file \
                   that asks for sppm",
            default: "off; ALPHA: 0.5",
            applies: MAPS,
            get: |s| Some(s.integrator.photons.progressive.map_or(Value::Name("off"), |p| Value::Real(p.alpha))),
            set: |s, v| {
                let progressive = &mut s.integrator.photons.progressive;
                *progressive = v.real().map(|alpha| ProgressiveSettings { alpha, ..progressive.unwrap_or_default() });
                Some(())
            },
            ..Setting::BASE
        },
        Setting {
            flag: "photon-radius",
            is_option: false,
            value_name: "METRES",
            parameters: &["radius"],
            key: "photon_radius",
            kind: Kind::Real { range: Interval::POSITIVE, words: &[] },
            help: "Initial radius of progressive photon mapping, which this option switches on",
            default: "the distance of the K nearest photons at surfaces visible to the camera",
            applies: MAPS,
            get: |s| s.integrator.photons.progressive.and_then(|p| p.radius).map(Value::Real),
            set: |s, v| {
                s.integrator.photons.progressive.get_or_insert_default().radius = Some(v.real()?);
                Some(())
            },
            ..Setting::BASE
        },
        Setting {
            flag: "visibility-photons",
            is_option: false,
            aliases: &["light-photons"],
            parameters: &["visibilityphotons"],
            old_parameters: &[("visibilityphotons", "lightphotons")],
            help: "Photon paths traced for the visibility cache, which --light-sampler photons, --target visibility \
                   and --estimator contributing use",
            default: "262144",
            applies: Applies::If(
                |s| s.integrator.uses_visibility_cache(),
                "the light sampler photons, the estimator contributing and the targets visibility and visibility-control",
            ),
            ..row!(open_count("visibility_photons", 1, MAX_U32, integrator.photons.visibility_photons))
        },
        Setting {
            flag: "photon-paths",
            is_option: false,
            value_name: "N",
            parameters: &["photonpaths"],
            key: "photon_paths",
            kind: Kind::Integer { range: Integers { min: 1, max: i64::MAX as u64 }, words: &[] },
            help: "Maximum number of photon paths per map: storage by importance can take many to store the photons \
                   requested",
            applies: MAPS,
            get: |s| Some(Value::Integer(s.integrator.photons.paths)),
            set: |s, v| v.integer().map(|n| s.integrator.photons.paths = n),
            ..Setting::BASE
        },
        Setting {
            flag: "memory",
            is_option: false,
            value_name: "BYTES",
            parameters: &["memory"],
            key: "memory",
            kind: Kind::Bytes,
            help: "Maximum memory of the photon maps, such as 800M or 4G",
            default: "4G",
            applies: MAPS,
            is_recorded: false,
            get: |s| Some(Value::Integer(s.integrator.photons.memory)),
            set: |s, v| v.integer().map(|n| s.integrator.photons.memory = n),
            ..Setting::BASE
        },
    ],
};

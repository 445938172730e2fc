//! `Integrator` and `Sampler`: the settings of [`crate::settings::table`], and pbrt's synonyms.

use super::checks::unknown;
use super::descriptions::Pending;
use crate::settings::table::{Directive, Removed, rows};
use crate::settings::value::{Integers, Interval, Kind, Value};
use crate::settings::{IntegratorKind, ProgressiveSettings, Setting, Settings};
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::pbrt::params::{ParamSet, ParamType};
use lumiris_formats::source::Span;
use lumiris_numbers::samplers::SamplerKind;

/// Parameters of pbrt's integrators that have no effect here.
const IGNORED: [&str; 16] = [
    "iterations",
    "imagewritefrequency",
    "rrthreshold",
    "samplelights",
    "samplebsdf",
    "visualizestrategies",
    "visualizeweights",
    "bootstrapsamples",
    "chains",
    "mutationsperpixel",
    "largestepprobability",
    "sigma",
    "cossample",
    "maxdistance",
    "strategy",
    "seed",
];

/// A setting that a file gives.
pub struct GivenSetting {
    /// The setting.
    pub setting: &'static Setting,
    /// Its value.
    pub value: Value,
    /// Source position.
    pub span: Span,
}

/// Reads `Integrator`, and returns its settings.
pub(super) fn finish_integrator(pending: Option<&Pending>, s: &mut Settings, d: &mut Diagnostics) -> Vec<GivenSetting> {
    let Some(Pending { name, params: p }) = pending else { return Vec::new() };
    let mut kind = IntegratorKind::Path;
    match name.text.as_str() {
        "path" | "volpath" => {}
        "direct" => kind = IntegratorKind::Direct,
        "irradiance-cache" => kind = IntegratorKind::IrradianceCache,
        "photon-map" => kind = IntegratorKind::PhotonMap,
        "sppm" => {
            kind = IntegratorKind::PhotonMap;
            s.integrator.photons.progressive = Some(ProgressiveSettings::default());
        }
        "directlighting" => {
            kind = IntegratorKind::Direct;
            d.warning_once(name.span, "integrator `directlighting` is pbrt-v3: `direct` is used");
        }
        "simplepath" | "simplevolpath" | "bdpt" | "mlt" | "lightpath" | "ao" | "randomwalk" | "whitted" => {
            d.warning_once(name.span, format!("integrator `{}` is not rendered here: `path` is used", name.text));
        }
        other => {
            unknown(other, name.span, "integrator", &["path", "direct", "irradiance-cache", "photon-map", "volpath"], d)
        }
    }
    set_name("integrator", kind.into(), s);
    let given = parameters(Directive::Integrator, s, p, d);
    // pbrt counts photon paths, the setting counts stored photons; −1 leaves the choice to the renderer
    if let Some(n @ 1..) = p.integer("photonsperiteration", d) {
        s.integrator.photons.photons = n as u32;
    }
    if p.ignore("regularize") {
        d.warning_once(p.span_of("regularize"), "regularize is ignored: it would bias the image");
    }
    IGNORED.iter().for_each(|key| {
        p.ignore(key);
    });
    p.report_unused(d);
    given
}

/// Reads `Sampler`, and returns its settings.
pub(super) fn finish_sampler(pending: Option<&Pending>, s: &mut Settings, d: &mut Diagnostics) -> Vec<GivenSetting> {
    let Some(Pending { name, params: p }) = pending else { return Vec::new() };
    match name.text.as_str() {
        "independent" | "random" => {
            // The only sampler with this default
            (s.sampling.sampler, s.sampling.spp) = (SamplerKind::Independent, 4);
        }
        // pbrt's stratified samples cover a pixel jointly, like the samples of a sequence
        "sobol" | "paddedsobol" | "halton" | "pmj02bn" | "stratified" | "lowdiscrepancy" | "02sequence"
        | "maxmindist" => {
            s.sampling.sampler = SamplerKind::Sobol;
        }
        "zsobol" => s.sampling.sampler = SamplerKind::SobolBlueNoise,
        other => unknown(other, name.span, "sampler", &["independent", "sobol", "zsobol", "halton", "stratified"], d),
    }
    if name.text == "stratified" {
        let counts = Integers { min: 1, ..Integers::ALL };
        let mut count = |key| whole(key, &counts, p, d).map(|n| n as u32);
        let (x, y) = (count("xsamples").unwrap_or(4), count("ysamples").unwrap_or(4));
        s.sampling.spp = x.saturating_mul(y);
        p.ignore("jitter");
        p.ignore("dimensions");
    }
    let given = parameters(Directive::Sampler, s, p, d);
    // Randomisation is part of the sampler here.
    p.ignore("randomization");
    p.report_unused(d);
    given
}

/// Sets a setting of the table to one of its names.
fn set_name(flag: &str, name: &'static str, s: &mut Settings) {
    rows().filter(|row| row.flag == flag).for_each(|row| {
        (row.set)(s, Value::Name(name));
    });
}

/// Reads all settings among the parameters of a directive.
fn parameters(directive: Directive, s: &mut Settings, p: &ParamSet, d: &mut Diagnostics) -> Vec<GivenSetting> {
    let mut given = Vec::new();
    for row in rows().filter(|row| row.directive == directive) {
        if let Some(value) = read(row, s, p, d) {
            (row.set)(s, value);
            let names = row.parameters.iter().chain(row.old_parameters.iter().map(|(_, old)| old));
            let written = names.copied().find(|name| p.type_of(name).is_some());
            given.extend(written.map(|name| GivenSetting { setting: row, value, span: p.span_of(name) }));
        }
    }
    for removed in Removed::of(directive).filter(|removed| p.type_of(removed.parameter).is_some()) {
        p.ignore(removed.parameter);
        d.warning(p.span_of(removed.parameter), removed.note(removed.parameter));
    }
    given
}

/// The name of parameter `i` of a setting in the file: a former name if the present one is absent.
fn spelling(row: &Setting, i: usize, p: &ParamSet) -> Option<&'static str> {
    let &name = row.parameters.get(i)?;
    let is_old = |&&(new, old): &&(&str, &str)| new == name && p.type_of(name).is_none() && p.type_of(old).is_some();
    Some(row.old_parameters.iter().find(is_old).map_or(name, |&(_, old)| old))
}

/// The value of a setting from its parameters; missing components are taken from `current`.
fn read(row: &Setting, current: &Settings, p: &ParamSet, d: &mut Diagnostics) -> Option<Value> {
    let key = spelling(row, 0, p)?;
    let is_text = p.type_of(key) == Some(ParamType::String);
    match row.kind {
        Kind::Choice { names, synonyms } => {
            let read: Vec<&'static str> = names.iter().copied().chain(synonyms.iter().map(|&(name, _)| name)).collect();
            let name = named(key, &read, p, d)?;
            Some(Value::Name(synonyms.iter().find(|(synonym, _)| *synonym == name).map_or(name, |&(_, name)| name)))
        }
        Kind::Integer { words, .. } | Kind::Real { words, .. } | Kind::Percentage { words }
            if is_text && !words.is_empty() =>
        {
            named(key, words, p, d).map(Value::Name)
        }
        // Negative numbers are large ones with the same bits
        Kind::Integer { range, .. } if range == Integers::ALL => {
            p.integer(key, d).map(|n| Value::Integer(u64::from(n as u32)))
        }
        Kind::Integer { range, .. } => whole(key, &range, p, d).map(Value::Integer),
        Kind::Real { range, .. } => within(key, &range, p, d).map(Value::Real),
        Kind::Percentage { .. } => within(key, &Interval::POSITIVE, p, d).map(Value::Real),
        Kind::Pair { .. } => pair(row, current, p, d),
        Kind::Graded { plain, graded, range, default } => {
            let grade = spelling(row, 1, p).and_then(|key| within(key, &range, p, d)).unwrap_or(default);
            let names: Vec<&'static str> = [plain].into_iter().chain(graded.iter().copied()).collect();
            let name = named(key, &names, p, d)?;
            Some(if name == plain { Value::Name(plain) } else { Value::Graded(name, grade) })
        }
        Kind::Bytes => {
            let value = row.kind.parse(p.string(key, d)?);
            value.map_err(|expected| d.error(p.span_of(key), format!("wrong {key}")).help(expected)).ok()
        }
    }
}

/// Two numbers, in one parameter each. A maximum that is not given is at least the minimum.
fn pair(row: &Setting, current: &Settings, p: &ParamSet, d: &mut Diagnostics) -> Option<Value> {
    let (Kind::Pair { range, unit }, &[min, max]) = (row.kind, row.parameters) else { return None };
    let now = (row.get)(current).and_then(|value| value.pair()).unwrap_or_default();
    let (first, second) = (p.float(min, d), p.float(max, d));
    if first.is_none() && second.is_none() {
        return None;
    }
    let first = first.unwrap_or(now[0]);
    let second = second.unwrap_or(now[1].max(first));
    if range.contains(first) && range.contains(second) && first <= second {
        return Some(Value::Pair([first, second]));
    }
    let key = if p.type_of(max).is_some() { max } else { min };
    let message = format!("{min} and {max} must be {range}, and not {first} and {second}");
    d.error(p.span_of(key), message).help(format!("{unit}; the smaller one first"));
    None
}

/// One of `known`.
fn named(key: &'static str, known: &[&'static str], p: &ParamSet, d: &mut Diagnostics) -> Option<&'static str> {
    let name = p.string(key, d)?;
    let found = known.iter().copied().find(|&k| k == name);
    if found.is_none() {
        let message = format!("unknown {key} `{name}`");
        d.error(p.span_of(key), message).help(format!("one of {}", known.join(", ")));
    }
    found
}

/// A whole number in a range.
fn whole(key: &'static str, range: &Integers, p: &ParamSet, d: &mut Diagnostics) -> Option<u64> {
    let n = i64::from(p.integer(key, d)?);
    if range.contains(n) {
        return u64::try_from(n).ok();
    }
    d.error(p.span_of(key), format!("{key} must be {range}, not {n}"));
    None
}

/// A number in a range.
fn within(key: &'static str, range: &Interval, p: &ParamSet, d: &mut Diagnostics) -> Option<f32> {
    let x = p.float(key, d)?;
    if range.contains(x) {
        return Some(x);
    }
    d.error(p.span_of(key), format!("{key} must be {range}, not {x}"));
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::{LoadOptions, load};
    use crate::lights::LightSamplerKind;
    use crate::settings::{
        Cached, EstimatorKind, IntegratorSettings, IrradianceCacheSettings, PhotonMapSettings, PhotonStorage,
        ProposalPoints, Proposals, SampleCounts, SamplingTechnique, Strata, Target,
    };
    use lumiris_numbers::estimators::heuristics::Heuristic;

    fn settings(integrator: &str) -> Result<IntegratorSettings, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.pbrt");
        std::fs::write(&path, format!("{integrator}\nWorldBegin\nShape \"sphere\"\n")).unwrap();
        load(&path, &LoadOptions::default())
            .map(|loaded| loaded.settings.integrator)
            .map_err(|report| report.to_string())
    }

    #[test]
    fn settings_of_resampling_are_read() {
        let s = settings(
            "Integrator \"direct\" \"string estimator\" \"ris\" \"integer samples\" 2 \"integer proposals\" 24
             \"string strata\" \"weights\" \"string proposalpoints\" \"independent\" \"string target\" \"gvl\"
             \"string heuristic\" \"power\" \"integer bsdfproposals\" 9",
        )
        .unwrap();
        assert_eq!((s.kind, s.estimator), (IntegratorKind::Direct, EstimatorKind::Ris));
        assert_eq!(s.sample_counts(), SampleCounts { samples: 2, proposals: 24 });
        assert_eq!((s.ris.strata, s.ris.points), (Strata::Weights, ProposalPoints::Independent));
        assert_eq!((s.ris.target, s.heuristic(), s.bsdf_proposals), (Target::Gvl, Heuristic::Power, 9));
        for (word, proposals) in [("auto", Proposals::Auto), ("optimal", Proposals::Optimal)] {
            let s = settings(&format!("Integrator \"path\" \"string proposals\" \"{word}\"")).unwrap();
            assert_eq!(s.ris.proposals, proposals);
        }
    }

    #[test]
    fn settings_of_the_irradiance_cache_are_read() {
        let s = settings(
            "Integrator \"irradiance-cache\" \"string cached\" \"all\" \"float cacheerror\" 0.3 \"float cacheminradius\" 2
             \"float cachemaxradius\" 50 \"integer cachesamples\" 1000 \"integer cachepasses\" 7",
        )
        .unwrap();
        let cache =
            IrradianceCacheSettings { cached: Cached::All, error: 0.3, radius: [2.0, 50.0], samples: 1000, passes: 7 };
        assert_eq!((s.kind, s.cache, s.max_depth), (IntegratorKind::IrradianceCache, cache, 5));
        let s = settings("Integrator \"irradiance-cache\" \"float cacheminradius\" 90").unwrap();
        assert_eq!(s.cache, IrradianceCacheSettings { radius: [90.0, 90.0], ..Default::default() });
    }

    #[test]
    fn settings_of_photon_maps_are_read() {
        let s = settings(
            "Integrator \"photon-map\" \"integer photons\" 1000000 \"float causticratio\" 0.5 \"string importance\" \"floor\"
             \"float minimportance\" 0.25 \"integer nearest\" 80 \"integer gather\" 0 \"float gatherguide\" 0.5 \"integer visibilityphotons\" 9000",
        )
        .unwrap();
        let photons = PhotonMapSettings {
            photons: 1_000_000,
            caustic_ratio: 0.5,
            storage: PhotonStorage::Floor(0.25),
            nearest: 80,
            gather: 0,
            guide: 0.5,
            visibility_photons: Some(9000),
            ..Default::default()
        };
        assert_eq!((s.kind, s.photons), (IntegratorKind::PhotonMap, photons));
        let s = settings("Integrator \"sppm\" \"float radius\" 0.5 \"integer photonsperiteration\" -1").unwrap();
        assert_eq!(s.photons.progressive, Some(ProgressiveSettings { radius: Some(0.5), ..Default::default() }));
    }

    #[test]
    fn wrong_settings_of_photon_maps_are_errors() {
        for (parameter, message) in [
            ("\"integer photons\" 0", "photons must be at least 1, not 0"),
            ("\"float causticratio\" 0", "causticratio must be above 0 and up to 1, not 0"),
            ("\"float gatherguide\" 1", "gatherguide must be from 0 to 0.95, not 1"),
            ("\"integer gather\" -1", "gather must be from 0 to 4096, not -1"),
            ("\"float alpha\" 1", "alpha must be above 0 and below 1, not 1"),
            ("\"string importance\" \"all\"", "one of none, floor, cut-off"),
        ] {
            let error = settings(&format!("Integrator \"photon-map\" {parameter}")).unwrap_err();
            assert!(error.contains(message), "{error}");
        }
    }

    #[test]
    fn settings_that_no_longer_exist_are_ignored_with_their_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.pbrt");
        let text = "Integrator \"path\"\n  \"string roulette\" \"efficiency\" \"integer maxdepth\" 3\nWorldBegin\nShape \"sphere\"\n";
        std::fs::write(&path, text).unwrap();
        let loaded = load(&path, &LoadOptions::default()).map_err(|report| report.to_string()).unwrap();
        assert_eq!(loaded.settings.integrator, IntegratorSettings { max_depth: 3, ..Default::default() });
        let warnings = loaded.warnings.to_string();
        assert!(warnings.contains("scene.pbrt:2:3"), "{warnings}");
        assert!(warnings.contains("the setting `roulette` no longer exists and is ignored"), "{warnings}");
    }

    #[test]
    fn wrong_settings_of_the_irradiance_cache_are_errors() {
        for (parameter, message) in [
            ("\"string cached\" \"most\"", "one of indirect, all"),
            ("\"float cacheerror\" 1", "cacheerror must be above 0 and below 1, not 1"),
            ("\"float cacheminradius\" 0", "must be positive, and not 0 and 20"),
            ("\"float cacheminradius\" 9 \"float cachemaxradius\" 8", "the smaller one first"),
            ("\"integer cachesamples\" 4", "cachesamples must be from 8 to 65536, not 4"),
            ("\"integer cachepasses\" 0", "cachepasses must be from 1 to 4096, not 0"),
        ] {
            let report = settings(&format!("Integrator \"irradiance-cache\" {parameter}")).unwrap_err();
            assert!(report.contains(message), "{parameter}: {report}");
        }
    }

    #[test]
    fn settings_of_correlated_sampling_are_read() {
        let s = settings("Integrator \"path\" \"string estimator\" \"correlated\"").unwrap();
        assert_eq!(s.estimator, EstimatorKind::Correlated);
        assert_eq!(s.correlated_technique, SamplingTechnique::Bsdf);
        let s = settings("Integrator \"path\" \"string technique\" \"light\"").unwrap();
        assert_eq!(s.correlated_technique, SamplingTechnique::Light);
        let report = settings("Integrator \"path\" \"string technique\" \"both\"").unwrap_err();
        assert!(report.contains("one of bsdf, light"), "{report}");
    }

    #[test]
    fn settings_of_light_by_photons_are_read() {
        let s = settings("Integrator \"path\" \"string estimator\" \"contributing\" \"integer samples\" 8").unwrap();
        assert_eq!((s.estimator, s.contributing.noncontributing_samples()), (EstimatorKind::Contributing, 2));
        assert!(
            s.uses_visibility_cache()
                && !s.leaves_lights_out()
                && s.sample_counts() == SampleCounts { samples: 8, proposals: 8 }
        );
        let s =
            settings("Integrator \"path\" \"string estimator\" \"contributing\" \"integer noncontributingsamples\" 0")
                .unwrap();
        assert!(s.leaves_lights_out());
        let s = settings("Integrator \"path\" \"string lightsampler\" \"photons\"").unwrap();
        assert!(
            s.light_sampler == LightSamplerKind::VisibilityCache && s.uses_visibility_cache() && !s.leaves_lights_out()
        );
        let s = settings("Integrator \"path\" \"string target\" \"visibility\"").unwrap();
        assert!(s.ris.target == Target::Visibility && !s.uses_visibility_cache(), "the target is that of ris alone");
        let s = settings("Integrator \"path\" \"string estimator\" \"ris\" \"string target\" \"visibility\"").unwrap();
        assert!(s.uses_visibility_cache());
        let report = settings("Integrator \"path\" \"integer noncontributingsamples\" -1").unwrap_err();
        assert!(report.contains("noncontributingsamples must be from 0 to 4096, not -1"), "{report}");
    }

    #[test]
    fn wrong_settings_of_resampling_are_errors_that_say_what_is_possible() {
        for (parameter, message) in [
            ("\"string proposals\" \"many\"", "one of auto, optimal"),
            ("\"integer proposals\" 0", "proposals must be from 1 to 4096, not 0"),
            ("\"string strata\" \"some\"", "one of none, proposals, weights, systematic"),
            ("\"string target\" \"l\"", "one of fgl, gv, gvl"),
            ("\"string estimator\" \"rys\"", "one of auto, mc, mis, ris, ocv, optimal-mis, correlated"),
        ] {
            let report = settings(&format!("Integrator \"path\" {parameter}")).unwrap_err();
            assert!(report.contains(message), "{parameter}: {report}");
        }
    }
}

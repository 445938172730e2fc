//! `Integrator`: light transport and the estimator of direct light.

use super::options::{Pending, unknown};
use crate::bsdfs::ProposalDensity;
use crate::lights::LightSamplerKind;
use crate::scene::{
    Cached, CorrelatedForm, Deposition, EstimatorKind, IntegratorKind, IntegratorSettings, IrradianceCacheSettings,
    OptimalForm, PhotonMapSettings, ProposalPoints, Proposals, SamplingTechnique, Shrinking, Strata, Target,
};
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::pbrt::params::{ParamSet, ParamType};
use lumiris_numbers::estimators::mis::Heuristic;
use lumiris_numbers::estimators::ocv::Form;

/// Understands `Integrator`.
pub(super) fn finish_integrator(pending: Option<&Pending>, d: &mut Diagnostics) -> IntegratorSettings {
    let mut s = IntegratorSettings::default();
    let Some(Pending { name, params: p }) = pending else { return s };
    match name.text.as_str() {
        "path" | "volpath" => {}
        "direct" => s.kind = IntegratorKind::Direct,
        "irradiance-cache" => s.kind = IntegratorKind::IrradianceCache,
        "photon-map" => s.kind = IntegratorKind::PhotonMap,
        "sppm" => {
            s.kind = IntegratorKind::PhotonMap;
            s.photons.progressive = Some(Shrinking::default());
        }
        "directlighting" => {
            s.kind = IntegratorKind::Direct;
            d.warning_once(name.span, "integrator `directlighting` is pbrt-v3: `direct` is used");
        }
        "simplepath" | "simplevolpath" | "bdpt" | "mlt" | "lightpath" | "ao" | "randomwalk" | "whitted" => {
            d.warning_once(name.span, format!("integrator `{}` is not rendered here: `path` is used", name.text));
        }
        other => {
            unknown(other, name.span, "integrator", &["path", "direct", "irradiance-cache", "photon-map", "volpath"], d)
        }
    }
    match p.integer("maxdepth", d) {
        Some(n @ 0..=10_000) => s.max_depth = n as u32,
        Some(n) => {
            d.error(p.span_of("maxdepth"), format!("maxdepth must be from 0 to 10000, not {n}"));
        }
        None if s.kind == IntegratorKind::Direct => s.max_depth = 1,
        None => {}
    }
    lumiris_parameters(&mut s, p, d);
    cache_parameters(&mut s.cache, p, d);
    photon_parameters(&mut s.photons, p, d);
    if p.ignore("regularize") {
        d.warning_once(p.span_of("regularize"), "regularize is ignored: it would bias the picture");
    }
    for key in [
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
    ] {
        p.ignore(key);
    }
    p.report_unused(d);
    s
}

/// Parameters that are Lumiris's own, and pbrt's `lightsampler`.
fn lumiris_parameters(s: &mut IntegratorSettings, p: &ParamSet, d: &mut Diagnostics) {
    use EstimatorKind::{Contributing, Correlated, Mc, Mis, Ocv, OptimalMis, Ris};
    let kinds = [Mc, Mis, Ris, Ocv, OptimalMis, Correlated, Contributing];
    if let Some(e) = choice(p, "estimator", &kinds, EstimatorKind::name, d) {
        s.estimator = e;
    }
    let forms = [Form::Progressive, Form::Crossfit, Form::Regression, Form::Paper];
    if let Some(form) = choice(p, "ocv", &forms, Form::name, d) {
        s.ocv.form = form;
    }
    if let Some(form) = choice(p, "optimalmis", &[OptimalForm::Progressive, OptimalForm::Direct], OptimalForm::name, d)
    {
        s.optimal_mis = form;
    }
    let forms = [CorrelatedForm::Combined, CorrelatedForm::Crossfit];
    if let Some(form) = choice(p, "correlated", &forms, CorrelatedForm::name, d) {
        s.correlated.form = form;
    }
    let techniques = [SamplingTechnique::Bsdf, SamplingTechnique::Light];
    if let Some(technique) = choice(p, "technique", &techniques, SamplingTechnique::name, d) {
        s.correlated.technique = technique;
    }
    match p.integer("components", d) {
        Some(n @ 2..=8) => s.ocv.components = Some(n as u32),
        Some(n) => {
            d.error(p.span_of("components"), format!("components must be from 2 to 8, not {n}"));
        }
        None => {}
    }
    match p.integer("restsamples", d) {
        Some(n @ 0..=4096) => s.contributing.rest_samples = n as u32,
        Some(n) => {
            d.error(p.span_of("restsamples"), format!("restsamples must be from 0 to 4096, not {n}"));
        }
        None => {}
    }
    match p.float("bsdfshare", d) {
        Some(share) if (0.0..=1.0).contains(&share) => s.bsdf_share = share,
        Some(share) => {
            d.error(p.span_of("bsdfshare"), format!("bsdfshare must be from 0 to 1, not {share}"));
        }
        None => {}
    }
    let heuristics = [Heuristic::Balance, Heuristic::Power, Heuristic::Maximum];
    if let Some(h) = choice(p, "heuristic", &heuristics, Heuristic::name, d) {
        s.heuristic = Some(h);
    }
    let kinds = [Strata::None, Strata::Proposals, Strata::Weights, Strata::Systematic];
    if let Some(strata) = choice(p, "strata", &kinds, Strata::name, d) {
        s.ris.strata = strata;
    }
    let kinds = [ProposalPoints::Independent, ProposalPoints::Stratified];
    if let Some(points) = choice(p, "proposalpoints", &kinds, ProposalPoints::name, d) {
        s.ris.points = points;
    }
    let kinds = [Target::Fgl, Target::Gv, Target::Gvl, Target::Visibility];
    if let Some(target) = choice(p, "target", &kinds, Target::name, d) {
        s.ris.target = target;
    }
    let samplers = ["uniform", "power", "bvh", "tree", "exhaustive", "spatial", "photons"];
    if let Some(name) = choice(p, "lightsampler", &samplers, |name| name, d) {
        s.light_choice = match name {
            "uniform" => LightSamplerKind::Uniform,
            "power" => LightSamplerKind::Power,
            "photons" => LightSamplerKind::Photons,
            _ => LightSamplerKind::Tree,
        };
    }
    if let Some(density) = choice(p, "bsdfdensity", &ProposalDensity::ALL, ProposalDensity::name, d) {
        s.bsdf_density = density;
    }
    if let Some(n) = count(p, "bsdfproposals", d) {
        s.bsdf_proposals = n;
    }
    s.samples = count(p, "samples", d);
    if p.type_of("proposals") == Some(ParamType::String) {
        let kinds = [Proposals::Auto, Proposals::Optimal];
        let name = |p: Proposals| if p == Proposals::Auto { "auto" } else { "optimal" };
        if let Some(proposals) = choice(p, "proposals", &kinds, name, d) {
            s.ris.proposals = proposals;
        }
    } else if let Some(n) = count(p, "proposals", d) {
        s.ris.proposals = Proposals::Fixed(n);
    }
}

/// Parameters of `irradiance-cache`.
fn cache_parameters(s: &mut IrradianceCacheSettings, p: &ParamSet, d: &mut Diagnostics) {
    if let Some(cached) = choice(p, "cached", &[Cached::Indirect, Cached::All], Cached::name, d) {
        s.cached = cached;
    }
    if let Some(error) = p.float("cacheerror", d) {
        if IrradianceCacheSettings::is_error(error) {
            s.error = error;
        } else {
            d.error(p.span_of("cacheerror"), format!("cacheerror must be above 0 and below 1, not {error}"));
        }
    }
    let min = p.float("cacheminradius", d).unwrap_or(s.radius[0]);
    let radius = [min, p.float("cachemaxradius", d).unwrap_or(s.radius[1].max(min))];
    if IrradianceCacheSettings::is_radius(radius) {
        s.radius = radius;
    } else {
        let key = if p.type_of("cachemaxradius").is_some() { "cachemaxradius" } else { "cacheminradius" };
        let message = format!("cacheminradius and cachemaxradius must be positive, and not {} and {}", min, radius[1]);
        d.error(p.span_of(key), message).help("pixels; the least one first");
    }
    if let Some(n) = p.integer("cachesamples", d) {
        if let n @ 8..=65_536 = n {
            s.samples = n as u32;
        } else {
            d.error(p.span_of("cachesamples"), format!("cachesamples must be from 8 to 65536, not {n}"));
        }
    }
    if let Some(n) = count(p, "cachepasses", d) {
        s.passes = n;
    }
}

/// Parameters of `photon-map`, and those of `sppm` that mean the same.
fn photon_parameters(s: &mut PhotonMapSettings, p: &ParamSet, d: &mut Diagnostics) {
    s.photons = photon_count(p, "photons", d).unwrap_or(s.photons);
    // Trajectories there, stored photons here; −1 is the choice of the renderer
    if let Some(n @ 1..) = p.integer("photonsperiteration", d) {
        s.photons = n as u32;
    }
    s.light_photons = photon_count(p, "lightphotons", d).or(s.light_photons);
    s.nearest = count(p, "nearest", d).unwrap_or(s.nearest).max(2);
    if let Some(n) = p.integer("gather", d) {
        if let n @ 0..=4096 = n {
            s.gather = n as u32;
        } else {
            d.error(p.span_of("gather"), format!("gather must be from 0 to 4096, not {n}"));
        }
    }
    let (q, guide) = (PhotonMapSettings::is_ratio, PhotonMapSettings::is_guide);
    s.caustic_ratio = within(p, "causticratio", q, "above 0 and up to 1", d).unwrap_or(s.caustic_ratio);
    s.guide = within(p, "gatherguide", guide, "from 0 to 0.95", d).unwrap_or(s.guide);
    let least = within(p, "leastimportance", Deposition::is_least, "above 0 and up to 1", d);
    let kinds = [Deposition::All, Deposition::Floor(least.unwrap_or(0.01)), Deposition::CutOff(least.unwrap_or(0.01))];
    s.deposition = choice(p, "importance", &kinds, Deposition::name, d).unwrap_or(s.deposition);
    if let Some(alpha) = within(p, "alpha", Shrinking::is_alpha, "above 0 and below 1", d) {
        s.progressive.get_or_insert_default().alpha = alpha;
    }
    if let Some(radius) = within(p, "radius", |r| r > 0.0 && r.is_finite(), "positive", d) {
        s.progressive.get_or_insert_default().radius = Some(radius);
    }
}

/// A number of photons.
fn photon_count(p: &ParamSet, key: &'static str, d: &mut Diagnostics) -> Option<u32> {
    match p.integer(key, d)? {
        n @ 1.. => Some(n as u32),
        n => {
            d.error(p.span_of(key), format!("{key} must be at least 1, not {n}"));
            None
        }
    }
}

/// A number that must lie somewhere.
fn within(
    p: &ParamSet,
    key: &'static str,
    is_valid: impl Fn(f32) -> bool,
    where_: &str,
    d: &mut Diagnostics,
) -> Option<f32> {
    let value = p.float(key, d)?;
    if is_valid(value) {
        return Some(value);
    }
    d.error(p.span_of(key), format!("{key} must be {where_}, not {value}"));
    None
}

/// One of `known`, by its name.
fn choice<T: Copy>(
    p: &ParamSet,
    key: &'static str,
    known: &[T],
    name: impl Fn(T) -> &'static str,
    d: &mut Diagnostics,
) -> Option<T> {
    let value = p.string(key, d)?.to_owned();
    let found = known.iter().copied().find(|&k| name(k) == value);
    if found.is_none() {
        let names: Vec<&str> = known.iter().map(|&k| name(k)).collect();
        d.error(p.span_of(key), format!("unknown {key} `{value}`")).help(format!("one of {}", names.join(", ")));
    }
    found
}

/// A number of samples or proposals.
fn count(p: &ParamSet, key: &'static str, d: &mut Diagnostics) -> Option<u32> {
    match p.integer(key, d)? {
        n @ 1..=4096 => Some(n as u32),
        n => {
            d.error(p.span_of(key), format!("{key} must be from 1 to 4096, not {n}"));
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::{LoadOptions, load};
    use crate::scene::Split;

    fn settings(integrator: &str) -> Result<IntegratorSettings, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.pbrt");
        std::fs::write(&path, format!("{integrator}\nWorldBegin\nShape \"sphere\"\n")).unwrap();
        load(&path, &LoadOptions::default()).map(|loaded| loaded.scene.integrator).map_err(|report| report.to_string())
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
        assert_eq!(s.split(), Split { samples: 2, proposals: 24 });
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
             \"float leastimportance\" 0.25 \"integer nearest\" 80 \"integer gather\" 0 \"float gatherguide\" 0.5 \"integer lightphotons\" 9000",
        )
        .unwrap();
        let photons = PhotonMapSettings {
            photons: 1_000_000,
            caustic_ratio: 0.5,
            deposition: Deposition::Floor(0.25),
            nearest: 80,
            gather: 0,
            guide: 0.5,
            light_photons: Some(9000),
            ..Default::default()
        };
        assert_eq!((s.kind, s.photons), (IntegratorKind::PhotonMap, photons));
        let s = settings("Integrator \"sppm\" \"float radius\" 0.5 \"integer photonsperiteration\" -1").unwrap();
        assert_eq!(s.photons.progressive, Some(Shrinking { radius: Some(0.5), ..Default::default() }));
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
    fn wrong_settings_of_the_irradiance_cache_are_errors() {
        for (parameter, message) in [
            ("\"string cached\" \"most\"", "one of indirect, all"),
            ("\"float cacheerror\" 1", "cacheerror must be above 0 and below 1, not 1"),
            ("\"float cacheminradius\" 0", "must be positive, and not 0 and 20"),
            ("\"float cacheminradius\" 9 \"float cachemaxradius\" 8", "the least one first"),
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
        assert_eq!((s.correlated.form, s.correlated.technique), (CorrelatedForm::Combined, SamplingTechnique::Bsdf));
        let s =
            settings("Integrator \"path\" \"string correlated\" \"crossfit\" \"string technique\" \"light\"").unwrap();
        assert_eq!((s.correlated.form, s.correlated.technique), (CorrelatedForm::Crossfit, SamplingTechnique::Light));
        for (parameter, message) in [
            ("\"string correlated\" \"half\"", "one of combined, crossfit"),
            ("\"string technique\" \"both\"", "one of bsdf, light"),
        ] {
            let report = settings(&format!("Integrator \"path\" {parameter}")).unwrap_err();
            assert!(report.contains(message), "{parameter}: {report}");
        }
    }

    #[test]
    fn settings_of_light_by_photons_are_read() {
        let s = settings("Integrator \"path\" \"string estimator\" \"contributing\" \"integer samples\" 8").unwrap();
        assert_eq!((s.estimator, s.contributing.rest_samples), (EstimatorKind::Contributing, 1));
        assert!(s.uses_light_hints() && !s.leaves_lights_out() && s.split() == Split { samples: 8, proposals: 8 });
        let s =
            settings("Integrator \"path\" \"string estimator\" \"contributing\" \"integer restsamples\" 0").unwrap();
        assert!(s.leaves_lights_out());
        let s = settings("Integrator \"path\" \"string lightsampler\" \"photons\"").unwrap();
        assert!(s.light_choice == LightSamplerKind::Photons && s.uses_light_hints() && !s.leaves_lights_out());
        let s = settings("Integrator \"path\" \"string target\" \"visibility\"").unwrap();
        assert!(s.ris.target == Target::Visibility && !s.uses_light_hints(), "the target is that of ris alone");
        let s = settings("Integrator \"path\" \"string estimator\" \"ris\" \"string target\" \"visibility\"").unwrap();
        assert!(s.uses_light_hints());
        let report = settings("Integrator \"path\" \"integer restsamples\" -1").unwrap_err();
        assert!(report.contains("restsamples must be from 0 to 4096, not -1"), "{report}");
    }

    #[test]
    fn wrong_settings_of_resampling_are_errors_that_say_what_is_possible() {
        for (parameter, message) in [
            ("\"string proposals\" \"many\"", "one of auto, optimal"),
            ("\"integer proposals\" 0", "proposals must be from 1 to 4096, not 0"),
            ("\"string strata\" \"some\"", "one of none, proposals, weights, systematic"),
            ("\"string target\" \"l\"", "one of fgl, gv, gvl"),
            ("\"string estimator\" \"rys\"", "one of mc, mis, ris, ocv, optimal-mis, correlated"),
        ] {
            let report = settings(&format!("Integrator \"path\" {parameter}")).unwrap_err();
            assert!(report.contains(message), "{parameter}: {report}");
        }
    }
}

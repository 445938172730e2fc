//! How direct light is estimated.

use super::{Applies, Group, MAX_SAMPLES, RESEARCH, Setting, choice, integer};
use crate::settings::EstimatorKind::{Auto, Contributing, Correlated, Mis, Ocv, OptimalMis, Ris};
use crate::settings::value::{Integers, Interval, Kind, Value};
use crate::settings::{
    EstimatorKind, OcvForm, OptimalForm, ProposalPoints, Proposals, SamplingTechnique, Strata, Target,
};
use lumiris_numbers::estimators::mis::Heuristic;
use lumiris_numbers::estimators::ocv::MAX_COMPONENTS;
use strum::VariantNames;

/// Samples of an estimate.
const SAMPLES: Integers = Integers { min: 1, max: MAX_SAMPLES };

/// Direct light.
pub(super) const DIRECT: Group = Group {
    title: "Direct light",
    rows: &[
        Setting {
            flag: "estimator",
            parameters: &["estimator"],
            key: "estimator",
            kind: choice(EstimatorKind::VARIANTS),
            help: "Estimator of direct light at path vertices, or `auto`: what a rule chooses from what the camera sees",
            get: |s| Some(Value::Name(s.integrator.estimator.into())),
            set: |s, v| v.named().map(|kind| s.integrator.estimator = kind),
            ..Setting::BASE
        },
        Setting {
            flag: "samples",
            value_name: "N",
            parameters: &["samples"],
            key: "samples",
            kind: Kind::Integer { range: SAMPLES, words: &["auto"] },
            help: "Samples per estimate (N): shadow rays per shading point, or `auto` for the estimator's default",
            default: "auto: what --estimator auto chooses; 2 for mc, and for mis with more than one bounce; otherwise 4; ris halves \
                      it at every bounce",
            get: |s| Some(s.integrator.samples.map_or(Value::Name("auto"), |n| Value::Integer(n.into()))),
            resolved: Some(|s| Some(Value::Integer(s.integrator.sample_counts().samples.into()))),
            set: |s, v| {
                s.integrator.samples = if v.name().is_some() { None } else { Some(v.count()?) };
                Some(())
            },
            ..Setting::BASE
        },
        Setting {
            flag: "later-samples",
            value_name: "N",
            parameters: &["latersamples"],
            key: "later_samples",
            kind: Kind::Integer { range: SAMPLES, words: &["auto"] },
            help: "Samples per estimate at later vertices of a path than the first",
            default: "auto: as many as at the first; ris halves them at every bounce",
            applies: Applies::If(|s| s.integrator.depth() > 1, "paths of more than one bounce"),
            get: |s| Some(s.integrator.later_samples.map_or(Value::Name("auto"), |n| Value::Integer(n.into()))),
            set: |s, v| {
                s.integrator.later_samples = if v.name().is_some() { None } else { Some(v.count()?) };
                Some(())
            },
            ..Setting::BASE
        },
        Setting {
            flag: "heuristic",
            parameters: &["heuristic"],
            key: "heuristic",
            kind: choice(Heuristic::VARIANTS),
            help: "MIS heuristic, which weights the techniques",
            default: "power; balance for ris, optimal-mis, and ocv unless over pixels",
            applies: Applies::Estimators(&[Auto, Mis, Ris, Ocv, OptimalMis, Contributing]),
            get: |s| s.integrator.heuristic.map(|h| Value::Name(h.into())),
            resolved: Some(|s| Some(Value::Name(s.integrator.heuristic().into()))),
            set: |s, v| v.named().map(|heuristic| s.integrator.heuristic = Some(heuristic)),
            ..Setting::BASE
        },
        Setting {
            flag: "bsdf-fraction",
            aliases: &["bsdf-share"],
            value_name: "FRACTION",
            parameters: &["bsdffraction"],
            old_parameters: &[("bsdffraction", "bsdfshare")],
            key: "bsdf_fraction",
            kind: Kind::Real { range: Interval::closed(0.0, 1.0), words: &[] },
            help: "Fraction of the samples drawn by BSDF sampling, for mis, ocv and optimal-mis",
            applies: Applies::Estimators(&[Mis, Ocv, OptimalMis]),
            default: "0.25 for mis and ocv over pixels, else 0.5",
            get: |s| s.integrator.bsdf_fraction.map(Value::Real),
            resolved: Some(|s| Some(Value::Real(s.integrator.bsdf_fraction()))),
            set: |s, v| v.real().map(|fraction| s.integrator.bsdf_fraction = Some(fraction)),
            ..Setting::BASE
        },
    ],
};

/// Resampling.
pub(super) const RIS: Group = Group {
    title: RESEARCH,
    rows: &[
        Setting {
            flag: "proposals",
            value_name: "M",
            parameters: &["proposals"],
            key: "proposals",
            kind: Kind::Integer { range: SAMPLES, words: &["auto", "optimal"] },
            help: "Proposals per estimate (M): a number, `auto` (three for each sample) or `optimal` (per pixel, from variances \
                   that a pilot finds)",
            applies: Applies::Estimators(&[Ris]),
            get: |s| {
                Some(match s.integrator.ris.proposals {
                    Proposals::Fixed(n) => Value::Integer(n.into()),
                    Proposals::Auto => Value::Name("auto"),
                    Proposals::Optimal => Value::Name("optimal"),
                })
            },
            resolved: Some(|s| {
                Some(match s.integrator.ris.proposals {
                    Proposals::Fixed(_) | Proposals::Auto => {
                        Value::Integer(s.integrator.sample_counts().proposals.into())
                    }
                    Proposals::Optimal => Value::Name("optimal"),
                })
            }),
            set: |s, v| {
                s.integrator.ris.proposals = match v.name() {
                    Some("auto") => Proposals::Auto,
                    Some(_) => Proposals::Optimal,
                    None => Proposals::Fixed(v.count()?),
                };
                Some(())
            },
            ..Setting::BASE
        },
        Setting {
            flag: "strata",
            is_option: false,
            parameters: &["strata"],
            key: "strata",
            kind: choice(Strata::VARIANTS),
            help: "How samples are drawn from the proposals: independently, stratified by the number or by the weight \
                   of the proposals, or by systematic resampling",
            applies: Applies::Estimators(&[Ris]),
            get: |s| Some(Value::Name(s.integrator.ris.strata.into())),
            set: |s, v| v.named().map(|strata| s.integrator.ris.strata = strata),
            ..Setting::BASE
        },
        Setting {
            flag: "proposal-points",
            is_option: false,
            parameters: &["proposalpoints"],
            key: "proposal_points",
            kind: choice(ProposalPoints::VARIANTS),
            help: "Distribution of the proposals over the lights",
            applies: Applies::Estimators(&[Ris]),
            get: |s| Some(Value::Name(s.integrator.ris.points.into())),
            set: |s, v| v.named().map(|points| s.integrator.ris.points = points),
            ..Setting::BASE
        },
        Setting {
            flag: "target",
            parameters: &["target"],
            key: "target",
            kind: choice(Target::VARIANTS),
            help: "Target density of resampling: f*G*L; with visibility V, where shading is more expensive than tracing rays; f*G*L with V estimated by the visibility cache (visibility), which may be a \
                   control variate as well (visibility-control)",
            applies: Applies::Estimators(&[Ris]),
            get: |s| Some(Value::Name(s.integrator.ris.target.into())),
            set: |s, v| v.named().map(|target| s.integrator.ris.target = target),
            ..Setting::BASE
        },
    ],
};

/// Contributing lights, control variates and optimal weights.
pub(super) const CONTROL_VARIATES: Group = Group {
    title: RESEARCH,
    rows: &[
        Setting {
            flag: "noncontributing-samples",
            aliases: &["rest-samples"],
            value_name: "N",
            parameters: &["noncontributingsamples"],
            old_parameters: &[("noncontributingsamples", "restsamples")],
            key: "noncontributing_samples",
            kind: integer(0, MAX_SAMPLES),
            help: "Samples of contributing on non-contributing lights, in addition to --samples on the contributing \
                   ones; 0 leaves these lights out, which is biased",
            default: "2; auto measures what is best",
            applies: Applies::Estimators(&[Contributing]),
            get: |s| s.integrator.contributing.noncontributing_samples.map(|n| Value::Integer(n.into())),
            resolved: Some(|s| Some(Value::Integer(s.integrator.contributing.noncontributing_samples().into()))),
            set: |s, v| v.count().map(|n| s.integrator.contributing.noncontributing_samples = Some(n)),
            ..Setting::BASE
        },
        Setting {
            flag: "contributing-bsdf-samples",
            is_option: false,
            value_name: "N",
            parameters: &["contributingbsdfsamples"],
            key: "contributing_bsdf_samples",
            kind: integer(0, MAX_SAMPLES),
            help: "BSDF samples of contributing on surfaces that are not diffuse, combined with its light samples by \
                   --heuristic; 0 takes light samples alone, as --noncontributing-samples 0 does",
            default: "1",
            applies: Applies::If(
                |s| s.integrator.estimator == Contributing && !s.integrator.leaves_lights_out(),
                "the estimator contributing with samples on non-contributing lights",
            ),
            get: |s| s.integrator.contributing.bsdf_samples.map(|n| Value::Integer(n.into())),
            resolved: Some(|s| Some(Value::Integer(s.integrator.contributing.bsdf_samples().into()))),
            set: |s, v| v.count().map(|n| s.integrator.contributing.bsdf_samples = Some(n)),
            ..Setting::BASE
        },
        Setting {
            flag: "ocv",
            value_name: "FORM",
            parameters: &["ocv"],
            key: "ocv",
            kind: choice(OcvForm::VARIANTS),
            help: "What ocv fits the coefficients of its control variates to: the surrounding pixels, earlier samples of \
                   the pixel, or (biased) the same samples",
            applies: Applies::Estimators(&[Ocv]),
            get: |s| Some(Value::Name(s.integrator.ocv.form.into())),
            set: |s, v| v.named().map(|form| s.integrator.ocv.form = form),
            ..Setting::BASE
        },
        Setting {
            flag: "components",
            is_option: false,
            value_name: "M",
            parameters: &["components"],
            key: "components",
            kind: integer(2, MAX_COMPONENTS as u64),
            help: "Maximum number of components of the mixture of ocv and optimal-mis: BSDF lobes and groups of lights",
            default: "8, the maximum",
            applies: Applies::Estimators(&[Ocv, OptimalMis]),
            get: |s| s.integrator.ocv.components.map(|n| Value::Integer(n.into())),
            resolved: Some(|s| Some(Value::Integer(s.integrator.ocv.max_components() as u64))),
            set: |s, v| v.count().map(|n| s.integrator.ocv.components = Some(n)),
            ..Setting::BASE
        },
        Setting {
            flag: "optimal-mis",
            value_name: "FORM",
            parameters: &["optimalmis"],
            key: "optimal_mis",
            kind: choice(OptimalForm::VARIANTS),
            help: "How optimal-mis determines its weights: from earlier samples of the pixel, or (biased) from the \
                   same samples",
            applies: Applies::Estimators(&[OptimalMis]),
            get: |s| Some(Value::Name(s.integrator.optimal_mis.into())),
            set: |s, v| v.named().map(|form| s.integrator.optimal_mis = form),
            ..Setting::BASE
        },
        Setting {
            flag: "technique",
            is_option: false,
            parameters: &["technique"],
            key: "technique",
            kind: choice(SamplingTechnique::VARIANTS),
            help: "Sampling technique of correlated",
            applies: Applies::Estimators(&[Correlated]),
            get: |s| Some(Value::Name(s.integrator.correlated_technique.into())),
            set: |s, v| v.named().map(|technique| s.integrator.correlated_technique = technique),
            ..Setting::BASE
        },
    ],
};

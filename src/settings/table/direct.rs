//! Settings of direct light.

use super::setting::{Applies, Group, MAX_SAMPLES, RESEARCH, Setting, choice};
use crate::settings::EstimatorKind::{Auto, Contributing, Correlated, Mis, Ocv, OptimalMis, Ris};
use crate::settings::value::{Integers, Interval, Kind, Value};
use crate::settings::{
    EstimatorKind, OcvForm, OptimalForm, ProposalPoints, Proposals, SamplingTechnique, Strata, Target,
};
use lumiris_numbers::estimators::heuristics::Heuristic;
use lumiris_numbers::estimators::ocv::MAX_COMPONENTS;
use strum::VariantNames;

/// Direct light.
pub(super) const DIRECT: Group = Group {
    title: "Direct light",
    rows: &[
        Setting {
            flag: "estimator",
            parameters: &["estimator"],
            help: "Estimator of direct light at path vertices, or `auto`: chosen by a rule from the surfaces visible to the camera",
            ..row!(named("estimator", EstimatorKind, integrator.estimator))
        },
        Setting {
            flag: "samples",
            parameters: &["samples"],
            help: "Samples per estimate (N): shadow rays per shading point, or `auto` for the estimator's default",
            default: "auto: chosen by --estimator auto; otherwise 2 for mc, and for mis with more than one bounce, else 4; ris \
                      halves it at every bounce",
            resolved: Some(|s| Some(Value::Integer(s.integrator.sample_counts().samples.into()))),
            ..row!(count_or("auto", "samples", 1, MAX_SAMPLES, integrator.samples))
        },
        Setting {
            flag: "later-samples",
            parameters: &["latersamples"],
            help: "Samples per estimate at later vertices of a path than the first",
            default: "auto: the number at the first vertex; ris halves it at every bounce",
            applies: Applies::If(|s| s.integrator.depth() > 1, "paths of more than one bounce"),
            ..row!(count_or("auto", "later_samples", 1, MAX_SAMPLES, integrator.later_samples))
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
            help: "Fraction of the samples drawn by BSDF sampling, for mis, ocv and optimal-mis",
            applies: Applies::Estimators(&[Mis, Ocv, OptimalMis]),
            default: "0.25 for mis and ocv over pixels, else 0.5",
            resolved: Some(|s| Some(Value::Real(s.integrator.bsdf_fraction()))),
            ..row!(open_real("bsdf_fraction", Interval::closed(0.0, 1.0), integrator.bsdf_fraction))
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
            kind: Kind::Integer { range: Integers { min: 1, max: MAX_SAMPLES }, words: &["auto", "optimal"] },
            help: "Proposals per estimate (M): a number, `auto` (three for each sample) or `optimal` (per pixel, from variances \
                   measured by a pilot)",
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
            help: "How samples are drawn from the proposals: independently, stratified by the number or by the weight \
                   of the proposals, or by systematic resampling",
            applies: Applies::Estimators(&[Ris]),
            ..row!(named("strata", Strata, integrator.ris.strata))
        },
        Setting {
            flag: "proposal-points",
            is_option: false,
            parameters: &["proposalpoints"],
            help: "Distribution of the proposals over the lights",
            applies: Applies::Estimators(&[Ris]),
            ..row!(named("proposal_points", ProposalPoints, integrator.ris.points))
        },
        Setting {
            flag: "target",
            parameters: &["target"],
            help: "Target density of resampling: f*G*L (fgl); G*V or G*V*L with traced visibility V (gv, gvl), where shading \
                   costs more than tracing rays; f*G*L*V with V estimated by the visibility cache (visibility), also as a \
                   control variate (visibility-control)",
            applies: Applies::Estimators(&[Ris]),
            ..row!(named("target", Target, integrator.ris.target))
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
            parameters: &["noncontributingsamples"],
            old_parameters: &[("noncontributingsamples", "restsamples")],
            help: "Samples of contributing on non-contributing lights, in addition to --samples on the contributing \
                   ones; 0 leaves these lights out, which is biased",
            default: "2; 1 or 2 chosen by --estimator auto",
            applies: Applies::Estimators(&[Contributing]),
            resolved: Some(|s| Some(Value::Integer(s.integrator.contributing.noncontributing_samples().into()))),
            ..row!(open_count(
                "noncontributing_samples",
                0,
                MAX_SAMPLES,
                integrator.contributing.noncontributing_samples
            ))
        },
        Setting {
            flag: "contributing-bsdf-samples",
            is_option: false,
            parameters: &["contributingbsdfsamples"],
            help: "BSDF samples of contributing on surfaces that are not diffuse, combined with its light samples by \
                   --heuristic; 0 takes light samples alone, as --noncontributing-samples 0 does",
            default: "1",
            applies: Applies::If(
                |s| s.integrator.estimator == Contributing && !s.integrator.leaves_lights_out(),
                "the estimator contributing with samples on non-contributing lights",
            ),
            resolved: Some(|s| Some(Value::Integer(s.integrator.contributing.bsdf_samples().into()))),
            ..row!(open_count("contributing_bsdf_samples", 0, MAX_SAMPLES, integrator.contributing.bsdf_samples))
        },
        Setting {
            flag: "ocv",
            value_name: "FORM",
            parameters: &["ocv"],
            help: "Samples to which ocv fits the coefficients of its control variates: of the surrounding pixels, earlier ones \
                   of the pixel, or (biased) the same ones",
            applies: Applies::Estimators(&[Ocv]),
            ..row!(named("ocv", OcvForm, integrator.ocv.form))
        },
        Setting {
            flag: "components",
            is_option: false,
            value_name: "M",
            parameters: &["components"],
            help: "Maximum number of components of the mixture of ocv and optimal-mis: BSDF lobes and groups of lights",
            default: "8, the maximum",
            applies: Applies::Estimators(&[Ocv, OptimalMis]),
            resolved: Some(|s| Some(Value::Integer(s.integrator.ocv.max_components() as u64))),
            ..row!(open_count("components", 2, MAX_COMPONENTS as u64, integrator.ocv.components))
        },
        Setting {
            flag: "optimal-mis",
            value_name: "FORM",
            parameters: &["optimalmis"],
            help: "How optimal-mis determines its weights: from earlier samples of the pixel, or (biased) from the \
                   same samples",
            applies: Applies::Estimators(&[OptimalMis]),
            ..row!(named("optimal_mis", OptimalForm, integrator.optimal_mis))
        },
        Setting {
            flag: "technique",
            is_option: false,
            parameters: &["technique"],
            help: "Sampling technique of correlated",
            applies: Applies::Estimators(&[Correlated]),
            ..row!(named("technique", SamplingTechnique, integrator.correlated_technique))
        },
    ],
};

//! Settings of the integrator and of random numbers.

use super::setting::{Applies, Directive, Group, MAX_SAMPLES, MAX_U32, Setting, choice};
use crate::bsdfs::ProposalDensity;
use crate::lights::LightSamplerKind;
use crate::settings::value::{Interval, Kind, Value};
use crate::settings::{Allocation, IntegratorKind};
use lumiris_numbers::samplers::SamplerKind;
use strum::VariantNames;

const PATHS: Applies = Applies::If(
    |s| s.integrator.kind == IntegratorKind::Path && s.integrator.depth() > 1,
    "the integrator path with more than one bounce",
);

/// Light transport.
pub(super) const TRANSPORT: Group = Group {
    title: "Light transport",
    rows: &[
        Setting {
            flag: "integrator",
            key: "integrator",
            kind: choice(IntegratorKind::VARIANTS),
            help: "Light transport algorithm",
            get: |s| Some(Value::Name(s.integrator.kind.into())),
            set: |s, v| {
                s.integrator.kind = v.named()?;
                // One bounce, unless a depth follows
                if s.integrator.kind == IntegratorKind::Direct {
                    s.integrator.max_depth = 1;
                }
                Some(())
            },
            ..Setting::BASE
        },
        Setting {
            flag: "max-depth",
            value_name: "D",
            parameters: &["maxdepth"],
            help: "Maximum number of bounces; `direct` has at most one",
            resolved: Some(|s| Some(Value::Integer(s.integrator.depth().into()))),
            ..row!(count("max_depth", 0, 10_000, integrator.max_depth))
        },
        Setting {
            flag: "roulette-depth",
            value_name: "D",
            parameters: &["roulettedepth"],
            help: "First bounce that Russian roulette may end a path before, or `off`: fewer and noisier paths in less \
                   time, or all of them up to the maximum number of bounces",
            applies: Applies::If(|s| s.integrator.depth() > 1, "paths of more than one bounce"),
            ..row!(count_or("off", "roulette_depth", 1, 10_000, integrator.roulette_depth))
        },
        Setting {
            flag: "path-reuse",
            value_name: "E",
            parameters: &["pathreuse"],
            help: "Edge of the blocks of E × E pixels that share their paths from the second diffuse vertex on, at the cost of \
                   E² − 1 shadow rays per path: less noise, which is correlated within a block; 1: no sharing",
            default: "auto: chosen by --estimator auto, otherwise 1",
            applies: PATHS,
            resolved: Some(|s| Some(Value::Integer(s.integrator.path_reuse.unwrap_or(1).into()))),
            ..row!(count_or("auto", "path_reuse", 1, 16, integrator.path_reuse))
        },
        Setting {
            flag: "light-paths",
            value_name: "N",
            parameters: &["lightpaths"],
            key: "light_paths",
            kind: Kind::Real { range: Interval::closed(0.0, 64.0), words: &["auto"] },
            help: "Light paths per camera sample, for caustics: light from emitting surfaces by way of metal and glass to \
                   diffuse surfaces, which camera paths find only by chance. MIS combines both; 0: none",
            default: "auto: chosen by --estimator auto, otherwise 0",
            applies: Applies::Integrators(&[IntegratorKind::Path]),
            get: |s| Some(s.integrator.light_paths.map_or(Value::Name("auto"), Value::Real)),
            resolved: Some(|s| Some(Value::Real(s.integrator.light_paths.unwrap_or(0.0)))),
            set: |s, v| {
                s.integrator.light_paths = if v.name().is_some() { None } else { Some(v.real()?) };
                Some(())
            },
            ..Setting::BASE
        },
        Setting {
            flag: "light-groups",
            value_name: "KIND",
            parameters: &["lightgroups"],
            key: "light_groups",
            kind: Kind::Choice { names: &["layers", "none"], synonyms: &[] },
            help: "Layers of the image for light groups (\"string lightgroup\" of a light): light_NAME.R, .G and .B for each \
                   group, which add up to the image; or none",
            get: |s| Some(Value::Name(if s.integrator.light_groups { "layers" } else { "none" })),
            set: |s, v| v.name().map(|name| s.integrator.light_groups = name == "layers"),
            ..Setting::BASE
        },
        Setting {
            flag: "light-sampler",
            aliases: &["light-choice"],
            parameters: &["lightsampler"],
            key: "light_sampler",
            kind: Kind::Choice {
                names: LightSamplerKind::VARIANTS,
                synonyms: &[("bvh", "tree"), ("exhaustive", "tree"), ("spatial", "tree")],
            },
            help: "How lights are chosen: uniformly, by power, by a light tree, or mostly among the contributing \
                   lights that the visibility cache finds (photons)",
            get: |s| Some(Value::Name(s.integrator.light_sampler.into())),
            set: |s, v| v.named().map(|kind| s.integrator.light_sampler = kind),
            ..Setting::BASE
        },
        Setting {
            flag: "infinite-fraction",
            value_name: "FRACTION",
            parameters: &["infinitefraction"],
            help: "Fraction of the light samples by the light tree that go to lights at infinity: skies and suns",
            applies: Applies::If(|s| s.integrator.has_light_tree(), "the light samplers tree and photons"),
            default: "each has the probability of all other lights together; --estimator auto measures it",
            ..row!(open_real("infinite_fraction", Interval::open(0.0, 1.0), integrator.infinite_fraction))
        },
        Setting {
            flag: "bsdf-proposals",
            is_option: false,
            value_name: "M",
            parameters: &["bsdfproposals"],
            help: "Proposals per bounce off materials whose BSDF can only be evaluated, not sampled",
            ..row!(count("bsdf_proposals", 1, MAX_SAMPLES, integrator.bsdf_proposals))
        },
        Setting {
            flag: "bsdf-density",
            is_option: false,
            parameters: &["bsdfdensity"],
            help: "Sampling density of these proposals",
            ..row!(named("bsdf_density", ProposalDensity, integrator.bsdf_density))
        },
    ],
};

/// Random numbers.
pub(super) const SAMPLING: Group = Group {
    title: "Sampling",
    rows: &[
        Setting {
            flag: "sampler",
            directive: Directive::Sampler,
            help: "Sample sequence",
            ..row!(named("sampler", SamplerKind, sampling.sampler))
        },
        Setting {
            flag: "spp",
            value_name: "K",
            directive: Directive::Sampler,
            parameters: &["pixelsamples"],
            help: "Camera samples per pixel. With adaptive sampling (--allocation), the image takes the time of about as many \
                   in each pixel; if pixels share paths (--path-reuse), this is the minimum, and noisy pixels have 2, 4 or \
                   8 times as many. With --noise, the maximum",
            ..row!(count("spp", 1, MAX_U32, sampling.spp))
        },
        Setting {
            flag: "allocation",
            directive: Directive::Sampler,
            parameters: &["allocation"],
            help: "Distribution of the camera samples over the pixels: the same number for each, or more where a pilot \
                   measures more noise (see --spp). Adaptive counts are for the integrators direct and path, \
                   from 8 samples per pixel on",
            default: "auto: adaptive with --estimator auto, otherwise uniform",
            resolved: Some(|s| Some(Value::Name(s.allocation().into()))),
            ..row!(named("allocation", Allocation, sampling.allocation))
        },
        Setting {
            flag: "noise",
            value_name: "X",
            directive: Directive::Sampler,
            parameters: &["noise"],
            key: "noise",
            kind: Kind::Percentage { words: &["off"] },
            help: "Target standard error of every block of 16 x 16 pixels, relative to its mean luminance plus 0.01, such as \
                   2% or 0.02: an aim, not a guarantee. A pilot estimates the samples that each block needs; --spp is the \
                   maximum, 4096 unless given as an option. For the integrators direct and path",
            default: "off",
            get: |s| Some(s.sampling.noise.map_or(Value::Name("off"), Value::Real)),
            set: |s, v| {
                s.sampling.noise = if v.name().is_some() { None } else { Some(v.real()?) };
                Some(())
            },
            ..Setting::BASE
        },
        Setting {
            flag: "footprint-spp",
            is_option: false,
            value_name: "K",
            directive: Directive::Sampler,
            parameters: &["footprintspp"],
            help: "Camera samples per pixel that texture filtering assumes: the footprint is 1/sqrt(K) of a pixel \
                   wide, at least an eighth. For an image that is rendered in parts, give the total of all parts",
            default: "--spp",
            resolved: Some(|s| Some(Value::Integer(s.sampling.footprint_spp().into()))),
            ..row!(open_count("footprint_spp", 1, MAX_U32, sampling.footprint_spp))
        },
        Setting {
            flag: "pilot-spp",
            is_option: false,
            value_name: "K",
            directive: Directive::Sampler,
            parameters: &["pilotspp"],
            help: "Camera samples per pixel that determine the length of pilots, if less than --spp: pilots take a fraction of \
                   their time",
            default: "--spp; with --time at most 64, fewer if the time per pixel is short",
            ..row!(open_count("pilot_spp", 1, MAX_U32, sampling.pilot_spp))
        },
        Setting {
            flag: "seed",
            value_name: "S",
            directive: Directive::Sampler,
            parameters: &["seed"],
            help: "Random seed; images with different seeds are independent",
            ..row!(count("seed", 0, MAX_U32, sampling.seed))
        },
    ],
};

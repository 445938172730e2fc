//! Options that several subcommands share, as typed.

use super::photon_args::PhotonArgs;
use clap::{Args, ValueEnum};
use lumiris::bsdfs::ProposalDensity;
use lumiris::lights::LightSamplerKind;
use lumiris::render::output::Aov;
use lumiris::scene::{
    AccelKind, Cached, CorrelatedForm, EstimatorKind, IntegratorKind, IrradianceCacheSettings, OptimalForm,
    ProposalPoints, Proposals, SamplingTechnique, StageTimes, Strata, Target,
};
use lumiris_numbers::estimators::mis::Heuristic;
use lumiris_numbers::estimators::ocv::Form;
use lumiris_numbers::samplers::SamplerKind;
use std::path::PathBuf;

/// Declares a `ValueEnum` of the names that a type's `name()` gives.
macro_rules! choices {
    ($(#[$doc:meta])* $choice:ident => $target:ty { $($variant:ident => $value:expr),+ $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        pub enum $choice { $(#[doc = stringify!($variant)] $variant),+ }

        impl $choice {
            /// The value that the rest of the program uses.
            pub fn value(self) -> $target {
                match self { $($choice::$variant => $value),+ }
            }
        }

        impl ValueEnum for $choice {
            fn value_variants<'a>() -> &'a [Self] {
                &[$($choice::$variant),+]
            }

            fn to_possible_value(&self) -> Option<clap::builder::PossibleValue> {
                Some(clap::builder::PossibleValue::new(self.value().name()))
            }
        }
    };
}

choices!(
    /// `--integrator`
    IntegratorArg => IntegratorKind {
        Direct => IntegratorKind::Direct,
        Path => IntegratorKind::Path,
        IrradianceCache => IntegratorKind::IrradianceCache,
        PhotonMap => IntegratorKind::PhotonMap,
    }
);
choices!(
    /// `--cached`
    CachedArg => Cached { Indirect => Cached::Indirect, All => Cached::All }
);
choices!(
    /// `--estimator`
    EstimatorArg => EstimatorKind {
        Mc => EstimatorKind::Mc,
        Mis => EstimatorKind::Mis,
        Ris => EstimatorKind::Ris,
        Ocv => EstimatorKind::Ocv,
        OptimalMis => EstimatorKind::OptimalMis,
        Correlated => EstimatorKind::Correlated,
        Contributing => EstimatorKind::Contributing,
    }
);
choices!(
    /// `--ocv`
    OcvArg => Form {
        Progressive => Form::Progressive,
        Crossfit => Form::Crossfit,
        Regression => Form::Regression,
        Paper => Form::Paper,
    }
);
choices!(
    /// `--optimal-mis`
    OptimalMisArg => OptimalForm { Progressive => OptimalForm::Progressive, Direct => OptimalForm::Direct }
);
choices!(
    /// `--correlated`
    CorrelatedArg => CorrelatedForm { Combined => CorrelatedForm::Combined, Crossfit => CorrelatedForm::Crossfit }
);
choices!(
    /// `--technique`
    TechniqueArg => SamplingTechnique { Bsdf => SamplingTechnique::Bsdf, Light => SamplingTechnique::Light }
);
choices!(
    /// `--heuristic`
    HeuristicArg => Heuristic { Balance => Heuristic::Balance, Power => Heuristic::Power, Maximum => Heuristic::Maximum }
);
choices!(
    /// `--strata`
    StrataArg => Strata {
        None => Strata::None,
        Proposals => Strata::Proposals,
        Weights => Strata::Weights,
        Systematic => Strata::Systematic,
    }
);
choices!(
    /// `--proposal-points`
    ProposalPointsArg => ProposalPoints {
        Independent => ProposalPoints::Independent,
        Stratified => ProposalPoints::Stratified,
    }
);
choices!(
    /// `--target`
    TargetArg => Target {
        Fgl => Target::Fgl,
        Gv => Target::Gv,
        Gvl => Target::Gvl,
        Visibility => Target::Visibility,
    }
);
choices!(
    /// `--light-choice`
    LightChoiceArg => LightSamplerKind {
        Uniform => LightSamplerKind::Uniform,
        Power => LightSamplerKind::Power,
        Tree => LightSamplerKind::Tree,
        Photons => LightSamplerKind::Photons,
    }
);
choices!(
    /// `--bsdf-density`
    BsdfDensityArg => ProposalDensity { Lobes => ProposalDensity::Lobes, Uniform => ProposalDensity::Uniform }
);
choices!(
    /// `--sampler`
    SamplerArg => SamplerKind {
        Independent => SamplerKind::Independent,
        Stratified => SamplerKind::Stratified,
        Sobol => SamplerKind::Sobol,
        Zsobol => SamplerKind::SobolBlueNoise,
    }
);
choices!(
    /// `--accel`
    AccelArg => AccelKind { Embree => AccelKind::Embree, Bvh => AccelKind::Bvh }
);
choices!(
    /// `--aov`
    AovArg => Aov {
        Variance => Aov::Variance,
        Samples => Aov::Samples,
        Albedo => Aov::Albedo,
        Normal => Aov::Normal,
        Depth => Aov::Depth,
        Material => Aov::Material,
        Object => Aov::Object,
        Ratio => Aov::Ratio,
        Records => Aov::Records,
    }
);

/// What a scene file says and the command line overrides.
#[derive(Args, Clone, Debug)]
pub struct SceneArgs {
    /// Scene file (.pbrt or .pbrt.gz)
    pub scene: PathBuf,
    /// What is computed [default: the file's]
    #[arg(long)]
    pub integrator: Option<IntegratorArg>,
    /// Direct-light estimator [default: the file's, or mis]
    #[arg(long)]
    pub estimator: Option<EstimatorArg>,
    /// Samples per estimate: shadow segments per shading point, or `auto` for the estimator's own number
    /// [default: the file's, or auto: 2, or 4 for ris, which halves them with every bounce]
    #[arg(long, value_name = "N", value_parser = parse_samples)]
    pub samples: Option<SamplesArg>,
    /// Proposals per estimate of ris: a number, `auto` (by the measured times of stages) or `optimal` (per pixel, by times
    /// and variances) [default: the file's, or auto]
    #[arg(long, value_name = "M", value_parser = parse_proposals)]
    pub proposals: Option<Proposals>,
    /// How ris draws its samples from the proposals [default: the file's, or systematic]
    #[arg(long)]
    pub strata: Option<StrataArg>,
    /// How the proposals of ris lie on the lights [default: the file's, or stratified]
    #[arg(long)]
    pub proposal_points: Option<ProposalPointsArg>,
    /// What ris draws samples in proportion to: f*G*L, with visibility V where shading is dearer than rays, or
    /// (visibility) f*G*L with an estimate of V by photons [default: the file's, or fgl]
    #[arg(long)]
    pub target: Option<TargetArg>,
    /// Nanoseconds of a proposal and of a sample, from which `auto` and `optimal` choose [default: measured on this scene]
    #[arg(long, value_name = "T1,T2", value_parser = parse_stage_times)]
    pub stage_times: Option<StageTimes>,
    /// How ocv finds the coefficients of its control variates: from earlier samples of the pixel, from the other half of the
    /// samples, or (biased) from the same samples [default: the file's, or progressive]
    #[arg(long, value_name = "FORM")]
    pub ocv: Option<OcvArg>,
    /// How optimal-mis finds its weights: from earlier samples of the pixel, or (biased) from the same samples
    /// [default: the file's, or progressive]
    #[arg(long, value_name = "FORM")]
    pub optimal_mis: Option<OptimalMisArg>,
    /// How correlated weighs its two estimates: from the same samples (biased), or from the other half of them
    /// [default: the file's, or combined]
    #[arg(long, value_name = "FORM")]
    pub correlated: Option<CorrelatedArg>,
    /// What draws the samples of correlated [default: the file's, or bsdf]
    #[arg(long)]
    pub technique: Option<TechniqueArg>,
    /// Most components of the mixture of ocv and optimal-mis: lobes of BSDFs and groups of lights [default: the file's, or 8]
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u32).range(2..=8))]
    pub components: Option<u32>,
    /// Samples of contributing on the lights that no photon came from, besides --samples on the others; 0 leaves these lights
    /// out, which is biased [default: the file's, or 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=4096))]
    pub rest_samples: Option<u32>,
    /// Share of the samples that the BSDF draws, for mis, ocv and optimal-mis [default: the file's, or 0.5]
    #[arg(long, value_name = "SHARE", value_parser = parse_share)]
    pub bsdf_share: Option<f32>,
    /// Weights of the techniques [default: the file's, or power; balance for ris]
    #[arg(long)]
    pub heuristic: Option<HeuristicArg>,
    /// How a light is chosen; by photons, mostly among those that photons have come from
    /// [default: the file's lightsampler, or tree]
    #[arg(long)]
    pub light_choice: Option<LightChoiceArg>,
    /// Directions proposed per bounce off materials that can only be evaluated [default: the file's, or 4]
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub bsdf_proposals: Option<u32>,
    /// What proposes directions for such materials [default: the file's, or lobes]
    #[arg(long)]
    pub bsdf_density: Option<BsdfDensityArg>,
    /// What the records of irradiance-cache hold: indirect light, or direct light too [default: the file's, or indirect]
    #[arg(long)]
    pub cached: Option<CachedArg>,
    /// Error at which a record of irradiance-cache no longer serves: a share of the mean distance of what it sees
    /// [default: the file's, or 0.25]
    #[arg(long, value_name = "KAPPA", value_parser = parse_cache_error)]
    pub cache_error: Option<f32>,
    /// Least and greatest distance, in pixels, up to which a record serves [default: the file's, or 3,20]
    #[arg(long, value_name = "MIN,MAX", value_parser = parse_cache_radius)]
    pub cache_radius: Option<[f32; 2]>,
    /// Directions in which a record samples indirect light [default: the file's, or 256]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(8..=65_536))]
    pub cache_samples: Option<u32>,
    /// Estimates of direct light at a record, with `--cached all` [default: the file's, or 4]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub cache_passes: Option<u32>,
    #[command(flatten)]
    pub photons: PhotonArgs,
    /// Bounces of light, but for `direct` [default: the file's, or 5]
    #[arg(long, value_name = "D", value_parser = clap::value_parser!(u32).range(0..=10_000))]
    pub max_depth: Option<u32>,
    /// Camera samples per pixel [default: the file's, or 16]
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..=1_000_000_000))]
    pub spp: Option<u32>,
    /// Random sequence [default: the file's sampler, or zsobol]
    #[arg(long)]
    pub sampler: Option<SamplerArg>,
    /// Pictures of different seeds are independent [default: the file's, or 0]
    #[arg(long, value_name = "S")]
    pub seed: Option<u32>,
    /// Size of the picture, such as 640x480 [default: the file's]
    #[arg(long, value_name = "WxH", value_parser = parse_resolution)]
    pub resolution: Option<[u32; 2]>,
    /// The part that is rendered, in fractions of the picture [default: the file's]
    #[arg(long, value_name = "X0,X1,Y0,Y1", value_parser = parse_crop)]
    pub crop: Option<[f32; 4]>,
    /// Replace the file's pixel filter by a box of one pixel
    #[arg(long)]
    pub box_filter: bool,
    /// Ray tracer
    #[arg(long, default_value = "embree")]
    pub accel: AccelArg,
    /// Rays per Embree packet; changes speed, not the picture [default: the processor's native width]
    #[arg(long, value_name = "W", value_parser = parse_packet_width)]
    pub packet_width: Option<u32>,
    /// Threads [default: all cores]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub threads: Option<u32>,
    /// Edge of a tile in pixels; changes speed, not the picture
    #[arg(long, value_name = "PIXELS", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub tile_size: u32,
}

/// `lumiris render`
#[derive(Args, Clone, Debug)]
pub struct RenderArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Where to write; may be given several times. EXR holds everything; PNG, JPEG, TIFF and TGA what a display shows
    /// [default: the name in the file, or SCENE.exr]
    #[arg(short, long, value_name = "FILE")]
    pub output: Vec<PathBuf>,
    /// Stop after the pass in which this many seconds run out
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    pub time: Option<f64>,
    /// Channels beside the picture, in EXR [default: all, and ratio with --proposals optimal]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub aov: Option<Vec<AovArg>>,
    /// Exposure of what a display shows (PNG and its like), in stops
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_negative_numbers = true)]
    pub exposure: f32,
    /// Write seconds and counts of every stage
    #[arg(long, value_name = "FILE.json")]
    pub stats: Option<PathBuf>,
    /// No progress, only warnings and errors
    #[arg(short, long)]
    pub quiet: bool,
}

/// `--samples`
#[derive(Clone, Copy, Debug)]
pub enum SamplesArg {
    /// This many.
    Fixed(u32),
    /// The estimator's choice.
    Auto,
}

/// Most samples and proposals of an estimate.
const MAX_SAMPLES: u32 = 4096;

fn parse_count(text: &str, words: &str) -> Result<u32, String> {
    match text.parse::<u32>() {
        Ok(n @ 1..=MAX_SAMPLES) => Ok(n),
        _ => Err(format!("expected a whole number from 1 to {MAX_SAMPLES}, or {words}")),
    }
}

fn parse_samples(text: &str) -> Result<SamplesArg, String> {
    match text {
        "auto" => Ok(SamplesArg::Auto),
        _ => parse_count(text, "auto").map(SamplesArg::Fixed),
    }
}

fn parse_proposals(text: &str) -> Result<Proposals, String> {
    match text {
        "auto" => Ok(Proposals::Auto),
        "optimal" => Ok(Proposals::Optimal),
        _ => parse_count(text, "auto, or optimal").map(Proposals::Fixed),
    }
}

fn parse_stage_times(text: &str) -> Result<StageTimes, String> {
    let times: Vec<f64> = text.split(',').filter_map(|t| t.trim().parse().ok()).collect();
    match times[..] {
        [t1, t2] if t1 > 0.0 && t2 > 0.0 && t1.is_finite() && t2.is_finite() => Ok(StageTimes { t1, t2 }),
        _ => Err("expected two positive numbers of nanoseconds T1,T2".to_owned()),
    }
}

fn parse_cache_error(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(error) if IrradianceCacheSettings::is_error(error) => Ok(error),
        _ => Err("expected a number above 0 and below 1".to_owned()),
    }
}

fn parse_cache_radius(text: &str) -> Result<[f32; 2], String> {
    let pixels: Vec<f32> = text.split(',').filter_map(|t| t.trim().parse().ok()).collect();
    match pixels[..] {
        [min, max] if IrradianceCacheSettings::is_radius([min, max]) => Ok([min, max]),
        _ => Err("expected two numbers of pixels MIN,MAX, 0 < MIN <= MAX".to_owned()),
    }
}

fn parse_resolution(text: &str) -> Result<[u32; 2], String> {
    let (w, h) = text.split_once(['x', 'X']).ok_or("expected WIDTHxHEIGHT, such as 640x480")?;
    let parse = |s: &str| match s.trim().parse::<u32>() {
        Ok(n @ 1..=65_536) => Ok(n),
        _ => Err(format!("`{s}` is not a whole number from 1 to 65536")),
    };
    Ok([parse(w)?, parse(h)?])
}

fn parse_crop(text: &str) -> Result<[f32; 4], String> {
    let values: Vec<f32> = text
        .split(',')
        .map(|s| s.trim().parse().map_err(|_| format!("`{s}` is not a number")))
        .collect::<Result<_, _>>()?;
    match values[..] {
        [x0, x1, y0, y1] if 0.0 <= x0 && x0 < x1 && x1 <= 1.0 && 0.0 <= y0 && y0 < y1 && y1 <= 1.0 => {
            Ok([x0, x1, y0, y1])
        }
        [_, _, _, _] => Err("expected 0 <= X0 < X1 <= 1 and 0 <= Y0 < Y1 <= 1".to_owned()),
        _ => Err("expected four numbers X0,X1,Y0,Y1".to_owned()),
    }
}

fn parse_share(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(s) if (0.0..=1.0).contains(&s) => Ok(s),
        _ => Err("expected a number from 0 to 1".to_owned()),
    }
}

fn parse_packet_width(text: &str) -> Result<u32, String> {
    match text {
        "1" => Ok(1),
        "4" => Ok(4),
        "8" => Ok(8),
        _ => Err("expected 1, 4 or 8".to_owned()),
    }
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(s) if s > 0.0 && s.is_finite() => Ok(s),
        _ => Err("expected a positive number of seconds".to_owned()),
    }
}

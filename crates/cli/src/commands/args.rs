//! Options that several subcommands share, as typed.

use super::denoise_args::DenoiseArgs;
use super::exr::ExrArgs;
use super::frame_list::{FrameList, FrameOf, parse_frames};
use super::look::LookArgs;
use super::memory::{MemoryLimit, parse_limit};
use super::named::named;
use super::output_options::OutputOptions;
use super::part_args::{LONGEST, PartArgs};
use super::settings_args::SettingsArgs;
use super::watch_args::WatchArgs;
use clap::builder::{BoolishValueParser, PossibleValuesParser, TypedValueParser};
use clap::{Arg, ArgAction, Args};
use lumiris::import::LoadOptions;
use lumiris::import::gltf::LightUnits;
use lumiris::render::output::Aov;
use lumiris::scene::AccelKind;
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use strum::VariantNames;

/// An AOV, or none.
pub(super) fn aov() -> impl TypedValueParser<Value = Option<Aov>> {
    let names = Aov::VARIANTS.iter().copied().chain(["none"]);
    PossibleValuesParser::new(names).try_map(|name| if name == "none" { Ok(None) } else { name.parse().map(Some) })
}

/// The scene, and options that override its settings.
#[derive(Args, Clone, Debug)]
pub(super) struct SceneArgs {
    /// Scene file (.pbrt, .pbrt.gz, .gltf or .glb), or - for a pbrt scene from the standard input
    pub scene: PathBuf,
    #[command(flatten)]
    pub settings: SettingsArgs,
    /// Choices of a plan that `lumiris plan` has stored; options override them
    #[arg(long, value_name = "FILE")]
    pub plan: Option<PathBuf>,
    /// Size of the image, such as 640x480 [default: the file's]
    #[arg(long, value_name = "WxH", value_parser = parse_resolution)]
    pub resolution: Option<[u32; 2]>,
    /// Crop window, in fractions of the image [default: the file's]
    #[arg(long, value_name = "X0,X1,Y0,Y1", value_parser = parse_crop)]
    pub crop: Option<[f32; 4]>,
    /// Image of the environment of a glTF scene: latitude and longitude, or a square of equal areas
    #[arg(long, value_name = "FILE")]
    pub environment: Option<PathBuf>,
    /// Scene of a glTF file, by its name or its index [default: the file's]
    #[arg(long, value_name = "NAME|INDEX")]
    pub scene_in_file: Option<String>,
    /// Camera of a glTF scene, by its name or its index, which `lumiris info` lists [default: the first]
    #[arg(long, value_name = "NAME|INDEX", conflicts_with = "camera_auto")]
    pub camera: Option<String>,
    /// Frame a glTF scene from the front and somewhat above, whatever its cameras
    #[arg(long)]
    pub camera_auto: bool,
    /// What candela and lux of lights in a glTF file are beside emission: with `watt`, 683 of them are 1 W/sr and 1 W/m², as in files of Blender; with
    /// `candela` they are taken as they are, with emission in cd/m², as glTF has it [default: watt]
    #[arg(long, value_name = "UNIT", value_parser = named::<LightUnits>())]
    pub light_units: Option<LightUnits>,
    /// Time (s) at which the animations of a glTF scene are seen [default: without animations]
    #[arg(long, value_name = "SECONDS", value_parser = parse_time_in_scene)]
    pub time_in_scene: Option<f32>,
    /// What the scene has of a sequence, if it is a frame of one.
    #[arg(skip)]
    pub frame: Option<FrameOf>,
    /// Memory that the textures of the scene may take, such as 2GB, or `off`: what does not fit is read by tiles from a
    /// temporary file (in TMPDIR). The image is the same to the bit [default: off]
    #[arg(long, value_name = "SIZE", value_parser = parse_limit)]
    pub texture_memory: Option<MemoryLimit>,
    /// Use a box filter of one pixel instead of the file's pixel filter
    #[arg(long)]
    pub box_filter: bool,
    /// Ray tracer
    #[arg(long, default_value = "embree", value_parser = named::<AccelKind>())]
    pub accel: AccelKind,
    /// Rays per Embree packet: 1, 4, 8 or 16; affects speed only, not the image [default: what the processor is fastest
    /// with]
    #[arg(long, value_name = "W", value_parser = parse_packet_width)]
    pub packet_width: Option<u32>,
    /// Threads [default: all cores]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub threads: Option<u32>,
    /// Tile size in pixels; affects speed only, not the image
    #[arg(long, value_name = "PIXELS", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub tile_size: u32,
}

impl SceneArgs {
    /// The scene as messages name it.
    pub(super) fn name(&self) -> Cow<'_, str> {
        if is_standard_input(&self.scene) { "<stdin>".into() } else { self.scene.to_string_lossy() }
    }

    /// How the scene is loaded.
    pub(super) fn load_options(&self) -> LoadOptions {
        LoadOptions {
            resolution: self.resolution,
            crop: self.crop,
            environment: self.environment.clone(),
            scene: self.scene_in_file.clone(),
            camera: self.camera.clone(),
            camera_auto: self.camera_auto,
            light_units: self.light_units,
            time: self.time_in_scene,
        }
    }
}

/// Options of `render` that `-h` shows, beside itself.
const IN_SHORT_HELP: [&str; 24] = [
    "output",
    "quiet",
    "threads",
    "plan",
    "resolution",
    "crop",
    "camera",
    "environment",
    "frames",
    "time",
    "aov",
    "integrator",
    "max-depth",
    "spp",
    "noise",
    "seed",
    "estimator",
    "samples",
    "exposure",
    "view-transform",
    "denoise",
    "view",
    "checkpoint",
    "resume",
];

/// Leaves all others to `--help`.
pub(super) fn in_short_help(option: Arg) -> Arg {
    let is_hidden = option.get_long().is_some_and(|name| !IN_SHORT_HELP.contains(&name));
    option.hide_short_help(is_hidden)
}

/// `lumiris render`
#[derive(Args, Clone, Debug)]
pub(super) struct RenderArgs {
    // First: the fields that follow take their values from the command line
    #[command(flatten)]
    pub output_options: OutputOptions,
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Output image; may be given several times. EXR stores all channels; PNG, JPEG, TIFF and TGA the tone-mapped image; .part
    /// what `lumiris merge` needs
    /// [default: the name in the file, or SCENE.exr]
    #[arg(short, long, value_name = "FILE")]
    pub output: Vec<PathBuf>,
    /// Frames of an animation, such as 1-48, 1-48:2 or 5,10-20: `####` in SCENE, and in the FILEs of --output, --checkpoint and
    /// --resume, becomes the number of the frame; a glTF scene needs none (--fps)
    #[arg(long, value_name = "LIST", value_parser = parse_frames, requires = "output")]
    pub frames: Option<FrameList>,
    /// With --frames of a glTF scene without ####: frames per second; frame n is the scene at the time n/F
    #[arg(long, value_name = "F", default_value_t = 24.0, value_parser = parse_fps, requires = "frames")]
    pub fps: f32,
    /// With --frames: whether each frame has a seed of its own, which follows from --seed and its number, and stands in its
    /// metadata
    #[arg(
        long, value_name = "on|off", default_value = "on", action = ArgAction::Set, value_parser = BoolishValueParser::new(),
        requires = "frames"
    )]
    pub seed_per_frame: bool,
    /// With --frames: leave out those whose images are there, and were not cut short by Ctrl-C
    #[arg(long, requires = "frames")]
    pub skip_existing: bool,
    /// Render for this many seconds from the start of the program (with --frames: of each frame), loading and pilots included, or
    /// until --spp, if it is given, is reached before
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    pub time: Option<f64>,
    /// Try settings before, and take what is a tenth more efficient than the rule's: for long renders. `lumiris plan` stores it
    #[arg(long, hide_short_help = true, conflicts_with_all = ["plan", "part", "samples_from", "samples_to"])]
    pub tune: bool,
    /// AOVs: additional channels of EXR files, or `none`, which saves the time for them [default: all, and ratio with
    /// --proposals optimal]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = aov())]
    pub aov: Option<Vec<Option<Aov>>>,
    #[command(flatten)]
    pub look: LookArgs,
    #[command(flatten)]
    pub exr: ExrArgs,
    #[command(flatten)]
    pub denoise: DenoiseArgs,
    #[command(flatten)]
    pub watch: WatchArgs,
    /// Write times and counts of every stage
    #[arg(long, value_name = "FILE.json")]
    pub stats: Option<PathBuf>,
    /// Memory that the process may take, such as 24GB, or `off`: what will not fit is refused before it is rendered
    /// [default: what the machine and its control groups have]
    #[arg(long, value_name = "SIZE", value_parser = parse_limit)]
    pub memory_limit: Option<MemoryLimit>,
    /// Print no progress, only warnings and errors
    #[arg(short, long)]
    pub quiet: bool,
    #[command(flatten)]
    pub parts: PartArgs,
}

/// True for `-`: a pbrt scene whose files are relative to the working directory.
pub(super) fn is_standard_input(scene: &Path) -> bool {
    scene.as_os_str() == "-"
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

fn parse_packet_width(text: &str) -> Result<u32, String> {
    match text {
        "1" => Ok(1),
        "4" => Ok(4),
        "8" => Ok(8),
        "16" => Ok(16),
        _ => Err("expected 1, 4, 8 or 16".to_owned()),
    }
}

/// Understands a time of a scene, which may lie before its start.
fn parse_time_in_scene(text: &str) -> Result<f32, String> {
    text.parse::<f32>().ok().filter(|s| s.is_finite()).ok_or_else(|| "expected a number of seconds".to_owned())
}

pub(super) fn parse_fps(text: &str) -> Result<f32, String> {
    let fps = text.parse::<f32>().ok().filter(|f| *f > 0.0 && f.is_finite());
    fps.ok_or_else(|| "expected a positive number of frames per second".to_owned())
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(s) if s > 0.0 && s.is_finite() => Ok(s.min(LONGEST)),
        _ => Err("expected a positive number of seconds".to_owned()),
    }
}

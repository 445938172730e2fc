//! Command-line options shared by several subcommands.

use super::denoise_args::DenoiseArgs;
use super::exr::ExrArgs;
use super::frame_list::{FrameList, parse_frames};
use super::look::LookArgs;
use super::memory::{MemoryLimit, parse_limit};
use super::named::named;
use super::output_options::OutputOptions;
use super::part_args::{LONGEST, PartArgs};
use super::settings_args::SettingsArgs;
use super::watch_args::WatchArgs;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{ArgAction, Args};
use lumiris::import::LoadOptions;
use lumiris::import::gltf::LightUnits;
use lumiris::render::output::Aov;
use lumiris::scene::AccelKind;
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use strum::VariantNames;

/// Parses the name of an AOV, or `none`.
pub(super) fn aov() -> impl TypedValueParser<Value = Option<Aov>> {
    let names = Aov::VARIANTS.iter().copied().chain(["none"]);
    PossibleValuesParser::new(names).try_map(|name| if name == "none" { Ok(None) } else { name.parse().map(Some) })
}

/// Parses `on` and `off`.
pub(super) fn on_or_off() -> impl TypedValueParser<Value = bool> {
    PossibleValuesParser::new(["on", "off"]).map(|word| word == "on")
}

/// The scene, and options that override its settings.
#[derive(Args, Clone, Debug)]
pub(super) struct SceneArgs {
    /// Scene file (.pbrt, .pbrt.gz, .gltf or .glb), or - for a pbrt scene from the standard input
    pub scene: PathBuf,
    #[command(flatten)]
    pub settings: SettingsArgs,
    /// Size of the image, such as 640x480 [default: the file's]
    #[arg(long, value_name = "WxH", value_parser = parse_resolution)]
    pub resolution: Option<[u32; 2]>,
    /// Crop window, in fractions of the image [default: the file's]
    #[arg(long, value_name = "X0,X1,Y0,Y1", value_parser = parse_crop)]
    pub crop: Option<[f32; 4]>,
    /// Environment map of a glTF scene: latitude–longitude, or square in the equal-area octahedral mapping
    #[arg(long, value_name = "FILE")]
    pub environment: Option<PathBuf>,
    /// Scene of a glTF file, by its name or its index [default: the file's]
    #[arg(long, value_name = "NAME|INDEX")]
    pub scene_in_file: Option<String>,
    /// Camera of a glTF scene, by name or by index as listed by `lumiris info` [default: the first]
    #[arg(long, value_name = "NAME|INDEX", conflicts_with = "camera_auto")]
    pub camera: Option<String>,
    /// Place an automatic camera in front of and slightly above a glTF scene, instead of its own cameras
    #[arg(long)]
    pub camera_auto: bool,
    /// Units of glTF punctual lights. `watt`: candela and lux are divided by 683 lm/W, as in files of Blender.
    /// `candela`: they are taken as they are, and emission is in cd/m², as in the glTF specification [default: watt]
    #[arg(long, value_name = "UNIT", value_parser = named::<LightUnits>())]
    pub light_units: Option<LightUnits>,
    /// Time (s) of a glTF scene's animations [default: animations are ignored]
    #[arg(long, value_name = "SECONDS", value_parser = parse_time_in_scene)]
    pub time_in_scene: Option<f32>,
    /// Number of the frame, if the seed depends on it.
    #[arg(skip)]
    pub seed_by_frame: Option<u32>,
    /// Memory for the textures of the scene, such as 2GB, or `off`. The rest is read by tiles from a temporary file (in
    /// TMPDIR). Images are bit-identical [default: off, unless only this way the scene fits --memory-limit]
    #[arg(long, value_name = "SIZE", value_parser = parse_limit)]
    pub texture_memory: Option<MemoryLimit>,
    /// Folder that keeps textures in tiles, so that later runs load them at once. Missing ones are added, changed files
    /// are noticed, and several processes may share it. Images are bit-identical
    #[arg(long, value_name = "FOLDER")]
    pub texture_cache: Option<PathBuf>,
    /// Use a box filter of one pixel instead of the file's pixel filter
    #[arg(long)]
    pub box_filter: bool,
    /// Ray tracer
    #[arg(long, default_value = "embree", value_parser = named::<AccelKind>())]
    pub accel: AccelKind,
    /// Rays per Embree packet: 1, 4, 8 or 16; affects speed only, not the image [default: the fastest for the
    /// processor]
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
    /// Name of the scene in messages.
    pub(super) fn name(&self) -> Cow<'_, str> {
        if is_standard_input(&self.scene) { "<stdin>".into() } else { self.scene.to_string_lossy() }
    }

    /// Options for loading the scene.
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

/// `lumiris render`
#[derive(Args, Clone, Debug)]
pub(super) struct RenderArgs {
    // First, because later fields take their values from the command line
    #[command(flatten)]
    pub output_options: OutputOptions,
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Output image; may be given several times. EXR stores all channels; PNG, JPEG, TIFF and TGA the tone-mapped
    /// image; .part the input of `lumiris merge` [default: the name in the file, or SCENE.exr]
    #[arg(short, long, value_name = "FILE")]
    pub output: Vec<PathBuf>,
    /// Frames of an animation, such as 1-48, 1-48:2 or 5,10-20. `####` becomes the frame number, with zeros in front,
    /// in SCENE and in the FILEs of --output, --checkpoint and --resume. A glTF scene needs no `####` (see --fps)
    #[arg(long, value_name = "LIST", value_parser = parse_frames, requires = "output")]
    pub frames: Option<FrameList>,
    /// With --frames and a glTF scene without ####: frames per second; frame n is at the time n/F
    #[arg(long, value_name = "F", default_value_t = 24.0, value_parser = parse_fps, requires = "frames")]
    pub fps: f32,
    /// With --frames: whether each frame has its own seed, computed from --seed and the frame number. The seed is in
    /// the metadata
    #[arg(
        long, value_name = "on|off", default_value = "on", action = ArgAction::Set,
        value_parser = on_or_off(), requires = "frames"
    )]
    pub seed_per_frame: bool,
    /// With --frames: skip frames whose images exist and were not interrupted by Ctrl-C
    #[arg(long, requires = "frames")]
    pub skip_existing: bool,
    /// Stop after this many seconds, counted from the start of the program (with --frames: of each frame), loading and
    /// pilots included. With --spp, stop earlier if that is reached
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    pub time: Option<f64>,
    /// AOVs: additional channels of EXR files. `none` saves their time [default: all, and ratio with --proposals
    /// optimal]
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
    /// Memory limit of the process, such as 24GB, or `off`. A scene that would exceed it is refused before its files
    /// are read, and an image before it is rendered [default: the memory of the machine and its control groups]
    #[arg(long, value_name = "SIZE", value_parser = parse_limit)]
    pub memory_limit: Option<MemoryLimit>,
    /// Print no progress, only warnings and errors
    #[arg(short, long)]
    pub quiet: bool,
    #[command(flatten)]
    pub parts: PartArgs,
}

/// True for `-`: a pbrt scene from the standard input, whose files are relative to the working directory.
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

/// Parses a time (s) of the animations. It may be negative.
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

//! `lumiris farm`: an image rendered in parts by the nodes of a cluster.

use super::UsageError;
use super::args::{RenderArgs, SceneArgs, aov, is_standard_input, on_or_off, parse_fps};
use super::denoise_args::DenoiseArgs;
use super::exr::ExrArgs;
use super::farm_scripts::{Job, quoted};
use super::frame_list::{FrameList, has_number, numbered, parse_frames};
use super::frames::{check_numbers, first_of};
use super::look::LookArgs;
use super::merge::check_look;
use super::named::named;
use super::part_args::{PART_TYPE, PartBy, extension};
use super::parts;
use super::pictures::check_outputs;
use super::progress;
use super::settings::load_scene;
use super::typed_options::AsTyped;
use anyhow::{Context, bail};
use clap::{Args, FromArgMatches, Subcommand};
use lumiris::import::Loaded;
use lumiris::import::cache::FileCache;
use lumiris::render::output::Aov;
use lumiris::settings::{Allocation, EstimatorKind};
use lumiris_formats::output::write_text;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf, absolute};
use std::process::{Command, ExitCode, Stdio};

/// `lumiris farm`
#[derive(Args, Clone, Debug)]
pub(super) struct FarmArgs {
    #[command(subcommand)]
    queue: Queue,
}

#[derive(Clone, Debug, Subcommand)]
enum Queue {
    /// Write, and submit, the jobs of a Slurm cluster that render the parts of an image and merge them
    Slurm(Box<SlurmArgs>),
}

/// `lumiris farm slurm`
#[derive(Args, Clone, Debug)]
struct SlurmArgs {
    #[command(flatten)]
    scene: AsTyped<SceneArgs>,
    /// Frames of an animation, such as 1-48, as for `render`: one array job and one merge per frame
    #[arg(long, value_name = "LIST", value_parser = parse_frames)]
    frames: Option<FrameList>,
    /// With --frames of a glTF scene without ####: frames per second [default: 24]
    #[arg(long, value_name = "F", value_parser = parse_fps, requires = "frames")]
    fps: Option<f32>,
    /// With --frames: whether each frame has its own seed [default: on]
    #[arg(long, value_name = "on|off", value_parser = on_or_off(), requires = "frames")]
    seed_per_frame: Option<bool>,
    /// Number of parts per image; each is a task of an array job [default with --frames: 1]
    #[arg(
        long = "parts", value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000),
        required_unless_present = "frames"
    )]
    count: Option<u32>,
    /// Content of a part. `samples`: a share of the samples of every pixel. `tiles`: all samples of a share of the
    /// pixels
    #[arg(long, value_name = "WHAT", default_value = "samples", value_parser = named::<PartBy>())]
    part_by: PartBy,
    /// Output image of the merge; may be given several times
    #[arg(short, long, value_name = "FILE", required = true)]
    output: Vec<PathBuf>,
    /// AOVs: additional channels of EXR files, or `none` [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = aov())]
    aov: Option<Vec<Option<Aov>>>,
    #[command(flatten)]
    look: AsTyped<LookArgs>,
    #[command(flatten)]
    exr: AsTyped<ExrArgs>,
    #[command(flatten)]
    denoise: AsTyped<DenoiseArgs>,
    /// Time between the checkpoints of a part
    #[arg(long, value_name = "SECONDS", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..))]
    checkpoint_seconds: u32,
    /// Option of sbatch for all jobs, such as --sbatch=--partition=render; may be given several times
    #[arg(long, value_name = "OPTION", allow_hyphen_values = true)]
    sbatch: Vec<String>,
    /// Folder of scripts, parts and logs, on a file system shared by all nodes [default: the first output, .farm,
    /// without ####]
    #[arg(long, value_name = "DIR")]
    dir: Option<PathBuf>,
    /// Program on the nodes [default: this one, by its path]
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
    /// Submit the jobs and print their ids
    #[arg(long)]
    submit: bool,
}

impl SlurmArgs {
    /// Number of parts of an image.
    fn count(&self) -> u32 {
        self.count.unwrap_or(1)
    }
}

pub(super) fn run(args: &FarmArgs) -> anyhow::Result<ExitCode> {
    // Check the options
    let Queue::Slurm(args) = &args.queue;
    check_outputs(&outputs_of_first(args))?;
    if let Some(path) = args.output.iter().find(|path| extension(path) == PART_TYPE) {
        return Err(UsageError(format!("{}: parts are merged to an image, such as image.exr", path.display())).into());
    }
    check_look(&args.look.args, &args.exr.args)?;
    args.denoise.args.check(&args.output)?;
    check(args)?;

    // Choose the folder
    let folder = args.dir.clone().unwrap_or_else(|| default_folder(&args.output[0]));
    let folder = absolute(&folder).with_context(|| format!("cannot find {}", folder.display()))?;
    if args.frames.is_some() && has_number(&folder) {
        let text = format!("--frames: {} is one folder for all frames: give a --dir without #", folder.display());
        return Err(UsageError(text).into());
    }

    // Write the scripts, and submit or print them
    let job = job(args, &folder)?;
    write_folder(&folder, &job)?;
    if args.submit {
        submit(&folder)?;
    } else {
        let script = quoted(&text(&folder.join("submit.sh"))?);
        progress::print(&format!("{} is ready; this submits it:\n{script}", folder.display()))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Outputs of the first frame.
fn outputs_of_first(args: &SlurmArgs) -> Vec<PathBuf> {
    match first_frame(args) {
        Some(frame) => args.output.iter().map(|path| numbered(path, frame)).collect(),
        None => args.output.clone(),
    }
}

fn first_frame(args: &SlurmArgs) -> Option<u32> {
    args.frames.as_ref().and_then(|list| list.0.first().copied())
}

/// The default folder for an image, or for a sequence whose names contain ####.
fn default_folder(output: &Path) -> PathBuf {
    let name = output.file_name().unwrap_or_default().to_string_lossy();
    let mut words: Vec<String> = name.split('#').filter(|word| !word.is_empty()).map(str::to_owned).collect();
    if let Some((_, before)) = words.split_last_mut() {
        // Without the number, its separator is meaningless
        before.iter_mut().for_each(|word| *word = word.trim_end_matches(['.', '_', '-']).to_owned());
    }
    let name = words.concat();
    let name = if name.is_empty() || name.starts_with('.') { format!("frames{name}") } else { name };
    output.with_file_name(name).with_extension("farm")
}

/// Rejects options that cannot be rendered in parts, before anything is written.
fn check(args: &SlurmArgs) -> anyhow::Result<()> {
    // Parse the options as `lumiris render` will
    let mut words = part_options(args);
    words.extend(["--part".to_owned(), format!("1/{}", args.count())]);
    words.extend(["-o".to_owned(), (if args.frames.is_some() { "####.part" } else { "1.part" }).to_owned()]);
    words.extend(args.frames.iter().map(|list| format!("--frames={}", list.text())));
    words.extend(["--".to_owned(), text(&args.scene.args.scene)?]);
    let command = RenderArgs::augment_args(clap::Command::new("render").no_binary_name(true));
    let matches = command.try_get_matches_from(words).map_err(|e| UsageError(e.to_string()))?;
    let mut render = RenderArgs::from_arg_matches(&matches).map_err(|e| UsageError(e.to_string()))?;
    if let Some(frames) = &args.frames {
        check_numbers(args.output.iter())?;
        let first = first_of(&render, frames)?;
        check_scenes(&render.scene.scene, frames)?;
        render = first;
    }

    if is_standard_input(&render.scene.scene) {
        return Err(UsageError("the tasks of a farm read the scene each: it must be a file".to_owned()).into());
    }
    let Loaded { settings, .. } = load_scene(&render.scene, &FileCache::default(), None, None)?;
    parts::check_division(&render, &settings)?;
    // With other estimators and allocations, the pilot decides the sample count
    let is_uniform = match settings.sampling.allocation {
        Allocation::Uniform => true,
        Allocation::Auto => settings.integrator.estimator != EstimatorKind::Auto,
        Allocation::Adaptive => false,
    };
    let (spp, count) = (settings.sampling.spp, args.count());
    if is_uniform && args.part_by == PartBy::Samples && spp < count {
        let message = format!(
            "{spp} samples per pixel cannot be {count} parts: divide with --part-by tiles, if pixels share no paths"
        );
        return Err(UsageError(message).into());
    }
    Ok(())
}

/// Fails if the scene of a frame is missing. Only the first frame's scene is loaded.
fn check_scenes(scene: &Path, frames: &FrameList) -> anyhow::Result<()> {
    let scenes = frames.0.iter().map(|&frame| numbered(scene, frame));
    let missing: Vec<String> = scenes.filter(|path| !path.is_file()).map(|path| path.display().to_string()).collect();
    match missing.first() {
        Some(first) if missing.len() == 1 => bail!("{first}: there is no such scene"),
        Some(first) => bail!("{first} and the scenes of {} more frames are missing", missing.len() - 1),
        None => Ok(()),
    }
}

/// Options of `lumiris render` for all parts.
fn part_options(args: &SlurmArgs) -> Vec<String> {
    let mut words = args.scene.words_without(&[]);
    let names = args.aov.iter().map(|list| {
        let names: Vec<&str> = list.iter().map(|aov| aov.map_or("none", <&str>::from)).collect();
        format!("--aov={}", names.join(","))
    });
    words.extend(names);
    words.extend(args.fps.map(|fps| format!("--fps={fps}")));
    words.extend(args.seed_per_frame.map(|is_on| format!("--seed-per-frame={}", if is_on { "on" } else { "off" })));
    words.push(format!("--part-by={}", <&str>::from(args.part_by)));
    words
}

fn job(args: &SlurmArgs, folder: &Path) -> anyhow::Result<Job> {
    // Paths
    let from = std::env::current_dir().context("there is no current folder")?;
    let program = match &args.program {
        Some(path) => path.clone(),
        None => std::env::current_exe().context("this program has no path: give --program")?,
    };

    // Options of the merge
    let mut merge =
        [args.look.words_without(&[]), args.exr.words_without(&[]), args.denoise.words_without(&[])].concat();
    for path in &args.output {
        // Scripts change to the current folder, whose name may itself contain #
        merge.push(format!("--output={}", text(path)?));
    }
    Ok(Job {
        lumiris: text(&program)?,
        from: text(&from)?,
        folder: text(folder)?,
        scene: text(&args.scene.args.scene)?,
        frames: args.frames.as_ref().map_or(Vec::new(), |list| list.0.clone()),
        parts: args.count(),
        seconds: f64::from(args.checkpoint_seconds),
        has_threads: args.scene.args.threads.is_some(),
        options: [part_options(args), merge, args.sbatch.clone()],
    })
}

/// A path as text for scripts; fails if it is not UTF-8.
fn text(path: &Path) -> anyhow::Result<String> {
    Ok(path.to_str().with_context(|| format!("{}: the name is not in UTF-8", path.display()))?.to_owned())
}

/// Writes the scripts. An existing folder must be empty or belong to the same rendering, which is then continued.
fn write_folder(folder: &Path, job: &Job) -> anyhow::Result<()> {
    // Create the folder, or check the existing one
    let shown = folder.display();
    let scripts = job.scripts();
    match fs::create_dir(folder) {
        Ok(()) => (),
        Err(e) if e.kind() == ErrorKind::AlreadyExists => {
            let entries = fs::read_dir(folder).with_context(|| format!("{shown} exists, and is no folder"))?;
            let is_empty = entries.count() == 0;
            let is_same = |name| fs::read_to_string(folder.join(name)).ok().as_ref() == text_of(&scripts, name);
            if !is_empty && !is_same("part.sh") {
                bail!("{shown} has files that are not of this rendering: remove it, or give another --dir");
            }
        }
        Err(e) => return Err(e).with_context(|| format!("cannot make the folder {shown}")),
    }

    // Write the scripts
    for (name, text) in scripts {
        let path = folder.join(name);
        write_text(&path, &text).with_context(|| format!("cannot write {}", path.display()))?;
        #[cfg(unix)]
        fs::set_permissions(&path, std::os::unix::fs::PermissionsExt::from_mode(0o755))
            .with_context(|| format!("cannot make {} a program", path.display()))?;
    }
    Ok(())
}

fn text_of<'a>(scripts: &'a [(&str, String)], name: &str) -> Option<&'a String> {
    scripts.iter().find(|(other, _)| *other == name).map(|(_, text)| text)
}

/// Submits the jobs.
fn submit(folder: &Path) -> anyhow::Result<()> {
    let script = folder.join("submit.sh");
    let run = Command::new("bash").arg(&script).stdin(Stdio::null()).output();
    let output = run.with_context(|| format!("cannot run {}", script.display()))?;
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    if !output.status.success() {
        bail!("the jobs could not be submitted:\n{}", err.trim_end());
    }
    if !err.is_empty() {
        progress::say(err.trim_end());
    }
    progress::print(out.trim_end())?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_folder_is_called_like_the_image_without_the_number_of_a_frame() {
        let folder = |name: &str| default_folder(Path::new(name)).display().to_string();
        assert_eq!(folder("a/image.exr"), "a/image.farm");
        assert_eq!(folder("image"), "image.farm");
        assert_eq!(folder("out.####.exr"), "out.farm");
        assert_eq!(folder("a/out_##.left.exr"), "a/out.left.farm");
        assert_eq!(folder("####.exr"), "frames.farm");
        assert_eq!(folder("####"), "frames.farm");
    }
}

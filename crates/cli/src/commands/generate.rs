//! `lumiris generate`

use super::progress;
use anyhow::ensure;
use clap::{Args, Subcommand};
use lumiris_lab::procedural::files::{write_sky, write_statue};
use lumiris_lab::procedural::island::{self, IslandOptions};
use lumiris_lab::procedural::sky::SkyOptions;
use lumiris_lab::procedural::statue::{DEFAULT_DETAIL, StatueOptions};
use lumiris_lab::procedural::talbot::TalbotOptions;
use lumiris_lab::procedural::{fan, keller_wald, talbot};
use std::path::PathBuf;
use std::process::ExitCode;

/// `lumiris generate`
#[derive(Args, Clone, Debug)]
pub(super) struct GenerateArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Clone, Debug, Subcommand)]
enum What {
    /// A finely carved statue (PLY mesh)
    Statue(StatueArgs),
    /// An environment map of sun, sky and clouds (EXR image for `LightSource "infinite"`)
    Sky(SkyArgs),
    /// The scenes of scenes/talbot, with their statue and sky
    Talbot(TalbotArgs),
    /// The scenes of scenes/fan, with their statue
    Fan(FanArgs),
    /// The scenes of scenes/keller-wald, and a variant of the rooms with 10,000 lights
    KellerWald(KellerWaldArgs),
    /// A tropical island of up to 10⁸ plants and pebbles, with water and sky
    Island(IslandArgs),
}

#[derive(Args, Clone, Debug)]
struct StatueArgs {
    /// File to write (.ply)
    #[arg(short, long, value_name = "FILE", default_value = "statue.ply")]
    output: PathBuf,
    /// Grid cells along the height (8 to 4096); the number of triangles grows with the square
    #[arg(long, value_name = "N", default_value_t = DEFAULT_DETAIL)]
    detail: u32,
    /// Omit the vertex normals
    #[arg(long)]
    flat: bool,
}

#[derive(Args, Clone, Debug)]
#[command(allow_negative_numbers = true)]
struct SkyArgs {
    /// File to write (.exr)
    #[arg(short, long, value_name = "FILE", default_value = "sky.exr")]
    output: PathBuf,
    /// Width and height in texels
    #[arg(long, value_name = "N", default_value_t = 1024)]
    resolution: usize,
    /// Height of the sun above the horizon (degrees, 0 to 90)
    #[arg(long, value_name = "DEGREES", default_value_t = 25.0)]
    elevation: f32,
    /// Direction of the sun, from +x towards +y (degrees)
    #[arg(long, value_name = "DEGREES", default_value_t = 225.0)]
    azimuth: f32,
    /// Haze: 0 for none, 1 for a clear day, 10 for a very hazy day
    #[arg(long, value_name = "AMOUNT", default_value_t = 1.5)]
    haze: f32,
    /// Diameter of the sun relative to the real sun; its power stays the same
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    sun_size: f32,
    /// Reflectance of the ground below the horizon
    #[arg(long, value_name = "ALBEDO", default_value_t = 0.25)]
    ground: f32,
    /// Fraction of the sky covered by clouds (0 to 1)
    #[arg(long, value_name = "FRACTION", default_value_t = 0.0)]
    clouds: f32,
    /// Irradiance of a horizontal surface (luminance)
    #[arg(long, value_name = "E", default_value_t = std::f32::consts::PI)]
    irradiance: f32,
    /// Random seed of the clouds
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u32,
}

impl SkyArgs {
    fn options(&self) -> SkyOptions {
        SkyOptions {
            resolution: self.resolution,
            elevation: self.elevation.to_radians(),
            azimuth: self.azimuth.to_radians(),
            haze: self.haze,
            sun_size: self.sun_size,
            ground_albedo: self.ground,
            cloud_cover: self.clouds,
            irradiance: self.irradiance,
            seed: self.seed,
        }
    }
}

#[derive(Args, Clone, Debug)]
struct TalbotArgs {
    /// Folder to write into
    #[arg(short, long, value_name = "DIR", default_value = "talbot")]
    output: PathBuf,
    /// Grid cells along the height of the statue (8 to 4096)
    #[arg(long, value_name = "N", default_value_t = DEFAULT_DETAIL)]
    detail: u32,
    /// Width and height of the sky in texels
    #[arg(long, value_name = "N", default_value_t = 1024)]
    resolution: usize,
}

#[derive(Args, Clone, Debug)]
struct FanArgs {
    /// Folder to write into
    #[arg(short, long, value_name = "DIR", default_value = "fan")]
    output: PathBuf,
    /// Grid cells along the height of the statue (8 to 4096)
    #[arg(long, value_name = "N", default_value_t = DEFAULT_DETAIL)]
    detail: u32,
}

#[derive(Args, Clone, Debug)]
struct KellerWaldArgs {
    /// Folder to write into
    #[arg(short, long, value_name = "DIR", default_value = "keller-wald")]
    output: PathBuf,
}

#[derive(Args, Clone, Debug)]
struct IslandArgs {
    /// Folder to write into
    #[arg(short, long, value_name = "DIR", default_value = "island")]
    output: PathBuf,
    /// Number of plants and pebbles (1000 to 100000000); the area of the island grows with it
    #[arg(long, value_name = "N", default_value_t = IslandOptions::default().instances)]
    instances: usize,
    /// Squares of the terrain along each side, two triangles each (16 to 8192)
    #[arg(long, value_name = "N", default_value_t = IslandOptions::default().detail)]
    detail: u32,
    /// Width and height of the sky in texels
    #[arg(long, value_name = "N", default_value_t = IslandOptions::default().resolution)]
    resolution: usize,
    /// Random seed
    #[arg(long, value_name = "N", default_value_t = IslandOptions::default().seed)]
    seed: u32,
}

pub(super) fn run(args: &GenerateArgs) -> anyhow::Result<ExitCode> {
    // Write the files, and report each file or folder with its size
    match &args.what {
        What::Statue(args) => {
            ensure!(has_extension(&args.output, "ply"), "the statue is written as .ply, not {}", args.output.display());
            let written = write_statue(&args.output, &StatueOptions { detail: args.detail, normals: !args.flat })?;
            progress::say(&format!("{}: {} triangles", args.output.display(), written.triangles));
        }
        What::Sky(args) => {
            ensure!(has_extension(&args.output, "exr"), "the sky is written as .exr, not {}", args.output.display());
            write_sky(&args.output, &args.options())?;
            progress::say(&format!("{}: {1}×{1} texels", args.output.display(), args.resolution));
        }
        What::Talbot(args) => {
            let mut options = TalbotOptions::default();
            options.statue.detail = args.detail;
            options.sky.resolution = args.resolution;
            let written = talbot::write_scenes(&args.output, &options)?;
            progress::say(&format!("{}: three scenes, {} triangles", args.output.display(), written.triangles));
        }
        What::Fan(args) => {
            let statue = StatueOptions { detail: args.detail, ..StatueOptions::default() };
            let written = fan::write_scenes(&args.output, &statue)?;
            progress::say(&format!("{}: four scenes, {} triangles", args.output.display(), written.triangles));
        }
        What::KellerWald(args) => {
            keller_wald::write_scenes(&args.output)?;
            progress::say(&format!("{}: {} scenes", args.output.display(), keller_wald::COUNT));
        }
        What::Island(args) => write_island(args)?,
    }
    Ok(ExitCode::SUCCESS)
}

fn write_island(args: &IslandArgs) -> anyhow::Result<()> {
    let IslandArgs { ref output, instances, detail, resolution, seed } = *args;
    let written = island::write_scenes(output, &IslandOptions { instances, detail, resolution, seed })?;
    progress::say(&format!(
        "{}: two scenes, {} plants and {} pebbles on {:.0} × {:.0} m, {} triangles of ground",
        output.display(),
        written.plants,
        written.pebbles,
        written.side,
        written.side,
        written.triangles
    ));
    Ok(())
}

fn has_extension(path: &std::path::Path, extension: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension))
}

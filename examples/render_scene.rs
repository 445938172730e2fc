//! The library in one page: load a scene, build its ray tracers, render, write.
//!
//! `cargo run --release --example render_scene -- scenes/analytic/rectangle.pbrt rectangle.exr`
#![allow(clippy::print_stdout)]

use lumiris::imaging::oiio::{Part, write_image};
use lumiris::import::{LoadOptions, load};
use lumiris::render::output::{self, Aov};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::AccelKind;
use std::error::Error;
use std::path::Path;
use std::sync::atomic::AtomicBool;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, scene, image] = arguments.as_slice() else {
        return Err("usage: render_scene SCENE.pbrt PICTURE.exr".into());
    };

    // What is wrong with the file comes back as a report; warnings come with the scene.
    let loaded = load(Path::new(scene), &LoadOptions::default())?;
    println!("{}", loaded.warnings);

    // Ray tracers, one over everything and one over emitters only, and what the file's settings ask for.
    let job = loaded.job(AccelKind::Embree, None)?;

    let settings = RenderSettings { spp: job.settings().sampling.spp, ..RenderSettings::default() };
    let rendering = render(&job, &settings, &AtomicBool::new(false), &|_progress| ())?;

    let film = &rendering.film;
    let channels = output::channels(film, &[Aov::Variance], None);
    let (width, height) = (film.bounds.width() as usize, film.bounds.height() as usize);
    let part = Part::linear(width, height, channels.names, channels.data);
    write_image(Path::new(image), &[part])?;
    println!("{} camera rays in {:.2} s", rendering.stats.camera_rays, rendering.elapsed.as_secs_f64());
    Ok(())
}

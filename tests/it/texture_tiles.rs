//! Textures beyond the memory limit: bit-identical images.

use lumiris::imaging::oiio::{Part, write_image};
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load_with};
use lumiris::render::output::channels;
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, RenderJob};
use std::fmt::Write;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Side of the square images. One half of them is 8-bit, the other half floats.
const EDGE: usize = 300;
const IMAGES: usize = 6;
/// Bytes of all pyramids, except for rounding.
const BYTES: u64 = (EDGE * EDGE * 3 * (1 + 4) * IMAGES / 2 * 4 / 3) as u64;

/// A wall of squares, each with an image on it, near and far.
fn write_scene(folder: &Path) {
    let mut text = "LookAt 0 0.5 -3  0 0 0  0 1 0\nCamera \"perspective\" \"float fov\" 50\n\
                    Film \"rgb\" \"integer xresolution\" 48 \"integer yresolution\" 32\n\
                    Integrator \"path\" \"integer maxdepth\" 2\nWorldBegin\n\
                    LightSource \"distant\" \"point3 from\" [ 1 3 -2 ]\nLightSource \"infinite\" \"rgb L\" [ 0.2 0.3 0.4 ]\n"
        .to_owned();
    for i in 0..IMAGES {
        let name = format!("{i}.{}", if i % 2 == 0 { "png" } else { "exr" });
        // The image
        let value = |x: usize, y: usize, c: usize| ((x * (i + 3) + y * 7 + c * 50) % 256) as f32 / 255.0;
        let pixels = (0..EDGE * EDGE * 3).map(|k| value(k / 3 % EDGE, k / 3 / EDGE, k % 3)).collect();
        let names = ["R", "G", "B"].map(str::to_owned).to_vec();
        let part = if i % 2 == 0 { Part::display } else { Part::linear };
        write_image(&folder.join(&name), &[part(EDGE, EDGE, names, pixels)]).unwrap();

        // The square
        let filter = ["point", "bilinear", "trilinear"][i % 3];
        let (x, z) = ((i % 3) as f32 - 1.5, (i / 3) as f32 * 4.0 - 1.0);
        write!(
            text,
            "Texture \"t{i}\" \"spectrum\" \"imagemap\" \"string filename\" \"{name}\" \"string filter\" \"{filter}\" \
             \"float uscale\" 0.13 \"float vscale\" 0.1\nMaterial \"diffuse\" \"texture reflectance\" \"t{i}\"\n\
             Shape \"bilinearmesh\" \"point3 P\" [ {x} -1 {z}  {} -1 {z}  {x} 1 {}  {} 1 {} ]\n",
            x + 1.0,
            z + 3.0,
            x + 1.0,
            z + 3.0
        )
        .unwrap();
    }
    std::fs::write(folder.join("wall.pbrt"), text).unwrap();
}

fn job(folder: &Path, limit: Option<u64>) -> RenderJob {
    let files = FileCache::default();
    limit.into_iter().for_each(|bytes| files.limit_textures(bytes));
    let loaded = load_with(&folder.join("wall.pbrt"), &LoadOptions::default(), &files);
    loaded.map_err(|d| d.to_string()).unwrap().job(AccelKind::Embree, None).unwrap()
}

fn pixels(job: &RenderJob, threads: usize) -> Vec<f32> {
    let settings = RenderSettings { threads: Some(threads), ..RenderSettings::default() };
    let rendering = render(job, &settings, &AtomicBool::new(false), &|_| ()).unwrap();
    channels(&rendering.film, &[], None).data
}

#[test]
fn images_are_the_same_to_the_bit_with_a_quarter_of_the_memory_and_less() {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path());
    let whole = job(folder.path(), None);
    let expected = pixels(&whole, 2);
    assert!(whole.world.scene.textures.store().is_none());
    for (limit, threads) in [(BYTES / 4, 2), (BYTES / 4, 3), (BYTES / 20, 1)] {
        let job = job(folder.path(), Some(limit));
        assert!(pixels(&job, threads) == expected, "limit {limit}, {threads} threads");
        let textures = &job.world.scene.textures;
        let store = textures.store().unwrap();
        let counts = store.counts();
        assert!(counts.read > 0 && store.failure().is_none(), "{counts:?}");
        let (tiled, whole): (Vec<_>, Vec<_>) = textures.images.iter().partition(|image| image.store().is_some());
        // Levels no larger than a tile stay in memory: from 37 × 37 texels on, 5.5 kB of bytes and 22 kB of floats
        assert!(!tiled.is_empty() && tiled.iter().all(|image| image.bytes() < 22_500), "{:?}", tiled[0].bytes());
        let whole: u64 = whole.iter().map(|image| image.bytes() as u64).sum();
        assert!(whole + counts.held <= limit && counts.held > 0, "{whole} + {counts:?}, limit {limit}");
    }
}

#[test]
fn what_fits_stays_in_memory() {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path());
    assert!(job(folder.path(), Some(2 * BYTES)).world.scene.textures.store().is_none());
    // Half of it: the largest images move to tiles
    let job = job(folder.path(), Some(BYTES / 2));
    let images = &job.world.scene.textures.images;
    let is_tiled: Vec<bool> = images.iter().map(|image| image.store().is_some()).collect();
    assert_eq!(is_tiled, [false, true, false, true, false, true]);
}

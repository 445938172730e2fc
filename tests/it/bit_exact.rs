//! A picture depends on the scene, its settings, the seed and the sample range, and on nothing else.

use lumiris::film::Film;
use lumiris::import::{LoadOptions, load};
use lumiris::render::output::{Aov, channels};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, World};
use std::path::Path;
use std::sync::atomic::AtomicBool;

fn gallery(packet_width: Option<u32>) -> World {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/demo/gallery.pbrt");
    let options = LoadOptions { resolution: Some([96, 54]), ..LoadOptions::default() };
    let scene = load(&path, &options).map_err(|d| d.to_string()).unwrap().scene;
    World::new(scene, AccelKind::Embree, packet_width).unwrap()
}

fn film(world: &World, settings: RenderSettings) -> Film {
    render(world, &RenderSettings { spp: 8, ..settings }, &AtomicBool::new(false), &|_| ()).unwrap().film
}

fn assert_same_bits(a: &Film, b: &Film, what: &str) {
    let bits = |f: &Film| channels(f, &Aov::ALL).data.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    let (a, b) = (bits(a), bits(b));
    assert!(a.iter().any(|&v| v != 0));
    let different = a.iter().zip(&b).filter(|(x, y)| x != y).count();
    assert_eq!(different, 0, "{what}: {different} of {} values differ", a.len());
}

#[test]
fn threads_and_tiles_do_not_change_a_bit() {
    let world = gallery(None);
    let reference = film(&world, RenderSettings { threads: Some(1), ..RenderSettings::default() });
    for threads in [1, 2, 3] {
        for tile_size in [1, 8, 13, 64] {
            let other = film(&world, RenderSettings { threads: Some(threads), tile_size, ..RenderSettings::default() });
            assert_same_bits(&reference, &other, &format!("{threads} threads, tiles of {tile_size}"));
        }
    }
}

#[test]
fn packet_width_does_not_change_a_bit() {
    let reference = film(&gallery(Some(1)), RenderSettings::default());
    for width in [4, 8] {
        let other = film(&gallery(Some(width)), RenderSettings::default());
        assert_same_bits(&reference, &other, &format!("packets of {width}"));
    }
}

#[test]
fn seeds_give_different_pictures() {
    let mut world = gallery(None);
    let a = film(&world, RenderSettings::default());
    world.scene.sampling.seed = 1;
    let b = film(&world, RenderSettings::default());
    assert_ne!(channels(&a, &[]).data, channels(&b, &[]).data);
}

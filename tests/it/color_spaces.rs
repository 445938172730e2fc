//! Colour spaces of pbrt scenes, and their effect on films and lights.

use lumiris::film::PixelBounds;
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, Loaded, load_text};
use lumiris::lights::{DistantLight, Light};
use lumiris_numbers::math::Rgb;
use std::path::Path;

fn loaded(head: &str, world: &str) -> Result<Loaded, String> {
    let text = format!("{head}\nWorldBegin\n{world}");
    let options = LoadOptions::default();
    load_text(&text, "colors.pbrt", Path::new("."), &options, &FileCache::default()).map_err(|d| d.to_string())
}

/// The radiance of the only light.
fn light(world: &str) -> Rgb {
    match loaded("", world).unwrap().scene.lights.lights[0] {
        Light::InfiniteConstant { l } | Light::Distant(DistantLight { irradiance: l, .. }) => l,
        ref other => panic!("{other:?}"),
    }
}

#[track_caller]
fn assert_near(found: Rgb, expected: [f32; 3]) {
    assert!((found - Rgb::from_array(expected)).map(f32::abs).max_component() < 2e-3, "{found:?} {expected:?}");
}

#[test]
fn lights_have_the_white_of_their_space_and_reflectances_are_grey_in_any() {
    // Green of Rec.2020, and D60 [SMPTE ST 2065-1], in Rec.709
    let (green, d60) = ([-0.5876, 1.1329, -0.1006], [1.047, 0.995, 0.915]);
    assert_near(light("ColorSpace \"rec2020\" LightSource \"infinite\" \"rgb L\" [ 0 1 0 ]"), green);
    // `Attribute` parameters keep their colour space
    let stays = "ColorSpace \"rec2020\" Attribute \"light\" \"rgb L\" [ 0 1 0 ] ColorSpace \"srgb\" LightSource";
    assert_near(light(&format!("{stays} \"infinite\"")), green);
    assert_near(light(&format!("{stays} \"distant\"")), green);
    assert_near(light("ColorSpace \"aces2065-1\" LightSource \"infinite\" \"rgb L\" [ 1 1 1 ]"), d60);
    assert_near(light("ColorSpace \"aces2065-1\" LightSource \"infinite\""), d60);
    assert_near(light("LightSource \"distant\""), [1.0; 3]);
    let grey = "ColorSpace \"aces2065-1\" Texture \"t\" \"spectrum\" \"constant\" \"rgb value\" [ 0.5 0.5 0.5 ]
        Material \"diffuse\" \"texture reflectance\" \"t\" Shape \"sphere\" LightSource \"infinite\"";
    let textures = loaded("", grey).unwrap().scene.textures;
    let constants: Vec<Rgb> = (0..textures.rgbs.len() as u32).filter_map(|id| textures.constant_rgb(id)).collect();
    assert!(!constants.is_empty());
    constants.into_iter().for_each(|rgb| assert_near(rgb, [0.5; 3]));
}

#[test]
fn negative_light_is_an_error_with_its_place() {
    for wrong in [
        "LightSource \"infinite\" \"rgb L\" [ 1 -1 1 ]",
        "LightSource \"point\" \"rgb I\" [ -1 1 1 ]",
        "AreaLightSource \"diffuse\" \"rgb L\" [ 1 1 -0.5 ] Shape \"sphere\"",
        "MakeNamedMedium \"m\" \"string type\" \"homogeneous\" \"rgb Le\" [ 1 1 -1 ]",
    ] {
        let error = loaded("", wrong).err().unwrap();
        assert!(error.contains("must not be negative") && error.contains("colors.pbrt:3:"), "{error}");
    }
}

#[test]
fn films_have_the_window_of_pbrt_and_say_what_they_leave_out() {
    let bounds = |film: &str| {
        let film = format!("Film \"rgb\" \"integer xresolution\" 100 \"integer yresolution\" 50 {film}");
        let loaded = loaded(&film, "LightSource \"infinite\"").unwrap();
        (loaded.scene.film.bounds, loaded.warnings.to_string())
    };
    let window = |x0, x1, y0, y1| PixelBounds { x0, x1, y0, y1 };
    let crop = "\"float cropwindow\" [ 0.1 0.5 0.2 0.4 ]";
    assert_eq!(bounds(crop).0, window(10, 50, 10, 20));
    // Ends in any order, and clipped
    assert_eq!(bounds("\"float cropwindow\" [ 0.5 -3 0.4 2 ]").0, window(0, 50, 20, 50));
    let (both, warnings) = bounds(&format!("{crop} \"integer pixelbounds\" [ 0 7 0 9 ]"));
    assert!(both == window(10, 50, 10, 20) && warnings.contains("goes before `pixelbounds`"), "{both:?} {warnings}");
    assert_eq!(bounds("\"integer pixelbounds\" [ 0 7 0 9 ]").0, window(0, 7, 0, 9));

    let light = "LightSource \"infinite\"";
    let warnings = |head: &str| loaded(head, light).unwrap().warnings.to_string();
    assert!(warnings("Film \"gbuffer\"").contains("--aov"));
    assert!(warnings("ColorSpace \"rec2020\" Film \"rgb\"").contains("Rec.709"));
    assert!(warnings("Film \"rgb\"").is_empty());
    assert_eq!(loaded("Sampler \"independent\"", light).unwrap().settings.sampling.spp, 4);
    assert_eq!(loaded("Sampler \"zsobol\"", light).unwrap().settings.sampling.spp, 16);
}

#[test]
fn what_only_bounds_a_medium_does_not_emit() {
    let lamp = "Material \"interface\" AreaLightSource \"diffuse\" Shape \"sphere\"";
    let loaded = loaded("", &format!("{lamp} LightSource \"infinite\"")).unwrap();
    assert_eq!(loaded.scene.lights.lights.len(), 1);
    assert!(loaded.warnings.to_string().contains("does not emit"), "{}", loaded.warnings);
}

//! What whole scenes mean: their directives in other orders, and what pbrt repairs.

use crate::import::cache::FileCache;
use crate::import::{LoadOptions, Loaded, load_text};
use crate::materials::Material;
use std::path::Path;

/// A small image of what follows `WorldBegin`; `head` is before it.
fn load_with(head: &str, world: &str) -> Result<Loaded, String> {
    let film = "Film \"rgb\" \"integer xresolution\" 4 \"integer yresolution\" 4";
    let text = format!("{film}\n{head}\nWorldBegin\nLightSource \"infinite\"\n{world}\n");
    let folder = Path::new("/nonexistent");
    load_text(&text, "scene.pbrt", folder, &LoadOptions::default(), &FileCache::default()).map_err(|r| r.to_string())
}

/// The material of a surface.
fn material(loaded: &Loaded, surface: usize) -> &Material {
    let scene = &loaded.scene;
    &scene.materials.entries()[scene.surfaces[surface].material as usize].material
}

#[test]
fn options_have_a_name_and_a_value_as_in_pbrt() {
    let seed = |head: &str| load_with(head, "").unwrap().settings.sampling.seed;
    assert_eq!(seed("Option \"seed\" 3"), 3);
    assert_eq!(seed("Option \"SEED\" 4000000000"), 4_000_000_000);
    assert_eq!(seed("Option \"seed\" -1"), u32::MAX);
    let loaded = load_with("Option \"integer seed\" [ 5 ] \"bool forcediffuse\" false", "").unwrap();
    let warnings = loaded.warnings.to_string();
    assert_eq!(loaded.settings.sampling.seed, 5);
    assert!(warnings.contains("Option \"name\" value") && warnings.contains("scene.pbrt:2:8"), "{warnings}");
}

#[test]
fn options_without_effect_are_named_where_they_would_change_the_image() {
    let warnings = |head: &str| load_with(head, "").unwrap().warnings.to_string();
    let text = warnings("Option \"disable-Pixel_jitter\" true");
    assert!(text.contains("option `disable-Pixel_jitter` has no effect here"), "{text}");
    assert!(warnings("Option \"msereferenceimage\" \"a.exr\"").contains("no effect"));
    for harmless in ["\"rendercoordsys\" \"camera\"", "\"disablepixeljitter\" false", "\"wavefront\" true"] {
        assert_eq!(warnings(&format!("Option {harmless}")), "", "{harmless}");
    }
}

#[test]
fn wrong_options_are_errors_that_say_what_is_possible() {
    for (option, message) in [
        ("\"seed\" 1.5", "option `seed` takes a whole number of 32 bits, not `1.5`"),
        ("\"disablepixeljitter\" 1", "option `disablepixeljitter` takes true or false, not `1`"),
        ("\"displacementedgescale\" 0", "takes a positive number, not `0`"),
        ("\"rendercoordsys\" \"up\"", "takes camera, cameraworld or world, not `up`"),
        ("\"sede\" 1", "did you mean `seed`?"),
        ("\"seed\"", "an option takes a number, true, false or a string in quotes, not `WorldBegin`"),
        ("\"seed\" [ 1 ]", "not `[`"),
        ("\"integer seed\" [ 1 2 ]", "an option takes one value, not 2"),
        ("seed 1", "Option takes a string in quotes here, not `seed`"),
    ] {
        let error = load_with(&format!("Option {option}"), "").unwrap_err();
        assert!(error.contains(message) && error.contains("scene.pbrt:"), "{option}: {error}");
    }
}

#[test]
fn transform_end_restores_all_as_attribute_end_does() {
    let world = r#"Material "diffuse" TransformBegin Material "interface" Scale 2 2 2 TransformEnd Shape "disk""#;
    let loaded = load_with("", world).unwrap();
    assert_eq!(material(&loaded, 0).kind_name(), "diffuse");
    let warnings = loaded.warnings.to_string();
    assert!(warnings.contains("TransformBegin is AttributeBegin in pbrt-v4"), "{warnings}");
}

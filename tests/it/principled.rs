//! The principled material of pbrt scenes: names, ranges, and suggestions.

use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load_text};
use std::path::Path;

/// Errors or warnings of a scene with a principled material of these parameters.
fn said_of_principled(parameters: &str) -> String {
    let text = format!("WorldBegin\nMaterial \"principled\" {parameters}\nShape \"sphere\"\n");
    let loaded = load_text(&text, "a.pbrt", Path::new(""), &LoadOptions::default(), &FileCache::default());
    loaded.map_or_else(|report| report.to_string(), |loaded| loaded.warnings.to_string())
}

#[test]
fn numbers_of_principled_materials_outside_of_their_ranges_are_errors_with_places() {
    // Values outside of their ranges
    let wrong = [
        ("\"float base_metalness\" 2", "base_metalness must be from 0 to 1, not 2"),
        ("\"float specular_roughness\" -1", "specular_roughness must be from 0 to 1, not -1"),
        ("\"float specular_roughness_anisotropy\" 1.5", "must be from 0 to 1, not 1.5"),
        ("\"float sheen\" 1.5", "sheen must be from 0 to 1, not 1.5"),
        ("\"float anisotropic\" 2", "anisotropic must be from 0 to 1, not 2"),
        ("\"float fuzz_weight\" 1.5", "fuzz_weight must be from 0 to 1, not 1.5"),
        ("\"float specular_ior\" 0", "an index of refraction must be positive, not 0"),
        ("\"rgb base_color\" [0.5 2 0.5]", "base_color must be from 0 to 1, not 0.5 2 0.5"),
        ("\"rgb specular_color\" [0.5 -1 0.5]", "specular_color must be 0 or more, not 0.5 -1 0.5"),
    ];
    for (parameters, message) in wrong {
        let said = said_of_principled(parameters);
        assert!(said.contains(message) && said.contains("a.pbrt:2:23"), "{said}");
    }

    // Values at the limits are valid
    let right =
        "\"float coat_weight\" 1 \"rgb specular_color\" [3 1 0] \"rgb base_color\" [0 1 1] \"float coat_roughness\" 0";
    assert!(!said_of_principled(right).contains("must be"), "{}", said_of_principled(right));
}

#[test]
fn names_of_blender_and_disney_mean_those_of_openpbr() {
    // The material and its textures, as text
    let material = |parameters: &str| {
        let text =
            format!("WorldBegin\nLightSource \"infinite\"\nMaterial \"principled\" {parameters}\nShape \"sphere\"\n");
        let loaded = load_text(&text, "a.pbrt", Path::new(""), &LoadOptions::default(), &FileCache::default());
        let loaded = loaded.map_err(|report| report.to_string()).unwrap();
        assert_eq!(loaded.warnings.to_string(), "");
        format!("{:?} {:?}", loaded.scene.materials, loaded.scene.textures)
    };

    // Both vocabularies give the same material
    let openpbr = "\"rgb base_color\" [.2 .4 .6] \"float base_metalness\" .1 \"float specular_roughness\" .4 \"float specular_ior\" 1.4
        \"rgb specular_color\" [1 .5 1] \"float transmission_weight\" .2 \"float fuzz_weight\" .3 \"rgb fuzz_color\" [1 .9 .8]
        \"float fuzz_roughness\" .6 \"float coat_weight\" .7 \"bool geometry_thin_walled\" true";
    let others = "\"rgb basecolor\" [.2 .4 .6] \"float metallic\" .1 \"float roughness\" .4 \"float ior\" 1.4
        \"rgb specular_tint\" [1 .5 1] \"float spectrans\" .2 \"float sheen_weight\" .3 \"rgb sheen_tint\" [1 .9 .8]
        \"float sheen_roughness\" .6 \"float clearcoat\" .7 \"bool thin\" true";
    assert_eq!(material(openpbr), material(others));
    // The anisotropy of Disney keeps its own definition
    assert!(
        material("\"float specular\" 1 \"float anisotropic\" .5 \"float clearcoatgloss\" 1").contains("Disney(0.5)")
    );

    // Two names of the same parameter are an error
    let said = said_of_principled("\"float metallic\" 0.5 \"float base_metalness\" 0.5");
    assert!(said.contains("metallic is base_metalness, which is given as well"), "{said}");
}

#[test]
fn suggestions_for_parameters_name_what_is_wanted() {
    let said = said_of_principled("\"float base_roughness\" 0.5");
    assert!(said.contains("did you mean `specular_roughness`?"), "{said}");
    let said = said_of_principled("\"texture specular_ior\" \"x\"");
    assert!(said.contains("write `float specular_ior` or `spectrum specular_ior`"), "{said}");
}

//! Semantics of whole scenes: unusual orders of directives, and errors that pbrt repairs.

use crate::geometry::{GeometrySet, Shape};
use crate::import::cache::FileCache;
use crate::import::{LoadOptions, Loaded, load_text};
use crate::materials::Material;
use lumiris_numbers::math::Rgb;
use std::path::Path;

/// Loads a small scene: `world` follows `WorldBegin`, `head` precedes it.
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
fn a_name_is_the_same_in_every_unicode_normal_form() {
    // `ü` as one character and as two; each name is defined in one form and used in the other
    for [a, b] in [["gr\u{fc}n", "gru\u{308}n"], ["gru\u{308}n", "gr\u{fc}n"]] {
        let head = format!("MakeNamedMedium \"{a}\" \"string type\" \"homogeneous\"\nCoordinateSystem \"{a}\"");
        let world = format!(
            r#"CoordSysTransform "{b}"
               Texture "{a}" "float" "constant" "float value" 0.5
               Texture "{a}" "spectrum" "constant" "rgb value" [ 1 0 0 ]
               MakeNamedMaterial "{a}" "string type" "diffuse" "texture reflectance" "{b}"
               MakeNamedMaterial "mixed" "string type" "mix" "string materials" [ "{b}" "{a}" ] "texture amount" "{b}"
               NamedMaterial "{b}"
               MediumInterface "{b}" ""
               ObjectInstance "{b}"
               ObjectBegin "{a}" Shape "sphere" "texture alpha" "{b}" ObjectEnd
               ObjectInstance "{b}"
               AreaLightSource "diffuse" "string lightgroup" "{a}" Shape "disk"
               AreaLightSource "diffuse" "string lightgroup" "{b}" Shape "sphere""#
        );
        let loaded = load_with(&head, &world).unwrap_or_else(|report| panic!("{report}"));
        assert_eq!(loaded.scene.lights.layers.names(), ["other", "gr\u{fc}n"]);
        let twice = format!("MakeNamedMaterial \"{a}\" \"string type\" \"diffuse\"\n").replace(a, b);
        let error = load_with("", &(twice.replace(b, a) + &twice)).unwrap_err();
        assert!(error.contains("is defined twice"), "{error}");
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

/// The reflectance of a diffuse surface with a constant reflectance.
fn reflectance(loaded: &Loaded, surface: usize) -> Rgb {
    let Material::Diffuse { reflectance } = *material(loaded, surface) else { panic!("it is diffuse") };
    loaded.scene.textures.constant_rgb(reflectance).unwrap()
}

#[test]
fn textures_may_be_used_before_they_are_defined() {
    let world = r#"
        Material "diffuse" "texture reflectance" "late"
        Shape "disk" "texture alpha" "cut"
        Shape "disk" "texture alpha" "cut" "float height" 2
        AttributeBegin
            ColorSpace "rec2020"
            Texture "late" "spectrum" "constant" "rgb value" [ 0 0.5 0 ]
        AttributeEnd
        Texture "cut" "float" "constant" "float value" 0.25"#;
    let loaded = load_with("", world).unwrap();
    let color = reflectance(&loaded, 0);
    assert!(color.g > 0.5 && color.r != 0.0, "the colour space is that of the texture: {color:?}");
    for geometry in &loaded.scene.geometry.geometries {
        assert_eq!(loaded.scene.textures.constant_float(geometry.alpha.unwrap()), Some(0.25));
    }
}

#[test]
fn what_is_asked_of_constant_textures_is_asked_of_later_ones_too() {
    let sigma = |value: &str| {
        let world = format!(
            "Material \"matte\" \"texture sigma\" \"s\" Shape \"disk\"
             Texture \"s\" \"float\" \"constant\" \"float value\" {value}"
        );
        material(&load_with("", &world).unwrap(), 0).kind_name()
    };
    assert_eq!((sigma("0"), sigma("20")), ("diffuse", "evaluated"));
    let world = r#"Material "conductor" "texture roughness" "r" Texture "r" "float" "constant" "float value" -1"#;
    assert!(load_with("", world).unwrap_err().contains("roughness must be at least 0, not -1"));
}

#[test]
fn textures_are_made_in_the_order_of_pbrt() {
    // Spectra come after floats
    let world = r#"
        Texture "s" "spectrum" "scale" "rgb tex" [ 1 1 1 ] "texture scale" "f"
        Texture "f" "float" "constant" "float value" 0.5
        Material "diffuse" "texture reflectance" "s" Shape "disk""#;
    load_with("", world).unwrap();
    // Images come first
    let world = r#"
        Texture "f" "float" "scale" "texture tex" "i"
        Texture "i" "float" "imagemap" "string filename" "gone.png""#;
    let error = load_with("", world).unwrap_err();
    assert!(error.contains("1 file cannot be read") && !error.contains("texture `i`"), "{error}");
    // Others of their type are made in text order, so there are no cycles
    for (world, place) in [
        (r#"Texture "a" "float" "scale" "texture tex" "b" Texture "b" "float" "constant""#, "scene.pbrt:5:29"),
        (r#"Texture "a" "spectrum" "mix" "texture tex1" "a""#, "scene.pbrt:5:30"),
        (
            r#"Texture "a" "float" "mix" "texture tex1" "b" Texture "b" "float" "mix" "texture tex1" "a""#,
            "scene.pbrt:5:27",
        ),
    ] {
        let error = load_with("", world).unwrap_err();
        assert!(error.contains("is not made before the one that uses it") && error.contains(place), "{error}");
    }
}

#[test]
fn unknown_names_are_errors_where_they_are_used_first() {
    for (world, message) in [
        (
            "Shape \"disk\" \"texture alpha\" \"cuts\"\nShape \"disk\" \"texture alpha\" \"cuts\"
             Texture \"cut\" \"float\" \"constant\"",
            "unknown float texture `cuts`\n  --> scene.pbrt:5:14",
        ),
        (
            "Material \"diffuse\" \"texture reflectance\" \"wod\" Texture \"wood\" \"spectrum\" \"constant\"",
            "did you mean `wood`?",
        ),
        (
            "Material \"diffuse\" \"texture reflectance\" \"a\" Texture \"a\" \"float\" \"constant\"",
            "a float texture of this name exists",
        ),
        ("ObjectInstance \"tre\" ObjectBegin \"tree\" ObjectEnd", "did you mean `tree`?"),
        ("Material \"mix\" \"string materials\" [ \"a\" \"a\" ]", "unknown material `a`"),
    ] {
        // A wrong name that is used twice is reported twice
        let error = load_with("", world).unwrap_err();
        assert!(error.contains(message) && error.starts_with("error: "), "{error}");
        assert_eq!(error.matches("error: ").count(), if message.contains("`a`") { 2 } else { 1 }, "{error}");
    }
}

#[test]
fn names_are_defined_once_and_both_places_are_named() {
    for twice in [
        r#"Texture "a" "float" "constant" Texture "a" "float" "constant" "float value" 2"#,
        r#"Texture "a" "spectrum" "constant" Texture "a" "spectrum" "constant""#,
        r#"MakeNamedMaterial "a" "string type" "diffuse" MakeNamedMaterial "a" "string type" "diffuse""#,
    ] {
        let error = load_with("", twice).unwrap_err();
        assert!(error.contains("`a` is defined twice") && error.contains("first defined here"), "{error}");
    }
    load_with("", r#"Texture "a" "float" "constant" Texture "a" "spectrum" "constant""#).unwrap();
}

#[test]
fn objects_may_be_placed_before_they_are_defined() {
    let twice = r#"Translate 1 2 3 ObjectInstance "o" ObjectInstance "o" ObjectBegin "o" Shape "disk" ObjectEnd"#;
    let loaded = load_with("", twice).unwrap();
    let [instance, _] = loaded.scene.geometry.instances.as_slice() else { panic!("it is placed twice") };
    assert_eq!(instance.world_from_group[0].translation.to_array(), [1.0, 2.0, 3.0]);
    let nested = r#"ObjectBegin "a" ObjectInstance "b" ObjectEnd ObjectBegin "b" ObjectInstance "a" ObjectEnd"#;
    let error = load_with("", nested).unwrap_err();
    assert!(error.contains("object `b` is defined after the one that holds it"), "{error}");
}

#[test]
fn objects_that_are_placed_once_need_no_instance() {
    let mesh = r#"Shape "trianglemesh" "point3 P" [ 0 0 0 1 0 0 0 1 0.5 ] "integer indices" [ 0 1 2 ]"#;
    let place = "Rotate 30 1 2 3 Scale -1.5 0.7 2 Translate 4 -5 6";
    let geometry = |world: &str| load_with("", world).unwrap().scene.geometry;
    let placed = |object: &str, count: usize| {
        let instance = r#"ObjectInstance "o" "#.repeat(count);
        geometry(&format!(r#"ObjectBegin "o" Scale 2 1 1 {object} ObjectEnd {place} {instance}"#))
    };
    let triangle = |geometry: &GeometrySet| match &geometry.geometries[0].shape {
        Shape::Mesh(mesh) => (mesh.triangle(0), mesh.flip_normal),
        other => panic!("{other:?}"),
    };

    // As the shape at the same place without an object
    let (once, plain) = (placed(mesh, 1), geometry(&format!("{place} Scale 2 1 1 {mesh}")));
    assert_eq!((once.instances.len(), once.root.geometries.len()), (0, 1));
    assert_eq!(triangle(&once), triangle(&plain));

    // Others stay where they are defined
    assert_eq!(placed(mesh, 2).instances.len(), 2);
    let curve = r#"Shape "curve" "point3 P" [ 0 0 0 1 0 0 2 0 0 3 0 1 ]"#;
    assert_eq!(placed(&format!("{mesh} {curve}"), 1).instances.len(), 1);
    let light = r#"AreaLightSource "diffuse""#;
    let lit = load_with("", &format!(r#"ObjectBegin "o" {light} {mesh} ObjectEnd ObjectInstance "o""#)).unwrap();
    assert_eq!((lit.scene.geometry.instances.len(), lit.scene.lights.lights.len()), (1, 1));
    let turning = format!(r#"ObjectBegin "o" {mesh} ObjectEnd ActiveTransform EndTime {place} ObjectInstance "o""#);
    assert_eq!(geometry(&turning).instances.len(), 1);
    let nested = r#"ObjectBegin "a" ObjectInstance "o" ObjectEnd ObjectInstance "a" ObjectInstance "a""#;
    assert_eq!(geometry(&format!(r#"ObjectBegin "o" {mesh} ObjectEnd {nested}"#)).instances.len(), 2);
}

#[test]
fn shapes_that_move_together_are_one_instance() {
    let moving = |motion: &str, places: [&str; 2]| {
        let mesh = r#"Shape "trianglemesh" "point3 P" [ 0 0 0 1 0 0 0 1 0 ] "integer indices" [ 0 1 2 ]"#;
        let shapes = places.map(|place| format!("AttributeBegin {motion} {place} {mesh} AttributeEnd")).join(" ");
        load_with("Camera \"perspective\" \"float shutteropen\" 0.5", &shapes).unwrap().scene.geometry
    };

    // What only shifts is placed at the start
    let shifted =
        moving("ActiveTransform EndTime Translate 0 0 4 ActiveTransform All", ["Rotate 90 0 0 1", "Translate 0 0 0.1"]);
    let [instance] = shifted.instances.as_slice() else { panic!("{:?}", shifted.instances) };
    let shift = instance.world_from_group.iter().map(|m| m.translation.z);
    assert_eq!(shift.collect::<Vec<_>>(), [2.0, 4.0]);
    let corners = shifted.groups[0].geometries.iter().map(|&id| match &shifted.geometries[id as usize].shape {
        Shape::Mesh(mesh) => (mesh.triangle(0)[1] * 10.0).round().to_array(),
        other => panic!("{other:?}"),
    });
    assert_eq!(corners.collect::<Vec<_>>(), [[0.0, 10.0, 0.0], [10.0, 0.0, 1.0]]);

    // Other motions are those of the shapes' own spaces: more samples for a larger angle
    let turns = |degrees: u32, places| {
        let turning = moving(&format!("ActiveTransform EndTime Rotate {degrees} 0 1 0 ActiveTransform All"), places);
        turning.instances.iter().map(|instance| instance.world_from_group.len()).collect::<Vec<_>>()
    };
    assert_eq!(turns(10, ["Translate 1 0 0", "Translate 1 0 0"]), [2]);
    assert_eq!(turns(90, ["Translate 1 0 0", "Translate 2 0 0"]), [9, 9]);
}

#[test]
fn mixtures_may_name_later_materials_but_not_themselves() {
    let late = r#"
        Material "mix" "string materials" [ "a" "b" ] Shape "disk"
        MakeNamedMaterial "a" "string type" "mix" "string materials" [ "b" "b" ]
        MakeNamedMaterial "b" "string type" "diffuse""#;
    assert_eq!(material(&load_with("", late).unwrap(), 0).kind_name(), "mix");
    let ring = r#"
        MakeNamedMaterial "a" "string type" "mix" "string materials" [ "b" "c" ]
        MakeNamedMaterial "b" "string type" "mix" "string materials" [ "c" "a" ]
        MakeNamedMaterial "c" "string type" "diffuse""#;
    let error = load_with("", ring).unwrap_err();
    assert!(error.contains("the mixture `a` holds itself, or one that does\n  --> scene.pbrt:6:"), "{error}");
}

#[test]
fn empty_names_of_files_are_none() {
    let world = r#"
        LightSource "infinite" "string filename" "" "rgb L" [ 2 2 2 ]
        Material "diffuse" "string normalmap" ""
        AreaLightSource "diffuse" "string filename" "" "rgb L" [ 3 3 3 ]
        Shape "disk""#;
    let loaded = load_with("", world).unwrap();
    assert_eq!(loaded.scene.lights.lights.len(), 3);
    assert!(loaded.scene.materials.entries().iter().all(|entry| entry.normal_map.is_none()));
    let error = load_with("", r#"LightSource "projection" "string filename" """#).unwrap_err();
    assert!(error.contains("a projection light needs `filename`"), "{error}");
}

#[test]
fn parameters_are_those_of_the_version_that_has_them() {
    let gone = r#"Texture "i" "spectrum" "imagemap" "float maxanisotropy" 4 "bool trilinear" true"#;
    let error = load_with("", gone).unwrap_err();
    assert!(error.contains("`trilinear` is pbrt-v3") && !error.contains("`maxanisotropy`"), "{error}");
    let lamps = "LightSource \"point\" \"blackbody I\" [ 5500 2 ]\nLightSource \"point\" \"blackbody I\" [ 5500 2 ]";
    let warnings = load_with("", lamps).unwrap().warnings.to_string();
    assert_eq!(warnings.matches("a blackbody with a factor is pbrt-v3").count(), 1, "{warnings}");
    assert_eq!(load_with("", "LightSource \"point\" \"blackbody I\" 5500").unwrap().warnings.to_string(), "");
}

#[test]
fn what_pbrt_leaves_out_of_meshes_is_left_out_with_a_warning() {
    let corners = "\"point3 P\" [ 0 0 0  1 0 0  0 1 0  1 1 1 ]";
    let triangles = |rest: &str| format!("Shape \"trianglemesh\" {corners} {rest}");
    let patch = |rest: &str| format!("Shape \"bilinearmesh\" {corners} {rest}");
    let faces = "\"integer indices\" [ 0 1 2 1 2 3 ]";
    for (shape, warning) in [
        (triangles("\"integer indices\" [ 0 1 2 1 2 3 9 9 ]"), "must be a multiple of 3, not 8: 2 are left out"),
        (triangles(&format!("{faces} \"normal N\" [ 0 0 1 ]")), "`N` has 1 entries, but there are 4 vertices"),
        (triangles(&format!("{faces} \"vector3 S\" [ 0 0 1 ]")), "`S` has 1 entries"),
        (triangles(&format!("{faces} \"point2 uv\" [ 0 0 1 1 ]")), "`uv` has 2 entries"),
        (triangles(&format!("{faces} \"integer faceIndices\" [ 1 ]")), "faceIndices must be 2 numbers"),
        (
            triangles(&format!("{faces} \"integer faceIndices\" [ 1 -1 ]")),
            "none of which is negative: they are left out",
        ),
        (patch("\"integer indices\" [ 0 1 2 3 0 ]"), "must be a multiple of 4, not 5: 1 are left out"),
        (patch("\"normal N\" [ 0 0 1 ]"), "`N` has 1 entries"),
        (patch("\"integer faceIndices\" [ 1 2 ]"), "faceIndices must be 1 numbers"),
    ] {
        // The warning has a position, and the mesh lacks the attribute
        let loaded = load_with("", &shape).unwrap();
        let warnings = loaded.warnings.to_string();
        assert!(warnings.contains(warning) && warnings.contains("scene.pbrt:5:"), "{warnings}");
        match &loaded.scene.geometry.geometries[0].shape {
            Shape::Mesh(mesh) => {
                assert_eq!(mesh.indices, [[0, 1, 2], [1, 2, 3]]);
                assert!(
                    mesh.normals.is_empty() && mesh.tangents.is_empty() && mesh.uvs.is_empty() && mesh.faces.is_empty()
                );
            }
            Shape::Bilinear(mesh) => {
                assert_eq!(mesh.indices, [[0, 1, 2, 3]]);
                assert!(mesh.normals.is_empty() && mesh.uvs.is_empty() && mesh.faces.is_empty());
            }
            other => panic!("{other:?}"),
        }
    }

    // An index out of range is an error
    let outside = load_with("", &triangles("\"integer indices\" [ 0 1 9 ]")).unwrap_err();
    assert!(outside.contains("index 9 is out of range"), "{outside}");
}

#[test]
fn flattened_meshes_patches_and_disks_are_flat_and_others_are_errors_with_their_places() {
    let triangle = "Shape \"trianglemesh\" \"point3 P\" [0 0 1 1 0 2 0 1 3] \"normal N\" [.6 0 .8 .6 0 .8 .6 0 .8]";
    let patch = "Shape \"bilinearmesh\" \"point3 P\" [0 0 1 1 0 2 0 1 3 1 1 7]";
    let disk = "Shape \"disk\" \"float height\" 3";
    for (shape, max) in [(triangle, [1.0, 1.0]), (patch, [1.0, 1.0]), (disk, [1.0, 1.0])] {
        let in_object = format!("ObjectBegin \"o\" {shape} ObjectEnd Translate 0 0 5 Scale 1 1 0 ObjectInstance \"o\"");
        for world in [format!("Translate 0 0 5 Scale 1 1 0 {shape}"), in_object] {
            // Flat shapes in the plane z = 5, with normals along z
            let geometry = load_with("", &world).unwrap().scene.geometry;
            let bounds = geometry.world_bounds();
            assert_eq!(bounds.max.to_array(), [max[0], max[1], 5.0], "{world}");
            assert_eq!((bounds.min.z, geometry.instances.len()), (5.0, 0), "{world}");
            let hit = geometry.surface_hit(geometry.root.geometries[0], 0, u32::MAX, [0.3, 0.2], 0.0);
            assert!(hit.n.z > 0.999_999 && hit.ns.z > 0.999_999, "{world}: {hit:?}");
        }
    }

    // Errors, with their positions
    let flat = |rest: &str| load_with("", &format!("Scale 1 1 0\n{rest}")).unwrap_err();
    for (rest, what) in [
        ("Shape \"sphere\"", "a sphere"),
        ("Shape \"curve\" \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0]", "a curve"),
        ("LightSource \"infinite\" \"string filename\" \"sky.exr\"", "a light with an image"),
        ("Texture \"t\" \"float\" \"fbm\"", "a texture in space"),
        ("MakeNamedMedium \"m\" \"string type\" \"cloud\"", "a medium of a grid"),
        ("ActiveTransform EndTime Translate 1 0 0 ActiveTransform All Shape \"disk\"", "a moving disk"),
    ] {
        let error = flat(rest);
        assert!(error.contains(&format!("{what} cannot be flattened")) && error.contains("scene.pbrt:6:"), "{error}");
    }
    let object = "ObjectBegin \"o\" Shape \"sphere\" ObjectEnd\nScale 1 1 0 ObjectInstance \"o\"";
    let error = load_with("", object).unwrap_err();
    assert!(error.contains("of the object cannot be flattened") && error.contains("scene.pbrt:6:13"), "{error}");
    let error = load_with("Scale 0 1 1 Camera \"perspective\"", "").unwrap_err();
    assert!(error.contains("a camera cannot be flattened") && error.contains("scene.pbrt:2:13"), "{error}");
    assert!(load_with("", "Scale 1e30 1 1 Scale 1e30 1 1").unwrap_err().contains("not finite"));
}

#[test]
fn mixtures_that_hold_themselves_are_named_in_whatever_order_they_are_defined() {
    let mix = |name: &str, parts: [&str; 2]| {
        let [a, b] = parts;
        format!("MakeNamedMaterial \"{name}\" \"string type\" \"mix\" \"string materials\" [\"{a}\" \"{b}\"]\n")
    };
    let plain = "MakeNamedMaterial \"p\" \"string type\" \"diffuse\"\n";
    let sound = mix("a", ["b", "b"]) + &mix("b", ["c", "p"]) + &mix("c", ["p", "p"]);
    assert!(load_with("", &(sound.clone() + plain)).is_ok());
    let ring = mix("r", ["p", "s"]) + &mix("s", ["r", "a"]) + &mix("t", ["p", "s"]);
    let error = load_with("", &(sound + &ring + plain)).unwrap_err();
    for (name, is_wrong) in [("r", true), ("s", true), ("t", true), ("a", false), ("b", false), ("c", false)] {
        assert_eq!(error.contains(&format!("the mixture `{name}` holds itself")), is_wrong, "{error}");
    }
}

#[test]
fn chains_of_textures_have_a_limit() {
    let chain = |n: usize| {
        let next = |i| format!("Texture \"t{}\" \"float\" \"scale\" \"texture tex\" \"t{i}\"\n", i + 1);
        let first = "Texture \"t0\" \"float\" \"constant\"\n";
        let text = first.to_owned() + &(0..n).map(next).collect::<String>();
        load_with("", &format!("{text}Shape \"sphere\" \"texture alpha\" \"t{n}\""))
    };
    assert!(chain(490).is_ok());
    let error = chain(30_000).unwrap_err();
    assert!(error.contains("textures refer to each other more than 500 deep"), "{error}");
}

//! Materials of glTF scenes and their images: volumes, dispersion, normal maps, filters, and extensions.

use super::{PIXEL, VALUES, bounds, container, floats};
use lumiris::import::{LoadOptions, Loaded, load};
use lumiris::lights::{AreaLight, Light};
use lumiris::render::output::{Aov, channels};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::AccelKind;
use lumiris_numbers::math::{Rgb, Vec3};
use std::path::Path;
use std::sync::atomic::AtomicBool;

#[test]
fn unlit_surfaces_emit_the_colours_of_their_vertices_and_others_do_not() {
    let light = |material: &str| -> AreaLight {
        let mesh = format!(
            r#""materials":[{{{material}}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"COLOR_0":1}},"material":0}}]}}]"#
        );
        let (_, loaded) = bounds(r#"{"mesh":0},{}"#, &mesh, &VALUES).unwrap();
        let [Light::Area(light)] = &loaded.scene.lights.lights[..] else { panic!("{:?}", loaded.scene.lights) };
        light.clone()
    };
    // The vertex colours are (0, 0, 0), (2, 0, 0) and (0, 0, 4)
    let factor = r#""pbrMetallicRoughness":{"baseColorFactor":[0.5,0.5,0.5,1]}"#;
    let unlit = light(&format!(r#"{factor},"extensions":{{"KHR_materials_unlit":{{}}}}"#)).mean_radiance();
    assert!((unlit - Rgb::new(1.0 / 3.0, 0.0, 2.0 / 3.0)).map(f32::abs).max_component() < 1e-6, "{unlit:?}");
    let lit = light(&format!(r#"{factor},"emissiveFactor":[1,1,1]"#)).mean_radiance();
    assert_eq!(lit, Rgb::WHITE);
}

#[test]
fn specular_glossiness_goes_before_its_fallback() {
    let loaded = |fallback: &str| {
        let mesh = format!(
            r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"material":0}}]}}],
            "images":[{{"uri":"nope.png"}}],"textures":[{{"source":0}}],"materials":[{{{fallback}
                "extensions":{{"KHR_materials_pbrSpecularGlossiness":{{"diffuseFactor":[0.1,0.2,0.3,1],"glossinessFactor":0.25}}}}}}]"#
        );
        let (_, loaded) = bounds(r#"{"mesh":0},{}"#, &mesh, &VALUES).unwrap();
        format!("{:?} {:?}", loaded.scene.materials, loaded.scene.textures)
    };
    let alone = loaded("");
    assert_eq!(loaded(r#""pbrMetallicRoughness":{},"#), alone);
    let whole = r#""baseColorFactor":[1,0,0,1],"baseColorTexture":{"index":0},"metallicRoughnessTexture":{"index":0}"#;
    assert_eq!(loaded(&format!(r#""pbrMetallicRoughness":{{{whole}}},"#)), alone);
    assert!(alone.contains("0.75") && alone.contains("0.3"), "{alone}");
}

#[test]
fn texture_coordinates_beyond_the_second_are_told_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    let texture = r#"{"index":0,"texCoord":2}"#;
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"images":[{{"uri":"data:image/png;base64,{PIXEL}"}}],"textures":[{{"source":0}}],
        "materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{texture},"metallicRoughnessTexture":{texture}}},
            "normalTexture":{{"index":0,"extensions":{{"KHR_texture_transform":{{"texCoord":3}}}}}},
            "emissiveTexture":{texture}}},
            {{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0,"texCoord":1}}}}}}]}}"#
    );
    std::fs::write(&path, json).unwrap();
    let said = load(&path, &LoadOptions::default()).unwrap().warnings.to_string();
    assert_eq!(said.matches("TEXCOORD_2 is not read: textures have TEXCOORD_0").count(), 1, "{said}");
    assert_eq!(said.matches("TEXCOORD_3 is not read").count(), 1, "{said}");
    assert!(said.contains("materials[0].pbrMetallicRoughness.baseColorTexture.texCoord"), "{said}");
    assert!(!said.contains("TEXCOORD_1"), "{said}");
}

/// A box of width 2 of absorbing glass that does not refract, from outside in white surroundings.
fn glass(volume: &str) -> Vec<u8> {
    glass_of(1.0, &format!(r#""KHR_materials_volume":{{{volume}}}"#))
}

/// A box of width 2 of glass with the index `ior` and extensions, from outside in white surroundings.
fn glass_of(ior: f32, extensions: &str) -> Vec<u8> {
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0,1]}}],
        "nodes":[{{"mesh":0}},{{"translation":[0.1,0.2,9],"camera":0}}],
        "cameras":[{{"type":"orthographic","orthographic":{{"xmag":0.01,"ymag":0.01,"znear":0.1,"zfar":20}}}}],
        "materials":[{{"pbrMetallicRoughness":{{"metallicFactor":0,"roughnessFactor":0}},"extensions":{{
            "KHR_materials_transmission":{{"transmissionFactor":1}},"KHR_materials_ior":{{"ior":{ior}}},
            {extensions}}}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"material":0}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":8,"type":"VEC3"}},
                     {{"bufferView":1,"componentType":5121,"count":36,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":96}},{{"buffer":0,"byteOffset":96,"byteLength":36}}],
        "buffers":[{{"byteLength":132}}]}}"#
    );
    let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { 1.0 } else { -1.0 });
    let mut bytes = floats(&(0..8).flat_map(corner).collect::<Vec<f32>>());
    // Counterclockwise from outside
    for [a, b, c, d] in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
        bytes.extend([a, b, c, a, c, d]);
    }
    container(&json, bytes)
}

fn load_glass(folder: &Path, bytes: &[u8]) -> Loaded {
    let path = folder.join("a.glb");
    std::fs::write(&path, bytes).unwrap();
    let options = LoadOptions { resolution: Some([4, 4]), ..LoadOptions::default() };
    load(&path, &options).map_err(|r| r.to_string()).unwrap()
}

/// The mean colour of the image.
fn color_of(folder: &Path, bytes: &[u8], spp: u32) -> [f32; 3] {
    let job = load_glass(folder, bytes).job(AccelKind::Embree, None).unwrap();
    let settings = RenderSettings { spp, ..RenderSettings::default() };
    let data = channels(&render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film, &[], None).data;
    [0, 1, 2].map(|c| data.iter().skip(c).step_by(3).sum::<f32>() / 16.0)
}

#[test]
fn dispersion_has_the_abbe_number_of_the_file_and_leaves_white_light_white() {
    let folder = tempfile::tempdir().unwrap();
    let with = |ior: f32, volume: &str| {
        glass_of(ior, &format!(r#""KHR_materials_dispersion":{{"dispersion":4}},"KHR_materials_volume":{{{volume}}}"#))
    };
    let solid = r#""thicknessFactor":1"#;
    let loaded = load_glass(folder.path(), &with(1.5, solid));
    assert!(!loaded.warnings.to_string().contains("dispersion"), "{}", loaded.warnings);
    let entry = &loaded.scene.materials.entries()[0];
    let dispersion = entry.dispersion.as_ref().unwrap();
    // The Abbe number is 5
    let difference = dispersion.eta(486.13) - dispersion.eta(656.27);
    assert!((dispersion.eta(587.56) - 1.5).abs() < 1e-4 && (difference - 0.1).abs() < 1e-3, "{difference}");
    for (ior, volume) in [(1.5, ""), (1.0, solid), (0.0, solid)] {
        assert!(!load_glass(folder.path(), &with(ior, volume)).scene.materials.has_dispersion(), "{ior} {volume}");
    }
    // Smooth glass without absorption loses no uniform light at any wavelength
    let plain = color_of(folder.path(), &glass_of(1.5, &format!(r#""KHR_materials_volume":{{{solid}}}"#)), 1024);
    let dispersed = color_of(folder.path(), &with(1.5, solid), 1024);
    for (a, b) in plain.into_iter().zip(dispersed) {
        assert!((a - b).abs() < 0.02, "{plain:?} {dispersed:?}");
    }
}

#[test]
fn light_in_a_volume_has_the_colour_of_its_distance() {
    let folder = tempfile::tempdir().unwrap();
    let near = |volume: &str, expected: [f32; 3]| {
        let found = color_of(folder.path(), &glass(volume), 2048);
        let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 2e-3, "{volume}: {found:?}, not {expected:?}");
    };
    // The box is two units wide, four times the attenuation distance
    let attenuation = r#""attenuationColor":[0.9,0.5,1],"attenuationDistance":0.5"#;
    near(&format!(r#""thicknessFactor":1,{attenuation}"#), [0.9_f32.powi(4), 0.5_f32.powi(4), 1.0]);
    near(attenuation, [1.0; 3]);
    near(r#""thicknessFactor":1,"attenuationColor":[0.9,0.5,1]"#, [1.0; 3]);
}

/// A square of −1..1 with texture coordinates as in images (set 0) or rotated by 90° (set 1), and tangents along x with
/// the fourth component −1 (`TANGENT` 4) or 1 (`TANGENT` 5). An orthographic camera looks at it from +z.
fn square(nodes: &str, attributes: &str, rest: &str) -> Vec<u8> {
    // Document
    let accessor = |(i, width): (usize, usize)| {
        format!(r#"{{"bufferView":0,"byteOffset":{},"componentType":5126,"count":4,"type":"VEC{width}"}}"#, 64 * i)
    };
    let accessors: Vec<String> = [3, 3, 2, 2, 4, 4].into_iter().enumerate().map(accessor).collect();
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0,1]}}],"nodes":[{{"translation":[0,0,5],"camera":0}},{nodes}],
        "cameras":[{{"type":"orthographic","orthographic":{{"xmag":1,"ymag":1,"znear":0.1,"zfar":20}}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"NORMAL":1,"TEXCOORD_0":2{attributes}}},"indices":6,
            "material":0}}]}}],"textures":[{{"source":0,"sampler":0}}],
        "accessors":[{},{{"bufferView":0,"byteOffset":384,"componentType":5121,"count":6,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":390}}],"buffers":[{{"byteLength":390}}],{rest}}}"#,
        accessors.join(",")
    );

    // Buffer
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let bytes = |element: &dyn Fn([f32; 2]) -> Vec<f32>| {
        let mut bytes = floats(&corners.iter().flat_map(|&c| element(c)).collect::<Vec<f32>>());
        bytes.resize(64, 0);
        bytes
    };
    let all = [
        bytes(&|[x, y]| vec![x, y, 0.0]),
        bytes(&|_| vec![0.0, 0.0, 1.0]),
        bytes(&|[x, y]| vec![(x + 1.0) / 2.0, (1.0 - y) / 2.0]),
        bytes(&|[x, y]| vec![(y + 1.0) / 2.0, (x + 1.0) / 2.0]),
        bytes(&|_| vec![1.0, 0.0, 0.0, -1.0]),
        bytes(&|_| vec![1.0, 0.0, 0.0, 1.0]),
    ];
    container(&json, [all.concat(), vec![0, 1, 2, 0, 2, 3]].concat())
}

/// The channel names and values of an image of 16 × 16 pixels.
fn image_of(bytes: &[u8]) -> (Vec<String>, Vec<f32>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    std::fs::write(&path, bytes).unwrap();
    let options = LoadOptions { resolution: Some([16, 16]), ..LoadOptions::default() };
    let job = load(&path, &options).map_err(|r| r.to_string()).unwrap().job(AccelKind::Embree, None).unwrap();
    let settings = RenderSettings { spp: 4, ..RenderSettings::default() };
    let rendering = render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap();
    let image = channels(&rendering.film, &[Aov::Normal], None);
    (image.names, image.data)
}

#[test]
fn emitted_and_unlit_images_are_filtered_as_their_samplers_say() {
    // Red in the first quadrant
    let image = "iVBORw0KGgoAAAANSUhEUgAAAAIAAAACCAIAAAD91JpzAAAAEklEQVR4nGP4z8DAAMIM/4EAAB/uBfsL2WiLAAAAAElFTkSuQmCC";
    let unlit = r#"{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}},"extensions":{"KHR_materials_unlit":{}}}"#;
    let emissive = r#"{"emissiveFactor":[1,1,1],"emissiveTexture":{"index":0},"extensions":{"KHR_materials_ior":{"ior":1}},
        "pbrMetallicRoughness":{"baseColorFactor":[0,0,0,1],"metallicFactor":0}}"#;
    for material in [unlit, emissive] {
        for (filter, is_nearest) in [(9728, true), (9729, false)] {
            let rest = format!(
                r#""materials":[{material}],"samplers":[{{"magFilter":{filter}}}],
                "images":[{{"uri":"data:image/png;base64,{image}"}}]"#
            );
            let (names, data) = image_of(&square(r#"{"mesh":0}"#, "", &rest));
            // Inside the quadrant, two pixels from the next; the pixel filter has a radius of 1.5
            let pixel = &data[names.len() * (16 * 5 + 5)..][..3];
            let is_red = (pixel[0] - 1.0).abs() < 1e-3 && pixel[1].max(pixel[2]) < 1e-3;
            assert_eq!(is_red, is_nearest, "{material} {filter}: {pixel:?}");
        }
    }
}

#[test]
fn normal_maps_have_the_bitangents_of_their_tangents_or_of_their_texture_coordinates() {
    // (0, sin 30°, cos 30°) in tangent space
    let image = "iVBORw0KGgoAAAANSUhEUgAAAAgAAAAICAIAAABLbSncAAAAEUlEQVR4nGNo2P8OK2IYWhIATXKLQdHJGNsAAAAASUVORK5CYII=";
    let normal = |node: &str, attributes: &str, set: u32| {
        let rest = format!(
            r#""materials":[{{"normalTexture":{{"index":0,"texCoord":{set}}}}}],"samplers":[{{}}],
            "images":[{{"uri":"data:image/png;base64,{image}"}}]"#
        );
        let (names, data) = image_of(&square(node, attributes, &rest));
        let at = names.iter().position(|name| name == "normal.X").unwrap();
        Vec3::from_slice(&data[names.len() * (16 * 5 + 5) + at..])
    };
    let plain = r#"{"mesh":0}"#;
    let mirrored = r#"{"mesh":0,"scale":[-1,1,1]}"#;
    let (sin, cos) = (0.5, 0.75_f32.sqrt());
    let (up, down, left) = (Vec3::new(0.0, sin, cos), Vec3::new(0.0, -sin, cos), Vec3::new(-sin, 0.0, cos));
    for (node, attributes, set, expected) in [
        (plain, "", 0, up),
        (plain, r#","TANGENT":5"#, 0, up),
        (plain, r#","TANGENT":4"#, 0, down),
        // A mirrored node flips only the component along x
        (mirrored, r#","TANGENT":5"#, 0, up),
        (mirrored, r#","TANGENT":4"#, 0, down),
        (plain, r#","TEXCOORD_1":3"#, 0, up),
        (plain, r#","TEXCOORD_1":3"#, 1, left),
        (mirrored, r#","TEXCOORD_1":3"#, 1, left * Vec3::new(-1.0, 1.0, 1.0)),
        (plain, r#","TEXCOORD_1":3,"TANGENT":4"#, 1, down),
    ] {
        let found = normal(node, attributes, set);
        assert!((found - expected).length() < 0.02, "{node} {attributes} {set}: {found}, not {expected}");
    }
}

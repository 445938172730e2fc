//! Display images and EXR files: exposure and view transforms, layers, storage and attributes.

use super::program::{self, folder_with, read, stderr};
use lumiris::imaging::oiio::{ReadImage, ReadLimits, read_headers, read_part};
use lumiris::render::cryptomatte::{hash, id};
use std::path::Path;
use std::process::{Command, Output};

/// The program without an OpenColorIO configuration.
fn command(folder: &Path, args: &str) -> Command {
    let mut command = program::command(folder, args);
    command.env_remove("OCIO");
    command
}

fn render(folder: &Path, args: &str) -> Output {
    let output = command(folder, &format!("render scene.pbrt -q {args}")).output().unwrap();
    assert!(output.status.success(), "{args}: {}", stderr(&output));
    output
}

/// The bytes of the first pixel.
fn first(image: &ReadImage) -> [u8; 3] {
    ["R", "G", "B"].map(|c| (image.image.get(0, 0, image.image.channel(c).unwrap()) * 255.0).round() as u8)
}

/// A sky of one colour, and an OpenColorIO configuration that halves colours or permutes their channels.
fn sky() -> tempfile::TempDir {
    let scene = "Film \"rgb\" \"integer xresolution\" [ 8 ] \"integer yresolution\" [ 6 ]\n\
                 Sampler \"independent\" \"integer pixelsamples\" [ 1 ]\nWorldBegin\n\
                 LightSource \"infinite\" \"rgb L\" [ 0.2 0.4 0.6 ]\n";
    let folder = folder_with(scene);
    let config = "ocio_profile_version: 2\nroles: {default: raw}\nfile_rules:\n  - !<Rule> {name: Default, colorspace: raw}\n\
                  displays:\n  Screen:\n    - !<View> {name: Half, colorspace: half}\n    - !<View> {name: Turned, colorspace: turned}\n\
                  colorspaces:\n  - !<ColorSpace> {name: raw, isdata: true}\n  - !<ColorSpace> {name: Linear Rec.709 (sRGB)}\n\
                  \x20 - !<ColorSpace>\n    name: half\n    from_scene_reference: !<MatrixTransform> {matrix: [0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 1]}\n\
                  \x20 - !<ColorSpace>\n    name: turned\n    from_scene_reference: !<MatrixTransform> {matrix: [0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 0, 0, 0, 0, 1]}\n";
    std::fs::write(folder.path().join("config.ocio"), config).unwrap();
    folder
}

#[test]
fn exposure_and_view_transform_are_part_of_the_image_and_of_its_metadata() {
    let folder = sky();
    let look = |args: &str| {
        render(folder.path(), &format!("{args} -o a.png"));
        let image = read(folder.path(), "a.png");
        let entry = |key: &str| image.metadata.get(&format!("lumiris:{key}")).cloned().unwrap_or_default();
        (first(&image), entry("exposure"), entry("view_transform"))
    };
    let srgb = |v: f32| (lumiris::imaging::color::linear_to_srgb(v) * 255.0).round() as u8;
    assert_eq!(look(""), ([srgb(0.2), srgb(0.4), srgb(0.6)], "0".to_owned(), "srgb".to_owned()));
    assert_eq!(look("--exposure -1").0, [srgb(0.1), srgb(0.2), srgb(0.3)]);
    // The luminance becomes middle grey, whatever the colour
    let (_, exposure, _) = look("--exposure auto");
    let luminance = 0.2126 * 0.2 + 0.7152 * 0.4 + 0.0722 * 0.6;
    assert!((exposure.parse::<f64>().unwrap() - (0.18_f64 / luminance).log2()).abs() < 1e-3, "{exposure}");
    assert_eq!(look(&format!("--exposure {exposure}")).0, look("--exposure auto").0);

    let (filmic, _, name) = look("--view-transform filmic");
    assert_eq!(name, "filmic");
    let (agx, _, name) = look("--view-transform agx");
    assert_eq!(name, "agx");
    assert!(filmic != agx && filmic[0] < filmic[1] && agx[0] < agx[1], "{filmic:?} {agx:?}");
    for wrong in ["--exposure bright", "--view-transform aces", "--ocio-view Half", "--view-transform ocio"] {
        let output = command(folder.path(), &format!("render scene.pbrt {wrong} -o b.png")).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{wrong}: {}", String::from_utf8_lossy(&output.stderr));
    }
}

#[test]
fn a_configuration_of_open_color_io_makes_the_colours_of_its_views() {
    // Displays, views and inputs
    let folder = sky();
    let run = |args: &str| {
        let args = format!("render scene.pbrt -q --view-transform ocio -o a.png {args}");
        let output = command(folder.path(), &args).env("OCIO", "config.ocio").output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let bytes = |rgb: [f32; 3]| rgb.map(|v| (v * 255.0_f32).round());
    for (args, expected, name) in [
        ("", [0.1, 0.2, 0.3], "Screen, Half"),
        ("--ocio-view Turned --exposure -1", [0.2, 0.3, 0.1], "Screen, Turned"),
        ("--ocio-display Screen --ocio-view Half --ocio-input half", [0.2, 0.4, 0.6], "Screen, Half"),
    ] {
        assert_eq!(run(args), (Some(0), String::new()), "{args}");
        let image = read(folder.path(), "a.png");
        let off = first(&image).iter().zip(bytes(expected)).all(|(a, b)| (f32::from(*a) - b).abs() <= 1.0);
        assert!(off, "{args}: {:?}", first(&image));
        assert!(image.metadata["lumiris:view_transform"].ends_with(name), "{:?}", image.metadata);
    }

    // Names that the configuration does not have
    std::fs::remove_file(folder.path().join("a.png")).unwrap();
    for wrong in ["--ocio-view Sepia", "--ocio-display Wall", "--ocio-input nothing"] {
        let (code, text) = run(wrong);
        assert!(code == Some(3) && text.contains("OpenColorIO: "), "{wrong}: {text}");
        assert!(!folder.path().join("a.png").exists());
    }

    // No common name of linear Rec.709
    let config = std::fs::read_to_string(folder.path().join("config.ocio")).unwrap();
    std::fs::write(folder.path().join("config.ocio"), config.replace("Linear Rec.709 (sRGB)", "ACEScg")).unwrap();
    let (code, text) = run("");
    assert!(code == Some(3) && text.contains("--ocio-input"), "{text}");
}

/// Two spheres of one kind, a third from an instance, and a floor; three materials.
fn shapes() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let scene = "LookAt 0 0 -6 0 0 0 0 1 0\nCamera \"perspective\" \"float fov\" [ 50 ]\n\
                 Film \"rgb\" \"integer xresolution\" [ 48 ] \"integer yresolution\" [ 32 ]\n\
                 Sampler \"independent\" \"integer pixelsamples\" [ 1 ]\nPixelFilter \"box\"\nWorldBegin\n\
                 LightSource \"infinite\"\nMakeNamedMaterial \"red \\\"paint\\\"\" \"string type\" \"diffuse\"\n\
                 NamedMaterial \"red \\\"paint\\\"\"\nShape \"sphere\"\n\
                 AttributeBegin\nMaterial \"conductor\"\nTranslate 1.4 0.3 0.5\nShape \"sphere\"\nAttributeEnd\n\
                 ObjectBegin \"o\"\nMaterial \"dielectric\"\nShape \"sphere\" \"float radius\" [ 0.7 ]\nObjectEnd\n\
                 AttributeBegin\nTranslate -2 0 0\nObjectInstance \"o\"\nAttributeEnd\n\
                 AttributeBegin\nTranslate -1.2 1 0.4\nObjectInstance \"o\"\nAttributeEnd\n\
                 Shape \"disk\" \"float height\" [ 2 ] \"float radius\" [ 1.7 ]\n";
    std::fs::write(folder.path().join("scene.pbrt"), scene).unwrap();
    folder
}

/// Ids and coverages of a pixel.
fn ranks(image: &ReadImage, layer: &str, pixel: usize) -> Vec<(f32, f32)> {
    let channels =
        (0..3).flat_map(|group| [["R", "G"], ["B", "A"]].map(|pair| pair.map(|c| format!("{layer}{group:02}.{c}"))));
    let value = |name: &str| image.image.data[pixel * image.image.channels.len() + image.image.channel(name).unwrap()];
    channels.map(|[id, coverage]| (value(&id), value(&coverage))).filter(|(_, coverage)| *coverage > 0.0).collect()
}

#[test]
fn cryptomattes_are_those_of_the_samples_that_make_the_image() {
    let folder = shapes();
    // With one sample per pixel, the channels `object` and `material` have the same surface
    render(folder.path(), "--cryptomatte --estimator mis -o a.exr");
    let image = read(folder.path(), "a.exr");
    let value = |name: &str, pixel: usize| {
        image.image.data[pixel * image.image.channels.len() + image.image.channel(name).unwrap()] as usize
    };
    let materials = ["red \"paint\"", "conductor", "dielectric"];
    let mut seen = std::collections::BTreeSet::new();
    for pixel in 0..48 * 32 {
        let (objects, of_materials) = (ranks(&image, "CryptoObject", pixel), ranks(&image, "CryptoMaterial", pixel));
        let names: &[&str] = match value("object", pixel) {
            0 => {
                assert!(objects.is_empty() && of_materials.is_empty());
                continue;
            }
            1 => &["sphere"],
            2 => &["sphere.1"],
            3 => &["sphere.2@0", "sphere.2@1"],
            _ => &["disk"],
        };
        let name = names.iter().find(|name| objects == [(id(hash(name)), 1.0)]);
        seen.insert(*name.unwrap_or_else(|| panic!("{objects:?} is none of {names:?}")));
        let material = materials.iter().find(|name| of_materials == [(id(hash(name)), 1.0)]);
        let expected = match value("object", pixel) {
            2 => "conductor",
            3 => "dielectric",
            _ => "red \"paint\"",
        };
        assert_eq!(material, Some(&expected));
    }
    assert_eq!(seen.len(), 5, "{seen:?}");

    // Metadata entries, keyed by the first seven digits of the hash of the layer's name
    let key = |layer: &str, entry: &str| {
        let digits = format!("{:08x}", hash(layer));
        image.metadata[&format!("cryptomatte/{}/{entry}", &digits[..7])].clone()
    };
    assert_eq!(key("CryptoObject", "name"), "CryptoObject");
    assert_eq!(key("CryptoMaterial", "hash"), "MurmurHash3_32");
    assert_eq!(key("CryptoMaterial", "conversion"), "uint32_to_float32");
    let manifest: serde_json::Value = serde_json::from_str(&key("CryptoObject", "manifest")).unwrap();
    let names: Vec<&String> = manifest.as_object().unwrap().keys().collect();
    assert_eq!(names, seen.iter().collect::<Vec<_>>());
    assert_eq!(manifest["disk"], format!("{:08x}", hash("disk")));
    let manifest: serde_json::Value = serde_json::from_str(&key("CryptoMaterial", "manifest")).unwrap();
    assert_eq!(manifest[materials[0]], format!("{:08x}", hash(materials[0])));
}

#[test]
fn coverage_is_a_share_of_samples_and_survives_parts_and_compression() {
    // One file with the ids among other layers, one with separate parts, lossy compression and 16 bits
    let folder = shapes();
    let common = "--cryptomatte=object --spp 16 --estimator mis --threads";
    render(folder.path(), &format!("{common} 1 -o a.exr"));
    render(
        folder.path(),
        &format!("{common} 2 --tile-size 7 -o b.exr --exr-parts multi --exr-compression dwaa --exr-type half"),
    );

    // Parts and their storage
    let image = read(folder.path(), "a.exr");
    let headers = read_headers(&folder.path().join("b.exr")).unwrap();
    let names: Vec<&str> = headers.iter().map(|h| h.name.as_str()).collect();
    assert_eq!(
        names,
        ["beauty", "variance", "samples", "albedo", "normal", "depth", "material", "object", "CryptoObject"]
    );
    let part = |index| read_part(&folder.path().join("b.exr"), index, &ReadLimits::default()).unwrap();
    let (beauty, ids) = (part(0), part(8));
    assert!(beauty.is_half && beauty.metadata["compression"].starts_with("dwaa"), "{:?}", beauty.metadata);
    assert!(!ids.is_half && ids.metadata["compression"] == "zip");
    assert!(beauty.metadata.keys().any(|key| key.starts_with("cryptomatte/")));

    // Ids and coverages are the same in both; colours only roughly
    let (mut mixed, mut sum, mut depth) = (0, 0.0, 0);
    for pixel in 0..48 * 32 {
        let ranked = ranks(&image, "CryptoObject", pixel);
        assert_eq!(ranked, ranks(&ids, "CryptoObject", pixel));
        assert!(ranked.iter().all(|(_, c)| (c * 16.0).fract() == 0.0), "{ranked:?}");
        assert!(ranked.is_sorted_by(|a, b| a.1 >= b.1), "{ranked:?}");
        let covered: f32 = ranked.iter().map(|(_, c)| c).sum();
        assert!(covered <= 1.0);
        mixed += usize::from(ranked.len() > 1);
        sum += covered;
        let channels = image.image.channels.len();
        depth += usize::from(image.image.data[pixel * channels + image.image.channel("depth.Z").unwrap()].is_finite());
        let value = |image: &ReadImage, c| {
            image.image.data[pixel * image.image.channels.len() + image.image.channel(c).unwrap()]
        };
        assert!((value(&image, "G") - value(&beauty, "G")).abs() < 0.05 * value(&image, "G").max(0.1));
    }
    assert!(mixed > 20 && sum > 300.0 && (sum as usize) < depth, "{mixed} {sum} {depth}");

    // Lossy compression of ids in one part is refused
    let wrong = "render scene.pbrt --cryptomatte --exr-compression dwaa -o c.exr";
    assert_eq!(command(folder.path(), wrong).output().unwrap().status.code(), Some(2));
}

#[test]
fn exr_files_have_the_standard_attributes_of_openexr() {
    let folder = shapes();
    render(folder.path(), "-o a.exr --aov none --exr-compression piz");
    let bytes = std::fs::read(folder.path().join("a.exr")).unwrap();
    let header = String::from_utf8_lossy(&bytes[..2000.min(bytes.len())]).into_owned();
    for attribute in ["worldToCamera\0m44f\0", "worldToNDC\0m44f\0", "software\0string\0", "renderTime\0float\0"] {
        assert!(header.contains(attribute), "{attribute:?} in {header:?}");
    }
    let value = |name: &str, index: usize| {
        let start = bytes.windows(name.len()).position(|w| w == name.as_bytes()).unwrap() + name.len() + 10 + 4 * index;
        f32::from_le_bytes(bytes[start..start + 4].try_into().unwrap())
    };
    // The camera is at z = -6 and points along +z: the origin is in the middle of the image, 6 ahead
    assert_eq!([12, 13, 14, 15].map(|i| value("worldToCamera", i).abs()), [0.0, 0.0, 6.0, 1.0]);
    let [x, y, w] = [12, 13, 15].map(|i| value("worldToNDC", i));
    assert!((x / w - 0.5).abs() < 1e-6 && (y / w - 0.5).abs() < 1e-6, "{x} {y} {w}");
    let image = read(folder.path(), "a.exr");
    assert_eq!(image.metadata["compression"], "piz");
}

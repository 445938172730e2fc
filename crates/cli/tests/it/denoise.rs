//! Denoising: the added layer, and messages if it cannot be computed.
//!
//! `make test-denoise` runs the tests that need the library, whose path is in LUMIRIS_OIDN.

use super::program::{command, folder_with, read, stderr};
use lumiris::imaging::oiio::{Part, ReadImage, ReadLimits, read_headers, read_metadata, read_part, write_image};
use std::path::Path;
use std::process::Output;

const SCENE: &str = "Film \"rgb\" \"integer xresolution\" [ 64 ] \"integer yresolution\" [ 48 ]\n\
                     PixelFilter \"box\"\nCamera \"perspective\"\nSampler \"independent\" \"integer pixelsamples\" [ 4 ]\n\
                     WorldBegin\nLightSource \"infinite\" \"rgb L\" [ 0.5 0.6 0.8 ]\nTranslate 0 0 3\n\
                     Material \"diffuse\" \"rgb reflectance\" [ 0.8 0.4 0.2 ]\nShape \"sphere\"\n";

fn folder() -> tempfile::TempDir {
    folder_with(SCENE)
}

/// Exit code and messages. The library is named by LUMIRIS_OIDN.
fn run(folder: &Path, args: &str) -> (Option<i32>, String) {
    said(&command(folder, args).output().unwrap())
}

fn said(output: &Output) -> (Option<i32>, String) {
    (output.status.code(), stderr(output))
}

fn succeed(folder: &Path, args: &str) -> String {
    let (code, text) = run(folder, args);
    assert_eq!(code, Some(0), "{args}: {text}");
    text
}

fn bits(image: &ReadImage, names: [&str; 3]) -> Vec<u32> {
    let channels = names.map(|name| image.image.channel(name).unwrap_or_else(|| panic!("{name} is missing")));
    let pixels = image.image.data.chunks_exact(image.image.channels.len());
    pixels.flat_map(|pixel| channels.map(|c| pixel[c].to_bits())).collect()
}

const RGB: [&str; 3] = ["R", "G", "B"];
const DENOISED: [&str; 3] = ["denoised.R", "denoised.G", "denoised.B"];

#[test]
fn without_the_library_nothing_is_rendered_and_the_message_says_how_to_get_it() {
    let folder = folder();
    let path = folder.path();
    write_image(&path.join("in.exr"), &[Part::linear(1, 1, RGB.map(str::to_owned).to_vec(), vec![1.0; 3])]).unwrap();
    std::fs::write(path.join("text.so"), "no library").unwrap();
    for library in ["none.so", "text.so", "libm.so.6"] {
        // The scene does not exist; it is not even read
        for args in ["render none.pbrt --denoise -o a.exr", "denoise in.exr -o a.exr"] {
            let by_option = run(path, &format!("{args} --oidn-library {library}"));
            let by_variable = said(&command(path, args).env("LUMIRIS_OIDN", library).output().unwrap());
            for (code, text) in [by_option, by_variable] {
                assert_eq!(code, Some(3), "{args}: {text}");
                for part in ["Open Image Denoise cannot be loaded: ", library, "openimagedenoise.org", "LUMIRIS_OIDN"] {
                    assert!(text.contains(part), "{args} {library}: {text}");
                }
            }
            assert!(!path.join("a.exr").exists());
        }
    }
}

#[test]
fn options_that_would_lose_the_image_itself_are_refused() {
    let folder = folder();
    let path = folder.path();
    std::fs::write(path.join("in.png"), "").unwrap();
    for (args, reason) in [
        ("render scene.pbrt --denoise -o a.png", "needs an EXR file"),
        ("render scene.pbrt --denoise --part 1/2 -o a.part", "merge the parts"),
        ("render scene.pbrt --oidn-library a.so -o a.exr", "--denoise"),
        ("merge a.part --denoise -o a.png", "needs an EXR file"),
        ("denoise in.exr -o a.part", "as a part"),
        ("denoise in.png -o a.exr", "only EXR"),
    ] {
        // Impossible options are refused whether or not there is a library
        let (code, text) = run(path, args);
        assert!(code == Some(2) && text.contains(reason), "{args}: {code:?} {text}");
    }
}

#[test]
#[ignore = "needs Open Image Denoise: make test-denoise"]
fn the_denoised_layer_stands_beside_the_image_and_png_shows_it() {
    let folder = folder();
    let path = folder.path();
    succeed(path, "render scene.pbrt -q -o raw.exr -o raw.png");
    succeed(path, "render scene.pbrt -q --denoise --aov none --threads 1 -o a.exr -o a.png");
    let [raw, a] = ["raw.exr", "a.exr"].map(|name| read(path, name));
    assert!(bits(&raw, RGB) == bits(&a, RGB), "the image itself changes");
    assert!(bits(&a, RGB) != bits(&a, DENOISED));
    assert_eq!(a.image.channels.len(), 6, "{:?}", a.image.channels);
    let about = |name: &str| read_metadata(&path.join(name)).unwrap().get("lumiris:denoised").cloned();
    assert_eq!(about("raw.exr"), None);
    let text = about("a.exr").unwrap();
    assert!(text.starts_with("Open Image Denoise 2.") && text.ends_with("by colour, albedo and normal"), "{text}");
    assert_eq!(about("a.png"), Some(text));
    let shown = |name: &str| read_metadata(&path.join(name)).unwrap().get("lumiris:layer").cloned();
    assert_eq!((shown("raw.png"), shown("a.png")), (None, Some("denoised".to_owned())));
    assert!(read(path, "raw.png").image != read(path, "a.png").image);

    // The same from the file, with another number of threads
    succeed(path, "denoise raw.exr -q --threads 2 -o b.exr -o b.png");
    let b = read(path, "b.exr");
    assert!(bits(&a, DENOISED) == bits(&b, DENOISED), "the file has other layers than the film");
    assert!(bits(&raw, RGB) == bits(&b, RGB));
    assert_eq!(b.image.channels.len(), raw.image.channels.len() + 3);
    assert_eq!(read(path, "a.png").image, read(path, "b.png").image);
    for (key, value) in &raw.metadata {
        assert_eq!(b.metadata.get(key), Some(value), "{key}");
    }
    // The same from parts
    for i in 1..3 {
        succeed(path, &format!("render scene.pbrt -q --part {i}/2 -o {i}.part"));
    }
    succeed(path, "merge 1.part 2.part -q --denoise -o merged.exr -o merged.png");
    let merged = read(path, "merged.exr");
    assert!(bits(&merged, DENOISED) == bits(&a, DENOISED) && bits(&merged, RGB) == bits(&raw, RGB));
    assert_eq!(read(path, "merged.png").image, read(path, "a.png").image);
    succeed(path, "render scene.pbrt -q --aov none -o bare.part");
    let said = succeed(path, "merge bare.part -q --denoise -o bare.exr");
    assert!(said.contains("neither albedo nor normal"), "{said}");
    assert!(about("bare.exr").unwrap().ends_with("by colour"));

    // Denoising again replaces the layer
    succeed(path, "denoise b.exr -q -o b.exr");
    assert!(b.image == read(path, "b.exr").image);
}

#[test]
#[ignore = "needs Open Image Denoise: make test-denoise"]
fn in_files_of_several_parts_the_layer_is_a_part() {
    let folder = folder();
    let path = folder.path();
    let exr = "--exr-parts multi --exr-type half --crop 0.25,1,0,0.5";
    succeed(path, &format!("render scene.pbrt -q {exr} -o raw.exr"));
    succeed(path, &format!("render scene.pbrt -q {exr} --denoise -o a.exr"));
    succeed(path, "denoise raw.exr -q -o b.exr");
    for name in ["a.exr", "b.exr"] {
        let headers = read_headers(&path.join(name)).unwrap();
        let part = headers.iter().position(|h| h.name == "denoised").unwrap_or_else(|| panic!("{name}: {headers:?}"));
        assert_eq!(headers.len(), read_headers(&path.join("raw.exr")).unwrap().len() + 1);
        let read = read_part(&path.join(name), part, &ReadLimits::default()).unwrap();
        assert_eq!((read.image.width, read.image.height, read.window.origin), (48, 24, [16, 0]));
        assert!(read.is_half && read.image.channel("denoised.R").is_some(), "{name}");
    }
}

#[test]
#[ignore = "needs Open Image Denoise: make test-denoise"]
fn missing_layers_are_a_warning_and_values_that_are_not_finite_do_no_harm() {
    // Without guides, and with values that are not finite
    let folder = folder();
    let path = folder.path();
    let mut data: Vec<f32> = (0..32 * 32 * 3).map(|i| (i * 7919 % 101) as f32 / 101.0).collect();
    (data[300], data[900]) = (f32::NAN, f32::INFINITY);
    let names = RGB.map(str::to_owned).to_vec();
    write_image(&path.join("in.exr"), &[Part::linear(32, 32, names, data)]).unwrap();
    let text = succeed(path, "denoise in.exr -q -o out.exr");
    assert!(text.contains("warning: has neither albedo nor normal"), "{text}");
    let out = read(path, "out.exr");
    assert!(bits(&out, DENOISED).into_iter().all(|b| f32::from_bits(b).is_finite()));
    assert!(bits(&out, RGB) == bits(&read(path, "in.exr"), RGB));

    // Missing layers
    succeed(path, "render scene.pbrt -q --aov albedo -o albedo.exr");
    let text = succeed(path, "denoise albedo.exr -q -o out.exr");
    assert!(text.contains("warning: has no layer normal"), "{text}");
    write_image(&path.join("grey.exr"), &[Part::linear(1, 1, vec!["Y".to_owned()], vec![1.0])]).unwrap();
    let (code, text) = run(path, "denoise grey.exr -o out.exr");
    assert!(code == Some(3) && text.contains("no channels R, G and B"), "{text}");
}

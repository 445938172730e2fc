//! Files that are written can be read again.

mod common;

use common::*;
use openimageio_sys::*;

/// Asserts the metadata written to both parts.
fn assert_metadata(input: &Input) {
    let attributes = input.attributes(0);
    let value = |name: &str| (attributes[name].0.as_str(), attributes[name].1.as_str());
    assert_eq!(value("lumiris:settings"), ("string", "ris \"M=32\"\nN=4"));
    assert_eq!(value("lumiris:samples"), ("int", "64"));
    assert_eq!(value("oiio:subimagename"), ("string", "beauty"));
    assert_eq!(value("compression"), ("string", "zip"));
    assert_eq!(attributes["lumiris:world_from_camera"].0, "matrix");
    assert_eq!(input.floats(0, "lumiris:time"), [0.1]);
    let matrix: Vec<f32> = (0..16).map(|i| i as f32 + 0.1).collect();
    assert_eq!(input.floats(0, "lumiris:world_from_camera"), matrix);
    assert_eq!(input.attributes(1)["lumiris:part"].1, "second part");
}

#[test]
fn an_exr_of_two_parts_keeps_channels_formats_and_metadata() {
    let beauty = [
        ("R", OIIO_FORMAT_HALF),
        ("G", OIIO_FORMAT_HALF),
        ("B", OIIO_FORMAT_HALF),
        ("albedo.R", OIIO_FORMAT_HALF),
        ("Z", OIIO_FORMAT_FLOAT),
        ("variance", OIIO_FORMAT_FLOAT),
    ];
    let light = [("L.R", OIIO_FORMAT_FLOAT), ("L.G", OIIO_FORMAT_FLOAT)];
    let part = |name, compression, channels| Part { name, compression, width: 9, height: 5, channels };
    let path = temp("two_parts.exr");
    let output = Output::create(&path, &[part("beauty", "zip", &beauty), part("light", "none", &light)]).unwrap();
    output.set_string(0, "lumiris:settings", "ris \"M=32\"\nN=4");
    output.set_numbers(0);
    output.set_string(1, "lumiris:part", "second part");
    output.open().unwrap();

    // The first part in two steps, the second at once
    let first = noise(9 * 5 * 6);
    let second: Vec<f32> = noise(9 * 5 * 2).iter().map(|v| v * 1e6).collect();
    output.write(0, 0, 2, &first[..9 * 2 * 6]).unwrap();
    output.write(0, 2, 3, &first[9 * 2 * 6..]).unwrap();
    output.write(1, 0, 5, &second).unwrap();
    output.close().unwrap();
    drop(output);

    let input = Input::open(&path, false).unwrap();
    assert_eq!(input.format_name(), "openexr");
    assert_eq!(input.subimages().unwrap(), 2);
    let spec = input.spec(0).unwrap();
    assert_eq!((spec.width, spec.height, spec.depth, spec.nchannels), (9, 5, 1, 6));
    assert_eq!((spec.full_width, spec.full_height, spec.deep), (9, 5, 0));

    // Channels are in another order, with their original formats
    let found = input.channels(0);
    let pixels = input.read(0, LIMIT).unwrap();
    for (c, (name, format)) in beauty.iter().enumerate() {
        let at = found.iter().position(|channel| channel.0 == *name).unwrap();
        assert_eq!(found[at].1, *format, "{name}");
        for pixel in 0..9 * 5 {
            let (wrote, read) = (first[pixel * 6 + c], pixels[pixel * 6 + at]);
            let tolerance = if *format == OIIO_FORMAT_HALF { wrote / 2048.0 } else { 0.0 };
            assert!((wrote - read).abs() <= tolerance, "{name}: {wrote} {read}");
        }
    }
    let found = input.channels(1);
    let pixels = input.read(1, LIMIT).unwrap();
    for (c, (name, _)) in light.iter().enumerate() {
        let at = found.iter().position(|channel| channel.0 == *name).unwrap();
        assert!((0..45).all(|pixel| second[pixel * 2 + c] == pixels[pixel * 2 + at]));
    }

    assert_metadata(&input);
}

#[test]
fn a_png_keeps_eight_bit_values() {
    let rgb = [("R", OIIO_FORMAT_U8), ("G", OIIO_FORMAT_U8), ("B", OIIO_FORMAT_U8)];
    let wrote: Vec<f32> = (0..=255).flat_map(|i| [i as f32 / 255.0, 0.5, 1.0]).collect();
    let path = temp("levels.png");
    write_picture(&path, 16, 16, &rgb, &wrote).unwrap();

    let input = Input::open(&path, false).unwrap();
    assert_eq!(input.format_name(), "png");
    assert_eq!(input.spec(0).unwrap().format, OIIO_FORMAT_U8);
    assert_eq!(input.subimages().unwrap(), 1);
    let read = input.read(0, LIMIT).unwrap();
    for (wrote, read) in wrote.iter().zip(&read) {
        assert_eq!((wrote * 255.0 + 0.5) as u8, (read * 255.0 + 0.5) as u8);
    }
}

#[test]
fn unassociated_alpha_leaves_colours_as_stored() {
    let rgba = [("R", OIIO_FORMAT_U8), ("G", OIIO_FORMAT_U8), ("B", OIIO_FORMAT_U8), ("A", OIIO_FORMAT_U8)];
    let path = temp("alpha.png");
    let part = Part { name: "", compression: "", width: 2, height: 1, channels: &rgba };
    let output = Output::create(&path, &[part]).unwrap();
    // The writer must not divide by alpha either
    let name = c("oiio:UnassociatedAlpha");
    // SAFETY: the handle is live, the name ends in a zero byte.
    check(|e, n| unsafe { (api().output_set_int)(output.0, 0, name.as_ptr(), 1, e, n) }).unwrap();
    output.open().unwrap();
    output.write(0, 0, 1, &[1.0, 0.4, 0.2, 0.2, 1.0, 0.4, 0.2, 0.0]).unwrap();
    output.close().unwrap();

    let stored = Input::open(&path, true).unwrap().read(0, LIMIT).unwrap();
    assert_eq!(
        stored.iter().map(|v| (v * 255.0).round() as u8).collect::<Vec<_>>(),
        [255, 102, 51, 51, 255, 102, 51, 0]
    );
    let multiplied = Input::open(&path, false).unwrap().read(0, LIMIT).unwrap();
    assert_eq!(multiplied.iter().map(|v| (v * 255.0).round() as u8).collect::<Vec<_>>(), [51, 20, 10, 51, 0, 0, 0, 0]);
}

#[test]
fn data_and_display_windows_are_kept() {
    let path = temp("windows.exr");
    let output = Output::create(&path, &[]).unwrap();
    let name = c("Y");
    let part = OiioPart {
        name: std::ptr::null(),
        compression: std::ptr::null(),
        width: 4,
        height: 3,
        x: -1,
        y: 2,
        full_x: 0,
        full_y: 0,
        full_width: 10,
        full_height: 8,
        nchannels: 1,
        channel_names: &name.as_ptr(),
        channel_formats: &OIIO_FORMAT_FLOAT,
    };
    // SAFETY: the handle is live, and the one name and format live until the end of the call.
    check(|e, n| unsafe { (api().output_add_part)(output.0, &part, e, n) }).unwrap();
    output.open().unwrap();
    let wrote = noise(12);
    output.write(0, 0, 1, &wrote[..4]).unwrap();
    output.write(0, 1, 2, &wrote[4..]).unwrap();
    output.close().unwrap();

    let input = Input::open(&path, false).unwrap();
    let spec = input.spec(0).unwrap();
    assert_eq!((spec.x, spec.y, spec.width, spec.height), (-1, 2, 4, 3));
    assert_eq!((spec.full_x, spec.full_y, spec.full_width, spec.full_height), (0, 0, 10, 8));
    assert_eq!(input.read(0, LIMIT).unwrap(), wrote);
}

#[test]
fn the_library_tells_its_version_and_extensions() {
    // SAFETY: both functions take nothing and return strings that live forever.
    let (version, extensions) = unsafe { (string((api().version)()), string((api().extensions)())) };
    let numbers: Vec<u32> = version.split('.').map(|n| n.parse().unwrap()).collect();
    assert!((2..4).contains(&numbers[0]), "{version}");
    for wanted in ["openexr:exr", "png:png", "jpeg:jpg", "hdr:", "targa:tga"] {
        assert!(extensions.contains(wanted), "{wanted}: {extensions}");
    }
}

#[test]
fn threads_can_be_set_and_an_unknown_attribute_is_an_error() {
    let set = |name: &str, value| {
        let name = c(name);
        // SAFETY: the name ends in a zero byte.
        check(|e, n| unsafe { (api().set_int)(name.as_ptr(), value, e, n) })
    };
    set("threads", 2).unwrap();
    set("exr_threads", 2).unwrap();
    assert_eq!(set("no such attribute", 1).unwrap_err().0, OIIO_INVALID_ARGUMENT);
}

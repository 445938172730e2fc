//! Impossible reads and writes are errors with messages: never a crash, never a false success.

mod common;

use common::*;
use openimageio_sys::*;
use std::fs;

const RGB_U8: [(&str, i32); 3] = [("R", OIIO_FORMAT_U8), ("G", OIIO_FORMAT_U8), ("B", OIIO_FORMAT_U8)];
const RGB_FLOAT: [(&str, i32); 3] = [("R", OIIO_FORMAT_FLOAT), ("G", OIIO_FORMAT_FLOAT), ("B", OIIO_FORMAT_FLOAT)];

#[test]
fn a_missing_file_gives_a_message_that_names_it() {
    let (code, message) = Input::open(&temp("missing.exr"), false).err().unwrap();
    assert_eq!(code, OIIO_CANNOT_OPEN);
    assert!(message.contains("missing.exr"), "{message}");
}

#[test]
fn a_text_file_is_not_a_picture() {
    let path = temp("text.png");
    fs::write(&path, "not a picture").unwrap();
    let (code, message) = Input::open(&path, false).err().unwrap();
    assert_eq!(code, OIIO_CANNOT_OPEN);
    assert!(!message.is_empty());
}

#[test]
fn a_message_is_cut_to_the_buffer_and_ends_in_zero() {
    let path = c("/no/such/directory/picture.exr");
    let mut input = std::ptr::null_mut();
    let mut message = [0x7F_i8 as std::ffi::c_char; 8];
    // SAFETY: seven bytes and a zero fit into the buffer of eight bytes.
    let code = unsafe { (api().input_open)(path.as_ptr(), 0, &mut input, message.as_mut_ptr(), 8) };
    assert_eq!(code, OIIO_CANNOT_OPEN);
    assert!(input.is_null());
    assert_eq!(string(message.as_ptr()).len(), 7);
    // SAFETY: a null buffer is allowed, too.
    let code = unsafe { (api().input_open)(path.as_ptr(), 0, &mut input, std::ptr::null_mut(), 0) };
    assert_eq!(code, OIIO_CANNOT_OPEN);
}

#[test]
fn a_picture_above_the_limit_is_refused_before_it_is_read() {
    let path = temp("limit.exr");
    write_picture(&path, 8, 8, &RGB_FLOAT, &noise(192)).unwrap();
    let input = Input::open(&path, false).unwrap();
    assert_eq!(input.read(0, 768).unwrap().len(), 192);
    let (code, message) = input.read(0, 767).unwrap_err();
    assert_eq!(code, OIIO_TOO_LARGE);
    assert!(message.contains("8 x 8 pixels of 3 channels"), "{message}");
}

#[test]
fn wrong_indices_and_lengths_are_refused() {
    let path = temp("indices.exr");
    write_picture(&path, 4, 4, &RGB_FLOAT, &noise(48)).unwrap();
    let input = Input::open(&path, false).unwrap();
    assert!(input.spec(1).is_err());
    assert_eq!(input.spec(-1).unwrap_err().0, OIIO_INVALID_ARGUMENT);
    // The handle still works after an error
    assert_eq!(input.read(0, LIMIT).unwrap(), noise(48));

    let part = Part { name: "", compression: "", width: 4, height: 4, channels: &RGB_FLOAT };
    let output = Output::create(&temp("lengths.exr"), &[part]).unwrap();
    assert_eq!(output.write(0, 0, 4, &noise(48)).unwrap_err().0, OIIO_INVALID_ARGUMENT, "not open");
    output.open().unwrap();
    assert_eq!(output.write(0, 0, 4, &noise(47)).unwrap_err().0, OIIO_INVALID_ARGUMENT, "too short");
    assert_eq!(output.write(0, 1, 3, &noise(36)).unwrap_err().0, OIIO_INVALID_ARGUMENT, "a gap");
    assert_eq!(output.write(1, 0, 4, &noise(48)).unwrap_err().0, OIIO_INVALID_ARGUMENT, "no such part");
    output.write(0, 0, 1, &noise(12)).unwrap();
    let (code, message) = output.close().unwrap_err();
    assert_eq!(code, OIIO_INVALID_ARGUMENT, "{message}");
}

#[test]
fn what_a_format_cannot_hold_is_refused() {
    let part = |channels| Part { name: "", compression: "", width: 2, height: 2, channels };
    let two = [part(&RGB_U8), part(&RGB_U8)];
    for name in ["two.png", "two.tif"] {
        let error = Output::create(&temp(name), &two).and_then(|output| output.open()).unwrap_err();
        assert_eq!(error.0, OIIO_UNSUPPORTED, "{name}: {}", error.1);
    }
    let mixed = [("R", OIIO_FORMAT_U8), ("G", OIIO_FORMAT_U16)];
    let error = Output::create(&temp("mixed.png"), &[part(&mixed)]).err().unwrap();
    assert_eq!(error.0, OIIO_UNSUPPORTED, "{}", error.1);
    let wide = Part { name: "", compression: "", width: 65_501, height: 1, channels: &RGB_U8 };
    let error = Output::create(&temp("wide.jpg"), &[wide]).err().unwrap();
    assert_eq!(error.0, OIIO_UNSUPPORTED, "{}", error.1);
    let error = Output::create(&temp("picture.unknown"), &[]).err().unwrap();
    assert_eq!(error.0, OIIO_UNSUPPORTED, "{}", error.1);
}

#[test]
fn an_unwritable_place_is_an_error() {
    let path = temp("no_such_directory").join("a.exr");
    let (code, message) = write_picture(&path, 2, 2, &RGB_FLOAT, &noise(12)).unwrap_err();
    assert_eq!(code, OIIO_CANNOT_WRITE);
    assert!(message.contains("No such file"), "{message}");
}

/// `/dev/full` can be opened, but refuses every write.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error_in_six_formats() {
    for (extension, channels) in
        [("exr", RGB_FLOAT), ("png", RGB_U8), ("hdr", RGB_FLOAT), ("tga", RGB_U8), ("jpg", RGB_U8), ("tif", RGB_FLOAT)]
    {
        // A small image fits into the buffers, so only the end of the file reaches the disk
        for size in [4, 200] {
            let path = temp(&format!("full_{size}.{extension}"));
            let _ = fs::remove_file(&path);
            std::os::unix::fs::symlink("/dev/full", &path).unwrap();
            let result = write_picture(&path, size, size, &channels, &noise((size * size * 3) as usize));
            let (code, message) = result.expect_err(&path.to_string_lossy());
            assert_eq!(code, OIIO_CANNOT_WRITE, "{}: {message}", path.display());
        }
    }
}

#[test]
fn a_truncated_picture_is_an_error_or_pixels_but_never_a_crash() {
    // Images cut at 32 positions
    let (width, height) = (40, 30);
    for (extension, channels) in
        [("png", RGB_U8), ("jpg", RGB_U8), ("hdr", RGB_FLOAT), ("tga", RGB_U8), ("exr", RGB_FLOAT), ("tif", RGB_U8)]
    {
        let whole = temp(&format!("whole.{extension}"));
        write_picture(&whole, width, height, &channels, &noise(3600)).unwrap();
        let bytes = fs::read(&whole).unwrap();
        let path = temp(&format!("cut.{extension}"));
        let mut errors = 0;
        for k in 0..32 {
            fs::write(&path, &bytes[..bytes.len() * k / 32]).unwrap();
            match Input::open(&path, false).and_then(|input| input.read(0, LIMIT)) {
                Ok(pixels) => assert_eq!(pixels.len(), 3600, "{extension} {k}"),
                Err((_, message)) => {
                    assert!(!message.is_empty());
                    errors += 1;
                }
            }
        }
        assert!(errors > 0, "{extension}: an empty file is no picture");
    }
}

#[test]
fn flipped_bytes_are_an_error_or_pixels_but_never_a_crash() {
    for (extension, channels) in [("png", RGB_U8), ("hdr", RGB_FLOAT), ("tga", RGB_U8), ("exr", RGB_FLOAT)] {
        let whole = temp(&format!("flip_whole.{extension}"));
        write_picture(&whole, 16, 16, &channels, &noise(768)).unwrap();
        let bytes = fs::read(&whole).unwrap();
        let path = temp(&format!("flip.{extension}"));
        for position in 0..bytes.len().min(256) {
            let mut damaged = bytes.clone();
            damaged[position] ^= 0xFF;
            fs::write(&path, &damaged).unwrap();
            if let Ok(input) = Input::open(&path, false) {
                let _ = input.subimages();
                if let Err((_, message)) = input.read(0, LIMIT) {
                    assert!(!message.is_empty());
                }
            }
        }
    }
}

#[test]
fn colours_that_are_no_triples_and_names_that_are_null_are_the_callers_fault() {
    let (mut pixels, mut chosen) = ([0.5_f32; 4], [0 as std::ffi::c_char; 16]);
    let (empty, data) = (c(""), pixels.as_mut_ptr());
    // SAFETY: the name ends in a zero byte or is null; `data` holds four floats, `chosen` 16 bytes.
    let mut display = |name: *const std::ffi::c_char, count| unsafe {
        let name_of_all = empty.as_ptr();
        check(|e, n| {
            (api().ocio_display)(
                name,
                name_of_all,
                name_of_all,
                name_of_all,
                data,
                count,
                chosen.as_mut_ptr(),
                16,
                e,
                n,
            )
        })
    };
    assert_eq!(display(empty.as_ptr(), 4).unwrap_err().0, OIIO_INVALID_ARGUMENT);
    assert_eq!(display(std::ptr::null(), 3).unwrap_err().0, OIIO_INVALID_ARGUMENT);
}

//! Files are read as they were written, and failures are errors.

use super::write::NO_DATE;
use super::*;
use crate::imaging::ColorEncoding;
use rayon::prelude::*;
use std::io::Write;
use std::path::PathBuf;

fn names(names: &[&str]) -> Vec<String> {
    names.iter().map(|&n| n.to_owned()).collect()
}

#[test]
fn exr_keeps_floats_metadata_and_windows() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let data: Vec<f32> = (0..24).map(|i| i as f32 * 0.37 - 2.0).collect();
    let part = Part::linear(3, 2, names(&["R", "G", "B", "depth.Z"]), data.clone())
        .with_metadata(vec![("lumiris:seed".to_owned(), "7".to_owned())])
        .with_window([4, 5], [30, 20]);
    write_image(&path, &[part]).unwrap();
    let read = read_image(&path, &ReadLimits::default()).unwrap();
    assert_eq!((read.image.width, read.image.height), (3, 2));
    for (i, name) in ["R", "G", "B", "depth.Z"].iter().enumerate() {
        let c = read.image.channel(name).unwrap();
        for pixel in 0..6 {
            assert_eq!(read.image.data[pixel * 4 + c], data[pixel * 4 + i]);
        }
    }
    assert_eq!(read.metadata.get("lumiris:seed").map(String::as_str), Some("7"));
    assert_eq!(read.encoding, ColorEncoding::Linear);
    assert_eq!(read.window, Window { origin: [4, 5], full_origin: [0, 0], full_size: [30, 20] });
    // No temporary file is left
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn an_exr_holds_parts_with_names_half_floats_and_values() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let beauty: Vec<f32> = (0..6 * 4).map(|i| (i as f32 * 0.7).exp2() * 1e-3).collect();
    let albedo: Vec<f32> = (0..6 * 3).map(|i| i as f32 / 17.0).collect();
    let matrix = std::array::from_fn(|i| i as f32 * 0.25);
    let first = Part::linear(3, 2, names(&["R", "G", "B", "Z"]), beauty.clone())
        .named("beauty")
        .channels_stored_as(&["R", "G", "B"], Storage::Half)
        .with_value("lumiris:samples", MetaValue::Integer(64))
        .with_value("lumiris:exposure", MetaValue::Number(0.5))
        .with_value("lumiris:world_from_camera", MetaValue::Matrix(matrix));
    let second = Part::linear(3, 2, names(&["albedo.R", "albedo.G", "albedo.B"]), albedo.clone())
        .named("albedo")
        .stored_as(Storage::Half)
        .compressed_by("piz");
    write_image(&path, &[first.clone(), second.clone()]).unwrap();

    let limits = ReadLimits::default();
    let read = read_image(&path, &limits).unwrap();
    assert_eq!(read.parts, 2);
    for (channel, name) in ["R", "G", "B", "Z"].iter().enumerate() {
        let c = read.image.channel(name).unwrap();
        for pixel in 0..6 {
            let wrote = beauty[pixel * 4 + channel];
            let found = read.image.data[pixel * 4 + c];
            let tolerance = if *name == "Z" { 0.0 } else { wrote / 2048.0 };
            assert!((wrote - found).abs() <= tolerance, "{name} {wrote} {found}");
        }
    }
    let value = |name: &str| read.metadata.get(name).map(String::as_str);
    assert_eq!(value("lumiris:samples"), Some("64"));
    assert_eq!(value("lumiris:exposure"), Some("0.5"));
    assert!(value("lumiris:world_from_camera").unwrap().contains("3.75"));
    assert_eq!(value("oiio:subimagename"), Some("beauty"));
    assert_eq!(value("compression"), Some("zip"));
    assert_eq!(value("DateTime"), Some(NO_DATE));

    let headers = read_headers(&path).unwrap();
    assert_eq!(headers.iter().map(|h| h.name.as_str()).collect::<Vec<_>>(), ["beauty", "albedo"]);
    assert!(headers[0].channels.contains(&"Z".to_owned()) && headers[1].channels.len() == 3);
    let read = read_part(&path, 1, &limits).unwrap();
    assert!(read.is_half);
    assert_eq!(read.metadata["compression"], "piz");
    let g = read.image.channel("albedo.G").unwrap();
    assert!((0..6).all(|p| (read.image.data[p * 3 + g] - albedo[p * 3 + 1]).abs() < 1e-3));
    let error = read_part(&path, 2, &limits).unwrap_err();
    assert!(matches!(&error, ImageError::Unreadable { .. }) && error.to_string().contains("2 parts"), "{error}");

    // The same parts give the same bytes
    let again = folder.path().join("b.exr");
    write_image(&again, &[first, second]).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), std::fs::read(&again).unwrap());
}

#[test]
fn damaged_and_refused_files_are_errors_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let data: Vec<f32> = (0..40 * 30 * 3).map(|i| (i % 251) as f32 / 250.0).collect();
    for extension in ["exr", "png", "jpg"] {
        let path = folder.path().join(format!("whole.{extension}"));
        let part = match extension {
            "exr" => Part::linear(40, 30, names(&["R", "G", "B"]), data.clone()),
            _ => Part::display(40, 30, names(&["R", "G", "B"]), data.clone()),
        };
        write_image(&path, std::slice::from_ref(&part)).unwrap();
        assert_eq!(read_image(&path, &ReadLimits::default()).unwrap().image.data.len(), data.len());
        let bytes = std::fs::read(&path).unwrap();
        for length in [0, 10, 100] {
            std::fs::write(&path, &bytes[..length]).unwrap();
            let error = read_image(&path, &ReadLimits::default()).unwrap_err();
            assert!(error.to_string().contains("whole."), "{error}");
        }

        // A folder that cannot be written to; a folder with the name of the file
        let error = write_image(&path.join("below.exr"), std::slice::from_ref(&part)).unwrap_err();
        assert!(matches!(error, ImageError::Write { .. }), "{error}");
        let taken = folder.path().join(format!("taken.{extension}"));
        std::fs::create_dir(&taken).unwrap();
        assert!(write_image(&taken, &[part]).is_err());
        assert!(taken.is_dir());
    }
    let left = std::fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(left, 6, "no partial file is left");
    let error = write_image(&folder.path().join("a.unknown"), &[]).unwrap_err();
    assert!(matches!(error, ImageError::Write { .. }), "{error}");
}

#[test]
fn png_keeps_eight_bits_and_is_taken_as_srgb() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let data: Vec<f32> = (0..12).map(|i| i as f32 / 11.0).collect();
    write_image(&path, &[Part::display(2, 2, names(&["R", "G", "B"]), data.clone())]).unwrap();
    let read = read_image(&path, &ReadLimits::default()).unwrap();
    assert_eq!(read.encoding, ColorEncoding::Srgb);
    assert!(read.image.data.iter().zip(&data).all(|(a, b)| (a - b).abs() <= 0.5 / 255.0 + 1e-6));
}

#[test]
fn failures_say_what_and_leave_nothing() {
    // Missing files and folders
    let folder = tempfile::tempdir().unwrap();
    let limits = ReadLimits::default();
    assert!(matches!(read_image(&folder.path().join("no.exr"), &limits), Err(ImageError::NotFound { .. })));
    assert!(matches!(read_image(folder.path(), &limits), Err(ImageError::Unreadable { .. })));

    // Too large and truncated files
    let path = folder.path().join("a.exr");
    write_image(&path, &[Part::linear(8, 8, names(&["Y"]), vec![0.5; 64])]).unwrap();
    assert!(matches!(read_image(&path, &ReadLimits { max_bytes: 100, ..limits }), Err(ImageError::TooLarge { .. })));
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    assert!(matches!(read_image(&path, &limits), Err(ImageError::Unreadable { .. })));

    // A failed write keeps the old file
    let good = std::fs::read(&path).unwrap();
    let wrong = Part::linear(8, 8, names(&["Y"]), vec![0.5; 3]);
    assert!(matches!(write_image(&path, &[wrong]), Err(ImageError::Write { .. })));
    assert_eq!(std::fs::read(&path).unwrap(), good, "a failed write leaves the old file");
    assert!(write_image(&folder.path().join("no/where.exr"), &[]).is_err());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// Regression test. OpenEXR's thread count was set for each file, and a file that was being written when another
/// changed it was never completed.
#[test]
fn files_are_written_and_read_at_the_same_time() {
    // Write and read small and large files in four threads
    let (done, all) = std::sync::mpsc::channel();
    for thread in 0..4_usize {
        let done = done.clone();
        std::thread::spawn(move || {
            let folder = tempfile::tempdir().unwrap();
            for i in 0..40 {
                let (width, height) = ([2, 64][(i + thread) % 2], [2, 300][(i + thread) % 2]);
                let data: Vec<f32> = (0..width * height * 3).map(|k| (k * 7 % 1000) as f32).collect();
                let path = folder.path().join(format!("{i}.exr"));
                write_image(&path, &[Part::linear(width, height, names(&["R", "G", "B"]), data.clone())]).unwrap();
                assert_eq!(read_image(&path, &ReadLimits::default()).unwrap().image.data, data);
            }
            done.send(()).unwrap();
        });
    }

    // Wait for all threads
    for _ in 0..4 {
        all.recv_timeout(std::time::Duration::from_secs(300)).expect("a file is neither written nor refused");
    }
}

/// A chunk of a PNG file.
fn chunk(kind: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let mut chunk = (data.len() as u32).to_be_bytes().to_vec();
    chunk.extend_from_slice(kind);
    chunk.extend_from_slice(data);
    let crc = crc32fast::hash(&chunk[4..]);
    chunk.extend_from_slice(&crc.to_be_bytes());
    chunk
}

fn deflated(data: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(data).unwrap();
    encoder.finish().unwrap()
}

/// A PNG file of one grey pixel, whose ICC profile has these tags.
fn png_with_profile(tags: impl ExactSizeIterator<Item = [u8; 4]>) -> Vec<u8> {
    let (count, size) = (tags.len() as u32, 132 + 12 * tags.len() as u32 + 16);
    let mut profile = vec![0; 128];
    profile[0..4].copy_from_slice(&size.to_be_bytes());
    profile[8] = 4;
    profile[12..24].copy_from_slice(b"mntrGRAYXYZ ");
    profile[36..40].copy_from_slice(b"acsp");
    // The illuminant, D50
    profile[68..80].copy_from_slice(&[0, 0, 0xf6, 0xd6, 0, 1, 0, 0, 0, 0, 0xd3, 0x2d]);
    profile.extend_from_slice(&count.to_be_bytes());
    for tag in tags {
        profile.extend_from_slice(&tag);
        profile.extend_from_slice(&(size - 16).to_be_bytes());
        profile.extend_from_slice(&16_u32.to_be_bytes());
    }
    profile.extend_from_slice(b"text\0\0\0\0profile\0");

    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    file.extend(chunk(b"IHDR", &[0, 0, 0, 1, 0, 0, 0, 1, 8, 0, 0, 0, 0]));
    file.extend(chunk(b"iCCP", &[b"p\0\0".as_slice(), &deflated(&profile)].concat()));
    file.extend(chunk(b"IDAT", &deflated(&[0, 128])));
    file.extend(chunk(b"IEND", &[]));
    file
}

#[test]
fn files_with_profiles_are_opened_by_several_threads_at_once() {
    // Tags that OpenImageIO does not know
    const FILES: u16 = 400;
    let folder = tempfile::tempdir().unwrap();
    let paths: Vec<_> = (0..FILES).map(|i| folder.path().join(format!("{i}.png"))).collect();
    for (i, path) in paths.iter().enumerate() {
        let tag = |k: u16| [b'a' + (i / 26) as u8, b'a' + (i % 26) as u8, b'a' + (k / 26) as u8, b'a' + (k % 26) as u8];
        std::fs::write(path, png_with_profile((0..60).map(tag))).unwrap();
    }
    let read = |path: &PathBuf| read_image(path, &ReadLimits::default()).unwrap();
    let images: Vec<ReadImage> = paths.par_iter().map(read).collect();
    for image in images {
        assert!(image.metadata.keys().any(|name| name.starts_with("ICCProfile")), "{:?}", image.metadata);
        assert!((image.image.data[0] - 128.0 / 255.0).abs() < 1e-6);
    }
}

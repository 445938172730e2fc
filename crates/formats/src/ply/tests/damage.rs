//! Broken files.

use super::writer::*;
use crate::ply::header::Scalar::*;
use crate::ply::stream::Stream;
use crate::ply::*;
use lumiris_numbers::math::Vec3;
use lumiris_test_support::random::pcg32;

#[test]
fn broken_headers_are_refused_with_line_and_reason() {
    assert_eq!(message(b""), "line 1 of the header: the file is empty");
    assert!(message(b"obj\n").contains("line 1 of the header: is not a PLY file"));
    assert!(message(b"ply\nformat ascii 1.0\nend_header\n").contains("no `vertex` element"));
    assert!(
        message(b"ply\nelement vertex 0\nend_header\n")
            .contains("line 3 of the header: `end_header`, where a `format`")
    );
    assert!(message(b"ply\nformat ascii 1.0\nproperty int x\n").contains("line 3"));
    assert!(
        message(&[b"ply\ncomment ".as_slice(), &[b'x'; 9000]].concat())
            .contains("line 2 of the header: the line has no end")
    );
    let endless = format!("ply\nformat ascii 1.0\n{}", "comment\n".repeat(20_000));
    assert!(message(endless.as_bytes()).contains("the header has no end"));
    for (from, to, expected) in [
        ("float x", "quaternion x", "line 6 of the header: `property quaternion x`"),
        ("float x", "float w", "line 5 of the header: vertices have no properties x, y and z"),
        ("format ascii", "format octal", "line 2 of the header: `format octal 1.0`"),
        ("vertex 5", "vertex -5", "line 5 of the header"),
        ("face 2", "face 99999999999999999999", "line 11 of the header"),
        ("element face", "element vertex", "`vertex` is announced twice"),
        ("list uchar", "list float", "line 12 of the header"),
        ("obj_info", "info", "line 4 of the header: `info nothing`"),
    ] {
        let found = message(&replaced(from, to));
        assert!(found.contains(expected), "{from} -> {to}: {found}");
    }
}

#[test]
fn absurd_counts_are_refused_before_anything_is_allocated() {
    for format in FORMATS {
        for (from, to) in
            [("vertex 5", "vertex 4000000000"), ("face 2", "face 18446744073709551615"), ("face 2", "face 4294967296")]
        {
            let bytes = sample(format);
            let at = bytes.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
            let changed = [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat();
            for bytes in [compressed(&changed), changed] {
                let error = parse_ply(&bytes).unwrap_err();
                assert!(matches!(error, PlyError::Counts { .. }), "{format} {to}: {error}");
            }
        }
    }
    // The maximum expansion of deflate is accepted, but memory is only reserved as data are read.
    let mut reader: &[u8] = &[];
    assert_eq!(Stream::new(&mut reader, 1200).trusted_items(u64::MAX, 12), 100);
    let mut reader: &[u8] = &[];
    let stream = Stream::inflated(&mut reader, 1200);
    assert!(stream.remaining_limit() > 1_000_000 && stream.trusted_items(u64::MAX, 12) == 1600);
    // Rows without columns take no bytes and no time.
    let empty =
        with_faces("ascii", "element face 4294967295\nelement tristrips 4294967295\nelement x 4294967295", |_| ());
    assert_eq!(parse_ply(&empty).unwrap().positions.len(), 5);
}

#[test]
fn lists_that_do_not_fit_are_refused_before_anything_is_allocated() {
    for format in FORMATS {
        for (name, length) in [("face", 4e9), ("tristrips", 4e9), ("other", 4e9)] {
            let head = format!("element {name} 1\nproperty list uint int vertex_indices");
            let bytes = with_faces(format, &head, |w| {
                w.number(U32, length).number(I32, 0.0);
            });
            assert!(matches!(parse_ply(&bytes), Err(PlyError::Truncated { .. })), "{format} {name}");
            let bytes = with_faces(format, &head.replace("uint", "char"), |w| {
                w.number(I8, -3.).number(I32, 0.0);
            });
            assert!(matches!(parse_ply(&bytes), Err(PlyError::ListLength { length: -3, .. })), "{format} {name}");
        }
    }
}

#[test]
fn indices_out_of_range_are_refused_with_their_face() {
    for format in FORMATS {
        for (ty, index) in [(I32, 5.), (I32, -1.), (U32, 4294967295.), (U8, 255.), (F32, 1.5), (F32, f64::NAN)] {
            let head = format!("element face 3\nproperty list uchar {} vertex_indices", name(ty, 0));
            let bytes = with_faces(format, &head, |w| {
                w.list(U8, ty, &[0., 1., 2.]).end_row().list(U8, ty, &[0., 1., 2.]).end_row();
                w.list(U8, ty, &[0., index, 2.]).end_row();
            });
            match parse_ply(&bytes).unwrap_err() {
                PlyError::IndexOutOfRange { face: 2, index: found, vertices: 5, place } => {
                    assert_eq!(found, if ty == F32 { -1 } else { index as i64 }, "{format} {ty:?}");
                    let expected = if format == "ascii" { Place::Line(17) } else { place };
                    assert_eq!(place, expected);
                }
                // Text distinguishes non-integers.
                PlyError::Number { place: Place::Line(17), .. } if format == "ascii" && ty == F32 => {}
                other => panic!("{format} {ty:?} {index}: {other}"),
            }
        }
    }
}

#[test]
fn words_that_are_no_numbers_are_refused_with_their_line() {
    for (from, to, expected) in [
        ("3 3 2 4 8", "3 3 x2 4 8", "line 21: `x2` in `face`, where a whole number is expected"),
        ("1 1 0 1 1", "1 1 0 1,5 1", "line 17: `1,5` in `vertex`, where a number is expected"),
        ("1 1 0 1 1", "1 1 0 1.#INF 1", "line 17: `1.#INF` in `vertex`"),
        ("1 1 0 1 1", "1 1 0 \u{7}\" 1", "line 17: `\\x07\\\"` in `vertex`"),
    ] {
        assert!(message(&replaced(from, to)).contains(expected), "{}", message(&replaced(from, to)));
    }
    let long = message(&replaced("1 1 0 1 1", &format!("1 1 0 {} 1", "1".repeat(300))));
    assert!(long.contains("line 17: `1111111111111111111111111111111111111111`"), "{long}");
    assert!(parse_ply(&replaced("3 3 2 4 8", "3.0 3 2e0 +4 8")).is_ok());
}

#[test]
fn broken_vertices_lose_their_faces_and_are_counted() {
    for odd in ["nan", "-nan(ind)", "inf", "-Infinity", "NaN", "1e60"] {
        let mesh = parse_ply(&replaced("0.5 2 0.25 0.5 2", &format!("0.5 {odd} 0.25 0.5 2"))).unwrap();
        assert_eq!((mesh.triangles.len(), mesh.quads.len(), mesh.positions[4]), (0, 1, Vec3::ZERO), "{odd}");
        assert_eq!(mesh.warnings, ["1 vertices are not finite; 1 faces of them are left out"]);
    }
    for format in &FORMATS[1..] {
        let bytes = with_faces(format, "element face 1\nproperty list uchar int vertex_indices", |w| {
            // Overwrites y and z of the last vertex.
            let end = w.body.len() - 8;
            w.body.truncate(end);
            w.numbers(F32, &[f64::NAN, f64::INFINITY]).list(U8, I32, &[0., 1., 2.]);
        });
        let mesh = parse_ply(&bytes).unwrap();
        assert_eq!(mesh.warnings, ["1 vertices are not finite; 0 faces of them are left out"], "{format}");
    }
    // Large finite values are valid.
    let large = parse_ply(&replaced("0.5 2 0.25 0.5 2", "3e38 3e38 3e38 0 0")).unwrap();
    assert!(large.warnings.is_empty() && large.positions[4].x == 3e38);
}

#[test]
fn truncated_files_are_refused_wherever_they_end() {
    for format in FORMATS {
        let bytes = sample(format);
        // In text, the last number may lack digits, and the blank and line end after it.
        let end = bytes.len() - if format == "ascii" { 3 } else { 0 };
        for cut in 0..end {
            let error = parse_ply(&bytes[..cut]).expect_err(&format!("{cut} bytes of {format}"));
            assert!(!matches!(error, PlyError::Io { .. }), "{error}");
        }
    }
}

#[test]
fn damaged_files_never_panic() {
    let strips = with_faces("binary_little_endian", "element tristrips 1\nproperty list int int vertex_indices", |w| {
        w.list(I32, I32, &[0., 1., 3., 2., 4.]);
    });
    let mut samples: Vec<Vec<u8>> = FORMATS.map(sample).into();
    let wedges = with_faces(
        "binary_big_endian",
        "element face 1\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord",
        |w| {
            w.list(U8, I32, &[0., 1., 3., 2., 4.]).list(U8, F32, &[0.5; 10]);
        },
    );
    samples.push(wedges);
    samples.extend([compressed(&sample("binary_little_endian")), compressed(&sample("ascii")), strips]);
    let mut random = pcg32([20, 0, 0]);
    let mut accepted = 0;
    for round in 0..24_000 {
        let mut bytes = samples[round % samples.len()].clone();
        for _ in 0..=below(&mut random, 4) {
            let bit = below(&mut random, 8 * bytes.len());
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        if let Ok(mesh) = parse_ply(&bytes) {
            assert_is_sound(&mesh);
            accepted += 1;
        }
    }
    assert!((1..24_000).contains(&accepted), "{accepted}");
}

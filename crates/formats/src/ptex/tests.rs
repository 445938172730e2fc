//! Reading texels with known values in every encoding, and damaged files.

use super::*;
use lumiris_test_support::ptex::{PtexEncoding, PtexFaceSpec, PtexSpec, ptex_file};
use lumiris_test_support::random::{RngExt, pcg32};

const ENCODINGS: [PtexEncoding; 6] = [
    PtexEncoding::Mean,
    PtexEncoding::Constant,
    PtexEncoding::Compressed,
    PtexEncoding::Differences,
    PtexEncoding::Tiled([1, 2]),
    PtexEncoding::Tiled([3, 0]),
];

#[test]
fn the_list_of_faces_tells_the_number_of_texels() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/demo/patchwork.ptx");
    let (file, size) = (read_ptex(&path).unwrap(), ptex_size(&path).unwrap());
    let texels = match &file.texels {
        PtexTexels::Bytes(v) => v.len(),
        PtexTexels::Floats(v) => size_of_val(&v[..]),
    };
    assert_eq!(size.texels, texels as u64);
    assert_eq!(size.faces, size_of_val(&file.faces[..]) as u64);
}

/// A face for each encoding, of 8 × 4 texels of multiples of 1/16.
fn sample(ty: u32, channels: u16) -> PtexSpec {
    let face = |(i, &encoding): (usize, &PtexEncoding)| {
        let is_one = matches!(encoding, PtexEncoding::Mean | PtexEncoding::Constant);
        let value = |k: usize| {
            let texel = if is_one { 0 } else { k / usize::from(channels) };
            ((texel * 5 + k % usize::from(channels) * 3 + i) % 17) as f32 / 16.0
        };
        let texels = (0..32 * usize::from(channels)).map(value).collect();
        PtexFaceSpec { encoding, ..PtexFaceSpec::new([3, 2], texels) }
    };
    PtexSpec { ty, channels, faces: ENCODINGS.iter().enumerate().map(face).collect() }
}

#[test]
fn texels_are_those_that_were_written_whatever_their_type_and_encoding() {
    for (ty, tolerance) in [(0, 0.5 / 255.0 + 1e-6), (1, 0.5 / 65535.0 + 1e-6), (2, 0.0), (3, 0.0)] {
        for channels in [1, 2, 3, 4] {
            let spec = sample(ty, channels);
            let file = parse_ptex(&ptex_file(&spec)).unwrap();
            let kept = if channels >= 3 { 3 } else { 1 };
            assert_eq!((file.channels, file.faces.len()), (kept, ENCODINGS.len()));
            let number = |i: usize| match &file.texels {
                PtexTexels::Bytes(v) => f32::from(v[i]) / 255.0,
                PtexTexels::Floats(v) => v[i],
            };
            assert_eq!(matches!(file.texels, PtexTexels::Bytes(_)), ty == 0);
            for (face, spec) in file.faces.iter().zip(&spec.faces) {
                let is_one = matches!(spec.encoding, PtexEncoding::Mean | PtexEncoding::Constant);
                assert_eq!((face.log2, face.is_constant), ([3, 2], is_one));
                for texel in 0..if is_one { 1 } else { 32 } {
                    for c in 0..kept {
                        let (is, should) =
                            (number((face.first + texel) * kept + c), spec.texels[texel * usize::from(channels) + c]);
                        assert!((is - should).abs() <= tolerance, "type {ty}, {:?}: {is} for {should}", spec.encoding);
                    }
                }
            }
        }
    }
}

#[test]
fn neighbors_are_faces_of_the_file_and_of_their_own_kind() {
    let mut spec = sample(0, 1);
    spec.faces[0].neighbors = [(1, 3), (u32::MAX, 0), (5, 2), (600, 1)];
    spec.faces[5].is_subface = true;
    let file = parse_ptex(&ptex_file(&spec)).unwrap();
    assert_eq!(file.faces[0].neighbors, [Some(Neighbor { face: 1, edge: 3 }), None, None, None]);
}

#[test]
fn damaged_files_are_errors_with_a_place() {
    let good = ptex_file(&sample(1, 3));
    for end in 0..good.len() {
        let error = parse_ptex(&good[..end]).unwrap_err().to_string();
        assert!(error.contains("byte "), "{error}");
    }
    let mut random = pcg32([7, 0, 0]);
    for _ in 0..3000 {
        let mut bytes = good.clone();
        for _ in 0..random.random_range(1..4) {
            let at = random.random_range(0..bytes.len());
            bytes[at] = random.random_range(0..=255);
        }
        // May be invalid, but must not panic
        let _ = parse_ptex(&bytes);
    }
}

#[test]
fn what_is_not_read_is_said() {
    let good = ptex_file(&sample(0, 3));
    let message = |at: usize, bytes: &[u8]| {
        let mut file = good.clone();
        file[at..at + bytes.len()].copy_from_slice(bytes);
        parse_ptex(&file).unwrap_err().to_string()
    };
    assert!(message(0, b"Pxex").contains("no Ptex file"));
    assert!(message(4, &[2]).contains("version 2"));
    assert!(message(8, &[0]).contains("triangles"));
    assert!(message(12, &[9]).contains("type of data 9"));
    assert!(message(20, &[0]).contains("0 channels"));
    assert!(message(64 + 24, &[1]).contains("edits"));
    // A face that claims far more texels than the tiles of constant colour in the file allow
    let mut face = PtexFaceSpec { encoding: PtexEncoding::Tiled([0, 0]), ..PtexFaceSpec::new([0, 0], vec![0.5]) };
    let file = |face: &PtexFaceSpec| ptex_file(&PtexSpec { ty: 3, channels: 1, faces: vec![face.clone(); 3] });
    assert!(parse_ptex(&file(&face)).is_ok());
    face.claimed = Some([16, 16]);
    let error = parse_ptex(&file(&face)).unwrap_err().to_string();
    assert!(error.contains("face 0 has 2^16 × 2^16 texels, in a file of"), "{error}");
}

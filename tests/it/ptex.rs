//! `Texture "ptex"`: a texture for each face of a mesh.

use lumiris::geometry::Shape;
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, Loaded, load_text};
use lumiris::textures::{RgbTexture, TextureContext};
use lumiris_numbers::math::{Rgb, Vec2, Vec3};
use lumiris_test_support::ptex::{PtexEncoding, PtexFaceSpec, PtexSpec, ptex_file};
use std::fs;
use std::path::Path;

/// Three faces of one colour each, for two quads and a triangle that use them in reverse order.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let face =
        |v: f32| PtexFaceSpec { encoding: PtexEncoding::Mean, ..PtexFaceSpec::new([0, 0], vec![v, v / 2.0, v / 4.0]) };
    let spec = PtexSpec { ty: 3, channels: 3, faces: [0.25, 0.5, 0.75].map(face).to_vec() };
    fs::write(folder.path().join("wall.ptx"), ptex_file(&spec)).unwrap();
    let ply = "ply\nformat ascii 1.0\nelement vertex 7\nproperty float x\nproperty float y\nproperty float z\n\
               element face 3\nproperty int face_indices\nproperty list uchar int vertex_indices\nend_header\n\
               0 0 0\n1 0 0\n2 0 0\n0 1 0\n1 1 0\n2 1 0\n3 0 0\n\
               2 4 0 1 4 3\n1 4 1 2 5 4\n0 3 2 6 5\n";
    fs::write(folder.path().join("wall.ply"), ply).unwrap();
    folder
}

fn load(folder: &Path, texture: &str, shape: &str) -> Result<Loaded, String> {
    let text = format!(
        r#"LookAt 1.5 0.5 4  1.5 0.5 0  0 1 0
        Camera "orthographic"
        Film "rgb" "integer xresolution" 8 "integer yresolution" 8
        WorldBegin
        LightSource "infinite"
        Texture "wall" "spectrum" "ptex" {texture}
        Material "diffuse" "texture reflectance" "wall"
        {shape}"#
    );
    load_text(&text, "wall.pbrt", folder, &LoadOptions::default(), &FileCache::default()).map_err(|d| d.to_string())
}

const PLY: &str = r#"Shape "plymesh" "string filename" "wall.ply""#;

/// Points on all primitives, with the reflectances there.
fn seen(loaded: &Loaded) -> Vec<(Vec3, Rgb)> {
    let textures = &loaded.scene.textures;
    let wall = textures.rgbs.iter().position(|t| matches!(t, RgbTexture::Faces(_))).unwrap();
    let at = |shape: &Shape, primitive: u32| {
        let hit = shape.surface_hit(primitive, [0.25, 0.5], Vec3::Z);
        let (uv, face) = (hit.uv, hit.vertex.face);
        assert_eq!(shape.vertex_values(primitive, [0.25, 0.5]), hit.vertex);
        let context = TextureContext { uv, face, uv_width: Vec2::ZERO, ..TextureContext::whole() };
        (hit.p, textures.rgb(wall as u32, &context))
    };
    let shapes = loaded.scene.geometry.geometries.iter().map(|g| &g.shape);
    let primitives = |shape: &Shape| match shape {
        Shape::Mesh(mesh) => mesh.triangle_count(),
        Shape::Bilinear(mesh) => mesh.patch_count(),
        Shape::Quadric(_) | Shape::Curves(_) => 0,
    };
    shapes.flat_map(|shape| (0..primitives(shape)).map(move |i| at(shape, i as u32))).collect()
}

/// Asserts that each point has the colour of its column of the wall.
fn assert_columns(seen: &[(Vec3, Rgb)], columns: [f32; 3], scale: f32) {
    for (p, color) in seen {
        let v = columns[p.x as usize] * scale;
        assert_eq!(*color, Rgb::new(v, v / 2.0, v / 4.0), "at {p}");
    }
}

#[test]
fn faces_have_their_textures_by_number_in_all_kinds_of_meshes() {
    let folder = folder();
    let texture = r#""string filename" "wall.ptx" "string encoding" "linear" "float scale" 0.5"#;
    let ply = load(folder.path(), texture, PLY).unwrap();
    let places = seen(&ply);
    assert!(places.len() >= 3 && ply.warnings.to_string().is_empty(), "{}", ply.warnings);
    assert_columns(&places, [0.75, 0.5, 0.25], 0.5);

    // Triangles, parallelograms (which become triangles) and a bent patch
    let corners = "\"point3 P\" [ 0 0 0  1 0 0  0 1 0  1 1 0 ]";
    for shape in [
        format!("Shape \"trianglemesh\" {corners} \"integer indices\" [ 0 1 3 0 3 2 ] \"integer faceIndices\" [ 1 1 ]"),
        format!("Shape \"bilinearmesh\" {corners} \"integer faceIndices\" [ 1 ]"),
        format!("Shape \"bilinearmesh\" {} \"integer faceIndices\" [ 1 ]", corners.replace("1 1 0 ", "1 1 1 ")),
    ] {
        assert_columns(&seen(&load(folder.path(), texture, &shape).unwrap()), [0.5; 3], 0.5);
    }

    // Without face numbers, the first face is used, as in pbrt-v4, and the default encoding
    let shape = format!("Shape \"bilinearmesh\" {corners}");
    let usual = seen(&load(folder.path(), r#""string filename" "wall.ptx""#, &shape).unwrap());
    assert!((usual[0].1.r - 0.25_f32.powf(2.2)).abs() < 1e-5, "{usual:?}");
}

#[test]
fn what_is_wrong_has_its_place() {
    let folder = folder();
    let error = |texture: &str, shape: &str| load(folder.path(), texture, shape).err().unwrap();
    fs::write(folder.path().join("no.ptx"), b"Ptex\x02").unwrap();
    let missing = error(r#""string filename" "none.ptx""#, PLY);
    assert!(missing.contains("none.ptx") && missing.contains("wall.pbrt:6:"), "{missing}");
    let damaged = error(r#""string filename" "no.ptx""#, PLY);
    assert!(damaged.contains("no.ptx: byte 4:") && damaged.contains("wall.pbrt:6:"), "{damaged}");
    assert!(error("", PLY).contains("needs a `string filename`"));
    let texture = r#""string filename" "wall.ptx""#;
    let shape = r#"Shape "bilinearmesh" "point3 P" [ 0 0 0  1 0 0  0 1 0  1 1 0 ] "integer faceIndices" [ 1 2 ]"#;
    let numbers = load(folder.path(), texture, shape).unwrap().warnings.to_string();
    assert!(numbers.contains("faceIndices must be 1 numbers") && numbers.contains("wall.pbrt:8:"), "{numbers}");
    assert!(error(texture, &PLY.replace("plymesh", "plymash")).contains("plymesh"));
}

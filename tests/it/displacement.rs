//! Displaced meshes: surfaces that can also be described without displacement, and errors.

use lumiris::geometry::Shape;
use lumiris::imaging::oiio::{Part, write_image};
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, Loaded, load_text};
use lumiris::render::output::channels;
use lumiris::render::{RenderSettings, render};
use lumiris::scene::AccelKind;
use std::path::Path;
use std::sync::atomic::AtomicBool;

const HEAD: &str = r#"LookAt 0 -3 2  0 0 0  0 0 1
Camera "perspective" "float fov" 40
Film "rgb" "integer xresolution" 24 "integer yresolution" 16
Integrator "path" "integer maxdepth" 1
WorldBegin
LightSource "distant" "point3 from" [ 1 -1 3 ]
Texture "ramp" "float" "bilerp" "float v00" 0 "float v01" 0 "float v10" 1 "float v11" 1
"#;

/// A square of −1..1 at height 0.
const SHEET: &str = r#""point3 P" [ -1 -1 0  1 -1 0  1 1 0  -1 1 0 ] "point2 uv" [ 0 0  1 0  1 1  0 1 ] "integer indices" [ 0 1 2  0 2 3 ]"#;

fn load(folder: &Path, world: &str) -> Result<Loaded, String> {
    load_with("", folder, world)
}

fn load_with(option: &str, folder: &Path, world: &str) -> Result<Loaded, String> {
    let text = format!("{option}{HEAD}{world}");
    load_text(&text, "bumps.pbrt", folder, &LoadOptions::default(), &FileCache::default()).map_err(|d| d.to_string())
}

fn image(world: &str) -> Vec<f32> {
    let job = load(Path::new("."), world).unwrap().job(AccelKind::Embree, None).unwrap();
    let settings = RenderSettings { spp: 64, ..RenderSettings::default() };
    channels(&render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film, &[], None).data
}

/// Vertices and triangles of the first shape.
fn mesh(option: &str, folder: &Path, world: &str) -> (Vec<[f32; 3]>, usize) {
    let scene = load_with(option, folder, world).unwrap().scene;
    let Shape::Mesh(mesh) = &scene.geometry.geometries[0].shape else { panic!("a mesh") };
    (mesh.positions().iter().map(|p| p.to_array()).collect(), mesh.triangle_count())
}

#[test]
fn a_sheet_on_a_ramp_is_a_slope() {
    let flat = format!("Shape \"trianglemesh\" {SHEET}");
    // Half a unit per u, and a scale by 2 along z: the height is u, with two units of x per u
    let bent = "AttributeBegin Scale 1 1 2\nTexture \"half\" \"float\" \"scale\" \"texture tex\" \"ramp\" \"float scale\" 0.5\n";
    let bent = format!("{bent}{flat} \"texture displacement\" \"half\" \"float edgelength\" 0.25\nAttributeEnd");
    let slope = flat.replace("-1 -1 0  1 -1 0  1 1 0", "-1 -1 0  1 -1 1  1 1 1");
    let [bent_image, slope_image, flat_image] = [&bent, &slope, &flat].map(|world| image(world));
    let differs = |a: &[f32], b: &[f32]| {
        let other = a.iter().zip(b).filter(|(a, b)| (*a - *b).abs() > 2e-3 * a.abs().max(b.abs()));
        other.count() as f64 / a.len() as f64
    };
    let (same, other) = (differs(&bent_image, &slope_image), differs(&bent_image, &flat_image));
    assert!(same < 0.03 && other > 0.2, "{same} {other}");

    // Edges are measured in world space
    let (vertices, triangles) = mesh("", Path::new("."), &bent);
    assert!(triangles >= 2 * 64 && vertices.iter().all(|[x, _, z]| (z - (x + 1.0) * 0.5).abs() < 1e-5), "{triangles}");
    let (_, triangles) = mesh("Option \"displacementedgescale\" 8\n", Path::new("."), &bent);
    assert_eq!(triangles, 4, "edges of at most 2 units");
}

#[test]
fn images_displace_meshes_of_files_and_their_quadrilaterals() {
    let folder = tempfile::tempdir().unwrap();
    let height = Part::linear(2, 1, vec!["Y".to_owned()], vec![0.25, 0.75]);
    write_image(&folder.path().join("height.exr"), &[height]).unwrap();
    let ply = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
               property float u\nproperty float v\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
               -1 -1 0 0 0\n1 -1 0 1 0\n1 1 0 1 1\n-1 1 0 0 1\n4 0 1 2 3\n";
    std::fs::write(folder.path().join("sheet.ply"), ply).unwrap();
    let world = "Texture \"h\" \"float\" \"imagemap\" \"string filename\" \"height.exr\" \"string filter\" \"point\" \"string wrap\" \"clamp\"\n\
                 Shape \"plymesh\" \"string filename\" \"sheet.ply\" \"texture displacement\" \"h\" \"float edgelength\" 0.1";
    let (vertices, triangles) = mesh("", folder.path(), world);
    assert!(triangles >= 800, "{triangles}");
    for [x, _, z] in vertices.into_iter().filter(|[x, _, _]| x.abs() > 0.01) {
        assert_eq!(z, if x < 0.0 { 0.25 } else { 0.75 }, "{x}");
    }
}

#[test]
fn wrong_displacements_are_errors_with_a_place() {
    let plain = SHEET.replace("\"point2 uv\" [ 0 0  1 0  1 1  0 1 ]", "");
    for (shape, expected) in [
        (format!("{plain} \"texture displacement\" \"ramp\""), "needs texture coordinates"),
        (format!("{SHEET} \"texture displacement\" \"ramps\""), "unknown float texture `ramps`"),
        (format!("{SHEET} \"float displacement\" 1"), "displacement is a texture"),
        (format!("{SHEET} \"texture displacement\" \"ramp\" \"float edgelength\" 0"), "edgelength must be positive"),
        (
            format!("{SHEET} \"texture displacement\" \"ramp\" \"float edgelength\" 1e-5"),
            "more than 134217728 triangles",
        ),
    ] {
        let error = load(Path::new("."), &format!("Shape \"trianglemesh\" {shape}")).map(|_| ()).unwrap_err();
        assert!(error.contains(expected) && error.contains("bumps.pbrt:8:"), "{shape}: {error}");
    }
}

#[test]
fn every_texture_of_pbrt_is_read() {
    // Valid textures
    let world = |class: &str| format!("Texture \"t\" {class}\nShape \"sphere\" \"float radius\" 0.5");
    for class in [
        "\"float\" \"fbm\" \"integer octaves\" 4 \"float roughness\" 0.6",
        "\"float\" \"wrinkled\"",
        "\"float\" \"windy\"",
        "\"float\" \"dots\" \"float inside\" 0.2 \"texture outside\" \"ramp\" \"float uscale\" 8",
        "\"spectrum\" \"dots\" \"rgb inside\" [ 1 0 0 ]",
        "\"spectrum\" \"marble\" \"float scale\" 3 \"float variation\" 0.4",
        "\"spectrum\" \"bilerp\" \"rgb v00\" [ 1 0 0 ] \"rgb v11\" [ 0 0 1 ] \"string mapping\" \"planar\"",
    ] {
        let loaded = load(Path::new("."), &world(class)).unwrap();
        assert!(loaded.warnings.is_empty(), "{class}: {}", loaded.warnings);
    }

    // Errors
    for (class, expected) in [
        ("\"float\" \"fbm\" \"integer octaves\" 99", "octaves must be from 0 to 30, not 99"),
        ("\"float\" \"marbel\"", "unknown texture class `marbel`"),
        ("\"float\" \"fbm\" \"float rougness\" 1", "roughness"),
    ] {
        let error = load(Path::new("."), &world(class)).map(|_| ()).unwrap_err();
        assert!(error.contains(expected) && error.contains("bumps.pbrt:8:"), "{class}: {error}");
    }
}

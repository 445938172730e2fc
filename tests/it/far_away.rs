//! Scenes far from the origin of their world, such as maps in metres and models of the earth. The images equal those of
//! the same scenes at the origin; they are bit-identical if coordinates and distances are fractions of powers of two.

use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, Loaded, load, load_text};
use lumiris::render::output::channels;
use lumiris::render::{RenderSettings, render};
use lumiris::scene::AccelKind;
use std::path::Path;
use std::sync::atomic::AtomicBool;

type Point = [f64; 3];

const NEAR: Point = [0.0; 3];
/// On the grid of origins: 10⁷ is 78125 · 128.
const FAR: Point = [1e7, -4e6, 512_000.0];
/// Off that grid.
const ODD: Point = [9_999_987.3, -4_000_011.9, 511_987.6];

/// Coordinates of points, translated by `o`.
fn points(o: Point, at: &[Point]) -> String {
    at.iter().map(|p| format!("{} {} {}  ", p[0] + o[0], p[1] + o[1], p[2] + o[2])).collect()
}

/// The directives before the world: a camera at `o`.
fn head(o: Point) -> String {
    let view = points(o, &[[0.5, -5.0, 2.0], [0.25, 0.5, 0.5]]);
    format!(
        "LookAt {view} 0 0 1\nCamera \"perspective\" \"float fov\" 45\n\
         Film \"rgb\" \"integer xresolution\" 32 \"integer yresolution\" 24\n\
         PixelFilter \"box\" \"float xradius\" 0.5 \"float yradius\" 0.5\n\
         Sampler \"independent\"\nIntegrator \"path\" \"integer maxdepth\" 3\nWorldBegin\n"
    )
}

/// A way to move a world.
#[derive(Clone, Copy)]
struct Way<'a> {
    /// Offset of points that are given as numbers.
    o: Point,
    /// Transformation of everything except the corners of the portal.
    place: &'a str,
    /// Offset of the portal's corners, which are always in world space.
    portal: Point,
    /// True if 3D textures remain in world space: offsets by whole periods do not change them.
    world_textures: bool,
}

impl Way<'_> {
    /// A world with lights, textures, a medium, one shape of each kind, and a moving shape.
    fn world(&self) -> String {
        // Points
        let Way { o, place, .. } = *self;
        let p = |at: &[Point]| points(o, at);
        let floor = p(&[[-4.0, -4.0, 0.0], [4.0, -4.0, 0.0], [4.0, 6.0, 0.0], [-4.0, 6.0, 0.0]]);
        let roof = p(&[[-1.0, -1.0, 4.0], [-1.0, 0.5, 4.0], [0.5, -1.0, 4.0], [0.5, 0.5, 4.0]]);
        let patch = p(&[[-2.0, 1.0, 0.25], [-0.5, 1.5, 0.0], [-2.0, 2.0, 1.5], [-0.5, 1.25, 2.0]]);
        let tetrahedron = p(&[[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.5, 1.0, 0.0], [1.5, 0.5, 1.0]]);
        let curve = p(&[[-0.5, -1.0, 0.25], [0.0, -1.5, 1.0], [0.5, -0.5, 0.5], [1.0, -1.0, 1.5]]);
        let mover = p(&[[-1.5, -1.0, 1.0], [-0.75, -1.0, 1.0], [-1.25, -1.0, 1.75]]);
        let single = [[-1.0, 2.0, 0.0], [1.0, 4.0, 2.0], [2.0, -2.0, 3.0], [-3.0, -2.0, 3.0], [-1.0, 1.0, 0.5]];
        let [fog0, fog1, lamp, from, to] = single.map(|at| p(&[at]));
        let [here, ball, fog] = [NEAR, [0.75, 1.5, 0.75], [0.0, 3.0, 1.0]].map(|at| format!("Translate {}", p(&[at])));

        // Text
        let tiles = if self.world_textures { "" } else { here.as_str() };
        let window = points(self.portal, &[[-4.0, 8.0, 0.0], [4.0, 8.0, 0.0], [4.0, 8.0, 4.0], [-4.0, 8.0, 4.0]]);
        format!(
            r#"AttributeBegin {place}
            LightSource "point" "point3 from" [ {lamp} ] "rgb I" [ 8 6 4 ]
            LightSource "spot" "point3 from" [ {from} ] "point3 to" [ {to} ] "rgb I" [ 9 9 20 ]
            LightSource "infinite" "rgb L" [ 0.3 0.4 0.5 ] "point3 portal" [ {window} ]
            MakeNamedMedium "fog" "string type" "uniformgrid" "point3 p0" [ {fog0} ] "point3 p1" [ {fog1} ]
                "integer nx" 2 "integer ny" 1 "integer nz" 1 "float density" [ 0.5 2 ]
            AttributeBegin {tiles}
                Texture "tiles" "spectrum" "checkerboard" "string mapping" "planar" "rgb tex1" [ 0.8 0.7 0.2 ]
                    "rgb tex2" [ 0.1 0.2 0.6 ] "vector3 v1" [ 1 0 0 ] "vector3 v2" [ 0 1 0 ]
                Texture "cubes" "spectrum" "checkerboard" "integer dimension" 3
                    "rgb tex1" [ 0.9 0.2 0.2 ] "rgb tex2" [ 0.2 0.9 0.2 ]
            AttributeEnd
            AttributeBegin {here}
                Texture "noise" "float" "fbm" "integer octaves" 4
                Texture "clouds" "spectrum" "mix" "texture amount" "noise"
                    "rgb tex1" [ 0.5 0.5 0.5 ] "rgb tex2" [ 0.9 0.9 0.3 ]
            AttributeEnd
            Material "diffuse" "texture reflectance" "tiles"
            Shape "trianglemesh" "point3 P" [ {floor} ] "integer indices" [ 0 1 2  0 2 3 ]
            Material "diffuse" "texture reflectance" "cubes"
            Shape "bilinearmesh" "point3 P" [ {patch} ]
            Material "diffuse" "texture reflectance" "clouds"
            Shape "loopsubdiv" "integer levels" 2 "point3 P" [ {tetrahedron} ]
                "integer indices" [ 0 2 1  0 1 3  1 2 3  2 0 3 ]
            Shape "curve" "point3 P" [ {curve} ] "float width" 0.125
            AttributeBegin {ball} Material "dielectric" Shape "sphere" "float radius" 0.75 AttributeEnd
            AttributeBegin AreaLightSource "diffuse" "rgb L" [ 4 4 4 ]
                Shape "bilinearmesh" "point3 P" [ {roof} ] AttributeEnd
            AttributeBegin ActiveTransform EndTime Translate 0.25 0 0.5 ActiveTransform All
                Shape "trianglemesh" "point3 P" [ {mover} ] AttributeEnd
            AttributeBegin {fog} MediumInterface "fog" "" Material "interface"
                Shape "sphere" "float radius" 1 AttributeEnd
            AttributeEnd
            "#
        )
    }
}

fn loaded(text: &str, folder: &Path) -> Loaded {
    let files = FileCache::default();
    load_text(text, "far.pbrt", folder, &LoadOptions::default(), &files).unwrap_or_else(|report| panic!("{report}"))
}

fn rendered(loaded: Loaded, accel: AccelKind) -> Vec<f32> {
    let job = loaded.job(accel, None).unwrap();
    let settings = RenderSettings { spp: 4, with_features: false, with_replicas: false, ..RenderSettings::default() };
    channels(&render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film, &[], None).data
}

fn image(text: &str) -> Vec<f32> {
    rendered(loaded(text, Path::new(".")), AccelKind::Embree)
}

/// Fraction of the values that differ by more than the rounding error of a hit away from edges.
fn others(a: &[f32], b: &[f32]) -> f64 {
    assert!(a.len() == b.len() && b.iter().any(|x| *x > 0.0));
    let differs = a.iter().zip(b).filter(|(a, b)| (*a - *b).abs() > 1e-3 * (a.abs() + b.abs()));
    differs.count() as f64 / a.len() as f64
}

fn translate(o: Point) -> String {
    format!("Translate {}", points(o, &[NEAR]))
}

fn back(o: Point) -> Point {
    o.map(|x| 0.0 - x)
}

#[test]
fn a_scene_has_the_same_image_wherever_it_is_and_however_it_comes_there() {
    let way = |o: Point, place: &str, portal: Point| Way { o, place, portal, world_textures: true }.world();
    let near = image(&(head(NEAR) + &way(NEAR, "", NEAR)));
    let matrix = format!("ConcatTransform [ 1 0 0 0  0 1 0 0  0 0 1 0  {} 1 ]", points(FAR, &[NEAR]));
    let there_and_back = format!("{} Scale 4 4 4 Scale 0.25 0.25 0.25 {}", translate(FAR), translate(back(FAR)));
    // The transformation of a camera maps world space to camera space
    let moved_head = head(NEAR).replace("\nCamera", &format!("\n{}\nCamera", translate(FAR)));
    let system = format!("{} CoordinateSystem \"far\" Identity CoordSysTransform \"far\"", translate(FAR));
    for (name, text) in [
        ("points in the text", head(FAR) + &way(FAR, "", FAR)),
        ("a translation", head(FAR) + &way(NEAR, &translate(FAR), FAR)),
        ("a matrix", head(FAR) + &way(NEAR, &matrix, FAR)),
        ("a coordinate system", head(FAR) + &way(NEAR, &system, FAR)),
        ("the camera's transformation", moved_head + &way(NEAR, &translate(back(FAR)), back(FAR))),
        ("points that are moved back", head(NEAR) + &way(FAR, &translate(back(FAR)), NEAR)),
        ("there and back", head(NEAR) + &way(NEAR, &there_and_back, NEAR)),
    ] {
        let far = image(&text);
        assert!(far == near, "{name}: {:.4} of the numbers differ", others(&far, &near));
    }
    for (o, place) in [(ODD, String::new()), (NEAR, translate(ODD))] {
        let far = Way { o, place: &place, portal: ODD, world_textures: false };
        let others = others(&image(&(head(ODD) + &far.world())), &near);
        assert!(others < 0.02, "beside the grid, {place}: {others:.4} of the numbers differ");
    }
}

#[test]
fn objects_have_the_same_image_wherever_they_are_defined_and_placed() {
    // Scene with nested objects
    let lamp = |o: Point| {
        format!("LightSource \"point\" \"point3 from\" [ {} ] \"rgb I\" [ 20 20 20 ]\n", points(o, &[[2.0, -3.0, 4.0]]))
    };
    let object = |o: Point| {
        let at = |p: Point| translate([o[0] + p[0], o[1] + p[1], o[2] + p[2]]);
        let [a, b] = [
            [[-1.0, 1.0, 0.25], [0.5, 1.25, 0.0], [0.0, 1.0, 1.5]],
            [[0.5, 0.0, 0.0], [1.5, 0.0, 0.0], [1.0, 0.5, 1.0]],
        ];
        format!(
            "ObjectBegin \"inner\" Shape \"trianglemesh\" \"point3 P\" [ {} ]\n\
             AttributeBegin {} Shape \"sphere\" \"float radius\" 0.5 AttributeEnd ObjectEnd\n\
             ObjectBegin \"outer\" Shape \"trianglemesh\" \"point3 P\" [ {} ]\n\
             ActiveTransform EndTime Translate 0 0 0.5 ActiveTransform All\n\
             Shape \"trianglemesh\" \"point3 P\" [ {} ]\n\
             ObjectInstance \"inner\" ObjectEnd\n",
            points(o, &a),
            at([-0.5, -0.5, 0.5]),
            points(o, &b),
            points(o, &b.map(|p| [p[0], p[1] - 1.0, p[2] + 0.5])),
        )
    };
    let scene = |camera: Point, defined: Point, placed: Point| {
        let places =
            format!("{} ObjectInstance \"outer\"\nTranslate 0 0 1 ObjectInstance \"inner\"\n", translate(placed));
        head(camera) + &lamp(camera) + &object(defined) + &places
    };

    // Definitions and instances here and there
    for accel in [AccelKind::Embree, AccelKind::Bvh] {
        let image = |text: String| rendered(loaded(&text, Path::new(".")), accel);
        let near = image(scene(NEAR, NEAR, NEAR));
        for (way, camera, defined, placed) in [
            ("placed there", FAR, NEAR, FAR),
            ("defined there", FAR, FAR, NEAR),
            ("defined there, placed back", NEAR, FAR, back(FAR)),
        ] {
            let far = image(scene(camera, defined, placed));
            assert!(far == near, "{way}, {accel:?}: {:.4} of the numbers differ", others(&far, &near));
        }
    }
}

/// A PLY file of two triangles, with points of type `ty`.
fn ply(format: &str, ty: &str, at: &[Point; 4]) -> Vec<u8> {
    // Header
    let header = format!(
        "ply\nformat {format} 1.0\nelement vertex 4\nproperty {ty} x\nproperty {ty} y\nproperty {ty} z\n\
         element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    );

    // Vertices and faces
    let faces = [[0, 1, 2], [0, 2, 3_i32]];
    let mut file = header.into_bytes();
    if format == "ascii" {
        let rows = at.iter().map(|p| format!("{} {} {}\n", p[0], p[1], p[2]));
        let faces = faces.iter().map(|f| format!("3 {} {} {}\n", f[0], f[1], f[2]));
        file.extend(rows.chain(faces).flat_map(String::into_bytes));
    } else {
        file.extend(at.as_flattened().iter().flat_map(|x| x.to_be_bytes()));
        for face in faces {
            file.push(3);
            file.extend(face.iter().flat_map(|i| i.to_be_bytes()));
        }
    }
    file
}

#[test]
fn ply_files_of_doubles_keep_them() {
    // A sheet from a file
    let folder = tempfile::tempdir().unwrap();
    let sheet = |o: Point| {
        [[-2.0, 1.0, 0.25], [0.5, 0.5, 0.0], [2.0, 2.0, 1.5], [-1.0, 3.0, 2.0]]
            .map(|p| [p[0] + o[0], p[1] + o[1], p[2] + o[2]])
    };
    let image = |o: Point, format: &str| {
        std::fs::write(folder.path().join("sheet.ply"), ply(format, "double", &sheet(o))).unwrap();
        let lamp = points(o, &[[2.0, -3.0, 4.0]]);
        let world = format!(
            "LightSource \"point\" \"point3 from\" [ {lamp} ]\nShape \"plymesh\" \"string filename\" \"sheet.ply\"\n"
        );
        rendered(loaded(&(head(o) + &world), folder.path()), AccelKind::Bvh)
    };

    // Near and far
    let near = image(NEAR, "ascii");
    for format in ["ascii", "binary_big_endian"] {
        let far = image(FAR, format);
        assert!(far == near, "{format}: {:.4} of the numbers differ", others(&far, &near));
    }
}

/// A glTF file whose camera, light and meshes are children of a node at `o`.
fn gltf(o: Point, has_camera: bool) -> String {
    let o = o.map(|x| x.to_string()).join(",");
    let camera = if has_camera { r#","camera":0"# } else { "" };
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"extensionsUsed":["KHR_lights_punctual"],
        "extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"point","intensity":6830}}]}}}},
        "nodes":[{{"translation":[{o}],"children":[1,2,3,4]}},{{"translation":[0.25,0.5,4]{camera}}},
          {{"translation":[1,2,2],"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}},
          {{"mesh":0,"translation":[0,0.5,0]}},
          {{"mesh":1,"matrix":[0,1,0,0,-1,0,0,0,0,0,1,0,0.5,-0.25,0.5,1],"children":[5]}},{{"mesh":1}}],
        "cameras":[{{"type":"perspective","perspective":{{"yfov":0.7,"znear":0.1,"aspectRatio":1.5}}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}},{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[-1,0,-1],"max":[1,1.5,-0.5]}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],"buffers":[{{"byteLength":36,"uri":"far.bin"}}]}}"#
    )
}

#[test]
fn gltf_nodes_have_the_same_image_wherever_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("far.gltf");
    let corners = [-1.0, 0.0, -1.0, 1.0, 0.0, -0.5, 0.0, 1.5, -1.0_f32];
    std::fs::write(folder.path().join("far.bin"), corners.map(f32::to_le_bytes).as_flattened()).unwrap();
    let options = LoadOptions { resolution: Some([36, 24]), ..LoadOptions::default() };
    for has_camera in [true, false] {
        let image = |o: Point| {
            std::fs::write(&path, gltf(o, has_camera)).unwrap();
            rendered(load(&path, &options).unwrap_or_else(|report| panic!("{report}")), AccelKind::Bvh)
        };
        let (near, far) = (image(NEAR), image(FAR));
        assert!(far == near, "camera {has_camera}: {:.4} of the numbers differ", others(&far, &near));
        let odd = others(&image(ODD), &near);
        assert!(odd < 0.02, "camera {has_camera}, beside the grid: {odd:.4} of the numbers differ");
    }
}

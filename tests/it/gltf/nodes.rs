//! Nodes of glTF scenes: instances, skins, weights, scales, chains, and visibility.

use super::{VALUES, bounds, container, floats, loaded};
use lumiris::geometry::Shape;
use lumiris::import::{LoadOptions, load};
use lumiris::lights::Light;
use lumiris::scene::AccelKind;
use lumiris_numbers::math::Vec3;

#[test]
fn morph_targets_have_their_default_weights() {
    let mesh = |weights: &str| {
        format!(
            r#""meshes":[{{{weights}"primitives":[{{"attributes":{{"POSITION":0}},"targets":[{{"POSITION":1}}]}}]}}]"#
        )
    };
    let top = |nodes: &str, weights: &str| bounds(nodes, &mesh(weights), &VALUES).unwrap().0.max;
    assert_eq!(top(r#"{"mesh":0},{}"#, ""), Vec3::new(1.0, 1.0, 0.0));
    assert_eq!(top(r#"{"mesh":0},{}"#, r#""weights":[0.5],"#), Vec3::new(2.0, 1.0, 2.0));
    let of_node = r#"{"mesh":0,"weights":[1],"translation":[0,1,0]},{}"#;
    assert_eq!(top(of_node, r#""weights":[0.5],"#), Vec3::new(3.0, 2.0, 4.0));
}

#[test]
fn hidden_nodes_and_their_children_are_left_out_but_for_cameras_and_joints() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    let load_with = |visible: &str, child: &str| {
        // (0, 0, 0), (1, 0, 0) and (0, 1, 0)
        let data = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"extensionsRequired":["KHR_node_visibility","KHR_lights_punctual"],
            "scenes":[{{"nodes":[0,2]}}],
            "nodes":[{{"children":[1],"mesh":0,"extensions":{{"KHR_node_visibility":{{{visible}}}}}}},
                {{"mesh":0,"camera":0,"translation":[5,0,3],
                  "extensions":{{"KHR_lights_punctual":{{"light":0}},"KHR_node_visibility":{{{child}}}}}}},
                {{"mesh":0}}],
            "extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"point"}}]}}}},
            "cameras":[{{"type":"perspective","perspective":{{"yfov":0.7,"znear":0.1,"aspectRatio":2}}}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}}],
            "bufferViews":[{{"buffer":0,"byteLength":36}}],
            "buffers":[{{"byteLength":36,"uri":"data:application/octet-stream;base64,{data}"}}]}}"#
        );
        std::fs::write(&path, json).unwrap();
        let scene = load(&path, &LoadOptions::default()).map_err(|report| report.to_string()).unwrap().scene;
        let points = scene.lights.lights.iter().filter(|light| matches!(light, Light::Point(_))).count();
        assert_eq!(scene.film.resolution, [1440, 720], "the camera is there");
        (scene.geometry.world_bounds().max.x, points)
    };
    assert_eq!(load_with("", ""), (6.0, 1));
    assert_eq!(load_with(r#""visible":true"#, ""), (6.0, 1));
    assert_eq!(load_with("", r#""visible":false"#), (1.0, 0));
    assert_eq!(load_with(r#""visible":false"#, r#""visible":true"#), (1.0, 0));
}

#[test]
fn skins_follow_their_joints_and_not_their_node() {
    let rest = |joint: u32| {
        format!(
            r#""skins":[{{"joints":[1],"inverseBindMatrices":2}}],"meshes":[{{"primitives":[
            {{"attributes":{{"POSITION":0,"JOINTS_0":{joint},"WEIGHTS_0":4}}}}]}}]"#
        )
    };
    let nodes = r#"{"mesh":0,"skin":0,"translation":[9,9,9]},{"translation":[10,0,0],"scale":[2,1,1]}"#;
    let (bounds_of_skin, _) = bounds(nodes, &rest(3), &VALUES).unwrap();
    assert_eq!((bounds_of_skin.min, bounds_of_skin.max), (Vec3::new(10.0, 0.0, 5.0), Vec3::new(12.0, 1.0, 5.0)));
    let hidden = nodes.replace(r#""scale""#, r#""extensions":{"KHR_node_visibility":{"visible":false}},"scale""#);
    assert_eq!(bounds(&hidden, &rest(3), &VALUES).unwrap().0, bounds_of_skin, "joints need not be seen");
    let error = bounds(nodes, &rest(4), &VALUES).map(|_| ()).unwrap_err();
    assert!(error.contains("JOINTS_0") && error.contains("of 1"), "{error}");
}

#[test]
fn meshes_that_stand_twice_are_instances() {
    let mesh = r#""meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}]"#;
    let (bounds, loaded) = bounds(r#"{"mesh":0},{"mesh":0,"scale":[-3,1,1]}"#, mesh, &VALUES).unwrap();
    let geometry = &loaded.scene.geometry;
    assert_eq!((geometry.groups.len(), geometry.instances.len(), geometry.geometries.len()), (1, 2, 1));
    assert_eq!((bounds.min, bounds.max), (Vec3::new(-3.0, 0.0, 0.0), Vec3::new(1.0, 1.0, 0.0)));
    assert!(loaded.warnings.to_string().contains("no light"), "{}", loaded.warnings);
}

#[test]
fn nodes_with_a_scale_of_zero_flatten_their_meshes() {
    let mesh = r#""meshes":[{"primitives":[{"attributes":{"POSITION":1,"NORMAL":0}}]}]"#;
    // With different z
    let mut values = VALUES;
    values[9..18].copy_from_slice(&[0.0, 0.0, 0.0, 1.0, 0.0, 2.0, 0.0, 1.0, 4.0]);
    values[..9].copy_from_slice(&[0.6, 0.0, 0.8, 0.6, 0.0, 0.8, 0.6, 0.0, 0.8]);
    let flat = r#"{"mesh":0,"scale":[1,1,0],"translation":[0,0,7]}"#;
    let (one, loaded) = bounds(&format!("{flat},{{}}"), mesh, &values).unwrap();
    assert_eq!((one.min, one.max), (Vec3::new(0.0, 0.0, 7.0), Vec3::new(1.0, 1.0, 7.0)));
    let hit = loaded.scene.geometry.surface_hit(0, 0, u32::MAX, [0.2, 0.2], 0.0);
    assert!((hit.n - Vec3::Z).length() < 1e-6 && (hit.ns - Vec3::Z).length() < 1e-6, "{hit:?}");
    // Together with instances, which need inverse matrices
    let nodes = format!(r#"{{"children":[2,3]}},{flat},{{"mesh":0}},{{"mesh":0,"translation":[1,0,0]}}"#);
    let (all, loaded) = bounds(&nodes, mesh, &values).unwrap();
    let geometry = &loaded.scene.geometry;
    assert_eq!((geometry.instances.len(), geometry.geometries.len(), geometry.root.geometries.len()), (2, 2, 1));
    assert_eq!(all.max, Vec3::new(2.0, 1.0, 7.0));
    assert!(loaded.job(AccelKind::Embree, None).is_ok());
}

/// A document with a chain of `n` nodes, each with a mesh and a material.
fn chain(n: usize) -> String {
    let list = |item: &dyn Fn(usize) -> String| (0..n).map(item).collect::<Vec<_>>().join(",");
    let children = |i: usize| if i + 1 < n { format!(r#","children":[{}]"#, i + 1) } else { String::new() };
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{}],"meshes":[{}],"materials":[{}],
        "accessors":[{}]}}"#,
        list(&|i| format!(r#"{{"mesh":{i},"translation":[1,0,0]{}}}"#, children(i))),
        list(&|i| format!(r#"{{"primitives":[{{"attributes":{{"POSITION":{i}}},"material":{i}}}]}}"#)),
        list(&|i| format!(r#"{{"name":"{i}"}}"#)),
        list(&|_| r#"{"componentType":5126,"count":3,"type":"VEC3"}"#.to_owned()),
    )
}

#[test]
fn chains_of_nodes_may_be_as_deep_as_they_are_long() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    std::fs::write(&path, chain(20_000)).unwrap();
    let scene = load(&path, &LoadOptions::default()).map_err(|r| r.to_string()).unwrap().scene;
    assert_eq!((scene.geometry.geometries.len(), scene.materials.entries().len()), (20_000, 20_001));
    assert_eq!(f64::from(scene.geometry.world_bounds().max.x) + scene.origin.x, 20_000.0);
}

#[test]
fn primitives_take_their_own_vertices_of_a_shared_accessor() {
    // A mesh with three of 40 vertices
    let json = r#"{"asset":{"version":"2.0"},"nodes":[{"mesh":0}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0,"COLOR_0":0},"indices":1}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":40,"type":"VEC3"},
                     {"bufferView":1,"componentType":5121,"count":3,"type":"SCALAR"}],
        "bufferViews":[{"buffer":0,"byteLength":480},{"buffer":0,"byteOffset":480,"byteLength":3}],
        "buffers":[{"byteLength":483}]}"#;
    let vertex = |i: usize| [i as f32, (i * i) as f32, 0.5];
    let with = |indices: [u8; 3]| {
        let bytes = [floats(&(0..40).flat_map(vertex).collect::<Vec<f32>>()), indices.to_vec()].concat();
        let folder = tempfile::tempdir().unwrap();
        loaded(folder.path(), &container(json, bytes))
    };

    // Only these are stored
    let scene = with([30, 4, 17]).unwrap().scene;
    let Shape::Mesh(mesh) = &scene.geometry.geometries[0].shape else { panic!("a mesh") };
    assert_eq!((mesh.positions().len(), mesh.colors.len()), (3, 3));
    assert_eq!(mesh.triangle(0), [30, 4, 17].map(|i| Vec3::from(vertex(i))));
    assert_eq!(mesh.indices[0].map(|v| mesh.colors[v as usize][1]), [900.0, 16.0, 289.0]);
    let error = with([0, 1, 40]).map(|_| ()).unwrap_err();
    assert!(error.contains("[0, 1, 40], but there are 40 vertices"), "{error}");
}

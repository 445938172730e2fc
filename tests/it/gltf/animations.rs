//! Animations of glTF scenes, and the automatic camera.

use super::{container, floats, triangle};
use lumiris::geometry::Shape;
use lumiris::import::{LoadOptions, load};
use lumiris_numbers::math::{Vec2, Vec3};

/// A triangle that is translated, rotated and deformed by an animation with keys at 1 s and 3 s.
fn animated(rest: &str) -> Vec<u8> {
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0,"weights":[0.25]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"targets":[{{"POSITION":1}}]}}]}}],
        "animations":[{{"samplers":[{{"input":2,"output":3}},{{"input":2,"output":4}},{{"input":2,"output":5,"interpolation":"STEP"}},
                                   {{"input":2,"output":6}}],
            "channels":[{{"sampler":0,"target":{{"node":0,"path":"translation"}}}},{{"sampler":1,"target":{{"node":0,"path":"rotation"}}}},
                        {{"sampler":2,"target":{{"node":0,"path":"weights"}}}}{rest}]}},
            {{"samplers":[{{"input":2,"output":6}}],"channels":[{{"sampler":0,"target":{{"node":0,"path":"translation"}}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}},
                     {{"bufferView":0,"byteOffset":36,"componentType":5126,"count":3,"type":"VEC3"}},
                     {{"bufferView":0,"byteOffset":72,"componentType":5126,"count":2,"type":"SCALAR"}},
                     {{"bufferView":0,"byteOffset":80,"componentType":5126,"count":2,"type":"VEC3"}},
                     {{"bufferView":0,"byteOffset":104,"componentType":5126,"count":2,"type":"VEC4"}},
                     {{"bufferView":0,"byteOffset":136,"componentType":5126,"count":2,"type":"SCALAR"}},
                     {{"bufferView":0,"byteOffset":144,"componentType":5126,"count":2,"type":"VEC3"}}],
        "bufferViews":[{{"buffer":0,"byteLength":168}}],"buffers":[{{"byteLength":168}}]}}"#
    );
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let values = [
        &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0][..], // vertices
        &[0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 4.0],     // changes
        &[1.0, 3.0],                                        // times
        &[10.0, 0.0, 0.0, 20.0, 0.0, 0.0],                  // translation
        &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half],        // rotation: 90° about z
        &[0.0, 1.0],                                        // weights
        &[100.0, 0.0, 0.0, 100.0, 0.0, 0.0],                // translation by another animation
    ];
    container(&json, floats(&values.concat()))
}

#[test]
fn animations_move_nodes_and_bend_meshes_at_a_time() {
    let folder = tempfile::tempdir().unwrap();
    let at = |bytes: &[u8], time: Option<f32>| {
        let path = folder.path().join("a.glb");
        std::fs::write(&path, bytes).unwrap();
        let options = LoadOptions { time, ..LoadOptions::default() };
        load(&path, &options).map_err(|report| report.to_string())
    };
    let file = animated("");
    let vertices = |time| {
        let scene = at(&file, time).unwrap().scene;
        let Shape::Mesh(mesh) = &scene.geometry.geometries[0].shape else { panic!("a mesh") };
        mesh.positions().to_vec()
    };
    let near = |time, expected: [[f32; 3]; 3]| {
        let found = vertices(time);
        let off = found.iter().zip(expected).map(|(a, b)| (*a - Vec3::from(b)).length()).fold(0.0, f32::max);
        assert!(off < 1e-4, "{time:?}: {found:?}");
    };
    // Without a time: the weight of the node
    near(None, [[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [0.0, 1.0, 1.0]]);
    near(Some(0.0), [[10.0, 0.0, 0.0], [11.0, 0.0, 0.0], [10.0, 1.0, 0.0]]);
    // Half-way: rotated by 45°; step interpolation is still at the first key
    let half = std::f32::consts::FRAC_1_SQRT_2;
    near(Some(2.0), [[15.0, 0.0, 0.0], [15.0 + half, half, 0.0], [15.0 - half, half, 0.0]]);
    near(Some(7.0), [[20.0, 0.0, 0.0], [20.0, 3.0, 0.0], [19.0, 0.0, 4.0]]);

    let error = |rest: &str| at(&animated(rest), Some(1.0)).map(|_| ()).unwrap_err();
    let wrong = error(r#",{"sampler":9,"target":{"node":0,"path":"scale"}}"#);
    assert!(wrong.contains("is not there") && wrong.contains("animations[0].channels[3].sampler"), "{wrong}");
    let wrong = error(r#",{"sampler":1,"target":{"node":0,"path":"scale"}}"#);
    assert!(wrong.contains("has not 3 numbers for each key"), "{wrong}");
    let still = at(&triangle(), Some(1.0)).unwrap().warnings.to_string();
    assert!(still.contains("no animation"), "{still}");
}

#[test]
fn a_camera_that_frames_an_animation_is_the_same_at_all_times_and_sees_all_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    std::fs::write(&path, animated("")).unwrap();
    let at = |time| {
        let options = LoadOptions { time: Some(time), resolution: Some([64, 64]), ..LoadOptions::default() };
        load(&path, &options).map_err(|report| report.to_string()).unwrap().scene
    };
    let view = |time| {
        let scene = at(time);
        let corners = [[0.0, 0.0], [64.0, 0.0], [0.0, 64.0], [64.0, 64.0]];
        let rays = corners.map(|[x, y]| scene.camera.ray(Vec2::new(x, y), [0.5; 2], 0.5).ray);
        (scene.origin, rays.map(|ray| (ray.o, ray.d)))
    };
    let first = view(1.0);
    for time in [0.0, 1.7, 2.0, 3.0, 9.0] {
        assert_eq!(view(time), first, "at {time} s");
        // All of the scene is between the rays of the image corners
        let (_, [(o, a), (_, b), (_, c), (_, d)]) = first;
        let bounds = at(time).geometry.world_bounds();
        for p in [bounds.min, bounds.max] {
            let inside = [(a, b), (b, d), (d, c), (c, a)].map(|(u, v)| u.cross(v).dot(p - o).signum());
            assert!(inside.iter().all(|side| *side == inside[0]), "{p} at {time} s");
        }
    }
}

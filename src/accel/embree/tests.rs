//! Comparison of Embree with the pure-Rust tracer, and of packets with single rays.

use super::*;
use crate::accel::Bvh;
use crate::accel::embree::ErrorCode;
use crate::accel::scenes_for_tests::{
    Stripes, curve_rays, curve_scene, mixed_scene, random_placement, random_rays, rippled_sphere, separate_triangles,
    soup,
};
use crate::geometry::reference_for_tests::{random_point, triangle_hit};
use crate::geometry::{Clusters, Geometry, Group, Instance, Member, Shape, TriangleMesh, Visibility};
use lumiris_numbers::math::ray::offset_origin;
use lumiris_numbers::math::{Affine3A, Frame, Ray, Vec2, Vec3, warp};
use lumiris_test_support::random::{Pcg32, RngExt, pcg32};

use std::ffi::CStr;

const WIDTHS: [u32; 4] = [1, 4, 8, 16];
const COHERENCES: [Coherence; 3] = [Coherence::Coherent, Coherence::Packets, Coherence::Incoherent];

fn opaque(shape: Shape) -> Geometry {
    Geometry { shape, alpha: None, visibility: Visibility::ALL }
}

fn only_root(shapes: Vec<Shape>) -> Arc<GeometrySet> {
    let root = Group { geometries: (0..shapes.len() as u32).collect() };
    Arc::new(GeometrySet { geometries: shapes.into_iter().map(opaque).collect(), root, ..GeometrySet::default() })
}

/// Overlapping triangles in a few planes, some of them parallel to the axes.
fn coplanar(s: &mut Pcg32, triangles: u32) -> TriangleMesh {
    let mut corners = Vec::new();
    for k in 0..triangles {
        let plane = (k % 8) as f32;
        for _ in 0..3 {
            let p = random_point(s);
            let z =
                if plane < 4.0 { plane * 0.2 - 0.3 } else { p.x * 0.037 * plane + p.y * 0.05 * plane - 0.2 * plane };
            corners.push(Vec3::new(p.x, p.y, z));
        }
    }
    separate_triangles(corners)
}

/// Rays of a camera at (0.05, 0.02, 2.3), in tiles of 4 by 4 pixels.
fn camera_rays(side: usize) -> RayBatch {
    let mut rays = RayBatch::default();
    for (tile_y, tile_x) in (0..side / 4).flat_map(|y| (0..side / 4).map(move |x| (y, x))) {
        for k in 0..16 {
            let at = |tile: usize, k: usize| ((tile * 4 + k) as f32 + 0.5) / side as f32 * 1.4 - 0.7;
            let d = Vec3::new(at(tile_x, k % 4), at(tile_y, k / 4), -1.0).normalize();
            rays.push(&Ray { o: Vec3::new(0.05, 0.02, 2.3), d, t_max: f32::INFINITY, time: 0.25 });
        }
    }
    rays
}

/// Rays from a few points to edges or vertices of the mesh; 16 consecutive rays start at the same point.
fn aimed_rays(mesh: &TriangleMesh, count: usize, seed: u32, vertices: bool) -> RayBatch {
    let mut s = pcg32([seed, 6, 6]);
    let (mut rays, mut o) = (RayBatch::default(), Vec3::ZERO);
    for k in 0..count {
        if k % 16 == 0 {
            o = random_point(&mut s) * 2.0 + Vec3::Z * 1.5;
        }
        let triangle = (s.random::<f32>() * mesh.triangle_count() as f32) as usize % mesh.triangle_count();
        let [a, b, _] = mesh.triangle(triangle);
        let w = if vertices { 0.0 } else { s.random::<f32>() };
        let d = (a + (b - a) * w - o).normalize();
        rays.push(&Ray { o, d, t_max: f32::INFINITY, time: 0.5 });
    }
    rays
}

/// Rays almost parallel to the planes z = const.
fn grazing_rays(count: usize, seed: u32) -> RayBatch {
    let mut s = pcg32([seed, 7, 7]);
    let mut rays = RayBatch::default();
    for _ in 0..count {
        let (sin, cos) = (s.random::<f32>() * std::f32::consts::TAU).sin_cos();
        let o = random_point(&mut s) * Vec3::new(1.0, 1.0, 0.3);
        rays.push(&Ray {
            o,
            d: Vec3::new(cos, sin, (s.random::<f32>() - 0.5) * 0.02),
            t_max: f32::INFINITY,
            time: 0.1,
        });
    }
    rays
}

fn embree(set: &Arc<GeometrySet>, width: u32) -> EmbreeAccel {
    configured(set, width, c"")
}

fn configured(set: &Arc<GeometrySet>, width: u32, config: &CStr) -> EmbreeAccel {
    let options = EmbreeOptions { packet_width: Some(width), config: config.to_owned(), ..EmbreeOptions::default() };
    EmbreeAccel::with_options(Arc::clone(set), Some(Arc::new(Stripes)), options).unwrap()
}

fn intersect(accel: &dyn Accel, rays: &RayBatch, coherence: Coherence) -> Vec<Option<Hit>> {
    let mut hits = Vec::new();
    accel.intersect(rays, coherence, &mut hits);
    hits
}

fn occluded(accel: &dyn Accel, rays: &RayBatch, coherence: Coherence) -> Vec<bool> {
    let mut bits = Vec::new();
    accel.occluded(rays, coherence, &mut bits);
    bits
}

/// The bits of a hit.
fn bits(hit: &Option<Hit>) -> Option<[u32; 6]> {
    hit.map(|h| [h.t.to_bits(), h.uv[0].to_bits(), h.uv[1].to_bits(), h.geometry, h.primitive, h.instance])
}

/// True if one of the hits is at an edge of its triangle, where rounding errors decide between hit and miss.
fn is_at_edge(hits: [&Option<Hit>; 2]) -> bool {
    hits.into_iter().flatten().any(|Hit { uv: [u, v], .. }| u.min(*v).min(1.0 - u - v) < 1e-4)
}

/// True unless the AVX2 kernels round edge tests differently for single rays and packets, as on some processors.
fn rounds_edges_alike(config: &CStr) -> bool {
    config != c"isa=avx2" && (config != c"" || is_x86_feature_detected!("avx512f"))
}

/// Asserts that all widths and coherence flags give the same bits. Hits at edges are exempt if their rounding may
/// differ.
fn assert_widths_agree(name: &str, set: &Arc<GeometrySet>, batches: &[RayBatch], config: &CStr) {
    // Results of single rays
    let accels = WIDTHS.map(|width| configured(set, width, config));
    let is_exact = rounds_edges_alike(config);
    for (b, rays) in batches.iter().enumerate() {
        let first = intersect(&accels[0], rays, Coherence::Incoherent);
        let first_occluded = occluded(&accels[0], rays, Coherence::Incoherent);
        assert!(first.iter().any(Option::is_some), "{name} {b}: nothing is hit");

        // Compare all widths and coherences
        for (accel, coherence) in accels.iter().flat_map(|a| COHERENCES.map(|c| (a, c))) {
            let what = format!("{config:?}, {name}, batch {b}, width {}, {coherence:?}", accel.packet_width(coherence));
            let other = intersect(accel, rays, coherence);
            let differs = |i: usize| bits(&first[i]) != bits(&other[i]);
            let is_free = |i: usize| !is_exact && is_at_edge([&first[i], &other[i]]);
            let differing = (0..rays.len()).find(|&i| differs(i) && !is_free(i));
            let hits = differing.map(|i| format!("{:?} {:?} {:?}", rays.get(i), first[i], other[i]));
            assert_eq!(hits, None, "{what}");
            let of_edges = (0..rays.len()).filter(|&i| differs(i)).count();
            assert!(of_edges * 4 < rays.len(), "{of_edges}: {what}");

            // Compare occlusion
            let other_occluded = occluded(accel, rays, coherence);
            let differing = (0..rays.len()).find(|&i| first_occluded[i] != other_occluded[i] && !is_free(i));
            assert_eq!(differing, None, "occlusion, {what}");
        }
    }
}

fn ray_kinds(mesh: &TriangleMesh, count: usize) -> Vec<RayBatch> {
    let side = (count as f32).sqrt() as usize / 4 * 4 + 5;
    vec![
        camera_rays(side),
        random_rays(count, 1),
        aimed_rays(mesh, count, 2, false),
        aimed_rays(mesh, count, 3, true),
        grazing_rays(count, 4),
    ]
}

/// Asserts the same for many scenes, with `count` rays of each kind.
fn assert_widths_agree_everywhere(count: usize, config: &CStr) {
    let mut s = pcg32([1, 2, 3]);
    let meshes = [
        ("soup", soup(&mut s, 20_000, 0.1)),
        ("crossing triangles", soup(&mut s, 300, 1.5)),
        ("coplanar triangles", coplanar(&mut s, 400)),
        ("closed surface", rippled_sphere(300)),
    ];
    for (name, mesh) in meshes {
        let batches = ray_kinds(&mesh, count);
        assert_widths_agree(name, &only_root(vec![Shape::Mesh(mesh)]), &batches, config);
    }
    for samples in [1, 3] {
        let batches = ray_kinds(&rippled_sphere(12), count);
        assert_widths_agree("shapes and instances", &mixed_scene(9, samples), &batches, config);
    }
}

#[test]
fn packets_of_any_width_answer_as_single_rays_do() {
    assert_widths_agree_everywhere(20_003, c"");
}

/// `side` × `side` quads in a plane, each of two triangles along one of its diagonals.
fn grid(side: u32, other_diagonal: bool) -> TriangleMesh {
    let point = |i: u32| {
        let x = (i % (side + 1)) as f32 / side as f32 - 0.5;
        let y = (i / (side + 1)) as f32 / side as f32 - 0.5;
        Vec3::new(x, y, 0.31 * x - 0.17 * y)
    };
    let quad = |i: u32| {
        let a = i / side * (side + 1) + i % side;
        let b = (i / side + 1) * (side + 1) + i % side;
        if other_diagonal { [[a, a + 1, b], [b, a + 1, b + 1]] } else { [[a, a + 1, b + 1], [a, b + 1, b]] }
    };
    TriangleMesh::new((0..(side + 1).pow(2)).map(point).collect(), (0..side * side).flat_map(quad).collect()).unwrap()
}

#[test]
fn of_surfaces_that_lie_on_each_other_the_first_by_exact_parameter_and_ids_is_hit() {
    let coincident = [grid(7, false), grid(7, true), grid(1, false), grid(7, false)];
    let set = only_root(coincident.map(Shape::Mesh).to_vec());
    let batches =
        [camera_rays(128), aimed_rays(&grid(7, false), 2_003, 5, false), aimed_rays(&grid(7, true), 2_003, 6, true)];
    assert_widths_agree("coincident grids", &set, &batches, c"");

    let reference = intersect(&Bvh::new(Arc::clone(&set), None), &batches[0], Coherence::Packets);
    let of_geometry = |id: u32| reference.iter().flatten().filter(|hit| hit.geometry == id).count();
    assert!((0..3).all(|id| of_geometry(id) > 100) && of_geometry(3) == 0, "{:?}", [0, 1, 2, 3].map(of_geometry));
    for (width, coherence) in WIDTHS.into_iter().flat_map(|w| COHERENCES.map(|c| (w, c))) {
        let found = intersect(&embree(&set, width), &batches[0], coherence);
        let differing = (0..found.len())
            .find(|&i| bits(&found[i]) != bits(&reference[i]) && !is_at_edge([&found[i], &reference[i]]));
        assert_eq!(differing.map(|i| (found[i], reference[i])), None, "width {width}, {coherence:?}");
    }
}

#[test]
fn packets_answer_as_single_rays_do_in_the_kernels_of_older_processors() {
    for config in [c"isa=avx2", c"isa=avx", c"isa=sse4.2"] {
        assert_widths_agree_everywhere(5_003, config);
    }
}

#[test]
fn answers_agree_with_the_rust_tracer() {
    for (seed, samples) in [(1, 1), (2, 3), (3, 4)] {
        let set = mixed_scene(seed, samples);
        let reference = Bvh::new(Arc::clone(&set), Some(Arc::new(Stripes)));
        let accel = embree(&set, 8);
        let rays = random_rays(60_000, seed);
        let (expected, found) =
            (intersect(&reference, &rays, Coherence::Packets), intersect(&accel, &rays, Coherence::Packets));
        let hits = expected.iter().flatten().count();
        assert!(hits > 10_000, "{hits}");
        // Rays at edges may differ, and hits with the same t
        let differ = expected.iter().zip(&found).filter(|(a, b)| bits(a) != bits(b)).count();
        assert!(differ <= 3, "{differ} of {hits}");
        let (expected, found) =
            (occluded(&reference, &rays, Coherence::Packets), occluded(&accel, &rays, Coherence::Packets));
        assert!(expected.iter().filter(|&&o| o).count() > 5_000);
        let differ = expected.iter().zip(&found).filter(|(a, b)| a != b).count();
        assert!(differ <= 3, "{differ}");
    }
}

#[test]
fn curves_among_triangles_are_hit_as_by_the_rust_tracer() {
    for (seed, samples) in [(0, 1), (1, 3), (2, 1)] {
        let set = curve_scene(seed, samples);
        let rays = curve_rays(&set, 8000, seed);
        let bvh = Bvh::new(Arc::clone(&set), Some(Arc::new(Stripes)));
        let expected = intersect(&bvh, &rays, Coherence::Incoherent);
        let expected_occluded = occluded(&bvh, &rays, Coherence::Incoherent);
        let is_curve = |hit: &Hit| matches!(set.geometries[hit.geometry as usize].shape, Shape::Curves(_));
        let curves = expected.iter().flatten().filter(|hit| is_curve(hit)).count();
        let others = expected.iter().flatten().count() - curves;
        assert!(curves > 1500 && others > 300, "{curves} {others}");

        for (width, coherence) in WIDTHS.into_iter().flat_map(|w| COHERENCES.map(|c| (w, c))) {
            let accel = embree(&set, width);
            let found = intersect(&accel, &rays, coherence);
            let found_occluded = occluded(&accel, &rays, coherence);
            for i in 0..rays.len() {
                let pair = [&found[i], &expected[i]];
                let is_edge = is_at_edge(pair.map(|hit| if hit.is_some_and(|h| is_curve(&h)) { &None } else { hit }));
                assert!(bits(pair[0]) == bits(pair[1]) || is_edge, "{width} {coherence:?} {i}: {pair:?}");
                assert!(found_occluded[i] == expected_occluded[i] || is_edge, "{width} {coherence:?} {i}: occlusion");
            }
        }
    }
}

/// The set with clusters of its groups, two places of which coincide, and the same set with instances only.
fn with_clusters(set: &GeometrySet) -> [Arc<GeometrySet>; 2] {
    let mut set = set.clone();
    let mut s = pcg32([4, 4, 4]);
    for count in [3_u32, 5] {
        let mut placement = || random_placement(&mut s).as_daffine3();
        let group = |k| k % set.groups.len() as u32;
        let members = (0..count).map(|k| Member { group: group(k), cluster_from_group: placement() }).collect();
        let cluster = set.clusters.add(members);
        let places = [placement(), placement(), placement()];
        [0, 1, 2, 1].iter().for_each(|&i| set.clusters.place(cluster, places[i]));
    }
    assert_eq!(set.instance_count(), set.instances.len() as u32 + 32);
    let instances = (0..set.instance_count()).map(|i| set.instance(i).into_owned()).collect();
    let expanded = GeometrySet { instances, clusters: Clusters::default(), ..set.clone() };
    [set, expanded].map(Arc::new)
}

#[test]
fn clusters_give_the_hits_of_their_instances() {
    // Shapes of all kinds with alpha masks, moving instances beside clusters, and curves
    let curves = curve_scene(0, 1);
    let rays = curve_rays(&curves, 20_000, 0);
    let others = [mixed_scene(4, 1), mixed_scene(5, 3)].map(|set| (set, random_rays(20_000, 4)));
    for (set, rays) in others.into_iter().chain([(curves, rays)]) {
        let sets = with_clusters(&set);
        let bvhs = sets.each_ref().map(|set| Bvh::new(Arc::clone(set), Some(Arc::new(Stripes))));
        let [hits, expected] = bvhs.each_ref().map(|bvh| intersect(bvh, &rays, Coherence::Incoherent));
        assert!(hits.iter().zip(&expected).all(|(a, b)| bits(a) == bits(b)), "the BVH traces the same instances");
        let expected_occluded = occluded(&bvhs[0], &rays, Coherence::Incoherent);

        // Single rays and packets
        for (width, coherence) in WIDTHS.into_iter().flat_map(|w| COHERENCES.map(|c| (w, c))) {
            let accels = sets.each_ref().map(|set| embree(set, width));
            let [hits, of_instances] = accels.each_ref().map(|accel| intersect(accel, &rays, coherence));
            let in_clusters = hits.iter().flatten().filter(|hit| hit.instance >= set.instances.len() as u32).count();
            assert!(in_clusters > 2_000, "{in_clusters}");
            let [found, of_instances_too] = accels.each_ref().map(|accel| occluded(accel, &rays, coherence));
            for (expected, expected_occluded) in [(&expected, &expected_occluded), (&of_instances, &of_instances_too)] {
                let differ = hits.iter().zip(expected).filter(|(a, b)| bits(a) != bits(b)).count();
                let differ_in_occlusion = found.iter().zip(expected_occluded).filter(|(a, b)| a != b).count();
                assert!(
                    differ <= 3 && differ_in_occlusion <= 3,
                    "{width} {coherence:?}: {differ} {differ_in_occlusion}"
                );
            }
        }

        // Surfaces and bounds
        assert_eq!(sets[0].world_bounds(), sets[1].world_bounds());
        for (i, hit) in hits.iter().enumerate().filter_map(|(i, hit)| hit.map(|hit| (i, hit))) {
            let surface = |set: &Arc<GeometrySet>| {
                set.surface_hit_of_ray(hit.geometry, hit.primitive, hit.instance, hit.uv, &rays.get(i))
            };
            let [a, b] = sets.each_ref().map(surface);
            assert_eq!((a.p, a.n), (b.p, b.n));
        }
    }
}

#[test]
fn answers_agree_with_brute_force_in_f64() {
    // Trace with Embree
    let mut s = pcg32([4, 0, 1]);
    let mesh = soup(&mut s, 300, 0.4);
    let set = only_root(vec![Shape::Mesh(mesh.clone())]);
    let accel = embree(&set, 8);
    let rays = random_rays(20_000, 8);
    let hits = intersect(&accel, &rays, Coherence::Packets);
    let shadows = occluded(&accel, &rays, Coherence::Packets);

    // Compare with the nearest of all triangles
    let (mut hit_count, mut unclear) = (0, 0);
    for (i, (hit, &shadow)) in hits.iter().zip(&shadows).enumerate() {
        let ray = rays.get(i);
        let all = (0..mesh.triangle_count()).filter_map(|k| triangle_hit(&ray, mesh.triangle(k)).map(|h| (k, h)));
        let first = all.min_by(|a, b| a.1[0].total_cmp(&b.1[0]));
        assert_eq!(hit.is_some(), shadow);
        match (hit, first) {
            (None, None) => {}
            (Some(hit), Some((k, [t, b1, b2]))) if hit.primitive == k as u32 => {
                hit_count += 1;
                let scale = f64::from(ray.o.length() / ray.d.length()) + t;
                assert!((f64::from(hit.t) - t).abs() < 2e-4 * scale, "{hit:?} {t}");
                let error = (f64::from(hit.uv[0]) - b1).abs().max((f64::from(hit.uv[1]) - b2).abs());
                assert!(error < 2e-2, "{hit:?} {b1} {b2}");
            }
            _ => unclear += 1,
        }
    }
    assert!(hit_count > 5000 && unclear <= 2, "{hit_count} {unclear}");
}

#[test]
fn rays_that_leave_a_surface_do_not_meet_it_again() {
    let mut s = pcg32([12, 0, 0]);
    let mut tested = 0;
    // A triangle of any size and position
    for k in 0..60 {
        let center = random_point(&mut s) * 300.0;
        let scale = [0.01, 1.0, 50.0, 2000.0][k % 4];
        let corners = (0..3).map(|_| center + random_point(&mut s) * scale).collect();
        let set = only_root(vec![Shape::Mesh(separate_triangles(corners))]);
        let accel = embree(&set, 8);

        // Rays that leave it on both sides
        let mut rays = RayBatch::default();
        for _ in 0..20_000 {
            let u = s.random::<[f32; 2]>();
            let uv = if u[0] + u[1] > 1.0 { [1.0 - u[0], 1.0 - u[1]] } else { u };
            let hit = set.surface_hit(0, 0, Hit::NO_INSTANCE, uv, 0.0);
            let side = if s.random::<f32>() < 0.5 { hit.n } else { -hit.n };
            let d = Frame::from_z(side).to_world(warp::sample_cosine_hemisphere(s.random::<[f32; 2]>()));
            if hit.n.dot(d).abs() > 1e-4 {
                rays.push(&Ray { o: offset_origin(hit.p, hit.p_error, hit.n, d), d, t_max: f32::INFINITY, time: 0.0 });
            }
        }

        // No ray hits it again
        tested += rays.len();
        for coherence in [Coherence::Packets, Coherence::Incoherent] {
            let again = intersect(&accel, &rays, coherence).iter().flatten().count();
            let shadowed = occluded(&accel, &rays, coherence).iter().filter(|&&o| o).count();
            assert_eq!((again, shadowed), (0, 0), "triangle {k} of size {scale}");
        }
    }
    assert!(tested > 1_000_000);
}

#[test]
fn an_empty_scene_stops_nothing() {
    let set = Arc::new(GeometrySet {
        groups: vec![Group::default()],
        instances: vec![Instance { group: 0, world_from_group: vec![Affine3A::IDENTITY] }],
        ..GeometrySet::default()
    });
    let accel = EmbreeAccel::new(set, None, None).unwrap();
    let rays = random_rays(100, 3);
    for coherence in COHERENCES {
        assert_eq!(intersect(&accel, &rays, coherence), vec![None; 100]);
        assert_eq!(occluded(&accel, &rays, coherence), vec![false; 100]);
    }
    assert_eq!(intersect(&accel, &RayBatch::default(), Coherence::Coherent), vec![]);
}

#[test]
fn rays_that_are_not_finite_or_empty_hit_nothing() {
    let set = only_root(vec![Shape::Mesh(rippled_sphere(20))]);
    let accel = embree(&set, 8);
    let good = Ray { o: Vec3::Z * 3.0, d: -Vec3::Z + Vec3::X * 0.01, t_max: f32::INFINITY, time: f32::NAN };
    let mut rays = RayBatch::default();
    rays.push(&good);
    rays.push(&Ray { o: Vec3::NAN, ..good });
    rays.push(&Ray { o: Vec3::INFINITY, ..good });
    rays.push(&Ray { d: Vec3::ZERO, ..good });
    rays.push(&Ray { d: Vec3::new(0.0, f32::NEG_INFINITY, 0.0), ..good });
    rays.push(&Ray { t_max: 0.0, ..good });
    rays.push(&Ray { t_max: f32::NAN, ..good });
    rays.push(&Ray { t_max: -1.0, ..good });
    for coherence in COHERENCES {
        let hits: Vec<bool> = intersect(&accel, &rays, coherence).iter().map(Option::is_some).collect();
        assert_eq!(hits, [true, false, false, false, false, false, false, false], "{coherence:?}");
        assert_eq!(occluded(&accel, &rays, coherence), hits);
    }
}

#[test]
fn flat_and_infinite_placements_are_left_out() {
    // Two unusable instances and a good one
    let placed = |m| Instance { group: 0, world_from_group: vec![m] };
    let set = GeometrySet {
        geometries: vec![opaque(Shape::Mesh(rippled_sphere(20)))],
        groups: vec![Group { geometries: vec![0] }],
        root: Group::default(),
        instances: vec![
            placed(Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0))),
            placed(Affine3A::from_translation(Vec3::INFINITY)),
            placed(Affine3A::from_translation(Vec3::X * 4.0)),
        ],
        ..GeometrySet::default()
    };
    let accel = EmbreeAccel::new(Arc::new(set), None, None).unwrap();
    let mut rays = RayBatch::default();
    for x in [0.0, 4.0] {
        rays.push(&Ray { o: Vec3::new(x, 0.1, 3.0), d: -Vec3::Z, t_max: f32::INFINITY, time: 0.0 });
    }

    // Only the last one is hit
    let hits = intersect(&accel, &rays, Coherence::Packets);
    assert_eq!(hits.iter().map(|h| h.map(|h| h.instance)).collect::<Vec<_>>(), [None, Some(2)]);
}

#[test]
fn a_memory_limit_is_an_error_that_says_so() {
    let set = only_root(vec![Shape::Mesh(rippled_sphere(200))]);
    let options = EmbreeOptions { memory_limit: Some(100_000), ..EmbreeOptions::default() };
    let error = EmbreeAccel::with_options(Arc::clone(&set), None, options).err().unwrap();
    assert!(matches!(error, EmbreeError::Call { code: ErrorCode::OutOfMemory, .. }), "{error:?}");
    let message = error.to_string();
    assert!(message.contains("cannot build a scene") && message.contains("memory"), "{message}");

    let stats = EmbreeAccel::new(set, None, None).unwrap().stats();
    assert!(stats.bytes > 1_000_000 && stats.peak_bytes >= stats.bytes && stats.build_seconds > 0.0, "{stats:?}");
}

#[test]
fn a_misaligned_buffer_is_an_error_that_says_so() {
    let device = Arc::new(Device::new(c"", None).unwrap());
    let kind = embree4_sys::RTCGeometryType::RTC_GEOMETRY_TYPE_TRIANGLE;
    let geometry = crate::accel::embree::scene::EmbreeGeometry::new(&device, kind).unwrap();
    let positions = [[0.0_f32; 3]; 4];
    let askew = positions.as_ptr().wrapping_byte_add(1);
    let vertices = embree4_sys::RTCBufferType::RTC_BUFFER_TYPE_VERTEX;
    let error = geometry.share(vertices, askew, 3).unwrap_err();
    assert!(error.to_string().contains("cannot share a buffer of a mesh: invalid"), "{error}");
    // The error is reported once
    assert_eq!(device.check("do nothing"), Ok(()));
}

#[test]
fn unknown_packet_widths_are_refused() {
    for width in [0, 2, 32] {
        let error = EmbreeAccel::new(Arc::default(), None, Some(width)).err().unwrap();
        assert_eq!(error, EmbreeError::PacketWidth(width));
    }
}

#[test]
fn a_panic_in_an_alpha_source_comes_out_of_the_query() {
    struct Broken;
    impl AlphaSource for Broken {
        fn alpha(&self, _: u32, _: Vec2, _: &crate::geometry::VertexValues, _: Vec3) -> f32 {
            panic!("broken texture")
        }
    }
    let cut_out = Geometry { alpha: Some(0), ..opaque(Shape::Mesh(rippled_sphere(20))) };
    let set = GeometrySet { geometries: vec![cut_out], root: Group { geometries: vec![0] }, ..GeometrySet::default() };
    let accel = EmbreeAccel::new(Arc::new(set), Some(Arc::new(Broken)), None).unwrap();
    let rays = camera_rays(8);
    for coherence in COHERENCES {
        let query = std::panic::AssertUnwindSafe(|| intersect(&accel, &rays, coherence));
        let result = std::panic::catch_unwind(query);
        assert_eq!(result.unwrap_err().downcast_ref::<&str>(), Some(&"broken texture"));
    }
}

#[test]
fn many_instances_build_fast_and_small() {
    let mut s = pcg32([3, 3, 3]);
    let instances = (0..25_250).map(|_| Instance { group: 0, world_from_group: vec![random_placement(&mut s)] });
    let set = GeometrySet {
        geometries: vec![opaque(Shape::Mesh(rippled_sphere(122)))],
        groups: vec![Group { geometries: vec![0] }],
        root: Group::default(),
        instances: instances.collect(),
        ..GeometrySet::default()
    };
    let accel = EmbreeAccel::new(Arc::new(set), None, None).unwrap();
    let stats = accel.stats();
    // 30,000 triangles take about 3 MB, an instance about a hundred bytes of hierarchy
    assert!(stats.bytes < 40_000_000 && stats.peak_bytes < 80_000_000, "{stats:?}");
    let hits = intersect(&accel, &random_rays(1000, 1), Coherence::Packets);
    assert!(hits.iter().flatten().count() > 300);
}

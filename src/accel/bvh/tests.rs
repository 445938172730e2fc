//! Comparison with brute force. Both use the same exact intersections, so results must be bit-identical.

use super::*;
use crate::accel::scenes_for_tests::{
    Stripes, curve_rays, curve_scene, mixed_scene, random_patches, random_quadric, random_rays, separate_triangles,
    soup,
};
use crate::accel::{Accel, Coherence, Hit, RayBatch};
use crate::geometry::reference_for_tests::random_point;
use crate::geometry::triangle::{RayPrecomputed, intersect_triangle};
use crate::geometry::{BilinearMesh, GeometryId, Instance, TriangleMesh, loop_subdivide};
use lumiris_numbers::math::Ray;
use lumiris_test_support::random::{RngExt, pcg32};
use std::cell::RefCell;

/// All hits on a geometry with the ray in the space of its group, with their crossing numbers.
fn all_hits(set: &GeometrySet, id: GeometryId, ray: &Ray, instance: u32, hits: &mut Vec<(Hit, usize)>) {
    // Quadrics, patches and curves: reject every hit to collect all
    let hits = RefCell::new(hits);
    let push = |t: f32, uv, primitive: usize, crossing: usize| {
        hits.borrow_mut().push((Hit { t, uv, geometry: id, primitive: primitive as u32, instance }, crossing));
    };
    let shape = &set.geometries[id as usize].shape;
    let push_all_of = |primitive: u32| {
        let none = shape.intersect(primitive, ray, |hit, crossing| {
            push(hit.t, hit.uv, primitive as usize, crossing);
            false
        });
        assert_eq!(none, None);
    };
    let push_all = |count: usize| (0..count as u32).for_each(push_all_of);

    // Triangles are tested one by one
    match shape {
        Shape::Mesh(mesh) => {
            let Some(pre) = RayPrecomputed::new(ray) else { return };
            for i in 0..mesh.triangle_count() {
                if let Some(hit) = intersect_triangle(&pre, mesh.triangle(i), ray.t_max) {
                    push(hit.t, [hit.b1, hit.b2], i, 0);
                }
            }
        }
        Shape::Quadric(_) => push_all(1),
        Shape::Bilinear(mesh) => push_all(mesh.patch_count()),
        Shape::Curves(set) => (0..set.curves().len()).flat_map(|i| set.pieces_of(i)).for_each(push_all_of),
    }
}

/// First hit, and occlusion.
fn brute_force(set: &Arc<GeometrySet>, alpha: Option<&AlphaTest>, ray: &Ray) -> (Option<Hit>, bool) {
    // All hits in the root and in instances
    let mut hits = Vec::new();
    for &id in &set.root.geometries {
        all_hits(set, id, ray, Hit::NO_INSTANCE, &mut hits);
    }
    for (index, instance) in set.instances.iter().enumerate() {
        let m = instance.world_from_group_at(ray.time).inverse();
        let moved = Ray { o: m.transform_point3(ray.o), d: m.transform_vector3(ray.d), ..*ray };
        for &id in &set.groups[instance.group as usize].geometries {
            all_hits(set, id, &moved, index as u32, &mut hits);
        }
    }

    // Apply the interval and the alpha test
    hits.retain(|(h, crossing)| h.t < ray.t_max && alpha.is_none_or(|a| a.stops(h, *crossing, ray)));
    let hits: Vec<Hit> = hits.into_iter().map(|(h, _)| h).collect();

    // First hit on the path, any hit of shadow rays
    let seen = |h: &Hit, mask: Visibility| set.geometries[h.geometry as usize].visibility.0 & mask.0 != 0;
    let first = hits.iter().filter(|h| seen(h, Visibility::PATH)).min_by(|a, b| {
        let key = |h: &Hit| (h.instance, h.geometry, h.primitive);
        a.t.total_cmp(&b.t).then(key(a).cmp(&key(b)))
    });
    (first.copied(), hits.iter().any(|h| seen(h, Visibility::SHADOW)))
}

fn trace(bvh: &Bvh, rays: &RayBatch) -> (Vec<Option<Hit>>, Vec<bool>) {
    let (mut hits, mut occluded) = (Vec::new(), Vec::new());
    bvh.intersect(rays, Coherence::Incoherent, &mut hits);
    bvh.occluded(rays, Coherence::Incoherent, &mut occluded);
    (hits, occluded)
}

/// Compares with brute force. Returns the number of hits and of occluded rays.
fn assert_exact(set: &Arc<GeometrySet>, alpha: Option<Arc<dyn AlphaSource>>, rays: &RayBatch) -> (usize, usize) {
    let bvh = Bvh::new(Arc::clone(set), alpha.clone());
    let test = alpha.map(|source| AlphaTest::new(Arc::clone(set), source));
    let (hits, occluded) = trace(&bvh, rays);
    for i in 0..rays.len() {
        let ray = rays.get(i);
        assert_eq!((hits[i], occluded[i]), brute_force(set, test.as_ref(), &ray), "ray {i}: {ray:?}");
    }
    (hits.iter().flatten().count(), occluded.iter().filter(|&&o| o).count())
}

fn root_only(shapes: Vec<Shape>) -> Arc<GeometrySet> {
    let root = Group { geometries: (0..shapes.len() as u32).collect() };
    let geometries =
        shapes.into_iter().map(|shape| Geometry { shape, alpha: None, visibility: Visibility::ALL }).collect();
    Arc::new(GeometrySet { geometries, root, ..GeometrySet::default() })
}

#[test]
fn answers_equal_brute_force_on_mixed_scenes() {
    for seed in 0..4 {
        let set = mixed_scene(seed, 3);
        let rays = random_rays(4000, seed);
        let (opaque_hits, opaque_occluded) = assert_exact(&set, None, &rays);
        let (hits, occluded) = assert_exact(&set, Some(Arc::new(Stripes)), &rays);
        assert!(opaque_hits > 300 && hits > 100 && opaque_hits > hits, "{opaque_hits} {hits}");
        assert!(opaque_occluded > 300 && occluded > 100 && opaque_occluded > occluded, "{opaque_occluded} {occluded}");
    }
}

#[test]
fn answers_equal_brute_force_on_curves() {
    for seed in 0..3 {
        let set = curve_scene(seed, 3);
        let rays = curve_rays(&set, 2000, seed);
        let (hits, occluded) = assert_exact(&set, None, &rays);
        let (masked_hits, masked_occluded) = assert_exact(&set, Some(Arc::new(Stripes)), &rays);
        assert!(hits > 700 && occluded > 700, "{hits} {occluded}");
        assert!(masked_hits < hits && masked_occluded < occluded, "{masked_hits} {masked_occluded}");
    }
}

#[test]
fn answers_equal_brute_force_on_soups_of_any_size() {
    let mut s = pcg32([1, 1, 1]);
    let mut shapes = vec![Shape::Mesh(soup(&mut s, 3000, 0.1)), Shape::Mesh(soup(&mut s, 5, 3.0))];
    // Far from the origin, and flat in a coordinate plane
    let far = soup(&mut s, 200, 0.5);
    let moved = far.positions().iter().map(|p| *p + Vec3::new(0.0, 500.0, 0.0)).collect();
    shapes.push(Shape::Mesh(TriangleMesh::new(moved, far.indices.clone()).unwrap()));
    let flat = far.positions().iter().map(|p| p.with_y(0.25)).collect();
    shapes.push(Shape::Mesh(TriangleMesh::new(flat, far.indices).unwrap()));
    let set = root_only(shapes);
    let (hits, _) = assert_exact(&set, None, &random_rays(6000, 9));
    assert!(hits > 2000, "{hits}");

    let mut upward = RayBatch::default();
    for _ in 0..1000 {
        let o = random_point(&mut s) - Vec3::Y;
        upward.push(&Ray { o, d: Vec3::new(0.0, 1.0, 0.0), t_max: f32::INFINITY, time: 0.0 });
    }
    assert!(assert_exact(&set, None, &upward).0 > 500);
}

#[test]
fn alpha_stops_rays_with_its_probability() {
    let mut s = pcg32([2, 1, 1]);
    let square = |z: f32| {
        let p = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, z)).to_vec();
        let shape = Shape::Mesh(TriangleMesh::new(p, vec![[0, 1, 2], [1, 3, 2]]).unwrap());
        Geometry { shape, alpha: Some(1), visibility: Visibility::ALL }
    };
    let root = Group { geometries: vec![0, 1] };
    let set = Arc::new(GeometrySet { geometries: vec![square(1.0), square(2.0)], root, ..GeometrySet::default() });
    let bvh = Bvh::new(set, Some(Arc::new(Stripes)));
    let mut rays = RayBatch::default();
    let n = 40_000;
    for _ in 0..n {
        let o = (random_point(&mut s) * 0.9).with_z(0.0);
        rays.push(&Ray { o, d: Vec3::Z, t_max: f32::INFINITY, time: 0.0 });
    }
    let (hits, occluded) = trace(&bvh, &rays);
    // The surfaces decide independently: 0.4, then 0.6 · 0.4. Five standard deviations are 0.0125
    let share = |id: u32| hits.iter().flatten().filter(|h| h.geometry == id).count() as f64 / f64::from(n);
    assert!((share(0) - 0.4).abs() < 0.0125 && (share(1) - 0.24).abs() < 0.0125, "{} {}", share(0), share(1));
    for (hit, occluded) in hits.iter().zip(occluded) {
        assert_eq!(hit.is_some(), occluded);
    }
}

#[test]
fn equal_hits_go_to_the_smallest_ids() {
    let mut s = pcg32([3, 1, 1]);
    let mesh = soup(&mut s, 60, 0.5);
    let mut doubled = mesh.clone();
    doubled.indices.extend_from_within(..);
    let set = root_only(vec![Shape::Mesh(doubled), Shape::Mesh(mesh)]);
    let bvh = Bvh::new(set, None);
    let (hits, _) = trace(&bvh, &random_rays(2000, 4));
    assert!(hits.iter().flatten().count() > 300);
    assert!(hits.iter().flatten().all(|h| h.geometry == 0 && h.primitive < 60));
}

#[test]
fn degenerate_geometry_and_rays_are_harmless() {
    let mut s = pcg32([4, 1, 1]);
    let mesh = soup(&mut s, 400, 0.4);
    let good = root_only(vec![Shape::Mesh(mesh.clone())]);
    // The same mesh followed by bad triangles: NaN, infinite, and collapsed to lines and points
    let mut positions = mesh.positions().to_vec();
    let n = positions.len() as u32;
    positions.extend([Vec3::NAN, Vec3::INFINITY, Vec3::new(0.0, f32::NAN, 0.0), Vec3::splat(3e38)]);
    let mut indices = mesh.indices.clone();
    for i in 0..300 {
        indices.extend([[n, i, i + 1], [i, n + 1, i], [i, i + 2, n + 2], [i, i, i + 1], [7, 7, 7]]);
    }
    let patches =
        BilinearMesh { positions: vec![Vec3::NAN; 4], indices: vec![[0, 1, 2, 3]], ..BilinearMesh::default() };
    let bad = TriangleMesh::new(positions, indices).unwrap();
    let mut set = GeometrySet::clone(&root_only(vec![Shape::Mesh(bad), Shape::Bilinear(patches)]));
    set.groups = vec![Group { geometries: vec![0] }];
    let singular = Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0));
    for world_from_group in [vec![singular], vec![Affine3A::from_translation(Vec3::NAN)], vec![singular, singular]] {
        set.instances.push(Instance { group: 0, world_from_group });
    }
    let mut rays = random_rays(2000, 8);
    let expected = trace(&Bvh::new(good, None), &rays);
    let bvh = Bvh::new(Arc::new(set), None);
    assert_eq!(trace(&bvh, &rays), expected);

    rays.clear();
    for v in [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY, Vec3::splat(1e38), Vec3::splat(1e-42)] {
        rays.push(&Ray { o: Vec3::ZERO, d: v, t_max: f32::INFINITY, time: 0.0 });
        rays.push(&Ray { o: v, d: Vec3::X, t_max: f32::INFINITY, time: f32::NAN });
        rays.push(&Ray { o: Vec3::ZERO, d: Vec3::X, t_max: v.x, time: 2.0 });
        rays.push(&Ray { o: Vec3::ZERO, d: Vec3::X, t_max: -v.x, time: -2.0 });
    }
    assert_eq!(trace(&bvh, &rays).0.len(), rays.len());
}

#[test]
fn empty_scenes_and_single_primitives_work() {
    let rays = random_rays(500, 3);
    let empty = Arc::new(GeometrySet::default());
    assert_eq!(assert_exact(&empty, None, &rays), (0, 0));
    let mut s = pcg32([5, 1, 1]);
    for shape in [Shape::Mesh(soup(&mut s, 1, 3.0)), random_quadric(&mut s, 0), random_patches(&mut s, 1)] {
        assert_exact(&root_only(vec![shape]), None, &rays);
    }
    let large =
        separate_triangles(vec![Vec3::new(-4.0, -4.0, 0.1), Vec3::new(4.0, -4.0, 0.2), Vec3::new(0.0, 5.0, -0.3)]);
    assert!(assert_exact(&root_only(vec![Shape::Mesh(large)]), None, &rays).0 > 0);
    let all_bad = TriangleMesh::new(vec![Vec3::NAN; 3], vec![[0, 1, 2]; 9]).unwrap();
    assert_eq!(assert_exact(&root_only(vec![Shape::Mesh(all_bad)]), None, &rays), (0, 0));
}

#[test]
fn the_tree_does_not_depend_on_the_number_of_threads() {
    let mut s = pcg32([6, 1, 1]);
    let mesh = soup(&mut s, 150_000, 0.01);
    let set = root_only(vec![Shape::Mesh(mesh), random_quadric(&mut s, 1)]);
    let build = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Bvh::new(Arc::clone(&set), None))
    };
    let (one, four) = (build(1), build(4));
    assert!(one.root.nodes == four.root.nodes);
    assert_eq!(format!("{:?}", one.root.blocks), format!("{:?}", four.root.blocks));
    assert_eq!(one.root.others, four.root.others);
}

/// A closed, bumpy surface around the origin.
fn closed_mesh() -> TriangleMesh {
    let p = vec![Vec3::X, Vec3::Y, -Vec3::X, -Vec3::Y, Vec3::Z, -Vec3::Z];
    let faces = (0..4).flat_map(|k| [[k, (k + 1) % 4, 4], [(k + 1) % 4, k, 5]]).collect();
    let smooth = loop_subdivide(6, p, faces).unwrap();
    let bumpy = smooth.positions().iter().map(|p| *p * (1.0 + 0.1 * (40.0 * p.x).sin() * (30.0 * p.y).cos()));
    TriangleMesh::new(bumpy.collect(), smooth.indices).unwrap()
}

#[test]
fn rays_through_edges_and_vertices_of_a_closed_mesh_never_leak() {
    let mesh = closed_mesh();
    let mut s = pcg32([7, 1, 1]);
    for (shift, scale) in [(Vec3::ZERO, 1.0), (Vec3::new(300.0, -20.0, 1e4), 1.0), (Vec3::splat(0.1), 1e-3)] {
        let place = |p: Vec3| p * scale + shift;
        let placed = mesh.positions().iter().map(|&p| place(p)).collect();
        let placed = TriangleMesh::new(placed, mesh.indices.clone()).unwrap();
        let mut rays = RayBatch::default();
        for k in 0..200_000 {
            let [a, b, c] = placed.triangle((s.random::<f32>() * placed.triangle_count() as f32) as usize);
            let u = s.random::<f32>();
            let target = match k % 4 {
                0 => a,
                1 => a + (b - a) * u,
                2 => b + (c - b) * u,
                _ => place(random_point(&mut s)),
            };
            // From the inside, every ray must hit
            let o = place(random_point(&mut s) * 0.15);
            rays.push(&Ray { o, d: target - o, t_max: f32::INFINITY, time: 0.0 });
        }
        let (hits, occluded) = trace(&Bvh::new(root_only(vec![Shape::Mesh(placed)]), None), &rays);
        for (i, hit) in hits.iter().enumerate() {
            assert!(
                (hit.is_some() && occluded[i]) || rays.get(i).d == Vec3::ZERO,
                "{shift} {scale}: {:?}",
                rays.get(i)
            );
        }
    }
}

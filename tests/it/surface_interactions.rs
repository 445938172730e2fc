//! Interactions of many rays at once, against those of single rays.

use lumiris::accel::{Coherence, Hit, RayBatch};
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load_text};
use lumiris::scene::{AccelKind, RayHit, RenderJob, SurfaceInteraction, SurfaceInteractions};
use lumiris_numbers::math::warp::sample_uniform_sphere;
use lumiris_numbers::math::{Ray, Vec3};
use lumiris_test_support::random::{RngExt, pcg32};
use std::path::Path;

/// Triangles with all, no and degenerate texture coordinates, with normals, a sphere, and instances at rest and in
/// motion, about the origin.
const SCENE: &str = "
Camera \"perspective\"
WorldBegin
Material \"diffuse\"
Shape \"trianglemesh\" \"point3 P\" [ -2 -2 -2  2 -2 -2  0 2 -2 ] \"integer indices\" [ 0 1 2 ]
  \"point2 uv\" [ 0 0  1 0.2  0.3 1 ]
Shape \"trianglemesh\" \"point3 P\" [ -2 -2 2  2 -2 2  0 2 2 ] \"integer indices\" [ 0 1 2 ]
  \"point2 uv\" [ 0.3 0.3  0.3 0.3  0.3 0.3 ]
Shape \"trianglemesh\" \"point3 P\" [ -2 -2 -2  -2 -2 2  -2 2 0 ] \"integer indices\" [ 0 1 2 ]
  \"normal N\" [ 1 0.2 0  1 0 0.3  1 0 0 ]
AttributeBegin
Translate 2 0 0
Shape \"sphere\" \"float radius\" 0.8
AttributeEnd
ObjectBegin \"tile\"
Shape \"trianglemesh\" \"point3 P\" [ -1 0 -1  1 0 -1  0 0 1 ] \"integer indices\" [ 0 1 2 ]
  \"point2 uv\" [ 0 0  2 0  0 3 ]
ObjectEnd
AttributeBegin
Translate 0 2 0
Scale 1 2 0.5
ObjectInstance \"tile\"
AttributeEnd
AttributeBegin
ActiveTransform EndTime
Translate 0 0.5 0
ActiveTransform All
Translate 0 -2 0
ObjectInstance \"tile\"
AttributeEnd
";

#[test]
fn interactions_of_many_rays_are_those_of_single_rays() {
    let loaded = load_text(SCENE, "scene", Path::new("."), &LoadOptions::default(), &FileCache::default());
    let job: RenderJob = loaded.map_err(|d| d.to_string()).unwrap().job(AccelKind::Embree, None).unwrap();

    // Rays from near the origin, some of which hit nothing
    let mut s = pcg32([12, 0, 2]);
    let rays: Vec<Ray> = (0..2000)
        .map(|_| {
            let o = Vec3::from_array(std::array::from_fn(|_| s.random::<f32>() - 0.5));
            let d = sample_uniform_sphere(s.random::<[f32; 2]>()) * 3.0;
            Ray { o, d, t_max: f32::INFINITY, time: s.random::<f32>() }
        })
        .collect();
    let (mut batch, mut hits) = (RayBatch::default(), Vec::new());
    batch.set(rays.iter());
    job.world.accel.intersect(&batch, Coherence::Incoherent, &mut hits);

    // In their order, with the same bits
    let mut many = Vec::new();
    SurfaceInteractions::default().visit(
        &job,
        &rays,
        |ray| ray,
        &hits,
        |ray, interaction| {
            many.push((*ray, format!("{interaction:?}")));
        },
    );
    let met: Vec<(&Ray, &Hit)> = rays.iter().zip(&hits).filter_map(|(ray, hit)| Some((ray, hit.as_ref()?))).collect();
    assert!((500..2000).contains(&met.len()), "{}", met.len());
    assert_eq!(many.len(), met.len());
    for ((ray, found), (expected_ray, hit)) in many.iter().zip(&met) {
        assert_eq!((ray.o, ray.d), (expected_ray.o, expected_ray.d));
        assert_eq!(*found, format!("{:?}", SurfaceInteraction::new(&job, &RayHit::of_ray(ray, hit))));
    }
    // Every shape was met
    for geometry in 0..job.world.scene.geometry.geometries.len() as u32 {
        assert!(met.iter().any(|(_, hit)| hit.geometry == geometry), "{geometry}");
    }
}

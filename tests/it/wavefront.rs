//! Batched path tracing equals tracing vertex by vertex: the same random numbers give the same radiance.

use lumiris::direct::Fits;
use lumiris::film::PixelSample;
use lumiris::import::{LoadOptions, load};
use lumiris::integrators::PathTracer;
use lumiris::integrators::{CameraSample, CameraSamples};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::{EstimatorKind, IntegratorKind};
use lumiris_numbers::math::Vec2;
use lumiris_numbers::samplers::{SampleStream, SamplerKind};
use std::path::Path;

/// Many materials and lights, a box, and an environment.
const SCENES: [&str; 3] = ["scenes/demo/gallery.pbrt", "scenes/fan/box.pbrt", "scenes/analytic/half-environment.pbrt"];

const RESOLUTION: [u32; 2] = [64, 36];

fn job(scene: &str, kind: IntegratorKind, estimator: EstimatorKind, samples: u32, bsdf_fraction: f32) -> RenderJob {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(scene);
    let options = LoadOptions { resolution: Some(RESOLUTION), ..LoadOptions::default() };
    let mut loaded = load(&path, &options).map_err(|d| d.to_string()).unwrap();
    let integrator = &mut loaded.settings.integrator;
    (integrator.kind, integrator.estimator, integrator.samples) = (kind, estimator, Some(samples));
    integrator.bsdf_fraction = Some(bsdf_fraction);
    loaded.job(AccelKind::Embree, None).unwrap()
}

fn camera_samples(job: &RenderJob) -> CameraSamples {
    // One camera sample through the centre of each pixel
    let pixels = (0..RESOLUTION[1]).flat_map(|y| (0..RESOLUTION[0]).map(move |x| [x, y]));
    let sample = |pixel: [u32; 2]| {
        let stream = SampleStream::new(SamplerKind::Sobol, pixel, 0, 3);
        let film = Vec2::new(pixel[0] as f32 + 0.5, pixel[1] as f32 + 0.5);
        let ray = job.world.scene.camera.ray(film, [0.5; 2], 0.0);
        let sample_counts = job.settings().integrator.sample_counts();
        CameraSample { pixel, ..CameraSample::of_ray(ray, 1.0, stream, sample_counts) }
    };
    pixels.map(sample).collect()
}

/// Traces in batches, or by the stages of direct light, which list the contributions of samples.
fn traced(job: &RenderJob, samples: &CameraSamples, side_by_side: bool) -> Vec<PixelSample> {
    let mut out = Vec::new();
    let mut tracer = PathTracer::default();
    tracer.outcomes = (!side_by_side).then(Vec::new);
    tracer.trace(job, &job.settings().integrator, samples, &mut Fits::default(), &mut out);
    out
}

fn assert_same_radiance(
    scene: &str,
    kind: IntegratorKind,
    (estimator, samples, bsdf_fraction): (EstimatorKind, u32, f32),
    part: f64,
) {
    let job = job(scene, kind, estimator, samples, bsdf_fraction);
    assert_same_radiance_of(&job, scene, part);
}

fn assert_same_radiance_of(job: &RenderJob, scene: &str, part: f64) {
    let samples = camera_samples(job);
    let (a, b) = (traced(job, &samples, true), traced(job, &samples, false));
    let i = &job.settings().integrator;
    let what = format!("{scene} {:?} {:?} {}", i.kind, i.estimator, samples.sample_counts[0].samples);
    let mut lit = 0;
    let mut different = 0;
    for (a, b) in a.iter().zip(&b) {
        let (x, y) = (a.radiance.luminance(), b.radiance.luminance());
        lit += usize::from(y > 0.0);
        different += usize::from(!((x - y).abs() <= 1e-3 * (y.abs() + 1e-3)));
        let (f, g) = (a.features.unwrap_or_default(), b.features.unwrap_or_default());
        assert_eq!((f.material, f.object), (g.material, g.object), "{what}");
        assert!((f.normal - g.normal).length() < 1e-4 && (f.depth - g.depth).abs() <= 1e-4 * g.depth, "{what}");
        assert!((f.albedo - g.albedo).map(f32::abs).max_component() < 1e-4, "{what}");
    }
    // Rounding may change occlusion and the continuation of a path
    let allowed = ((1.0 - part) * samples.len() as f64) as usize;
    assert!(lit > samples.len() / 4 && different <= allowed, "{what}: {different} of {lit}");
}

#[test]
fn direct_light_is_that_of_the_stages() {
    for scene in SCENES {
        for (samples, bsdf_fraction) in [(2, 0.5), (7, 0.5), (4, 0.25), (8, 0.25)] {
            let estimator = (EstimatorKind::Mis, samples, bsdf_fraction);
            assert_same_radiance(scene, IntegratorKind::Direct, estimator, 0.99);
        }
        assert_same_radiance(scene, IntegratorKind::Direct, (EstimatorKind::Mc, 3, 0.0), 0.99);
    }
}

#[test]
fn paths_go_the_same_ways() {
    for scene in SCENES {
        assert_same_radiance(scene, IntegratorKind::Path, (EstimatorKind::Mc, 2, 0.0), 0.96);
        // Only in columns does the path continue with the single BSDF sample of the first vertex
        assert_same_radiance(scene, IntegratorKind::Path, (EstimatorKind::Mis, 4, 0.5), 0.96);
    }
}

//! Cryptomattes cost rays only if they are requested.

use lumiris::accel::bvh::Bvh;
use lumiris::accel::{Accel, AccelStats, Coherence, Hit, RayBatch};
use lumiris::import::{LoadOptions, load};
use lumiris::render::cryptomatte::{Cryptomatte, cryptomattes};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::AccelKind;
use lumiris::settings::IntegratorKind;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Counts the rays of closest-hit queries.
struct Counting {
    bvh: Bvh,
    rays: Arc<AtomicU64>,
}

impl Accel for Counting {
    fn intersect(&self, rays: &RayBatch, coherence: Coherence, hits: &mut Vec<Option<Hit>>) {
        self.rays.fetch_add(rays.len() as u64, Ordering::Relaxed);
        self.bvh.intersect(rays, coherence, hits);
    }

    fn occluded(&self, rays: &RayBatch, coherence: Coherence, occluded: &mut Vec<bool>) {
        self.bvh.occluded(rays, coherence, occluded);
    }

    fn stats(&self) -> AccelStats {
        self.bvh.stats()
    }
}

/// Tracing the camera rays of a finished image again used to take a fifth of the time of every render of direct light.
#[test]
fn camera_rays_are_traced_once_if_no_cryptomatte_is_asked_for() {
    // A ray tracer that counts
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/fan/box.pbrt");
    let options = LoadOptions { resolution: Some([16, 12]), ..LoadOptions::default() };
    let loaded = load(&path, &options).map_err(|d| d.to_string()).unwrap();
    let mut job = loaded.job(AccelKind::Embree, None).unwrap();
    job.change(|s| s.integrator.kind = IntegratorKind::Direct);
    let rays = Arc::new(AtomicU64::new(0));
    let scene = &job.world.scene;
    let bvh = Bvh::new(Arc::clone(&scene.geometry), Some(Arc::clone(&scene.textures) as _));
    job.world.accel = Box::new(Counting { bvh, rays: Arc::clone(&rays) });
    let settings = RenderSettings { spp: 4, ..RenderSettings::default() };
    let film = render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film;

    // Rays with and without Cryptomattes
    let camera_rays = 16 * 12 * 4;
    assert_eq!(rays.load(Ordering::Relaxed), camera_rays);
    assert!(cryptomattes(&job, &settings, &film, &[]).unwrap().is_empty());
    assert_eq!(rays.load(Ordering::Relaxed), camera_rays);
    assert_eq!(cryptomattes(&job, &settings, &film, &[Cryptomatte::Object]).unwrap().len(), 1);
    assert_eq!(rays.load(Ordering::Relaxed), 2 * camera_rays);
}

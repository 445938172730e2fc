//! Embree and the BVH on the same rays, and the check itself on a faulty tracer.

use super::{Family, crosscheck};
use lumiris::accel::bvh::Bvh;
use lumiris::accel::{Accel, AccelStats, Coherence, Hit, RayBatch};
use lumiris::import::{LoadOptions, load};
use lumiris::scene::{AccelKind, RenderJob};
use std::path::Path;
use std::sync::Arc;

fn gallery() -> RenderJob {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/demo/gallery.pbrt");
    let loaded = load(&path, &LoadOptions::default()).map_err(|d| d.to_string()).unwrap();
    loaded.job(AccelKind::Embree, None).unwrap()
}

fn bvh(job: &RenderJob) -> Bvh {
    Bvh::new(Arc::clone(&job.world.scene.geometry), Some(Arc::clone(&job.world.scene.textures) as _))
}

#[test]
fn embree_and_the_bvh_agree_on_every_family_of_rays() {
    let job = gallery();
    let report = crosscheck(&job, &bvh(&job), 50_000);
    assert_eq!(report.tallies.len(), 5);
    for (family, tally) in &report.tallies {
        assert!(tally.rays > 10_000 && tally.hits > 100, "{family:?} {tally:?}");
        // At the borders of open surfaces rounding decides; elsewhere it rarely does
        assert!(*family == Family::Edge || tally.edge_flips * 1000 < tally.rays, "{family:?} {tally:?}");
    }
    assert_eq!(report.disagreements(), 0, "{report:#?}");
}

/// A tracer that reports a wrong result for one ray in a thousand.
struct Leaky(Bvh);

impl Accel for Leaky {
    fn intersect(&self, rays: &RayBatch, coherence: Coherence, hits: &mut Vec<Option<Hit>>) {
        self.0.intersect(rays, coherence, hits);
        hits.iter_mut().step_by(1000).for_each(|h| *h = None);
    }

    fn occluded(&self, rays: &RayBatch, coherence: Coherence, occluded: &mut Vec<bool>) {
        self.0.occluded(rays, coherence, occluded);
        occluded.iter_mut().step_by(1000).for_each(|o| *o = !*o);
    }

    fn stats(&self) -> AccelStats {
        self.0.stats()
    }
}

#[test]
fn a_tracer_that_loses_hits_is_caught() {
    let job = gallery();
    let report = crosscheck(&job, &Leaky(bvh(&job)), 20_000);
    for (family, tally) in &report.tallies {
        assert!(tally.disagreements > 0, "{family:?} {tally:?}");
    }
    assert!(!report.examples.is_empty());
}

//! What `--estimator auto` chooses, and what it leaves as it is.

use lumiris::import::{LoadOptions, load};
use lumiris::lights::LightSamplerKind;
use lumiris::render::plan::{Preparation, prepare};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::{Allocation, EstimatorKind, IntegratorKind, IntegratorSettings, RouletteKind, Settings};
use lumiris_numbers::samplers::SamplerKind;
use std::path::Path;
use std::time::Duration;

/// The gallery, large enough for a pilot, with settings changed.
fn gallery(kind: IntegratorKind, resolution: [u32; 2], change: impl FnOnce(&mut Settings)) -> RenderJob {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/demo/gallery.pbrt");
    let options = LoadOptions { resolution: Some(resolution), ..LoadOptions::default() };
    let mut loaded = load(&path, &options).map_err(|d| d.to_string()).unwrap();
    loaded.settings.integrator = IntegratorSettings::default().of_kind(kind);
    loaded.settings.sampling.spp = 32;
    change(&mut loaded.settings);
    loaded.job(AccelKind::Embree, None).unwrap()
}

/// In paths, what an image took before is a part of the time of its samples; and where samples take long, more pixels tell what
/// is chosen.
#[test]
fn what_an_image_takes_before_counts() {
    // Far more than any time that a machine takes for a sample
    let of = |kind: IntegratorKind| {
        let how = Preparation { loading: Duration::from_secs(10_000), ..Preparation::on(None) };
        prepare(&mut gallery(kind, [256, 144], |_| ()), &how).unwrap().auto.unwrap()
    };
    let of_sample = 10_000e9 / f64::from(256 * 144 * 32);
    let path = of(IntegratorKind::Path);
    assert!(path.cost[0] > of_sample && path.trials.iter().flatten().all(|t| t.nanoseconds > of_sample), "{path:?}");
    assert!(path.checked.len() >= 2 && path.checked[0].name == path.trials[1][0].name, "{path:?}");
    let direct = of(IntegratorKind::Direct);
    assert!(direct.cost[0] < of_sample && direct.checked.is_empty(), "{direct:?}");
}

/// Whatever the user gives, the pilot chooses the rest.
#[test]
fn what_is_given_stays() {
    let both = [IntegratorKind::Direct, IntegratorKind::Path];
    // Each of these beside others, since a pilot takes a second
    let all: [fn(&mut Settings); 7] = [
        |s| (s.integrator.path_reuse, s.integrator.samples) = (Some(1), Some(1)),
        |s| (s.integrator.path_reuse, s.integrator.light_sampler) = (Some(3), LightSamplerKind::Uniform),
        |s| {
            (s.integrator.light_paths, s.integrator.samples) = (Some(0.0), Some(5));
            s.integrator.contributing.noncontributing_samples = Some(3);
        },
        |s| (s.integrator.light_paths, s.integrator.later_samples) = (Some(0.5), Some(3)),
        |s| {
            (s.integrator.samples, s.integrator.later_samples) = (Some(6), Some(2));
            (s.integrator.bsdf_fraction, s.sampling.sampler) = (Some(0.3), SamplerKind::Independent);
        },
        |s| {
            (s.integrator.samples, s.integrator.bsdf_fraction) = (Some(8), Some(0.0));
            (s.integrator.roulette_depth, s.sampling.allocation) = (None, Allocation::Uniform);
        },
        |s| (s.integrator.roulette, s.integrator.light_sampler) = (RouletteKind::Efficiency, LightSamplerKind::Photons),
    ];
    for (kind, (i, change)) in both.into_iter().flat_map(|kind| all.into_iter().enumerate().map(move |c| (kind, c))) {
        let mut job = gallery(kind, [224, 126], change);
        let given = *job.settings();
        assert!(prepare(&mut job, &Preparation::on(None)).unwrap().auto.is_some());
        let mut chosen = *job.settings();
        assert_ne!(chosen.integrator.estimator, EstimatorKind::Auto);
        // The same change once more makes no difference
        change(&mut chosen);
        assert_eq!(chosen, *job.settings(), "{kind:?}, change {i} of {given:?}");
    }
}

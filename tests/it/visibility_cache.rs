//! Direct light with the visibility cache [Keller and Wald 2000, §3]: its contents affect only the noise, unless lights
//! are left out on request.
//!
//! [`super::analytic_scenes`] tests that every estimator gives the known answer with the cache absent, empty, right and
//! wrong.

use super::analytic_scenes::answer;
use lumiris::accel::{Coherence, RayBatch};
use lumiris::film::PixelSums;
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load, load_text};
use lumiris::lights::{LightId, LightSamplerKind, PathCount, PrimaryPhoton, SurfacePoint, VisibilityCache};
use lumiris::render::output::metadata;
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::{EstimatorKind, IntegratorSettings, Proposals, Target};
use lumiris_numbers::estimators::stats::{Welford, t_test, two_sample_z_test};
use lumiris_numbers::math::hash::pcg4d;
use lumiris_numbers::math::ray::offset_origin;
use lumiris_numbers::math::{Ray, Vec3};
use lumiris_test_support::random::{RngExt, pcg32};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Contents of a visibility cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CacheContents {
    /// No cache.
    Absent,
    /// A cache without photons.
    Empty,
    /// The lights that photons prove to be visible.
    Right,
    /// The same photons with other lights, chosen at random; some of them do not exist.
    Wrong,
}

/// Photons per light.
const PHOTONS: u32 = 1000;

/// Photons of every light at their first intersections.
fn primary_photons(job: &RenderJob) -> Vec<PrimaryPhoton> {
    // Emit photons
    let lights = &job.lights;
    let (mut rays, mut ids) = (RayBatch::default(), Vec::new());
    for (id, light) in (0..).zip(&lights.lights) {
        let mut stream = pcg32([id, 99, 3]);
        for _ in 0..PHOTONS {
            if let Some(s) =
                light.sample_le(lights.scene_sphere(), stream.random::<[f32; 2]>(), stream.random::<[f32; 2]>())
            {
                let o = if s.n == Vec3::ZERO { s.p } else { offset_origin(s.p, s.p_error, s.n, s.d) };
                rays.push(&Ray { o, d: s.d, t_max: f32::INFINITY, time: 0.0 });
                ids.push(id);
            }
        }
    }

    // Trace them
    let mut hits = Vec::new();
    job.world.accel.intersect(&rays, Coherence::Incoherent, &mut hits);

    // Photons at the hits
    let photon = |(i, hit): (usize, &Option<lumiris::accel::Hit>)| {
        let hit = hit.as_ref()?;
        let surface = job.world.scene.geometry.surface_hit(hit.geometry, hit.primitive, hit.instance, hit.uv, 0.0);
        let n = if surface.n.dot(rays.get(i).d) > 0.0 { -surface.n } else { surface.n };
        Some(PrimaryPhoton { at: SurfacePoint { p: surface.p, n }, light: ids[i] })
    };
    hits.iter().enumerate().filter_map(photon).collect()
}

/// A visibility cache for lookups at its photons.
fn adapted(photons: &[PrimaryPhoton], scene_radius: f32) -> VisibilityCache {
    let points: Vec<SurfacePoint> = photons.iter().map(|photon| photon.at).collect();
    VisibilityCache::adapted(&points, photons, scene_radius)
}

/// A visibility cache with the given contents for a job.
pub(crate) fn cache_with(job: &RenderJob, kind: CacheContents) -> Option<VisibilityCache> {
    let radius = job.lights.scene_radius;
    match kind {
        CacheContents::Absent => None,
        CacheContents::Empty => Some(VisibilityCache::new(&[], 1.0)),
        CacheContents::Right => Some(adapted(&primary_photons(job), radius)),
        CacheContents::Wrong => {
            let mut photons = primary_photons(job);
            let choices = job.lights.lights.len() as u32 + 2;
            for (i, photon) in photons.iter_mut().enumerate() {
                photon.light = pcg4d([i as u32, 1, 2, 3])[0] % choices / 2;
            }
            Some(adapted(&photons, radius))
        }
    }
}

/// Whether the light is visible from the origin.
fn is_seen(job: &RenderJob, light: LightId) -> bool {
    let ctx = lumiris::lights::LightCtx::at(Vec3::ZERO);
    job.lights.lights[light as usize].sample_li(&ctx, [0.5; 2]).is_some_and(|s| s.p.x < 0.5)
}

fn job(settings: impl Fn(&mut IntegratorSettings), seen: impl Fn(&RenderJob, LightId) -> bool) -> RenderJob {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/analytic/hidden-lights.pbrt");
    let mut loaded = load(&path, &LoadOptions::default()).map_err(|d| d.to_string()).unwrap();
    settings(&mut loaded.settings.integrator);
    let mut job = loaded.job(AccelKind::Embree, None).unwrap();
    let ids = (0..job.lights.lights.len() as LightId).filter(|&id| seen(&job, id));
    // With so few expected paths, the photons exceed them: lights with photons are classified as visible
    let paths = (0..job.lights.lights.len() as LightId).map(|light| PathCount { light, paths: 1000.0 });
    let at = SurfacePoint { p: Vec3::ZERO, n: Vec3::Z };
    let photons: Vec<_> = ids.flat_map(|light| vec![PrimaryPhoton { at, light }; 20]).collect();
    let visibility_cache = VisibilityCache::new(&photons, 0.1);
    let visibility_cache = visibility_cache.with_paths(paths);
    job.lights.set_visibility_cache(Some(visibility_cache));
    job
}

/// Red of all camera samples of some renderings.
fn pixels(job: &mut RenderJob, seeds: u32) -> Welford {
    let mut values = Welford::default();
    for seed in 0..seeds {
        job.change(|s| s.sampling.seed = seed);
        let settings = RenderSettings { threads: Some(1), spp: 1, ..RenderSettings::default() };
        let film = render(job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film;
        film.pixels().iter().for_each(|p: &PixelSums| values.add(p.mean()[0]));
    }
    values
}

fn red() -> f64 {
    answer(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/analytic/hidden-lights.pbrt"))[0]
}

fn contributing(samples: u32, noncontributing: u32) -> impl Fn(&mut IntegratorSettings) {
    move |s| {
        s.estimator = EstimatorKind::Contributing;
        s.samples = Some(samples);
        s.contributing.noncontributing_samples = Some(noncontributing);
    }
}

#[test]
fn leaving_lights_out_is_biased_where_a_light_that_is_seen_has_no_photon() {
    let is_some = |job: &RenderJob, id: LightId| is_seen(job, id) && id != 0 && id != 18;
    for samples in [1, 4, 16] {
        let right = pixels(&mut job(contributing(samples, 0), is_seen), 60);
        assert!(t_test(&right, red()).p_value > 1e-4, "{samples} {right:?}");
        let biased = pixels(&mut job(contributing(samples, 0), is_some), 60);
        assert!(t_test(&biased, red()).p_value < 1e-6 && biased.mean() < red(), "{samples} {biased:?}");
        let whole = pixels(&mut job(contributing(samples, 1), is_some), 60);
        assert!(t_test(&whole, red()).p_value > 1e-4, "{samples} {whole:?}");
    }
}

#[test]
fn a_image_says_that_lights_were_left_out() {
    for (noncontributing, is_biased) in [(0, true), (1, false)] {
        let job = job(contributing(4, noncontributing), is_seen);
        let entries = metadata(&job.world.scene.film, job.settings());
        assert!(entries.contains(&("lumiris:noncontributing_samples".to_owned(), noncontributing.to_string())));
        assert_eq!(entries.iter().any(|(key, _)| key == "lumiris:biased"), is_biased);
    }
}

#[test]
fn a_right_visibility_cache_lowers_the_variance() {
    // The variance ratio without and with a cache is above `min`
    let ratio = |settings: &dyn Fn(&mut IntegratorSettings), min: f64| {
        let without = pixels(&mut job(settings, |_, _| false), 100).variance();
        let with = pixels(&mut job(settings, is_seen), 100).variance();
        assert!(without > min * with, "{without} without a cache, {with} with one");
    };

    // Light selection, resampling, and contributing lights
    ratio(
        &|s| {
            s.light_sampler = LightSamplerKind::VisibilityCache;
            s.samples = Some(4);
        },
        1.5,
    );
    ratio(
        &|s| {
            s.estimator = EstimatorKind::Ris;
            s.ris.target = Target::Visibility;
            s.ris.proposals = Proposals::Fixed(64);
            s.samples = Some(2);
        },
        3.0,
    );
    ratio(&contributing(12, 1), 3.0);
}

#[test]
fn brighter_lights_first_leave_little_noise_and_no_bias() {
    // All 25 lights are taken for visible. The order does not account for the 16 hidden ones
    let estimate = |samples| pixels(&mut job(contributing(samples, 0), |_, _| true), 100);
    let estimates = [1, 8, 20, 60].map(estimate);
    for e in &estimates {
        assert!(t_test(e, red()).p_value > 1e-4, "{e:?}");
    }
    let [one, eight, twenty, sixty] = estimates.map(|e| e.variance());
    assert!(one > 2.0 * eight && eight > 2.0 * twenty && twenty > sixty, "{one} {eight} {twenty} {sixty}");

    // If all are visible, one light chosen in proportion to its brightness is as good as all lights
    let [one, all] = [1, 9].map(|samples| pixels(&mut job(contributing(samples, 0), is_seen), 100).variance());
    assert!(one < 2.0 * all, "{one} {all}");
}

/// A floor that reflects lamps, some of them behind a wall, a sky, and another sky with the same directions.
const GLOSSY: &str = r#"
LookAt -1 0 1  0 0 0  0 0 1
Camera "orthographic" "float screenwindow" [ -0.3 0.3 -0.3 0.3 ]
Film "rgb" "integer xresolution" 12 "integer yresolution" 12
Sampler "independent"
Integrator "path" "integer maxdepth" 1
WorldBegin
LightSource "infinite" "rgb L" [ 0.06 0.06 0.06 ]
LightSource "infinite" "rgb L" [ 0.02 0.02 0.02 ]
LightSource "point" "rgb I" [ 1 1 1 ] "point3 from" [ 0.5 1 1.5 ]
Material "conductor" "float roughness" 0.1 "bool remaproughness" false
Shape "bilinearmesh" "point3 P" [ -9 -9 0  9 -9 0  -9 9 0  9 9 0 ]
Material "coateddiffuse" "float roughness" 0.2 "bool remaproughness" false
Shape "sphere" "float radius" 0.15
Material "diffuse"
Shape "bilinearmesh" "point3 P" [ 0.5 0.3 0  0.5 4 0  0.5 0.3 3  0.5 4 3 ]
"#;

/// The glossy floor below `lamps` × `lamps` lamps.
fn glossy_job(lamps: u32, settings: impl Fn(&mut IntegratorSettings)) -> RenderJob {
    let mut text = GLOSSY.to_owned();
    for i in 0..lamps * lamps {
        let [x, y] = [i % lamps, i / lamps].map(|k| f64::from(k) / f64::from(lamps) * 2.0);
        let [x, y] = [x + 0.2, y - 1.0];
        let size = 1.0 / f64::from(lamps);
        text += &format!(
            "AttributeBegin AreaLightSource \"diffuse\" \"rgb L\" [ {l} 1 2 ] \"bool twosided\" true \
             Shape \"bilinearmesh\" \"point3 P\" [ {x} {y} 1.3 {x1} {y} 1.3 {x} {y1} 1.4 {x1} {y1} 1.4 ] AttributeEnd\n",
            l = 1 + i % 3,
            x1 = x + size,
            y1 = y + size,
        );
    }
    let loaded = load_text(&text, "glossy.pbrt", Path::new("."), &LoadOptions::default(), &FileCache::default());
    let mut loaded = loaded.map_err(|d| d.to_string()).unwrap();
    settings(&mut loaded.settings.integrator);
    loaded.job(AccelKind::Embree, None).unwrap()
}

/// With BSDF samples on glossy surfaces.
fn with_bsdf(samples: u32, noncontributing: u32, bsdf: u32) -> impl Fn(&mut IntegratorSettings) {
    move |s| {
        contributing(samples, noncontributing)(s);
        s.contributing.bsdf_samples = Some(bsdf);
    }
}

#[test]
fn bsdf_samples_beside_contributing_lights_leave_no_bias() {
    // Up to 64 lights are weighted, more are chosen by their photons; only one of `part` lights has photons
    for (lamps, part) in [(0, 1), (3, 3), (3, 1), (16, 2)] {
        let mis = |s: &mut IntegratorSettings| (s.estimator, s.samples) = (EstimatorKind::Mis, Some(8));
        let expected = pixels(&mut glossy_job(lamps, mis), 2000);
        for (samples, noncontributing, bsdf) in [(1, 1, 1), (2, 1, 1), (4, 2, 4)] {
            let mut job = glossy_job(lamps, with_bsdf(samples, noncontributing, bsdf));
            let cache = cache_with(&job, CacheContents::Right).map(|cache| cache.of_lights(|light| light % part == 0));
            job.lights.set_visibility_cache(cache);
            let found = pixels(&mut job, 1000);
            let p = two_sample_z_test(&found, &expected).p_value;
            let difference = found.mean() / expected.mean() - 1.0;
            assert!(p > 1e-4, "{lamps} {part}, {samples} {noncontributing} {bsdf}: {difference} p {p}");
        }
    }
}

#[test]
fn bsdf_samples_take_the_bright_spots_from_glossy_surfaces() {
    let variance = |bsdf: u32| {
        let mut job = glossy_job(3, with_bsdf(4, 2, bsdf));
        let cache = cache_with(&job, CacheContents::Right);
        job.lights.set_visibility_cache(cache);
        pixels(&mut job, 100).variance()
    };
    let [without, with] = [0, 1].map(variance);
    assert!(without > 1.5 * with, "{without} without, {with} with BSDF samples");
}

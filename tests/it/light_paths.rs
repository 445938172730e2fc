//! Light paths for caustics: light of every pixel, noise, and bit-identical images.

use crate::path_reuse::{film, image_of_seed, mean_of, pixel_means};
use crate::same_light::assert_same_light;
use lumiris::imaging::oiio::{Part, write_image};
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load_text};
use lumiris::integrators::exclusions::{Feature, allows};
use lumiris::integrators::light_paths::per_sample;
use lumiris::render::RenderSettings;
use lumiris::scene::{AccelKind, PixelSamples, RenderJob};
use lumiris::settings::{EstimatorKind, IntegratorKind};
use std::path::Path;

/// A ball of glass, a ball of slightly rough metal, and a sheet of glass, on a floor in front of a wall. Lamps, one of
/// which is a two-sided rectangle, and a dim sky. The lamps are large enough for camera paths to find them.
const BALLS: &str = r#"
LookAt 0 2 -5  0 0.6 0  0 1 0
Camera "perspective" "float fov" 40 LENS
Film "rgb" "integer xresolution" 16 "integer yresolution" 12
PixelFilter FILTER
Integrator "path" "integer maxdepth" 5
WorldBegin
LightSource "infinite" "rgb L" [ 0.05 0.06 0.08 ]
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [ 5 4 3 ]
  Translate 1.4 2.2 -0.4
  Shape "sphere" "float radius" SIZE
AttributeEnd
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [ 2 3 4 ] "bool twosided" true
  Shape "bilinearmesh" "point3 P" [ -2.2 1.2 -0.5  -2.2 1.2 0.7  -1.8 2.2 -0.5  -1.8 2.2 0.7 ]
AttributeEnd
Material FLOOR
Shape "bilinearmesh" "point3 P" [ -4 0 -4  4 0 -4  -4 0 4  4 0 4 ]
Material "diffuse" "rgb reflectance" [ 0.6 0.5 0.4 ]
Shape "bilinearmesh" "point3 P" [ -4 0 1.6  4 0 1.6  -4 4 1.6  4 4 1.6 ]
AttributeBegin
  Material "dielectric" "float eta" 1.5
  Translate 0.8 0.6 0
  Shape "sphere" "float radius" 0.6
AttributeEnd
AttributeBegin
  Material "conductor" "float roughness" 0.04
  Translate -0.8 0.5 0
  Shape "sphere" "float radius" 0.5
AttributeEnd
Material "thindielectric" "float eta" 1.5
Shape "bilinearmesh" "point3 P" [ -0.2 0 -1.2  0.3 0 -0.9  -0.2 0.8 -1.2  0.3 0.8 -0.9 ]
"#;

const DIFFUSE: &str = r#""diffuse" "rgb reflectance" [ 0.5 0.5 0.6 ]"#;
const COATED: &str = r#""coateddiffuse" "rgb reflectance" [ 0.5 0.5 0.6 ] "float roughness" 0.05"#;
const SMOOTH: &str = r#""coateddiffuse" "rgb reflectance" [ 0.5 0.5 0.6 ] "float roughness" 0"#;
const METAL: &str = r#""conductor" "float roughness" 0.4"#;
const GAUSSIAN: &str = r#""gaussian""#;

struct Scene {
    floor: &'static str,
    filter: &'static str,
    lens: &'static str,
    size: f32,
}

const SCENE: Scene = Scene { floor: DIFFUSE, filter: GAUSSIAN, lens: "", size: 0.5 };

impl Scene {
    fn job(&self, light_paths: f32, resolution: [u32; 2]) -> RenderJob {
        let text = BALLS
            .replace("FLOOR", self.floor)
            .replace("FILTER", self.filter)
            .replace("LENS", self.lens)
            .replace("SIZE", &self.size.to_string());
        let options = LoadOptions { resolution: Some(resolution), ..LoadOptions::default() };
        let mut loaded = load_text(&text, "balls", Path::new("."), &options, &FileCache::default()).unwrap();
        let integrator = &mut loaded.settings.integrator;
        (integrator.estimator, integrator.light_paths) = (EstimatorKind::Mis, Some(light_paths));
        loaded.job(AccelKind::Embree, None).unwrap()
    }
}

/// A wall lit only via metal, with `light_paths` light paths per camera sample.
pub(crate) fn caustics(light_paths: f32) -> RenderJob {
    let text = BOUNCED.replace("FLOOR", r#""conductor" "float roughness" 0.02"#).replace("WALL", r#""diffuse""#);
    let kept: Vec<&str> = text.lines().filter(|line| !line.starts_with("Texture")).collect();
    let loaded = load_text(&kept.join("\n"), "bounced", Path::new("."), &LoadOptions::default(), &FileCache::default());
    let mut job = loaded.unwrap().job(AccelKind::Embree, None).unwrap();
    job.change(|s| {
        (s.integrator.estimator, s.integrator.samples) = (EstimatorKind::Mis, Some(3));
        s.integrator.light_paths = Some(light_paths);
    });
    assert!(per_sample(&job) > 0.0);
    job
}

/// Samples beyond 2²⁰ have the light of light paths, too, which is most of the light here.
#[test]
fn samples_of_any_number_have_their_light_paths() {
    let mut job = caustics(4.0);
    let mut mean = |first_sample: u32| {
        let images = (0..24).map(|seed| {
            job.change(|s| s.sampling.seed = seed);
            let film = film(&job, RenderSettings { spp: 16, first_sample, ..RenderSettings::default() });
            film.pixels().iter().flat_map(|p| p.mean()).sum::<f64>()
        });
        mean_of(images.collect::<Vec<_>>().into_iter())
    };
    let ((first, v_first), (later, v_later)) = (mean(0), mean((1 << 20) - 5));
    let error = (v_first + v_later).sqrt();
    assert!((first - later).abs() < 4.0 * error && 8.0 * error < 0.2 * first, "{first} {later} ± {error}");
}

/// Sample counts from half of the mean to four times the mean, in no order.
fn different_numbers(job: &RenderJob, spp: u32) -> PixelSamples {
    let bounds = job.world.scene.film.bounds;
    let counts = (0..bounds.area() as u32).map(|i| (spp / 2) << (i * 7 / 3 % 4)).collect();
    PixelSamples { bounds, spp, counts, emission_rays: Vec::new() }
}

/// Light paths and camera paths divide the light between them: light via metal and glass must be neither lost nor
/// counted twice. Few and many light paths, rough and smooth coats, rough metal, a lens, a filter with negative lobes,
/// different sample counts, and shared paths.
#[test]
fn images_have_the_light_that_they_have_without_light_paths() {
    // Scenes
    let lanczos = r#""sinc" "float xradius" 2 "float yradius" 2"#;
    let lens = r#""float lensradius" 0.15 "float focaldistance" 4"#;
    for (name, scene, per_sample, edge, differ) in [
        ("few", SCENE, 0.5, 1, false),
        ("a rough coat, many", Scene { floor: COATED, ..SCENE }, 8.0, 1, false),
        ("a smooth coat, a lens", Scene { floor: SMOOTH, lens, ..SCENE }, 2.0, 1, true),
        ("metal, a filter with negative lobes", Scene { floor: METAL, filter: lanczos, ..SCENE }, 2.0, 1, false),
        ("shared paths", SCENE, 4.0, 3, true),
    ] {
        // With and without light paths
        let image = |light_paths: f32| {
            let mut job = scene.job(light_paths, [16, 12]);
            job.change(|s| (s.integrator.samples, s.integrator.path_reuse) = (Some(3), Some(edge)));
            assert!(allows(&job, Feature::LightPaths));
            let numbers = differ.then(|| different_numbers(&job, 64));
            image_of_seed(job, numbers, 64)
        };
        assert_same_light(&format!("light paths: {name}"), image(0.0), image(per_sample));
    }
}

/// A wall lit only by a lamp via the metal below both. The camera sees only the wall.
const BOUNCED: &str = r#"
LookAt 0 2 -4  0 2 0  0 1 0
Camera "perspective" "float fov" 30
Film "rgb" "integer xresolution" 16 "integer yresolution" 12
Integrator "path" "integer maxdepth" 3
WorldBegin
Texture "worn" "float" "imagemap" "string filename" "worn.exr" "float uscale" 50 "float vscale" 50
Texture "waves" "float" "fbm" "float roughness" 0.8
Texture "bumps" "float" "scale" "texture tex" "waves" "float scale" 0.05
MakeNamedMaterial "paint" "string type" "diffuse" "rgb reflectance" [ 0.7 0.2 0.2 ]
MakeNamedMaterial "metal" "string type" "conductor" "float roughness" 0.04
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [ 5 4 3 ]
  Shape "bilinearmesh" "point3 P" [ -1 0.6 -1  1 0.6 -1  -1 0.6 0.5  1 0.6 0.5 ]
AttributeEnd
Material FLOOR
Shape "bilinearmesh" "point3 P" [ -4 0 -4  4 0 -4  -4 0 4  4 0 4 ]
Material WALL
Shape "bilinearmesh" "point3 P" [ -4 0.8 1.6  4 0.8 1.6  -4 4 1.6  4 4 1.6 ]
"#;

/// Materials that vary from point to point: textures filtered over whole pixels, bumps, and mixtures that are drawn
/// anew for each direction. Light paths and camera paths must agree on which materials make caustics, and on the
/// directions and weights of their scattering, so that all light is counted once. The mean of the image must be the
/// same within 4 standard errors (10⁻⁴), at most 6 %.
#[test]
fn materials_that_vary_send_all_light_on_once() {
    // Materials
    const METAL: &str = r#""conductor" "float roughness" 0.02"#;
    const PAINT: &str = r#""diffuse" "rgb reflectance" [ 0.6 0.5 0.4 ]"#;
    const CHIPPED: &str = r#""mix" "string materials" [ "paint" "metal" ] "float amount" 0.6"#;
    const WORN: &str = r#""conductor" "texture roughness" "worn""#;
    const BUMPED: &str = r#""conductor" "float roughness" 0.02 "texture displacement" "bumps""#;
    const COPPER: &str =
        r#""principled" "float base_metalness" 0.9 "float specular_roughness" 0.2 "float coat_weight" 0.2"#;
    let folder = tempfile::tempdir().unwrap();
    let worn = (0..64 * 64).map(|i| if (i / 64 + i) % 2 == 0 { 0.001 } else { 0.2 }).collect();
    let worn = Part::display(64, 64, vec!["Y".to_owned()], worn);
    write_image(&folder.path().join("worn.exr"), &[worn]).unwrap();

    // With and without light paths
    for (floor, wall) in [(BUMPED, PAINT), (METAL, CHIPPED), (WORN, PAINT), (CHIPPED, CHIPPED), (COPPER, PAINT)] {
        let text = BOUNCED.replace("FLOOR", floor).replace("WALL", wall);
        let [without, with] = [(0.0, 0..48), (4.0, 1000..1048)].map(|(light_paths, seeds)| {
            let options = LoadOptions::default();
            let mut loaded = load_text(&text, "bounced", folder.path(), &options, &FileCache::default()).unwrap();
            let integrator = &mut loaded.settings.integrator;
            (integrator.estimator, integrator.light_paths) = (EstimatorKind::Mis, Some(light_paths));
            loaded.settings.sampling.footprint_spp = Some(1);
            let mut job = loaded.job(AccelKind::Embree, None).unwrap();
            assert!(allows(&job, Feature::LightPaths));
            let images = pixel_means(&mut job, seeds, 64);
            mean_of(images.iter().map(|image| image.iter().sum::<f64>()))
        });

        // Means
        let ((a, v_a), (b, v_b)) = (without, with);
        let error = (v_a + v_b).sqrt();
        let what = format!("{floor}, {wall}: {b} with and {a} without, ± {error}");
        assert!(a > 0.0 && (a - b).abs() < 4.0 * error && 4.0 * error < 0.06 * a, "{what}");
    }
}

/// With a small lamp, the relative variance of the whole image, including its caustics, falls below 1/1.3.
#[test]
fn light_paths_leave_little_of_the_noise_of_a_small_lamp() {
    let pairs = |light_paths| {
        let mut job = Scene { size: 0.05, ..SCENE }.job(light_paths, [32, 24]);
        job.change(|s| s.integrator.samples = Some(3));
        let images = pixel_means(&mut job, 0..16, 16);
        let relative = |(a, b): (&f64, &f64)| (a - b).powi(2) / (0.25 * (a + b).powi(2) + 0.01);
        let error = |pair: &[Vec<f64>]| pair[0].iter().zip(&pair[1]).map(relative).sum::<f64>();
        images.chunks(2).map(error).collect::<Vec<_>>()
    };
    let gains: Vec<f64> = pairs(0.0).into_iter().zip(pairs(1.0)).map(|(without, with)| (without / with).ln()).collect();
    let (gain, variance) = mean_of(gains.iter().copied());
    let what = format!("variance by {} ± {:.0} %", gain.exp(), 100.0 * variance.sqrt());
    assert!(gain - 4.0 * variance.sqrt() > 1.3_f64.ln(), "{what}");
}

#[test]
fn threads_tiles_and_passes_do_not_change_a_bit() {
    let image = |differ: bool, settings: RenderSettings| {
        let mut job = Scene { floor: COATED, ..SCENE }.job(0.7, [40, 27]);
        job.pixel_samples = differ.then(|| different_numbers(&job, 20));
        let film = film(&job, RenderSettings { spp: 20, ..settings });
        film.pixels().iter().flat_map(|p| p.mean().map(f64::to_bits)).collect::<Vec<_>>()
    };
    for differ in [false, true] {
        let settings = RenderSettings { threads: Some(1), ..RenderSettings::default() };
        let reference = image(differ, settings);
        for (threads, tile_size) in [(2, 16), (3, 1), (1, 200)] {
            let other = image(differ, RenderSettings { threads: Some(threads), tile_size, ..settings });
            assert!(reference == other, "{threads} threads, tiles of {tile_size}");
        }
    }
}

#[test]
fn images_that_light_paths_cannot_help_are_those_without() {
    let mut job = SCENE.job(1.0, [8, 6]);
    assert!(per_sample(&job) == 1.0);
    for change in [
        |job: &mut RenderJob| job.change(|s| s.integrator.kind = IntegratorKind::Direct),
        |job: &mut RenderJob| job.change(|s| s.integrator.estimator = EstimatorKind::Ris),
        |job: &mut RenderJob| job.change(|s| s.integrator.max_depth = 2),
    ] {
        let before = *job.settings();
        change(&mut job);
        assert!(!allows(&job, Feature::LightPaths) && per_sample(&job) == 0.0);
        let with = film(&job, RenderSettings { spp: 2, ..RenderSettings::default() });
        job.change(|s| s.integrator.light_paths = Some(0.0));
        let without = film(&job, RenderSettings { spp: 2, ..RenderSettings::default() });
        assert!(with.pixels().iter().zip(&without.pixels()).all(|(a, b)| a.mean() == b.mean()));
        job.change(|s| *s = before);
    }
}

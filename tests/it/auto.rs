//! `--estimator auto`: the rule's choices, and unchanged settings.

use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load, load_text};
use lumiris::lights::LightSamplerKind;
use lumiris::planning::facts::Facts;
use lumiris::planning::{Preparation, prepare};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::{Allocation, EstimatorKind, IntegratorKind, IntegratorSettings, Settings};
use lumiris_numbers::samplers::SamplerKind;
use std::path::Path;

fn gallery(kind: IntegratorKind, resolution: [u32; 2], change: impl FnOnce(&mut Settings)) -> RenderJob {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/demo/gallery.pbrt");
    let options = LoadOptions { resolution: Some(resolution), ..LoadOptions::default() };
    let mut loaded = load(&path, &options).map_err(|d| d.to_string()).unwrap();
    loaded.settings.integrator = IntegratorSettings::default().of_kind(kind);
    loaded.settings.sampling.spp = 32;
    change(&mut loaded.settings);
    loaded.job(AccelKind::Embree, None).unwrap()
}

/// The rule keeps all given settings and chooses the others.
#[test]
fn what_is_given_stays() {
    let both = [IntegratorKind::Direct, IntegratorKind::Path];
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
        |s| (s.integrator.light_sampler, s.integrator.infinite_fraction) = (LightSamplerKind::Tree, Some(0.3)),
    ];
    for (kind, (i, change)) in both.into_iter().flat_map(|kind| all.into_iter().enumerate().map(move |c| (kind, c))) {
        let mut job = gallery(kind, [64, 36], change);
        let given = *job.settings();
        prepare(&mut job, &Preparation::on(None)).unwrap();
        let mut chosen = *job.settings();
        assert_ne!(chosen.integrator.estimator, EstimatorKind::Auto);
        // Applying the same change again makes no difference
        change(&mut chosen);
        assert_eq!(chosen, *job.settings(), "{kind:?}, change {i} of {given:?}");
    }
}

/// A grey box around the camera with the light `inside`; without front and ceiling if it is `open`.
fn room(is_open: bool, material: &str, inside: &str, depth: u32) -> RenderJob {
    // Scene, with walls if it is closed
    let wall = |p: &str| format!("Shape \"bilinearmesh\" \"point3 P\" [ {p} ]\n");
    let mut text = format!(
        "LookAt 0 0 0.9  0 0 0  0 1 0\nCamera \"perspective\" \"float fov\" 90\n\
         Film \"rgb\" \"integer xresolution\" 32 \"integer yresolution\" 32\n\
         Integrator \"path\" \"integer maxdepth\" {depth}\nSampler \"sobol\" \"integer pixelsamples\" 16\n\
         WorldBegin\n{inside}\nMaterial {material}\n"
    );
    text += &wall("-1 -1 -1  1 -1 -1  -1 1 -1  1 1 -1");
    text += &wall("-1 -1 -1  1 -1 -1  -1 -1 1  1 -1 1");
    if !is_open {
        text += &wall("-1 1 -1  1 1 -1  -1 1 1  1 1 1");
        text += &wall("-1 -1 -1  -1 1 -1  -1 -1 1  -1 1 1");
        text += &wall("1 -1 -1  1 1 -1  1 -1 1  1 1 1");
        text += &wall("-1 -1 1  1 -1 1  -1 1 1  1 1 1");
    }

    // Load
    let loaded = load_text(&text, "room", Path::new("."), &LoadOptions::default(), &FileCache::default());
    let mut job = loaded.map_err(|d| d.to_string()).unwrap().job(AccelKind::Embree, None).unwrap();
    job.change(|s| s.integrator.estimator = EstimatorKind::Auto);
    job
}

const GREY: &str = "\"diffuse\" \"rgb reflectance\" [ 0.5 0.5 0.5 ]";
const LAMP: &str = "LightSource \"point\" \"rgb I\" [ 1 1 1 ]";
const SKY: &str = "LightSource \"infinite\" \"rgb L\" [ 1 1 1 ]";

#[test]
fn facts_are_those_of_the_scene() {
    let closed = Facts::of(&room(false, GREY, LAMP, 5));
    assert_eq!((closed.lights, closed.sky, closed.open), (1, 0.0, 0.0));
    assert!(closed.diffuse_pairs > 0.999, "{closed:?}");
    let open = Facts::of(&room(true, GREY, SKY, 5));
    assert_eq!(open.sky, 1.0);
    // A floor and a wall at a right angle, each as wide as it is long: the form factor between them is 0.2
    assert!((open.open - 0.8).abs() < 0.03 && (open.diffuse_pairs - 0.2).abs() < 0.03, "{open:?}");
    let metal = Facts::of(&room(false, "\"conductor\" \"float roughness\" 0.3", LAMP, 5));
    assert_eq!((metal.diffuse_pairs, metal.open), (0.0, 0.0));
    // An unoccluded sky has the irradiance π, and a lamp behind the floor is hidden
    let hidden = format!("{SKY}\nLightSource \"point\" \"rgb I\" [ 9 9 9 ] \"point3 from\" [ 0 -3 0 ]");
    let both = Facts::of(&room(true, GREY, &hidden, 5));
    assert!(both.lights == 2 && both.sky > 0.999, "{both:?}");
}

#[test]
fn the_rule_goes_by_facts() {
    // Summaries of the choices
    let chosen = |mut job: RenderJob| {
        prepare(&mut job, &Preparation::on(Some(1))).unwrap();
        job.settings().summary()
    };
    let direct = |mut job: RenderJob| {
        job.change(|s| s.integrator = s.integrator.of_kind(IntegratorKind::Direct));
        job
    };

    // Rooms that differ in light, materials and depth
    assert_eq!(chosen(direct(room(false, GREY, LAMP, 1))), "direct light: 8 samples (MIS); adaptive sampling");
    assert_eq!(
        chosen(room(false, GREY, LAMP, 5)),
        "direct light: 4 samples (MIS), 3 at later vertices; paths shared by 6 × 6 pixels; adaptive sampling"
    );
    assert_eq!(
        chosen(room(false, GREY, LAMP, 50)),
        "direct light: 3 samples (MIS), 2 at later vertices; paths shared by 4 × 4 pixels; adaptive sampling"
    );
    assert_eq!(
        chosen(room(true, GREY, SKY, 5)),
        "direct light: 6 samples (MIS), 3 at later vertices; paths shared by 4 × 4 pixels; adaptive sampling"
    );
    assert_eq!(
        chosen(room(false, "\"conductor\" \"float roughness\" 0.3", LAMP, 5)),
        "direct light: 8 samples (MIS), 2 at later vertices; adaptive sampling"
    );
}

#[test]
fn contributing_is_taken_where_most_of_many_lights_are_hidden() {
    let lamps = |y: f32| -> String {
        let lamp = |i: u32| format!("LightSource \"point\" \"rgb I\" [ 1 1 1 ] \"point3 from\" [ 0.{i} {y} 0 ]\n");
        (10..28).map(lamp).collect()
    };
    let estimator = |lights: &str| {
        let mut job = room(false, GREY, lights, 5);
        prepare(&mut job, &Preparation::on(Some(1))).unwrap();
        (job.settings().integrator.estimator, job.lights.visibility_cache().is_some())
    };
    assert_eq!(estimator(&lamps(0.5)), (EstimatorKind::Mis, false), "all are seen");
    // Six of the eight triangles of each lamp illuminate only the ceiling right above
    let (down, up) = ("0 1 2  0 2 3", "4 6 5  4 7 6");
    let meshes: String = (0..18)
        .map(|i| {
            let (x, z) = (0.3 * f64::from(i % 6) - 0.9, 0.3 * f64::from(i / 6) - 0.5);
            format!(
                "AttributeBegin AreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ] Translate {x} 0.97 {z}\n\
                 Shape \"trianglemesh\" \"point3 P\" [ 0 0 0  0.1 0 0  0.1 0 0.1  0 0 0.1  0 0.02 0  0.1 0.02 0  0.1 0.02 0.1  0 0.02 0.1 ]\n\
                 \"integer indices\" [ {down} {up} {up} {up} ] AttributeEnd\n"
            )
        })
        .collect();
    assert_eq!(estimator(&meshes), (EstimatorKind::Mis, false), "all lamps are seen, of their triangles few");
    assert_eq!(estimator(&(lamps(1.5) + LAMP)), (EstimatorKind::Contributing, true), "one is seen");
    // One mesh of 32 lamps above the ceiling
    let quad = |i: u32| {
        let (x, z) = (0.2 * f64::from(i % 8) - 0.8, 0.2 * f64::from(i / 8) - 0.4);
        format!("{x} 1.2 {z}  {} 1.2 {z}  {} 1.2 {}  {x} 1.2 {} ", x + 0.1, x + 0.1, z + 0.1, z + 0.1)
    };
    let corners: String = (0..32).map(quad).collect();
    let triangles: String =
        (0..32).map(|i| 4 * i).map(|i| format!("{i} {} {}  {i} {} {} ", i + 1, i + 2, i + 2, i + 3)).collect();
    let mesh = format!(
        "AttributeBegin AreaLightSource \"diffuse\" \"rgb L\" [ 99 99 99 ] Shape \"trianglemesh\" \"point3 P\" [ {corners} ] \
         \"integer indices\" [ {triangles} ] AttributeEnd\n"
    );
    assert_eq!(estimator(&(mesh + LAMP)), (EstimatorKind::Contributing, true), "one mesh of hidden lamps");
}

//! Layers of the image by light group: they add up to the image, and each has the light of its group.

use lumiris::film::{Film, PixelBounds};
use lumiris::imaging::Image;
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, load_text};
use lumiris::integrators::exclusions::{Feature, allows};
use lumiris::integrators::light_layers;
use lumiris::render::output::{Aov, channels, layers};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::{AccelKind, PixelSamples, RenderJob};
use lumiris::settings::{EstimatorKind, IntegratorKind, Target};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Edge of the images (pixels).
const EDGE: u32 = 12;

/// Lights of the scene by group: an area light that paths can hit, delta lights, and overlapping infinite lights, one
/// of them with a portal.
const LIGHTS: [(&str, &str); 4] = [
    (
        "key",
        r#"AttributeBegin AreaLightSource "diffuse" "rgb L" [9 7 5] "string lightgroup" "key" Translate 0 2.5 0
           Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point3 P" [-1 0 -1 1 0 -1 1 0 1 -1 0 1] AttributeEnd
           LightSource "spot" "rgb I" [4 1 1] "point3 from" [-2 2 -2] "point3 to" [0 0 0] "string lightgroup" "key""#,
    ),
    (
        "rim",
        r#"LightSource "point" "rgb I" [1 2 6] "point3 from" [2 1.5 1] "string lightgroup" "rim"
           LightSource "infinite" "rgb L" [4 3 2] "point3 portal" [-2 3.5 -1  2 3.5 -1  2 3.5 1  -2 3.5 1] "string lightgroup" "rim""#,
    ),
    (
        "sky",
        r#"LightSource "infinite" "rgb L" [0.2 0.4 0.8] "string lightgroup" "sky"
           LightSource "distant" "rgb L" [0.3 0.2 0.1] "point3 from" [1 3 -1] "string lightgroup" "sky""#,
    ),
    (
        "other",
        r#"LightSource "infinite" "rgb L" [0.3 0 0.1]
           AttributeBegin AreaLightSource "diffuse" "rgb L" [3 6 3] Translate -1.5 0.4 0.5
           Shape "sphere" "float radius" 0.3 AttributeEnd"#,
    ),
];

/// Surfaces of all kinds: plain, textured, a mirror, glass, and a coat.
const SURFACES: &str = r#"
LookAt 0 1.6 -5  0 0.6 0  0 1 0  Camera "perspective" "float fov" 45
Film "rgb" "integer xresolution" 12 "integer yresolution" 12 "string filename" "groups.exr"
WorldBegin
Texture "checks" "spectrum" "checkerboard" "rgb tex1" [0.8 0.3 0.2] "rgb tex2" [0.2 0.3 0.7] "float uscale" 6 "float vscale" 6
Material "diffuse" "texture reflectance" "checks"
Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point3 P" [-4 0 -4 4 0 -4 4 0 4 -4 0 4] "point2 uv" [0 0 1 0 1 1 0 1]
Material "diffuse" "rgb reflectance" [0.6 0.6 0.5]
Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point3 P" [-4 0 3 4 0 3 4 3 3 -4 3 3]
Material "conductor" "float roughness" 0
AttributeBegin Translate 1 0.6 0.5 Shape "sphere" "float radius" 0.6 AttributeEnd
Material "dielectric"
AttributeBegin Translate -0.6 0.5 -0.6 Shape "sphere" "float radius" 0.5 AttributeEnd
Material "coateddiffuse" "rgb reflectance" [0.2 0.5 0.2]
AttributeBegin Translate 0.3 0.3 -1 Shape "sphere" "float radius" 0.3 AttributeEnd
"#;

/// The scene with the light of all groups or of one group. All surfaces remain.
fn job(group: Option<&str>) -> RenderJob {
    let mut text = SURFACES.to_owned();
    for (name, lights) in LIGHTS {
        let is_lit = group.is_none_or(|group| group == name);
        let dark = |kind: &str| format!(r#""float scale" 0 {kind}"#);
        let lights = if is_lit { lights.to_owned() } else { lights.replace(r#""rgb"#, &dark(r#""rgb"#)) };
        text.push_str(&lights);
    }
    let loaded = load_text(&text, "groups", Path::new("."), &LoadOptions::default(), &FileCache::default());
    loaded.map_err(|d| d.to_string()).unwrap().job(AccelKind::Embree, None).unwrap()
}

fn film(job: &RenderJob, spp: u32) -> Film {
    render(job, &RenderSettings { spp, ..RenderSettings::default() }, &AtomicBool::new(false), &|_| ()).unwrap().film
}

/// Estimators with layers: vertices in columns and in stages, and BSDF samples that continue the path or do not.
const METHODS: [(IntegratorKind, EstimatorKind, u32); 7] = [
    (IntegratorKind::Direct, EstimatorKind::Mc, 2),
    (IntegratorKind::Direct, EstimatorKind::Mis, 4),
    (IntegratorKind::Path, EstimatorKind::Mis, 2),
    (IntegratorKind::Path, EstimatorKind::Mis, 1),
    (IntegratorKind::Path, EstimatorKind::Ris, 2),
    (IntegratorKind::Direct, EstimatorKind::Contributing, 4),
    (IntegratorKind::Path, EstimatorKind::Auto, 4),
];

fn choose(job: &mut RenderJob, (kind, estimator, samples): (IntegratorKind, EstimatorKind, u32)) {
    job.change(|s| {
        let i = &mut s.integrator;
        (i.kind, i.estimator, i.samples) = (kind, estimator, Some(samples));
    });
}

/// The same sample count in all pixels, with extra emission rays in some of them.
fn split(spp: u32) -> PixelSamples {
    let (bounds, pixels) = (PixelBounds { x0: 0, x1: EDGE, y0: 0, y1: EDGE }, (EDGE * EDGE) as usize);
    let emission_rays = (0..pixels).map(|i| [1, 6][i % 2]).collect();
    PixelSamples { bounds, spp, counts: vec![spp; pixels], emission_rays }
}

#[test]
fn layers_add_up_to_the_image_and_leave_its_bits() {
    // Layers of every method
    let mut job = job(None);
    job.pixel_samples = Some(split(4));
    for method in METHODS {
        choose(&mut job, method);
        assert_eq!(light_layers::count(&job), LIGHTS.len(), "{method:?}");
        let with = film(&job, 4);
        assert_eq!(with.light_layers(), LIGHTS.map(|(name, _)| name), "{method:?}");

        // Sums of the layers
        let mut sums = vec![[0.0; 3]; with.len()];
        for (_, layer) in &layers(&with, &[Aov::LightGroups], None)[1..] {
            let pixels = layer.data.as_chunks::<3>().0;
            sums.iter_mut().zip(pixels).for_each(|(sum, p)| (0..3).for_each(|c| sum[c] += f64::from(p[c])));
        }
        for (sum, pixel) in sums.iter().zip(with.pixels()) {
            for (sum, whole) in sum.iter().zip(pixel.mean()) {
                assert!((sum - whole).abs() <= 1e-5 * whole + 1e-7, "{method:?}: {sum} {whole}");
            }
        }

        // The image without layers
        job.change(|s| s.integrator.light_groups = false);
        let without = film(&job, 4);
        assert!(without.light_layers().is_empty());
        let bits = |f: &Film| channels(f, &Aov::ALL, None).data.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&with), bits(&without), "{method:?}");
        job.change(|s| s.integrator.light_groups = true);
    }
}

/// The mean of a layer equals the mean of the image with only its lights. 8 methods × 4 groups × 3 channels, two-sided
/// t-tests over 2 × 24 images: with at least 23 degrees of freedom, t = 5.5 has a level of 1.4·10⁻⁵, 1.3·10⁻³ for all
/// tests. A bias of 8.5 standard errors is detected with a probability above 0.99; it is at most 55 % of the mean of
/// the dimmest layer.
#[test]
fn a_layer_has_the_light_of_its_group_alone() {
    // Means of images
    let images = 24;
    let mean = |image: &Image| {
        let pixels = image.data.as_chunks::<3>().0;
        [0, 1, 2].map(|c| pixels.iter().map(|p| f64::from(p[c])).sum::<f64>() / f64::from(EDGE * EDGE))
    };
    let film = |job: &mut RenderJob, seed| {
        job.change(|s| s.sampling.seed = seed);
        film(job, 16)
    };
    let summary = |values: &[[f64; 3]], c: usize| {
        let n = values.len() as f64;
        let mean = values.iter().map(|v| v[c]).sum::<f64>() / n;
        (mean, values.iter().map(|v| (v[c] - mean).powi(2)).sum::<f64>() / (n - 1.0) / n)
    };

    // Layers against images with one group
    let mut all = job(None);
    all.pixel_samples = Some(split(16));
    let mut of_lights = LIGHTS.map(|(group, _)| job(Some(group)));
    for method in METHODS {
        choose(&mut all, method);
        let films: Vec<Film> = (0..images).map(|seed| film(&mut all, seed)).collect();
        for (alone, (group, _)) in of_lights.iter_mut().zip(LIGHTS) {
            choose(alone, method);
            let name = format!("light_{group}");
            let of_layers = films.iter().map(|film| layers(film, &[Aov::LightGroups], None));
            let layer = |layers: Vec<(String, Image)>| layers.into_iter().find(|(other, _)| *other == name).unwrap().1;
            let of_layer: Vec<_> = of_layers.map(|layers| mean(&layer(layers))).collect();
            let image = |seed| mean(&layers(&film(alone, seed), &[], None)[0].1);
            let of_image: Vec<_> = (images..2 * images).map(image).collect();
            for c in 0..3 {
                let ((a, va), (b, vb)) = (summary(&of_layer, c), summary(&of_image, c));
                let error = (va + vb).sqrt();
                let what = format!("{group}, {method:?}, channel {c}: {a} and {b} ± {error}");
                assert!((a - b).abs() < 5.5 * error + 1e-6 * b, "{what}");
                assert!(8.5 * error < 0.55 * b + 1e-9, "too much noise: {what}");
            }
        }
    }
}

#[test]
fn what_cannot_be_told_apart_has_no_layers() {
    let mut job = job(None);
    for kind in [IntegratorKind::PhotonMap, IntegratorKind::IrradianceCache] {
        job.change(|s| s.integrator.kind = kind);
        assert!(!allows(&job, Feature::LightGroups));
        assert_eq!(light_layers::count(&job), 0);
    }
    job.change(|s| s.integrator.kind = IntegratorKind::Path);
    for estimator in [EstimatorKind::Ocv, EstimatorKind::OptimalMis, EstimatorKind::Correlated] {
        job.change(|s| s.integrator.estimator = estimator);
        assert_eq!(light_layers::count(&job), 0, "{estimator:?}");
        assert!(film(&job, 2).light_layers().is_empty());
    }
    job.change(|s| (s.integrator.estimator, s.integrator.ris.target) = (EstimatorKind::Ris, Target::VisibilityControl));
    assert_eq!(light_layers::count(&job), 0);
}

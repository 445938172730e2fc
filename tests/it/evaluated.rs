//! Evaluation-only materials, from the scene file to the image.

use lumiris::bsdfs::ProposalDensity;
use lumiris::import::{LoadOptions, Loaded, load};
use lumiris::materials::{EvaluatedMaterial, Material};
use lumiris::render::{RenderSettings, render};
use lumiris::scene::AccelKind;
use lumiris_numbers::estimators::stats::{Welford, sidak, t_test, two_sample_z_test};
use std::path::Path;
use std::sync::atomic::AtomicBool;

const HEAD: &str = "LookAt 0 0 -1  0 0 0  0 1 0
Camera \"perspective\" \"float fov\" [ 60 ]
Film \"rgb\" \"integer xresolution\" [ 8 ] \"integer yresolution\" [ 8 ]
Sampler \"zsobol\" \"integer pixelsamples\" [ 64 ]
";

fn load_text(text: &str) -> Result<Loaded, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.pbrt");
    std::fs::write(&path, text).unwrap();
    load(&path, &LoadOptions::default()).map_err(|report| report.to_string())
}

/// The material of the only shape.
fn material(text: &str) -> Result<Material, String> {
    let text = format!("{HEAD}WorldBegin\nLightSource \"infinite\"\n{text}\nShape \"sphere\"");
    load_text(&text).map(|Loaded { scene, .. }| scene.materials.entries()[scene.surfaces[0].material as usize].material)
}

fn model(text: &str) -> Result<EvaluatedMaterial, String> {
    match material(text)? {
        Material::Evaluated(model) => Ok(model),
        other => Err(format!("{other:?}")),
    }
}

#[test]
fn every_model_has_a_name() {
    use EvaluatedMaterial as E;
    let named = |name: &str| model(&format!("Material \"evaluated\" \"string model\" \"{name}\"")).unwrap();
    assert!(matches!(named("diffuse"), E::Diffuse { .. }));
    assert!(matches!(named("orennayar"), E::OrenNayar { .. }));
    assert!(matches!(named("cooktorrance"), E::CookTorrance { .. }));
    assert!(matches!(named("ashikhminshirley"), E::AshikhminShirley { .. }));
    let axis = |name| match named(name) {
        E::CosineLobe { axis, .. } => axis,
        other => panic!("{other:?}"),
    };
    assert_ne!(axis("phong"), axis("retroreflective"));
}

#[test]
fn wrong_models_and_parameters_are_errors() {
    let error = |text: &str| material(text).unwrap_err();
    assert!(error("Material \"evaluated\"").contains("needs a `string model`"));
    assert!(error("Material \"evaluated\" \"string model\" \"phon\"").contains("did you mean `phong`?"));
    let unused = error("Material \"evaluated\" \"string model\" \"phong\" \"float sigma\" 3");
    assert!(unused.contains("sigma"), "{unused}");
}

#[test]
fn matte_is_oren_nayar_where_sigma_is_not_zero() {
    assert!(matches!(material("Material \"matte\"").unwrap(), Material::Diffuse { .. }));
    assert!(matches!(material("Material \"matte\" \"float sigma\" 0").unwrap(), Material::Diffuse { .. }));
    let rough = model("Material \"matte\" \"float sigma\" 20 \"rgb Kd\" [ 0.1 0.2 0.3 ]").unwrap();
    assert!(matches!(rough, EvaluatedMaterial::OrenNayar { .. }));
    let texture = "Texture \"s\" \"float\" \"checkerboard\" \"float tex1\" 0 \"float tex2\" 30\n";
    assert!(model(&format!("{texture}Material \"matte\" \"texture sigma\" \"s\"")).is_ok());
}

#[test]
fn integrators_take_proposals_and_density() {
    let with = |parameters: &str| load_text(&format!("{HEAD}Integrator \"path\" {parameters}\nWorldBegin\n"));
    let settings = with("\"integer bsdfproposals\" 12 \"string bsdfdensity\" \"uniform\"").unwrap().settings.integrator;
    assert_eq!((settings.bsdf_proposals, settings.bsdf_density), (12, ProposalDensity::Uniform));
    assert!(with("\"integer bsdfproposals\" 0").unwrap_err().contains("from 1 to 4096"));
    assert!(with("\"string bsdfdensity\" \"cosine\"").unwrap_err().contains("lobes, uniform"));
}

/// Means of the images of 12 seeds, by channel.
fn image_means(mut loaded: Loaded, proposals: u32, density: ProposalDensity) -> [Welford; 3] {
    loaded.settings.integrator.bsdf_proposals = proposals;
    loaded.settings.integrator.bsdf_density = density;
    let mut job = loaded.job(AccelKind::Embree, None).unwrap();
    let mut means = [Welford::default(); 3];
    for seed in 0..12 {
        // Different seeds per setting, so that the images are independent
        job.change(|s| s.sampling.seed = seed + 100 * proposals + 50 * u32::from(density == ProposalDensity::Uniform));
        let settings =
            RenderSettings { threads: Some(1), spp: job.settings().sampling.spp, ..RenderSettings::default() };
        let film = render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film;
        for (channel, mean) in means.iter_mut().enumerate() {
            mean.add(film.pixels().iter().map(|p| p.mean()[channel]).sum::<f64>() / film.len() as f64);
        }
    }
    means
}

const SETTINGS: [(u32, ProposalDensity); 4] = [
    (1, ProposalDensity::Lobes),
    (5, ProposalDensity::Lobes),
    (20, ProposalDensity::Lobes),
    (3, ProposalDensity::Uniform),
];

#[test]
fn a_closed_furnace_has_its_radiance_for_every_number_of_proposals() {
    // L = 0.5 Σ ρ^k over the emission and four bounces
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/analytic/furnace-evaluated.pbrt");
    let significance = sidak(1e-3, SETTINGS.len() * 3);
    for (proposals, density) in SETTINGS {
        let loaded = load(&path, &LoadOptions::default()).map_err(|d| d.to_string()).unwrap();
        let means = image_means(loaded, proposals, density);
        for (mean, rho) in means.iter().zip([0.5_f64, 0.25, 0.75]) {
            let expected = 0.5 * (1.0 - rho.powi(5)) / (1.0 - rho);
            assert!(t_test(mean, expected).p_value > significance, "{proposals} {density:?} {mean:?} {expected}");
        }
    }
}

#[test]
fn images_of_all_settings_have_one_mean() {
    let text = format!(
        "{HEAD}Integrator \"path\" \"integer maxdepth\" [ 4 ]
        WorldBegin
        LightSource \"point\" \"rgb I\" [ 4 3 2 ] \"point3 from\" [ 0.5 0.5 -0.5 ]
        Material \"evaluated\" \"string model\" \"cooktorrance\" \"float slope\" [ 0.3 ] \"rgb reflectance\" [ 0.2 0.4 0.8 ]
        Shape \"sphere\" \"float radius\" [ 3 ]
        Material \"evaluated\" \"string model\" \"phong\" \"float exponent\" [ 8 ]
        Translate 0 -0.3 1
        Shape \"sphere\" \"float radius\" [ 0.6 ]"
    );
    let all = SETTINGS.map(|(m, density)| image_means(load_text(&text).unwrap(), m, density));
    let significance = sidak(1e-3, 9);
    for other in &all[1..] {
        for (a, b) in all[0].iter().zip(other) {
            assert!(two_sample_z_test(a, b).p_value > significance, "{a:?} {b:?}");
        }
    }
}

#[test]
fn proposals_are_for_what_can_only_be_evaluated() {
    // Images with different numbers of proposals
    let text = |material: &str| {
        format!(
            "{HEAD}WorldBegin\nLightSource \"infinite\"\n{material}\nTranslate 0 0 1 Shape \"disk\" \"float radius\" 3 Shape \"sphere\" \"float radius\" 0.4"
        )
    };
    let image = |material: &str, proposals: u32| {
        let mut loaded = load_text(&text(material)).unwrap();
        loaded.settings.integrator.bsdf_proposals = proposals;
        loaded.settings.sampling.spp = 2;
        let job = loaded.job(AccelKind::Embree, None).unwrap();
        let settings = RenderSettings { spp: 2, ..RenderSettings::default() };
        let film = render(&job, &settings, &AtomicBool::new(false), &|_| ()).unwrap().film;
        film.pixels().iter().map(|p| p.mean()).collect::<Vec<_>>()
    };

    // Only evaluation-only materials use proposals
    for (material, same) in [
        ("Material \"diffuse\"", true),
        ("Material \"conductor\" \"float roughness\" 0.1", true),
        ("Material \"evaluated\" \"string model\" \"cooktorrance\"", false),
    ] {
        assert_eq!(image(material, 1) == image(material, 9), same, "{material}");
    }
}

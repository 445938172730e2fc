//! Properties that every BSDF must have, and the agreement of the closed form with the random walk.

mod coats;
mod densities;
mod evaluated;
mod measured;

use crate::bsdfs::hair::HairLobes;
use crate::bsdfs::principled::Interior;
use crate::bsdfs::sheen::Sheen;
use crate::bsdfs::*;
use lumiris_numbers::math::{Rgb, Vec3, safe_sqrt, sqr, warp};
use lumiris_test_support::Moments;
use lumiris_test_support::random::{Pcg32, RngExt, pcg32};
use std::f32::consts::{PI, TAU};
use strum::IntoEnumIterator;

pub(super) fn ggx(alpha_x: f32, alpha_y: f32) -> TrowbridgeReitz {
    TrowbridgeReitz::new(alpha_x, alpha_y)
}

pub(super) fn glass(eta: f32, alpha: f32) -> Dielectric {
    Dielectric { eta, distribution: ggx(alpha, alpha) }
}

pub(super) fn gold(alpha_x: f32, alpha_y: f32) -> Conductor {
    let (eta, k) = (Rgb::new(0.143, 0.375, 1.44), Rgb::new(3.98, 2.39, 1.6));
    Conductor { distribution: ggx(alpha_x, alpha_y), eta, k }
}

pub(super) fn layered(top: Dielectric, base: Base, albedo: f32, g: f32) -> Layered {
    let albedo = Rgb::new(albedo, albedo * 0.8, albedo * 0.5);
    Layered { top, base, thickness: if albedo.is_black() { 0.01 } else { 0.5 }, albedo, g, max_depth: 10, samples: 1 }
}

pub(super) const RED: Rgb = Rgb::new(0.9, 0.5, 0.2);

/// The BSDFs under test, with names.
pub(super) fn zoo<'a>(tables: &'a [CoatTable]) -> Vec<(String, Bsdf<'a>)> {
    let mut zoo: Vec<(String, Bsdf<'a>)> = vec![
        ("diffuse".into(), Bsdf::Diffuse(Diffuse { reflectance: RED })),
        (
            "diffuse transmission".into(),
            Bsdf::DiffuseTransmission(DiffuseTransmission { reflectance: RED * 0.4, transmittance: RED * 0.6 }),
        ),
        ("mirror".into(), Bsdf::Conductor(gold(0.0, 0.0))),
        ("gold 0.05".into(), Bsdf::Conductor(gold(0.05, 0.05))),
        ("gold 0.4 0.1".into(), Bsdf::Conductor(gold(0.4, 0.1))),
        ("smooth glass".into(), Bsdf::Dielectric(glass(1.5, 0.0))),
        ("glass 0.05".into(), Bsdf::Dielectric(glass(1.5, 0.05))),
        ("glass 0.3".into(), Bsdf::Dielectric(glass(1.5, 0.3))),
        ("air in glass 0.5".into(), Bsdf::Dielectric(glass(1.0 / 1.4, 0.5))),
        ("glass 0.6 0.2".into(), Bsdf::Dielectric(Dielectric { eta: 1.8, distribution: ggx(0.6, 0.2) })),
        ("no interface".into(), Bsdf::Dielectric(glass(1.0, 0.3))),
        ("thin".into(), Bsdf::ThinDielectric(ThinDielectric { eta: 1.5 })),
    ];

    // Coats
    for (i, table) in tables.iter().enumerate() {
        let coated = CoatedDiffuse::new(table, distributions()[i], RED, 10);
        zoo.push((format!("coated {:?}", distributions()[i]), Bsdf::CoatedDiffuse(coated)));
    }
    let lambert = Base::Diffuse(Diffuse { reflectance: RED });
    let layers = [
        layered(glass(1.5, 0.0), Base::Conductor(gold(0.0, 0.0)), 0.0, 0.0),
        layered(glass(1.5, 0.0), Base::Conductor(gold(0.0, 0.0)), 0.9, 0.3),
        layered(glass(1.5, 0.0), Base::Conductor(gold(0.1, 0.2)), 0.0, 0.0),
        layered(glass(1.5, 0.2), Base::Conductor(gold(0.0, 0.0)), 0.0, 0.0),
        layered(glass(1.5, 0.1), Base::Conductor(gold(0.3, 0.3)), 0.0, 0.0),
        layered(glass(1.5, 0.3), lambert, 0.9, -0.4),
        layered(glass(1.5, 0.0), lambert, 0.9, 0.7),
    ];
    zoo.extend(layers.iter().enumerate().map(|(i, &l)| (format!("layered {i}"), Bsdf::Layered(l))));

    // Models with tests of their own
    zoo.extend(principled().map(|(name, b)| (format!("principled {name}"), Bsdf::Principled(b))));
    zoo.extend(hair().map(|(name, b)| (format!("hair {name}"), Bsdf::Hair(b))));
    zoo.extend(measured::measured().map(|(name, b)| (format!("measured {name}"), Bsdf::Measured(b))));
    for density in ProposalDensity::iter() {
        let model = Model::CookTorrance(models::CookTorrance::new(RED, RED, 0.4, 0.5));
        zoo.push((format!("evaluated {density:?}"), Bsdf::Evaluated(Evaluated { model, density })));
    }
    zoo.push(("exit 0.3".into(), Bsdf::Exit(glass(1.4, 0.3))));
    zoo
}

/// Fibres at several offsets.
pub(super) fn hair() -> [(&'static str, Hair); 4] {
    let lobes = |beta_m, beta_n, alpha| HairLobes { beta_m, beta_n, alpha };
    let brown = Hair::sigma_a_of_melanin(1.3, 0.2);
    [
        ("brown", Hair::new(0.3, 1.55, brown, lobes(0.3, 0.3, 2.0))),
        ("edge", Hair::new(-0.95, 1.55, Hair::sigma_a_of_reflectance(RED, 0.3), lobes(0.25, 0.4, 3.0))),
        ("rough", Hair::new(-0.4, 1.3, brown, lobes(0.9, 0.8, 0.0))),
        ("white", Hair::new(0.6, 1.55, Rgb::BLACK, lobes(0.4, 0.3, 2.0))),
    ]
}

/// Variants of the principled BSDF.
pub(super) fn principled() -> [(&'static str, Principled); 9] {
    let plain = Principled {
        base_color: RED,
        metalness: 0.0,
        f0: Rgb::splat(0.04),
        f90: 1.0,
        distribution: ggx(0.25, 0.25),
        transmission: 0.0,
        interior: Interior::Thin,
        sheen: Sheen { color: Rgb::BLACK, alpha: 0.3 },
        coat: 0.0,
        coat_distribution: ggx(0.1, 0.1),
    };
    let solid = Interior::Solid(1.5);
    [
        ("plastic", plain),
        ("metal", Principled { metalness: 1.0, distribution: ggx(0.5, 0.2), ..plain }),
        ("white", Principled { base_color: Rgb::WHITE, metalness: 0.5, distribution: ggx(0.8, 0.8), ..plain }),
        ("coated", Principled { coat: 0.8, metalness: 0.3, ..plain }),
        ("thin", Principled { transmission: 0.7, ..plain }),
        ("solid", Principled { transmission: 1.0, interior: solid, ..plain }),
        ("cloth", Principled { sheen: Sheen { color: RED, alpha: 0.3 }, ..plain }),
        (
            "velvet",
            Principled { sheen: Sheen { color: Rgb::WHITE, alpha: 0.09 }, coat: 0.5, transmission: 0.5, ..plain },
        ),
        ("mixed", Principled { transmission: 0.5, interior: solid, coat: 0.5, metalness: 0.2, ..plain }),
    ]
}

/// Roughness of the coats of [`tables`].
pub(super) fn distributions() -> [TrowbridgeReitz; 4] {
    [ggx(0.0, 0.0), ggx(0.1, 0.1), ggx(0.5, 0.5), ggx(0.3, 0.08)]
}

pub(super) fn tables() -> Vec<CoatTable> {
    distributions().iter().map(|&d| CoatTable::for_roughness(1.5, 0.01, d)).collect()
}

#[test]
fn a_bsdf_is_small_enough_for_batches() {
    assert!(size_of::<Bsdf<'_>>() <= 128, "{}", size_of::<Bsdf<'_>>());
}

#[test]
fn nothing_is_ever_nan_negative_or_infinite() {
    let tables = tables();
    let mut s = pcg32([7, 7, 7]);
    for (name, b) in zoo(&tables) {
        for i in 0..20_000 {
            let mut direction = || {
                let w = warp::sample_uniform_sphere(s.random::<[f32; 2]>());
                // Every third direction is grazing, down to denormal cosines; some lie on an axis or in the plane.
                let z = match i % 6 {
                    0 => w.z * 10.0_f32.powi(-(1 + (i / 6) % 44)),
                    1 if i % 5 == 0 => return [Vec3::X, Vec3::Z, -Vec3::Z, Vec3::Y][i as usize / 30 % 4],
                    _ => w.z,
                };
                let scale = safe_sqrt(1.0 - z * z) / w.truncate().length().max(1e-20);
                Vec3::new(w.x * scale, w.y * scale, z)
            };
            let (wo, wi) = (direction(), if i % 7 == 0 { -direction() } else { direction() });
            let (f, pdf) = (b.f(wo, wi), b.pdf(wo, wi));
            assert!(f.is_finite() && f.to_array().iter().all(|&c| c >= 0.0), "{name} {wo} {wi} {f:?}");
            assert!(pdf.is_finite() && pdf >= 0.0, "{name} {wo} {wi} {pdf}");
            let sample =
                b.sample(wo, s.random::<f32>(), if i % 3 == 0 { [0.0, 1.0 - 6e-8] } else { s.random::<[f32; 2]>() });
            if let Some(x) = sample {
                assert!(x.pdf > 0.0 && x.pdf.is_finite() && x.f.is_finite(), "{name} {wo} {x:?}");
                assert!((x.wi.length() - 1.0).abs() < 1e-4 && x.wi.z != 0.0, "{name} {wo} {x:?}");
                assert_eq!(x.lobe.contains(Lobe::TRANSMISSION), x.wi.z * wo.z < 0.0, "{name} {wo} {x:?}");
            }
            let u = s.random::<[f32; 2]>();
            assert!(b.albedo_estimate(wo, || [s.random::<f32>(), u[0], u[1]]).is_finite());
        }
    }
}

#[test]
fn albedo_estimates_average_to_the_integral_of_f_times_the_cosine() {
    let tables = tables();
    let mut s = pcg32([4, 8, 15]);
    // Wide lobes only, which uniform directions on the sphere often hit
    let wide = ["gold 0.4 0.1", "glass 0.3", "glass 0.6 0.2", "layered 5"];
    let is_wide = |name: &str| wide.contains(&name) || name.starts_with("evaluated");
    let tested: Vec<_> = zoo(&tables).into_iter().filter(|(name, _)| is_wide(name)).collect();
    assert_eq!(tested.len(), wide.len() + ProposalDensity::iter().len());
    for (_, b) in tested {
        for wo in [warp::direction(0.9, 0.3), warp::direction(0.4, 2.0)] {
            // The difference of two estimates with independent numbers has the mean 0.
            let mut difference = Moments::default();
            for _ in 0..60_000 {
                let (u, v) = (s.random::<[f32; 2]>(), s.random::<[f32; 2]>());
                let estimate = b.albedo_estimate(wo, || [s.random::<f32>(), u[0], u[1]]).g;
                let wi = warp::sample_uniform_sphere(v);
                difference.add(f64::from(estimate - b.f(wo, wi).g * wi.z.abs() * 2.0 * TAU));
            }
            difference.assert_mean(0.0, 1e-6, 0.0);
        }
    }
}

#[test]
fn scattering_is_reciprocal() {
    let tables = tables();
    let mut s = pcg32([1, 7, 9]);
    for (name, b) in zoo(&tables) {
        if matches!(b, Bsdf::Layered(_)) {
            continue; // Noisy; its mean is compared with analog walks instead.
        }
        if matches!(b, Bsdf::Hair(_)) {
            continue; // Its attenuation depends on θo only [Chiang et al. 2016].
        }
        if matches!(b, Bsdf::Measured(_)) {
            continue; // Tables are interpolated in one of both directions.
        }
        for _ in 0..2000 {
            let (wo, wi) = (
                warp::sample_uniform_sphere(s.random::<[f32; 2]>()),
                warp::sample_uniform_sphere(s.random::<[f32; 2]>()),
            );
            if wo.z.abs().min(wi.z.abs()) < 0.05 {
                continue;
            }
            let (mut a, mut c) = (b.f(wo, wi).g, b.f(wi, wo).g);
            let eta = match &b {
                Bsdf::Dielectric(d) | Bsdf::Exit(d) => d.eta,
                Bsdf::Principled(Principled { interior: Interior::Solid(eta), .. }) => *eta,
                _ => 1.0,
            };
            if wo.z * wi.z < 0.0 {
                // f(wo → wi)·η_i² is symmetric, where η is absolute.
                let eta2 = |w: Vec3| if w.z < 0.0 { sqr(eta) } else { 1.0 };
                (a, c) = (a * eta2(wi), c * eta2(wo));
            }
            assert!((a - c).abs() <= 2e-3 * a.max(c) + 1e-6, "{name} {wo} {wi} {a} {c}");
        }
    }
}

#[test]
fn no_bsdf_creates_energy() {
    let tables = tables();
    for (name, b) in zoo(&tables) {
        for cos in [0.02, 0.3, 0.7, 1.0, -0.1, -0.9] {
            let wo = warp::direction(cos, 0.4);
            let (mut s, mut sum) = (pcg32([3, 2, 1]), 0.0_f64);
            let n = 40_000;
            for _ in 0..n {
                if let Some(x) = b.sample(wo, s.random::<f32>(), s.random::<[f32; 2]>()) {
                    // Transmitted radiance is scaled by the square of the index.
                    sum += f64::from(x.f.max_component() * x.wi.z.abs() / x.pdf * sqr(x.eta));
                }
            }
            assert!(sum / f64::from(n) < 1.01, "{name} {cos} {}", sum / f64::from(n));
        }
    }
}

#[test]
fn samples_agree_with_f_and_pdf() {
    let tables = tables();
    for (name, b) in zoo(&tables) {
        let mut s = pcg32([3, 2, 5]);
        for _ in 0..20_000 {
            let wo = warp::direction(s.random::<f32>() * 1.9 - 0.95, TAU * s.random::<f32>());
            let Some(x) = b.sample(wo, s.random::<f32>(), s.random::<[f32; 2]>()) else { continue };
            if x.lobe.is_specular() {
                assert!(b.has_specular(), "{name}");
                continue;
            }
            assert!(b.has_non_specular(), "{name}");
            let (f, pdf) = (b.f(wo, x.wi), b.pdf(wo, x.wi));
            let tolerance = if wo.z.abs().min(x.wi.z.abs()) < 0.05 { 0.2 } else { 0.02 };
            assert!((f.g - x.f.g).abs() <= tolerance * f.g.max(x.f.g), "{name} {wo} {x:?} {f:?}");
            assert!((pdf - x.pdf).abs() <= tolerance * pdf.max(x.pdf), "{name} {wo} {x:?} {pdf}");
        }
    }
}

#[test]
fn furnaces_have_their_known_albedo() {
    let up = warp::direction(0.6, 1.0);
    let mean = |b: &Bsdf<'_>, wo: Vec3| {
        let (mut s, mut sum) = (pcg32([5, 5, 5]), 0.0_f64);
        for _ in 0..200_000 {
            if let Some(x) = b.sample(wo, s.random::<f32>(), s.random::<[f32; 2]>()) {
                sum += f64::from(x.f.g * x.wi.z.abs() / x.pdf * sqr(x.eta));
            }
        }
        sum / 200_000.0
    };
    // Smooth glass, thin glass and an absent interface conserve energy, and so does a white Lambertian.
    for b in [
        Bsdf::Dielectric(glass(1.5, 0.0)),
        Bsdf::Dielectric(glass(1.0, 0.5)),
        Bsdf::ThinDielectric(ThinDielectric { eta: 1.5 }),
        Bsdf::Diffuse(Diffuse { reflectance: Rgb::WHITE }),
        Bsdf::DiffuseTransmission(DiffuseTransmission { reflectance: Rgb::splat(0.3), transmittance: Rgb::splat(0.7) }),
    ] {
        assert!((mean(&b, up) - 1.0).abs() < 1e-4, "{b:?}");
        assert!((mean(&b, -up) - 1.0).abs() < 1e-4, "{b:?}");
    }
    // Rough glass loses the light of multiple scattering: little at low roughness.
    let rough = mean(&Bsdf::Dielectric(glass(1.5, 0.1)), up);
    assert!((0.99..1.0005).contains(&rough), "{rough}");
    // Thin sheet at normal incidence: R' = 2R/(1 + R).
    let r = lumiris_lanes::kernels::thin_dielectric::reflectance(1.0, 1.5);
    assert!((r - 2.0 * 0.04 / 1.04).abs() < 1e-6);
    // A perfect mirror under an absent coat is a perfect mirror.
    let ComplexIor { eta, k } = Conductor::eta_k_of_reflectance(Rgb::splat(0.8));
    let mirror = Conductor { distribution: ggx(0.0, 0.0), eta, k };
    assert!((mean(&Bsdf::Conductor(mirror), Vec3::Z) - 0.8).abs() < 1e-3);
    assert!((PI * Diffuse { reflectance: RED }.f(Vec3::Z, Vec3::Z).r - RED.r).abs() < 1e-6);
}

#[test]
fn a_white_principled_surface_loses_nothing() {
    let white = |b: Principled| Principled { base_color: Rgb::WHITE, coat: 0.0, ..b };
    for (name, b) in principled().map(|(name, b)| (name, Bsdf::Principled(white(b)))) {
        if ["metal", "solid", "cloth", "velvet", "mixed"].contains(&name) {
            // Anisotropic tables are approximate; refraction has no multiple scattering; sheen does not conserve energy
            continue;
        }
        for cos in [0.1, 0.5, 1.0] {
            let (wo, mut s, mut mean) = (warp::direction(cos, 0.4), pcg32([2, 4, 6]), 0.0);
            for _ in 0..100_000 {
                let x = b.sample(wo, s.random::<f32>(), s.random::<[f32; 2]>());
                mean += x.map_or(0.0, |x| f64::from(x.f.g * x.wi.z.abs() / x.pdf)) / 1e5;
            }
            assert!((mean - 1.0_f64).abs() < 0.006, "{name} {cos}: {mean}");
        }
    }
}

#[test]
fn a_fibre_without_absorption_loses_nothing() {
    // Σ_p A_p = 1, and the lobes are normalised; uniform sampling makes the estimate independent of the density
    let mut s = pcg32([9, 4, 1]);
    for (beta_m, beta_n) in [(0.2, 0.4), (0.3, 0.3), (0.6, 0.9), (1.0, 1.0)] {
        for cos in [0.9, 0.3, -0.7] {
            let wo = warp::direction(cos, 0.7);
            let (mut uniform, mut sampled) = (Moments::default(), Moments::default());
            for _ in 0..200_000 {
                let h = 2.0 * s.random::<f32>() - 1.0;
                let b = Bsdf::Hair(Hair::new(h, 1.55, Rgb::BLACK, HairLobes { beta_m, beta_n, alpha: 2.0 }));
                let wi = warp::sample_uniform_sphere(s.random::<[f32; 2]>());
                uniform.add(f64::from(b.f(wo, wi).g * wi.z.abs() * 2.0 * TAU));
                let x = b.sample(wo, s.random::<f32>(), s.random::<[f32; 2]>());
                sampled.add(x.map_or(0.0, |x| f64::from(x.f.g * x.wi.z.abs() / x.pdf)));
            }
            uniform.assert_mean(1.0, 1e-4, 2e-3);
            sampled.assert_mean(1.0, 1e-4, 2e-3);
        }
    }
}

#[test]
fn the_colour_of_hair_is_that_of_its_bulk_and_black_hair_absorbs() {
    let white = Hair::sigma_a_of_reflectance(Rgb::WHITE, 0.3);
    assert!(white.is_black(), "{white:?}");
    // [Chiang et al. 2016, Eq. 9] by hand: ln 0.5 = -0.693147, the polynomial at 0.3 is 5.888 within 1e-3
    let half = Hair::sigma_a_of_reflectance(Rgb::splat(0.5), 0.3).g;
    assert!((half - 0.0139).abs() < 2e-4, "{half}");
}

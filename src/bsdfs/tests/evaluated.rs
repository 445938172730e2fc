//! BSDFs that can only be evaluated: their models, their sampling densities, and resampling, which must work for any
//! BSDF.

use super::*;
use crate::bsdfs::models::{AshikhminShirley, CookTorrance, CosineLobe, LobeAxis, OrenNayar};
use lumiris_numbers::estimators::stats::{Welford, sidak, two_sample_z_test, z_test};
use lumiris_numbers::math::hash::{pcg4d, unit_f32};

const BLUE: Rgb = Rgb::new(0.1, 0.4, 0.8);

/// The models under test, with names.
pub(super) fn models() -> Vec<(&'static str, Model)> {
    let lobe = |d: f32, s: f32, n, axis| Model::CosineLobe(CosineLobe::new(RED * d, BLUE * s, n, axis));
    vec![
        ("diffuse", Model::Diffuse(RED)),
        ("oren-nayar 20", Model::OrenNayar(OrenNayar::new(RED, 0.35))),
        ("oren-nayar 60", Model::OrenNayar(OrenNayar::new(RED, 1.05))),
        ("cook-torrance 0.1", Model::CookTorrance(CookTorrance::new(BLUE, RED, 0.1, 0.9))),
        ("cook-torrance 0.3", Model::CookTorrance(CookTorrance::new(BLUE, RED, 0.3, 0.5))),
        ("cook-torrance 0.6", Model::CookTorrance(CookTorrance::new(BLUE, RED, 0.6, 1.0))),
        ("phong 20", lobe(0.4, 0.7, 20.0, LobeAxis::Mirror)),
        ("phong 150", lobe(0.1, 1.0, 150.0, LobeAxis::Mirror)),
        ("retro 40", lobe(0.2, 0.9, 40.0, LobeAxis::Retro)),
        ("ashikhmin-shirley", Model::AshikhminShirley(AshikhminShirley::new(RED, BLUE * 0.5, [10.0, 200.0]))),
    ]
}

fn evaluated(model: Model) -> Bsdf<'static> {
    Bsdf::Evaluated(Evaluated { model, density: ProposalDensity::Lobes })
}

/// ∫ f(wo, wi) cos θi L(wi) over the side of `wo`, by the midpoint rule in (θ, φ).
fn quadrature(bsdf: &Bsdf<'_>, wo: Vec3, l: impl Fn(Vec3) -> Rgb) -> [f64; 3] {
    let (thetas, phis) = (1000, 1000);
    let dt = 0.5 * std::f64::consts::PI / f64::from(thetas);
    let dp = std::f64::consts::TAU / f64::from(phis);
    let mut sum = [0.0; 3];
    for i in 0..thetas {
        let (sin, cos) = (dt * (f64::from(i) + 0.5)).sin_cos();
        for j in 0..phis {
            let (sp, cp) = (dp * (f64::from(j) + 0.5)).sin_cos();
            let wi = Vec3::new((sin * cp) as f32, (sin * sp) as f32, cos.copysign(f64::from(wo.z)) as f32);
            let value = (bsdf.f(wo, wi) * l(wi)).to_array();
            sum.iter_mut().zip(value).for_each(|(s, v)| *s += f64::from(v) * cos * sin * dt * dp);
        }
    }
    sum
}

/// Illumination of all colours from all directions, brighter in one.
fn light(wi: Vec3) -> Rgb {
    Rgb::new(1.0 + wi.x, 0.3 + sqr(wi.y), 0.5 + 0.4 * wi.z)
}

/// Moments per channel of f |cos θ| L W of `n` directions resampled from `proposals`.
fn moments(bsdf: &Bsdf<'_>, wo: Vec3, proposals: u32, n: u32, seed: u32) -> [Welford; 3] {
    let mut sums = [Welford::new(); 3];
    for i in 0..n {
        let proposal = |j: u32| {
            let u = pcg4d([i, j, seed, 5]).map(unit_f32);
            [u[0], u[1], u[2]]
        };
        let [u_choice, ..] = pcg4d([i, seed, 8, 1]).map(unit_f32);
        let value = match resample(bsdf, wo, proposals, proposal, u_choice) {
            Some(r) => r.f * light(r.wi) * (r.wi.z.abs() * r.weight),
            None => Rgb::BLACK,
        };
        sums.iter_mut().zip(value.to_array()).for_each(|(s, v)| s.add(f64::from(v)));
    }
    sums
}

#[test]
fn models_are_reciprocal_and_one_sided() {
    let mut s = pcg32([6, 1, 4]);
    for (name, model) in models() {
        for _ in 0..5000 {
            let (wo, wi) = (
                warp::sample_uniform_sphere(s.random::<[f32; 2]>()),
                warp::sample_uniform_sphere(s.random::<[f32; 2]>()),
            );
            let (a, b) = (model.f(wo, wi), model.f(wi, wo));
            assert!((a.r - b.r).abs() <= 1e-4 * a.r.max(b.r) + 1e-6, "{name} {wo} {wi} {a:?} {b:?}");
            assert!(wo.z * wi.z > 0.0 || a.is_black(), "{name} {wo} {wi}");
            assert_eq!(a, model.f(-wo, -wi), "{name}");
        }
    }
}

#[test]
fn models_of_full_reflectance_create_no_energy() {
    let white = |_: Vec3| Rgb::WHITE;
    let lobe = |n, axis| Model::CosineLobe(CosineLobe::new(Rgb::splat(0.2), Rgb::WHITE, n, axis));
    let mut cases = vec![("diffuse", Model::Diffuse(Rgb::WHITE))];
    cases.extend([0.05, 0.2, 0.6].map(|m| {
        (
            "cook-torrance",
            Model::CookTorrance(CookTorrance::new(Rgb::WHITE, Rgb::WHITE, m, if m > 0.3 { 1.0 } else { 0.7 })),
        )
    }));
    cases.extend([1.0, 30.0, 300.0].map(|n| ("phong", lobe(n, LobeAxis::Mirror))));
    cases.extend([5.0, 100.0].map(|n| ("retro", lobe(n, LobeAxis::Retro))));
    cases.extend([[5.0, 5.0], [100.0, 100.0], [300.0, 20.0]].map(|n| {
        ("ashikhmin-shirley", Model::AshikhminShirley(AshikhminShirley::new(Rgb::WHITE, Rgb::splat(0.5), n)))
    }));
    for (name, model) in cases {
        for cos in [1.0, 0.8, 0.5, 0.2, 0.05] {
            let albedo = quadrature(&evaluated(model), warp::direction(cos, 0.3), white)[0];
            assert!(albedo < 1.0 + 1e-3, "{name} {model:?} {cos}: {albedo}");
        }
    }
    // Oren and Nayar's fit exceeds its ρ at grazing angles, by no more than A + B/2 − 1 ≤ 1.52 %.
    for sigma in [0.1, 0.2, 0.5, 1.0] {
        let model = OrenNayar::new(Rgb::WHITE, sigma);
        let bound = f64::from(model.a() + 0.5 * model.b());
        assert!(bound < 1.0153);
        for cos in [1.0, 0.5, 0.2, 0.02] {
            let albedo = quadrature(&evaluated(Model::OrenNayar(model)), warp::direction(cos, 0.3), white)[0];
            assert!(albedo < bound.max(1.0) + 1e-4, "{sigma} {cos}: {albedo}");
        }
    }
}

#[test]
fn albedos_along_the_normal_have_their_closed_forms() {
    let albedo = |model| quadrature(&evaluated(model), Vec3::Z, |_| Rgb::WHITE);
    for axis in [LobeAxis::Mirror, LobeAxis::Retro] {
        // ρd + ρs: the lobe is (n + 2)/(2π) ∫ cosⁿ⁺¹ θ dω = 1.
        let found = albedo(Model::CosineLobe(CosineLobe::new(Rgb::splat(0.3), Rgb::splat(0.5), 25.0, axis)));
        assert!((found[1] - 0.8).abs() < 1e-4, "{found:?}");
    }
    let oren_nayar = OrenNayar::new(Rgb::splat(0.5), 0.5);
    assert!((albedo(Model::OrenNayar(oren_nayar))[0] - 0.5 * f64::from(oren_nayar.a())).abs() < 1e-4);
    // σ = 0 is Lambert, and a flat metal of small slope keeps its reflectance at normal incidence.
    assert!((albedo(Model::OrenNayar(OrenNayar::new(RED, 0.0)))[1] - f64::from(RED.g)).abs() < 1e-4);
    let metal = albedo(Model::CookTorrance(CookTorrance::new(Rgb::BLACK, RED, 0.05, 1.0)));
    assert!((metal[1] - f64::from(RED.g)).abs() < 2e-3, "{metal:?}");
    // ρd (1 − (1 − cos θo/2)⁵): 28/23 is one over the integral of the other factor.
    let diffuse = Model::AshikhminShirley(AshikhminShirley::new(Rgb::WHITE, Rgb::BLACK, [1e4, 1e4]));
    assert!((albedo(diffuse)[0] - 31.0 / 32.0).abs() < 1e-3);
}

#[test]
fn cook_torrance_keeps_what_its_facets_keep() {
    // V-cavities shadow only as much as the projected area requires: with F = 1 the albedo at normal incidence is 1,
    // until facets are so steep that light is reflected twice.
    let albedo = |m, cos| {
        let model = CookTorrance::new(Rgb::BLACK, Rgb::WHITE, m, 1.0);
        quadrature(&evaluated(Model::CookTorrance(model)), warp::direction(cos, 0.0), |_| Rgb::WHITE)[0]
    };
    assert!((albedo(0.1, 1.0) - 1.0).abs() < 2e-3, "{}", albedo(0.1, 1.0));
    assert!((0.5..0.97).contains(&albedo(0.6, 0.5)), "{}", albedo(0.6, 0.5));
}

#[test]
fn resampling_is_unbiased_for_every_bsdf() {
    let tables = tables();
    let mut zoo = zoo(&tables);
    zoo.extend(models().into_iter().map(|(name, m)| (name.to_owned(), evaluated(m))));
    let directions = [warp::direction(0.8, 0.6), warp::direction(-0.3, 2.5)];
    let significance = sidak(0.01, zoo.len() * directions.len() * 2 * 3);
    for (name, bsdf) in &zoo {
        // Seeded by name, so that a new model changes no random numbers of others
        let of_name = name.bytes().fold(0, |seed: u32, byte| seed.wrapping_mul(31).wrapping_add(byte.into()));
        for (k, &wo) in directions.iter().enumerate() {
            let seed = of_name.wrapping_mul(64).wrapping_add(k as u32 * 32);
            let reference = match bsdf {
                Bsdf::Evaluated(_) => None,
                // Plain sampling, without a choice among proposals.
                Bsdf::Diffuse(_)
                | Bsdf::DiffuseTransmission(_)
                | Bsdf::Conductor(_)
                | Bsdf::Dielectric(_)
                | Bsdf::Exit(_)
                | Bsdf::ThinDielectric(_)
                | Bsdf::CoatedDiffuse(_)
                | Bsdf::Layered(_)
                | Bsdf::Phase(_)
                | Bsdf::Hair(_)
                | Bsdf::Measured(_)
                | Bsdf::Principled(_) => {
                    let mut sums = [Welford::new(); 3];
                    let mut s = pcg32([seed, 77, 3]);
                    for _ in 0..100_000 {
                        let value = match bsdf.sample(wo, s.random::<f32>(), s.random::<[f32; 2]>()) {
                            Some(x) => x.f * light(x.wi) * (x.wi.z.abs() / x.pdf),
                            None => Rgb::BLACK,
                        };
                        sums.iter_mut().zip(value.to_array()).for_each(|(s, v)| s.add(f64::from(v)));
                    }
                    Some(sums)
                }
            };
            let exact = reference.is_none().then(|| quadrature(bsdf, wo, light));
            for (m, n) in [(3, 40_000), (16, 10_000)] {
                let found = moments(bsdf, wo, m, n, seed + m);
                for c in 0..3 {
                    let p = match (&reference, &exact) {
                        (Some(r), _) if (found[c].mean() - r[c].mean()).abs() < 1e-5 * r[c].mean() => 1.0,
                        (Some(r), _) => two_sample_z_test(&found[c], &r[c]).p_value,
                        (_, Some(e)) => z_test(found[c].mean(), e[c], found[c].standard_error()).p_value,
                        (None, None) => 0.0,
                    };
                    assert!(p > significance, "{name} {wo} M {m} channel {c}: {:?} {reference:?} {exact:?}", found[c]);
                }
            }
        }
    }
}

#[test]
fn one_proposal_is_plain_importance_sampling() {
    let tables = tables();
    for (name, bsdf) in zoo(&tables) {
        let mut s = pcg32([2, 7, 1]);
        for _ in 0..500 {
            let wo = warp::sample_uniform_sphere(s.random::<[f32; 2]>());
            let (uc, u, choice) = (s.random::<f32>(), s.random::<[f32; 2]>(), s.random::<f32>());
            let plain = bsdf.sample(wo, uc, u);
            let drawn = resample(&bsdf, wo, 1, |_| [uc, u[0], u[1]], choice);
            assert_eq!(plain.is_some(), drawn.is_some(), "{name} {wo}");
            if let (Some(a), Some(b)) = (plain, drawn) {
                assert_eq!((a.wi, a.f, a.lobe, a.eta), (b.wi, b.f, b.lobe, b.eta), "{name}");
                assert!((b.weight * a.pdf - 1.0).abs() < 1e-5, "{name} {wo}");
            }
        }
    }
}

#[test]
fn resampled_directions_follow_the_target_in_the_limit() {
    // With many proposals, the mean of wi is the mean of the density f cos θ/∫ f cos θ, not the mean of the proposals.
    let bsdf = evaluated(Model::CosineLobe(CosineLobe::new(Rgb::BLACK, Rgb::WHITE, 20.0, LobeAxis::Mirror)));
    let wo = warp::direction(0.6, 0.0);
    let norm = quadrature(&bsdf, wo, |_| Rgb::WHITE)[0];
    let expected = quadrature(&bsdf, wo, |wi| Rgb::splat(wi.x + 1.0))[0] / norm - 1.0;
    let mut mean = Welford::new();
    let mut proposals = Welford::new();
    let mut s = pcg32([9, 9, 2]);
    for i in 0..4000 {
        let proposal = |j: u32| {
            let u = pcg4d([i, j, 3, 9]).map(unit_f32);
            [u[0], u[1], u[2]]
        };
        mean.add(f64::from(resample(&bsdf, wo, 500, proposal, s.random::<f32>()).unwrap().wi.x));
        if let Some(x) = bsdf.sample(wo, s.random::<f32>(), s.random::<[f32; 2]>()) {
            proposals.add(f64::from(x.wi.x));
        }
    }
    assert!((mean.mean() - expected).abs() < 0.02, "{mean:?} {expected}");
    assert!((proposals.mean() - expected).abs() > 0.2, "{proposals:?}");
}

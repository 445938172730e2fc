//! χ² tests of every sampling routine against its pdf; family-wise significance 1 % (Šidák), fixed seeds.

use super::*;
use lumiris_numbers::estimators::stats::{chi_squared_test, sidak};
use lumiris_test_support::power::by_power;

/// Number of bins of the polar angle; the azimuth has twice as many.
fn thetas() -> usize {
    by_power(32, 16)
}

fn phis() -> usize {
    2 * thetas()
}

fn samples() -> usize {
    by_power(1_000_000, 200_000)
}

/// 3×3 Gauss-Legendre on [a0, a1] × [b0, b1].
fn gauss(f: &dyn Fn(f64, f64) -> f64, a: [f64; 2], b: [f64; 2]) -> f64 {
    let nodes = [(-0.774_596_669_241_483_4, 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)];
    let (ha, hb) = (0.5 * (a[1] - a[0]), 0.5 * (b[1] - b[0]));
    let mut sum = 0.0;
    for (x, wx) in nodes {
        for (y, wy) in nodes {
            sum += wx * wy * f(a[0] + ha * (1.0 + x), b[0] + hb * (1.0 + y));
        }
    }
    sum * ha * hb
}

/// Adaptive quadrature by halving both axes, at least three times.
fn integrate(f: &dyn Fn(f64, f64) -> f64, a: [f64; 2], b: [f64; 2], whole: f64, depth: u32) -> f64 {
    let (ma, mb) = (0.5 * (a[0] + a[1]), 0.5 * (b[0] + b[1]));
    let cells =
        [([a[0], ma], [b[0], mb]), ([a[0], ma], [mb, b[1]]), ([ma, a[1]], [b[0], mb]), ([ma, a[1]], [mb, b[1]])];
    let parts = cells.map(|(a, b)| gauss(f, a, b));
    let sum: f64 = parts.iter().sum();
    if depth >= 2 && ((sum - whole).abs() < 1e-7 || depth >= 9) {
        return sum;
    }
    cells.iter().zip(parts).map(|(&(a, b), part)| integrate(f, a, b, part, depth + 1)).sum()
}

/// Probability of each bin over the sphere, and last, of a failed sample or a delta.
fn expected(pdf: &dyn Fn(Vec3) -> f32) -> Vec<f64> {
    let (thetas, phis) = (thetas(), phis());
    let f = |theta: f64, phi: f64| {
        let (st, ct) = theta.sin_cos();
        let (sp, cp) = phi.sin_cos();
        st * f64::from(pdf(Vec3::new((st * cp) as f32, (st * sp) as f32, ct as f32)))
    };
    let dt = std::f64::consts::PI / thetas as f64;
    let dp = std::f64::consts::TAU / phis as f64;
    let mut bins: Vec<f64> = (0..thetas * phis)
        .map(|i| {
            let (t, p) = ((i / phis) as f64 * dt, (i % phis) as f64 * dp);
            let (a, b) = ([t, t + dt], [p, p + dp]);
            integrate(&f, a, b, gauss(&f, a, b), 0)
        })
        .collect();
    bins.push((1.0 - bins.iter().sum::<f64>()).max(0.0));
    bins
}

fn histogram(sample: &dyn Fn(f32, [f32; 2]) -> Option<BsdfSample>, seed: u32) -> Vec<f64> {
    let (thetas, phis) = (thetas(), phis());
    let mut counts = vec![0.0; thetas * phis + 1];
    let mut s = pcg32([seed, 11, 22]);
    for _ in 0..samples() {
        let bin = match sample(s.random::<f32>(), s.random::<[f32; 2]>()) {
            Some(x) if !x.lobe.is_specular() => {
                let theta = f64::from(x.wi.truncate().length()).atan2(f64::from(x.wi.z));
                let i = (theta / std::f64::consts::PI * thetas as f64) as usize;
                let j = (warp::azimuth(x.wi) / TAU * phis as f32) as usize;
                i.min(thetas - 1) * phis + j.min(phis - 1)
            }
            _ => thetas * phis,
        };
        counts[bin] += 1.0;
    }
    counts
}

#[test]
fn samples_follow_their_density_by_chi_squared() {
    let tables = tables();
    let zoo: Vec<_> = zoo(&tables).into_iter().filter(|(_, b)| b.has_non_specular()).collect();
    let directions = [warp::direction(0.85, 0.6), warp::direction(0.25, 2.5), warp::direction(-0.6, 4.0)];
    let significance = sidak(0.01, zoo.len() * directions.len());
    let mut failures = Vec::new();
    for (i, (name, b)) in zoo.iter().enumerate() {
        for (j, &wo) in directions.iter().enumerate() {
            // Expected and observed counts
            let probabilities = expected(&|wi| b.pdf(wo, wi));
            let total: f64 = probabilities[..thetas() * phis()].iter().sum();
            let expected: Vec<f64> = probabilities.iter().map(|p| p * samples() as f64).collect();
            let observed = histogram(&|uc, u| b.sample_direction(wo, uc, u), (i * 8 + j) as u32);
            let chi = chi_squared_test(&observed, &expected, significance);
            if chi.rejected || total > 1.0 + 1e-4 {
                failures.push(format!("{name} {wo}: {chi:?}, ∫pdf = {total}"));
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn the_chi_squared_test_finds_a_wrong_density() {
    // Power of the test: the same sampler must fail against a density that is 3 % narrower in alpha.
    let (a, b) = (Bsdf::Conductor(gold(0.3, 0.3)), Bsdf::Conductor(gold(0.291, 0.291)));
    let wo = warp::direction(0.7, 1.0);
    let expected: Vec<f64> = expected(&|wi| b.pdf(wo, wi)).iter().map(|p| p * samples() as f64).collect();
    assert!(chi_squared_test(&histogram(&|uc, u| a.sample(wo, uc, u), 5), &expected, 1e-6).rejected);
}

#[test]
fn the_first_lobe_is_sampled_in_proportion_to_its_part_of_the_density() {
    // Given the direction, the probability that the first lobe sampled it is its fraction of the density
    let tables = tables();
    let mut of_two = 0;
    for (i, (name, b)) in zoo(&tables).iter().enumerate() {
        for wo in [warp::direction(0.85, 0.6), warp::direction(-0.6, 4.0)] {
            let share = b.first_lobe(wo);
            assert!((0.0..=1.0).contains(&share), "{name}: {share}");
            let mut stream = pcg32([i as u32, 3, 7]);
            let mut difference = lumiris_numbers::estimators::stats::Welford::new();
            for _ in 0..100_000 {
                let uc = stream.random::<f32>();
                let Some(s) = b.sample_direction(wo, uc, stream.random::<[f32; 2]>()).filter(|s| !s.lobe.is_specular())
                else {
                    continue;
                };
                let part = b.pdf_first_lobe(wo, s.wi, s.pdf);
                assert!((0.0..=s.pdf).contains(&part), "{name}: {part} of {}", s.pdf);
                difference.add(f64::from(part / s.pdf) - f64::from(u8::from(uc < share)));
            }
            of_two += usize::from(share > 0.0 && share < 1.0);
            let z = lumiris_numbers::estimators::stats::z_test(difference.mean(), 0.0, difference.standard_error());
            assert!(difference.mean().abs() < 1e-6 || z.p_value > 1e-5, "{name} {wo}: {difference:?}");
        }
    }
    assert!(of_two >= 8, "BSDFs of two lobes are among them");
}

#[test]
fn wide_lobes_find_every_direction_of_their_side() {
    // ∫ cos θ/π = 1 by samples that include black f, with a bounded quotient
    let tables = tables();
    let mut all = zoo(&tables);
    let half = |albedo, coat| {
        Bsdf::Layered(layered(glass(1.5, coat), Base::Diffuse(Diffuse { reflectance: RED * albedo }), 0.0, 0.0))
    };
    let narrow = Model::CosineLobe(models::CosineLobe::new(Rgb::BLACK, RED, 900.0, models::LobeAxis::Mirror));
    all.extend([
        ("black base".into(), half(0.0, 0.0)),
        ("dark base".into(), half(0.2, 0.3)),
        ("narrow".into(), Bsdf::Evaluated(Evaluated { model: narrow, density: ProposalDensity::Lobes })),
        (
            "transmission".into(),
            Bsdf::DiffuseTransmission(DiffuseTransmission { reflectance: Rgb::BLACK, transmittance: RED }),
        ),
    ]);
    let mut tested = 0;
    for (i, (name, b)) in all.iter().enumerate() {
        for wo in [warp::direction(0.85, 0.6), warp::direction(-0.3, 4.0)] {
            let wide = b.wide_lobe(wo);
            assert!((0.0..=1.0).contains(&wide), "{name}: {wide}");
            if wide < 0.01 {
                continue;
            }
            tested += 1;
            let mut stream = pcg32([i as u32, 9, 1]);
            let mut mean = lumiris_numbers::estimators::stats::Welford::new();
            for _ in 0..20_000 {
                let sample = b.sample_direction(wo, stream.random::<f32>(), stream.random::<[f32; 2]>());
                let sample = sample.filter(|s| !s.lobe.is_specular() && s.wi.z * wo.z > 0.0);
                let quotient = sample.map_or(0.0, |s| s.wi.z.abs() / s.pdf);
                assert!(quotient <= 1.001 * TAU / wide, "{name}: {quotient}");
                mean.add(f64::from(quotient / PI));
            }
            let z = lumiris_numbers::estimators::stats::z_test(mean.mean(), 1.0, mean.standard_error());
            assert!((mean.mean() - 1.0).abs() < 1e-5 || z.p_value > 1e-5, "{name} {wo}: {mean:?}");
        }
    }
    assert!(tested >= 24, "{tested}");
}
